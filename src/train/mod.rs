//! Shards -> a network that says which cells a rover can cross.
//!
//! In: [`TrainParams`], a finished corpus (or several). Out: a run folder with a [`Model`]. Source: Hewitt et al. 2017,
//! "EKF formulation": a sigmoid multilayer perceptron whose weights are the state of an extended Kalman filter (eqs 8-16); Puskorius &
//! Feldkamp 1991 (decoupled), Bierman 1977 (factored). Deviations: by default larger networks learn by batches
//! (Vyas et al. 2024), and take normal scores of the features beside them ([`NormalScores`]). Memory does not grow with the corpus. Rows come in an order that is a
//! pure function of (seed, epoch), so that a killed run goes on to the same bits.

mod calibration;
mod checksum;
pub(crate) mod corpora;
pub(crate) mod curves;
pub(crate) mod error;
pub(crate) mod export;
pub(crate) mod feature_choice;
pub mod filter;
pub(crate) mod folder;
pub(crate) mod generalisation;
pub(crate) mod leaks;
mod learner;
pub(crate) mod lock;
pub mod looks;
mod loss;
pub mod memory;
pub(crate) mod model;
pub mod network;
pub(crate) mod normal_scores;
pub(crate) mod numbered;
pub(crate) mod onnx;
pub(crate) mod operating_point;
pub(crate) mod order;
pub mod params;
pub(crate) mod quantiles;
pub mod rows;
pub(crate) mod run;
pub(crate) mod scaler;
pub(crate) mod scaling;
pub(crate) mod scenes;
mod selection;
pub(crate) mod source;
mod state;
pub(crate) mod stopping;
mod stream;
#[cfg(test)]
mod tests;
pub(crate) mod validation;

pub use calibration::Calibration;
pub use error::TrainError;
pub use filter::Filter;
pub use loss::Loss;
pub(crate) use model::one_member;
pub use model::{About, MODEL_FORMAT, Model, ModelError};
pub use network::{Activation, Layout, Network};
pub use normal_scores::NormalScores;
pub use operating_point::OperatingPoint;
pub use params::{FeatureSet, TrainParams};
pub use run::{Event, Outcome, Setup, Tell, train};
pub(crate) use run::{as_noted_now, leave_unnoted};
pub use scaler::Scaler;
pub use source::{Source, Sources};
