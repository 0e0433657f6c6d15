//! Receipts, in shard order -> `manifest.json` and `shards.jsonl`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::Digest;

use super::limits::FileKind;
use super::ranges::Selection;
use super::receipt::{self, FileFacts, Receipt};
use super::spec::CorpusSpec;
use super::stats::{LabelCounts, Moments, PointCounts};
use super::totals::Totals;
use super::{
    Build, CorpusError, FORMAT, Split, Store, Table, Yards, card, croissant, hex, names, plan_file, ranges, sha256,
};
use crate::cells::FeatureColumn;
use crate::shell;

pub(crate) const NAME: &str = "manifest.json";
pub const SHARDS: &str = "shards.jsonl";
/// The files beside the manifest whose hashes it holds, ascending.
pub(crate) const FILES: [&str; 4] = [card::NAME, croissant::NAME, plan_file::NAME, SHARDS];
/// The formats that are read.
pub(crate) const FORMATS: std::ops::RangeInclusive<u64> = 1..=FORMAT as u64;

/// What is known of a whole corpus. No time, host or path: equal plans and programs give equal manifests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Manifest {
    pub format: u32,
    pub name: String,
    pub seed: u64,
    pub scene_plan_hash: String,
    /// Hashes of the kinds of yard (seed and `scene` section of a family), ascending: scenes of equal number are the same yard where
    /// two corpora have one of these in common. Since format 2.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub yards: Vec<String>,
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
    /// Since format 2: the SHA-256 of the files beside the manifest, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
    /// Since format 2: the SHA-256 of all receipts, one behind the other in the order of their shards.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receipts_sha256: Option<String>,
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
pub(crate) fn replay(scene: u64) -> String {
    format!("marsyard explain plan.yaml --scene {scene}")
}

/// Receipts, one after another in shard order -> the manifest and `shards.jsonl`. Holds one line of text a shard, no receipts.
pub struct Merge<'a> {
    spec: &'a CorpusSpec,
    format: u32,
    totals: Totals,
    moments: Vec<Moments>,
    points: PointCounts,
    failed: Vec<FailedEntry>,
    /// Each program with the shards that it wrote; the first is that of the first shard.
    builds: Vec<(Build, Vec<u64>)>,
    receipts: sha2::Sha256,
    lines: String,
}

impl<'a> Merge<'a> {
    pub(crate) fn new(spec: &'a CorpusSpec) -> Merge<'a> {
        Merge::in_format(spec, FORMAT)
    }

    /// What an earlier version would have merged, to be compared with what it did.
    pub(crate) fn in_format(spec: &'a CorpusSpec, format: u32) -> Merge<'a> {
        Merge {
            spec,
            format,
            totals: Totals::new(),
            moments: vec![Moments::default(); spec.features.len()],
            points: PointCounts::default(),
            failed: Vec::new(),
            builds: Vec::new(),
            receipts: sha2::Sha256::default(),
            lines: String::new(),
        }
    }

    /// The next shard's receipt, and the bytes that it was read from.
    pub(crate) fn add(&mut self, receipt: &Receipt, bytes: &[u8]) {
        self.receipts.update(bytes);
        self.points = self.points + receipt.points;
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
        let labels = (self.format > 1).then_some(receipt.labels);
        let tables = receipt.tables.clone();
        let Receipt { shard, split, scenes, .. } = *receipt;
        let receipt_sha256 = (self.format > 1).then(|| sha256(bytes));
        let line = ShardLine { shard, split, scenes, labels, receipt_sha256, tables };
        self.totals.add(&line, receipt.labels, receipt.failed.len() as u64);
        self.lines += &serde_json::to_string(&line).expect("a line is plain data");
        self.lines.push('\n');
    }

    /// The manifest, and `shards.jsonl` as text. The hashes of the files beside it are for whoever writes them.
    pub(crate) fn finish(self) -> (Manifest, String) {
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
            format: self.format,
            name: spec.name.clone(),
            seed: spec.seed,
            scene_plan_hash: spec.scene_plan_hash.clone(),
            yards: if self.format > 1 { spec.yards.clone() } else { Vec::new() },
            corpus_id: self.totals.corpus_id(),
            scenes: spec.scenes,
            scenes_per_shard: spec.scenes_per_shard,
            shards: spec.shards(),
            families: spec.families.clone(),
            tables: self.totals.tables,
            splits: self.totals.splits,
            features: spec.features.iter().zip(self.moments).map(summary).collect(),
            points: self.points,
            failed: self.failed,
            build,
            files: BTreeMap::new(),
            receipts_sha256: (self.format > 1).then(|| hex(&self.receipts.finalize())),
            other_builds: builds.map(named).collect(),
        };
        (manifest, self.lines)
    }
}

impl Manifest {
    /// The first of the failed scenes, where they are more than this share of all.
    pub(crate) fn too_many_failed(&self, most_share: f64) -> Option<&FailedEntry> {
        let is_over = self.failed.len() as f64 > most_share * self.scenes as f64;
        self.failed.first().filter(|_| is_over)
    }

    /// The manifest's file.
    pub(crate) fn text(&self) -> String {
        serde_json::to_string_pretty(self).expect("a manifest is plain data") + "\n"
    }

    pub fn read(store: &dyn Store) -> Result<Manifest, CorpusError> {
        Manifest::read_with_bytes(store).map(|(manifest, _)| manifest)
    }

    /// The manifest, and the bytes that it was read from.
    pub(crate) fn read_with_bytes(store: &dyn Store) -> Result<(Manifest, Vec<u8>), CorpusError> {
        let at = shell::word(store.place());
        let fault = |reason: String, cure: String| {
            let (place, name) = (store.place(), NAME.into());
            CorpusError::BadManifest { place, name, reason, cure }
        };
        let bad = |reason| fault(reason, format!("run `marsyard finalize {at}` to write it again from the receipts"));
        let bytes = match FileKind::Manifest.read(store, NAME) {
            Err(CorpusError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                return Err(match store.size(plan_file::NAME)? {
                    Some(_) => fault(
                        "there is no manifest: the corpus is not finished".into(),
                        format!("`marsyard generate {at}` completes it"),
                    ),
                    None => fault(
                        "there is no manifest, nor a plan: this is no corpus".into(),
                        "name the place that `marsyard generate` named, such as corpora/quickstart".into(),
                    ),
                });
            }
            other => other?,
        };
        // The format first: the rest of a later format's manifest cannot be known.
        let stated = serde_json::from_slice::<serde_json::Value>(&bytes).ok().and_then(|all| all["format"].as_u64());
        if let Some(there) = stated.filter(|there| !FORMATS.contains(there)) {
            return Err(CorpusError::OtherFormat { place: store.place(), name: NAME.into(), there });
        }
        let manifest: Manifest =
            serde_json::from_slice(&bytes).map_err(|error| bad(format!("not a whole manifest ({error})")))?;
        manifest.check().map_err(bad)?;
        Ok((manifest, bytes))
    }

    /// What holds for every manifest that marsyard wrote: names that are no paths, numbers that can be true.
    pub(crate) fn check(&self) -> Result<(), String> {
        let named = self.families.iter().chain([&self.name]).find(|name| !names::is_folder_name(name));
        if let Some(name) = named {
            return Err(format!("the name {name:?} {}", names::RULE));
        }
        if !(1..=receipt::MOST_SCENES).contains(&u64::from(self.scenes_per_shard)) {
            return Err(format!("{} scenes in a shard are absurd", self.scenes_per_shard));
        }
        if self.format > 1 && (self.receipts_sha256.is_none() || !self.files.keys().map(String::as_str).eq(FILES)) {
            return Err(format!("it lacks the hashes of {} and the receipts", FILES.join(", ")));
        }
        // Their names would say that what they cover is checked.
        let has_later_keys = !self.files.is_empty() || self.receipts_sha256.is_some() || !self.yards.is_empty();
        if self.format == 1 && has_later_keys {
            return Err("it is of format 1, and has keys of format 2: its format was edited".into());
        }
        let foreign = |failed: &&FailedEntry| failed.scene >= self.scenes || failed.replay != replay(failed.scene);
        match self.failed.iter().find(foreign) {
            Some(failed) => Err(format!("it lists scene {} as failed, which is none of its own", failed.scene)),
            None => Ok(()),
        }
    }

    /// As many shards as its scenes fill.
    pub(crate) fn shards_of_scenes(&self) -> u64 {
        self.scenes.div_ceil(u64::from(self.scenes_per_shard.max(1)))
    }

    /// The scenes of a shard: the first, and the one after the last.
    pub(crate) fn scenes_of(&self, shard: u64) -> [u64; 2] {
        let size = u64::from(self.scenes_per_shard);
        [shard, shard.saturating_add(1)].map(|shard| shard.saturating_mul(size).min(self.scenes))
    }

    /// The split that a scene lies in.
    pub(crate) fn split_of(&self, scene: u64) -> Split {
        Split::of_shard(scene / u64::from(self.scenes_per_shard.max(1)))
    }

    /// Its yards and their splits.
    pub(crate) fn yards(&self) -> Yards {
        let Manifest { seed, scenes, scenes_per_shard, .. } = *self;
        Yards { seed, yards: self.yards.clone(), scenes, scenes_per_shard }
    }

    /// The program that wrote a shard.
    pub(crate) fn build_of(&self, shard: u64) -> &Build {
        let wrote = |other: &&OtherBuild| {
            other
                .shards
                .parse()
                .is_ok_and(|shards: Selection| shards.of(self.shards).is_ok_and(|all| all.contains(&shard)))
        };
        self.other_builds.iter().find(wrote).map_or(&self.build, |other| &other.build)
    }

    pub(crate) fn labels(&self) -> LabelCounts {
        self.splits.values().map(|split| split.labels).sum()
    }
}

/// One line of `shards.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShardLine {
    pub shard: u64,
    pub split: Split,
    pub scenes: [u64; 2],
    /// Since format 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelCounts>,
    /// Of the shard's receipt. Since format 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receipt_sha256: Option<String>,
    pub tables: BTreeMap<Table, FileFacts>,
}

/// The lines of `shards.jsonl`, of its bytes; `Err` says what is wrong with it.
pub fn parse_shard_lines(bytes: &[u8]) -> Result<Vec<ShardLine>, String> {
    let text = std::str::from_utf8(bytes).map_err(|error| error.to_string())?;
    let mut lines: Vec<ShardLine> = Vec::new();
    for (number, text) in text.lines().enumerate() {
        let at = |reason: String| format!("line {}: {reason}", number + 1);
        let line: ShardLine = serde_json::from_str(text).map_err(|error| at(error.to_string()))?;
        receipt::check_shard(line.shard, line.split, line.scenes, &line.tables).map_err(at)?;
        if lines.last().is_some_and(|before| before.shard >= line.shard) {
            return Err(at(format!("shard {} does not follow the one before", line.shard)));
        }
        lines.push(line);
    }
    Ok(lines)
}
