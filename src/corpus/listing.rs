//! The folders that readers read by glob -> what lies there and belongs to no shard of the corpus, and what is missing.
//!
//! Polars, DuckDB and Hugging Face take `data/cells/train-*.parquet` as it is: a file too many is read by them, whatever a manifest
//! says. One listing a folder, so that a corpus of 10^5 shards is listed in a second.

use std::collections::HashMap;

use super::manifest::{Manifest, ShardLine};
use super::reader::TableFile;
use super::receipt::{self, Receipt};
use super::{CorpusError, Store, Table};

/// What lies in the folders of tables and receipts.
pub(crate) struct Listing {
    sizes: HashMap<String, u64>,
    /// Links, folders, pipes.
    odd: Vec<String>,
}

/// Why a file that belongs to no shard lies in a corpus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Stray {
    /// Of a whole shard behind the plan's end: the corpus was larger, or was to grow.
    Beyond { shard: u64 },
    /// Marsyard wrote it for this plan, and no receipt speaks for it: half a shard, or a copy.
    Ours,
    /// Marsyard did not write it for this plan.
    Foreign,
}

impl Listing {
    /// Of a place that was not listed.
    pub(crate) fn none() -> Listing {
        Listing { sizes: HashMap::new(), odd: Vec::new() }
    }

    pub(crate) fn of(store: &dyn Store) -> Result<Listing, CorpusError> {
        let mut listing = Listing::none();
        for folder in Table::ALL.map(Table::folder).iter().map(String::as_str).chain([receipt::FOLDER]) {
            let (files, others) = store.list_all(folder)?;
            listing.sizes.extend(files);
            listing.odd.extend(others);
        }
        Ok(listing)
    }

    /// Names that some reader would read and that are of no shard below `shards` of these tables, ascending.
    pub(crate) fn strays(&self, shards: u64, tables: impl Fn(Table) -> bool) -> Vec<String> {
        let expected = |name: &str| match Table::of_path(name) {
            Some((table, shard)) => shard < shards && tables(table),
            None => receipt::number(name).is_some_and(|shard| shard < shards),
        };
        let all = self.sizes.keys().chain(&self.odd);
        let mut strays: Vec<String> = all.filter(|name| is_read(name) && !expected(name)).cloned().collect();
        strays.sort_unstable();
        strays
    }

    /// Files of the corpus that are not there, or not of their size; each with what is wrong with it.
    pub(crate) fn faults(&self, manifest: &Manifest, lines: &[ShardLine]) -> impl Iterator<Item = (String, String)> {
        let tables = lines.iter().flat_map(|line| line.tables.values());
        let tables = tables.filter_map(|facts| Some((facts.path.clone(), self.fault(&facts.path, Some(facts.bytes))?)));
        let receipts = (0..manifest.shards).map(Receipt::path);
        tables.chain(receipts.filter_map(|name| self.fault(&name, None).map(|what| (name, what))))
    }

    fn fault(&self, name: &str, expected: Option<u64>) -> Option<String> {
        match (self.sizes.get(name), expected) {
            (Some(&size), Some(bytes)) if size != bytes => {
                Some(format!("it has {size} bytes, shards.jsonl says {bytes}"))
            }
            (Some(_), _) => None,
            (None, _) if self.odd.iter().any(|odd| odd == name) => {
                Some("it is a link, a folder or a pipe, no file".into())
            }
            (None, _) => Some("it is missing".into()),
        }
    }

    /// What a stray in a corpus of so many shards is; reads its head.
    pub(crate) fn judge(
        &self,
        store: &dyn Store,
        name: &str,
        scene_plan_hash: &str,
        shards: u64,
    ) -> Result<Stray, CorpusError> {
        if !self.sizes.contains_key(name) {
            return Ok(Stray::Foreign);
        }
        if let Some(shard) = receipt::number(name) {
            let ours = match Receipt::read(store, shard, scene_plan_hash) {
                Ok(_) => true,
                Err(CorpusError::BadReceipt { .. } | CorpusError::OtherFormat { .. }) => false,
                Err(error) => return Err(error),
            };
            return Ok(if ours { Stray::Beyond { shard } } else { Stray::Foreign });
        }
        if !is_ours(store, name, scene_plan_hash)?.unwrap_or(false) {
            return Ok(Stray::Foreign);
        }
        let receipted = |&shard: &u64| shard >= shards && self.sizes.contains_key(&Receipt::path(shard));
        let shard = Table::of_path(name).map(|(_, shard)| shard).filter(receipted);
        Ok(shard.map_or(Stray::Ours, |shard| Stray::Beyond { shard }))
    }
}

/// Whether a table file says itself that marsyard wrote it for a plan; `None` where it cannot be read as Parquet.
pub(crate) fn is_ours(store: &dyn Store, name: &str, scene_plan_hash: &str) -> Result<Option<bool>, CorpusError> {
    match TableFile::open(store, name) {
        Ok(file) => {
            Ok(Some(file.key_values().get("marsyard.scene_plan_hash").is_some_and(|there| there == scene_plan_hash)))
        }
        Err(CorpusError::Parquet { .. } | CorpusError::Arrow { .. }) => Ok(None),
        // Gone since it was listed, or its name is no text.
        Err(CorpusError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(Some(false)),
        Err(error) => Err(error),
    }
}

/// Whether some reader takes what bears this name: hidden files are skipped, unless a glob for `*.parquet` catches them.
fn is_read(name: &str) -> bool {
    let (folder, file) = name.rsplit_once('/').unwrap_or(("", name));
    if folder == receipt::FOLDER {
        file.ends_with(".json")
    } else {
        file.ends_with(".parquet") || !file.starts_with(['.', '_'])
    }
}
