//! What the caller of `run_scene` wants to know of its stages: times, hashes, or nothing.

use std::time::{Duration, Instant};

use crate::random::Stage;

/// Told of each stage's end. `hash` writes the stage's f64 results; it is called by those who want it.
pub trait StageObserver {
    /// A stage begins now.
    fn begin(&mut self);
    /// What ran since the last call belongs to `stage`.
    fn end(&mut self, stage: Stage, hash: impl FnOnce(&mut blake3::Hasher));
    /// So many beams were cast.
    fn count_rays(&mut self, _rays: u64) {}
}

/// Wants nothing.
pub struct Unobserved;

impl StageObserver for Unobserved {
    fn begin(&mut self) {}
    fn end(&mut self, _: Stage, _: impl FnOnce(&mut blake3::Hasher)) {}
}

/// Time spent per stage, and beams cast.
#[derive(Clone, Copy, Debug)]
pub struct StageTimes {
    since: Instant,
    spent: [Duration; StageTimes::STAGES.len()],
    rays: u64,
}

impl StageTimes {
    /// The stages that are timed, in the order of the flow.
    pub const STAGES: [(Stage, &'static str); 5] = [
        (Stage::Scene, "scene"),
        (Stage::Drive, "drive"),
        (Stage::Sweep, "sweep"),
        (Stage::Slam, "slam"),
        (Stage::Cells, "cells"),
    ];

    pub fn new() -> StageTimes {
        StageTimes { since: Instant::now(), spent: [Duration::ZERO; StageTimes::STAGES.len()], rays: 0 }
    }

    /// Time per stage, in the order of the flow.
    pub fn spent(&self) -> impl Iterator<Item = (&'static str, Duration)> + '_ {
        StageTimes::STAGES.iter().map(|(_, name)| *name).zip(self.spent)
    }

    /// Beams cast.
    pub fn rays(&self) -> u64 {
        self.rays
    }

    /// Adds another thread's times.
    pub fn add(&mut self, other: &StageTimes) {
        for (sum, more) in self.spent.iter_mut().zip(other.spent) {
            *sum += more;
        }
        self.rays += other.rays;
    }
}

impl Default for StageTimes {
    fn default() -> Self {
        StageTimes::new()
    }
}

impl StageObserver for StageTimes {
    fn begin(&mut self) {
        self.since = Instant::now();
    }

    fn end(&mut self, stage: Stage, _: impl FnOnce(&mut blake3::Hasher)) {
        let now = Instant::now();
        if let Some(k) = StageTimes::STAGES.iter().position(|(s, _)| *s == stage) {
            self.spent[k] += now - self.since;
        }
        self.since = now;
    }

    fn count_rays(&mut self, rays: u64) {
        self.rays += rays;
    }
}

/// One hash a stage, over its f64 results in the order they came: what f32 columns would hide.
#[derive(Clone, Debug)]
pub struct StageHashes {
    hashers: Vec<(Stage, blake3::Hasher)>,
}

impl StageHashes {
    pub fn new() -> StageHashes {
        StageHashes { hashers: StageTimes::STAGES.iter().map(|(s, _)| (*s, blake3::Hasher::new())).collect() }
    }

    /// (stage, hash as hexadecimal), in the order of the flow.
    pub fn finish(&self) -> Vec<(&'static str, String)> {
        let names = StageTimes::STAGES.iter().map(|(_, name)| *name);
        names.zip(self.hashers.iter().map(|(_, h)| h.finalize().to_hex()[..16].to_string())).collect()
    }
}

impl Default for StageHashes {
    fn default() -> Self {
        StageHashes::new()
    }
}

impl StageObserver for StageHashes {
    fn begin(&mut self) {}

    fn end(&mut self, stage: Stage, hash: impl FnOnce(&mut blake3::Hasher)) {
        if let Some((_, hasher)) = self.hashers.iter_mut().find(|(s, _)| *s == stage) {
            hash(hasher);
        }
    }
}

/// What a build keeps of each scene: times, and hashes where they are asked for.
#[derive(Clone, Debug, Default)]
pub struct StageRecord {
    pub times: StageTimes,
    pub hashes: Option<StageHashes>,
}

impl StageObserver for StageRecord {
    fn begin(&mut self) {
        self.times.begin();
    }

    fn end(&mut self, stage: Stage, hash: impl FnOnce(&mut blake3::Hasher)) {
        self.times.end(stage, |_| ());
        if let Some(hashes) = &mut self.hashes {
            hashes.end(stage, hash);
            // Hashing is nobody's stage.
            self.times.begin();
        }
    }

    fn count_rays(&mut self, rays: u64) {
        self.times.count_rays(rays);
    }
}
