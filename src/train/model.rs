//! A trained network with everything that its use needs.
//!
//! In: the bytes of a model file, rows of features. Out: a [`Model`], and one output in (0, 1) a row: low is traversable, high
//! untraversable. On disk: one `model.safetensors` with the weights, and one metadata key `marsyard` of sorted JSON (the rest of
//! the struct); the layout of the file stands in `model/file.rs`.
//!
//! The output of a row is scaled features, clipped, and their normal scores where there are any, through the network: f64 throughout. A row of finite features never gives a
//! NaN, because [`Model::load`] takes finite numbers of sane size only; a NaN feature gives a NaN, which is the caller's to count.

mod file;

use garde::Validate;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::calibration::Calibration;
use super::leaks::LearntFrom;
use super::operating_point::MOST_THRESHOLDS;
use super::{Activation, Layout, Network, OperatingPoint, Scaler};
use crate::cells::params::{LocalHeightParams, UnseenParams};
use crate::cells::{CellFrame, CellParams, LOCAL_HEIGHT, LabelRule, is_gap};
use crate::drive::Rover;
use crate::sweep::Sensor;

/// Version of the model format; files of every earlier one are read.
pub const MODEL_FORMAT: u32 = 7;

/// What a model is and was trained on.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    pub network: Network,
    pub about: About,
    /// SHA-256 of the file that it was read from, as `sha256sum` says it; `None` for one that comes from no file.
    pub sha256: Option<String>,
}

/// The metadata of a model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// Version of the model format.
    pub marsyard_model: u32,
    /// Of the network: the features, and their normal scores where it takes those.
    pub inputs: usize,
    pub hidden: Vec<usize>,
    pub bias: bool,
    /// Networks of these sizes, whose mean is the output.
    #[serde(default = "one_member", skip_serializing_if = "is_one")]
    pub members: usize,
    /// What hidden neurons make of their sums; logistic in models from before it was kept.
    #[serde(default, skip_serializing_if = "is_logistic")]
    pub activation: Activation,
    /// Names of the features, in order.
    pub features: Vec<String>,
    pub scaler: Scaler,
    /// Per feature, of the train split: quantiles 0, 0.1 %, 1 %, 50 %, 99 %, 99.9 %, 1.
    pub quantiles: Vec<[f64; 7]>,
    /// Outputs for traversable and untraversable in training.
    pub targets: [f64; 2],
    /// Ascending borders between classes; one = traversable below, untraversable from it on.
    pub thresholds: Vec<f64>,
    /// The grid, features and labels it was trained with, per family of the corpus the first.
    pub cells: CellParams,
    /// Its frame and all others that it learnt from, where there are several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<CellFrame>,
    /// Its overhang rule's height, metres (`None`: no rule), and all others that it learnt with, where there are several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub overhangs_m: Vec<Option<f64>>,
    /// How far the cells reach of the family that reaches farthest of those that it learnt from, metres; none where that is the first one's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_m: Option<f64>,
    /// The rule that it learnt labels by; none where it learnt the corpora's own, and in models from before this was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelRule>,
    pub rover: Rover,
    pub sensor: Sensor,
    /// Position and angles of the sensor on the rover: x, y, z in metres, yaw, pitch, roll in degrees.
    pub mount: [f64; 6],
    pub corpus_ids: Vec<String>,
    pub corpus_names: Vec<String>,
    /// SHA-256 of what the run was begun with: config, corpora, and the network it started from. Format 1 had none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Which scenes it learnt from and was stopped by, those of the network that it was started from included; none in models from
    /// before this was kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub learnt_from: Vec<LearntFrom>,
    /// What its outputs meant on the validation scenes; none where these lack a class, and in models of formats 1 and 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<Calibration>,
}

impl About {
    /// Of the network.
    pub(crate) fn layout(&self) -> Layout {
        let About { inputs, bias, members, activation, .. } = *self;
        Layout { inputs, hidden: self.hidden.clone(), bias, members, activation }
    }

    /// How far the cells that it learnt from reach, metres.
    pub(crate) fn reaches_m(&self) -> f64 {
        self.reach_m.or(self.cells.max_range_m).unwrap_or(self.sensor.max_range_m)
    }
}

/// What files from before there were several say of members.
pub(crate) fn one_member() -> usize {
    1
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde hands over a reference.
fn is_one(members: &usize) -> bool {
    *members == 1
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde hands over a reference.
fn is_logistic(activation: &Activation) -> bool {
    *activation == Activation::Logistic
}

/// Why a model cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    #[error("{name}: {source}")]
    Io { name: String, source: std::io::Error },
    #[error("not a marsyard model: {reason}; give the `model.safetensors` of a run folder of `marsyard train`")]
    NotAModel { reason: String },
    #[error(
        "a model of format {there}, this marsyard reads formats 1 to {MODEL_FORMAT}: use the marsyard that wrote it, or train again"
    )]
    OtherVersion { there: u64 },
    #[error(
        "the model is damaged: {reason}; copy it again from where it came, or have its run write it anew: remove it and give the \
         command that trained it, with --resume"
    )]
    Damaged { reason: String },
    #[error("the model contradicts itself: {reason}; the file was damaged or changed by hand: train again")]
    Contradiction { reason: String },
    #[error(
        "the model takes {}, which the data does not have; build the corpus with the effects and cell features that give {}, or train with \
         `features: listed`",
        missing.join(", "),
        if missing.len() == 1 { "it" } else { "them" }
    )]
    MissingFeatures { missing: Vec<String> },
    #[error(
        "the model was trained on cells of {model_m} m, the data has cells of {data_m} m: a model fits its own cell size only; \
         build the data with `cells.size_m: {model_m}`, or train a model on cells of {data_m} m"
    )]
    OtherCellSize { model_m: f64, data_m: f64 },
    #[error(
        "the model was trained on heights above {model}, the data has those above {data}: the same column with another meaning; \
         build the data with the model's `cells.local_height`, or train again without `local_height_m`"
    )]
    OtherLocalHeight { model: String, data: String },
    #[error(
        "the model was trained on gaps in {model}, the data has those in {data}: the same columns with another meaning; build the data \
         with the model's `cells.unseen`, or train again"
    )]
    OtherUnseen { model: String, data: String },
    #[error("the thresholds {0:?} are not 1 to {MOST_THRESHOLDS} rising numbers within 0 and 1")]
    Thresholds(Vec<f64>),
    #[error(
        "the model does not know what its outputs mean: its validation scenes lacked a class, or it was trained by an earlier marsyard; \
         train again, or say --threshold"
    )]
    Uncalibrated,
    #[error(
        "no threshold keeps within {} % on the model's validation scenes; allow more, or train on a corpus with more scenes",
        100.0 * share
    )]
    Unreached { share: f64 },
}

/// The greatest weight, scale or mean that a file may hold: far beyond use, and no sum of such products overflows.
const SANE: f64 = 1e100;

/// The same of weights where neurons have no bounds, and the most hidden layers of such: nor does a product of them, layer by layer, of the widest network that a
/// file may hold.
const SANE_RECTIFIED: f64 = 1e20;
const MOST_RECTIFIED_LAYERS: usize = 8;

/// Rows that are scaled at a time.
const CHUNK_ROWS: usize = 1024;

impl Model {
    /// The first digits of its file's SHA-256: how a model is named in what is said of it.
    pub(crate) fn short_sha256(&self) -> Option<&str> {
        self.sha256.as_ref().and_then(|digits| digits.get(..12))
    }

    /// Where each input of the model stands among the columns of some data.
    pub(crate) fn inputs_of<S: AsRef<str>>(&self, columns: &[S]) -> Result<Vec<usize>, ModelError> {
        let place = |name: &String| columns.iter().position(|column| column.as_ref() == name);
        let missing: Vec<String> = self.about.features.iter().filter(|name| place(name).is_none()).cloned().collect();
        if !missing.is_empty() {
            return Err(ModelError::MissingFeatures { missing });
        }
        Ok(self.about.features.iter().filter_map(place).collect())
    }

    /// Refuses data whose cells have another size.
    pub(crate) fn check_cell_size(&self, data_m: f64) -> Result<(), ModelError> {
        let model_m = self.about.cells.size_m;
        if (model_m - data_m).abs() <= 1e-9 * model_m {
            return Ok(());
        }
        Err(ModelError::OtherCellSize { model_m, data_m })
    }

    /// Refuses data whose local heights, where the model takes them, mean something else.
    pub(crate) fn check_local_height(&self, data: Option<&LocalHeightParams>) -> Result<(), ModelError> {
        let takes = self.about.features.iter().any(|name| name == LOCAL_HEIGHT);
        match (&self.about.cells.local_height, data) {
            (Some(model), Some(data)) if takes && model != data => {
                Err(ModelError::OtherLocalHeight { model: model.words(), data: data.words() })
            }
            _ => Ok(()),
        }
    }

    /// Whether it judges cells that hold no point, by what the beams over them know.
    pub(crate) fn takes_unseen(&self) -> bool {
        self.about.features.iter().any(|name| is_gap(name))
    }

    /// Refuses data whose gaps, where the model takes them, mean something else.
    pub(crate) fn check_unseen(&self, data: Option<&UnseenParams>) -> Result<(), ModelError> {
        match (&self.about.cells.unseen, data) {
            (Some(model), Some(data)) if self.takes_unseen() && model != data => {
                Err(ModelError::OtherUnseen { model: model.words(), data: data.words() })
            }
            _ => Ok(()),
        }
    }

    /// What to tell where cells lie in a frame that the model never learnt from: they are judged all the same.
    pub(crate) fn other_frame(&self, data: CellFrame) -> Option<String> {
        let about = &self.about;
        let learnt = if about.frames.is_empty() { std::slice::from_ref(&about.cells.frame) } else { &about.frames };
        let names: Vec<&str> = learnt.iter().map(|frame| frame.name()).collect();
        (!learnt.contains(&data)).then(|| {
            format!(
                "the model learnt cells of the frame {}, and these are of the frame {}, in which heights, pitch and roll have other errors: \
                 expect more mistakes, or train on a corpus with `cells.frame: {}`",
                names.join(" and "),
                data.name(),
                data.name()
            )
        })
    }

    /// What to tell where cells hold what the model never learnt that they hold, or lack it: crowns, branches and gates by the rule
    /// `cells.overhang`. They are judged all the same.
    pub(crate) fn other_overhang(&self, data_m: Option<f64>) -> Option<String> {
        let about = &self.about;
        let own_m = [about.cells.above_m()];
        let learnt_m = if about.overhangs_m.is_empty() { &own_m[..] } else { &about.overhangs_m };
        let ruled = || learnt_m.iter().flatten().copied();
        let (least_m, most_m) = (ruled().fold(f64::INFINITY, f64::min), ruled().fold(f64::NEG_INFINITY, f64::max));
        let told = match data_m {
            None if learnt_m.contains(&None) => return None,
            None => format!(
                "the model learnt cells without what hangs over {least_m} m of free height, and these hold it: crowns and branches look like \
                 obstacles; build the data with the model's `cells.overhang`"
            ),
            Some(data_m) if least_m > most_m => format!(
                "the model learnt cells with all that hangs over them, and these are without what hangs over {data_m} m of free height: train on \
                 a corpus with `cells.overhang`"
            ),
            Some(data_m) if (least_m..=most_m).contains(&data_m) => return None,
            Some(data_m) => format!(
                "the model learnt cells without what hangs over {least_m} to {most_m} m of free height, and these are without what hangs over \
                 {data_m} m: train on a corpus with `cells.overhang: {{above_m: {data_m}}}`"
            ),
        };
        Some(told)
    }

    /// What to tell where a model that learnt labels by a rule of its own is judged by others (`None`: the corpus's own).
    pub(crate) fn other_labels(&self, judged_by: Option<&LabelRule>) -> Option<String> {
        let learnt = self.about.labels.as_ref().filter(|learnt| !judged_by.is_some_and(|rule| rule.same_as(learnt)))?;
        let rule = serde_json::to_string(learnt).expect("a rule is plain data");
        let by = if judged_by.is_some() { "another rule" } else { "the corpus's own labels" };
        Some(format!(
            "the model learnt labels by {rule} and is judged by {by}: --labels '{rule}' judges it by what it learnt"
        ))
    }

    /// The output for one row of features, in the order of `about.features`.
    pub fn output(&self, features: &[f32]) -> f64 {
        self.outputs(features).first().copied().unwrap_or(f64::NAN)
    }

    /// The outputs of rows that lie one after another.
    pub(crate) fn outputs(&self, rows: &[f32]) -> Vec<f64> {
        let (features, inputs) = (self.about.features.len(), self.about.inputs);
        let (mut scaled, mut outputs) = (vec![0.0; inputs * CHUNK_ROWS], vec![0.0; rows.len() / features]);
        for (rows, outputs) in rows.chunks(features * CHUNK_ROWS).zip(outputs.chunks_mut(CHUNK_ROWS)) {
            self.about.scaler.scale(rows, &mut scaled);
            self.network.outputs(&scaled[..inputs * outputs.len()], outputs);
        }
        outputs
    }

    /// The same on the threads of rayon's current pool.
    pub(crate) fn outputs_in_parallel(&self, rows: &[f32]) -> Vec<f64> {
        rows.par_chunks(self.about.features.len() * CHUNK_ROWS).flat_map_iter(|rows| self.outputs(rows)).collect()
    }

    /// How probable it is that a cell of that output is untraversable, as cells occur on the validation scenes; `None` where nothing
    /// is known of them.
    pub fn probability(&self, output: f64) -> Option<f64> {
        let calibration = self.about.calibration.as_ref()?;
        Some(calibration.probability(output, self.about.targets))
    }

    /// Rising borders between classes of the output.
    pub fn thresholds(&self, at: &OperatingPoint) -> Result<Vec<f64>, ModelError> {
        at.thresholds(&self.about)
    }

    /// Everything that the rest of the program relies on; [`Model::load`] and [`Model::save`] both ask.
    fn check(&self) -> Result<(), ModelError> {
        let fault = self.fault();
        fault.map_or(Ok(()), |reason| Err(ModelError::Contradiction { reason }))
    }

    fn fault(&self) -> Option<String> {
        let (about, layout) = (&self.about, &self.network.layout);
        let finite = |values: &[f64]| values.iter().all(|v| v.abs() <= SANE);
        let ascending = |values: &[f64]| values.windows(2).all(|pair| pair[0] <= pair[1]);
        let in_unit = |values: &[f64]| values.iter().all(|v| (0.0..=1.0).contains(v));
        let Scaler { minus, mean, scale, scores, .. } = &about.scaler;
        let features = about.features.len();
        let per_feature = [minus.len(), mean.len(), scale.len(), about.quantiles.len()];
        if *layout != about.layout() {
            return Some("its network is not the one that its metadata tells of".into());
        }
        if let Some(other) = per_feature.iter().find(|&&count| count != features) {
            return Some(format!("{features} features, but scaling or quantiles of {other}"));
        }
        if !scores.is_empty() && scores.len() != features || about.inputs != about.scaler.inputs() {
            let (inputs, scores) = (about.inputs, scores.len());
            return Some(format!("{inputs} inputs, but {features} features and normal scores of {scores}"));
        }
        if self.network.weights.len() != layout.weights() {
            let (there, needed) = (self.network.weights.len(), layout.weights());
            return Some(format!("{there} weights where its layers need {needed}"));
        }
        let is_rectified = layout.activation != Activation::Logistic;
        if is_rectified && layout.hidden.len() > MOST_RECTIFIED_LAYERS {
            let (there, most) = (layout.hidden.len(), MOST_RECTIFIED_LAYERS);
            return Some(format!(
                "{there} hidden layers of rectified neurons, more than the {most} that a config may have"
            ));
        }
        let sane = if is_rectified { SANE_RECTIFIED } else { SANE };
        if let Some(at) = self.network.weights.iter().position(|w| w.abs() > sane || w.is_nan()) {
            return Some(format!("weight {at} is {}", self.network.weights[at]));
        }
        let mut names: Vec<&String> = about.features.iter().collect();
        names.sort();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Some(format!("the feature {} is named twice", pair[0]));
        }
        let scaler = &about.scaler;
        if !finite(&scaler.mean) || scaler.scale.iter().any(|s| !(1e-300..=SANE).contains(s)) {
            return Some("a mean that is not finite, or a scale that is not positive".into());
        }
        if let Some(other) = minus.iter().flatten().find(|&&other| minus.get(other) != Some(&None)) {
            return Some(format!("input {other} is subtracted from another and is no plain input"));
        }
        if !(1e-3..=1e6).contains(&scaler.clip) {
            return Some(format!("inputs are clipped to {}, not to 0.001 to 1e6", scaler.clip));
        }
        if let Some(fault) = scores.iter().find_map(|scores| scores.fault(scaler.clip, SANE)) {
            return Some(fault.into());
        }
        if about.quantiles.iter().any(|q| !finite(q) || !ascending(q)) {
            return Some("quantiles that do not ascend".into());
        }
        if !in_unit(&about.targets) || about.targets[0] >= about.targets[1] {
            return Some(format!("targets {:?} are not two rising numbers within 0 and 1", about.targets));
        }
        if !(1..=16).contains(&about.thresholds.len()) || !in_unit(&about.thresholds) || !ascending(&about.thresholds) {
            return Some(format!("thresholds {:?} are not 1 to 16 rising numbers within 0 and 1", about.thresholds));
        }
        if about.overhangs_m.iter().flatten().any(|m| !(0.0..=SANE).contains(m)) {
            return Some("an overhang rule whose height is not a number from 0 on".into());
        }
        if about.reach_m.is_some_and(|m| !(1e-3..=1e6).contains(&m)) {
            return Some("a reach that is not 1 mm to 1000 km".into());
        }
        if !finite(&about.mount) {
            return Some("a mount that is not finite".into());
        }
        if let Some(fault) = about.calibration.as_ref().and_then(Calibration::fault) {
            return Some(fault);
        }
        let sections = [
            ("cells", about.cells.validate().err()),
            ("labels", about.labels.as_ref().and_then(|rule| rule.validate().err())),
            ("rover", about.rover.validate().err()),
            ("sensor", about.sensor.validate().err()),
        ];
        sections.into_iter().find_map(|(name, fault)| {
            fault.map(|fault| format!("its {name}: {}", fault.to_string().trim().replace('\n', "; ")))
        })
    }
}

#[cfg(test)]
pub(crate) mod tests;
