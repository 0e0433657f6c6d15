//! Scenes' rows -> Parquet shards, receipts, manifest; and back. Outside of tests nothing else uses the arrow crates or parquet: who
//! learns from a corpus or judges by it takes the cells as [`cells::CellBatch`].
//!
//! In: a [`CorpusSpec`] (what the plan says of the corpus as a whole) and one [`SceneOutput`](crate::episode::SceneOutput) a scene. Out: a place (a folder
//! or an object store) that holds
//!
//! ```text
//! README.md  croissant.json  manifest.json  shards.jsonl      written by `finalize`, from the receipts
//! plan.yaml                                                   the resolved config
//! receipts/0000007.json                                       one a shard: written last, so a shard is there whole or not at all
//! data/<table>/<split>-0000007.parquet
//! ```
//!
//! Same plan, same bytes: no time, host, path or thread count is in any of them. What is written can be compared in two
//! ways: sha256 covers a file, the value hash covers its Arrow values and outlives a change of compression.
//! Not here: what the columns' numbers mean beyond a sentence (the stages say that), and how scenes are scheduled.

pub(crate) mod advice;
pub(crate) mod belongs;
pub(crate) mod card;
pub(crate) mod cell_file;
pub mod cells;
pub(crate) mod checked;
pub(crate) mod compare;
pub(crate) mod croissant;
pub(crate) mod documents;
pub(crate) mod error;
pub(crate) mod finalize;
pub(crate) mod finished;
pub(crate) mod free_space;
pub(crate) mod inspect;
pub(crate) mod kept_poses;
pub(crate) mod key_differences;
pub(crate) mod limits;
mod listing;
mod lookup;
pub mod manifest;
pub(crate) mod names;
pub(crate) mod outputs;
pub(crate) mod owner;
mod pages;
pub mod place;
pub(crate) mod plain;
pub(crate) mod plan_difference;
pub(crate) mod plan_file;
mod program;
pub(crate) mod ranges;
pub mod reader;
pub(crate) mod rebuild;
pub(crate) mod rebuilt;
pub(crate) mod receipt;
pub(crate) mod schema;
pub(crate) mod shard;
pub(crate) mod signature;
pub(crate) mod spec;
pub(crate) mod stats;
mod status;
pub(crate) mod store;
mod tables;
#[cfg(test)]
pub(crate) mod tests;
mod totals;
mod value_hash;
pub(crate) mod verify;
pub(crate) mod write;
pub(crate) mod yards;

pub use crate::plan::{Split, Table};
pub use error::CorpusError;
pub(crate) use finalize::{Known, finalize, finalize_knowing};
pub use finished::Finished;
pub(crate) use free_space::FreeSpace;
pub(crate) use inspect::inspect_with;
pub use inspect::{Inspection, inspect};
pub(crate) use lookup::families_of_scenes;
pub use lookup::stored_cell;
pub use manifest::Manifest;
pub(crate) use outputs::Outputs;
pub(crate) use place::Place;
pub use program::Build;
pub use ranges::Selection;
pub use receipt::Receipt;
pub use shard::{FinishedShard, ShardWriter};
pub use spec::CorpusSpec;
pub(crate) use status::{Status, status, status_of};
pub use store::{LocalFolder, Store, address};
pub use yards::Yards;

/// Version of the manifest, `shards.jsonl` and the receipts; those of earlier versions are read, too.
///
/// 1: no hashes of the files beside the manifest, none of the receipts, no labels in `shards.jsonl`. 2: with them.
pub(crate) const FORMAT: u32 = 2;

/// Version of the tables, written into each: a change of a column, of the Parquet crates or of an encoding raises it.
pub(crate) const PARQUET_FORMAT: u32 = 1;

/// 32 bytes as 64 hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// sha256 of a file's bytes, as hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    use sha2::Digest;
    hex(&sha2::Sha256::digest(bytes))
}
