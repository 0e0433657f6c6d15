//! What a model says of itself beside its weights: the network's shape, its inputs and how they are scaled, and what it was trained on.
//!
//! In: the metadata of a model file, or what a training knows when it ends. Out: an [`About`], whose fields are the keys of the metadata;
//! keys that earlier formats lack have the value that these meant.

use serde::{Deserialize, Serialize};

use crate::cells::{CellFrame, CellParams, LabelRule};
use crate::drive::Rover;
use crate::sweep::Sensor;
use crate::train::leaks::LearntFrom;
use crate::train::{Activation, Calibration, Layout, Scaler};

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
