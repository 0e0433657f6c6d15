//! Lines of `shards.jsonl` -> the sums that a manifest holds: of splits, of tables, of all values.
//!
//! Whoever merges receipts and whoever opens a finished corpus adds up the same way.

use std::collections::BTreeMap;

use super::manifest::{Manifest, ShardLine, SplitTotals, TableTotals};
use super::stats::LabelCounts;
use super::{Split, Table, value_hash};

/// Sums over shards.
#[derive(Clone, Debug)]
pub(crate) struct Totals {
    pub tables: BTreeMap<Table, TableTotals>,
    pub splits: BTreeMap<Split, SplitTotals>,
    value_hashes: Vec<String>,
}

impl Totals {
    pub(super) fn new() -> Totals {
        Totals {
            tables: BTreeMap::new(),
            splits: Split::ALL.iter().map(|&split| (split, SplitTotals::default())).collect(),
            value_hashes: Vec::new(),
        }
    }

    /// Adds a shard of which some scenes failed.
    pub(super) fn add(&mut self, line: &ShardLine, labels: LabelCounts, failed_scenes: u64) {
        let split = self.splits.entry(line.split).or_default();
        split.shards += 1;
        split.scenes += line.scenes[1].saturating_sub(line.scenes[0]);
        split.failed_scenes += failed_scenes;
        split.labels = split.labels + labels;
        for (&table, facts) in &line.tables {
            // What is read back may say anything: a sum that does not fit is no sum of a sound corpus.
            let rows = split.rows.entry(table).or_default();
            *rows = rows.saturating_add(facts.rows);
            let totals = self.tables.entry(table).or_default();
            totals.rows = totals.rows.saturating_add(facts.rows);
            totals.bytes = totals.bytes.saturating_add(facts.bytes);
            self.value_hashes.push(facts.value_hash.clone());
        }
    }

    pub(super) fn corpus_id(&self) -> String {
        value_hash::corpus_id(self.value_hashes.iter().map(String::as_str))
    }
}

/// Where a manifest and its list of shards disagree, in words; `None` where they are of one corpus.
pub(crate) fn disagreement(manifest: &Manifest, lines: &[ShardLine]) -> Option<String> {
    let listed = lines.len() as u64;
    if listed != manifest.shards || manifest.shards != manifest.shards_of_scenes() {
        let scenes = manifest.scenes;
        return Some(format!("it lists {listed} shards, the manifest has {} of {scenes} scenes", manifest.shards));
    }
    let mut totals = Totals::new();
    for (number, line) in (0..).zip(lines) {
        let scenes = manifest.scenes_of(number);
        if line.shard != number || line.scenes != scenes {
            let [first, end] = line.scenes;
            return Some(format!(
                "it says shard {} of scenes {first}..{end} where shard {number} of scenes {}..{} is due",
                line.shard, scenes[0], scenes[1]
            ));
        }
        let is_format_1 = manifest.format == 1;
        if line.labels.is_none() != is_format_1 || line.receipt_sha256.is_none() != is_format_1 {
            return Some(format!("its line of shard {number} is not of the manifest's format {}", manifest.format));
        }
        if !line.tables.keys().eq(manifest.tables.keys()) {
            return Some(format!("its line of shard {number} has other tables than the manifest"));
        }
        totals.add(line, line.labels.unwrap_or_default(), 0);
    }
    for failed in &manifest.failed {
        totals.splits.entry(manifest.split_of(failed.scene)).or_default().failed_scenes += 1;
    }
    if manifest.format == 1 {
        // Labels by shard are not known: what the manifest says of its splits stands.
        for (split, said) in &manifest.splits {
            totals.splits.entry(*split).or_default().labels = said.labels;
        }
    }
    if totals.tables != manifest.tables {
        return Some("it lists other tables, rows or bytes than the manifest".into());
    }
    if totals.splits != manifest.splits {
        let differ = Split::ALL.iter().find(|split| totals.splits.get(split) != manifest.splits.get(split));
        let named = differ.map_or("", |split| split.name());
        return Some(format!("it lists other scenes, rows or labels of the {named} split than the manifest"));
    }
    (totals.corpus_id() != manifest.corpus_id)
        .then(|| "it lists values that do not give the manifest's corpus_id".into())
}
