//! The cells of every setting -> classifiers trained on them, at four sizes and with several seeds, and what each makes of the test scenes.
//!
//! A network is trained as `train` does it by default; the seed draws its first weights, the order of the rows and which scenes the
//! smaller sizes hold, alike for every setting, so that differences between settings are differences of pairs. Settings of the trainer
//! learn the reference's cells, each a network of the size that is usual for it. Equal cells are learnt once. What a training costs is the CPU time of the one thread that
//! it runs on, looks at the rows that stop it included.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::judging::{TestScenes, Verdicts};
use super::measure::Measured;
use super::settings::{Settings, Variant};
use super::sizes::{Chosen, SIZES};
use super::{Event, Options, TradeoffError};
use crate::cells::Label;
use crate::measure::clock::{LearningTime, thread_cpu_s};
use crate::measure::interleave::rotation;
use crate::parallel;
use crate::train::memory::{self, Held, outputs};
use crate::train::params::FilterParams;
use crate::train::rows::Rows;
use crate::train::{Network, Scaler, TrainError, TrainParams};

/// One training, and what came of it.
#[derive(Clone, Debug)]
pub(super) struct Training {
    /// Seconds of CPU, all together; and of those what learning took, without looks.
    pub cpu_s: f64,
    pub learning_cpu_s: f64,
    pub rows_learnt: u64,
    /// Cells that it learnt from.
    pub train_rows: u64,
    /// What was learnt, so that more scenes can be judged.
    network: Network,
    scaler: Scaler,
    /// Of no scene before the first [`judge`].
    pub verdicts: Verdicts,
}

/// The trainings of a setting: by size, then by seed.
pub(super) type Trainings = Vec<Vec<Training>>;

/// How many trainings there are at most; equal cells are learnt once.
pub(super) fn most_trainings(settings: &Settings, options: &Options) -> usize {
    settings.list.len() * SIZES.len() * options.seeds as usize
}

/// Adds the trainings of a later round to those there are; a setting that lacks some in either has none.
pub(super) fn add(there: &mut [Option<Trainings>], more: Vec<Option<Trainings>>) {
    for (there, more) in there.iter_mut().zip(more) {
        *there = there.take().zip(more).map(|(mut there, more)| {
            there.iter_mut().zip(more).for_each(|(of_size, more)| of_size.extend(more));
            there
        });
    }
}

/// Has every training judge all test scenes.
pub(super) fn judge(all: &mut [Option<Trainings>], test: &TestScenes, threads: usize) -> Result<(), TradeoffError> {
    let trainings: Vec<&mut Training> = all.iter_mut().flatten().flatten().flatten().collect();
    let one = |training: &mut Training, (): &mut ()| {
        training.verdicts = test.verdicts(&outputs(&training.scaler, &training.network, test.rows()));
        Ok::<_, TradeoffError>(())
    };
    parallel::map(threads, trainings, &AtomicBool::new(false), one, |_| ())?;
    Ok(())
}

/// The trainings of each setting with these seeds; `None` in the list where a setting has no cells to learn, and in its stead where `stop` was raised.
pub(super) fn learn(
    settings: &Settings,
    measured: &Measured,
    seeds: Range<usize>,
    options: &Options,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Vec<Option<Trainings>>>, TradeoffError> {
    let corpora = settings.plans().count();
    let hashes: Vec<blake3::Hash> = (0..corpora).map(|k| hash(measured, k)).collect();
    let first_alike = |k: usize| hashes.iter().position(|hash| *hash == hashes[k]).unwrap_or(k);
    // Per setting: the corpus it learns, and how.
    let default = FilterParams::default();
    let plan_or_filter = |(k, variant): (usize, &Variant)| match variant {
        Variant::Plan(_) => (first_alike(k), default.clone()),
        Variant::Filter(filter) => (0, filter.clone()),
    };
    let wanted: Vec<(usize, FilterParams)> =
        settings.list.iter().map(|setting| &setting.variant).enumerate().map(plan_or_filter).collect();
    let first_same = |k: usize| wanted.iter().position(|other| *other == wanted[k]).unwrap_or(k);
    let distinct: Vec<usize> = (0..wanted.len()).filter(|&k| first_same(k) == k).collect();
    let per_round = options.seeds as usize;
    let mut jobs: Vec<(usize, usize, usize)> = Vec::new();
    for seed in seeds.clone() {
        for k in rotation(distinct.len(), seed) {
            jobs.extend((0..SIZES.len()).map(|size| (distinct[k], size, seed)));
        }
    }
    let one_training = |(k, size, seed): (usize, usize, usize), (): &mut ()| {
        let (corpus, filter) = &wanted[k];
        let chosen = Chosen::of(measured.scenes.len(), size, seed, per_round);
        match training(measured, *corpus, filter, &chosen, seed as u64 + 1, stop) {
            Ok(trained) => Ok(trained),
            // All scenes failed there: that is told elsewhere.
            Err(TrainError::NoRowsHeld { .. }) => Ok(None),
            Err(source) => {
                let setting = settings.list[k].name.clone();
                Err(TradeoffError::Train { setting, source: Box::new(source) })
            }
        }
    };
    let of = jobs.len();
    let tell_done = |done| tell(Event::Training { done, of });
    let Some(finished) = parallel::map(options.threads, jobs.clone(), stop, one_training, tell_done)? else {
        return Ok(None);
    };
    // One that was under way when `stop` was raised gave nothing.
    if stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let mut all: Vec<Trainings> = vec![vec![Vec::new(); SIZES.len()]; wanted.len()];
    for ((k, size, _), trained) in jobs.into_iter().zip(finished) {
        all[k][size].extend(trained);
    }
    // A curve that lacks a point is none.
    let is_whole = |trainings: &Trainings| trainings.iter().all(|of_size| of_size.len() == seeds.len());
    Ok(Some((0..wanted.len()).map(|k| Some(&all[first_same(k)]).filter(|all| is_whole(all)).cloned()).collect()))
}

fn training(
    measured: &Measured,
    corpus: usize,
    filter: &FilterParams,
    chosen: &Chosen,
    seed: u64,
    stop: &AtomicBool,
) -> Result<Option<Training>, TrainError> {
    let params = TrainParams { seed, allow_few_rows: true, ..TrainParams::usual_of(filter.clone()) };
    let (train, validation) = (rows(measured, corpus, &chosen.train), rows(measured, corpus, &chosen.stop));
    let started_s = thread_cpu_s();
    let held = Held::new(&measured.features, train, validation, &[1.0], &params)?;
    let mut learning = LearningTime::start();
    let trained = memory::train(&params, &held, held.course(&params), stop, &mut |event| learning.hear(event))?;
    let cpu_s = thread_cpu_s() - started_s;
    Ok(trained.map(|trained| Training {
        cpu_s,
        learning_cpu_s: learning.cpu_s,
        rows_learnt: trained.rows_learnt,
        train_rows: held.train.len() as u64,
        network: trained.network,
        scaler: held.objective.scaler,
        verdicts: Verdicts::default(),
    }))
}

/// The cells of some scenes at a setting, in the order of the list.
fn rows(measured: &Measured, setting: usize, scenes: &[usize]) -> Rows {
    let mut rows = Rows::new(measured.features.len());
    for made in scenes.iter().filter_map(|&scene| measured.scenes[scene][setting].as_ref().ok()) {
        made.cells.learn(&mut rows);
    }
    rows
}

/// Equal for settings whose cells are learnt alike.
fn hash(measured: &Measured, setting: usize) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for made in &measured.scenes {
        let Ok(made) = &made[setting] else {
            hasher.update(b"failed");
            continue;
        };
        hasher.update(&(made.cells.labels.len() as u64).to_le_bytes());
        made.cells.labels.iter().for_each(|label| _ = hasher.update(&label.map_or(-1, Label::number).to_le_bytes()));
        made.cells.features.iter().for_each(|value| _ = hasher.update(&value.to_bits().to_le_bytes()));
    }
    hasher.finalize()
}
