//! The filters: what all of these tests stand on.

mod forms;
mod guards;

use super::{Counters, Filter, FilterError};
use crate::random::{Purpose, Stage, Stream, Streams};
use crate::train::params::*;
use crate::train::{Activation, Layout, Network};

fn stream(seed: u64) -> Stream {
    Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: 1 }.open(Purpose::InitialWeights)
}

fn normals(seed: u64, count: usize) -> Vec<f64> {
    let mut values = vec![0.0; count];
    stream(seed).fill_normal(0, &mut values);
    values
}

fn network(inputs: usize, hidden: &[usize]) -> Network {
    let streams = Streams { seed: 5, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    Network::random(
        Layout { inputs, hidden: hidden.to_vec(), bias: true, members: 1, activation: Activation::Logistic },
        &streams,
    )
}

/// A network of 87 weights, as small as has two hidden layers of some use, and rows that it can learn.
fn case(rows: usize) -> (Network, Vec<f64>, Vec<f64>, Vec<f64>) {
    let inputs = normals(1, rows * 8);
    let targets = inputs.chunks(8).map(|x| if x[0] * x[1] + x[2] > 0.3 { 0.9 } else { 0.1 }).collect();
    let noise = (0..rows).map(|k| if k % 3 == 0 { 0.5 } else { 1.0 }).collect();
    (network(8, &[6, 4]), inputs, targets, noise)
}

fn noise(p0: f64, q: f64) -> NoiseParams {
    NoiseParams { p0_over_r: p0, q_over_r: q, schedule: Schedule::Constant }
}

fn ekf(p0: f64, q: f64, precision: Precision, robust: bool, batch: usize) -> FilterParams {
    FilterParams::Ekf(EkfParams { noise: noise(p0, q), precision, robust, batch, rows: RowsLearnt::Every })
}

fn decoupled(groups: Groups, precision: Precision) -> FilterParams {
    FilterParams::Decoupled(DecoupledParams { noise: noise(10.0, 1e-5), precision, groups })
}

/// One of each kind.
fn all() -> Vec<FilterParams> {
    let mut all = Vec::new();
    for precision in [Precision::F32, Precision::F64] {
        for robust in [false, true] {
            all.extend([1, 5].map(|batch| ekf(10.0, 1e-5, precision, robust, batch)));
        }
        let by = [Groups::One, Groups::Layer, Groups::Node, Groups::InputNode, Groups::Weight];
        all.extend(by.map(|groups| decoupled(groups, precision)));
    }
    all.push(FilterParams::Backprop(BackpropParams::default()));
    all.push(FilterParams::Kronecker(KroneckerParams::default()));
    all.push(FilterParams::Ukf(UkfParams { noise: noise(1.0, 1e-5), ..UkfParams::default() }));
    all
}

fn build(params: &FilterParams, layout: &Layout) -> Result<Box<dyn Filter>, FilterError> {
    super::build(params, layout, 8.0)
}

fn learn(params: &FilterParams, rows: usize) -> (Vec<f64>, Counters) {
    let (mut network, inputs, targets, noise) = case(rows);
    let mut filter = build(params, &network.layout).unwrap();
    filter.learn(&mut network, &inputs, &targets, &noise);
    (network.weights, filter.counters())
}

fn bits(weights: &[f64]) -> Vec<u64> {
    weights.iter().map(|w| w.to_bits()).collect()
}

fn furthest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
