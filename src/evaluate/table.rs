//! A report -> aligned text for people.

use std::fmt::{self, Display, Formatter};

use super::lead::Lead;
use super::report::{AtThreshold, DataFacts, GroupReport, Judged, Report, SpreadReport};
use super::spread::Bin;
use super::threshold::{Group, Threshold, ThresholdOrigin};
use crate::train::Activation;

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.head(f)?;
        writeln!(f, "\n{}", Lead(self))?;
        self.rates(f)?;
        if let Some(all) = self.groups.first() {
            for at in &all.network.at {
                writeln!(f)?;
                confusion(f, at)?;
                writeln!(f)?;
                table_1(f, at)?;
            }
        }
        self.tops(f)?;
        self.classes(f)?;
        writeln!(f)?;
        spread(f, "points per cell", &self.points_per_cell, self.thresholds.first(), whole_bin)?;
        writeln!(f)?;
        spread(f, "range, metres", &self.range_m, self.thresholds.first(), metres_bin)?;
        if !self.notes.is_empty() {
            writeln!(f)?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

/// What a report says first: which cells were judged, what a user needs to know, how good each classifier is on all of them, and its notes.
pub(crate) struct Brief<'a>(pub &'a Report);

impl Display for Brief<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Brief(report) = self;
        writeln!(f, "{}\n{}", report.data_line(), Lead(report))?;
        rates_head(f)?;
        report.groups.iter().take(1).try_for_each(|group| rates_of(f, group, &report.data))?;
        report.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

impl Report {
    fn head(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (model, data) = (&self.model, &self.data);
        let hidden: Vec<String> = model.hidden.iter().map(usize::to_string).collect();
        writeln!(
            f,
            "model   {}{}, {} inputs, {} weights; trained on {} (its first family has {} on {})",
            model.sha256.as_ref().map_or(String::new(), |digits| format!("{}: ", digits.get(..12).unwrap_or(digits))),
            if model.members > 1 {
                format!("mean of {} networks of {}{}", model.members, hidden.join("-"), of_neurons(model.activation))
            } else {
                format!("{} network{}", hidden.join("-"), of_neurons(model.activation))
            },
            model.features.len(),
            thousands(model.weights as u64),
            model.trained_on.join(", "),
            model.sensor,
            model.rover
        )?;
        writeln!(f, "data    {}", self.data_line())?;
        writeln!(f, "labels  {}", data.labels)?;
        if data.unknown_cells + data.not_finite_cells > 0 {
            let (unknown, odd) = (thousands(data.unknown_cells), thousands(data.not_finite_cells));
            writeln!(f, "        left out: {unknown} cells of unknown label, {odd} with values that are not finite")?;
        }
        Ok(())
    }

    /// Which cells were judged; scans from elsewhere have no split.
    fn data_line(&self) -> String {
        let (data, all) = (&self.data, self.groups.first());
        format!(
            "{}{}: {} cells with {} points in {} scans{}",
            data.name,
            if data.split.is_empty() { String::new() } else { format!(", {} split", data.split) },
            thousands(all.map_or(0, |g| g.cells)),
            thousands(all.map_or(0, |g| g.points)),
            thousands(data.scans),
            self.over_scenes.first().map_or(String::new(), |over| {
                format!(" of {} scenes, over which intervals are of 95 %", thousands(over.scenes))
            })
        )
    }

    /// One line for each group, classifier and threshold.
    fn rates(&self, f: &mut Formatter<'_>) -> fmt::Result {
        rates_head(f)?;
        let all = self.groups.first().map(|all| all.cells);
        // The one family of a corpus, or its one sensor, is all of it.
        let tells =
            |group: &&GroupReport| matches!(group.group, Group::All | Group::Points(_)) || Some(group.cells) != all;
        self.groups.iter().filter(tells).try_for_each(|group| rates_of(f, group, &self.data))?;
        rates_legend(f)
    }

    /// Which things are missed, and which give alarm.
    fn classes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.classes.is_empty() {
            return Ok(());
        }
        let from = self.thresholds.first().map_or(String::new(), |t| format!(" (from {:.3})", t.value));
        let title = format!("what makes the label, or is tallest{from}");
        writeln!(f, "\n{title:<42} {:>12} {:>14} {:>8} {:>8}", "cells", "untraversable", "missed", "false")?;
        for class in &self.classes {
            writeln!(
                f,
                "  {:<40} {:>12} {:>14} {:>8} {:>8}",
                class.class,
                thousands(class.counts.total()),
                thousands(class.counts.untraversable()),
                percent(class.rates.missed_untraversable),
                percent(class.rates.false_untraversable)
            )?;
        }
        Ok(())
    }

    fn tops(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (tops, threshold) in self.missed_tops.iter().zip(&self.thresholds).filter(|(tops, _)| tops.cells > 0) {
            let of = |part: u64| percent(Some(part as f64 / tops.cells as f64));
            writeln!(
                f,
                "\nmissed tops from {:.3}{}: {} cells; {} % of them enclosed by cells called untraversable, {} % with no empty cell \
                 beside",
                threshold.value,
                origin(*threshold),
                thousands(tops.cells),
                of(tops.enclosed),
                of(tops.walled_in)
            )?;
        }
        Ok(())
    }
}

fn rates_head(f: &mut Formatter<'_>) -> fmt::Result {
    writeln!(
        f,
        "{:<40} {:>13} {:>9} {:>9} {:>9} {:>7} {:>7} {:>6} {:>8} {:>8}",
        "by cells, percent",
        "untraversable",
        "majority",
        "accuracy",
        "balanced",
        "MCC",
        "AUC",
        "ECE",
        "missed",
        "false"
    )
}

/// A line for each classifier and threshold.
fn rates_of(f: &mut Formatter<'_>, group: &GroupReport, data: &DataFacts) -> fmt::Result {
    let title = match &group.group {
        Group::All => "all cells".to_string(),
        Group::Points(points) => format!("cells of {points} points or more"),
        Group::Family(name) => format!("family {name}{}", data.mark(name)),
        Group::Sensor(name) => format!("sensor {name}"),
    };
    writeln!(f, "{title} ({})", thousands(group.cells))?;
    let error = group.probabilities.as_ref().map(|found| found.expected_calibration_error);
    for (name, unit, panels, error) in
        [("network", "", &group.network, error), ("height diff.", " m", &group.height_difference, None)]
    {
        for at in &panels.at {
            let label = format!("  {name} from {:.3}{unit}{}", at.threshold.value, origin(at.threshold));
            let r = &at.cells.rates;
            writeln!(
                f,
                "{label:<40} {:>13} {:>9} {:>9} {:>9} {:>7} {:>7} {:>6} {:>8} {:>8}",
                percent(r.prevalence),
                percent(r.majority_baseline),
                percent(r.accuracy),
                percent(r.balanced_accuracy),
                plain(r.mcc),
                plain(panels.auc),
                percent(error),
                percent(r.missed_untraversable),
                percent(r.false_untraversable)
            )?;
        }
    }
    Ok(())
}

fn rates_legend(f: &mut Formatter<'_>) -> fmt::Result {
    writeln!(f, "missed = missed_untraversable: of what is untraversable, the share called traversable (dangerous)")?;
    writeln!(f, "false  = false_untraversable: of what is traversable, the share called untraversable (a detour)")?;
    writeln!(
        f,
        "ECE    = expected calibration error: how far the probabilities are from the shares that came true, in the mean"
    )?;
    writeln!(f, "(validation): the threshold of the best balanced accuracy on the validation scenes")
}

fn confusion(f: &mut Formatter<'_>, at: &AtThreshold) -> fmt::Result {
    let cells = &at.cells.counts;
    let title = format!("confusion from {:.3}{}, cells", at.threshold.value, origin(at.threshold));
    writeln!(f, "{title:<42} {:>24} {:>24}", "called traversable", "called untraversable")?;
    for (name, counts, whole) in [
        ("traversable", [cells.true_traversable, cells.false_untraversable], cells.traversable()),
        ("untraversable", [cells.missed_untraversable, cells.true_untraversable], cells.untraversable()),
    ] {
        let [a, b] = counts.map(|count| {
            let share = percent((whole > 0).then(|| count as f64 / whole as f64));
            format!("{} ({share} %)", thousands(count))
        });
        writeln!(f, "  truly {name:<34} {a:>24} {b:>24}")?;
    }
    Ok(())
}

/// The five rows, by points and by cells, with and without tops, and in the other reading.
fn table_1(f: &mut Formatter<'_>, at: &AtThreshold) -> fmt::Result {
    let title = format!("table 1 from {:.3}{}", at.threshold.value, origin(at.threshold));
    writeln!(f, "{title:<42} {:>12} {:>12} {:>12} {:>12}", "points", "own truth", "cells", "paper")?;
    let columns = |pick: fn(&Judged) -> String| [&at.points, &at.own_points, &at.cells].map(pick);
    let without = |pick: fn(&Judged) -> String| {
        [&at.points_without_tops, &at.own_points_without_tops, &at.cells_without_tops].map(pick)
    };
    let rows: [(&str, [String; 3], &str); 9] = [
        ("untraversable", columns(|j| thousands(j.table_1.of_truth.untraversable)), "11,687"),
        ("traversable", columns(|j| thousands(j.table_1.of_truth.traversable)), "308,800"),
        ("missed_untraversable %", columns(|j| percent(j.table_1.of_truth.wrong_of_untraversable)), "4.74"),
        ("false_untraversable %", columns(|j| percent(j.table_1.of_truth.wrong_of_traversable)), "0.81"),
        ("all wrong %", columns(|j| percent(j.table_1.of_truth.wrong_of_all)), "0.96"),
        (
            "  majority baseline, wrong %",
            columns(|j| percent(j.rates.majority_baseline.map(|right| 1.0 - right))),
            "3.65",
        ),
        ("  without tops: missed_untraversable %", without(|j| percent(j.rates.missed_untraversable)), "< 1"),
        (
            "  of what was called untraversable, wrong %",
            columns(|j| percent(j.table_1.of_calls.wrong_of_untraversable)),
            "",
        ),
        (
            "  of what was called traversable, wrong %",
            columns(|j| percent(j.table_1.of_calls.wrong_of_traversable)),
            "",
        ),
    ];
    for (name, [points, own, cells], paper) in rows {
        writeln!(f, "  {name:<41} {points:>11} {own:>12} {cells:>12} {paper:>12}")?;
    }
    writeln!(f, "points: with their cell's label; own truth: a point is untraversable where it lies on an obstacle")
}

fn spread(
    f: &mut Formatter<'_>,
    title: &str,
    report: &SpreadReport,
    threshold: Option<&Threshold>,
    name: impl Fn(&Bin) -> String,
) -> fmt::Result {
    let from = threshold.map_or(String::new(), |t| format!(" (from {:.3})", t.value));
    writeln!(
        f,
        "{:<28} {:>11} {:>13} {:>8} {:>8} {:>8}",
        format!("{title}{from}"),
        "cells",
        "untraversable",
        "wrong",
        "missed",
        "false"
    )?;
    for bin in &report.bins {
        let wrong = bin.rates.accuracy.map(|accuracy| 1.0 - accuracy);
        writeln!(
            f,
            "  {:<26} {:>11} {:>13} {:>8} {:>8} {:>8}",
            name(bin),
            thousands(bin.counts.total()),
            percent(bin.rates.prevalence),
            percent(wrong),
            percent(bin.rates.missed_untraversable),
            percent(bin.rates.false_untraversable)
        )?;
    }
    writeln!(
        f,
        "  Spearman's rho: {} with being wrong; {} with false_untraversable among traversable cells",
        plain(report.rho_wrong),
        plain(report.rho_false_untraversable)
    )
}

fn of_neurons(activation: Activation) -> &'static str {
    match activation {
        Activation::Logistic => "",
        Activation::Relu => " of rectified neurons",
        Activation::Both => ", every second of rectified neurons",
    }
}

fn whole_bin(bin: &Bin) -> String {
    match bin.to {
        Some(to) if to - bin.from <= 1.0 => format!("{}", bin.from),
        Some(to) => format!("{} to {}", bin.from, to - 1.0),
        None => format!("{} and more", bin.from),
    }
}

fn metres_bin(bin: &Bin) -> String {
    match bin.to {
        Some(to) => format!("{} to {to}", bin.from),
        None => format!("{} and more", bin.from),
    }
}

fn origin(threshold: Threshold) -> &'static str {
    match threshold.origin {
        ThresholdOrigin::Model => "",
        ThresholdOrigin::Given => " (given)",
        ThresholdOrigin::Validation => " (validation)",
    }
}

/// 0.0474 -> "4.74".
pub(super) fn percent(share: Option<f64>) -> String {
    share.map_or("-".into(), |share| format!("{:.2}", 100.0 * share))
}

fn plain(value: Option<f64>) -> String {
    value.map_or("-".into(), |value| format!("{value:.4}"))
}

/// 1234567 -> "1,234,567".
pub(super) fn thousands(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
