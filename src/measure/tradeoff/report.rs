//! One row a setting, as the JSON file holds it.

use serde::{Deserialize, Serialize};

use super::Group;
use super::settings::{Refused, Side};
use crate::statistics::{Interval, Spread};

/// The file `tradeoff.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Report {
    /// Version of this format.
    pub marsyard_tradeoff: u32,
    pub version: String,
    pub commit: String,
    pub name: String,
    /// Of the reference's plan.
    pub scene_plan_hash: String,
    /// Overrides that hold at every setting.
    pub sets: Vec<String>,
    pub scenes: u64,
    pub test_cells: u64,
    pub train_cells: u64,
    pub threads: u64,
    pub seeds: u64,
    pub max_loss: f64,
    /// Name of the cheapest pipeline, and of the cheapest filter, whose loss is within `max_loss`.
    pub cheapest_pipeline: Option<String>,
    pub cheapest_filter: Option<String>,
    /// Inputs of the classifier.
    pub features: Vec<String>,
    pub rows: Vec<Row>,
    pub refused: Vec<Refused>,
}

/// One setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    pub side: Side,
    pub group: Option<Group>,
    pub name: String,
    pub sets: Vec<String>,
    /// On the Pareto front of its side; changes of the yard are on none.
    pub on_front: bool,
    pub pipeline: Option<PipelineRow>,
    pub classifier: Option<ClassifierRow>,
}

/// What the pipeline does at a setting. Spreads are over scenes, or over scans where it says so.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PipelineRow {
    pub scenes: u64,
    pub failed: u64,
    /// Milliseconds a kept scan.
    pub cpu_ms: Option<Spread>,
    pub wall_ms: Option<Spread>,
    pub stages: Vec<StageRow>,
    pub rays_per_scan: Option<f64>,
    pub ranges: Option<RangeRow>,
    pub pose: Option<PoseRow>,
    pub drive: Option<DriveRow>,
    pub cells: Option<CellRow>,
    /// Share of its cells that are untraversable.
    pub untraversable: Option<f64>,
    pub cells_per_scan: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StageRow {
    pub stage: String,
    pub cpu_ms: Option<Spread>,
    pub wall_ms: Option<Spread>,
}

/// Ranges against the exact surface, before noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RangeRow {
    pub rays: u64,
    pub median_m: Option<f64>,
    pub p99_m: Option<f64>,
    pub max_m: f64,
    pub missed: u64,
    pub invented: u64,
    pub other_object: u64,
}

/// Estimates against the truth, at kept scans.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PoseRow {
    pub scans: u64,
    pub position_m: Option<Spread>,
    pub heading_deg: Option<Spread>,
    /// Mean over scans; 6 where the covariance is honest. `None` where none is claimed.
    pub mean_nees: Option<f64>,
    pub nees: Option<Spread>,
}

/// Where the rover truly stands against where the reference's does, at kept scans.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct DriveRow {
    pub median_position_m: Option<f64>,
    pub max_position_m: f64,
    pub median_turn_deg: Option<f64>,
    pub max_turn_deg: f64,
}

/// Cells against the reference's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CellRow {
    pub matched: u64,
    pub appeared: u64,
    pub vanished: u64,
    /// Share of the matched cells.
    pub other_label: f64,
    /// Scenes whose kept scan is another attempt's: nothing is matched there.
    pub scenes_of_another_attempt: u64,
    /// The feature that shifted most, and its root mean square shift in the reference's standard deviations.
    pub worst_feature: String,
    pub worst_shift_sd: f64,
    pub shifts: Vec<ShiftRow>,
}

/// Shift of a feature over the matched cells, in the reference's standard deviations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ShiftRow {
    pub feature: String,
    pub mean_sd: f64,
    pub rms_sd: f64,
}

/// A classifier trained at a setting, judged on the reference's test cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ClassifierRow {
    pub train_rows: u64,
    pub balanced_accuracy: Vec<Option<f64>>,
    /// Lost against the reference, by pairs of equal seeds.
    pub loss: Option<Interval>,
    /// Over seeds.
    pub cpu_us_per_row: Option<Spread>,
    pub rows_learnt: Option<Spread>,
}

impl Row {
    /// Group and name.
    pub(crate) fn label(&self) -> String {
        self.group.map_or(self.name.clone(), |group| format!("{}: {}", group.name(), self.name))
    }

    /// What its side counts as cost: CPU milliseconds a kept scan, or CPU microseconds a row learnt; medians.
    pub(crate) fn cost(&self) -> Option<f64> {
        match self.side {
            Side::Trainer => self.classifier.as_ref()?.cpu_us_per_row.map(|spread| spread.median),
            _ => self.pipeline.as_ref()?.cpu_ms.map(|spread| spread.median),
        }
    }

    pub(crate) fn loss(&self) -> Option<Interval> {
        self.classifier.as_ref()?.loss
    }
}

impl ClassifierRow {
    /// Over seeds; `None` where the test lacks a class.
    pub(crate) fn mean_balanced_accuracy(&self) -> Option<f64> {
        let values = self.balanced_accuracy.iter().copied().collect::<Option<Vec<f64>>>()?;
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    }
}

impl Report {
    /// The rows of a side.
    pub(crate) fn side(&self, side: Side) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(move |row| row.side == side)
    }

    /// With every time taken out: what is the same for any number of threads.
    #[cfg(test)]
    pub(crate) fn timeless(&self) -> Report {
        let mut report = Report { threads: 0, cheapest_pipeline: None, cheapest_filter: None, ..self.clone() };
        for row in &mut report.rows {
            row.on_front = false;
            if let Some(pipeline) = &mut row.pipeline {
                (pipeline.cpu_ms, pipeline.wall_ms) = (None, None);
                pipeline.stages.clear();
            }
            if let Some(classifier) = &mut row.classifier {
                classifier.cpu_us_per_row = None;
            }
        }
        report
    }
}
