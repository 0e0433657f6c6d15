//! Corpora and parameters -> a run folder: the loop itself.
//!
//! A checkpoint holds the place in the stream, the weights, the filter's memory, the best of both and the patience. It may be
//! written after any look at the validation split, and when training is interrupted; whenever that is, what follows has the same
//! bits, because the place alone says which rows come next and in which portions they are learnt.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

use super::filter::{self, Counters, Filter};
use super::folder::{self, Line, LookLog, RunFolder};
use super::rows::LeftOut;
use super::scaling::{Weights, scaler};
use super::state::{self, Snapshot};
use super::stopping::{Look, Stop, Stopping};
use super::stream::{Course, Stream, Window};
use super::validation::{ErrorSum, Judge, Validation, each_group};
use super::{About, Layout, MODEL_FORMAT, Model, Network, Sources, TrainError, TrainParams, curves, quantiles};
use crate::cells::CellParams;
use crate::corpus::Split;
use crate::drive::Rover;
use crate::random::{Stage, Streams};
use crate::sweep::Sensor;

/// Rows learnt in one portion, at most; between two portions training may be interrupted.
const PORTION_ROWS: usize = 256;

/// Checkpoints take at most this share of the time.
const CHECKPOINT_SHARE: f64 = 0.05;

/// What is trained on what.
pub struct Setup {
    pub params: TrainParams,
    /// The resolved config as text.
    pub config_yaml: String,
    pub sources: Arc<Sources>,
    pub origin: Origin,
    /// The run folder.
    pub out: PathBuf,
    pub resume: bool,
    pub init: Option<Init>,
    /// Windows read ahead; never changes a bit.
    pub ahead: usize,
}

/// What a model says of the cells that it was trained on.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    pub cells: CellParams,
    pub rover: Rover,
    pub sensor: Sensor,
    pub mount: [f64; 6],
}

/// A network to start from.
#[derive(Clone, Debug)]
pub struct Init {
    /// The file, for messages.
    pub path: String,
    pub model: Model,
    /// The filter's memory, where it is known.
    pub filter: Option<Vec<u8>>,
}

/// What happens while training.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// Before the first row.
    Start(&'a Start),
    /// So many rows are learnt.
    Rows(u64),
    Look {
        look: &'a Look,
        best: &'a Look,
        is_best: bool,
        counters: Counters,
    },
    /// Training goes on from here after a kill.
    Checkpoint {
        rows: u64,
    },
}

/// What is known before the first row is learnt.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    pub train_rows: u64,
    pub validation_rows: u64,
    pub untraversable_share: f64,
    pub weights: usize,
    pub features: Vec<String>,
    /// Features that never vary.
    pub constant: Vec<String>,
    pub class_weights: [f64; 2],
    pub validate_every: u64,
    pub stream_bytes: u64,
    /// Rows learnt before a kill.
    pub resumed_at: u64,
    /// Only one label is there.
    pub one_class: bool,
    /// Whether `--init` brought a covariance.
    pub covariance: Option<bool>,
}

/// How it ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    Done(Box<Summary>),
    /// Asked to stop; the checkpoint is written.
    Interrupted {
        rows: u64,
    },
}

/// `training.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    pub marsyard_training: u32,
    pub stopped: Stop,
    pub best: Look,
    pub last: Look,
    pub looks: u64,
    pub train_rows: u64,
    pub validation_rows: u64,
    /// Learnt, rows of later epochs counted again.
    pub rows_learnt: u64,
    /// In all epochs.
    pub left_out: LeftOut,
    pub left_out_of_validation: LeftOut,
    pub class_weights: [f64; 2],
    pub weights: usize,
    pub features: Vec<String>,
    pub constant_features: Vec<String>,
    pub filter: String,
    /// Of the filter at its last update; where it started from another run's covariance, that run's included.
    pub counters: Counters,
    pub corpora: Json,
    /// Hash of the network and covariance it started from.
    pub init: Option<String>,
    pub config: TrainParams,
}

/// Where training stands.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Place {
    epoch: u32,
    window: u32,
    /// Rows of the window that are learnt.
    offset: u64,
    rows: u64,
    train_sum: SumBits,
    left_out: LeftOut,
    stopping: Stopping,
    stopped: Option<Stop>,
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

/// Trains, or goes on training, until the validation error rises, the epochs are over, or `stop` is raised.
pub fn train(setup: &Setup, stop: &AtomicBool, tell: &mut dyn FnMut(Event)) -> Result<Outcome, TrainError> {
    let identity = identity(setup);
    if setup.resume {
        if let Some(there) = finished(setup)? {
            let begun = json!({"config": there.config, "corpora": there.corpora, "init": there.init});
            check_identity(setup, &begun, &identity)?;
            return Ok(Outcome::Done(Box::new(there)));
        }
    } else if setup.out.exists() {
        // Said before the corpora are read; creating the folder says it again, whoever was faster.
        return Err(TrainError::Exists { path: setup.out.display().to_string() });
    }
    let mut training = Training::prepare(setup, identity)?;
    tell(Event::Start(&training.start));
    training.learn(stop, tell)
}

/// What must be the same for a run to go on.
fn identity(setup: &Setup) -> Json {
    let corpora: Vec<Json> = setup
        .sources
        .list
        .iter()
        .map(|source| {
            json!({
                "name": source.name,
                "corpus_id": source.corpus_id,
                "manifest_sha256": source.manifest_sha256,
                "scene_plan_hash": source.scene_plan_hash,
                "weight": source.weight,
            })
        })
        .collect();
    let init = setup.init.as_ref().map(|init| {
        let weights = init.model.network.weights.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        let mut hasher = blake3::Hasher::new();
        hasher.update(&weights).update(init.filter.as_deref().unwrap_or_default());
        hasher.finalize().to_hex().to_string()
    });
    json!({"config": setup.params, "corpora": corpora, "init": init})
}

fn check_identity(setup: &Setup, there: &Json, here: &Json) -> Result<(), TrainError> {
    let differs = |what: &str| TrainError::OtherRun { path: setup.out.display().to_string(), what: what.into() };
    for (key, what) in [
        ("config", "the config is another one (its own is in train.yaml)"),
        ("corpora", "the corpora, or their weights, are others"),
        ("init", "the network it starts from is another one"),
    ] {
        if there[key] != here[key] {
            return Err(differs(what));
        }
    }
    Ok(())
}

fn finished(setup: &Setup) -> Result<Option<Summary>, TrainError> {
    let path = setup.out.join(folder::SUMMARY);
    if !path.is_file() {
        return Ok(None);
    }
    let bad = |reason: String| TrainError::BadState { path: path.display().to_string(), reason };
    let bytes = std::fs::read(&path).map_err(|error| bad(error.to_string()))?;
    serde_json::from_slice(&bytes).map(Some).map_err(|error| bad(error.to_string()))
}

/// What a killed run left.
struct Checkpoint {
    place: Place,
    now: Snapshot,
    best: Snapshot,
}

fn read_checkpoint(
    setup: &Setup,
    run: &RunFolder,
    identity: &Json,
    weights: usize,
) -> Result<Option<Checkpoint>, TrainError> {
    if !run.holds(folder::CHECKPOINT) {
        return Ok(None);
    }
    let path = run.path().join(folder::CHECKPOINT).display().to_string();
    let bad = |reason: String| TrainError::BadState { path: path.clone(), reason };
    let (header, mut snapshots) = state::from_bytes(&run.read(folder::CHECKPOINT)?).map_err(bad)?;
    check_identity(setup, &header["identity"], identity)?;
    let place: Place = serde_json::from_value(header["place"].clone()).map_err(|error| bad(error.to_string()))?;
    let both = snapshots.remove("now").zip(snapshots.remove("best"));
    let (now, best) = both.ok_or_else(|| bad("it is not whole".into()))?;
    if now.weights.len() != weights || best.weights.len() != weights {
        return Err(bad(format!("it holds {} weights", now.weights.len())));
    }
    Ok(Some(Checkpoint { place, now, best }))
}

struct Training<'s> {
    setup: &'s Setup,
    run: RunFolder,
    identity: Json,
    judge: Judge,
    validation: Validation,
    network: Network,
    filter: Box<dyn Filter>,
    best: Snapshot,
    place: Place,
    log: LookLog,
    started: Instant,
    elapsed_before: Duration,
    /// When the last checkpoint was done, and how long it took.
    checkpoint: (Instant, Duration),
    start: Start,
}

impl<'s> Training<'s> {
    fn prepare(setup: &'s Setup, identity: Json) -> Result<Training<'s>, TrainError> {
        let (params, sources) = (&setup.params, &setup.sources);
        let counts = class_counts(sources)?;
        let labelled: u64 = counts.iter().flatten().sum();
        let layout =
            Layout { inputs: sources.features.len(), hidden: params.network.hidden.clone(), bias: params.network.bias };
        let validation = Validation::open(Arc::clone(sources))?;
        if labelled == 0 {
            let unlabelled = sources.list.iter().map(|source| source.labels(Split::Train).unknown).sum();
            return Err(no_rows(sources, Split::Train, LeftOut { unlabelled, ..LeftOut::default() }));
        }
        if validation.rows == 0 {
            return Err(no_rows(sources, Split::Validation, validation.left_out));
        }
        let weights = layout.weights();
        if labelled < weights as u64 && !params.allow_few_rows {
            return Err(TrainError::FewRows { rows: labelled, weights });
        }
        let (mut scaler, constant) = scaler(sources, params.clip);
        if let Some(init) = &setup.init {
            // Its weights mean what they mean behind its own scaling.
            scaler.clone_from(&init.model.about.scaler);
        }
        let corpora: Vec<f64> = sources.list.iter().map(|source| source.weight).collect();
        let judge = Judge { scaler, targets: params.targets, weights: Weights::new(&counts, &corpora, params.balance) };
        let mut filter = filter::build(&params.filter, &layout, params.clip)?;
        let streams = Streams { seed: params.seed, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
        let mut network = Network::random(layout, &streams);
        let covariance =
            setup.init.as_ref().map(|init| start_from(init, sources, &mut network, filter.as_mut())).transpose()?;
        // Nothing is written before everything is known to be sound.
        let run = if setup.resume { RunFolder::resume(&setup.out)? } else { RunFolder::create(&setup.out)? };
        let mut place = Place::default();
        let mut best = Snapshot { weights: network.weights.clone(), filter: filter.state() };
        if let Some(checkpoint) = read_checkpoint(setup, &run, &identity, network.weights.len())? {
            filter.restore(&checkpoint.now.filter)?;
            network.weights = checkpoint.now.weights;
            (place, best) = (checkpoint.place, checkpoint.best);
        }
        let (log, elapsed_s) = run.looks(place.stopping.looks)?;
        run.write(folder::CONFIG, setup.config_yaml.as_bytes())?;
        let untraversable: u64 = counts.iter().map(|of| of[1]).sum();
        Ok(Training {
            start: Start {
                train_rows: labelled,
                validation_rows: validation.rows,
                untraversable_share: untraversable as f64 / labelled as f64,
                weights,
                features: sources.features.clone(),
                constant,
                class_weights: judge.weights.class,
                validate_every: params.validate_every.unwrap_or_else(|| 20_000.min(labelled / 5)).max(1),
                stream_bytes: super::stream::memory_bytes(sources, setup.ahead),
                resumed_at: place.rows,
                one_class: untraversable == 0 || untraversable == labelled,
                covariance,
            },
            identity,
            best,
            judge,
            validation,
            network,
            filter,
            place,
            log,
            started: Instant::now(),
            elapsed_before: Duration::try_from_secs_f64(elapsed_s).unwrap_or_default(),
            checkpoint: (Instant::now(), Duration::ZERO),
            setup,
            run,
        })
    }

    fn learn(&mut self, stop: &AtomicBool, tell: &mut dyn FnMut(Event)) -> Result<Outcome, TrainError> {
        if self.place.stopping.looks == 0 {
            self.look(tell)?;
            self.save(tell)?;
        }
        if self.place.stopped.is_none() {
            let Place { epoch, window, .. } = self.place;
            let course = Course { seed: self.setup.params.seed, epoch, window, epochs: self.setup.params.epochs };
            for window in Stream::start(Arc::clone(&self.setup.sources), course, self.setup.ahead) {
                let going_on = self.window(&window?, stop, tell)?;
                if self.place.stopped.is_some() {
                    break;
                }
                if !going_on {
                    self.save(tell)?;
                    return Ok(Outcome::Interrupted { rows: self.place.rows });
                }
            }
        }
        if self.place.stopped.is_none() {
            if self.place.stopping.last.is_some_and(|last| last.rows < self.place.rows) {
                self.look(tell)?;
            }
            self.place.stopped = Some(self.place.stopped.unwrap_or(Stop::Epochs));
        }
        self.save(tell)?;
        self.finish()
    }

    /// Learns what is left of a window; false where training was asked to stop.
    fn window(&mut self, window: &Window, stop: &AtomicBool, tell: &mut dyn FnMut(Event)) -> Result<bool, TrainError> {
        if (self.place.epoch, self.place.window) != (window.epoch, window.window) {
            (self.place.epoch, self.place.window, self.place.offset) = (window.epoch, window.window, 0);
        }
        let count = window.order.len();
        let mut portion = Portion::default();
        while (self.place.offset as usize) < count {
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let offset = self.place.offset as usize;
            let until_look = self.start.validate_every - self.place.rows % self.start.validate_every;
            let end = count.min(offset - offset % PORTION_ROWS + PORTION_ROWS);
            let end = end.min(offset + usize::try_from(until_look).unwrap_or(usize::MAX));
            portion.fill(window, offset..end, &self.judge);
            let mut sum = ErrorSum::from(self.place.train_sum);
            sum += portion.error(&self.network);
            self.place.train_sum = sum.into();
            self.filter.learn(&mut self.network, &portion.inputs, &portion.targets, &portion.noise);
            self.place.offset = end as u64;
            self.place.rows += (end - offset) as u64;
            tell(Event::Rows(self.place.rows));
            if self.place.rows.is_multiple_of(self.start.validate_every) {
                self.look(tell)?;
                if self.place.stopping.is_over(self.setup.params.patience) {
                    self.place.stopped = Some(Stop::Patience);
                    return Ok(true);
                }
                let (last, cost) = self.checkpoint;
                if last.elapsed().mul_f64(CHECKPOINT_SHARE) > cost {
                    self.save(tell)?;
                }
            }
        }
        self.place.left_out += window.rows.left_out;
        Ok(true)
    }

    fn look(&mut self, tell: &mut dyn FnMut(Event)) -> Result<(), TrainError> {
        let finite = |error: f64| error.is_finite().then_some(error);
        let look = Look {
            rows: self.place.rows,
            epoch: self.place.epoch + u32::from(self.place.rows > 0),
            train_error: finite(ErrorSum::from(self.place.train_sum).mean()),
            validation_error: finite(self.validation.error(&self.judge, &self.network)?),
        };
        self.place.train_sum = ErrorSum::default().into();
        let is_best = self.place.stopping.take(look);
        if is_best {
            self.best = self.snapshot();
        }
        let elapsed_s = (self.elapsed_before + self.started.elapsed()).as_secs_f64();
        self.log.push(&Line { look, best: is_best, elapsed_s })?;
        let best = self.place.stopping.best.as_ref().unwrap_or(&look);
        tell(Event::Look { look: &look, best, is_best, counters: self.filter.counters() });
        Ok(())
    }

    fn snapshot(&self) -> Snapshot {
        Snapshot { weights: self.network.weights.clone(), filter: self.filter.state() }
    }

    fn save(&mut self, tell: &mut dyn FnMut(Event)) -> Result<(), TrainError> {
        let begun = Instant::now();
        let header = json!({"identity": self.identity, "place": self.place});
        let bytes = state::to_bytes(&header, &[("now", &self.snapshot()), ("best", &self.best)]);
        self.run.write(folder::CHECKPOINT, &bytes)?;
        self.checkpoint = (Instant::now(), begun.elapsed());
        tell(Event::Checkpoint { rows: self.place.rows });
        Ok(())
    }

    /// Reverts to the best, and writes everything that is left of a training.
    fn finish(&mut self) -> Result<Outcome, TrainError> {
        let sources = &self.setup.sources;
        self.network.weights.clone_from(&self.best.weights);
        let summary = self.summary();
        let model = self.model(quantiles::of_train_split(sources, self.setup.params.seed, &self.judge.scaler)?);
        self.run.write(folder::MODEL, &model.save()?)?;
        let about = json!({"features": sources.features, "best": summary.best});
        self.run.write(folder::FILTER, &state::to_bytes(&about, &[("best", &self.best)]))?;
        if let Some(svg) = curves::svg(&self.run.read_looks()?, Some(&summary.best)) {
            self.run.write(folder::CURVES, svg.as_bytes())?;
        }
        let text = serde_json::to_string_pretty(&summary).expect("a summary is plain data") + "\n";
        self.run.write(folder::SUMMARY, text.as_bytes())?;
        self.run.remove(folder::CHECKPOINT)?;
        Ok(Outcome::Done(Box::new(summary)))
    }

    fn summary(&self) -> Summary {
        let none = Look { rows: 0, epoch: 0, train_error: None, validation_error: None };
        let Stopping { looks, last, best, .. } = self.place.stopping;
        Summary {
            marsyard_training: 1,
            stopped: self.place.stopped.unwrap_or(Stop::Epochs),
            best: best.unwrap_or(none),
            last: last.unwrap_or(none),
            looks,
            train_rows: self.start.train_rows,
            validation_rows: self.start.validation_rows,
            rows_learnt: self.place.rows,
            left_out: self.place.left_out,
            left_out_of_validation: self.validation.left_out,
            class_weights: self.judge.weights.class,
            weights: self.start.weights,
            features: self.setup.sources.features.clone(),
            constant_features: self.start.constant.clone(),
            filter: self.best.filter.kind.clone(),
            counters: self.filter.counters(),
            corpora: self.identity["corpora"].clone(),
            init: self.identity["init"].as_str().map(str::to_string),
            config: self.setup.params.clone(),
        }
    }

    fn model(&self, quantiles: Vec<[f64; 7]>) -> Model {
        let Setup { params, sources, origin, .. } = self.setup;
        Model {
            network: self.network.clone(),
            about: About {
                marsyard_model: MODEL_FORMAT,
                inputs: self.network.layout.inputs,
                hidden: self.network.layout.hidden.clone(),
                bias: self.network.layout.bias,
                features: sources.features.clone(),
                scaler: self.judge.scaler.clone(),
                quantiles,
                targets: params.targets,
                thresholds: params.thresholds.clone(),
                cells: origin.cells.clone(),
                rover: origin.rover.clone(),
                sensor: origin.sensor.clone(),
                mount: origin.mount,
                corpus_ids: sources.list.iter().map(|source| source.corpus_id.clone()).collect(),
                corpus_names: sources.list.iter().map(|source| source.name.clone()).collect(),
            },
        }
    }
}

/// Rows as the filter takes them.
#[derive(Default)]
struct Portion {
    inputs: Vec<f64>,
    targets: Vec<f64>,
    noise: Vec<f64>,
    outputs: Vec<f64>,
}

impl Portion {
    fn fill(&mut self, window: &Window, range: std::ops::Range<usize>, judge: &Judge) {
        let width = window.rows.width;
        self.inputs.resize(range.len() * width, 0.0);
        self.targets.clear();
        self.noise.clear();
        for (out, &row) in self.inputs.chunks_exact_mut(width).zip(&window.order[range]) {
            let row = row as usize;
            judge.scaler.scale(window.rows.row(row), out);
            let label = window.rows.labels[row];
            self.targets.push(judge.targets[usize::from(label)]);
            // R of a row is divided by its weight: exact in a Kalman filter.
            self.noise.push(1.0 / judge.weights.of(label, window.rows.corpora[row]));
        }
    }

    /// The error before these rows are learnt.
    fn error(&mut self, network: &Network) -> ErrorSum {
        self.outputs.resize(self.targets.len(), 0.0);
        network.outputs(&self.inputs, &mut self.outputs);
        let mut sum = ErrorSum::default();
        for ((target, noise), output) in self.targets.iter().zip(&self.noise).zip(&self.outputs) {
            let error = target - output;
            sum += ErrorSum { squared: error * error / noise, weight: 1.0 / noise };
        }
        sum
    }
}

/// Rows of each class in the train split, by corpus.
fn class_counts(sources: &Arc<Sources>) -> Result<Vec<[u64; 2]>, TrainError> {
    if sources.rule.is_none() {
        let of = |labels: crate::corpus::stats::LabelCounts| [labels.traversable, labels.untraversable];
        return Ok(sources.list.iter().map(|source| of(source.labels(Split::Train))).collect());
    }
    // Another rule gives other labels: they are counted.
    let mut counts = vec![[0; 2]; sources.list.len()];
    each_group(&sources.labels_alone(), Split::Train, |rows| {
        for (&label, &corpus) in rows.labels.iter().zip(&rows.corpora) {
            counts[usize::from(corpus)][usize::from(label)] += 1;
        }
    })?;
    Ok(counts)
}

fn no_rows(sources: &Sources, split: Split, left_out: LeftOut) -> TrainError {
    let LeftOut { unlabelled, not_finite } = left_out;
    TrainError::NoRows { split: split.name(), shards: sources.shards(split), unlabelled, not_finite }
}

/// Takes over weights, and the filter's memory where it fits; whether it did.
fn start_from(
    init: &Init,
    sources: &Sources,
    network: &mut Network,
    filter: &mut dyn Filter,
) -> Result<bool, TrainError> {
    let refuse = |reason: String| Err(TrainError::Init { path: init.path.clone(), reason });
    if init.model.about.features != sources.features {
        let (there, here) = (init.model.about.features.join(" "), sources.features.join(" "));
        return refuse(format!("its inputs are {there}, these are {here}; choose the same with --set features=..."));
    }
    if init.model.network.layout != network.layout {
        let shape = |layout: &Layout| format!("{:?} with bias {}", layout.sizes(), layout.bias);
        let (there, here) = (shape(&init.model.network.layout), shape(&network.layout));
        return refuse(format!(
            "its layers are {there}, the config's {here}; choose the same with --set network.hidden=..."
        ));
    }
    network.weights.clone_from(&init.model.network.weights);
    let Some(bytes) = &init.filter else { return Ok(false) };
    let read = state::from_bytes(bytes).map(|(_, mut snapshots)| snapshots.remove("best"));
    match read {
        Ok(Some(best)) if best.weights == network.weights => match filter.restore(&best.filter) {
            Ok(()) => Ok(true),
            Err(error) => refuse(format!(
                "its covariance does not fit ({error}); take the same filter, or move filter.safetensors away"
            )),
        },
        Ok(_) => refuse("the filter.safetensors beside it belongs to other weights; move it away".into()),
        Err(reason) => refuse(format!("filter.safetensors: {reason}; move it away")),
    }
}
