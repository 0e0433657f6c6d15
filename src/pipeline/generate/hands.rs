//! Scenes that come back, in order -> shards in the making: whose rows may be laid next, and which shard is whole.
//!
//! A shard's rows are laid by one thread at a time, whichever is free; what it holds of the shard meanwhile is not here.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::corpus::SceneOutput;

/// The shards of which scenes are there, by number; `W`: a shard in the making.
pub(super) struct Hands<W> {
    shards: BTreeMap<u64, Hand<W>>,
}

struct Hand<W> {
    /// The next of its scenes, in order.
    ready: Vec<SceneOutput>,
    /// Not before its first scene, and not while a thread works on it.
    open: Option<W>,
    busy: bool,
    /// Its scenes whose rows are laid.
    laid: usize,
    /// Time that threads have spent on it.
    took: Duration,
}

/// Rows for one thread to lay.
pub(super) struct Rows<W> {
    pub shard: u64,
    /// `None`: the shard is yet to be opened.
    pub open: Option<W>,
    pub scenes: Vec<SceneOutput>,
}

impl<W> Hands<W> {
    pub(super) fn new() -> Hands<W> {
        Hands { shards: BTreeMap::new() }
    }

    /// The next scene of a shard has come back.
    pub(super) fn add(&mut self, shard: u64, scene: SceneOutput) {
        let empty = || Hand { ready: Vec::new(), open: None, busy: false, laid: 0, took: Duration::ZERO };
        self.shards.entry(shard).or_insert_with(empty).ready.push(scene);
    }

    /// Rows that no thread is laying, of the first such shard.
    pub(super) fn take(&mut self) -> Option<Rows<W>> {
        let (&shard, hand) = self.shards.iter_mut().find(|(_, hand)| !hand.busy && !hand.ready.is_empty())?;
        hand.busy = true;
        Some(Rows { shard, open: hand.open.take(), scenes: std::mem::take(&mut hand.ready) })
    }

    /// A shard, so many more of its scenes laid; given back, with the time spent on it, where it has all of them.
    pub(super) fn laid(
        &mut self,
        (shard, open): (u64, W),
        scenes: usize,
        took: Duration,
        per_shard: usize,
    ) -> Option<(W, Duration)> {
        let hand = self.shards.get_mut(&shard).expect("a shard whose rows were taken");
        hand.laid += scenes;
        hand.took += took;
        hand.busy = false;
        if hand.laid < per_shard {
            hand.open = Some(open);
            return None;
        }
        self.shards.remove(&shard).map(|hand| (open, hand.took))
    }
}
