//! Entries of all rungs -> `search.json` and the table in the terminal.

use std::fmt::Write;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::entry::Entry;
use super::networks::shown;
use super::over_scenes::ValidationScenes;
use super::rungs::{Rung, smallest_within};
use crate::statistics::{Interval, spearman};

pub(crate) const NAME: &str = "search.json";
/// Networks in the terminal's table.
const SHOWN: usize = 20;
/// Networks of the last rung in `search.json`; the journal has all.
const KEPT: usize = 1000;

/// `search.json`: the same bytes however many threads there were, and however often they were killed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Leaderboard {
    pub marsyard_search: u32,
    /// A share of the best error.
    #[serde(rename = "margin_share")]
    pub margin: f64,
    /// The smallest network whose validation error is above the best by at most that share of it; `None` where no error is finite.
    pub chosen: Option<Line>,
    /// Networks that were begun, and how far.
    pub networks: usize,
    pub rungs: Vec<RungFacts>,
    /// The last rung, best first.
    pub leaderboard: Vec<Line>,
    /// Validation scenes, over which intervals are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation_scenes: Option<usize>,
    pub begun_with: Json,
}

/// A network of the leaderboard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Line {
    pub hidden: Vec<usize>,
    pub weights: usize,
    pub rows: u64,
    pub best_rows: u64,
    pub validation_error: Option<f64>,
    /// That error, and how much it is above the best network's, with intervals of 95 % over the validation scenes; absent where a journal of an
    /// earlier marsyard does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<Interval>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above_best: Option<Interval>,
    pub balanced_accuracy: Option<f64>,
    pub auc: Option<f64>,
    /// Rows that the filter rejected, and how often it rebuilt its covariance.
    pub rejected: u64,
    pub rebuilt: u64,
}

/// One rung in hindsight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RungFacts {
    pub rows: u64,
    pub networks: usize,
    /// Spearman's rho of its errors with those of the last rung, over the networks of the last rung.
    pub rank_correlation: Option<f64>,
}

impl Line {
    /// `best`: the best of its rung.
    fn of(entry: &Entry, best: &Entry, scenes: &ValidationScenes) -> Line {
        Line {
            hidden: entry.hidden.clone(),
            weights: entry.weights,
            rows: entry.rows,
            best_rows: entry.best_rows,
            validation_error: entry.validation_error,
            error: scenes.interval(entry.error_by_scene.iter().copied()),
            above_best: above(entry, best, scenes),
            balanced_accuracy: entry.balanced_accuracy,
            auc: entry.auc,
            rejected: entry.rejected,
            rebuilt: entry.rebuilt,
        }
    }
}

impl Leaderboard {
    /// `entries`: of each rung, best first.
    pub(crate) fn of(
        rungs: &[Rung],
        entries: &[Vec<Entry>],
        scenes: &ValidationScenes,
        margin: f64,
        begun_with: Json,
    ) -> Leaderboard {
        let last = entries.last().map_or(&[][..], Vec::as_slice);
        let facts = rungs.iter().zip(entries).map(|(rung, entries)| RungFacts {
            rows: rung.rows,
            networks: entries.len(),
            rank_correlation: spearman(&pairs(entries, last)),
        });
        let line = |entry: &Entry| Line::of(entry, &last[0], scenes);
        Leaderboard {
            marsyard_search: 1,
            margin,
            chosen: smallest_within(last, margin).map(line),
            networks: entries.first().map_or(0, Vec::len),
            rungs: facts.collect(),
            leaderboard: last.iter().take(KEPT).map(line).collect(),
            validation_scenes: last.iter().any(|entry| !entry.error_by_scene.is_empty()).then(|| scenes.count()),
            begun_with,
        }
    }
}

/// How much a network's validation error is above another's, with an interval over scenes.
pub(crate) fn above(entry: &Entry, best: &Entry, scenes: &ValidationScenes) -> Option<Interval> {
    let (own, other) = (&entry.error_by_scene, &best.error_by_scene);
    if own.len() != other.len() {
        return None;
    }
    scenes.interval(own.iter().zip(other).map(|(own, other)| own - other))
}

/// Errors of an early rung beside those of the last, of the networks in both.
fn pairs(early: &[Entry], last: &[Entry]) -> Vec<(f64, f64)> {
    let by_network: std::collections::BTreeMap<_, _> =
        early.iter().filter_map(|entry| Some((&entry.hidden, entry.validation_error?))).collect();
    last.iter().filter_map(|entry| Some((*by_network.get(&entry.hidden)?, entry.validation_error?))).collect()
}

/// The best networks of the last rung, with the chosen one below where it is not among them.
pub(crate) fn table(entries: &[Entry], scenes: &ValidationScenes, margin: f64) -> String {
    let chosen = smallest_within(entries, margin);
    let mut text = String::from(
        "  rank  hidden layers  weights  validation error   above the best, 95 %  balanced accuracy     AUC  best after  rows/s a thread\n",
    );
    for (place, entry) in entries.iter().enumerate() {
        let is_chosen = chosen == Some(entry);
        if place >= SHOWN && !is_chosen {
            continue;
        }
        let number = |value: Option<f64>, digits: usize| value.map_or("-".into(), |value| format!("{value:.digits$}"));
        let _ = writeln!(
            text,
            "{} {:>5}  {:>13}  {:>7}  {:>16}  {:>21}  {:>17}  {:>6}  {:>10}  {:>15.0}",
            if is_chosen { '>' } else { ' ' },
            place + 1,
            shown(&entry.hidden),
            entry.weights,
            number(entry.validation_error, 5),
            if place == 0 { "-".into() } else { shown_interval(above(entry, &entries[0], scenes)) },
            number(entry.balanced_accuracy, 4),
            number(entry.auc, 4),
            entry.best_rows,
            entry.rows_per_s(),
        );
    }
    text
}

/// As in the table; a dash where nothing is known.
pub(crate) fn shown_interval(interval: Option<Interval>) -> String {
    let known = interval.filter(|interval| interval.half_width.is_finite());
    known.map_or("-".into(), |Interval { mean, half_width }| format!("{mean:.5} +- {half_width:.5}"))
}

#[cfg(test)]
mod tests {
    use super::super::over_scenes::tests::scenes;
    use super::super::rungs::tests::entry;
    use super::*;

    #[test]
    fn exact_the_table_holds_the_best_twenty_and_the_chosen_one() {
        let mut entries: Vec<Entry> = (0..30).map(|k| entry(&[32 - k], 320 - 10 * k, 0.1 + 1e-4 * k as f64)).collect();
        entries.sort_by(Entry::rank);
        let table = table(&entries, &scenes(&[1.0; 2]), 0.0265);
        assert_eq!(table.lines().count(), 1 + 20 + 1);
        let last = table.lines().last().unwrap();
        assert!(last.starts_with(">    27              6       60           0.10260                      -"), "{last}");
    }

    #[test]
    fn exact_a_network_stands_above_the_best_by_pairs_of_scenes() {
        // Two scenes that differ much, and alike for both networks: what one is above the other is sure all the same.
        let of = |hidden: usize, parts: [f64; 2]| Entry {
            error_by_scene: parts.to_vec(),
            ..entry(&[hidden], 10 * hidden, parts[0] + parts[1])
        };
        let entries = [of(8, [0.01, 0.09]), of(4, [0.0125, 0.0925])];
        let scenes = scenes(&[1.0; 2]);
        let table = table(&entries, &scenes, 0.1);
        assert!(table.lines().nth(2).unwrap().contains("0.10500     0.00500 +- 0.00000"), "{table}");
        let rungs = [Rung { rows: 10, networks: 2 }];
        let board = Leaderboard::of(&rungs, &[entries.to_vec()], &scenes, 0.1, Json::Null);
        let chosen = board.chosen.unwrap();
        let (own, above) = (chosen.error.unwrap(), chosen.above_best.unwrap());
        assert!((own.mean - 0.105).abs() < 1e-15 && (above.mean - 0.005).abs() < 1e-15);
        // 12.706 sqrt(2 (2 (0.08 / 2)^2)).
        assert!((own.half_width - 12.706_204_736 * 0.08).abs() < 1e-8 && above.half_width < 1e-15);
        assert_eq!(board.validation_scenes, Some(2));
        // Entries of an earlier marsyard tell nothing of it, and its leaderboard is written as it was.
        let before = Leaderboard::of(&rungs, &[vec![entry(&[8], 80, 0.1)]], &scenes, 0.01, Json::Null);
        let text = serde_json::to_string(&before).unwrap();
        assert!(!["\"error\"", "above_best", "validation_scenes"].iter().any(|key| text.contains(key)), "{text}");
    }

    #[test]
    fn exact_an_early_rung_is_compared_over_the_networks_of_the_last() {
        let early = vec![entry(&[1], 1, 0.3), entry(&[2], 2, 0.2), entry(&[3], 3, 0.1), entry(&[4], 4, 0.9)];
        let last = vec![entry(&[1], 1, 0.03), entry(&[3], 3, 0.05), entry(&[2], 2, 0.04)];
        let rungs = [Rung { rows: 10, networks: 4 }, Rung { rows: 40, networks: 3 }];
        let board = Leaderboard::of(&rungs, &[early, last], &scenes(&[1.0; 2]), 0.0, Json::Null);
        let rho: Vec<_> = board.rungs.iter().map(|rung| rung.rank_correlation).collect();
        assert_eq!(rho, [Some(-1.0), Some(1.0)]);
        assert_eq!((board.networks, board.chosen.unwrap().hidden), (4, vec![1]));
    }
}
