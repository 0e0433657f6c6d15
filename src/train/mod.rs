//! Shards -> a network that says which cells a rover can cross.
//!
//! In: [`TrainParams`], a finished corpus (or several). Out: a run folder with a [`Model`]. Source: Hewitt et al. 2017,
//! "EKF formulation": a sigmoid multilayer perceptron whose weights are the state of an extended Kalman filter (eqs 8-16); Puskorius &
//! Feldkamp 1991 (decoupled), Bierman 1977 (factored). Memory does not grow with the corpus. Rows come in an order that is a
//! pure function of (seed, epoch), so that a killed run goes on to the same bits.

mod checksum;
pub mod corpora;
pub mod curves;
pub mod error;
pub mod export;
pub mod filter;
pub mod folder;
pub mod leaks;
mod learner;
pub(crate) mod lock;
pub mod looks;
pub mod memory;
pub mod model;
pub mod network;
pub mod numbered;
pub mod onnx;
pub mod order;
pub mod params;
pub mod quantiles;
pub mod rows;
pub mod run;
pub mod scaling;
pub mod scenes;
pub mod source;
mod state;
pub mod stopping;
mod stream;
#[cfg(test)]
mod tests;
pub mod validation;

pub use error::TrainError;
pub use filter::Filter;
pub use model::{About, MODEL_FORMAT, Model, ModelError, Scaler};
pub use network::{Layout, Network};
pub use params::{FeatureSet, TrainParams};
pub use run::{Event, Outcome, Setup, train};
pub use source::{Source, Sources};
