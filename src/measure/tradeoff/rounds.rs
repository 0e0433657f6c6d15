//! Measured settings -> rounds of trainings and test scenes, until what matters is resolved or the time is over.
//!
//! A round trains every setting with as many new seeds, and makes as many new test scenes, as the first; all trainings judge all test scenes. What
//! is resolved is the gain of each setting that may still be the best: one that may be recommended and is not told to be worse. A round is not
//! begun where it would end behind the limit if it took as long as the last one. Time decides how many rounds there are and nothing else:
//! for a number of rounds all but the times is the same. Half-widths are looked at after each round; stopping by them, and not by
//! the gains, leaves the gains without bias.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::judging::{self, TestScenes};
use super::measure::Measured;
use super::report::{Ended, Report, Row, Told, Widest};
use super::settings::{Setting, Settings};
use super::{Event, Options, TradeoffError, learning, measured, summary};

/// When to go on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    /// Half-width to be reached, as a share.
    pub resolve: Option<f64>,
    /// Counted from the start of the whole.
    pub time: Option<Duration>,
}

impl Limit {
    /// What ends the rounds after one that took `last`; `None` where another follows.
    fn ended(&self, widest: Option<&Widest>, elapsed: Duration, last: Duration) -> Option<Ended> {
        let is_within = |limit: f64| widest.is_none_or(|widest| widest.half_width.is_some_and(|width| width <= limit));
        match (self.resolve, self.time) {
            (None, None) => Some(Ended::Once),
            (Some(limit), _) if is_within(limit) => Some(Ended::Resolved),
            (_, Some(time)) if elapsed + last > time => Some(Ended::Time),
            _ => None,
        }
    }
}

/// The gain of a setting that may be the best and is known least.
pub(super) fn widest(rows: &[Row]) -> Option<Widest> {
    let open = rows.iter().filter(|row| row.may_be_recommended);
    let gains = open.filter_map(|row| Some((row, row.gain().filter(|gain| gain.told != Told::Worse)?)));
    let width = |half_width: f64| half_width.is_finite().then_some(half_width);
    gains
        .max_by(|a, b| a.1.balanced_accuracy.half_width.total_cmp(&b.1.balanced_accuracy.half_width))
        .map(|(row, gain)| Widest { name: row.label(), half_width: width(gain.balanced_accuracy.half_width) })
}

/// The report of the last whole round; `None` where `stop` was raised before the first was over.
pub(super) fn rounds(
    settings: &Settings,
    measured: &Measured,
    options: &Options,
    begun: Instant,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Report>, TradeoffError> {
    let limit = Limit { resolve: options.resolve, time: options.time };
    let mut test = TestScenes::default();
    let mut trainings = Vec::new();
    let mut report: Option<Report> = None;
    for round in 0.. {
        let round_begun = Instant::now();
        let numbers = options.test_scenes * round..options.test_scenes * (round + 1);
        let seeds = (options.seeds * round) as usize..(options.seeds * (round + 1)) as usize;
        let more =
            judging::make(settings.reference(), std::mem::take(&mut test), numbers, options.threads, stop, tell)?;
        let Some(more) = more else { break };
        test = more;
        let Some(learnt) = learning::learn(settings, measured, seeds, options, stop, tell)? else { break };
        if round == 0 {
            trainings = learnt
        } else {
            learning::add(&mut trainings, learnt)
        }
        learning::judge(&mut trainings, &test, options.threads)?;
        let made = report.insert(summary::report(options, settings, measured, &test, &trainings, round + 1));
        if let Some(ended) = limit.ended(made.widest.as_ref(), begun.elapsed(), round_begun.elapsed()) {
            made.ended = ended;
            return Ok(report);
        }
        tell(Event::Round { done: round + 1, half_width: made.widest.as_ref().and_then(|widest| widest.half_width) });
    }
    debug_assert!(stop.load(Ordering::Relaxed));
    Ok(report.map(|report| Report { ended: Ended::Interrupted, ..report }))
}

/// Settings, the reference first, measured anew with the seeds and the test scenes of all rounds of a report at once; `None` where `stop` was raised
/// before the end.
pub(super) fn again(
    list: Vec<Setting>,
    report: &Report,
    options: &Options,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Report>, TradeoffError> {
    let settings = Settings { list, refused: Vec::new() };
    let at_once = Options {
        seeds: report.seeds,
        test_scenes: options.test_scenes * report.rounds,
        resolve: None,
        time: None,
        ..options.clone()
    };
    match measured(&settings, &at_once, stop, tell)? {
        Some(scenes) => rounds(&settings, &scenes, &at_once, Instant::now(), stop, tell),
        None => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_rounds_end_where_all_is_resolved_or_the_next_would_be_late() {
        let widest = |half_width| Widest { name: "slam: truth".into(), half_width };
        let s = Duration::from_secs;
        let ended = |resolve, time: Option<u64>, width: Option<f64>, elapsed: u64, last: u64| {
            Limit { resolve, time: time.map(s) }.ended(Some(&widest(width)), s(elapsed), s(last))
        };
        assert_eq!(ended(None, None, None, 9, 9), Some(Ended::Once));
        assert_eq!(ended(Some(0.003), None, Some(0.003), 9, 9), Some(Ended::Resolved));
        assert_eq!(ended(Some(0.003), None, Some(0.0031), 9000, 9), None);
        // One training has no interval.
        assert_eq!(ended(Some(0.5), None, None, 9, 9), None);
        assert_eq!(ended(Some(0.003), Some(60), Some(0.01), 40, 20), None);
        assert_eq!(ended(Some(0.003), Some(60), Some(0.01), 41, 20), Some(Ended::Time));
        assert_eq!(ended(None, Some(60), Some(0.0), 10, 20), None);
        // Nothing that may be the best is left to resolve.
        assert_eq!(Limit { resolve: Some(0.1), time: None }.ended(None, s(1), s(1)), Some(Ended::Resolved));
    }
}
