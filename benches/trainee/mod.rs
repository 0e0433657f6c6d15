//! Networks of 14 inputs in training, and rows to train them on: for the bench of the filters and for their peers.

use marsyard::measure::clock::thread_cpu_s;
use marsyard::random::{Purpose, Stage, Streams};
use marsyard::train::filter::build;
use marsyard::train::params::{
    BackpropParams, DecoupledParams, EkfParams, FilterParams, Groups, NoiseParams, Precision, RowsLearnt, UkfParams,
};
use marsyard::train::{Activation, Filter, Layout, Network};

const INPUTS: usize = 14;
/// Rows that are gone through again and again.
const ROWS: usize = 4096;
/// The filters by the names used here.
pub const FILTERS: [&str; 12] = [
    "ekf-f32",
    "ekf-f64",
    "batch8-f32",
    "batch8-f64",
    "ud-f32",
    "ud-f64",
    "layer-f32",
    "node-f32",
    "node-f64",
    "weight",
    "backprop",
    "ukf",
];

/// A filter by the name used here.
fn settings(name: &str) -> Option<FilterParams> {
    let noise = NoiseParams::default();
    let (form, precision) = match name.rsplit_once('-') {
        Some((form, "f32")) => (form, Precision::F32),
        Some((form, "f64")) => (form, Precision::F64),
        _ => (name, Precision::F64),
    };
    let ekf = |robust, batch| {
        FilterParams::Ekf(EkfParams { noise: noise.clone(), precision, robust, batch, rows: RowsLearnt::Every })
    };
    let decoupled = |groups| FilterParams::Decoupled(DecoupledParams { noise: noise.clone(), precision, groups });
    Some(match form {
        "ekf" => ekf(false, 1),
        "batch8" => ekf(false, 8),
        "ud" => ekf(true, 1),
        "layer" => decoupled(Groups::Layer),
        "node" => decoupled(Groups::Node),
        "weight" => decoupled(Groups::Weight),
        "backprop" => FilterParams::Backprop(BackpropParams::default()),
        "ukf" => FilterParams::Ukf(UkfParams::default()),
        _ => return None,
    })
}

/// A network and a filter in training.
pub struct Trainee {
    pub network: Network,
    filter: Box<dyn Filter>,
    next: usize,
}

/// Rows to learn: normal features, a bent border between the classes.
pub struct Rows {
    inputs: Vec<f64>,
    targets: Vec<f64>,
    noise: Vec<f64>,
}

impl Trainee {
    pub fn new(hidden: &str, filter: &str) -> Result<Trainee, String> {
        let sizes: Result<Vec<usize>, _> = hidden.split('x').map(str::parse).collect();
        let layout = Layout {
            inputs: INPUTS,
            hidden: sizes.map_err(|e| format!("{hidden}: {e}"))?,
            bias: true,
            members: 1,
            activation: Activation::Logistic,
        };
        let params = settings(filter).ok_or_else(|| format!("{filter}: one of {FILTERS:?}"))?;
        let filter = build(&params, &layout, f64::INFINITY).map_err(|e| e.to_string())?;
        let streams = Streams { seed: 1, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
        Ok(Trainee { network: Network::random(layout, &streams), filter, next: 0 })
    }

    /// CPU seconds of this thread for `count` rows.
    pub fn learn(&mut self, rows: &Rows, mut count: usize) -> f64 {
        let begun = thread_cpu_s();
        while count > 0 {
            let (first, take) = (self.next, count.min(ROWS - self.next));
            let inputs = &rows.inputs[first * INPUTS..(first + take) * INPUTS];
            let part = first..first + take;
            self.filter.learn(&mut self.network, inputs, &rows.targets[part.clone()], &rows.noise[part]);
            self.next = (first + take) % ROWS;
            count -= take;
        }
        thread_cpu_s() - begun
    }
}

pub fn rows() -> Rows {
    let streams = Streams { seed: 2, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    let mut inputs = vec![0.0; ROWS * INPUTS];
    streams.open(Purpose::InitialWeights).fill_normal(0, &mut inputs);
    let targets = inputs.chunks(INPUTS).map(|x| if x[0] * x[1] + x[2] > 1.0 { 0.9 } else { 0.1 }).collect();
    Rows { inputs, targets, noise: vec![1.0; ROWS] }
}
