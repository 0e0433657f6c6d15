//! What was gathered -> a report: plain numbers, for `evaluation.json`, for the table and for the figures.

use serde::{Deserialize, Serialize};

use super::by_scene::{ByScene, OverScenes};
use super::confusion::{Confusion, Rates, Table1};
use super::figures::figures;
use super::judge::{CM_PER_M, Judge};
use super::lead::FamilySummary;
use super::places::PlacesReport;
use super::reliability::{Doubt, ReliabilityReport};
use super::spread::{Bin, Spread};
use super::tally::{Counts, Panel, Tally, WITH_TOPS, WITHOUT_TOPS};
use super::threshold::{Group, Threshold, asked};
use super::tops::MissedTops;
use crate::scene::Class;
use crate::statistics::scores::{BINS, RocPoint};
use crate::train::{Activation, Model};

/// How good a model is on some cells. No time, host or path: equal models and cells give equal reports.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    pub model: ModelFacts,
    pub data: DataFacts,
    /// Of the network's output; the first is the one for densities.
    pub thresholds: Vec<Threshold>,
    /// Of the height difference alone, metres.
    pub height_threshold_m: Option<Threshold>,
    /// How the areas under ROC curves were computed, and that ties count half.
    pub auc_method: String,
    /// All cells first, then those with at least 3 points, then by family and by sensor.
    pub groups: Vec<GroupReport>,
    /// How far the first rates of all cells can be told, at each threshold; empty in reports from before it was told.
    #[serde(default)]
    pub over_scenes: Vec<OverScenes>,
    /// Worst and mean of the families, where there is more than one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub families: Option<FamilySummary>,
    /// What is doubtful by the model's validation scenes, and how the rest fares; none for a model that has no calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doubt: Option<Doubt>,
    pub points_per_cell: SpreadReport,
    pub range_m: SpreadReport,
    /// Cells by their place from the rover, at the first threshold, where poses are known: drawn, and written as CSV, but not in the JSON.
    #[serde(skip)]
    pub places: Option<PlacesReport>,
    /// Cells by their true class (of what made the label, else of the tallest thing in them), at the first threshold: what is missed, what
    /// gives alarm.
    pub classes: Vec<ClassReport>,
    /// Missed tops of obstacles at each threshold.
    pub missed_tops: Vec<MissedTops>,
    /// The network's curve over all cells, thinned.
    pub roc: Vec<RocPoint>,
    /// The curve of the height difference alone.
    pub roc_height_difference: Vec<RocPoint>,
    /// What a reader must know before quoting a number.
    pub notes: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelFacts {
    pub features: Vec<String>,
    pub hidden: Vec<usize>,
    pub bias: bool,
    /// Networks of these layers, whose mean judges; 1 in reports from before there were several.
    #[serde(default = "crate::train::one_member")]
    pub members: usize,
    /// Of hidden neurons; logistic in reports from before there were others.
    #[serde(default)]
    pub activation: Activation,
    pub weights: usize,
    pub trained_on: Vec<String>,
    /// Of the first family that it learnt from.
    pub sensor: String,
    pub rover: String,
    /// Of the model's file, as `sha256sum` says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DataFacts {
    /// Name and id of the corpus; for scans from elsewhere, what the caller calls them.
    pub name: String,
    pub corpus_id: String,
    pub split: String,
    /// The rule that the labels follow.
    pub labels: String,
    pub scans: u64,
    pub unknown_cells: u64,
    pub not_finite_cells: u64,
    /// Families that the corpus holds out; not told in reports from before it was.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held_out: Vec<String>,
}

impl DataFacts {
    /// What stands behind the name of a family that is held out.
    pub(super) fn mark(&self, family: &str) -> &'static str {
        if self.held_out.iter().any(|name| name == family) { " (held out)" } else { "" }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupReport {
    pub group: Group,
    pub cells: u64,
    pub points: u64,
    pub network: Panels,
    /// One tuned threshold on the height difference.
    pub height_difference: Panels,
    /// Of the network's probabilities; none for a model that has no calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probabilities: Option<ReliabilityReport>,
}

/// One classifier in one group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Panels {
    pub auc: Option<f64>,
    /// The AUC is right to within this.
    pub auc_bound: f64,
    /// One a threshold.
    pub at: Vec<AtThreshold>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AtThreshold {
    pub threshold: Threshold,
    pub cells: Judged,
    /// Points with their cell's label.
    pub points: Judged,
    /// Points with their own truth.
    pub own_points: Judged,
    pub cells_without_tops: Judged,
    pub points_without_tops: Judged,
    pub own_points_without_tops: Judged,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    pub counts: Confusion,
    #[serde(flatten)]
    pub rates: Rates,
    pub table_1: Table1,
}

/// Cells of one true class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClassReport {
    pub class: String,
    pub counts: Confusion,
    #[serde(flatten)]
    pub rates: Rates,
}

/// Errors at the first threshold by a number of the cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpreadReport {
    pub bins: Vec<Bin>,
    /// Spearman's rho with being wrong, over all cells.
    pub rho_wrong: Option<f64>,
    /// Spearman's rho with being called untraversable, over the traversable cells.
    pub rho_false_untraversable: Option<f64>,
}

/// Points per cell: 1, 2, 3-4, 5-8, 9-16 ...
const POINT_BORDERS: [u32; 12] = [0, 1, 2, 3, 5, 9, 17, 33, 65, 129, 257, 513];

/// Ranges in centimetres.
const RANGE_BORDERS: [u32; 11] = [0, 100, 200, 300, 400, 600, 800, 1000, 1500, 2000, 3000];

/// More points of a curve show nothing more.
const ROC_POINTS: usize = 256;

impl Report {
    /// The file of it.
    pub const FILE: &str = "evaluation.json";

    /// What is written of it: [`Report::FILE`], the figures, and the squares that one of them shows.
    pub(crate) fn files(&self) -> Vec<(String, Vec<u8>)> {
        let figures = figures(self).into_iter().map(|(name, svg)| (name.to_string(), svg.into_bytes()));
        let places = self.places.iter().map(|places| ("error-by-place.csv".into(), places.csv().into_bytes()));
        std::iter::once((Report::FILE.into(), self.to_json().into_bytes())).chain(figures).chain(places).collect()
    }

    /// Closes the books.
    pub(crate) fn new(model: &Model, judge: &Judge, data: DataFacts, notes: Vec<String>) -> Report {
        let all = judge.groups.get(&Group::All);
        let curve = |panel: fn(&Tally) -> &Panel| all.map_or(Vec::new(), |t| thinned(&panel(t).scores.roc()));
        let groups: Vec<GroupReport> =
            judge.groups.iter().map(|(group, tally)| GroupReport::of(group, tally, judge)).collect();
        Report {
            model: ModelFacts::of(model),
            data: DataFacts { unknown_cells: judge.unknown_cells, not_finite_cells: judge.not_finite_cells, ..data },
            thresholds: judge.thresholds.clone(),
            height_threshold_m: judge.height_threshold,
            auc_method: format!(
                "by cells, from a histogram of {BINS} equal bins; equal scores and scores of one bin count half; auc_bound is \
                 the most that sharing a bin can change"
            ),
            over_scenes: judge.by_scene.iter().map(ByScene::report).collect(),
            families: FamilySummary::of(&groups, asked(&judge.thresholds)),
            groups,
            doubt: judge.doubt.clone(),
            points_per_cell: SpreadReport::of(&judge.by_points, &POINT_BORDERS, 1.0),
            places: judge.by_place.report(),
            range_m: SpreadReport::of(&judge.by_range, &RANGE_BORDERS, f64::from(CM_PER_M)),
            classes: judge.by_class.iter().map(|(&class, &counts)| ClassReport::of(class, counts)).collect(),
            missed_tops: judge.tops.clone(),
            roc: curve(|tally| &tally.network),
            roc_height_difference: curve(|tally| &tally.height),
            notes,
        }
    }

    /// `evaluation.json`.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a report is plain data") + "\n"
    }
}

impl ModelFacts {
    fn of(model: &Model) -> ModelFacts {
        let about = &model.about;
        ModelFacts {
            features: about.features.clone(),
            hidden: about.hidden.clone(),
            bias: about.bias,
            members: about.members,
            activation: about.activation,
            weights: model.network.weights.len(),
            trained_on: about.corpus_names.clone(),
            sensor: about.sensor.name.clone(),
            rover: about.rover.name.clone(),
            sha256: model.sha256.clone(),
        }
    }
}

impl GroupReport {
    fn of(group: &Group, tally: &Tally, judge: &Judge) -> GroupReport {
        GroupReport {
            group: group.clone(),
            cells: tally.cells,
            points: tally.points,
            network: Panels::of(&tally.network, &judge.thresholds),
            height_difference: Panels::of(&tally.height, judge.height_threshold.as_slice()),
            probabilities: tally.reliability.report(),
        }
    }
}

impl Panels {
    fn of(panel: &Panel, thresholds: &[Threshold]) -> Panels {
        let at = panel.at.iter().zip(thresholds).map(|(counts, &threshold)| AtThreshold::of(counts, threshold));
        Panels { auc: panel.scores.auc(), auc_bound: panel.scores.auc_bound(), at: at.collect() }
    }
}

impl AtThreshold {
    fn of(counts: &Counts, threshold: Threshold) -> AtThreshold {
        AtThreshold {
            threshold,
            cells: Judged::of(counts.cells[WITH_TOPS]),
            points: Judged::of(counts.points[WITH_TOPS]),
            own_points: Judged::of(counts.own_points[WITH_TOPS]),
            cells_without_tops: Judged::of(counts.cells[WITHOUT_TOPS]),
            points_without_tops: Judged::of(counts.points[WITHOUT_TOPS]),
            own_points_without_tops: Judged::of(counts.own_points[WITHOUT_TOPS]),
        }
    }
}

impl Judged {
    pub(super) fn of(counts: Confusion) -> Judged {
        Judged { counts, rates: counts.rates(), table_1: counts.table_1() }
    }
}

impl ClassReport {
    fn of(class: Class, counts: Confusion) -> ClassReport {
        ClassReport { class: class.name().into(), counts, rates: counts.rates() }
    }
}

impl SpreadReport {
    fn of(spread: &Spread, borders: &[u32], unit: f64) -> SpreadReport {
        SpreadReport {
            bins: spread.bins(borders, unit),
            rho_wrong: spread.rho(),
            rho_false_untraversable: spread.rho_false_untraversable(),
        }
    }
}

/// Every point of a short curve; of a long one, those that are a step apart along it.
fn thinned(roc: &[RocPoint]) -> Vec<RocPoint> {
    let mut kept: Vec<RocPoint> = Vec::new();
    for (k, point) in roc.iter().enumerate() {
        let far = kept.last().is_none_or(|last| {
            let along = (last.false_untraversable - point.false_untraversable).abs()
                + (last.missed_untraversable - point.missed_untraversable).abs();
            roc.len() <= ROC_POINTS || along >= 2.0 / ROC_POINTS as f64
        });
        if far || k + 1 == roc.len() {
            kept.push(*point);
        }
    }
    kept
}
