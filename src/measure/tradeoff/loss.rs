//! The cells of every setting -> what a classifier trained on them is worth on the reference's test cells.
//!
//! Scenes are split once, by their place in the list: 5 in 8 train, 1 in 8 says when to stop, 2 in 8 (of the reference) are the test that
//! all share. A network of 16-16 neurons is trained on each setting's own cells by the default training config, once a seed; the seed
//! draws its first weights and the order of the rows, alike for every setting, so that losses are differences of pairs. Settings of
//! the trainer learn the reference's cells. Equal cells are learnt once. The interval covers the trainings' draws, not those of the
//! scenes: what the test would say of other yards is not in it.

use std::sync::atomic::{AtomicBool, Ordering};

use super::measure::Measured;
use super::settings::{Settings, Variant};
use super::{Event, Options, TradeoffError};
use crate::cells::Label;
use crate::evaluate::Confusion;
use crate::measure::clock::thread_cpu_s;
use crate::measure::interleave::rotation;
use crate::parallel;
use crate::train::memory::{self, Held};
use crate::train::params::FilterParams;
use crate::train::rows::Rows;
use crate::train::{TrainError, TrainParams};

/// Above it, an output calls a cell untraversable.
const THRESHOLD: f64 = 0.5;

/// What a scene is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Train,
    Validation,
    Test,
}

impl Role {
    /// Of the k-th scene.
    pub(super) fn of(k: usize) -> Role {
        match k % 8 {
            3 | 7 => Role::Test,
            1 => Role::Validation,
            _ => Role::Train,
        }
    }
}

/// The trainings of one setting, by seed.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Classifier {
    /// On the test cells; `None` where they lack a class.
    pub balanced_accuracy: Vec<Option<f64>>,
    /// CPU microseconds a row learnt.
    pub cpu_us_per_row: Vec<f64>,
    pub rows_learnt: Vec<u64>,
    /// Of the cells that it learnt from.
    pub train_rows: u64,
}

/// How many trainings there are at most; equal cells are learnt once.
pub(super) fn trainings(settings: &Settings, options: &Options) -> usize {
    settings.list.len() * options.seeds as usize
}

/// One classifier a setting; `None` in the list where a setting has no cells to learn, and in its stead where `stop` was raised.
pub(super) fn classifiers(
    settings: &Settings,
    measured: &Measured,
    options: &Options,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Vec<Option<Classifier>>>, TradeoffError> {
    let corpora = settings.plans().count();
    let hashes: Vec<blake3::Hash> = (0..corpora).map(|k| hash(measured, k)).collect();
    let first_alike = |k: usize| hashes.iter().position(|hash| *hash == hashes[k]).unwrap_or(k);
    // Per setting: the corpus it learns, and how.
    let default = TrainParams::default().filter;
    let plan_or_filter = |(k, variant): (usize, &Variant)| match variant {
        Variant::Plan(_) => (first_alike(k), default.clone()),
        Variant::Filter(filter) => (0, filter.clone()),
    };
    let wanted: Vec<(usize, FilterParams)> =
        settings.list.iter().map(|setting| &setting.variant).enumerate().map(plan_or_filter).collect();
    let first_same = |k: usize| wanted.iter().position(|other| *other == wanted[k]).unwrap_or(k);
    let distinct: Vec<usize> = (0..wanted.len()).filter(|&k| first_same(k) == k).collect();
    let seeds = (1..=options.seeds).flat_map(|seed| rotation(distinct.len(), seed as usize).map(move |k| (k, seed)));
    let jobs: Vec<(usize, u64)> = seeds.map(|(k, seed)| (distinct[k], seed)).collect();

    let test = rows(measured, 0, Role::Test);
    let one_training = |(k, seed): (usize, u64), (): &mut ()| {
        let (corpus, filter) = &wanted[k];
        match training(measured, *corpus, filter, seed, &test, stop) {
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
    let mut all: Vec<Option<Classifier>> = vec![None; wanted.len()];
    for ((k, _), trained) in jobs.into_iter().zip(finished) {
        if let Some(trained) = trained {
            let classifier = all[k].get_or_insert_default();
            classifier.balanced_accuracy.push(trained.balanced_accuracy);
            classifier.cpu_us_per_row.push(1e6 * trained.cpu_s / trained.rows_learnt.max(1) as f64);
            classifier.rows_learnt.push(trained.rows_learnt);
            classifier.train_rows = trained.train_rows;
        }
    }
    Ok(Some((0..wanted.len()).map(|k| all[first_same(k)].clone()).collect()))
}

#[derive(Clone, Copy, Debug)]
struct Training {
    balanced_accuracy: Option<f64>,
    cpu_s: f64,
    rows_learnt: u64,
    train_rows: u64,
}

fn training(
    measured: &Measured,
    corpus: usize,
    filter: &FilterParams,
    seed: u64,
    test: &Rows,
    stop: &AtomicBool,
) -> Result<Option<Training>, TrainError> {
    let params = TrainParams { seed, filter: filter.clone(), allow_few_rows: true, ..TrainParams::default() };
    let (train, validation) = (rows(measured, corpus, Role::Train), rows(measured, corpus, Role::Validation));
    let held = Held::new(&measured.features, train, validation, &[1.0], &params)?;
    // Learning alone: looks at the validation rows cost the same at every setting.
    let (mut learning_s, mut since_s) = (0.0, thread_cpu_s());
    let trained = memory::train(&params, &held, held.course(&params), stop, &mut |event| {
        let now_s = thread_cpu_s();
        if let memory::Event::Rows(_) = event {
            learning_s += now_s - since_s;
        }
        since_s = now_s;
    })?;
    Ok(trained.map(|trained| {
        let mut confusion = Confusion::default();
        for (output, &label) in held.outputs(&trained.network, test).into_iter().zip(&test.labels) {
            confusion.add(label.is_untraversable(), output >= THRESHOLD, 1);
        }
        Training {
            balanced_accuracy: confusion.rates().balanced_accuracy,
            cpu_s: learning_s,
            rows_learnt: trained.rows_learnt,
            train_rows: held.train.len() as u64,
        }
    }))
}

/// The cells of one setting's scenes of a role, in their order.
pub(super) fn rows(measured: &Measured, setting: usize, role: Role) -> Rows {
    let mut rows = Rows::new(measured.features.len());
    for (_, made) in measured.scenes.iter().enumerate().filter(|(k, _)| Role::of(*k) == role) {
        if let Ok(made) = &made[setting] {
            made.cells.learn(&mut rows);
        }
    }
    rows
}

/// Equal for settings whose cells are learnt alike.
fn hash(measured: &Measured, setting: usize) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    let learnt = measured.scenes.iter().enumerate().filter(|(k, _)| Role::of(*k) != Role::Test);
    for (_, made) in learnt {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_every_eight_scenes_hold_all_roles() {
        for start in [0, 8, 80] {
            let count = |role| (start..start + 8).filter(|&k| Role::of(k) == role).count();
            assert_eq!([Role::Train, Role::Validation, Role::Test].map(count), [5, 1, 2]);
        }
    }
}
