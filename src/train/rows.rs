//! Batches of the `cells` table -> rows as the trainer holds them.
//!
//! A row whose label is unknown, and a row with a value that is not finite, are counted and left out.

use crate::cells::{Label, LabelRule};
use crate::corpus::cells::{CellBatch, rule_truth};

/// Rows that can be learnt, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Features a row.
    pub width: usize,
    /// Row-major, as stored.
    pub features: Vec<f32>,
    pub labels: Vec<Label>,
    /// The corpus that each row comes from.
    pub corpora: Vec<u16>,
    pub left_out: LeftOut,
}

/// What is wanted of a batch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted<'w> {
    pub features: &'w [String],
    /// Another rule than the corpus's.
    pub rule: Option<&'w LabelRule>,
    /// Cells without points are passed by, and counted nowhere.
    pub seen_alone: bool,
}

/// Rows that are there and cannot be learnt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct LeftOut {
    /// Their label is null.
    pub unlabelled: u64,
    /// A feature is NaN or infinite.
    pub not_finite: u64,
}

impl std::ops::AddAssign for LeftOut {
    fn add_assign(&mut self, other: LeftOut) {
        self.unlabelled += other.unlabelled;
        self.not_finite += other.not_finite;
    }
}

/// What all rows are, where they are of one class. `counts`: traversable and untraversable rows.
pub(crate) fn only_class(counts: [u64; 2]) -> Option<&'static str> {
    match counts {
        [0, 0] => None,
        [_, 0] => Some("traversable"),
        [0, _] => Some("untraversable"),
        _ => None,
    }
}

impl Rows {
    pub fn new(width: usize) -> Rows {
        Rows { width, ..Rows::default() }
    }

    /// Without rows, of another width, with the memory they had.
    pub(crate) fn clear(&mut self, width: usize) {
        self.truncate(0);
        (self.width, self.left_out) = (width, LeftOut::default());
    }

    pub fn len(&self) -> usize {
        self.labels.len()
    }

    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Rows of each class.
    pub(crate) fn counts(&self) -> [u64; 2] {
        let untraversable = self.labels.iter().filter(|label| **label == Label::Untraversable).count();
        [self.len() - untraversable, untraversable].map(|count| count as u64)
    }

    /// Keeps the first rows.
    pub(crate) fn truncate(&mut self, count: usize) {
        self.features.truncate(count * self.width);
        self.labels.truncate(count);
        self.corpora.truncate(count);
    }

    /// Of the rows from `first` on, keeps those with these numbers, counted from it and ascending.
    pub(crate) fn keep_of_last(&mut self, first: usize, kept: &[u32]) {
        for (to, from) in (first..).zip(kept.iter().map(|&row| first + row as usize)) {
            self.features.copy_within(from * self.width..(from + 1) * self.width, to * self.width);
            self.labels[to] = self.labels[from];
            self.corpora[to] = self.corpora[from];
        }
        self.truncate(first + kept.len());
    }

    /// Adds a row of others.
    pub(crate) fn push_row(&mut self, of: &Rows, row: usize) {
        self.features.extend_from_slice(of.row(row));
        self.labels.push(of.labels[row]);
        self.corpora.push(of.corpora[row]);
    }

    /// Every so many-th row.
    pub(crate) fn thinned(self, every: usize) -> Rows {
        if every == 1 {
            return self;
        }
        let mut kept = Rows { left_out: self.left_out, ..Rows::new(self.width) };
        (0..self.len()).step_by(every).for_each(|row| kept.push_row(&self, row));
        kept
    }

    /// Bytes that the rows take.
    pub(crate) fn bytes(&self) -> usize {
        4 * self.features.len() + self.labels.len() + 2 * self.corpora.len()
    }

    pub(crate) fn row(&self, row: usize) -> &[f32] {
        &self.features[row * self.width..][..self.width]
    }

    /// Adds the rows of a batch; `Err` names the column that is not as it must be.
    pub(crate) fn push(&mut self, cells: &CellBatch, wanted: &Wanted, corpus: u16) -> Result<(), String> {
        let Wanted { features, rule, seen_alone } = *wanted;
        let points = seen_alone.then(|| cells.points()).transpose()?;
        let features = cells.features(features.iter().map(String::as_str))?;
        let stored = cells.labels()?;
        let relabel = rule.map(|rule| cells.truth(rule_truth(Some(rule))).map(|truth| (rule, truth))).transpose()?;
        for row in (0..cells.rows()).filter(|&row| points.is_none_or(|points| points[row] > 0)) {
            let Some(label) = stored.at(row) else {
                self.left_out.unlabelled += 1;
                continue;
            };
            if !features.append_finite(row, &mut self.features) {
                self.left_out.not_finite += 1;
                continue;
            }
            self.labels.push(relabel.map_or(label, |(rule, truth)| rule.label(&truth.at(row))));
            self.corpora.push(corpus);
        }
        Ok(())
    }
}

/// Every so many-th of all rows is taken, so that `count` are left, or nearly twice as many.
pub(crate) fn stride(rows: u64, count: u64) -> u64 {
    (rows / count).max(1)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float32Array, Int8Array, RecordBatch};

    use super::*;

    fn batch(columns: Vec<(&str, ArrayRef)>) -> CellBatch {
        let columns = columns.into_iter().map(|(name, array)| (name, array, true));
        CellBatch::of(RecordBatch::try_from_iter_with_nullable(columns).unwrap())
    }

    #[test]
    fn exact_unknown_labels_and_values_that_are_not_finite_are_counted_and_left_out() {
        let a = Float32Array::from(vec![Some(1.0), Some(f32::NAN), Some(3.0), Some(4.0), None]);
        let b = Float32Array::from(vec![5.0, 6.0, f32::NEG_INFINITY, 8.0, 9.0]);
        let label = Int8Array::from(vec![Some(1), Some(0), Some(1), None, Some(0)]);
        let batch = batch(vec![("a", Arc::new(a)), ("b", Arc::new(b)), ("label", Arc::new(label))]);
        let mut rows = Rows::new(2);
        let features = ["b".to_owned(), "a".to_owned()];
        rows.push(&batch, &Wanted { features: &features, rule: None, seen_alone: false }, 3).unwrap();
        assert_eq!((rows.features, rows.labels, rows.corpora), (vec![5.0, 1.0], vec![Label::Untraversable], vec![3]));
        assert_eq!(rows.left_out, LeftOut { unlabelled: 1, not_finite: 3 });
    }

    #[test]
    fn exact_cells_without_points_are_passed_by_where_they_are_not_wanted() {
        let a = Float32Array::from(vec![1.0, 2.0, 3.0]);
        let (label, points) = (Int8Array::from(vec![1, 0, 0]), arrow_array::Int32Array::from(vec![4, 0, 1]));
        let batch = batch(vec![("a", Arc::new(a)), ("label", Arc::new(label)), ("points", Arc::new(points))]);
        let features = ["a".to_owned()];
        for (seen_alone, values) in [(true, vec![1.0, 3.0]), (false, vec![1.0, 2.0, 3.0])] {
            let mut rows = Rows::new(1);
            rows.push(&batch, &Wanted { features: &features, rule: None, seen_alone }, 0).unwrap();
            assert_eq!((rows.features, rows.left_out), (values, LeftOut::default()));
        }
    }

    #[test]
    fn extreme_columns_that_are_absent_or_of_another_type_are_named() {
        let there =
            batch(vec![("a", Arc::new(Int8Array::from(vec![1]))), ("label", Arc::new(Int8Array::from(vec![7])))]);
        let push = |features: &[&str]| {
            let features: Vec<String> = features.iter().map(|f| (*f).to_owned()).collect();
            let wanted = Wanted { features: &features, rule: None, seen_alone: false };
            Rows::new(features.len()).push(&there, &wanted, 0).unwrap_err()
        };
        assert_eq!(push(&["b"]), "it has no column 'b'");
        assert_eq!(push(&["a"]), "its column 'a' is Int8, not Float32");
        assert_eq!(push(&[]), "its column 'label' holds 7; labels are 0, 1 or null");
    }
}
