//! Scenes and shards as they are done -> counts, times and rates of a build: for whoever watches, and for `report.json`.
//!
//! Times are wall-clock seconds, those of stages the sum over all threads. None of it is part of a corpus's identity.

use std::time::{Duration, Instant};

use serde_json::json;

use crate::corpus::Build;
use crate::episode::{SceneOutput, StageTimes};

/// What a build has done so far.
#[derive(Clone, Debug)]
pub struct Tally {
    started: Instant,
    ended: Option<Instant>,
    /// Scenes to build.
    pub scenes: u64,
    /// Scenes that are built, those that failed included.
    pub done: u64,
    pub failed: u64,
    /// Rows of `cells`.
    pub rows: u64,
    /// Time of each stage, and beams cast.
    pub times: StageTimes,
    /// Time that threads spent on shards beside their scenes.
    pub writing: Duration,
}

impl Tally {
    pub(super) fn new(scenes: u64) -> Tally {
        let (started, times) = (Instant::now(), StageTimes::new());
        Tally { started, ended: None, scenes, done: 0, failed: 0, rows: 0, times, writing: Duration::ZERO }
    }

    pub(super) fn scene(&mut self, output: &SceneOutput, times: &StageTimes) {
        self.done += 1;
        self.failed += u64::from(output.error.is_some());
        self.rows += output.scans.iter().map(|scan| scan.cells.rows.len() as u64).sum::<u64>();
        self.times.add(times);
    }

    pub(super) fn end(&mut self) {
        self.ended = Some(Instant::now());
    }

    /// Since the first scene was begun, until the last shard was handed over.
    pub(crate) fn elapsed(&self) -> Duration {
        self.ended.unwrap_or_else(Instant::now) - self.started
    }

    /// A count since the start as so many a second.
    pub(crate) fn per_second(&self, count: u64) -> f64 {
        count as f64 / self.elapsed().as_secs_f64().max(1e-9)
    }

    /// At the pace so far.
    pub(crate) fn remaining(&self) -> Duration {
        let left = (self.scenes - self.done) as f64 / self.done.max(1) as f64;
        self.elapsed().mul_f64(left)
    }

    /// Share of the threads' time that was spent on shards beside their scenes.
    pub(crate) fn writing_share(&self, threads: usize) -> f64 {
        self.writing.as_secs_f64() / (self.elapsed().as_secs_f64().max(1e-9) * threads as f64)
    }

    /// What `report.json` holds.
    pub(super) fn report(&self, threads: usize) -> serde_json::Value {
        let spent = self.times.spent().chain([("writing", self.writing)]);
        let stages: serde_json::Map<_, _> =
            spent.map(|(name, time)| (name.to_string(), time.as_secs_f64().into())).collect();
        json!({
            "wall_s": self.elapsed().as_secs_f64(),
            "threads": threads,
            "build": Build::of_this_binary(),
            "scenes": self.done,
            "failed_scenes": self.failed,
            "rays": self.times.rays(),
            "cell_rows": self.rows,
            "scenes_per_s": self.per_second(self.done),
            "rays_per_s": self.per_second(self.times.rays()),
            "cell_rows_per_s": self.per_second(self.rows),
            "stage_thread_seconds": stages,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_failed_scenes_are_done_and_a_tally_that_ended_stands_still() {
        let mut tally = Tally::new(4);
        tally.scene(&SceneOutput::default(), &StageTimes::new());
        tally.scene(&SceneOutput { error: Some("no path".into()), ..SceneOutput::default() }, &StageTimes::new());
        tally.end();
        let ended = tally.elapsed();
        assert_eq!((tally.done, tally.failed, tally.remaining(), tally.elapsed()), (2, 1, ended, ended));
    }

    #[test]
    fn law_the_share_of_writing_is_one_of_all_threads_time() {
        let mut tally = Tally::new(1);
        tally.end();
        tally.writing = tally.elapsed() * 3;
        let share = tally.writing_share(4) * tally.elapsed().as_secs_f64().max(1e-9);
        assert!((share - 0.75 * tally.elapsed().as_secs_f64()).abs() < 1e-12, "{share}");
    }
}
