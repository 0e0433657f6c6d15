//! The columns of a row group of `cells` -> the cells of its scans, with the model's inputs, or why one cannot be judged.

use super::cell::Cell;
use crate::cells::{HEIGHT_DIFFERENCE, LabelRule};
use crate::corpus::cells::{
    CLASS, CellBatch, Features, KEYS, Keys, LABEL, Labels, OBSTACLE_POINTS, POINTS, RANGE_M, TOP_POINTS, TruthColumns,
    projection, rule_truth,
};
use crate::corpus::reader::TableFile;
use crate::train::Model;

/// Scans one after another.
#[derive(Default)]
pub(super) struct Scans {
    /// Of each scan, scene and number, and how many of the cells are up to its end.
    pub ends: Vec<((i64, i32), usize)>,
    pub cells: Vec<Cell>,
    /// One row a cell.
    pub features: Vec<f32>,
    /// Cells that cannot be judged: without a known label, and with a feature that is NaN or infinite.
    pub unknown_cells: u64,
    pub not_finite_cells: u64,
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

    /// The scans of those scenes that are wanted; counts what cannot be judged.
    pub(super) fn scans(&self, wanted_scene: impl Fn(i64) -> bool) -> Scans {
        let mut scans = Scans::default();
        for row in (0..self.points.len()).filter(|&row| wanted_scene(self.keys.scenes[row])) {
            self.push(row, &mut scans);
        }
        scans
    }

    /// Adds a row to its scan, or counts why it cannot be judged; a cell without points counts where the model takes such.
    fn push(&self, row: usize, scans: &mut Scans) {
        if self.seen_alone && self.points[row] == 0 {
            return;
        }
        let Some(stored) = self.labels.at(row) else {
            scans.unknown_cells += 1;
            return;
        };
        if !self.features.append_finite(row, &mut scans.features) {
            scans.not_finite_cells += 1;
            return;
        }
        let truth = self.truth.at(row);
        scans.cells.push(Cell {
            index: self.keys.index(row),
            label: self.rule.map_or(stored, |rule| rule.label(&truth)),
            points: self.points[row],
            range_m: self.ranges_m[row],
            height_difference_m: self.height_differences_m.map_or(0.0, |values| values[row]),
            truth,
        });
        let (key, end) = ((self.keys.scenes[row], self.keys.scans[row]), scans.cells.len());
        match scans.ends.last_mut().filter(|last| last.0 == key) {
            Some(last) => last.1 = end,
            None => scans.ends.push((key, end)),
        }
    }
}
