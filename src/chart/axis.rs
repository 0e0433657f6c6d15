//! A range of numbers -> an axis of a chart: its scale, and ticks at round numbers.
//!
//! Ticks of a linear axis are the multiples of 1, 2 or 5 times a power of ten; of a logarithmic one 1, 2 and 5 in each decade, or the powers
//! of ten where there are many decades, or as on a linear axis where there is hardly one; of one of durations, round numbers of seconds,
//! minutes, hours and days. An axis of categories has a name in the middle of each unit. Large numbers are written with k and M.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use crate::math;

/// About as many ticks fit on an axis.
const TICKS: f64 = 8.0;
/// From this ratio of the highest to the lowest value on, a linear axis crowds the low ones into its bottom.
const LOG_FROM_RATIO: f64 = 4.0;
/// Units of time in seconds, and the numbers of each that make ticks: those from one unit to the next one.
const UNITS_OF_TIME: [(&str, f64, &[f64]); 4] = [
    ("s", 1.0, &[0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0]),
    ("min", 60.0, &[1.0, 2.0, 5.0, 10.0, 20.0]),
    ("h", 3600.0, &[1.0, 2.0, 5.0, 10.0]),
    ("d", 86_400.0, &[1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scale {
    Linear,
    Logarithmic,
}

/// What it shows, from where to where, and its ticks.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    label: String,
    range: Range<f64>,
    scale: Scale,
    ticks: Vec<(f64, String)>,
    has_grid: bool,
}

impl Axis {
    pub(crate) fn linear(label: impl Into<String>, range: Range<f64>) -> Axis {
        let ticks = linear_ticks(&range);
        Axis { label: label.into(), range, scale: Scale::Linear, ticks, has_grid: true }
    }

    /// `range` above zero.
    pub(crate) fn logarithmic(label: impl Into<String>, range: Range<f64>) -> Axis {
        let ticks = logarithmic_ticks(&range);
        Axis { label: label.into(), range, scale: Scale::Logarithmic, ticks, has_grid: true }
    }

    /// A logarithmic axis of seconds, whose ticks are read without reckoning: 20 s, 5 min, 2 h.
    pub(crate) fn durations(label: impl Into<String>, range: Range<f64>) -> Axis {
        let ticks = duration_ticks(&range);
        Axis { ticks, ..Axis::logarithmic(label, range) }
    }

    /// An axis that shows all these values with a margin: logarithmic where they are above zero and span a factor of four, else linear from
    /// zero (or from the lowest, where that is below).
    pub(crate) fn of_values(label: impl Into<String>, values: impl Iterator<Item = f64> + Clone) -> Axis {
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        if low > 0.0 && high > LOG_FROM_RATIO * low {
            Axis::logarithmic(label, low / 1.15..1.15 * high)
        } else {
            let low = low.min(0.0);
            let margin = 0.05 * (high - low);
            Axis::linear(label, low..high + if margin > 0.0 { margin } else { 1.0 })
        }
    }

    /// From 0 to the number of names; a name in the middle of each unit.
    pub(crate) fn categories(label: impl Into<String>, names: impl IntoIterator<Item = String>) -> Axis {
        let ticks: Vec<(f64, String)> = names.into_iter().enumerate().map(|(k, name)| (k as f64 + 0.5, name)).collect();
        let range = 0.0..ticks.len().max(1) as f64;
        Axis { label: label.into(), range, scale: Scale::Linear, ticks, has_grid: false }
    }

    pub(crate) fn label(&self) -> &str {
        &self.label
    }

    pub(crate) fn span(&self) -> f64 {
        self.range.end - self.range.start
    }

    pub(crate) fn high(&self) -> f64 {
        self.range.end
    }

    pub(super) fn has_grid(&self) -> bool {
        self.has_grid
    }

    /// Where a value stands: 0 at the low end, 1 at the high one; a little beyond where it lies outside.
    pub(crate) fn position(&self, value: f64) -> f64 {
        let on_scale = |value: f64| match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic => math::ln(value.max(f64::MIN_POSITIVE)),
        };
        let (low, high) = (on_scale(self.range.start), on_scale(self.range.end));
        ((on_scale(value) - low) / (high - low)).clamp(-1.0, 2.0)
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        from + (self.position(*value) * f64::from(to - from)).round() as i32
    }

    /// plotters asks for two kinds of lines, coarse ones with text and fine ones without; there are none of these.
    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.iter().map(|tick| tick.0).collect() }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        let tick = self.ticks.iter().find(|tick| tick.0 == *value);
        tick.map_or_else(String::new, |tick| tick.1.clone())
    }
}

/// Multiples of a step within a range.
fn linear_ticks(range: &Range<f64>) -> Vec<(f64, String)> {
    let step = round_step((range.end - range.start) / TICKS);
    let first = (range.start / step - 1e-9).ceil() as i64;
    let last = (range.end / step + 1e-9).floor() as i64;
    (first..=last).map(|k| (k as f64 * step, written(k as f64 * step, step))).collect()
}

fn logarithmic_ticks(range: &Range<f64>) -> Vec<(f64, String)> {
    let decades = math::ln(range.end / range.start) / std::f64::consts::LN_10;
    if decades < 0.7 {
        return linear_ticks(range);
    }
    let first = (math::ln(range.start) / std::f64::consts::LN_10).floor() as i32;
    let multiples: &[f64] = if decades < 0.5 * TICKS { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let stride = (decades / TICKS).ceil().max(1.0) as usize;
    let all = (first..=first + decades as i32 + 1).step_by(stride).flat_map(|exponent| {
        let decade = power_of_ten(exponent);
        multiples.iter().map(move |multiple| (multiple * decade, written(multiple * decade, decade)))
    });
    all.filter(|(value, _)| range.contains(value)).collect()
}

/// Every second or third one where they would crowd; where a range holds hardly one of them, round numbers of the unit that it lies in.
fn duration_ticks(range: &Range<f64>) -> Vec<(f64, String)> {
    let of_unit = |(unit, unit_s, numbers): (&'static str, f64, &'static [f64])| {
        numbers.iter().map(move |number| (number * unit_s, format!("{number} {unit}")))
    };
    let round: Vec<(f64, String)> =
        UNITS_OF_TIME.into_iter().flat_map(of_unit).filter(|(value, _)| range.contains(value)).collect();
    if round.len() > 2 {
        let stride = (round.len() as f64 / (1.5 * TICKS)).ceil() as usize;
        return round.into_iter().step_by(stride).collect();
    }
    let within = UNITS_OF_TIME.into_iter().rfind(|(_, unit_s, _)| *unit_s <= range.start);
    let (unit, unit_s, _) = within.unwrap_or(UNITS_OF_TIME[0]);
    let ticks = logarithmic_ticks(&(range.start / unit_s..range.end / unit_s));
    ticks.into_iter().map(|(value, number)| (value * unit_s, format!("{number} {unit}"))).collect()
}

/// The least of 1, 2, 5 times a power of ten that is not below a step.
fn round_step(step: f64) -> f64 {
    let decade = power_of_ten((math::ln(step) / std::f64::consts::LN_10).floor() as i32);
    let multiple = [1.0, 2.0, 5.0].into_iter().find(|multiple| multiple * decade >= step * (1.0 - 1e-9));
    multiple.unwrap_or(10.0) * decade
}

fn power_of_ten(exponent: i32) -> f64 {
    math::pow(10.0, f64::from(exponent))
}

/// A tick's number, to the decimals of the step between ticks.
fn written(value: f64, step: f64) -> String {
    let (unit, suffix) = match value.abs() {
        size if size >= 1e6 => (1e6, "M"),
        size if size >= 1e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    let decimals = (-(math::ln(step / unit) / std::f64::consts::LN_10 + 1e-9).floor()).clamp(0.0, 12.0) as usize;
    let number = format!("{:.decimals$}", value / unit);
    let trimmed = if suffix.is_empty() || !number.contains('.') {
        &number
    } else {
        number.trim_end_matches('0').trim_end_matches('.')
    };
    format!("{trimmed}{suffix}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|tick| tick.1.as_str()).collect()
    }

    #[test]
    fn exact_ticks_of_a_linear_axis() {
        assert_eq!(texts(&Axis::linear("", 0.0..1.0)), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(texts(&Axis::linear("", -0.03..0.012)), ["-0.03", "-0.02", "-0.01", "0.00", "0.01"]);
        assert_eq!(texts(&Axis::linear("", 0.0..1.3e6)), ["0", "200k", "400k", "600k", "800k", "1M", "1.2M"]);
        assert_eq!(texts(&Axis::linear("", 95.0..102.0)), ["95", "96", "97", "98", "99", "100", "101", "102"]);
    }

    #[test]
    fn exact_ticks_of_a_logarithmic_axis() {
        assert_eq!(texts(&Axis::logarithmic("", 0.015..0.2)), ["0.02", "0.05", "0.1"]);
        assert_eq!(texts(&Axis::logarithmic("", 3.0..300.0)), ["5", "10", "20", "50", "100", "200"]);
        assert_eq!(texts(&Axis::logarithmic("", 0.5..2e6)), ["1", "10", "100", "1000", "10k", "100k", "1M"]);
        assert_eq!(texts(&Axis::logarithmic("", 1.0..3.0)), ["1.0", "1.5", "2.0", "2.5", "3.0"]);
    }

    #[test]
    fn exact_ticks_of_an_axis_of_durations() {
        assert_eq!(
            texts(&Axis::durations("", 1.7..1100.0)),
            ["2 s", "5 s", "10 s", "20 s", "1 min", "2 min", "5 min", "10 min"]
        );
        assert_eq!(texts(&Axis::durations("", 0.4..4.0)), ["0.5 s", "1 s", "2 s"]);
        assert_eq!(
            texts(&Axis::durations("", 6.0..9.0)),
            ["6.0 s", "6.5 s", "7.0 s", "7.5 s", "8.0 s", "8.5 s", "9.0 s"]
        );
        assert_eq!(
            texts(&Axis::durations("", 6120.0..17_280.0)),
            ["2.0 h", "2.5 h", "3.0 h", "3.5 h", "4.0 h", "4.5 h"]
        );
        assert_eq!(
            texts(&Axis::durations("", 100.0..300.0)),
            ["2.0 min", "2.5 min", "3.0 min", "3.5 min", "4.0 min", "4.5 min", "5.0 min"]
        );
        let night = Axis::durations("", 1.0..100_000.0);
        assert_eq!(texts(&night), ["1 s", "5 s", "20 s", "2 min", "10 min", "1 h", "5 h", "1 d"]);
        let at: Vec<f64> = night.ticks.iter().map(|tick| tick.0).collect();
        assert_eq!(at, [1.0, 5.0, 20.0, 120.0, 600.0, 3600.0, 18_000.0, 86_400.0]);
    }

    #[test]
    fn law_equal_ratios_are_equal_lengths_on_a_logarithmic_axis() {
        let axis = Axis::logarithmic("", 0.01..100.0);
        let at: Vec<i32> = [0.01, 0.1, 1.0, 10.0, 100.0].iter().map(|value| axis.map(value, (500, 100))).collect();
        assert_eq!(at, [500, 400, 300, 200, 100]);
        // Nothing positive is that small: it stands beyond the low end, and not at infinity.
        assert_eq!(axis.map(&0.0, (500, 100)), 900);
    }

    #[test]
    fn law_values_that_span_a_factor_of_four_have_a_logarithmic_axis() {
        let scale = |values: &[f64]| {
            let axis = Axis::of_values("", values.iter().copied());
            let shows = |value: &f64| (0.0..=1.0).contains(&axis.position(*value));
            assert!(values.iter().all(shows), "{values:?}");
            axis.scale
        };
        assert_eq!(scale(&[0.19, 0.016]), Scale::Logarithmic);
        assert_eq!(scale(&[0.05, 0.04]), Scale::Linear);
        assert_eq!(scale(&[0.05, 0.0]), Scale::Linear);
        assert_eq!(scale(&[0.0, 0.0]), Scale::Linear);
    }

    #[test]
    fn exact_a_category_has_its_name_in_its_middle() {
        let axis = Axis::categories("", ["a", "b"].map(String::from));
        assert_eq!((axis.map(&0.5, (0, 100)), axis.format_ext(&1.5)), (25, "b".to_owned()));
    }
}
