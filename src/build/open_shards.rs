//! Scenes that come back, in order -> shards in the making: whose rows may be appended next, and which shard is whole.
//!
//! A shard's rows are appended by one thread at a time, whichever is free; what it holds of the shard meanwhile is not here.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::episode::SceneOutput;

/// The shards of which scenes are there, by number; `W`: a shard in the making.
pub(super) struct OpenShards<W> {
    shards: BTreeMap<u64, OpenShard<W>>,
}

struct OpenShard<W> {
    /// The next of its scenes, in order.
    ready: Vec<SceneOutput>,
    /// Not before its first scene, and not while a thread works on it.
    open: Option<W>,
    busy: bool,
    /// Its scenes whose rows are appended.
    appended: usize,
    /// Time that threads have spent on it.
    took: Duration,
}

/// ReadyScenes for one thread to lay.
pub(super) struct ReadyScenes<W> {
    pub shard: u64,
    /// `None`: the shard is yet to be opened.
    pub open: Option<W>,
    pub scenes: Vec<SceneOutput>,
}

impl<W> OpenShards<W> {
    pub(super) fn new() -> OpenShards<W> {
        OpenShards { shards: BTreeMap::new() }
    }

    /// The next scene of a shard has come back.
    pub(super) fn add(&mut self, shard: u64, scene: SceneOutput) {
        let empty = || OpenShard { ready: Vec::new(), open: None, busy: false, appended: 0, took: Duration::ZERO };
        self.shards.entry(shard).or_insert_with(empty).ready.push(scene);
    }

    /// ReadyScenes that no thread is laying, of the first such shard.
    pub(super) fn take(&mut self) -> Option<ReadyScenes<W>> {
        let (&shard, shard_state) =
            self.shards.iter_mut().find(|(_, shard_state)| !shard_state.busy && !shard_state.ready.is_empty())?;
        shard_state.busy = true;
        Some(ReadyScenes { shard, open: shard_state.open.take(), scenes: std::mem::take(&mut shard_state.ready) })
    }

    /// A shard, so many more of its scenes appended; given back, with the time spent on it, where it has all of them.
    pub(super) fn appended(
        &mut self,
        (shard, open): (u64, W),
        scenes: usize,
        took: Duration,
        per_shard: usize,
    ) -> Option<(W, Duration)> {
        let shard_state = self.shards.get_mut(&shard).expect("a shard whose rows were taken");
        shard_state.appended += scenes;
        shard_state.took += took;
        shard_state.busy = false;
        if shard_state.appended < per_shard {
            shard_state.open = Some(open);
            return None;
        }
        self.shards.remove(&shard).map(|shard_state| (open, shard_state.took))
    }
}
