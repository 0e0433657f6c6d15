//! Receipts, in shard order -> `manifest.json` and `shards.jsonl`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::receipt::{self, FileFacts, Receipt};
use super::spec::{Build, CorpusSpec};
use super::stats::{LabelCounts, Moments, PointCounts};
use super::{CorpusError, FORMAT, Split, Store, Table, ranges, value_hash};
use crate::cells::FeatureColumn;

pub const NAME: &str = "manifest.json";
pub const SHARDS: &str = "shards.jsonl";

/// What is known of a whole corpus. No time, host or path: equal plans and programs give equal manifests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Manifest {
    pub format: u32,
    pub name: String,
    pub seed: u64,
    pub scene_plan_hash: String,
    /// Hash over the sorted value hashes of all files.
    pub corpus_id: String,
    pub scenes: u64,
    pub scenes_per_shard: u32,
    pub shards: u64,
    pub families: Vec<String>,
    pub tables: BTreeMap<Table, TableTotals>,
    pub splits: BTreeMap<Split, SplitTotals>,
    /// Of the train split alone, shards merged in order: what a trainer scales by.
    pub features: Vec<FeatureSummary>,
    pub points: PointCounts,
    pub failed: Vec<FailedEntry>,
    /// The program that wrote shard 0.
    pub build: Build,
    /// Programs that wrote the other shards, where they differ from it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub other_builds: Vec<OtherBuild>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct TableTotals {
    pub rows: u64,
    pub bytes: u64,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SplitTotals {
    pub shards: u64,
    pub scenes: u64,
    pub failed_scenes: u64,
    pub rows: BTreeMap<Table, u64>,
    pub labels: LabelCounts,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FeatureSummary {
    pub name: String,
    pub unit: String,
    #[serde(flatten)]
    pub moments: Moments,
}

/// A scene that gave no rows, and how to see why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FailedEntry {
    pub scene: u64,
    pub error: String,
    /// To be run in the corpus folder.
    pub replay: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct OtherBuild {
    /// As `3..5,9`.
    pub shards: String,
    pub build: Build,
}

/// The command that replays one scene, to be run in the corpus folder.
pub fn replay(scene: u64) -> String {
    format!("marsyard explain plan.yaml --scene {scene}")
}

/// Receipts, one after another in shard order -> the manifest and `shards.jsonl`. Holds one line of text a shard, no receipts.
pub struct Merge<'a> {
    spec: &'a CorpusSpec,
    tables: BTreeMap<Table, TableTotals>,
    splits: BTreeMap<Split, SplitTotals>,
    moments: Vec<Moments>,
    points: PointCounts,
    failed: Vec<FailedEntry>,
    value_hashes: Vec<String>,
    /// Each program with the shards that it wrote; the first is that of the first shard.
    builds: Vec<(Build, Vec<u64>)>,
    lines: String,
}

impl<'a> Merge<'a> {
    pub fn new(spec: &'a CorpusSpec) -> Merge<'a> {
        Merge {
            spec,
            tables: BTreeMap::new(),
            splits: Split::ALL.iter().map(|&split| (split, SplitTotals::default())).collect(),
            moments: vec![Moments::default(); spec.features.len()],
            points: PointCounts::default(),
            failed: Vec::new(),
            value_hashes: Vec::new(),
            builds: Vec::new(),
            lines: String::new(),
        }
    }

    /// The next shard's receipt.
    pub fn add(&mut self, receipt: &Receipt) {
        self.points = self.points + receipt.points;
        let split = self.splits.entry(receipt.split).or_default();
        split.shards += 1;
        split.scenes += receipt.scenes[1] - receipt.scenes[0];
        split.failed_scenes += receipt.failed.len() as u64;
        split.labels = split.labels + receipt.labels;
        for (&table, facts) in &receipt.tables {
            *split.rows.entry(table).or_default() += facts.rows;
            let totals = self.tables.entry(table).or_default();
            totals.rows += facts.rows;
            totals.bytes += facts.bytes;
            self.value_hashes.push(facts.value_hash.clone());
        }
        if receipt.split == Split::Train {
            for (merged, of_shard) in self.moments.iter_mut().zip(&receipt.features) {
                *merged = merged.merge(&of_shard.moments);
            }
        }
        self.failed.extend(receipt.failed.iter().map(|scene| FailedEntry {
            scene: scene.scene,
            error: scene.error.clone(),
            replay: replay(scene.scene),
        }));
        match self.builds.iter_mut().find(|(build, _)| *build == receipt.build) {
            Some((_, shards)) => shards.push(receipt.shard),
            None => self.builds.push((receipt.build.clone(), vec![receipt.shard])),
        }
        let tables = receipt.tables.clone();
        let line = ShardLine { shard: receipt.shard, split: receipt.split, scenes: receipt.scenes, tables };
        self.lines += &serde_json::to_string(&line).expect("a line is plain data");
        self.lines.push('\n');
    }

    /// The manifest, and `shards.jsonl` as text.
    pub fn finish(self) -> (Manifest, String) {
        let spec = self.spec;
        let summary = |(feature, moments): (&FeatureColumn, Moments)| FeatureSummary {
            name: feature.name.clone(),
            unit: feature.unit.into(),
            moments,
        };
        let mut builds = self.builds.into_iter();
        let build = builds.next().map(|(build, _)| build).unwrap_or_default();
        let named = |(build, shards): (Build, Vec<u64>)| OtherBuild { shards: ranges::to_text(&shards), build };
        let manifest = Manifest {
            format: FORMAT,
            name: spec.name.clone(),
            seed: spec.seed,
            scene_plan_hash: spec.scene_plan_hash.clone(),
            corpus_id: value_hash::corpus_id(self.value_hashes.iter().map(String::as_str)),
            scenes: spec.scenes,
            scenes_per_shard: spec.scenes_per_shard,
            shards: spec.shards(),
            families: spec.families.clone(),
            tables: self.tables,
            splits: self.splits,
            features: spec.features.iter().zip(self.moments).map(summary).collect(),
            points: self.points,
            failed: self.failed,
            build,
            other_builds: builds.map(named).collect(),
        };
        (manifest, self.lines)
    }
}

impl Manifest {
    pub fn write(&self, store: &dyn Store) -> Result<(), CorpusError> {
        let text = serde_json::to_string_pretty(self).expect("a manifest is plain data") + "\n";
        store.replace(NAME, text.as_bytes())
    }

    pub fn read(store: &dyn Store) -> Result<Manifest, CorpusError> {
        let bad = |reason: String| CorpusError::BadManifest { place: store.place(), name: NAME.into(), reason };
        if store.size(NAME)?.is_none() {
            return Err(bad("there is no manifest: the corpus is not finished, or this is not a corpus".into()));
        }
        let bytes = store.read(NAME)?;
        // The format first: the rest of another format's manifest cannot be known.
        let stated = serde_json::from_slice::<serde_json::Value>(&bytes).ok().and_then(|all| all["format"].as_u64());
        if let Some(there) = stated.filter(|&there| there != u64::from(FORMAT)) {
            return Err(CorpusError::OtherFormat { place: store.place(), name: NAME.into(), there });
        }
        serde_json::from_slice(&bytes).map_err(|error| bad(format!("not a whole manifest ({error})")))
    }

    pub fn labels(&self) -> LabelCounts {
        self.splits.values().map(|split| split.labels).sum()
    }
}

/// One line of `shards.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShardLine {
    pub shard: u64,
    pub split: Split,
    pub scenes: [u64; 2],
    pub tables: BTreeMap<Table, FileFacts>,
}

/// `shards.jsonl` read back.
pub fn read_shard_lines(store: &dyn Store) -> Result<Vec<ShardLine>, CorpusError> {
    let bad = |reason: String| CorpusError::BadManifest { place: store.place(), name: SHARDS.into(), reason };
    let bytes = store.read(SHARDS)?;
    let text = std::str::from_utf8(&bytes).map_err(|error| bad(error.to_string()))?;
    let mut lines: Vec<ShardLine> = Vec::new();
    for (number, text) in text.lines().enumerate() {
        let at = |reason: String| bad(format!("line {}: {reason}", number + 1));
        let line: ShardLine = serde_json::from_str(text).map_err(|error| at(error.to_string()))?;
        receipt::check_shard(line.shard, line.split, line.scenes, &line.tables).map_err(at)?;
        if lines.last().is_some_and(|before| before.shard >= line.shard) {
            return Err(at(format!("shard {} does not follow the one before", line.shard)));
        }
        lines.push(line);
    }
    Ok(lines)
}
