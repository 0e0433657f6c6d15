//! Two corpora, or a corpus and a plan -> where they differ: plans key by key, rows, labels, features, programs, shards.
//!
//! In: a [`Side`] each, its resolved plan and, of a finished corpus, manifest and list of shards. Out: a [`Comparison`], which serialises
//! to `schemas/comparison.schema.json`. What is compared is what manifests hold: counts, means, standard deviations and extremes; no
//! table is read. Shards are equal where their tables have equal value hashes.
//! Source: Cohen 1988, chapter 2, and Austin 2009 for the standardised difference of means.

mod words;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value as Json;

use super::inspect::{FeatureRange, FeatureReport};
use super::key_differences::{KeyDifference, key_differences};
use super::manifest::{Manifest, OtherBuild, ShardLine};
use super::stats::LabelCounts;
use super::{Build, Finished, Split, Table, ranges};

/// Version of the document.
pub(crate) const FORMAT: u32 = 1;
/// From here on a feature is told to have moved: a tenth of a standard deviation, which Austin 2009 takes for negligible below.
pub(crate) const MOVED: f64 = 0.1;

/// One of the two.
#[derive(Clone, Copy)]
pub(crate) struct Side<'a> {
    /// How it was named.
    pub at: &'a str,
    /// The resolved plan as a document.
    pub plan: &'a Json,
    pub scene_plan_hash: &'a str,
    /// The corpus, where it is one.
    pub corpus: Option<&'a Finished>,
}

/// What the two have of one thing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub(crate) struct Pair<T> {
    pub a: T,
    pub b: T,
}

impl<T: PartialEq> Pair<T> {
    fn differs(&self) -> bool {
        self.a != self.b
    }
}

/// What the rows of the two have to do with each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Relation {
    /// The same rows.
    Same,
    /// A holds all shards of B, and more.
    AExtendsB,
    /// B holds all shards of A, and more.
    BExtendsA,
    /// The same plan of scenes, but shards that both have hold other values: written by programs that differ, or changed.
    SamePlanOtherRows,
    /// Other scenes, tables or shards.
    Other,
    /// One of them is a plan, of the very scenes that the other holds or would hold.
    SamePlan,
}

/// Where two corpora differ. `format` 1.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Comparison {
    /// Version of this document: 1.
    pub format: u32,
    /// How the two were named.
    pub at: Pair<String>,
    /// Nothing differs but where they lie.
    pub is_equal: bool,
    pub relation: Relation,
    /// Keys of the resolved plans, by path.
    pub keys: Vec<KeyDifference>,
    /// Null where one of them is a plan.
    pub rows: Option<RowComparison>,
}

/// What two manifests hold.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(crate) struct RowComparison {
    pub corpus_id: Pair<String>,
    pub scenes: Pair<u64>,
    pub failed_scenes: Pair<u64>,
    pub shards: Pair<u64>,
    /// Shards of the same number whose tables hold the same values, and those that do not, as ranges.
    pub shards_equal: u64,
    pub shards_other: String,
    /// Version of the manifests.
    pub manifest_format: Pair<u32>,
    /// Rows by table; null where there is no such table.
    pub tables: BTreeMap<Table, Pair<Option<u64>>>,
    pub labels: BTreeMap<Split, Pair<LabelCounts>>,
    pub features: Vec<FeatureComparison>,
    /// The programs that wrote shard 0, and those that wrote others.
    pub build: Pair<Build>,
    pub other_builds: Pair<Vec<OtherBuild>>,
}

/// A feature of the train splits.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(crate) struct FeatureComparison {
    pub name: String,
    /// Null where a corpus has no such feature.
    pub a: Option<FeatureRange>,
    pub b: Option<FeatureRange>,
    /// Mean of B less that of A, over the root of the mean of both variances; null where one has no values, or where neither varies and
    /// the means differ.
    pub standardised_difference: Option<f64>,
    /// Standard deviation of B over that of A; null where A does not vary.
    pub sd_ratio: Option<f64>,
}

/// Compares two.
pub(crate) fn compare(a: Side, b: Side) -> Comparison {
    let keys = key_differences(a.plan, b.plan);
    let is_same_plan = a.scene_plan_hash == b.scene_plan_hash;
    let rows = a.corpus.zip(b.corpus).map(|(a, b)| RowComparison::of(a, b));
    let relation = match &rows {
        Some(rows) => rows.relation(is_same_plan),
        None if is_same_plan => Relation::SamePlan,
        None => Relation::Other,
    };
    let is_equal = keys.is_empty() && rows.as_ref().is_none_or(RowComparison::is_equal);
    let at = Pair { a: a.at.into(), b: b.at.into() };
    Comparison { format: FORMAT, at, is_equal, relation, keys, rows }
}

impl RowComparison {
    fn of(a: &Finished, b: &Finished) -> RowComparison {
        let (left, right) = (&a.manifest, &b.manifest);
        fn pair<T>(a: &Manifest, b: &Manifest, of: impl Fn(&Manifest) -> T) -> Pair<T> {
            Pair { a: of(a), b: of(b) }
        }
        let (shards_equal, other) = shared_shards(&a.lines, &b.lines);
        let rows = |manifest: &Manifest, table| manifest.tables.get(&table).map(|totals| totals.rows);
        let tables = Table::ALL.map(|table| (table, pair(left, right, |manifest| rows(manifest, table))));
        let labels =
            |manifest: &Manifest, split| manifest.splits.get(&split).map_or(LabelCounts::default(), |s| s.labels);
        RowComparison {
            corpus_id: pair(left, right, |manifest| manifest.corpus_id.clone()),
            scenes: pair(left, right, |manifest| manifest.scenes),
            failed_scenes: pair(left, right, |manifest| manifest.failed.len() as u64),
            shards: pair(left, right, |manifest| manifest.shards),
            shards_equal,
            shards_other: if other.is_empty() { String::new() } else { ranges::to_text(&other) },
            manifest_format: pair(left, right, |manifest| manifest.format),
            tables: tables.into_iter().filter(|(_, rows)| rows.a.is_some() || rows.b.is_some()).collect(),
            labels: Split::ALL.map(|split| (split, pair(left, right, |manifest| labels(manifest, split)))).into(),
            features: features(left, right),
            build: pair(left, right, |manifest| manifest.build.clone()),
            other_builds: pair(left, right, |manifest| manifest.other_builds.clone()),
        }
    }

    fn is_equal(&self) -> bool {
        !self.corpus_id.differs()
            && !self.failed_scenes.differs()
            && !self.build.differs()
            && !self.other_builds.differs()
            && !self.manifest_format.differs()
    }

    fn relation(&self, is_same_plan: bool) -> Relation {
        let shared = self.shards.a.min(self.shards.b);
        if !self.corpus_id.differs() {
            Relation::Same
        } else if !is_same_plan {
            Relation::Other
        } else if self.shards_equal < shared {
            Relation::SamePlanOtherRows
        } else if self.shards.a > self.shards.b {
            Relation::AExtendsB
        } else {
            Relation::BExtendsA
        }
    }
}

/// How many shards of equal number hold equal values, and which do not.
fn shared_shards(a: &[ShardLine], b: &[ShardLine]) -> (u64, Vec<u64>) {
    let is_equal = |a: &ShardLine, b: &ShardLine| {
        let hashes = |line: &ShardLine| -> Vec<(Table, String)> {
            line.tables.iter().map(|(&table, facts)| (table, facts.value_hash.clone())).collect()
        };
        a.scenes == b.scenes && hashes(a) == hashes(b)
    };
    // Both begin at shard 0 and leave none out.
    let other: Vec<u64> = a.iter().zip(b).filter(|(a, b)| !is_equal(a, b)).map(|(a, _)| a.shard).collect();
    (a.len().min(b.len()) as u64 - other.len() as u64, other)
}

/// The features of both, those of A first.
fn features(a: &Manifest, b: &Manifest) -> Vec<FeatureComparison> {
    let range = |manifest: &Manifest, name: &str| {
        let summary = manifest.features.iter().find(|feature| feature.name == name)?;
        Some(FeatureRange::from(&FeatureReport::of(summary)))
    };
    let is_new = |name: &&String| a.features.iter().all(|feature| feature.name != **name);
    let names = a.features.iter().map(|feature| &feature.name);
    let names = names.chain(b.features.iter().map(|feature| &feature.name).filter(is_new));
    names.map(|name| FeatureComparison::of(name, range(a, name), range(b, name))).collect()
}

impl FeatureComparison {
    fn of(name: &str, a: Option<FeatureRange>, b: Option<FeatureRange>) -> FeatureComparison {
        let moments = |range: &Option<FeatureRange>| range.as_ref().and_then(|range| range.mean.zip(range.sd));
        let (mut standardised_difference, mut sd_ratio) = (None, None);
        if let (Some((mean_a, sd_a)), Some((mean_b, sd_b))) = (moments(&a), moments(&b)) {
            let spread = (0.5 * (sd_a * sd_a + sd_b * sd_b)).sqrt();
            standardised_difference = match (mean_b - mean_a, spread) {
                (0.0, _) => Some(0.0),
                (_, 0.0) => None,
                (off, spread) => Some(off / spread),
            };
            sd_ratio = (sd_a > 0.0).then(|| sd_b / sd_a);
        }
        FeatureComparison { name: name.into(), a, b, standardised_difference, sd_ratio }
    }

    /// The feature has moved by more than is negligible, or is in one of the two alone.
    pub(crate) fn has_moved(&self) -> bool {
        let has_values = |range: &Option<FeatureRange>| range.as_ref().map(|range| range.count > 0);
        match (has_values(&self.a), has_values(&self.b)) {
            (Some(true), Some(true)) => self.standardised_difference.is_none_or(|off| off.abs() >= MOVED),
            (a, b) => a != b,
        }
    }
}

#[cfg(test)]
mod tests;
