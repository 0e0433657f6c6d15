//! Innovations -> better weights: the Kalman filters, back-propagation, and batches with a Kronecker-factored covariance beside them.
//!
//! All learn through one face, so that a config can swap them. Symbols: w weights (s), P their covariance (s x s), b = dy/dw the
//! Jacobian (s), d target, y output, nu = d - y innovation, R measurement noise, S = b'Pb + R, K = Pb / S gain, Q process noise.
//!
//! ```
//! use marsyard::random::{Stage, Streams};
//! use marsyard::train::filter::build;
//! use marsyard::train::params::{EkfParams, FilterParams};
//! use marsyard::train::{Activation, Layout, Network};
//!
//! // Inputs x and y in [-1, 1]; a cell is untraversable, target 0.9, where x > y.
//! let streams = Streams { seed: 1, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
//! let layout = Layout { inputs: 2, hidden: vec![3], bias: true, members: 1, activation: Activation::Logistic };
//! let mut network = Network::random(layout.clone(), &streams);
//! let rows: Vec<f64> = (0..800).map(|k| f64::from(k * 7919 % 2001) / 1000.0 - 1.0).collect();
//! let targets: Vec<f64> = rows.chunks(2).map(|row| if row[0] > row[1] { 0.9 } else { 0.1 }).collect();
//! let wrong = |network: &Network| {
//!     let mut outputs = vec![0.0; targets.len()];
//!     network.outputs(&rows, &mut outputs);
//!     outputs.iter().zip(&targets).filter(|(output, target)| (**output > 0.5) != (**target > 0.5)).count()
//! };
//! let before = wrong(&network);
//! let mut filter = build(&FilterParams::Ekf(EkfParams::default()), &layout, 5.0)?;
//! for _ in 0..3 {
//!     filter.learn(&mut network, &rows, &targets, &vec![1.0; targets.len()]);
//! }
//! assert_eq!(filter.counters().updates, 3 * 400);
//! assert!(before > 100 && wrong(&network) < 12, "{before} {}", wrong(&network));
//! # Ok::<(), marsyard::train::filter::FilterError>(())
//! ```

mod backprop;
mod build;
mod counters;
mod covariance;
mod diagonal;
mod ekf;
mod groups;
mod guarded;
mod kronecker;
pub(super) mod lanes;
mod linearised;
mod noise;
mod state;
#[cfg(test)]
mod tests;
mod triangle;
mod ud;
mod ukf;

pub use build::{build, build_unchecked};
pub use counters::Counters;
pub(crate) use counters::MOST_WEIGHT;

use super::Network;

/// What learns.
pub trait Filter: Send {
    /// Learns rows in order: `inputs` is row-major (rows x inputs, scaled), `targets` and `noise` (R of each row) have one entry a
    /// row; rows may be taken together as a mini-batch where the filter says so.
    fn learn(&mut self, network: &mut Network, inputs: &[f64], targets: &[f64], noise: &[f64]);

    /// Learns portions one after another; gives the same bits as a call of `learn` for each. `ends`: rows up to the end of each.
    fn learn_portions(
        &mut self,
        network: &mut Network,
        inputs: &[f64],
        targets: &[f64],
        noise: &[f64],
        ends: &[usize],
    ) {
        let (width, mut from) = (network.layout.inputs, 0);
        for &end in ends {
            self.learn(network, &inputs[from * width..end * width], &targets[from..end], &noise[from..end]);
            from = end;
        }
    }

    /// From here on work may be shared among the threads of the rayon pool that calls, where the filter can; never changes a bit. A task
    /// of a pool that must not wait for its other threads leaves it alone.
    fn share_work(&mut self) {}

    /// What went wrong and was mended so far.
    fn counters(&self) -> Counters;

    /// Everything that the next update depends on, beside the weights: for checkpoints and for reverting to the best.
    fn state(&self) -> FilterState;

    /// Goes on from a state of a filter of the same kind and size.
    fn restore(&mut self, state: &FilterState) -> Result<(), FilterError>;

    /// The restored state is of a training that is over, and another begins at its weights: what is of those rows and not of the weights
    /// is forgotten.
    fn begin_anew(&mut self) {}
}

/// A filter's memory as plain numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterState {
    /// Name of the filter, such as `ekf-f32`.
    pub kind: String,
    /// Its arrays by name, as bytes, with their element type (`F32`, `F64`, `U64`) and shape.
    pub arrays: Vec<(String, &'static str, Vec<usize>, Vec<u8>)>,
}

/// Why a filter could not be made or go on.
#[derive(Debug, thiserror::Error)]
pub enum FilterError {
    #[error("the state is of '{there}', the filter is '{here}'")]
    OtherKind { there: String, here: String },
    #[error("the state holds {there} values where {here} are needed")]
    OtherSize { there: usize, here: usize },
    #[error("{0}")]
    OutOfRange(String),
}
