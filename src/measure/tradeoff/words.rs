//! Numbers of a report -> the words in a cell of its tables.
//!
//! In: counts, shares, spreads and intervals. Out: text of three significant figures, of points or of percent, with the interval behind
//! the mean where there is one.

use super::report::Told;
use crate::statistics::{Interval, Spread};

pub(super) fn plural(count: u64) -> &'static str {
    if count == 1 { "" } else { "s" }
}

pub(super) fn shown<T>(value: Option<T>, say: impl FnOnce(T) -> String) -> String {
    value.map_or("-".into(), say)
}

pub(super) fn spread(spread: Spread) -> String {
    format!("{} [{}, {}]", figures(spread.median), figures(spread.lower_quartile), figures(spread.upper_quartile))
}

/// A gain in points of balanced accuracy.
pub(crate) fn points(gain: &Interval) -> String {
    with_half_width(format!("{:+.2}", 100.0 * gain.mean), gain)
}

pub(super) fn percent(accuracy: &Interval) -> String {
    with_half_width(format!("{:.2}", 100.0 * accuracy.mean), accuracy)
}

/// Of one training there is no interval.
fn with_half_width(mean: String, of: &Interval) -> String {
    if of.half_width.is_finite() { format!("{mean} ± {:.2}", 100.0 * of.half_width) } else { mean }
}

/// Three significant figures.
pub(super) fn figures(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if !(1e-3..1e5).contains(&size) => format!("{value:.1e}"),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        size if size >= 1.0 => format!("{value:.2}"),
        size if size >= 0.1 => format!("{value:.3}"),
        size if size >= 0.01 => format!("{value:.4}"),
        _ => format!("{value:.5}"),
    }
}

pub(super) fn told_in_words(told: Told) -> &'static str {
    match told {
        Told::Better => "better",
        Told::Worse => "worse",
        Told::NotApart => "not told apart",
        Told::OneSeed => "one training",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_numbers_have_three_figures() {
        for (value, expected) in [
            (0.0, "0"),
            (1234.4, "1234"),
            (12.34, "12.3"),
            (-1.234, "-1.23"),
            (0.1234, "0.123"),
            (0.01234, "0.0123"),
            (0.001234, "0.00123"),
            (1.5e-9, "1.5e-9"),
        ] {
            assert_eq!(figures(value), expected);
        }
        assert_eq!(points(&Interval { mean: 0.0123, half_width: 0.004 }), "+1.23 ± 0.40");
        assert_eq!(percent(&Interval { mean: 0.9712, half_width: f64::INFINITY }), "97.12");
    }
}
