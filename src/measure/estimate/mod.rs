//! A plan -> what its build will take: time, rows, bytes, and what each part costs. Measured on some of the plan's own scenes.
//!
//! ```text
//! sample    scenes of every family, on as many threads as the build will have, until the standard error is small
//! encode    the sampled scenes as a shard, on all threads at once: bytes, and the time of writing them
//! rows      the same shard read and judged, as a training does it beside learning: what that takes of a row
//! storage   the same shard put into the place of the build: what that takes
//! parts     each part that the plan switches on, left out on the same scenes: what it costs
//! ```
//!
//! The build: every thread is busy with scenes and shards, T at a time, so its wall time is the sum of both over T, plus what
//! the last shard keeps the others waiting. Measured with T threads at once, so that what hyper-threads, caches and other
//! programs take is in it. Not counted: start and finalize, milliseconds for each hundred shards.

mod encode;
mod part;
mod parts;
mod rows;
mod sample;
mod storage;
mod strata;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::corpus::advice::{self, Advice, Content};
use crate::corpus::{CorpusError, Table};
use crate::episode::{Prepared, StageTimes};
use crate::parallel::PoolError;
use crate::plan::Plan;
use crate::sweep::PatternError;

pub(crate) use part::Part;
pub(crate) use parts::PartCost;
pub use parts::scene_costs;
pub(crate) use rows::RowCost;
pub(crate) use sample::test_scenes;
pub(crate) use storage::{Storage, free_bytes};
pub(crate) use strata::Figure;

/// How long, with how many threads, and for which place.
#[derive(Clone, Debug)]
pub(crate) struct Options<'a> {
    /// Threads that measure, all at once: those of the build, or as many as there are cores.
    pub threads: usize,
    /// So many scenes; `None`: until time and rows have a relative standard error of `ENOUGH`.
    pub scenes: Option<u64>,
    /// No new scene is begun after this.
    pub limit: Duration,
    /// No new scene is begun for the parts after this much more, but the first two of each family; zero leaves them out.
    pub parts_limit: Duration,
    /// Nothing at all is begun after this, counted from the start: not even the first scene of a family, nor a scene without the next part.
    pub most: Duration,
    /// Where the build will write; its storage is measured there.
    pub place: Option<&'a Path>,
    /// Whether it is to be told what a training takes of a row beside learning it.
    pub for_training: bool,
    /// When it is raised, what was tried at the place is taken away, and there is no estimate.
    pub stop: &'a AtomicBool,
}

impl Options<'_> {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// When an estimate was begun, and whether it has to end.
#[derive(Clone, Copy, Debug)]
struct Clock<'a> {
    options: &'a Options<'a>,
    begun: Instant,
}

impl Clock<'_> {
    /// All time is spent, or somebody raised `stop`.
    fn is_over(&self) -> bool {
        self.options.stopped() || self.begun.elapsed() > self.options.most
    }
}

/// Relative standard error of time and of rows at which sampling ends: a fifth of the 15 % that the estimate is held to.
pub(crate) const ENOUGH: f64 = 0.03;

/// What a build will take.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    pub threads: usize,
    /// Scenes that were run for it.
    pub scenes: u64,
    /// By family: what those scenes hold.
    pub contents: Vec<Content>,
    /// What makes the corpus weak, with the key to turn.
    pub advice: Vec<Advice>,
    /// Of all threads together, seconds; the wall time of the whole.
    pub cpu_s: Figure,
    pub wall_s: Figure,
    /// Rows of `cells`.
    pub rows: Figure,
    pub bytes: Figure,
    /// Families of which no scene was run before the time was over: they are taken to be as the others.
    pub not_reached: Vec<String>,
    /// Mean over the plan's scenes: CPU seconds of each stage, by name, and of writing.
    pub stages: Vec<(&'static str, f64)>,
    /// CPU seconds a scene of making each table's file.
    pub tables: Vec<(Table, f64)>,
    /// By family: scenes of it in the plan, and the price of each part that it switches on.
    pub families: Vec<FamilyCost>,
    pub storage: Option<Storage>,
    /// Where it was asked for, and there are cells to learn.
    pub row_cost: Option<RowCost>,
}

#[derive(Clone, Debug)]
pub(crate) struct FamilyCost {
    pub scenes: u64,
    /// CPU seconds a scene: all of it, where the parts were measured.
    pub scene_s: Option<f64>,
    pub parts: Vec<(Part, PartCost)>,
}

impl Estimate {
    /// Bytes a second that the build writes when nothing holds it up.
    pub(crate) fn needed_bytes_per_s(&self) -> f64 {
        let waiting = self.storage.as_ref().map_or(0.0, |s| s.build_s / self.threads as f64);
        self.bytes.value / (self.wall_s.value - waiting).max(1e-9)
    }
}

/// Why nothing could be estimated.
#[derive(Debug, thiserror::Error)]
pub(crate) enum EstimateError {
    #[error(transparent)]
    Pattern(#[from] PatternError),
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    #[error(transparent)]
    Threads(#[from] PoolError),
    #[error("{place}: cannot be written to: {reason}")]
    Place { place: String, reason: String },
    #[error("all {scenes} sampled scenes fail, so there is nothing to estimate; the first: {first}")]
    NoScene { scenes: u64, first: String },
    #[error("interrupted: there is no estimate, and what was tried at a place is taken away")]
    Interrupted,
}

/// Runs scenes of the plan, writes them to memory (and to the place, if one is given), and reckons up.
pub(crate) fn estimate(plan: &Plan, options: &Options) -> Result<Estimate, EstimateError> {
    // First: a place that cannot be is told at once.
    options.place.map(storage::check).transpose()?;
    let clock = Clock { options, begun: Instant::now() };
    let prepared = Prepared::new(plan.clone())?;
    let mut sample = sample::run(&prepared, &clock)?;
    if options.stopped() {
        return Err(EstimateError::Interrupted);
    }
    if let Some(first) = sample.only_failure() {
        return Err(EstimateError::NoScene { scenes: sample.scenes(), first });
    }
    let spec = plan.corpus_spec();
    let encoded = encode::encode(&spec, std::mem::take(&mut sample.outputs), options.threads)?;
    let row_cost = options.for_training.then(|| rows::cost(&spec, &encoded.whole)).transpose()?.flatten();
    let bytes = encoded.bytes(&sample, plan.shards());
    let probed = options.place.map(|place| storage::probe(place, &encoded, plan.shards(), bytes.value, options));
    let storage = probed.transpose()?;
    let families = parts::prices(&prepared, &sample, &clock)?;
    if options.stopped() {
        return Err(EstimateError::Interrupted);
    }

    let threads = options.threads as f64;
    let shards = plan.shards() as f64;
    let (making_cpu_s, making_wall_s) = (sample.total(|cost| cost.whole.cpu), sample.total(|cost| cost.whole.wall));
    let (writing_cpu_s, writing_wall_s) = encoded.seconds(bytes.value);
    let storing_s = storage.as_ref().map_or(0.0, |s| s.build_s);
    // Rows are written while scenes are made. When the last shard is whole, one thread puts it in its place and the others have
    // nothing left to do; before that, they wait half a scene on average for the last one.
    let last_s = storing_s / shards + 0.5 * making_wall_s.value / plan.scenes as f64;
    let busy_s = making_wall_s.value + writing_wall_s + storing_s;
    let wall_s = Figure {
        value: busy_s / threads + last_s * (1.0 - 1.0 / threads),
        standard_error: making_wall_s.standard_error / threads,
    };
    let per_scene = 1.0 / plan.scenes as f64;
    let contents = std::mem::take(&mut sample.contents);
    let stages = StageTimes::STAGES.iter().enumerate();
    let stages = stages.map(|(k, (_, name))| (*name, sample.total(|cost| cost.stages[k]).value * per_scene));
    Ok(Estimate {
        threads: options.threads,
        scenes: sample.scenes(),
        not_reached: sample.not_reached(plan),
        advice: advice::advise(&contents),
        contents,
        cpu_s: Figure { value: making_cpu_s.value + writing_cpu_s, ..making_cpu_s },
        wall_s,
        rows: sample.total(|cost| cost.rows[Table::Cells as usize]),
        bytes,
        stages: stages.chain([("writing", writing_cpu_s * per_scene)]).collect(),
        tables: encoded.tables_s(writing_cpu_s * per_scene),
        families,
        storage,
        row_cost,
    })
}
