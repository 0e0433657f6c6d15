//! The settings of the pipeline that are told better, and the reference -> their learning curves on more scenes than settings are compared at.
//!
//! Every setting makes the scenes that settings are compared at, so they are few, and where a curve ends cannot be told of them; nor whether what is
//! cheaper and better there stays so. So what is recommended, and what else is told better, is measured once more beside the reference: on so
//! many times the scenes, trained at the sizes of them that lie beyond the first measurement, with the seeds of all rounds, and judged on the same test
//! scenes. What it gains is told again, at the largest CPU time that both reach there, and what is recommended goes by that. Costs are told in the first measurement's seconds, by
//! what a scene and a learnt row of the setting took in either.

use std::sync::atomic::AtomicBool;

use super::judging::{self, TestScenes};
use super::report::{CurveRow, Ended, GainRow, Report, Row, Told, WorthRow};
use super::settings::{Setting, Settings, Side, Variant};
use super::worth::{Seeds, worth};
use super::{Event, Options, TradeoffError, learning, measured, recommend};
use crate::config;

/// Settings that are measured beside the reference, at most.
const MOST_FOLLOWED: usize = 3;

/// The report with the longer curves; as it was where none are asked for, or where `stop` was raised meanwhile.
pub(super) fn add(
    mut report: Report,
    options: &Options,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Report, TradeoffError> {
    let places = followed(&report);
    if options.farther < 2 || report.ended == Ended::Interrupted || places.is_empty() {
        return Ok(report);
    }
    let list = places.iter().map(|place| setting(&report.rows[*place], options)).collect::<Result<Vec<_>, _>>()?;
    let settings = Settings { list, refused: Vec::new() };
    let at_once =
        Options { scenes: options.farther * options.scenes, seeds: report.seeds, time: None, ..options.clone() };
    let Some(worths) = worths(&settings, &at_once, options.test_scenes * report.rounds, stop, tell)? else {
        return Ok(Report { ended: Ended::Interrupted, ..report });
    };
    for (place, made) in places.into_iter().zip(worths) {
        if let Some((worth, made)) = report.rows[place].worth.as_mut().zip(made) {
            worth.farther = beyond(&worth.curve, made.curve);
            // The floor of fewer scenes is higher than that of these, and no other draws of these were measured.
            let told = |gain: &GainRow| Told::of(&gain.balanced_accuracy, report.noise_floor);
            worth.farther_gain = made.gain.map(|gain| GainRow { told: told(&gain), ..gain });
        }
    }
    report.recommended_pipeline = recommend::recommend(&report.rows, Side::Pipeline);
    Ok(report)
}

/// Rows: the reference, then what is recommended and what else is told better, the most accurate for the reference's CPU time first; none where
/// nothing is recommended.
fn followed(report: &Report) -> Vec<usize> {
    let Some(of) = &report.recommended_pipeline else { return Vec::new() };
    let rows = || report.rows.iter().enumerate().filter(|(_, row)| row.side == Side::Pipeline);
    let is_it = |row: &Row| row.label() == of.name && row.sets == of.sets;
    let is_told = |row: &Row| row.may_be_recommended && row.gain().is_some_and(|gain| gain.told == Told::Better);
    let within = |place: &usize| report.rows[*place].worth.as_ref().and_then(|worth| worth.at_reference_cpu);
    let mut others: Vec<usize> =
        rows().filter(|(_, row)| is_told(row) && !is_it(row)).map(|(place, _)| place).collect();
    others.sort_by(|a, b| within(b).unwrap_or(0.0).total_cmp(&within(a).unwrap_or(0.0)));
    let recommended = rows().filter(|(place, row)| *place > 0 && is_it(row)).map(|(place, _)| place);
    std::iter::once(0).chain(recommended).chain(others).take(1 + MOST_FOLLOWED).collect()
}

/// What made a row.
fn setting(row: &Row, options: &Options) -> Result<Setting, TradeoffError> {
    let plan = config::load(&options.config, &[options.sets.as_slice(), &row.sets].concat())?;
    let variant = Variant::Plan(Box::new(plan));
    Ok(Setting { group: row.group, name: row.name.clone(), sets: row.sets.clone(), variant })
}

/// What the settings are worth at the four sizes of these scenes, against the first; `None` where `stop` was raised.
fn worths(
    settings: &Settings,
    options: &Options,
    test_scenes: u64,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Vec<Option<WorthRow>>>, TradeoffError> {
    let Some(scenes) = measured(settings, options, stop, tell)? else { return Ok(None) };
    let (none, threads) = (TestScenes::default(), options.threads);
    let Some(test) = judging::make(settings.reference(), none, 0..test_scenes, threads, stop, tell)? else {
        return Ok(None);
    };
    let seeds = options.seeds as usize;
    let Some(mut trainings) = learning::learn(settings, &scenes, 0..seeds, options, stop, tell)? else {
        return Ok(None);
    };
    learning::judge(&mut trainings, &test, threads)?;
    Ok(Some(worth(settings, &scenes, &test, &trainings, Seeds { all: seeds, per_round: seeds }).0))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::Interval;

    fn size(scenes: u64, generate_cpu_s: f64, rows_learnt: f64, train_cpu_s: f64) -> CurveRow {
        CurveRow {
            scenes,
            train_rows: 1.0,
            rows_learnt,
            generate_cpu_s,
            train_cpu_s,
            learning_cpu_s: 0.5 * train_cpu_s,
            balanced_accuracy: Interval { mean: 0.9, half_width: 0.01 },
            by_seed: vec![0.9; 2],
            own: None,
            worst: None,
            missed: None,
        }
    }

    #[test]
    fn exact_sizes_beyond_are_told_in_the_seconds_of_the_first_measurement() {
        let first = [size(4, 4.0, 50.0, 5.0), size(8, 8.0, 100.0, 10.0)];
        // A scene takes twice as long there, and a learnt row three times. The first size is what there is, and one scene more.
        let sizes = vec![size(9, 18.0, 110.0, 33.0), size(12, 24.0, 200.0, 60.0), size(24, 60.0, 400.0, 90.0)];
        let expected = [size(12, 12.0, 200.0, 20.0), size(24, 30.0, 400.0, 30.0)];
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12 * b;
        let found = beyond(&first, sizes);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!((found.scenes, found.rows_learnt), (expected.scenes, expected.rows_learnt));
            assert!(close(found.generate_cpu_s, expected.generate_cpu_s), "{found:?}");
            assert!(close(found.train_cpu_s, expected.train_cpu_s), "{found:?}");
            assert!(close(found.learning_cpu_s, expected.learning_cpu_s), "{found:?}");
        }
        assert!(beyond(&first, Vec::new()).is_empty());
    }
}
