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

pub mod belongs;
pub mod card;
pub mod cell_file;
pub mod cells;
pub mod checked;
pub mod compare;
pub mod croissant;
pub mod documents;
pub mod error;
pub mod finalize;
pub mod finished;
pub mod free_space;
pub mod inspect;
pub mod key_differences;
pub mod limits;
mod listing;
mod lookup;
pub mod manifest;
pub mod names;
pub mod outputs;
pub mod owner;
mod pages;
pub mod place;
pub mod plain;
pub mod plan_file;
mod program;
pub mod ranges;
pub mod reader;
pub mod rebuild;
pub mod rebuilt;
pub mod receipt;
pub mod schema;
pub mod shard;
pub mod signature;
pub mod spec;
pub mod stats;
pub mod store;
mod tables;
#[cfg(test)]
pub(crate) mod tests;
mod totals;
mod value_hash;
pub mod verify;
mod write;
pub mod yards;

pub use crate::plan::{Split, Table};
pub use error::CorpusError;
pub use finalize::{Known, finalize, finalize_knowing};
pub use finished::Finished;
pub use free_space::FreeSpace;
pub use inspect::{Inspection, inspect};
pub use lookup::{families_of_scenes, stored_cell};
pub use manifest::Manifest;
pub use outputs::Outputs;
pub use place::{Place, Status, status, status_of};
pub use program::Build;
pub use ranges::Selection;
pub use receipt::Receipt;
pub use shard::{FinishedShard, ShardWriter};
pub use spec::CorpusSpec;
pub use store::{LocalFolder, Store, address};
pub use yards::Yards;

/// Version of the manifest, `shards.jsonl` and the receipts; those of earlier versions are read, too.
///
/// 1: no hashes of the files beside the manifest, none of the receipts, no labels in `shards.jsonl`. 2: with them.
pub const FORMAT: u32 = 2;

/// Version of the tables, written into each: a change of a column, of the Parquet crates or of an encoding raises it.
pub const PARQUET_FORMAT: u32 = 1;

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
