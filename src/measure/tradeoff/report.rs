//! One row a setting, as the JSON file holds it.

use serde::{Deserialize, Serialize};

use super::Group;
use super::judging::TestGroup;
use super::settings::{AS_WRITTEN, Refused, Side};
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
    /// Made at every setting: those that train and those that stop.
    pub scenes: u64,
    /// What every classifier is judged on.
    pub test: Vec<TestGroup>,
    /// Share of the traversable cells called untraversable at which `missed` is told.
    pub false_share: f64,
    pub threads: u64,
    /// Trainings of a setting at a size, all rounds together.
    pub seeds: u64,
    /// Rounds of trainings and test scenes, and what ended them.
    pub rounds: u64,
    pub ended: Ended,
    /// Half-width that was asked for, as a share of balanced accuracy.
    pub resolve: Option<f64>,
    /// Of the gains that may still be the best, the one that is known least.
    pub widest: Option<Widest>,
    /// Gain beyond which a setting is told apart, for other draws alone gain as much. `None` where that was not measured.
    pub noise_floor: Option<f64>,
    /// How many times larger the variances of gains would be without common scenes, trainings and draws; median over settings.
    pub variance_ratio: Option<f64>,
    pub recommended_pipeline: Option<Recommendation>,
    pub recommended_filter: Option<Recommendation>,
    /// Inputs of the classifier.
    pub features: Vec<String>,
    pub rows: Vec<Row>,
    pub refused: Vec<Refused>,
}

/// What ended the rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Ended {
    /// One round was asked for.
    Once,
    /// Every gain that may be the best is known to the half-width that was asked for.
    Resolved,
    /// Another round would have taken longer than there was time.
    Time,
    /// Somebody interrupted it.
    Interrupted,
}

/// A gain by its setting, and the half-width of its interval of 95 %; `None` of one training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Widest {
    pub name: String,
    pub half_width: Option<f64>,
}

/// The setting to build with, and what it was worth on the most scenes that it was measured at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Recommendation {
    pub name: String,
    pub sets: Vec<String>,
    /// Against the reference at equal CPU; else nothing could be told apart for the better.
    pub is_told_better: bool,
    pub scenes: u64,
    pub cpu_s: f64,
    pub balanced_accuracy: Interval,
}

/// One setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    pub side: Side,
    pub group: Option<Group>,
    pub name: String,
    pub sets: Vec<String>,
    /// Not what changes the yard, and not poses that no rover knows.
    pub may_be_recommended: bool,
    pub pipeline: Option<PipelineRow>,
    pub worth: Option<WorthRow>,
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

/// What a setting is worth: classifiers trained at it, judged on the common test scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct WorthRow {
    /// By size, ascending.
    pub curve: Vec<CurveRow>,
    /// Of the reference, what is recommended and what else is told better, sizes beyond those at which settings are compared; told in the seconds of those.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub farther: Vec<CurveRow>,
    /// Against the reference at the largest CPU time that both reach on those scenes, in their own seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub farther_gain: Option<GainRow>,
    /// Mean balanced accuracy for the CPU time of the reference's largest size; at the own largest size where that costs less. `None` where
    /// the smallest size costs more.
    pub at_reference_cpu: Option<f64>,
    /// Against the reference of its side; `None` for that one, and where no cost is common to both.
    pub gain: Option<GainRow>,
    /// Scenes from which on more bring at most half a point, at the interval's upper end; `None` where that is not told.
    pub flat_from: Option<u64>,
}

/// A setting at a size. Means are over seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CurveRow {
    /// That train and that stop.
    pub scenes: u64,
    pub train_rows: f64,
    /// Rows of later epochs counted again.
    pub rows_learnt: f64,
    pub generate_cpu_s: f64,
    /// Looks at the rows that stop included.
    pub train_cpu_s: f64,
    pub learning_cpu_s: f64,
    /// Mean of the held-out families, or of the own kinds where there are none.
    pub balanced_accuracy: Interval,
    pub by_seed: Vec<f64>,
    /// On the own kinds of yard alone.
    pub own: Option<f64>,
    /// The held-out family that is judged worst.
    pub worst: Option<WorstRow>,
    /// Share of the untraversable missed at the report's `false_share`, mean of the groups that judge.
    pub missed: Interval,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct WorstRow {
    pub family: String,
    pub balanced_accuracy: f64,
}

/// What a setting gains on the reference for the same seconds of CPU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct GainRow {
    pub cpu_s: f64,
    /// Scenes that each has made for it.
    pub scenes: u64,
    pub reference_scenes: u64,
    pub balanced_accuracy: Interval,
    /// How much less of the untraversable is missed at the report's `false_share`, as a share.
    pub fewer_missed: Interval,
    /// By balanced accuracy.
    pub told: Told,
}

/// Whether a gain can be told from nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Told {
    Better,
    Worse,
    NotApart,
    /// One training says nothing of others.
    OneSeed,
}

impl Row {
    /// Group and name.
    pub(crate) fn label(&self) -> String {
        self.group.map_or(self.name.clone(), |group| format!("{}: {}", group.name(), self.name))
    }

    pub(super) fn is_as_written(&self) -> bool {
        self.group == Some(Group::Presets) && self.name == AS_WRITTEN
    }

    /// At the largest size.
    pub(super) fn whole(&self) -> Option<&CurveRow> {
        self.worth.as_ref()?.curve.last()
    }

    /// What is told of it against the reference, by its last gain.
    pub(crate) fn told(&self) -> Option<Told> {
        self.last_gain().map(|gain| gain.told)
    }

    /// Its gain on the most scenes that it and the reference were measured at.
    pub(crate) fn last_gain(&self) -> Option<&GainRow> {
        let worth = self.worth.as_ref()?;
        worth.farther_gain.as_ref().or(worth.gain.as_ref())
    }

    pub(super) fn gain(&self) -> Option<&GainRow> {
        self.worth.as_ref()?.gain.as_ref()
    }
}

impl WorthRow {
    /// Those at which all settings are compared, and those beyond.
    pub(super) fn sizes(&self) -> impl DoubleEndedIterator<Item = &CurveRow> {
        self.curve.iter().chain(&self.farther)
    }
}

impl CurveRow {
    /// Making the scenes, and training.
    pub(crate) fn cpu_s(&self) -> f64 {
        self.generate_cpu_s + self.train_cpu_s
    }

    /// Tells seconds of making scenes, and of training, in those of another measurement.
    pub(super) fn scale_cpu_s(&mut self, making: f64, training: f64) {
        self.generate_cpu_s *= making;
        self.train_cpu_s *= training;
        self.learning_cpu_s *= training;
    }
}

impl Report {
    /// The rows of a side.
    pub(crate) fn side(&self, side: Side) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(move |row| row.side == side)
    }

    /// What classifiers are compared by, in words.
    pub(crate) fn judged_by(&self) -> String {
        match self.test.iter().filter(|group| group.judges && group.held_out.is_some()).count() {
            0 => "unseen yards of the config".into(),
            1 => "the held-out family".into(),
            count => format!("the mean of {count} held-out families"),
        }
    }

    /// With every time taken out, and what is told of equal times: what is the same for any number of threads.
    #[cfg(test)]
    pub(crate) fn timeless(&self) -> Report {
        let nothing = (None, None, None, None);
        let mut report = Report { threads: 0, ..self.clone() };
        (report.noise_floor, report.variance_ratio, report.recommended_pipeline, report.recommended_filter) = nothing;
        report.widest = None;
        for row in &mut report.rows {
            if let Some(pipeline) = &mut row.pipeline {
                (pipeline.cpu_ms, pipeline.wall_ms) = (None, None);
                pipeline.stages.clear();
            }
            if let Some(worth) = &mut row.worth {
                (worth.gain, worth.at_reference_cpu, worth.farther_gain) = (None, None, None);
                for size in worth.curve.iter_mut().chain(&mut worth.farther) {
                    (size.generate_cpu_s, size.train_cpu_s, size.learning_cpu_s) = (0.0, 0.0, 0.0);
                }
            }
        }
        report
    }
}
