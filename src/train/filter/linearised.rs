//! Rows -> Jacobians and innovations -> a learner.
//!
//! What all filters that need dy/dw share: the network's gradient, the schedules of R and Q, the batches, the guard against rows
//! that are not finite, the counters.

use super::noise::Noise;
use super::state::{Reader, Writer};
use super::{Counters, Filter, FilterError, FilterState};
use crate::train::Network;
use crate::train::network::Activations;

/// A batch of rows, linearised at the same weights.
pub(super) struct Rows<'a> {
    /// dy/dw, one row after the other.
    pub jacobian: &'a [f64],
    /// d - y.
    pub innovations: &'a [f64],
    /// R of each row.
    pub noise: &'a [f64],
    /// Q of each weight.
    pub q: f64,
}

/// What became of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Outcome {
    /// Covariances that were rebuilt from their diagonals.
    pub rebuilt: u64,
    /// Whether the batch was left out, because its step is not finite.
    pub rejected: bool,
}

/// Whether all numbers are finite. Looks at all of them: a loop that may stop early is not turned into vectors.
#[inline(always)]
pub(super) fn finite(values: &[f64]) -> bool {
    values.iter().fold(true, |sound, x| sound & (x.abs() < f64::INFINITY))
}

/// A filter's own part.
pub(crate) trait Learner: Send {
    fn kind(&self) -> &str;
    /// Rows that are learnt together, at most.
    fn batch(&self) -> usize;
    /// One batch: weights stay finite, whatever the numbers.
    fn update(&mut self, weights: &mut [f64], rows: &Rows) -> Outcome;
    /// Told that its covariance was rebuilt repeatedly; true where it goes on in a sounder form.
    fn give_way(&mut self) -> bool {
        false
    }
    fn save(&self, to: &mut Writer);
    fn load(&mut self, from: &Reader) -> Result<(), FilterError>;
}

/// A learner with everything round it.
pub(crate) struct Linearised<L> {
    learner: L,
    noise: Noise,
    clip: f64,
    counters: Counters,
    tape: Activations,
    jacobian: Vec<f64>,
    innovations: Vec<f64>,
    row_noise: Vec<f64>,
}

impl<L: Learner> Linearised<L> {
    /// `clip`: the inputs' greatest size, at which rows are counted.
    pub(super) fn new(learner: L, noise: Noise, weights: usize, clip: f64) -> Linearised<L> {
        let batch = learner.batch();
        Linearised {
            learner,
            noise,
            clip,
            counters: Counters::default(),
            tape: Activations::default(),
            jacobian: vec![0.0; batch * weights],
            innovations: Vec::with_capacity(batch),
            row_noise: Vec::with_capacity(batch),
        }
    }

    fn flush(&mut self, network: &mut Network) {
        let count = self.innovations.len();
        if count == 0 {
            return;
        }
        let (r, q) = self.noise.at(self.counters.updates);
        self.row_noise.iter_mut().for_each(|noise| *noise *= r);
        let rows = Rows {
            jacobian: &self.jacobian[..count * network.weights.len()],
            innovations: &self.innovations,
            noise: &self.row_noise,
            q,
        };
        let outcome = self.learner.update(&mut network.weights, &rows);
        if outcome.rebuilt > 0 && self.counters.take_rebuilt(outcome.rebuilt) && self.learner.give_way() {
            self.counters.factored_at = Some(self.counters.updates);
        }
        if outcome.rejected {
            self.counters.rejected += count as u64;
        } else {
            self.counters.updates += count as u64;
            self.counters.take_weights(&mut network.weights);
        }
        self.innovations.clear();
        self.row_noise.clear();
    }
}

impl<L: Learner> Filter for Linearised<L> {
    fn learn(&mut self, network: &mut Network, inputs: &[f64], targets: &[f64], noise: &[f64]) {
        let (width, size) = (network.layout.inputs, network.weights.len());
        for ((row, &target), &noise) in inputs.chunks_exact(width).zip(targets).zip(noise) {
            let place = self.innovations.len() * size;
            let gradient = &mut self.jacobian[place..place + size];
            let sound = row.iter().all(|x| x.is_finite()) && noise > 0.0 && noise < f64::INFINITY;
            let output = if sound { network.gradient(row, &mut self.tape, gradient) } else { f64::NAN };
            if !(target - output).is_finite() || !finite(gradient) {
                self.counters.rejected += 1;
                continue;
            }
            self.counters.take_inputs(row, self.clip);
            self.innovations.push(target - output);
            self.row_noise.push(noise);
            if self.innovations.len() == self.learner.batch() {
                self.flush(network);
            }
        }
        self.flush(network);
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn state(&self) -> FilterState {
        let mut writer = Writer::new(self.learner.kind());
        self.counters.save("", &mut writer);
        self.learner.save(&mut writer);
        writer.finish()
    }

    fn restore(&mut self, state: &FilterState) -> Result<(), FilterError> {
        let reader = Reader::new(state, self.learner.kind())?;
        let counters = Counters::load("", &reader)?;
        self.learner.load(&reader)?;
        self.counters = counters;
        Ok(())
    }
}
