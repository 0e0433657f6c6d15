//! A comparison -> text for people: what the two have to do with each other, then what differs, and nothing that does not.

use std::fmt;

use serde_json::Value as Json;

use super::{Comparison, FeatureComparison, MOVED, Pair, Relation, RowComparison};
use crate::corpus::stats::LabelCounts;

/// A value longer than this is cut, letters.
const WIDTH: usize = 60;

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "A  {}\nB  {}\n\n{}", self.at.a, self.at.b, self.verdict())?;
        if !self.keys.is_empty() {
            writeln!(f, "\nkeys of the plans that differ\n  {:<44} A -> B", "key")?;
        }
        for key in &self.keys {
            writeln!(f, "  {:<44} {} -> {}", key.key, shown(key.a.as_ref()), shown(key.b.as_ref()))?;
        }
        self.rows.as_ref().map_or(Ok(()), |rows| rows.fmt(f))
    }
}

impl Comparison {
    /// What the two have to do with each other, in a sentence.
    pub(crate) fn verdict(&self) -> String {
        let shards = |of: fn(&RowComparison) -> u64| self.rows.as_ref().map_or(0, of);
        match self.relation {
            Relation::Same if self.is_equal => "equal: the same plan, the same rows, the same program".into(),
            Relation::Same => "the same rows; what differs stands below".into(),
            Relation::AExtendsB => {
                let more = shards(|rows| rows.shards.a - rows.shards.b);
                format!(
                    "A extends B: all {} shards of B are in A with the same values, and {more} more",
                    shards(|rows| rows.shards.b)
                )
            }
            Relation::BExtendsA => {
                let more = shards(|rows| rows.shards.b - rows.shards.a);
                format!(
                    "B extends A: all {} shards of A are in B with the same values, and {more} more",
                    shards(|rows| rows.shards.a)
                )
            }
            Relation::SamePlanOtherRows => {
                let other = self.rows.as_ref().map_or("", |rows| &rows.shards_other);
                format!(
                    "the same plan of scenes, but shards {other} hold other values: they were written by programs that differ, or were \
                     changed; `marsyard verify --rebuild` says which are as their plan says"
                )
            }
            Relation::Other => "plans of other scenes, tables or shards".into(),
            Relation::SamePlan if self.is_equal => "the same plan".into(),
            Relation::SamePlan => "the same plan of scenes; what differs stands below".into(),
        }
    }
}

/// A value on a line; `-` where there is none.
fn shown(value: Option<&Json>) -> String {
    let text = value.map_or("-".into(), Json::to_string);
    match text.char_indices().nth(WIDTH) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

impl fmt::Display for RowComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n{:<28} {:>20} {:>20}", "", "A", "B")?;
        let mut line = |what: &str, pair: Pair<String>| writeln!(f, "{what:<28} {:>20} {:>20}", pair.a, pair.b);
        line("corpus_id", self.corpus_id.map(|id| id.chars().take(12).collect()))?;
        line("scenes", self.scenes.map(u64::to_string))?;
        line("failed scenes", self.failed_scenes.map(u64::to_string))?;
        line("shards", self.shards.map(u64::to_string))?;
        line("manifest's format", self.manifest_format.map(u32::to_string))?;
        for (table, rows) in &self.tables {
            line(
                &format!("rows of {}", table.name()),
                rows.map(|rows| rows.map_or("-".into(), |rows| rows.to_string())),
            )?;
        }
        for (split, labels) in &self.labels {
            line(&format!("untraversable, {}", split.name()), labels.map(share))?;
        }
        if self.build.differs() {
            writeln!(f, "\nprograms\n  A  {}\n  B  {}", self.build.a, self.build.b)?;
        }
        if self.other_builds.differs() {
            writeln!(f, "\nprograms of other shards")?;
            for (side, others) in [("A", &self.other_builds.a), ("B", &self.other_builds.b)] {
                if others.is_empty() {
                    writeln!(f, "  {side}  none")?;
                }
                others
                    .iter()
                    .try_for_each(|other| writeln!(f, "  {side}  shards {}: {}", other.shards, other.build))?;
            }
        }
        let moved: Vec<&FeatureComparison> = self.features.iter().filter(|feature| feature.has_moved()).collect();
        let all = self.features.len();
        if moved.is_empty() {
            return writeln!(
                f,
                "\nfeatures (train split): none of {all} has moved by {MOVED} standard deviations or more"
            );
        }
        writeln!(
            f,
            "\n{} of {all} features (train split) have moved by {MOVED} standard deviations or more",
            moved.len()
        )?;
        let width = moved.iter().map(|feature| feature.name.len()).max().unwrap_or(0).max(24);
        writeln!(
            f,
            "  {:<width$} {:>11} {:>11} {:>11} {:>11} {:>10} {:>8}",
            "feature", "mean A", "mean B", "sd A", "sd B", "difference", "sd B/A"
        )?;
        moved.into_iter().try_for_each(|feature| {
            let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.5}"));
            let (a, b) = (feature.a.as_ref(), feature.b.as_ref());
            writeln!(
                f,
                "  {:<width$} {:>11} {:>11} {:>11} {:>11} {:>10} {:>8}",
                feature.name,
                number(a.and_then(|a| a.mean)),
                number(b.and_then(|b| b.mean)),
                number(a.and_then(|a| a.sd)),
                number(b.and_then(|b| b.sd)),
                feature.standardised_difference.map_or("-".into(), |off| format!("{off:+.2}")),
                feature.sd_ratio.map_or("-".into(), |ratio| format!("{ratio:.2}")),
            )
        })
    }
}

impl<T> Pair<T> {
    fn map<U>(&self, of: impl Fn(&T) -> U) -> Pair<U> {
        Pair { a: of(&self.a), b: of(&self.b) }
    }
}

/// The share of the known labels that are untraversable, of how many.
fn share(labels: &LabelCounts) -> String {
    let known = labels.traversable + labels.untraversable;
    labels.untraversable_share().map_or("-".into(), |share| format!("{:.2} % of {known}", 100.0 * share))
}
