//! A report -> what a reader needs first: what is missed, what gives alarm, what a call is worth, what is doubtful, and on which family it
//! is worst.
//!
//! By cells. What lies between the first and the last of the thresholds that are asked for is doubtful, and neither missed nor a false alarm,
//! in all lines alike; of a single one the line of what is doubtful has two of its own. A family is judged by its balanced accuracy, which its share of untraversable cells does not move; families without
//! cells of both classes have none and are left out of worst and mean.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use super::confusion::share;
use super::report::{GroupReport, Report};
use super::table::{percent, thousands};
use super::threshold::{Group, asked};

/// The families of a report as one: a network is worth what it is on the worst of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FamilySummary {
    /// Families with cells of both classes.
    pub families: usize,
    /// Mean of their balanced accuracies.
    pub mean_balanced_accuracy: f64,
    pub worst: String,
    pub worst_balanced_accuracy: f64,
    /// The family of which the largest share of the untraversable cells is called traversable; empty in reports from before it was told.
    #[serde(default)]
    pub most_missed: String,
    #[serde(default)]
    pub most_missed_untraversable: f64,
}

impl FamilySummary {
    /// Of the first and the last of so many thresholds; `None` where there are not two families to compare.
    pub(super) fn of(groups: &[GroupReport], asked: usize) -> Option<FamilySummary> {
        let rates = |group: &GroupReport| {
            let Group::Family(name) = &group.group else { return None };
            let at = &group.network.at;
            let (low, high) = (at.first()?.cells.rates, at.get(asked.saturating_sub(1))?.cells.rates);
            let (missed, alarms) = (low.missed_untraversable?, high.false_untraversable?);
            Some((name.clone(), 1.0 - 0.5 * (missed + alarms), missed))
        };
        let families: Vec<(String, f64, f64)> = groups.iter().filter_map(rates).collect();
        // Of equals the first: the report does not depend on how the minimum is found.
        let worst = families.iter().reduce(|worst, other| if other.1 < worst.1 { other } else { worst })?;
        let most_missed = families.iter().reduce(|most, other| if other.2 > most.2 { other } else { most })?;
        let mean_balanced_accuracy = families.iter().map(|(_, share, _)| share).sum::<f64>() / families.len() as f64;
        (families.len() > 1).then_some(FamilySummary {
            families: families.len(),
            mean_balanced_accuracy,
            worst: worst.0.clone(),
            worst_balanced_accuracy: worst.1,
            most_missed: most_missed.0.clone(),
            most_missed_untraversable: most_missed.2,
        })
    }
}

/// The lines that a report begins with.
pub(super) struct Lead<'a>(pub &'a Report);

impl Display for Lead<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Lead(report) = self;
        let Some(all) = report.groups.first() else { return Ok(()) };
        let last = asked(&report.thresholds).saturating_sub(1);
        let at = |index: usize| {
            Some((all.network.at.get(index)?.cells, report.over_scenes.get(index).copied().unwrap_or_default()))
        };
        let Some(((low, low_over), (high, high_over))) = at(0).zip(at(last)) else { return Ok(()) };
        let called = high.counts.called_untraversable();
        let precision = share(high.counts.true_untraversable, called);
        let of = |part: u64, whole: u64| format!("{} of {}", thousands(part), thousands(whole));
        let lines = [
            (
                "missed",
                (low.rates.missed_untraversable, low_over.missed_untraversable),
                of(low.counts.missed_untraversable, low.counts.untraversable()),
                "untraversable cells are called traversable: dangerous",
            ),
            (
                "false",
                (high.rates.false_untraversable, high_over.false_untraversable),
                of(high.counts.false_untraversable, high.counts.traversable()),
                "traversable cells are called untraversable: a detour",
            ),
            (
                "precision",
                (precision, high_over.precision),
                of(high.counts.true_untraversable, called),
                "cells called untraversable are",
            ),
        ];
        for (name, (rate, over_scenes), counts, meaning) in lines {
            let [low, high] = over_scenes.unwrap_or_default().map(|bound| percent(Some(bound)));
            let interval = over_scenes.map_or(String::new(), |_| format!("({low} to {high})"));
            writeln!(f, "{name:<9} {:>6} %  {interval:<16} {counts} {meaning}", percent(rate))?;
        }
        if let Some(doubt) = &report.doubt {
            let [false_alarms, missed] = doubt.wrong_shares().map(percent);
            // The other lines are of one threshold, by which no cell is doubtful.
            let would = match doubt.allowed_share {
                Some(share) if last == 0 => format!(" would be, by --doubtful {}%:", 100.0 * share),
                _ => ", with".to_string(),
            };
            writeln!(
                f,
                "{:<9} {:>6} %  {:<16} of the cells{would} outputs of {:.3} to {:.3}; of the others {missed} % are missed, {false_alarms} % false",
                "doubtful",
                percent(Some(doubt.share())),
                "",
                doubt.between[0],
                doubt.between[1]
            )?;
        }
        if let Some(of) = &report.families {
            let [worst, mean] =
                [of.worst_balanced_accuracy, of.mean_balanced_accuracy].map(|share| percent(Some(share)));
            let most_missed = if of.most_missed.is_empty() || of.most_missed_untraversable == 0.0 {
                String::new()
            } else {
                let (family, missed) = (&of.most_missed, percent(Some(of.most_missed_untraversable)));
                format!("; most missed on {family}{}: {missed} %", report.data.mark(family))
            };
            writeln!(
                f,
                "{:<9} {worst:>6} %  {:<16} balanced accuracy on family {}{}{}{}; mean of {} families {mean} %{most_missed}",
                "worst",
                "",
                of.worst,
                report.data.mark(&of.worst),
                cells_of(report, &of.worst),
                if last > 0 { ", what is doubtful not counted as wrong" } else { "" },
                of.families
            )?;
        }
        Ok(())
    }
}

/// How much a family's figure rests on.
fn cells_of(report: &Report, family: &str) -> String {
    let group = report.groups.iter().find(|group| matches!(&group.group, Group::Family(name) if name == family));
    let counts = group.and_then(|group| Some(group.network.at.first()?.cells.counts));
    counts.map_or(String::new(), |counts| {
        format!(" ({} untraversable of {} cells)", thousands(counts.untraversable()), thousands(counts.total()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::Confusion;
    use crate::evaluate::report::{AtThreshold, Judged, Panels};
    use crate::evaluate::threshold::{Threshold, ThresholdOrigin};

    /// A family of 100 traversable and 100 untraversable cells.
    fn family(name: &str, false_untraversable: u64, missed_untraversable: u64) -> GroupReport {
        group(
            name,
            Confusion {
                true_traversable: 100 - false_untraversable,
                false_untraversable,
                missed_untraversable,
                true_untraversable: 100 - missed_untraversable,
            },
        )
    }

    fn group(name: &str, counts: Confusion) -> GroupReport {
        let judged = Judged::of(counts);
        let at = AtThreshold {
            threshold: Threshold { value: 0.5, origin: ThresholdOrigin::Model },
            cells: judged,
            points: judged,
            own_points: judged,
            cells_without_tops: judged,
            points_without_tops: judged,
            own_points_without_tops: judged,
        };
        let panels = Panels { auc: None, auc_bound: 0.0, at: vec![at] };
        let group = Group::Family(name.into());
        GroupReport {
            group,
            cells: counts.total(),
            points: 0,
            network: panels.clone(),
            height_difference: panels,
            probabilities: None,
        }
    }

    #[test]
    fn exact_the_worst_family_and_the_mean_of_all() {
        let summary = FamilySummary::of(&[family("a", 0, 10), family("b", 20, 10), family("c", 10, 20)], 1);
        let summary = summary.expect("three families");
        // 95, 85 and 85 %: of equals the first.
        assert_eq!((summary.families, summary.worst.as_str()), (3, "b"));
        assert!((summary.worst_balanced_accuracy - 0.85).abs() < 1e-15);
        assert_eq!((summary.most_missed.as_str(), summary.most_missed_untraversable), ("c", 0.2));
        assert!((summary.mean_balanced_accuracy - (0.95 + 0.85 + 0.85) / 3.0).abs() < 1e-15);
    }

    #[test]
    fn extreme_families_of_one_class_and_single_families_are_not_compared() {
        let bare = || group("bare", Confusion { true_traversable: 7, ..Confusion::default() });
        assert_eq!(FamilySummary::of(&[], 1), None);
        assert_eq!(FamilySummary::of(&[family("a", 1, 1)], 1), None);
        assert_eq!(FamilySummary::of(&[family("a", 1, 1), bare()], 1), None);
        let two = FamilySummary::of(&[bare(), family("a", 0, 40), family("b", 0, 0)], 1);
        let two = two.expect("two that can be judged");
        assert_eq!((two.families, two.worst.as_str()), (2, "a"));
    }

    #[test]
    fn exact_doubtful_cells_are_no_mistakes_of_a_family() {
        // From the first threshold on 10 of 100 are missed and 30 called falsely, from the second 40 and 6.
        let mut doubted = family("a", 30, 10);
        doubted.network.at.extend(family("a", 6, 40).network.at);
        let mut other = family("b", 20, 10);
        other.network.at.extend(family("b", 10, 30).network.at);
        let summary = FamilySummary::of(&[doubted, other], 2).expect("two families");
        assert!((summary.worst_balanced_accuracy - 0.90).abs() < 1e-15 && summary.worst == "b", "{summary:?}");
        assert!((summary.mean_balanced_accuracy - 0.5 * (0.92 + 0.90)).abs() < 1e-15, "{summary:?}");
    }
}
