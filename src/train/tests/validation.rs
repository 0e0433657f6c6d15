//! What the validation split gives to a look.

use std::sync::Arc;

use super::fixture::{circles, params, sources};
use crate::corpus::Split;
use crate::train::rows::{LeftOut, Rows};
use crate::train::validation::{Validation, each_group};

#[test]
fn exact_looks_take_every_so_many_th_row_of_a_split_that_holds_more_and_all_are_counted() {
    let dir = tempfile::tempdir().unwrap();
    let sources = Arc::new(sources(&[circles(&dir, "a", 300)], &params()).unwrap());
    let mut all = Rows::new(3);
    each_group(Arc::clone(&sources), Split::Validation, |part| {
        all.features.extend(part.features);
        all.labels.extend(part.labels);
    })
    .unwrap();
    let rows = all.len();
    for (look_rows, every) in [(rows as u64, 1), (1 << 40, 1), (rows as u64 / 2, 2), (90, rows / 90)] {
        let validation = Validation::open(&sources, look_rows).unwrap();
        assert_eq!((validation.rows, validation.left_out), (rows as u64, LeftOut::default()));
        assert!(validation.looked_at.len() as u64 >= look_rows.min(rows as u64));
        let expected: Vec<&[f32]> = (0..rows).step_by(every).map(|row| all.row(row)).collect();
        assert_eq!(validation.looked_at.features, expected.concat());
        let labels: Vec<_> = all.labels.iter().step_by(every).copied().collect();
        assert_eq!(validation.looked_at.labels, labels);
    }
}
