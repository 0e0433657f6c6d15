//! What a model said of the cells of one scan, and what the labels of the cloud say of them.

use crate::cells::{CellRow, Cells};
use crate::evaluate::Cell;
use crate::geometry::{CellIndex, GridSpec};

/// What so many classes are called, from the most traversable on.
pub(crate) fn class_names(classes: usize) -> Vec<String> {
    match classes {
        2 => ["traversable", "untraversable"].map(String::from).into(),
        3 => ["traversable", "doubtful", "untraversable"].map(String::from).into(),
        _ => (0..classes).map(|class| format!("class {class}")).collect(),
    }
}

/// The cells of one scan and what a model said of them.
#[derive(Clone, Debug)]
pub struct JudgedCells {
    /// The scan's name, for messages and titles.
    pub scan: String,
    pub cells: Cells,
    /// Of each cell's points, those with a verdict by their label.
    pub known_points: Vec<i32>,
    /// The model's inputs, cell by cell.
    pub inputs: Vec<f32>,
    /// One a cell: the network's output, `None` where the cell is not judged (too few points, or a feature that is not finite).
    pub outputs: Vec<Option<f64>>,
    /// One a cell: how probable it is that it is untraversable; `None` where the cell is not judged, or the model has no calibration.
    pub probabilities: Vec<Option<f64>>,
    /// One a cell: how many thresholds the output reaches.
    pub classes: Vec<Option<usize>>,
    /// Number of classes.
    pub of_classes: usize,
    /// Outputs for traversable and untraversable in training: the ends of the scale from light to dark.
    pub targets: [f64; 2],
    pub grid: GridSpec,
    /// What mean heights are measured from.
    pub rover_z_m: f64,
}

impl JudgedCells {
    /// Cells of a class; of none: those that were not judged.
    pub fn count(&self, class: Option<usize>) -> usize {
        self.classes.iter().filter(|&&there| there == class).count()
    }

    /// What the classes are called, from the most traversable on.
    pub fn class_names(&self) -> Vec<String> {
        class_names(self.of_classes)
    }

    /// The number of a cell's row.
    pub(crate) fn find(&self, cell: CellIndex) -> Option<usize> {
        self.cells.rows.binary_search_by_key(&cell, |row| row.index).ok()
    }

    /// The direct output as a shade: 0 light (traversable) to 1 dark, linear between the targets (paper, figure 12c).
    pub(crate) fn shade(&self, row: usize) -> Option<f64> {
        let [light, dark] = self.targets;
        self.outputs[row].map(|output| ((output - light) / (dark - light)).clamp(0.0, 1.0))
    }

    /// The class as a shade: the first is 0, the last 1.
    pub(crate) fn class_shade(&self, row: usize) -> Option<f64> {
        let last = self.of_classes.saturating_sub(1).max(1);
        self.classes[row].map(|class| class as f64 / last as f64)
    }

    /// Mean height of a cell, frame map.
    pub(crate) fn mean_z_m(&self, row: usize) -> f64 {
        // The mean height is the first feature.
        self.rover_z_m + f64::from(self.feature(row, 0))
    }

    /// The cells that have a label and a judgement, as an evaluation takes them, with their outputs. `height_difference`: the number of
    /// that feature.
    pub(super) fn scored(&self, height_difference: Option<usize>) -> (Vec<Cell>, Vec<f64>) {
        let cell = |(i, row): (usize, &CellRow)| {
            let cell = Cell {
                index: row.index,
                label: row.label?,
                points: self.known_points[i],
                range_m: row.range_m,
                truth: row.truth,
                height_difference_m: height_difference.map_or(0.0, |feature| self.feature(i, feature)),
            };
            Some((cell, self.outputs[i]?))
        };
        self.cells.rows.iter().enumerate().filter_map(cell).unzip()
    }

    fn feature(&self, row: usize, feature: usize) -> f32 {
        let width = self.cells.features.len() / self.cells.rows.len().max(1);
        self.cells.features[row * width + feature]
    }
}
