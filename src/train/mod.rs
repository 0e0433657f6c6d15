//! Shards -> a network that says which cells a rover can cross.
//!
//! In: [`TrainParams`], a finished corpus (or several). Out: a run folder with a [`Model`]. Source: Hewitt et al. 2017,
//! "Training": a sigmoid multilayer perceptron whose weights are the state of an extended Kalman filter (eqs 8-16); Puskorius &
//! Feldkamp 1991 (decoupled), Bierman 1977 (factored). Memory does not grow with the corpus. Rows come in an order that is a
//! pure function of (seed, epoch), so that a killed run goes on to the same bits.

pub mod filter;
pub mod labels;
pub mod model;
pub mod network;
pub mod params;

pub use filter::Filter;
pub use model::{About, MODEL_FORMAT, Model, ModelError, Scaler};
pub use network::{Layout, Network};
pub use params::TrainParams;
