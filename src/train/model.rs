//! A trained network with everything that its use needs.
//!
//! In: the bytes of a model file, rows of features. Out: a [`Model`], and one output in (0, 1) a row: low is traversable, high
//! untraversable. On disk: one `model.safetensors` with the weights, and one metadata key `marsyard` of sorted JSON (the rest of
//! the struct); the layout of the file stands in `model/file.rs`.
//!
//! The output of a row is scaled features, clipped, and their normal scores where there are any, through the network: f64 throughout. A row of finite features never gives a
//! NaN, because [`Model::load`] takes finite numbers of sane size only; a NaN feature gives a NaN, which is the caller's to count.

mod about;
mod data_fit;
mod error;
mod fault;
mod file;

use rayon::prelude::*;

pub use about::About;
pub(crate) use about::one_member;
pub use error::ModelError;

use super::{Network, OperatingPoint};

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

/// Rows that are scaled at a time.
const CHUNK_ROWS: usize = 1024;

impl Model {
    /// The first digits of its file's SHA-256: how a model is named in what is said of it.
    pub(crate) fn short_sha256(&self) -> Option<&str> {
        self.sha256.as_ref().and_then(|digits| digits.get(..12))
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
}

#[cfg(test)]
pub(crate) mod tests;
