//! A trained network with everything that its use needs.
//!
//! On disk: one `model.safetensors` with the weights, and one metadata key `marsyard` of sorted JSON (the rest of this struct).

use serde::{Deserialize, Serialize};

use super::Network;
use crate::cells::CellParams;
use crate::drive::Rover;
use crate::sweep::Sensor;

/// Features -> what the network takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scaler {
    /// Subtracted, then divided by; from the train split. A feature that never varied has scale 1.
    pub mean: Vec<f64>,
    pub scale: Vec<f64>,
    /// Scaled inputs are clipped to [-clip, clip].
    pub clip: f64,
}

/// What a model is and was trained on.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    pub network: Network,
    pub about: About,
}

/// The metadata of a model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Version of the model format.
    pub marsyard_model: u32,
    pub inputs: usize,
    pub hidden: Vec<usize>,
    pub bias: bool,
    /// Names of the inputs, in order.
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
    pub rover: Rover,
    pub sensor: Sensor,
    /// Position and angles of the sensor on the rover: x, y, z in metres, yaw, pitch, roll in degrees.
    pub mount: [f64; 6],
    pub corpus_ids: Vec<String>,
    pub corpus_names: Vec<String>,
}

impl Scaler {
    /// Scales one row of features.
    pub fn scale(&self, features: &[f32], out: &mut [f64]) {
        for (((out, &x), mean), scale) in out.iter_mut().zip(features).zip(&self.mean).zip(&self.scale) {
            *out = ((f64::from(x) - mean) / scale).clamp(-self.clip, self.clip);
        }
    }
}
