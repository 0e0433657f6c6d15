//! Shards in the making: whose scenes are made next, whose rows are appended next, which shard is whole.
//!
//! Scenes of the oldest open shard are made first. Its rows are appended in order, by one thread at a time; where some of its scenes wait
//! for that, because one before them is slow or because writing takes long, the next shard is opened beside it, so that several threads
//! write. How many may be open, and how many scenes may wait for their rows in all, is [`Limits`]' to say.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::episode::SceneOutput;
use crate::parallel;

/// How far a build may run ahead of the rows that are written; what it needs of memory follows from this.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Shards that are open at once: every thread may have one to write, and half as many others have rows ready for the next thread.
    pub open: usize,
    /// Scenes of one shard that are made and wait, before scenes of another are begun.
    pub waiting: usize,
    /// Scenes that threads hold.
    pub held: usize,
}

impl Limits {
    pub(super) fn of_threads(threads: usize) -> Limits {
        Limits { open: (threads + threads / 2).max(2), waiting: threads / 4 + 2, held: parallel::most_out(threads) }
    }

    /// Scenes that are begun and whose rows are not written, where so many shards are open: as many wait as a thread is writing.
    pub(super) fn unwritten(&self, open: usize) -> usize {
        self.held + 2 * self.waiting * open
    }
}

/// `W`: a shard in the making.
pub(super) struct OpenShards<'a, W> {
    /// Those not opened yet, ascending.
    unopened: &'a [u64],
    per_shard: usize,
    limits: Limits,
    /// Scenes that are begun and not appended.
    unwritten: usize,
    /// By number.
    open: BTreeMap<u64, OpenShard<W>>,
}

struct OpenShard<W> {
    /// Its scenes that a thread was given.
    begun: usize,
    /// Scenes that are made, by number, and not appended.
    made: BTreeMap<u64, SceneOutput>,
    /// The writer, between two appends; none before the first.
    writer: Option<W>,
    is_busy: bool,
    appended: usize,
    /// Time that threads have spent on it.
    took: Duration,
}

/// The next scenes of a shard, in order, for one thread to append.
pub(super) struct ReadyScenes<W> {
    pub shard: u64,
    /// `None`: the shard is yet to be opened.
    pub writer: Option<W>,
    pub scenes: Vec<SceneOutput>,
}

impl<'a, W> OpenShards<'a, W> {
    pub(super) fn new(shards: &'a [u64], per_shard: usize, threads: usize) -> Self {
        let limits = Limits::of_threads(threads);
        OpenShards { unopened: shards, per_shard, limits, unwritten: 0, open: BTreeMap::new() }
    }

    /// A scene to make: of the oldest shard that may have one begun, or of one that is opened for it.
    pub(super) fn next_scene(&mut self) -> Option<u64> {
        let (per_shard, most_waiting) = (self.per_shard, self.limits.waiting);
        let may_begin = |shard: &OpenShard<W>| shard.begun < per_shard && shard.made.len() < most_waiting;
        let is_full = self.unwritten >= self.limits.unwritten(self.open.len());
        if is_full || !self.open.values().any(may_begin) {
            let (&next, left) = self.unopened.split_first().filter(|_| self.open.len() < self.limits.open)?;
            self.unopened = left;
            self.open.insert(next, OpenShard::new());
        }
        let (&number, shard) = self.open.iter_mut().find(|(_, shard)| may_begin(shard))?;
        shard.begun += 1;
        self.unwritten += 1;
        Some(number * per_shard as u64 + shard.begun as u64 - 1)
    }

    /// A scene is made.
    pub(super) fn add(&mut self, scene: SceneOutput) {
        let number = scene.scene_id / self.per_shard as u64;
        self.open.get_mut(&number).expect("a shard whose scene was begun").made.insert(scene.scene_id, scene);
    }

    /// Scenes that no thread appends yet, of the oldest shard that has the next of its own.
    pub(super) fn next_append(&mut self) -> Option<ReadyScenes<W>> {
        let per_shard = self.per_shard as u64;
        let (&number, shard) = self.open.iter_mut().find(|(number, shard)| {
            let next = *number * per_shard + shard.appended as u64;
            !shard.is_busy && shard.made.first_key_value().is_some_and(|(&scene, _)| scene == next)
        })?;
        shard.is_busy = true;
        let mut scenes = Vec::new();
        let first = number * per_shard + shard.appended as u64;
        while let Some(scene) = shard.made.remove(&(first + scenes.len() as u64)) {
            scenes.push(scene);
        }
        Some(ReadyScenes { shard: number, writer: shard.writer.take(), scenes })
    }

    /// So many more scenes of a shard are appended; the writer comes back with the time spent on it where it has them all.
    pub(super) fn appended(&mut self, number: u64, writer: W, scenes: usize, took: Duration) -> Option<(W, Duration)> {
        let shard = self.open.get_mut(&number).expect("a shard whose scenes were appended");
        shard.appended += scenes;
        self.unwritten -= scenes;
        shard.took += took;
        shard.is_busy = false;
        if shard.appended < self.per_shard {
            shard.writer = Some(writer);
            return None;
        }
        self.open.remove(&number).map(|shard| (writer, shard.took))
    }
}

impl<W> OpenShard<W> {
    fn new() -> Self {
        let (made, took) = (BTreeMap::new(), Duration::ZERO);
        OpenShard { begun: 0, made, writer: None, is_busy: false, appended: 0, took }
    }
}
