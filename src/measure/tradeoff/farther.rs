//! The settings of the pipeline that are told better, and the reference -> their learning curves on more scenes than settings are compared at.
//!
//! Every setting makes the scenes that settings are compared at, so they are few, and where a curve ends cannot be told of them; nor whether what is
//! cheaper and better there stays so. So what is recommended, and what else is told better, is measured once more beside the reference: on so
//! many times the scenes, trained at the sizes of them that lie beyond the first measurement, with the seeds of all rounds, and judged on the same test
//! scenes. What it gains is told again, at the largest CPU time that both reach there, and what is recommended goes by that. Costs are told in the first measurement's seconds, by
//! what a scene and a learnt row of the setting took in either.

use std::sync::atomic::AtomicBool;

use super::report::{CurveRow, Ended, GainRow, Report, Row, Told};
use super::settings::{Setting, Side, Variant};
use super::{Event, Options, TradeoffError, recommend, rounds};
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
    let places = followed(&report.rows);
    if options.farther < 2 || report.ended == Ended::Interrupted || places.is_empty() {
        return Ok(report);
    }
    let list = places.iter().map(|place| setting(&report.rows[*place], options)).collect::<Result<Vec<_>, _>>()?;
    let more = Options { scenes: options.farther * options.scenes, ..options.clone() };
    let Some(made) = rounds::again(list, &report, &more, stop, tell)? else {
        return Ok(Report { ended: Ended::Interrupted, ..report });
    };
    for (place, made) in places.into_iter().zip(made.rows) {
        if let Some((worth, made)) = report.rows[place].worth.as_mut().zip(made.worth) {
            let measured_s = made.curve.last().map(CurveRow::cpu_s);
            worth.farther = beyond(&worth.curve, made.curve);
            // In the seconds of the first measurement, too, by what its largest size took in either.
            let scale = worth.farther.last().map(CurveRow::cpu_s).zip(measured_s).map_or(1.0, |(told, own)| told / own);
            // The floor of fewer scenes is higher than that of these, and no other draws of these were measured.
            let told = |gain: &GainRow| Told::of(&gain.balanced_accuracy, report.noise_floor);
            worth.farther_gain = made.gain.map(|gain| GainRow { told: told(&gain), cpu_s: scale * gain.cpu_s, ..gain });
        }
    }
    report.recommended_pipeline = recommend::recommend(&report.rows, Side::Pipeline);
    Ok(report)
}

/// Rows: the reference, then what is recommended and what else is told better, the best first; none where nothing is recommended.
fn followed(rows: &[Row]) -> Vec<usize> {
    let Some(recommended) = recommend::place(rows, Side::Pipeline) else { return Vec::new() };
    let mut places = vec![0];
    for place in std::iter::once(recommended).chain(recommend::better(rows, Side::Pipeline)) {
        if !places.contains(&place) {
            places.push(place);
        }
    }
    places.truncate(1 + MOST_FOLLOWED);
    places
}

/// What made a row.
fn setting(row: &Row, options: &Options) -> Result<Setting, TradeoffError> {
    let plan = config::load(&options.config, &[options.sets.as_slice(), &row.sets].concat())?;
    let variant = Variant::Plan(Box::new(plan));
    Ok(Setting { group: row.group, name: row.name.clone(), sets: row.sets.clone(), variant })
}

/// The sizes beyond those of the first measurement, in its seconds.
fn beyond(first: &[CurveRow], sizes: Vec<CurveRow>) -> Vec<CurveRow> {
    let (Some(last), Some(next)) = (first.last(), sizes.first()) else { return Vec::new() };
    let a_scene = |size: &CurveRow| size.generate_cpu_s / size.scenes as f64;
    let a_row = |size: &CurveRow| size.train_cpu_s / size.rows_learnt;
    let (making, training) = (a_scene(last) / a_scene(next), a_row(last) / a_row(next));
    // The part of them that is as many as there were is one more for an uneven number.
    let most = last.scenes * 3 / 2;
    let mut farther: Vec<CurveRow> = sizes.into_iter().filter(|size| size.scenes >= most).collect();
    farther.iter_mut().for_each(|size| size.scale_cpu_s(making, training));
    farther
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
            missed: Interval { mean: 0.1, half_width: 0.01 },
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
