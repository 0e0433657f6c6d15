//! The columns of a row group of `cells` -> the cells of a scan, with the model's inputs, or why one cannot be judged.

use super::judge::{Cell, Judge};
use crate::cells::{HEIGHT_DIFFERENCE, LabelRule};
use crate::corpus::cells::{
    CLASS, CellBatch, Features, KEYS, Keys, LABEL, Labels, OBSTACLE_POINTS, POINTS, RANGE_M, TOP_POINTS, TruthColumns,
    projection, rule_truth,
};
use crate::corpus::reader::TableFile;
use crate::train::Model;

/// One scan in the making.
#[derive(Default)]
pub(super) struct Scan {
    pub key: Option<(i64, i32)>,
    pub cells: Vec<Cell>,
    pub features: Vec<f32>,
}

/// The columns to read of a file; `Err` names one that it lacks.
pub(super) fn wanted<'n>(file: &TableFile, model: &'n Model, rule: Option<&LabelRule>) -> Result<Vec<&'n str>, String> {
    let truth = rule_truth(rule);
    let needed = KEYS.into_iter().chain([LABEL, POINTS, RANGE_M]).chain(truth.iter().copied());
    let features = model.about.features.iter().map(String::as_str);
    projection(file, needed.chain(features), &[HEIGHT_DIFFERENCE, OBSTACLE_POINTS, TOP_POINTS, CLASS])
}

/// The columns of a row group.
pub(super) struct Columns<'b> {
    keys: Keys<'b>,
    labels: Labels<'b>,
    points: &'b [i32],
    ranges_m: &'b [f32],
    height_differences_m: Option<&'b [f32]>,
    truth: TruthColumns<'b>,
    features: Features<'b>,
    rule: Option<&'b LabelRule>,
    /// The model knows nothing of cells without points.
    seen_alone: bool,
}

impl<'b> Columns<'b> {
    pub(super) fn of(cells: &'b CellBatch, model: &Model, rule: Option<&'b LabelRule>) -> Result<Columns<'b>, String> {
        Ok(Columns {
            keys: cells.keys()?,
            labels: cells.labels()?,
            points: cells.points()?,
            ranges_m: cells.ranges_m()?,
            height_differences_m: cells.feature_if_there(HEIGHT_DIFFERENCE)?,
            truth: cells.truth(rule_truth(rule))?,
            features: cells.features(model.about.features.iter().map(String::as_str))?,
            rule,
            seen_alone: !model.takes_unseen(),
        })
    }

    /// Scene and scan of a row.
    pub(super) fn scan(&self, row: usize) -> (i64, i32) {
        (self.keys.scenes[row], self.keys.scans[row])
    }

    /// Adds a row to its scan, or counts why it cannot be judged; a cell without points counts where the model takes such.
    pub(super) fn push(&self, row: usize, scan: &mut Scan, judge: &mut Judge) {
        if self.seen_alone && self.points[row] == 0 {
            return;
        }
        let Some(stored) = self.labels.at(row) else {
            judge.unknown_cells += 1;
            return;
        };
        if !self.features.append_finite(row, &mut scan.features) {
            judge.not_finite_cells += 1;
            return;
        }
        let truth = self.truth.at(row);
        scan.cells.push(Cell {
            index: self.keys.index(row),
            label: self.rule.map_or(stored, |rule| rule.label(&truth)),
            points: self.points[row],
            range_m: self.ranges_m[row],
            height_difference_m: self.height_differences_m.map_or(0.0, |values| values[row]),
            truth,
        });
    }
}
