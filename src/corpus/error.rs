//! What can go wrong between rows and files; each message names the place, the rule and the cure.

use arrow::error::ArrowError;
use parquet::errors::ParquetError;

/// Why a corpus could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CorpusError {
    #[error("{place}/{name}: {source}")]
    Io { place: String, name: String, source: std::io::Error },
    #[error("{place}: {reason}; {cure}")]
    Refused { place: String, reason: String, cure: String },
    #[error(
        "{place}/{name}: {why}; nothing else came in {patience_s:.0} s of trying. What is stored is kept: when the network and the \
             store are well again, the same command goes on"
    )]
    Unreachable { place: String, name: String, why: String, patience_s: f64 },
    #[error("'{name}' is not a name within a corpus: names are relative, with / between parts and no '..'")]
    BadName { name: String },
    #[error(
        "{place}/{name} is there already with other bytes ({there}, not {here}); the same plan gives the same bytes, so it was \
             damaged, or written by another binary: delete it and run `marsyard generate` again, or choose another place"
    )]
    Differs { place: String, name: String, there: String, here: String },
    #[error("{place}/{name}: {reason}; delete the file and run `marsyard generate` again: it builds that shard anew")]
    BadReceipt { place: String, name: String, reason: String },
    #[error("{place}/{name}: {reason}; run `marsyard finalize {place}` to write it again from the receipts")]
    BadManifest { place: String, name: String, reason: String },
    #[error(
        "{place}/{name}: written in format {there}, this program reads format {}; use the marsyard that wrote it, or build the \
             corpus again with this one, in another place; a file of which you know that it is damaged may be deleted",
        super::FORMAT
    )]
    OtherFormat { place: String, name: String, there: u64 },
    #[error(
        "{place} holds another corpus: its scene_plan_hash is {there}, this plan's is {here}; choose another place, or undo \
             the difference (plan there: -, plan here: +)\n{difference}"
    )]
    OtherPlan { place: String, there: String, here: String, difference: String },
    #[error(
        "{place}/plan.yaml was not written by marsyard (its first line does not say the scene_plan_hash); choose an empty place"
    )]
    ForeignPlan { place: String },
    #[error(
        "{place} holds shard {shard}, but the plan ends before shard {shards}: a corpus only grows; raise `scenes` or choose \
             another place"
    )]
    BeyondPlan { place: String, shard: u64, shards: u64 },
    #[error(
        "{place}: {missing} of {shards} shards are missing or damaged ({ranges}); build them with `marsyard generate {place}`, on \
             many machines with --shards, then finalize again"
    )]
    Gaps { place: String, missing: u64, shards: u64, ranges: String },
    #[error(
        "{place}: {what} takes {} MB and {} MB are to stay free, but {} MB are free; free some space, or choose another place with \
             --out, or another --keep-free-mb: the same command again goes on",
        mb(*bytes), mb(*keep_bytes), mb(*free_bytes)
    )]
    NoRoom { place: String, what: String, bytes: u64, keep_bytes: u64, free_bytes: u64 },
    #[error(
        "{place} is no longer the place of this plan: it was removed, unmounted or taken by another; the shards written before lie \
             where it went: bring it back, and the same command again goes on"
    )]
    Vanished { place: String },
    #[error("shard {shard}: {reason}")]
    Rows { shard: u64, reason: String },
    #[error("{name}: {source}")]
    Parquet { name: String, source: ParquetError },
    #[error("{name}: {source}")]
    Arrow { name: String, source: ArrowError },
}

/// Whole megabytes, rounded up: no room is not "0 MB".
fn mb(bytes: u64) -> u64 {
    bytes.div_ceil(1_000_000)
}
