//! Stand-in until the filters are here.

use super::filter::{Counters, Filter, FilterError, FilterState};
use super::{Layout, Network, TrainParams};
use crate::math;
use crate::random::{Purpose, Stage, Streams};

pub struct Forward {
    layers: Vec<Vec<f64>>,
}

impl Forward {
    pub fn new(layout: &Layout) -> Forward {
        Forward { layers: layout.sizes().into_iter().map(|n| vec![0.0; n]).collect() }
    }

    pub fn output(&mut self, network: &Network, inputs: &[f64]) -> f64 {
        self.layers[0].copy_from_slice(inputs);
        let mut at = 0;
        for l in 1..self.layers.len() {
            let (before, after) = self.layers.split_at_mut(l);
            for y in &mut after[0] {
                let mut sum = 0.0;
                for x in &before[l - 1] {
                    sum += network.weights[at] * x;
                    at += 1;
                }
                if network.layout.bias {
                    sum += network.weights[at];
                    at += 1;
                }
                *y = 1.0 / (1.0 + math::exp(-sum));
            }
        }
        self.layers[self.layers.len() - 1][0]
    }
}

pub fn initial(layout: Layout, seed: u64) -> Network {
    let stream = Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: 0 }.open(Purpose::TrainRows);
    let mut weights = vec![0.0; layout.weights()];
    stream.fill_uniform(0, &mut weights);
    weights.iter_mut().for_each(|w| *w = (*w - 0.5) * 0.7);
    Network { layout, weights }
}

pub fn filter(_params: &TrainParams, layout: &Layout) -> Result<Box<dyn Filter>, FilterError> {
    Ok(Box::new(Steps { forward: Forward::new(layout), counters: Counters::default() }))
}

struct Steps {
    forward: Forward,
    counters: Counters,
}

impl Filter for Steps {
    fn learn(&mut self, network: &mut Network, inputs: &[f64], targets: &[f64], noise: &[f64]) {
        let width = network.layout.inputs;
        for ((x, &d), &r) in inputs.chunks(width).zip(targets).zip(noise) {
            let y = self.forward.output(network, x);
            let sizes = network.layout.sizes();
            let mut delta = vec![0.3 / r * (d - y) * y * (1.0 - y)];
            let mut end = network.weights.len();
            for l in (1..sizes.len()).rev() {
                let per = sizes[l - 1] + usize::from(network.layout.bias);
                let start = end - per * sizes[l];
                let mut below = vec![0.0; sizes[l - 1]];
                for (j, d) in delta.iter().enumerate() {
                    for i in 0..sizes[l - 1] {
                        let a = self.forward.layers[l - 1][i];
                        below[i] += d * network.weights[start + j * per + i] * a * (1.0 - a);
                        network.weights[start + j * per + i] += d * a;
                    }
                    if network.layout.bias {
                        network.weights[start + j * per + sizes[l - 1]] += d;
                    }
                }
                delta = below;
                end = start;
            }
            self.counters.updates += 1;
        }
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn state(&self) -> FilterState {
        let bytes = self.counters.updates.to_le_bytes().to_vec();
        FilterState { kind: "stand-in".into(), arrays: vec![("updates".into(), "U64", vec![1], bytes)] }
    }

    fn restore(&mut self, state: &FilterState) -> Result<(), FilterError> {
        self.counters.updates = u64::from_le_bytes(state.arrays[0].3[..8].try_into().unwrap_or_default());
        Ok(())
    }
}
