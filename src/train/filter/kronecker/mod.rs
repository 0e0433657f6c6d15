//! Mini-batches -> steps in the eigenvectors of a Kronecker-factored covariance of the gradients, averaged.
//!
//! For networks whose covariance of all weights (s x s) is too large or too dear for the extended Kalman filter: a batch costs the rows'
//! gradients and some products of matrices of the size of a layer. Source: Vyas et al. 2024 (SOAP), after Gupta et al. 2018 (Shampoo) and
//! Martens & Grosse 2015 (factors with the bias among the inputs); what the network is at any time is an average of the steps' weights that
//! forgets all but the last ninth (Shamir & Zhang 2013, polynomial decay). Deviations: bases start at the axes; batches grow with the rows that were
//! learnt, so that few rows are enough for many steps and later steps have less noise (Smith et al. 2018). Members of a network learn the
//! same rows side by side, each for itself, as if it were alone.
//!
//! The rate is constant after the first steps: the average does what a falling rate would, and needs no word of when training ends.

mod basis;
mod gradient;
mod layer;
mod portion;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use self::gradient::{MicroBatch, Row};
use self::layer::{KEPT, Layer};
use self::portion::Portion;
use super::lanes::Isa;
use super::state::{Reader, Writer};
use super::{Counters, Filter, FilterError, FilterState};
use crate::math;
use crate::train::network::forward::{ForwardWeights, MICRO_BATCH_ROWS};
use crate::train::params::KroneckerParams;
use crate::train::{Layout, Loss, Network};

const KIND: &str = "kronecker-f32";
/// Rows of the first batches, and of the last; between them a batch holds this share of the rows that were learnt before it.
const BATCH_ROWS: [u64; 2] = [64, 512];
const BATCH_SHARE: f64 = 0.005;
/// Steps in which the rate rises to what it is: the covariances know little yet.
const WARM_UP_STEPS: f64 = 100.0;
/// The exponent by which the average forgets: its weight lies mostly on the last 1 / (1 + this) of the steps.
const DECAY: f64 = 8.0;

/// Works on each, with its number: by all threads of the pool, or by this one alone.
fn each<T: Send>(list: &mut [T], is_shared: bool, work: impl Fn(usize, &mut T) + Send + Sync) {
    if is_shared && rayon::current_num_threads() > 1 {
        list.par_iter_mut().enumerate().for_each(|(number, one)| work(number, one));
    } else {
        list.iter_mut().enumerate().for_each(|(number, one)| work(number, one));
    }
}

/// Learns by batches; the network that it leaves is the average.
pub(super) struct Kronecker {
    clip: f64,
    /// Whether the threads of the pool share the work.
    is_shared: bool,
    /// With what its arrays' names begin.
    members: Vec<(String, Member)>,
}

/// One network of several, which learns as if it were alone.
struct Member {
    rate: f64,
    loss: Loss,
    isa: Isa,
    layers: Vec<Layer>,
    /// Their weights, as rows meet them.
    forward: ForwardWeights,
    micro_batches: Vec<MicroBatch>,
    counters: Counters,
    steps: u64,
    /// Steps that the average is of.
    averaged: u64,
    /// Rows of the batch that is begun.
    begun: u64,
}

/// A member as a state holds it.
struct Kept {
    counters: Counters,
    /// Steps, those of the average, rows of the batch that is begun.
    place: Vec<u64>,
    /// In the order of the layers.
    arrays: Vec<Vec<f32>>,
}

impl Kronecker {
    pub(super) fn new(params: &KroneckerParams, layout: &Layout, clip: f64) -> Kronecker {
        let member = |number| (layout.member_name(number), Member::new(params, layout, number));
        Kronecker { clip, is_shared: false, members: (0..layout.members).map(member).collect() }
    }
}

impl Member {
    fn new(params: &KroneckerParams, layout: &Layout, number: usize) -> Member {
        let bias = usize::from(layout.bias);
        let micro_batches = BATCH_ROWS[1].div_ceil(MICRO_BATCH_ROWS as u64);
        Member {
            rate: params.rate,
            loss: params.loss,
            isa: Isa::detect(),
            layers: layout.layers().map(|(inputs, neurons)| Layer::new(neurons, inputs + bias)).collect(),
            forward: ForwardWeights::new(layout, number),
            micro_batches: (0..micro_batches).map(|_| MicroBatch::new(layout)).collect(),
            counters: Counters::default(),
            steps: 0,
            averaged: 0,
            begun: 0,
        }
    }

    /// Learns rows in order; `weights`: of the average.
    fn learn(&mut self, weights: &mut [f64], rows: &[Row], is_shared: bool) {
        if self.is_fresh() {
            let mut weights = weights.iter().map(|w| *w as f32);
            self.layers.iter_mut().for_each(|layer| layer.weights.fill(&mut weights));
        }
        let mut rest = rows;
        while !rest.is_empty() {
            let (now, later) = rest.split_at(rest.len().min((self.batch() - self.begun) as usize));
            self.gather(now, is_shared);
            if self.begun == self.batch() {
                self.step(weights, is_shared);
            }
            rest = later;
        }
    }

    /// Rows of the batch that is begun, when it is whole.
    fn batch(&self) -> u64 {
        batch_after(self.counters.updates - self.begun)
    }

    fn is_fresh(&self) -> bool {
        self.averaged == 0 && self.begun == 0
    }

    /// Adds the gradient of rows that fit into the batch.
    fn gather(&mut self, rows: &[Row], is_shared: bool) {
        let Member { layers, forward, micro_batches, loss, isa, .. } = self;
        let weights: Vec<_> = layers.iter().map(|layer| &layer.weights).collect();
        forward.set(weights.iter().copied(), *isa);
        let micro_batches = &mut micro_batches[..rows.len().div_ceil(MICRO_BATCH_ROWS)];
        let parts: Vec<_> = rows.chunks(MICRO_BATCH_ROWS).collect();
        each(micro_batches, is_shared, |number, micro_batch| {
            micro_batch.run(&weights, forward, parts[number], *loss, *isa)
        });
        for micro_batch in micro_batches {
            layers.iter_mut().zip(&micro_batch.gradients).for_each(|(layer, gradient)| {
                layer.gradient.change_by(gradient, *isa, |x, y| x + y);
            });
        }
        self.begun += rows.len() as u64;
        self.counters.updates += rows.len() as u64;
    }

    /// The step of a whole batch, and the average with it.
    fn step(&mut self, weights: &mut [f64], is_shared: bool) {
        let (rows, steps) = (std::mem::take(&mut self.begun), self.steps);
        let count = (steps + 1) as f64;
        let rate = (self.rate * (count / WARM_UP_STEPS).min(1.0)) as f32;
        let seen = (1.0 - math::pow(KEPT, count)) as f32;
        let isa = self.isa;
        if !self.layers.iter().all(Layer::is_sound) {
            self.layers.iter_mut().for_each(|layer| layer.zero_gradient(isa));
            self.counters.updates -= rows;
            self.counters.rejected += rows;
            return;
        }
        each(&mut self.layers, is_shared, |_, layer| layer.step(rows, steps, rate, seen, isa));
        self.steps += 1;
        self.averaged += 1;
        let share = ((DECAY + 1.0) / (self.averaged as f64 + DECAY)).min(1.0);
        let raw = self.layers.iter().flat_map(|layer| layer.weights.values());
        for (average, raw) in weights.iter_mut().zip(raw) {
            *average += share * (f64::from(raw) - *average);
        }
        self.counters.take_weights(weights);
    }

    fn save(&self, name: &str, writer: &mut Writer) {
        self.counters.save(name, writer);
        writer.counts(&format!("{name}place"), [self.steps, self.averaged, self.begun].into_iter());
        for (number, layer) in self.layers.iter().enumerate() {
            layer
                .arrays()
                .iter()
                .for_each(|(array, values)| writer.reals(&format!("{name}{number}.{array}"), values.values()));
        }
    }

    /// What a state holds of it.
    fn read(&self, name: &str, reader: &Reader) -> Result<Kept, FilterError> {
        let counters = Counters::load(name, reader)?;
        let place = reader.counts(&format!("{name}place"), 3)?;
        let (begun, updates) = (place[2], counters.updates);
        if begun > updates || begun > batch_after(updates - begun) {
            return Err(FilterError::OutOfRange(format!("a batch of {begun} rows is begun after {updates} rows")));
        }
        let mut arrays = Vec::new();
        for (number, layer) in self.layers.iter().enumerate() {
            for (array, of) in layer.arrays() {
                arrays.push(reader.reals::<f32>(&format!("{name}{number}.{array}"), of.rows * of.columns)?);
            }
        }
        Ok(Kept { counters, place, arrays })
    }
}

/// Rows of the batch that follows so many.
fn batch_after(learnt: u64) -> u64 {
    let [first, last] = BATCH_ROWS;
    let rows = ((BATCH_SHARE * learnt as f64) as u64).clamp(first, last);
    rows - rows % first
}

impl Filter for Kronecker {
    fn learn(&mut self, network: &mut Network, inputs: &[f64], targets: &[f64], noise: &[f64]) {
        self.learn_portions(network, inputs, targets, noise, &[targets.len()]);
    }

    fn learn_portions(
        &mut self,
        network: &mut Network,
        inputs: &[f64],
        targets: &[f64],
        noise: &[f64],
        ends: &[usize],
    ) {
        let (width, clip) = (network.layout.inputs, self.clip);
        let mut portions: Vec<Portion> = ends.iter().map(|_| Portion::default()).collect();
        each(&mut portions, self.is_shared, |number, portion| {
            let range = number.checked_sub(1).map_or(0, |before| ends[before])..ends[number];
            let inputs = &inputs[range.start * width..range.end * width];
            portion.take(inputs, &targets[range.clone()], &noise[range], clip);
        });
        let size = network.weights.len() / self.members.len();
        let mut members: Vec<_> = self.members.iter_mut().zip(network.weights.chunks_exact_mut(size)).collect();
        // Threads take whole members, and parts of one where there are more threads.
        let is_shared = self.is_shared;
        let is_split = is_shared && rayon::current_num_threads() > members.len();
        each(&mut members, is_shared, |_, ((_, member), weights)| {
            for Portion { rows, seen } in &portions {
                member.counters.clipped += seen.clipped;
                member.counters.rejected += seen.rejected;
                member.learn(weights, rows, is_split);
            }
        });
    }

    fn share_work(&mut self) {
        self.is_shared = true;
    }

    /// Rows that every member learnt, and rows that one or another did not.
    fn counters(&self) -> Counters {
        let of_members = self.members.iter().map(|(_, member)| member.counters);
        let both = |a: Counters, b: Counters| Counters {
            updates: a.updates.min(b.updates),
            rejected: a.rejected.max(b.rejected),
            cut_back: a.cut_back + b.cut_back,
            ..a
        };
        of_members.reduce(both).unwrap_or_default()
    }

    fn state(&self) -> FilterState {
        let mut writer = Writer::new(KIND);
        self.members.iter().for_each(|(name, member)| member.save(name, &mut writer));
        writer.finish()
    }

    fn restore(&mut self, state: &FilterState) -> Result<(), FilterError> {
        let reader = Reader::new(state, KIND)?;
        // All is read before any is taken, so that a state that does not fit changes nothing.
        let read =
            self.members.iter().map(|(name, member)| member.read(name, &reader)).collect::<Result<Vec<_>, _>>()?;
        for ((_, member), Kept { counters, place, arrays: values }) in self.members.iter_mut().zip(read) {
            let arrays = member.layers.iter_mut().flat_map(Layer::arrays_mut);
            arrays.zip(values).for_each(|((_, array), values)| array.fill(values.into_iter()));
            (member.counters, member.steps, member.averaged, member.begun) = (counters, place[0], place[1], place[2]);
        }
        Ok(())
    }

    fn begin_anew(&mut self) {
        for (_, member) in &mut self.members {
            (member.averaged, member.begun) = (0, 0);
            let isa = member.isa;
            member.layers.iter_mut().for_each(|layer| layer.zero_gradient(isa));
        }
    }
}
