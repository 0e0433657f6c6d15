//! The recommended setting of the pipeline -> its learning curve on more scenes than settings are compared at.
//!
//! Every setting makes the scenes that settings are compared at, so they are few, and where a curve ends cannot be told of them. So what is
//! recommended is measured once more, alone: on so many times the scenes, trained at the sizes of them that lie beyond the first measurement, with the seeds of all
//! rounds, and judged on the same test scenes. Its costs are told in the first measurement's seconds, by what a scene and a learnt row of it
//! took in either.

use std::sync::atomic::AtomicBool;

use super::judging::{self, TestScenes};
use super::report::{CurveRow, Ended, Report, Row};
use super::settings::{Setting, Settings, Side, Variant};
use super::worth::{Seeds, worth};
use super::{Event, Options, TradeoffError, learning, measured};
use crate::config;

/// The report with the longer curve; as it was where none is asked for or nothing is recommended, or where `stop` was raised meanwhile.
pub(super) fn add(
    mut report: Report,
    options: &Options,
    settings: &Settings,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Report, TradeoffError> {
    let Some(place) = recommended(&report) else { return Ok(report) };
    if options.farther < 2 || report.ended == Ended::Interrupted {
        return Ok(report);
    }
    let row = &report.rows[place];
    let plan = config::load(&options.config, &[options.sets.as_slice(), &row.sets].concat())?;
    let setting = Setting {
        group: row.group,
        name: row.name.clone(),
        sets: row.sets.clone(),
        variant: Variant::Plan(Box::new(plan)),
    };
    let alone = Settings { list: vec![setting], refused: Vec::new() };
    let at_once =
        Options { scenes: options.farther * options.scenes, seeds: report.seeds, time: None, ..options.clone() };
    match curve(&alone, settings, &at_once, options.test_scenes * report.rounds, stop, tell)? {
        Some(sizes) => {
            let worth = report.rows[place].worth.as_mut().expect("it is recommended by its worth");
            worth.farther = beyond(&worth.curve, sizes);
        }
        None => report.ended = Ended::Interrupted,
    }
    Ok(report)
}

/// The row of what is recommended.
fn recommended(report: &Report) -> Option<usize> {
    let of = report.recommended_pipeline.as_ref()?;
    let is_it = |row: &Row| row.side == Side::Pipeline && row.label() == of.name && row.sets == of.sets;
    report.rows.iter().position(is_it)
}

/// The curve of one setting, at the four sizes of its own scenes; `None` where `stop` was raised, or a size has no cells to learn.
fn curve(
    alone: &Settings,
    settings: &Settings,
    options: &Options,
    test_scenes: u64,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Vec<CurveRow>>, TradeoffError> {
    let Some(scenes) = measured(alone, options, stop, tell)? else { return Ok(None) };
    let (none, threads) = (TestScenes::default(), options.threads);
    let Some(test) = judging::make(settings.reference(), none, 0..test_scenes, threads, stop, tell)? else {
        return Ok(None);
    };
    let seeds = options.seeds as usize;
    let Some(mut trainings) = learning::learn(alone, &scenes, 0..seeds, options, stop, tell)? else { return Ok(None) };
    learning::judge(&mut trainings, &test, threads)?;
    let (worths, _) = worth(alone, &scenes, &test, &trainings, Seeds { all: seeds, per_round: seeds });
    Ok(worths.into_iter().next().flatten().map(|worth| worth.curve))
}

/// The sizes beyond those of the first measurement, in its seconds.
fn beyond(first: &[CurveRow], sizes: Vec<CurveRow>) -> Vec<CurveRow> {
    let (Some(last), Some(next)) = (first.last(), sizes.first()) else { return Vec::new() };
    let a_scene = |size: &CurveRow| size.generate_cpu_s / size.scenes as f64;
    let a_row = |size: &CurveRow| size.train_cpu_s / size.rows_learnt;
    let (making, training) = (a_scene(last) / a_scene(next), a_row(last) / a_row(next));
    // The part of them that is as many as there were is one more for an uneven number.
    let most = last.scenes * 3 / 2;
    let farther = sizes.into_iter().filter(|size| size.scenes >= most);
    let in_its_seconds = |size: CurveRow| CurveRow {
        generate_cpu_s: making * size.generate_cpu_s,
        train_cpu_s: training * size.train_cpu_s,
        learning_cpu_s: training * size.learning_cpu_s,
        ..size
    };
    farther.map(in_its_seconds).collect()
}
