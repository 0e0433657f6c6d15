//! A place and its plan -> which shards are there, whole, and which are missing or damaged.
//!
//! In: the receipts and the sizes of the files that they name, and no contents. Out: a [`Status`], and on the way the receipt of each
//! shard that is done.

use std::collections::BTreeSet;
use std::fmt;

use rayon::prelude::*;

use super::receipt::Receipt;
use super::{Build, CorpusError, CorpusSpec, Store, ranges};

pub(super) enum ShardState {
    /// The receipt, and the bytes that it was read from.
    Done(Box<Receipt>, Vec<u8>),
    Missing,
    Damaged(String),
    OtherFormat(CorpusError),
}

pub(super) fn shard_state(store: &dyn Store, spec: &CorpusSpec, shard: u64) -> Result<ShardState, CorpusError> {
    let (receipt, bytes) = match Receipt::read_of(store, spec, shard) {
        Ok(read) => read,
        Err(error @ (CorpusError::BadReceipt { .. } | CorpusError::NotAFile { .. } | CorpusError::TooLarge { .. })) => {
            return Ok(ShardState::Damaged(error.to_string()));
        }
        Err(error @ CorpusError::OtherFormat { .. }) => return Ok(ShardState::OtherFormat(error)),
        Err(CorpusError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
            return Ok(ShardState::Missing);
        }
        Err(error) => return Err(error),
    };
    for table in &spec.tables {
        let path = table.path(shard);
        let size = match store.size(&path) {
            Err(error @ CorpusError::NotAFile { .. }) => return Ok(ShardState::Damaged(error.to_string())),
            other => other?,
        };
        let reason = match (receipt.tables.get(table), size) {
            (_, None) => format!("{path} is missing"),
            (Some(facts), Some(size)) if facts.bytes != size => {
                format!("{path} has {size} bytes, its receipt says {}", facts.bytes)
            }
            _ => continue,
        };
        return Ok(ShardState::Damaged(reason));
    }
    Ok(ShardState::Done(Box::new(receipt), bytes))
}

/// Which shards of the plan are there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    pub place: String,
    pub shards: u64,
    pub done: Vec<u64>,
    pub missing: Vec<u64>,
    /// There, but not as the receipt says; and why.
    pub damaged: Vec<(u64, String)>,
    /// There, in a format that this program does not read: not damaged, so nothing to build anew; and why.
    pub other_format: Vec<(u64, String)>,
    /// Done, with scenes that failed.
    pub with_failed_scenes: Vec<u64>,
    pub failed_scenes: u64,
    /// Bytes of the shards that are done.
    pub bytes: u64,
    /// Programs that wrote the shards that are done, with how many.
    pub builds: Vec<(Build, u64)>,
}

impl Status {
    /// Shards to be built, ascending.
    pub(crate) fn to_build(&self) -> Vec<u64> {
        let all: BTreeSet<u64> =
            self.missing.iter().copied().chain(self.damaged.iter().map(|(shard, _)| *shard)).collect();
        all.into_iter().collect()
    }

    /// Shards without which there is no whole corpus, ascending.
    pub(super) fn gaps(&self) -> Vec<u64> {
        let mut gaps = self.to_build();
        gaps.extend(self.other_format.iter().map(|(shard, _)| *shard));
        gaps.sort_unstable();
        gaps
    }

    fn add_done(&mut self, receipt: &Receipt) {
        self.done.push(receipt.shard);
        if !receipt.failed.is_empty() {
            self.with_failed_scenes.push(receipt.shard);
            self.failed_scenes += receipt.failed.len() as u64;
        }
        self.bytes += receipt.tables.values().map(|file| file.bytes).sum::<u64>();
        match self.builds.iter_mut().find(|(build, _)| *build == receipt.build) {
            Some((_, shards)) => *shards += 1,
            None => self.builds.push((receipt.build.clone(), 1)),
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = |shards: &[(u64, String)]| shards.iter().map(|(shard, _)| *shard).collect::<Vec<_>>();
        let (damaged, other) = (numbers(&self.damaged), numbers(&self.other_format));
        writeln!(f, "{}: {} shards", self.place, self.shards)?;
        for (word, shards) in [("done", &self.done), ("missing", &self.missing), ("damaged", &damaged)] {
            writeln!(f, "  {word:<8} {:>7}  {}", shards.len(), ranges::to_text(shards))?;
        }
        if !other.is_empty() {
            writeln!(f, "  other format {:>3}  {}", other.len(), ranges::to_text(&other))?;
        }
        let failed = (self.failed_scenes, ranges::to_text(&self.with_failed_scenes));
        writeln!(f, "  failed scenes {:>2}  in shards {}", failed.0, failed.1)?;
        self.damaged.iter().chain(&self.other_format).try_for_each(|(shard, why)| writeln!(f, "  shard {shard}: {why}"))
    }
}

/// Looks at every shard of the plan: receipts and sizes, no contents (`verify` reads those).
pub(crate) fn status(store: &dyn Store, spec: &CorpusSpec) -> Result<Status, CorpusError> {
    status_of(store, spec, &(0..spec.shards()).collect::<Vec<_>>())
}

/// Looks at some shards of the plan: a machine that builds a part need not look at all.
pub(crate) fn status_of(store: &dyn Store, spec: &CorpusSpec, shards: &[u64]) -> Result<Status, CorpusError> {
    survey(store, spec, shards, |_, _| ())
}

/// Receipts that are read at a time, on all threads.
const BLOCK: usize = 1024;

/// Looks at these shards, and shows the receipts of those that are done, in their order; few are in memory at a time.
pub(super) fn survey(
    store: &dyn Store,
    spec: &CorpusSpec,
    shards: &[u64],
    mut done: impl FnMut(&Receipt, &[u8]),
) -> Result<Status, CorpusError> {
    let mut status = Status { place: store.place(), shards: spec.shards(), ..Status::default() };
    for block in shards.chunks(BLOCK) {
        let states: Vec<_> = block.par_iter().map(|&shard| shard_state(store, spec, shard)).collect();
        for (&shard, state) in block.iter().zip(states) {
            match state? {
                ShardState::Missing => status.missing.push(shard),
                ShardState::Damaged(reason) => status.damaged.push((shard, reason)),
                ShardState::OtherFormat(error) => status.other_format.push((shard, error.to_string())),
                ShardState::Done(receipt, bytes) => {
                    status.add_done(&receipt);
                    done(&receipt, &bytes);
                }
            }
        }
    }
    Ok(status)
}
