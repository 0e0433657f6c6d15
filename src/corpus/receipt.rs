//! What a finished shard leaves behind, and how it is read back.
//!
//! A receipt is written after the shard's tables, create-only: where it is, the shard is whole. The manifest and
//! `shards.jsonl` are merged from receipts alone, so that many machines can build one corpus.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::limits::FileKind;
use super::stats::{LabelCounts, Moments, PointCounts};
use super::store::{Put, Store};
use super::{Build, CorpusError, CorpusSpec, Split, Table, manifest};

pub(crate) const FOLDER: &str = "receipts";

/// What is known of a finished shard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Receipt {
    pub format: u32,
    pub scene_plan_hash: String,
    pub shard: u64,
    pub split: Split,
    /// First scene, and the one after the last.
    pub scenes: [u64; 2],
    pub tables: BTreeMap<Table, FileFacts>,
    /// By feature, in the order of the columns.
    pub features: Vec<FeatureMoments>,
    pub labels: LabelCounts,
    pub points: PointCounts,
    pub failed: Vec<FailedScene>,
    pub build: Build,
}

/// What a receipt of any format says.
#[derive(Deserialize)]
struct Format {
    format: u64,
}

/// A data file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FileFacts {
    pub path: String,
    pub rows: u64,
    pub row_groups: u32,
    pub bytes: u64,
    pub sha256: String,
    pub value_hash: String,
}

/// A feature's moments under its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FeatureMoments {
    pub name: String,
    #[serde(flatten)]
    pub moments: Moments,
}

/// A scene that gave no rows, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FailedScene {
    pub scene: u64,
    pub error: String,
}

impl Receipt {
    pub fn path(shard: u64) -> String {
        format!("{FOLDER}/{shard:07}.json")
    }

    /// Writes the receipt. One that is there already and differs by its format and the program alone that wrote it is the same
    /// shard.
    pub(crate) fn put(&self, store: &dyn Store) -> Result<Put, CorpusError> {
        let name = Receipt::path(self.shard);
        let text = serde_json::to_string_pretty(self).expect("a receipt is plain data") + "\n";
        match store.put(&name, text.as_bytes()) {
            Err(refused @ CorpusError::Differs { .. }) => match Receipt::read(store, self.shard, &self.scene_plan_hash)
            {
                Ok(there) if Receipt { format: self.format, build: self.build.clone(), ..there.clone() } == *self => {
                    Ok(Put::Same)
                }
                _ => Err(refused),
            },
            other => other,
        }
    }

    /// Reads and checks a receipt: whole, of a format that is read, of this plan, of this shard.
    pub fn read(store: &dyn Store, shard: u64, scene_plan_hash: &str) -> Result<Receipt, CorpusError> {
        Receipt::read_with_bytes(store, shard, scene_plan_hash).map(|(receipt, _)| receipt)
    }

    /// The receipt of a plan's shard, and the bytes that it was read from; one that says what the plan does not is refused.
    pub(crate) fn read_of(store: &dyn Store, spec: &CorpusSpec, shard: u64) -> Result<(Receipt, Vec<u8>), CorpusError> {
        let (receipt, bytes) = Receipt::read_with_bytes(store, shard, &spec.scene_plan_hash)?;
        let bad = |reason| CorpusError::BadReceipt { place: store.place(), name: Receipt::path(shard), reason };
        receipt.check(spec).map_err(bad)?;
        Ok((receipt, bytes))
    }

    /// Whether scenes, tables, features and failures are such as the plan asks of the shard.
    fn check(&self, spec: &CorpusSpec) -> Result<(), String> {
        let due = spec.scenes_of(self.shard);
        let [first, end] = self.scenes;
        if (first..end) != due {
            return Err(format!("it says scenes {first}..{end}, where the plan has {}..{}", due.start, due.end));
        }
        if !self.tables.keys().eq(BTreeSet::from_iter(&spec.tables)) {
            return Err("its tables are not those of the plan".into());
        }
        if !self.features.iter().map(|said| &said.name).eq(spec.features.iter().map(|feature| &feature.name)) {
            return Err("its features are not those of the plan".into());
        }
        // Ascending, so that none is counted twice.
        if !self.failed.is_sorted_by(|a, b| a.scene < b.scene) {
            return Err("its failed scenes do not ascend".into());
        }
        match self.failed.iter().find(|failed| !due.contains(&failed.scene)) {
            Some(failed) => Err(format!("it lists scene {} as failed, which is none of its own", failed.scene)),
            None => Ok(()),
        }
    }

    /// The receipt, and the bytes that it was read from.
    fn read_with_bytes(
        store: &dyn Store,
        shard: u64,
        scene_plan_hash: &str,
    ) -> Result<(Receipt, Vec<u8>), CorpusError> {
        let name = Receipt::path(shard);
        let bytes = FileKind::Receipt.read(store, &name)?;
        let bad = |reason: String| CorpusError::BadReceipt { place: store.place(), name: name.clone(), reason };
        // The format first: the rest of a later format's receipt cannot be known, and it may be sound.
        let stated = serde_json::from_slice::<Format>(&bytes).ok().map(|stated| stated.format);
        if let Some(there) = stated.filter(|there| !manifest::FORMATS.contains(there)) {
            return Err(CorpusError::OtherFormat { place: store.place(), name, there });
        }
        let receipt: Receipt =
            serde_json::from_slice(&bytes).map_err(|error| bad(format!("not a whole receipt ({error})")))?;
        if receipt.scene_plan_hash != scene_plan_hash {
            let short = |hash: &str| hash.chars().take(12).collect::<String>();
            let (theirs, ours) = (short(&receipt.scene_plan_hash), short(scene_plan_hash));
            return Err(bad(format!("it belongs to another plan (scene_plan_hash {theirs}, not {ours})")));
        }
        if receipt.shard != shard {
            return Err(bad(format!("it is the receipt of shard {}", receipt.shard)));
        }
        check_shard(shard, receipt.split, receipt.scenes, &receipt.tables).map_err(bad)?;
        Ok((receipt, bytes))
    }
}

/// More of anything than a shard can have; lists of scenes and row groups are made from these numbers.
pub(crate) const MOST_SCENES: u64 = 100_000;
const MOST_ROW_GROUPS: u32 = 4096;
const MOST_ROWS: u64 = 1 << 40;

/// Whether what is said of a shard can be true: its split and paths are those of its number, and nothing is absurd.
pub(crate) fn check_shard(
    shard: u64,
    split: Split,
    scenes: [u64; 2],
    tables: &BTreeMap<Table, FileFacts>,
) -> Result<(), String> {
    if split != Split::of_shard(shard) || tables.iter().any(|(table, file)| file.path != table.path(shard)) {
        return Err("its split or paths are not those of its shard".into());
    }
    let [first, end] = scenes;
    if end.checked_sub(first).is_none_or(|count| count > MOST_SCENES) {
        return Err(format!("scenes {first} to {end} are not those of one shard"));
    }
    let absurd = |file: &&FileFacts| file.row_groups > MOST_ROW_GROUPS || file.rows > MOST_ROWS;
    match tables.values().find(absurd) {
        Some(file) => Err(format!("{}: {} rows in {} row groups are absurd", file.path, file.rows, file.row_groups)),
        None => Ok(()),
    }
}

/// Numbers of the shards that have a receipt file, ascending.
pub(crate) fn numbers(store: &dyn Store) -> Result<Vec<u64>, CorpusError> {
    let files = store.list(FOLDER)?;
    let mut numbers: Vec<u64> = files.iter().filter_map(|(name, _)| number(name)).collect();
    numbers.sort_unstable();
    Ok(numbers)
}

/// The shard whose receipt bears this name.
pub(crate) fn number(name: &str) -> Option<u64> {
    let number = name.strip_prefix(FOLDER)?.strip_prefix('/')?.strip_suffix(".json")?.parse().ok()?;
    (Receipt::path(number) == name).then_some(number)
}
