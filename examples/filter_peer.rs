//! The filter side of `scripts/peers/jax_ekf.py`: CPU time of whole training steps (forward run, gradient, update), one thread.
//!
//! `filter_peer` prints rows per second of each filter for three networks, medians of 5 interleaved rounds; numbers as
//! arguments choose other hidden layers (`filter_peer 16x16 32`). `filter_peer serve` reads lines `HIDDEN FILTER ROWS`
//! and answers each with the CPU seconds that learning ROWS rows took.

use std::collections::BTreeMap;
use std::io::{BufRead, Write};

use marsyard::pipeline::clock::thread_cpu_s;
use marsyard::random::{Purpose, Stage, Streams};
use marsyard::train::filter::build;
use marsyard::train::params::{
    BackpropParams, DecoupledParams, EkfParams, FilterParams, Groups, NoiseParams, Precision, UkfParams,
};
use marsyard::train::{Filter, Layout, Network};

const INPUTS: usize = 14;
const ROWS: usize = 4096;
const FILTERS: [&str; 12] = [
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
    let ekf = |robust, batch| FilterParams::Ekf(EkfParams { noise: noise.clone(), precision, robust, batch });
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
struct Trainee {
    network: Network,
    filter: Box<dyn Filter>,
    next: usize,
}

/// Rows to learn: normal features, a bent border between the classes.
struct Rows {
    inputs: Vec<f64>,
    targets: Vec<f64>,
    noise: Vec<f64>,
}

impl Trainee {
    fn new(hidden: &str, filter: &str) -> Result<Trainee, String> {
        let sizes: Result<Vec<usize>, _> = hidden.split('x').map(str::parse).collect();
        let layout = Layout { inputs: INPUTS, hidden: sizes.map_err(|e| format!("{hidden}: {e}"))?, bias: true };
        let params = settings(filter).ok_or_else(|| format!("{filter}: one of {FILTERS:?}"))?;
        let filter = build(&params, &layout, f64::INFINITY).map_err(|e| e.to_string())?;
        let streams = Streams { seed: 1, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
        Ok(Trainee { network: Network::random(layout, &streams), filter, next: 0 })
    }

    /// CPU seconds of this thread for `count` rows.
    fn learn(&mut self, rows: &Rows, mut count: usize) -> f64 {
        let before = cpu_ns();
        while count > 0 {
            let (first, take) = (self.next, count.min(ROWS - self.next));
            let inputs = &rows.inputs[first * INPUTS..(first + take) * INPUTS];
            let part = first..first + take;
            self.filter.learn(&mut self.network, inputs, &rows.targets[part.clone()], &rows.noise[part]);
            self.next = (first + take) % ROWS;
            count -= take;
        }
        (cpu_ns() - before) as f64 / 1e9
    }
}

fn rows() -> Rows {
    let streams = Streams { seed: 2, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    let mut inputs = vec![0.0; ROWS * INPUTS];
    streams.open(Purpose::InitialWeights).fill_normal(0, &mut inputs);
    let targets = inputs.chunks(INPUTS).map(|x| if x[0] * x[1] + x[2] > 1.0 { 0.9 } else { 0.1 }).collect();
    Rows { inputs, targets, noise: vec![1.0; ROWS] }
}

/// Nanoseconds this thread has spent on a CPU.
fn cpu_ns() -> i64 {
    (1e9 * thread_cpu_s()) as i64
}

fn serve(rows: &Rows) -> Result<(), String> {
    let mut trainees: BTreeMap<String, Trainee> = BTreeMap::new();
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(|e| e.to_string())?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let [hidden, filter, count] = words[..] else { return Err(format!("`{line}` is not `HIDDEN FILTER ROWS`")) };
        let count = count.parse().map_err(|e| format!("{count}: {e}"))?;
        let key = format!("{hidden} {filter}");
        if !trainees.contains_key(&key) {
            trainees.insert(key.clone(), Trainee::new(hidden, filter)?);
        }
        let seconds = trainees.get_mut(&key).map_or(0.0, |trainee| trainee.learn(rows, count));
        println!("{seconds:.9}");
        std::io::stdout().flush().map_err(|e| e.to_string())?;
    }
    Ok(())
}

fn table(rows: &Rows, networks: &[String]) -> Result<(), String> {
    for hidden in networks {
        let mut trainees = Vec::new();
        for filter in FILTERS {
            if let Ok(mut trainee) = Trainee::new(hidden, filter) {
                // About 0.1 s a round.
                let count = ((0.1 / (trainee.learn(rows, 16) / 16.0)) as usize).clamp(16, 1 << 20) / 8 * 8;
                trainees.push((filter, trainee, count, Vec::new()));
            }
        }
        for _ in 0..5 {
            for (_, trainee, count, rates) in &mut trainees {
                rates.push(*count as f64 / trainee.learn(rows, *count));
            }
        }
        for (filter, trainee, _, mut rates) in trainees {
            rates.sort_unstable_by(f64::total_cmp);
            let weights = trainee.network.weights.len();
            println!("{hidden:>10} {weights:>6} weights  {filter:<11} {:>10.0} rows/s", rates[rates.len() / 2]);
        }
    }
    Ok(())
}

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let rows = rows();
    match arguments.first().map(String::as_str) {
        Some("serve") => serve(&rows),
        None => table(&rows, &["16x16", "32x32", "32x32x32"].map(String::from)),
        Some(_) => table(&rows, &arguments),
    }
}
