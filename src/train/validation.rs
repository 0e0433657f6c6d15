//! A split and a network -> its weighted mean squared error.
//!
//! A look takes so many rows as the filter's pace allows ([`FilterParams::look_rows`](super::params::FilterParams::look_rows)), or up to
//! twice as many: of a split that holds more, every so many-th that can be judged, so that all its scenes have their say, in the same share
//! of their rows. They are read once and kept, and a look costs the same however large the corpus is. Cells beside one another err alike: what tells a look's error is the scenes. Chunks of rows are taken by all threads; their
//! sums are added in the order of the rows, so that the number of threads changes no bit. Where outputs are of f32, rows are scaled once
//! for all looks, because scaling costs about as much as the network's pass in f32. The threads are those of rayon's current pool,
//! which lives as long as a training: `parallel::run` starts and ends threads at each call, and a look at rows in memory takes less than
//! that.

use std::sync::Arc;

use rayon::prelude::*;

use super::network::forward::{NetworkF32, NetworkIn};
use super::rows::{LeftOut, Rows, stride};
use super::scaling::Weights;
use super::source::Sources;
use super::{Network, Scaler, TrainError, TrainParams};
use crate::corpus::Split;
use crate::parallel::ReadAhead;

/// Rows of one partial sum.
const CHUNK_ROWS: usize = 1024;

/// What turns a stored row into a term of the error.
#[derive(Clone, Debug)]
pub struct Objective {
    pub scaler: Scaler,
    pub targets: [f64; 2],
    /// How much a row to learn counts.
    pub weights: Weights,
    /// How much a row of the validation split counts in a look.
    pub look_weights: Weights,
    /// Whether errors are told of outputs in f32, as batches learn, or in f64, as the Kalman filters do.
    pub is_f32: bool,
}

/// Weighted squared errors added up.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct ErrorSum {
    pub squared: f64,
    pub weight: f64,
}

impl ErrorSum {
    /// The weighted mean squared error; NaN for nothing.
    pub(crate) fn mean(&self) -> f64 {
        self.squared / self.weight
    }

    fn and(mut self, other: ErrorSum) -> ErrorSum {
        self += other;
        self
    }
}

impl std::ops::AddAssign for ErrorSum {
    fn add_assign(&mut self, other: ErrorSum) {
        self.squared += other.squared;
        self.weight += other.weight;
    }
}

impl Objective {
    /// `counts`: rows to learn of each class by corpus; `corpora`: the corpora's weights.
    pub(crate) fn new(scaler: Scaler, params: &TrainParams, counts: &[[u64; 2]], corpora: &[f64]) -> Objective {
        let weights = |balance| Weights::new(counts, corpora, balance);
        let (weights, look_weights) = (weights(params.balance), weights(params.look_balance()));
        let is_f32 = params.filter.learns_by_batches();
        Objective { scaler, targets: params.targets, weights, look_weights, is_f32 }
    }

    /// A network in the precision that its errors are told in.
    pub(crate) fn network_in<'n>(&self, network: &'n Network) -> NetworkIn<'n> {
        if self.is_f32 { NetworkIn::F32(NetworkF32::new(network)) } else { NetworkIn::F64(network) }
    }

    /// Adds rows in order.
    pub(crate) fn sum(&self, network: &Network, rows: &Rows) -> ErrorSum {
        let network = self.network_in(network);
        self.sum_by(rows, |stored, outputs| self.outputs(&network, stored, outputs))
    }

    /// The same to the bit, on this thread alone.
    pub(crate) fn sum_here(&self, network: &Network, rows: &Rows) -> ErrorSum {
        let network = self.network_in(network);
        let outputs = |stored: &[f32], outputs: &mut [f64]| self.outputs(&network, stored, outputs);
        chunks(rows).map(|chunk| self.chunk(rows, chunk, &outputs)).fold(ErrorSum::default(), ErrorSum::and)
    }

    /// Adds rows in order, whose outputs are made of their features.
    fn sum_by(&self, rows: &Rows, outputs: impl Fn(&[f32], &mut [f64]) + Sync) -> ErrorSum {
        let parts = chunks(rows).into_par_iter().map(|chunk| self.chunk(rows, chunk, &outputs));
        parts.collect::<Vec<ErrorSum>>().into_iter().fold(ErrorSum::default(), ErrorSum::and)
    }

    /// The outputs of rows as they were stored.
    fn outputs(&self, network: &NetworkIn, stored: &[f32], outputs: &mut [f64]) {
        let mut scaled = vec![0.0; self.scaler.inputs() * outputs.len()];
        self.scaler.scale(stored, &mut scaled);
        network.outputs(&scaled, outputs);
    }

    fn chunk(&self, rows: &Rows, chunk: usize, outputs_of: &impl Fn(&[f32], &mut [f64])) -> ErrorSum {
        let range = chunk * CHUNK_ROWS..rows.len().min((chunk + 1) * CHUNK_ROWS);
        let mut outputs = vec![0.0; range.len()];
        outputs_of(&rows.features[range.start * rows.width..range.end * rows.width], &mut outputs);
        let mut sum = ErrorSum::default();
        for (row, output) in range.zip(outputs) {
            let label = rows.labels[row];
            let error = self.targets[label.index()] - output;
            let weight = self.look_weights.of(label, rows.corpora[row]);
            sum += ErrorSum { squared: weight * error * error, weight };
        }
        sum
    }

    /// Rows in f32 as the network takes them.
    fn scaled(&self, rows: Rows) -> Rows {
        let inputs = self.scaler.inputs();
        let mut features = vec![0.0; inputs * rows.len()];
        let chunks =
            features.par_chunks_mut(inputs * CHUNK_ROWS).zip(rows.features.par_chunks(rows.width * CHUNK_ROWS));
        chunks.for_each_init(
            || vec![0.0; inputs * CHUNK_ROWS],
            |scaled, (features, stored)| {
                let scaled = &mut scaled[..features.len()];
                self.scaler.scale(stored, scaled);
                features.iter_mut().zip(scaled).for_each(|(feature, x)| *feature = *x as f32);
            },
        );
        Rows { width: inputs, features, ..rows }
    }
}

/// The numbers of a sum's parts.
fn chunks(rows: &Rows) -> std::ops::Range<usize> {
    0..rows.len().div_ceil(CHUNK_ROWS)
}

/// The rows that a look takes.
#[derive(Debug)]
pub(crate) enum LookRows {
    Stored(Rows),
    /// As the network takes them, in f32: twice the memory with normal scores.
    Scaled(Rows),
}

impl LookRows {
    pub(crate) fn rows(&self) -> &Rows {
        let (LookRows::Stored(rows) | LookRows::Scaled(rows)) = self;
        rows
    }
}

/// The rows that decide when training ends.
pub(crate) struct Validation {
    pub(super) looked_at: LookRows,
    /// Of the whole split.
    pub rows: u64,
    pub left_out: LeftOut,
}

impl Validation {
    /// Reads the split once: to check it, to count it, and to keep what looks take.
    pub(crate) fn open(sources: &Arc<Sources>, look_rows: u64) -> Result<Validation, TrainError> {
        let every = stride(sources.rows(Split::Validation), look_rows);
        let mut looked_at = Rows::new(sources.features.len());
        let (mut rows, mut left_out) = (0, LeftOut::default());
        each_group(Arc::clone(sources), Split::Validation, |part| {
            left_out += part.left_out;
            for row in 0..part.len() {
                if rows % every == 0 {
                    looked_at.push_row(&part, row);
                }
                rows += 1;
            }
        })?;
        Ok(Validation { looked_at: LookRows::Stored(looked_at), rows, left_out })
    }

    /// For looks by this objective alone: where outputs are of f32, its scaling is done once for all looks, which changes no bit of theirs.
    pub(crate) fn for_looks_by(self, objective: &Objective) -> Validation {
        let looked_at = match self.looked_at {
            LookRows::Stored(rows) if objective.is_f32 => LookRows::Scaled(objective.scaled(rows)),
            looked_at => looked_at,
        };
        Validation { looked_at, ..self }
    }

    /// The error over the rows of a look.
    pub(crate) fn error(&self, objective: &Objective, network: &Network) -> f64 {
        let sum = match &self.looked_at {
            LookRows::Stored(rows) => objective.sum(network, rows),
            LookRows::Scaled(rows) => {
                let network = NetworkF32::new(network);
                objective.sum_by(rows, |scaled, outputs| network.outputs(scaled, outputs))
            }
        };
        sum.mean()
    }
}

/// Hands over the rows of a split, row group by row group in their order; the next one is read meanwhile.
pub(crate) fn each_group(sources: Arc<Sources>, split: Split, mut take: impl FnMut(Rows)) -> Result<(), TrainError> {
    let groups = sources.groups(split);
    let read = move |group| {
        let mut rows = Rows::new(sources.features.len());
        sources.read(split, group, &mut rows).map(|()| rows)
    };
    ReadAhead::start(0, groups.into_iter().map(read)).try_for_each(|rows| rows.map(&mut take))
}
