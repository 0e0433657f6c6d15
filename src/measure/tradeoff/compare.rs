//! The cells of one scene at two settings -> which changed their label, and by how much features shifted.
//!
//! Cells are the same where scan, row and col are. One that only one setting has is counted apart and not compared.

use crate::cells::Label;
use crate::episode::ScanOutput;
use crate::train::rows::Rows;

/// Where a cell is: scan, row, col.
pub(super) type Key = (u32, i32, i32);

/// The cells of one scene, ascending by key, with the features that the classifier sees.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SceneCells {
    pub keys: Vec<Key>,
    pub labels: Vec<Option<Label>>,
    pub width: usize,
    /// Row-major.
    pub features: Vec<f32>,
}

impl SceneCells {
    /// `columns`: the features to keep, by position.
    pub(super) fn of(scans: &[ScanOutput], columns: &[usize]) -> SceneCells {
        let count = scans.iter().map(|scan| scan.cells.rows.len()).sum();
        let mut cells = SceneCells {
            keys: Vec::with_capacity(count),
            labels: Vec::with_capacity(count),
            width: columns.len(),
            features: Vec::with_capacity(count * columns.len()),
        };
        for scan in scans {
            let all = scan.cells.features.len() / scan.cells.rows.len().max(1);
            for (row, features) in scan.cells.rows.iter().zip(scan.cells.features.chunks_exact(all.max(1))) {
                cells.keys.push((scan.scan_id, row.index.row, row.index.col));
                cells.labels.push(row.label);
                cells.features.extend(columns.iter().map(|&column| features[column]));
            }
        }
        cells
    }

    pub(super) fn row(&self, row: usize) -> &[f32] {
        &self.features[row * self.width..][..self.width]
    }

    /// Adds the cells that can be learnt.
    pub(super) fn learn(&self, rows: &mut Rows) {
        for (row, &label) in self.labels.iter().enumerate() {
            let Some(label) = label else {
                rows.left_out.unlabelled += 1;
                continue;
            };
            if self.row(row).iter().any(|value| !value.is_finite()) {
                rows.left_out.not_finite += 1;
            } else {
                rows.features.extend(self.row(row));
                rows.labels.push(label);
                rows.corpora.push(0);
            }
        }
    }
}

/// What differs from the reference.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Change {
    pub matched: u64,
    pub appeared: u64,
    pub vanished: u64,
    pub other_label: u64,
    /// Per feature, of the matched cells: sums of the shift and of its square.
    pub shift: Vec<f64>,
    pub shift_squared: Vec<f64>,
}

impl Change {
    pub(super) fn new(width: usize) -> Change {
        Change { shift: vec![0.0; width], shift_squared: vec![0.0; width], ..Change::default() }
    }

    pub(super) fn merge(&mut self, more: &Change) {
        self.matched += more.matched;
        self.appeared += more.appeared;
        self.vanished += more.vanished;
        self.other_label += more.other_label;
        for (sums, more) in [(&mut self.shift, &more.shift), (&mut self.shift_squared, &more.shift_squared)] {
            sums.iter_mut().zip(more).for_each(|(sum, value)| *sum += value);
        }
    }
}

/// What `other` changes of `reference`.
pub(super) fn compare(reference: &SceneCells, other: &SceneCells) -> Change {
    let mut change = Change::new(reference.width);
    let (mut a, mut b) = (0, 0);
    while a < reference.keys.len() && b < other.keys.len() {
        match reference.keys[a].cmp(&other.keys[b]) {
            std::cmp::Ordering::Less => {
                change.vanished += 1;
                a += 1;
            }
            std::cmp::Ordering::Greater => {
                change.appeared += 1;
                b += 1;
            }
            std::cmp::Ordering::Equal => {
                change.matched += 1;
                change.other_label += u64::from(reference.labels[a] != other.labels[b]);
                for (k, (old, new)) in reference.row(a).iter().zip(other.row(b)).enumerate() {
                    let shift = f64::from(*new) - f64::from(*old);
                    change.shift[k] += shift;
                    change.shift_squared[k] += shift * shift;
                }
                a += 1;
                b += 1;
            }
        }
    }
    change.vanished += (reference.keys.len() - a) as u64;
    change.appeared += (other.keys.len() - b) as u64;
    change
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(list: &[(Key, i8, f32)]) -> SceneCells {
        SceneCells {
            keys: list.iter().map(|cell| cell.0).collect(),
            labels: list.iter().map(|cell| Label::of_number(cell.1)).collect(),
            width: 1,
            features: list.iter().map(|cell| cell.2).collect(),
        }
    }

    #[test]
    fn exact_cells_are_matched_by_scan_row_and_col() {
        let reference = cells(&[((0, -1, 5), 0, 1.0), ((0, 2, 3), 1, 2.0), ((3, -4, 0), 0, 0.5), ((3, 0, 0), 0, 4.0)]);
        let other = cells(&[((0, 2, 2), 1, 9.0), ((0, 2, 3), 0, 2.5), ((3, -4, 0), 0, 0.25), ((4, 0, 0), 1, 7.0)]);
        let change = compare(&reference, &other);
        assert_eq!((change.matched, change.vanished, change.appeared, change.other_label), (2, 2, 2, 1));
        assert_eq!((change.shift, change.shift_squared), (vec![0.25], vec![0.25 + 0.0625]));
    }

    #[test]
    fn law_nothing_differs_from_itself_and_everything_from_nothing() {
        let some = cells(&[((0, 0, 0), 0, 1.0), ((0, 0, 1), 1, 2.0)]);
        let same = Change { matched: 2, ..Change::new(1) };
        assert_eq!(compare(&some, &some), same);
        assert_eq!(compare(&some, &cells(&[])), Change { vanished: 2, ..Change::new(1) });
        assert_eq!(compare(&cells(&[]), &some).appeared, 2);
    }

    #[test]
    fn exact_cells_that_cannot_be_learnt_are_counted_and_left_out() {
        let mut rows = Rows::new(1);
        cells(&[((0, 0, 0), -1, 1.0), ((0, 0, 1), 1, f32::NAN), ((0, 0, 2), 1, 3.0)]).learn(&mut rows);
        assert_eq!((rows.len(), rows.left_out.unlabelled, rows.left_out.not_finite), (1, 1, 1));
    }
}
