//! What can go wrong between rows and files; each message names the place, the rule and the cure.

use crate::shell;
use arrow_schema::ArrowError;
use parquet::errors::ParquetError;

/// Why a corpus could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CorpusError {
    #[error("{}: {source}", within(place, name))]
    Io { place: String, name: String, source: std::io::Error },
    #[error("{place} holds {name}, which {why}. {}; {cure}", super::owner::RULE)]
    Foreign { place: String, name: String, why: &'static str, cure: &'static str },
    #[error("{place}: {reason}; {cure}")]
    Refused { place: String, reason: String, cure: String },
    #[error(
        "{place}: the server is not known to be the store: {reason}; mend its certificate, or add the authority that signed it to this \
             machine's (SSL_CERT_FILE names a file of such); nothing was sent"
    )]
    Untrusted { place: String, reason: String },
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
    #[error("{place}/{name}: {reason}; {cure}")]
    BadManifest { place: String, name: String, reason: String, cure: String },
    #[error("{place}/{name}: {reason}; {cure}")]
    NotWhole { place: String, name: String, reason: String, cure: String },
    #[error("{place}/{name} is {what}, not a file; move it away, or put the file itself in its place")]
    NotAFile { place: String, name: String, what: &'static str },
    #[error(
        "{place}/{name} is larger than {most_bytes} bytes, the most that is read of {kind}: it is none, or damaged"
    )]
    TooLarge { place: String, name: String, kind: &'static str, most_bytes: u64 },
    #[error(
        "{place}/{name}: written in format {there}, this program reads formats 1 to {}; use the marsyard that wrote it, or build the \
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
        "{place} holds shard {shard}, but the plan ends before shard {shards}: a corpus only grows; raise `scenes`, choose another \
             place, or add --discard-beyond to remove the shards behind the plan's end"
    )]
    BeyondPlan { place: String, shard: u64, shards: u64 },
    #[error(
        "{place}: {missing} of {shards} shards are missing or damaged ({ranges}); build them with `marsyard generate {}`, on \
             many machines with --shards, then finalize again",
        shell::word(place)
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
    #[error(
        "{place}: another `marsyard generate` has taken it over for {theirs}, this one builds {ours}: the shards that belong to both are \
             kept; let the other end, or stop it and start this one again"
    )]
    Overtaken { place: String, ours: String, theirs: String },
    #[error("shard {shard}: {reason}")]
    Rows { shard: u64, reason: String },
    #[error("{name}: {source}")]
    Parquet { name: String, source: ParquetError },
    #[error("{name}: {source}")]
    Arrow { name: String, source: ArrowError },
}

/// A file within a place, either of which may be without a name.
fn within(place: &str, name: &str) -> String {
    let between = if place.is_empty() || name.is_empty() || place.ends_with('/') { "" } else { "/" };
    format!("{place}{between}{name}")
}

impl CorpusError {
    /// What a file system says of a file.
    pub(crate) fn of_path(path: &std::path::Path, source: std::io::Error) -> CorpusError {
        let place_name = path.parent().zip(path.file_name());
        // `.` and `/` are in no other folder.
        let (place, name) = place_name.map_or((path.display().to_string(), String::new()), |(above, name)| {
            (above.display().to_string(), name.to_string_lossy().into_owned())
        });
        CorpusError::Io { place, name, source }
    }

    /// A word for machines: what kind of fault it is.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            CorpusError::Io { .. } => "io",
            CorpusError::Refused { .. } => "refused",
            CorpusError::Untrusted { .. } => "untrusted",
            CorpusError::Unreachable { .. } => "unreachable",
            CorpusError::NoRoom { .. } => "no_room",
            CorpusError::Vanished { .. } => "vanished",
            CorpusError::Differs { .. } => "differs",
            CorpusError::OtherPlan { .. } | CorpusError::ForeignPlan { .. } | CorpusError::BeyondPlan { .. } => {
                "other_corpus"
            }
            CorpusError::Gaps { .. } => "gaps",
            CorpusError::Foreign { .. } => "foreign",
            CorpusError::Overtaken { .. } => "overtaken",
            CorpusError::OtherFormat { .. } => "other_format",
            CorpusError::NotAFile { .. } => "not_a_file",
            CorpusError::TooLarge { .. } => "too_large",
            CorpusError::BadName { .. }
            | CorpusError::BadReceipt { .. }
            | CorpusError::BadManifest { .. }
            | CorpusError::NotWhole { .. }
            | CorpusError::Rows { .. }
            | CorpusError::Parquet { .. }
            | CorpusError::Arrow { .. } => "damaged",
        }
    }

    /// The place that it speaks of; empty where it names none.
    pub(crate) fn place(&self) -> &str {
        match self {
            CorpusError::Io { place, .. }
            | CorpusError::Refused { place, .. }
            | CorpusError::Untrusted { place, .. }
            | CorpusError::Unreachable { place, .. }
            | CorpusError::NoRoom { place, .. }
            | CorpusError::Vanished { place }
            | CorpusError::Differs { place, .. }
            | CorpusError::BadReceipt { place, .. }
            | CorpusError::BadManifest { place, .. }
            | CorpusError::OtherFormat { place, .. }
            | CorpusError::OtherPlan { place, .. }
            | CorpusError::ForeignPlan { place }
            | CorpusError::BeyondPlan { place, .. }
            | CorpusError::Gaps { place, .. }
            | CorpusError::Foreign { place, .. }
            | CorpusError::NotWhole { place, .. }
            | CorpusError::NotAFile { place, .. }
            | CorpusError::TooLarge { place, .. }
            | CorpusError::Overtaken { place, .. } => place,
            CorpusError::BadName { .. }
            | CorpusError::Rows { .. }
            | CorpusError::Parquet { .. }
            | CorpusError::Arrow { .. } => "",
        }
    }
}

/// Whole megabytes, rounded up: no room is not "0 MB".
fn mb(bytes: u64) -> u64 {
    bytes.div_ceil(1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_path_is_told_as_it_was_named() {
        for path in ["run", "sub/run", "/run", "./run", ".", "/", ".."] {
            let told = CorpusError::of_path(path.as_ref(), std::io::ErrorKind::NotFound.into()).to_string();
            assert!(told.starts_with(&format!("{path}: ")), "{told}");
        }
    }
}
