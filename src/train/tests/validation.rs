//! What the validation split gives to a look.

use std::sync::Arc;

use super::fixture::{circles, params, sources, with};
use crate::corpus::Split;
use crate::random::{Stage, Streams};
use crate::train::Network;
use crate::train::rows::{LeftOut, Rows};
use crate::train::scaling::scaler;
use crate::train::validation::{Objective, Validation, each_group};

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
        let looked_at = validation.looked_at.rows();
        assert!(looked_at.len() as u64 >= look_rows.min(rows as u64));
        let expected: Vec<&[f32]> = (0..rows).step_by(every).map(|row| all.row(row)).collect();
        assert_eq!(looked_at.features, expected.concat());
        let labels: Vec<_> = all.labels.iter().step_by(every).copied().collect();
        assert_eq!(looked_at.labels, labels);
    }
}

#[test]
fn equal_a_look_has_the_same_bits_whether_its_rows_were_scaled_before_or_not() {
    let dir = tempfile::tempdir().unwrap();
    // More rows than one partial sum has, and no whole number of them.
    let places = [circles(&dir, "a", 2_500)];
    let batches = ["filter={kronecker: {}}", "network.normal_scores=true", "clip=1.5"];
    for (sets, columns) in [(&batches[..], 6), (&["filter={ekf: {}}"][..], 3)] {
        let params = with(sets);
        let sources = Arc::new(sources(&places, &params).unwrap());
        let stored = Validation::open(&sources, 1 << 40).unwrap();
        let (scaler, _) = scaler(&sources, &params).unwrap();
        let objective = Objective::new(scaler, &params, &[[1, 2]], &[1.0]);
        let streams = Streams { seed: 3, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
        let network = Network::random(params.layout(3), &streams);
        let rows = stored.looked_at.rows();
        let (rows, error) = (rows.len(), objective.sum(&network, rows).mean());
        assert_eq!(stored.error(&objective, &network).to_bits(), error.to_bits());
        let scaled = stored.for_looks_by(&objective);
        assert_eq!((scaled.looked_at.rows().width, scaled.looked_at.rows().features.len()), (columns, columns * rows));
        assert!(error > 0.0);
        assert_eq!(scaled.error(&objective, &network).to_bits(), error.to_bits(), "{sets:?}");
    }
}
