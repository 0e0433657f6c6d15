//! Rows in an order -> a network that learns them, the best one so far, and when to stop.
//!
//! What a training from shards and one from memory share. In: rows, and the order to learn them in. Portions end where a look at the
//! validation split is due, so that a position in the order is all that a resumed training needs to know of it.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::filter::{self, Filter};
use super::network::forward::NetworkIn;
use super::rows::Rows;
use super::selection::Selection;
use super::state::Snapshot;
use super::stopping::{Look, Stopping};
use super::validation::{ErrorSum, Objective};
use super::{Layout, Network, TrainError, TrainParams};
use crate::random::{Stage, Streams};

/// Of the portions between two looks, the first and every eighth after it tell the training error: it drives nothing, and is a forward
/// pass of its own.
const PORTIONS_A_TRAINING_ERROR: usize = 8;

/// Of the rows between two looks, the share (one over this) that a training error is of at least.
const FEWEST_OF_A_TRAINING_ERROR: u64 = 10;

/// Rows of a portion that a thread takes at a time.
const ROWS_A_TASK: usize = 128;

/// A network in training.
pub(super) struct Learner {
    pub objective: Objective,
    pub network: Network,
    pub filter: Box<dyn Filter>,
    pub best: Snapshot,
    /// The weights at the first look after the first row: what little they know tells how hard a scene is. A checkpoint of an earlier
    /// marsyard has none, and no later look takes their place.
    pub early: Option<Vec<f64>>,
    pub learnt: Learnt,
    /// Rows between two looks.
    pub validate_every: u64,
    patience: u32,
    /// As [`FilterParams::look_noise`](super::params::FilterParams::look_noise).
    look_noise: f64,
    /// Rows of a portion, at most: the training error is told, and rows are selected, by portions.
    portion_rows: usize,
    /// Portions that the filter is handed at once, at most, where threads share the work.
    portions_at_once: usize,
    handed: HandedRows,
    /// Whether the threads of the pool share the work.
    is_shared: bool,
    selection: Option<Selection>,
}

/// What was learnt so far, as far as it decides what comes next. Rows count whether the filter took them or a selection left them out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Learnt {
    pub rows: u64,
    /// Of the rows since the last look.
    train_sum: SumBits,
    pub stopping: Stopping,
}

/// An error sum, to the bit, whatever it holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct SumBits([u64; 2]);

impl From<ErrorSum> for SumBits {
    fn from(sum: ErrorSum) -> SumBits {
        SumBits([sum.squared.to_bits(), sum.weight.to_bits()])
    }
}

impl From<SumBits> for ErrorSum {
    fn from(SumBits([squared, weight]): SumBits) -> ErrorSum {
        ErrorSum { squared: f64::from_bits(squared), weight: f64::from_bits(weight) }
    }
}

impl Learner {
    /// A network as it is before the first row.
    pub(super) fn new(params: &TrainParams, objective: Objective, validate_every: u64) -> Result<Learner, TrainError> {
        let layout = params.layout(objective.scaler.mean.len());
        let filter = filter::build(&params.filter, &layout, params.clip)?;
        let network = first_network(params, layout);
        Ok(Learner {
            best: Snapshot { weights: network.weights.clone(), filter: filter.state() },
            early: None,
            objective,
            network,
            filter,
            learnt: Learnt::default(),
            validate_every: validate_every.max(1),
            patience: params.patience,
            look_noise: params.filter.look_noise(),
            portion_rows: params.filter.portion_rows(),
            portions_at_once: params.filter.portions_at_once(),
            handed: HandedRows::default(),
            is_shared: false,
            selection: Selection::of(&params.filter, params.seed),
        })
    }

    /// As [`Filter::share_work`].
    pub(super) fn share_work(&mut self) {
        self.is_shared = true;
        self.filter.share_work();
    }

    /// Learns the next portion of an order, or the next few of them where threads share the work, from its row `from` on; where they end. There
    /// training may be interrupted.
    pub(super) fn learn(&mut self, rows: &Rows, order: &[u32], from: usize) -> usize {
        let is_shared = self.is_shared && rayon::current_num_threads() > 1;
        let mut ends = self.portions(order.len(), from, is_shared);
        let end = from + ends[ends.len() - 1];
        self.handed.fill(rows, &order[from..end], &self.objective, is_shared);
        if self.tells_error(0) {
            let mut sum = ErrorSum::from(self.learnt.train_sum);
            sum += self.handed.error(ends[0], &self.objective.network_in(&self.network), is_shared);
            self.learnt.train_sum = sum.into();
        }
        if let Some(selection) = &mut self.selection {
            // It is of one portion, and leaves fewer rows of that.
            self.handed.select(selection, self.learnt.rows);
            ends = vec![self.handed.targets.len()];
        }
        let HandedRows { inputs, targets, noise, .. } = &self.handed;
        self.filter.learn_portions(&mut self.network, inputs, targets, noise, &ends);
        self.learnt.rows += (end - from) as u64;
        end
    }

    /// The ends of the portions that are learnt at once, counted from `from`: no farther than to a look, or to a portion whose error is told before
    /// it is learnt. With many at once threads wait for one another less often; one thread alone has them in its cache one by one.
    fn portions(&self, rows: usize, from: usize, is_shared: bool) -> Vec<usize> {
        let until_look = self.validate_every - self.learnt.rows % self.validate_every;
        let most = rows.min(from + usize::try_from(until_look).unwrap_or(usize::MAX));
        let at_once = if is_shared { self.portions_at_once } else { 1 };
        let mut ends = Vec::with_capacity(at_once);
        let mut end = from;
        loop {
            end = most.min(end - end % self.portion_rows + self.portion_rows);
            ends.push(end - from);
            if ends.len() == at_once || end == most || self.tells_error(end - from) {
                return ends;
            }
        }
    }

    /// Whether the training error is told of the portion that begins so many rows after what is learnt.
    fn tells_error(&self, after: usize) -> bool {
        let since_look = (self.learnt.rows % self.validate_every) as usize + after;
        self.selection.is_some() || (since_look / self.portion_rows).is_multiple_of(PORTIONS_A_TRAINING_ERROR)
    }

    /// Whether it is time to look at the validation split.
    pub(crate) fn is_look_due(&self) -> bool {
        self.learnt.rows.is_multiple_of(self.validate_every)
    }

    /// Whether rows were learnt that no look has seen.
    pub(crate) fn is_ahead_of_look(&self) -> bool {
        self.learnt.stopping.last.is_none_or(|last| last.rows < self.learnt.rows)
    }

    /// Takes in the validation error of the network as it is, in the epoch of that number; the look, and whether it is the best so
    /// far, which is then kept.
    pub(super) fn look(&mut self, epoch: u32, validation_error: f64) -> (Look, bool) {
        let finite = |error: f64| error.is_finite().then_some(error);
        // The last look of a course that ends between two may come after a handful of rows, whose mean says nothing.
        let since_look = self.learnt.rows - self.learnt.stopping.last.map_or(0, |last| last.rows);
        let tells_train_error = since_look >= self.validate_every / FEWEST_OF_A_TRAINING_ERROR;
        let look = Look {
            rows: self.learnt.rows,
            epoch: epoch + u32::from(self.learnt.rows > 0),
            train_error: finite(ErrorSum::from(self.learnt.train_sum).mean()).filter(|_| tells_train_error),
            validation_error: finite(validation_error),
        };
        self.learnt.train_sum = ErrorSum::default().into();
        let is_best = self.learnt.stopping.take(look, self.look_noise);
        if is_best {
            self.best = self.snapshot();
        }
        if self.early.is_none() && (1..=self.validate_every).contains(&look.rows) {
            self.early = Some(self.network.weights.clone());
        }
        (look, is_best)
    }

    /// Whether the validation error has not fallen for so many looks that it will not.
    pub(crate) fn is_over(&self) -> bool {
        self.learnt.stopping.is_over(self.patience)
    }

    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot { weights: self.network.weights.clone(), filter: self.filter.state() }
    }

    /// Goes back to the weights of the best look.
    pub(crate) fn revert(&mut self) {
        self.network.weights.clone_from(&self.best.weights);
    }
}

/// The weights that a seed draws.
fn first_network(params: &TrainParams, layout: Layout) -> Network {
    Network::random(layout, &Streams { seed: params.seed, scene: 0, attempt: 0, stage: Stage::Train, step: 0 })
}

/// Rows as the filter takes them.
#[derive(Default)]
struct HandedRows {
    /// As stored, in the order of learning.
    stored: Vec<f32>,
    inputs: Vec<f64>,
    targets: Vec<f64>,
    noise: Vec<f64>,
    outputs: Vec<f64>,
    chosen: Vec<usize>,
}

impl HandedRows {
    fn fill(&mut self, rows: &Rows, order: &[u32], objective: &Objective, is_shared: bool) {
        let (width, width_in) = (rows.width, objective.scaler.inputs());
        self.stored.resize(order.len() * width, 0.0);
        self.inputs.resize(order.len() * width_in, 0.0);
        let scale = |((inputs, stored), order): ((&mut [f64], &mut [f32]), &[u32])| {
            // Rows lie anywhere in the window. Fetched in a loop of its own, many of them come from memory at once.
            for (stored, &row) in stored.chunks_exact_mut(width).zip(order) {
                stored.copy_from_slice(rows.row(row as usize));
            }
            objective.scaler.scale(stored, inputs);
        };
        if is_shared {
            let parts = self.inputs.par_chunks_mut(ROWS_A_TASK * width_in);
            let parts = parts.zip(self.stored.par_chunks_mut(ROWS_A_TASK * width));
            parts.zip(order.par_chunks(ROWS_A_TASK)).for_each(scale);
        } else {
            scale(((&mut self.inputs, &mut self.stored), order));
        }
        self.targets.clear();
        self.noise.clear();
        for &row in order {
            let label = rows.labels[row as usize];
            self.targets.push(objective.targets[label.index()]);
            // R of a row is divided by its weight: exact in a Kalman filter.
            self.noise.push(1.0 / objective.weights.of(label, rows.corpora[row as usize]));
        }
    }

    /// Leaves those rows that are to be learnt; `first`: rows of the training before them.
    fn select(&mut self, selection: &mut Selection, first: u64) {
        let HandedRows { inputs, targets, noise, outputs, chosen, .. } = self;
        let width = inputs.len() / targets.len();
        for (output, target) in outputs.iter_mut().zip(targets.iter()) {
            *output = target - *output;
        }
        selection.select(first, outputs, noise, chosen);
        for (to, &from) in chosen.iter().enumerate() {
            inputs.copy_within(from * width..(from + 1) * width, to * width);
            (targets[to], noise[to]) = (targets[from], noise[from]);
        }
        inputs.truncate(chosen.len() * width);
        targets.truncate(chosen.len());
        noise.truncate(chosen.len());
    }

    /// The error of the first rows before they are learnt.
    fn error(&mut self, count: usize, network: &NetworkIn, is_shared: bool) -> ErrorSum {
        let width = self.inputs.len() / self.targets.len().max(1);
        let inputs = &self.inputs[..count * width];
        self.outputs.resize(count, 0.0);
        let outputs = |(rows, outputs): (&[f64], &mut [f64])| network.outputs(rows, outputs);
        if is_shared {
            let rows = inputs.par_chunks(ROWS_A_TASK * width);
            rows.zip(self.outputs.par_chunks_mut(ROWS_A_TASK)).for_each(outputs);
        } else {
            outputs((inputs, &mut self.outputs));
        }
        let mut sum = ErrorSum::default();
        for ((target, noise), output) in self.targets.iter().zip(&self.noise).zip(&self.outputs) {
            let error = target - output;
            sum += ErrorSum { squared: error * error / noise, weight: 1.0 / noise };
        }
        sum
    }
}
