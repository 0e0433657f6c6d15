//! Shard numbers -> those shards in their place, with progress, signals, free space and a report.
//!
//! What `generate` and `verify --repair` have in common. A signal, a disk that fills up or a folder that goes away may
//! end the build; shards are there whole or not at all, those that the scenes in hand make whole too, and the same command goes on.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use serde_json::json;

use super::place::corpus_failure;
use super::plan::estimate_failure;
use super::progress::Progress;
use super::signals::stop_on_signals;
use super::{Failure, LogFormat};
use crate::build::{self, BuildError, Event, Job, Outcome};
use crate::corpus::{self, CorpusError, CorpusSpec, FinishedShard, FreeSpace, Place, Status, Store, owner};
use crate::episode::SceneOutput;
use crate::episode::{Prepared, StageRecord};
use crate::measure::estimate;

/// A plan, its place, and how to build.
pub(super) struct Builder<'a> {
    pub(super) prepared: Prepared,
    pub(super) spec: &'a CorpusSpec,
    pub(super) store: &'a dyn Store,
    pub(super) place: &'a Place<'a>,
    pub(super) threads: usize,
    /// To be left free on the disk.
    pub(super) keep_free_bytes: u64,
    /// Hashes of the stages' results go here.
    pub(super) stage_hashes: Option<&'a Path>,
    /// Write report.json: nobody else builds other shards.
    pub(super) report: bool,
    pub(super) log: LogFormat,
}

/// What a build has done.
pub(super) struct Built {
    pub(super) progress: Progress,
    /// Time that threads spent on shards, not on scenes.
    pub(super) writing: Duration,
}

impl Builder<'_> {
    /// Builds these shards, ascending; `status` is that of the place. `replay` gives the command that replays a scene.
    pub(super) fn build(
        &self,
        status: &Status,
        shards: &[u64],
        replay: impl Fn(u64) -> String,
    ) -> Result<Built, Failure> {
        let stop = stop_on_signals()?;
        if let Some((_, reason)) = status.other_format.first() {
            return Err(Failure::failed(reason));
        }
        if !shards.is_empty() {
            self.store.probe().map_err(corpus_failure)?;
            self.tell_other_programs(status);
        }
        let room = FreeSpace::new(self.store, self.keep_free_bytes);
        if let Some(bytes) = self.expected_bytes(status, shards, &stop)? {
            let what = || format!("a build of {} shards", shards.len());
            room.check(bytes, what).map_err(corpus_failure)?;
        }
        for (shard, reason) in status.damaged.iter().filter(|(shard, _)| shards.binary_search(shard).is_ok()) {
            tracing::warn!("shard {shard} is damaged and is built anew: {reason}");
            self.place.discard(*shard).map_err(corpus_failure)?;
        }
        let mut hashes = self.stage_hashes.map(HashFile::open).transpose()?;
        let job = Job { shards, threads: self.threads, stop: &stop, hashes: hashes.is_some() };
        let mut progress = Progress::new(shards.len() as u64 * u64::from(self.spec.scenes_per_shard), self.log);
        let mut writing = Duration::ZERO;
        let mut lost_hashes = None;
        let outcome = build::build_shards(
            &self.prepared,
            self.spec,
            job,
            |event| match event {
                Event::Scene { output, record } => {
                    progress.scene(output, &record.times, || replay(output.scene_id));
                    if let Some(file) = &mut hashes {
                        lost_hashes = lost_hashes.take().or(file.add(output, record).err());
                    }
                }
                Event::Shard { shard, written, took } => {
                    writing += took;
                    progress.shard(shard, *written);
                }
            },
            |finished| self.put(&room, &finished),
        );
        progress.finish();
        let outcome = build_outcome(outcome, &replay)?;
        lost_hashes.map_or(Ok(()), Err)?;
        self.place.still_there().map_err(corpus_failure)?;
        if self.report {
            let report = report(&progress, writing, self.threads);
            self.store.replace(owner::REPORT, format!("{report:#}\n").as_bytes()).map_err(corpus_failure)?;
        }
        match outcome {
            Outcome::Done => Ok(Built { progress, writing }),
            Outcome::Interrupted => Err(Failure::new(Failure::TRY_AGAIN, interrupted())),
        }
    }

    fn put(&self, room: &FreeSpace, finished: &FinishedShard) -> Result<u64, CorpusError> {
        let bytes = finished.files.iter().map(|(_, bytes)| bytes.len() as u64).sum();
        room.check(bytes, || format!("shard {}", finished.receipt.shard))?;
        self.place.commit(finished)?;
        Ok(bytes)
    }

    /// Bytes of these shards: as those that are there, or as a few scenes say; `None` for a build too short to be worth it.
    fn expected_bytes(&self, status: &Status, shards: &[u64], stop: &AtomicBool) -> Result<Option<u64>, Failure> {
        let per_shard = if let Some(done) = std::num::NonZero::new(status.done.len() as u64) {
            status.bytes / done
        } else if shards.len() as u64 * u64::from(self.spec.scenes_per_shard) >= SAMPLE_FROM_SCENES {
            self.sampled_bytes(stop)?
        } else {
            return Ok(None);
        };
        Ok(Some(per_shard.saturating_mul(shards.len() as u64)))
    }

    /// Bytes of a shard, by a few scenes.
    fn sampled_bytes(&self, stop: &AtomicBool) -> Result<u64, Failure> {
        let plan = &self.prepared.plan;
        let options = estimate::Options {
            threads: 1,
            scenes: Some(SAMPLE),
            limit: Duration::from_secs(10),
            parts_limit: Duration::ZERO,
            place: None,
            stop,
        };
        let estimate = estimate::estimate(plan, &options).map_err(estimate_failure)?;
        Ok((estimate.bytes.value / plan.shards() as f64) as u64)
    }

    /// Says so where another program wrote shards that are there: equal values are promised for equal sources by one compiler.
    fn tell_other_programs(&self, status: &Status) {
        let here = corpus::Build::of_this_binary();
        let others: Vec<_> = status.builds.iter().filter(|(build, _)| !here.is_like(build)).collect();
        if let Some((there, _)) = others.first() {
            let shards: u64 = others.iter().map(|(_, shards)| shards).sum();
            let place = self.store.place();
            tracing::warn!(
                "{shards} of the shards there were written by another marsyard ({there}), this is {here}; equal values are \
                 promised for equal sources by one compiler: `marsyard verify {place} --rebuild 3`, once it is whole, says whether this one \
                 builds them alike"
            );
        }
    }
}

/// From so many scenes on, a build is worth a few scenes to see whether it will fit.
const SAMPLE_FROM_SCENES: u64 = 200;
/// Scenes of that look.
const SAMPLE: u64 = 4;

/// Whether a file holds such lines: what is appended to another's file is lost in it.
pub(super) fn is_stage_hashes(bytes: &[u8]) -> bool {
    bytes.starts_with(b"{\"scene\":")
}

/// One line of JSON a scene.
struct HashFile<'a> {
    path: &'a Path,
    file: File,
}

impl HashFile<'_> {
    fn open(path: &Path) -> Result<HashFile<'_>, Failure> {
        let opened = File::options().create(true).append(true).open(path);
        opened.map(|file| HashFile { path, file }).map_err(|error| HashFile::failed(path, &error))
    }

    fn add(&mut self, output: &SceneOutput, record: &StageRecord) -> Result<(), Failure> {
        let stages: serde_json::Map<_, _> = record
            .hashes
            .iter()
            .flat_map(|hashes| hashes.finish())
            .map(|(stage, hash)| (stage.into(), hash.into()))
            .collect();
        let line = json!({"scene": output.scene_id, "stages": stages, "error": output.error});
        // One write a line, so that the lines of two builds do not mix.
        self.file.write_all(format!("{line}\n").as_bytes()).map_err(|error| HashFile::failed(self.path, &error))
    }

    fn failed(path: &Path, error: &std::io::Error) -> Failure {
        Failure::failed(format!("--stage-hashes {}: {error}; choose a file that can be written", path.display()))
    }
}

/// How a build ended, or why it failed.
pub(super) fn build_outcome(
    built: Result<Outcome, BuildError<CorpusError>>,
    replay: impl Fn(u64) -> String,
) -> Result<Outcome, Failure> {
    built.map_err(|error| match error {
        BuildError::Write(error) => corpus_failure(error),
        BuildError::Unsteady { scene, .. } => {
            let help = format!("replay: {}", replay(scene));
            Failure::new(Failure::TRY_AGAIN, miette::miette!(help = help, "{error}"))
        }
        BuildError::Panic { .. } => Failure::failed(error),
        BuildError::Threads(_) => Failure::new(Failure::TRY_AGAIN, miette::Report::msg(error.to_string())),
    })
}

fn interrupted() -> miette::Report {
    miette::miette!(
        help = "the same command again goes on from here",
        "interrupted: shards that are whole are kept, others were discarded"
    )
}

/// Times and rates: not part of the corpus's identity.
fn report(progress: &Progress, writing: Duration, threads: usize) -> serde_json::Value {
    let seconds = progress.elapsed().as_secs_f64().max(1e-9);
    let stages: serde_json::Map<_, _> = progress
        .times
        .spent()
        .map(|(name, time)| (name.to_string(), time.as_secs_f64().into()))
        .chain([("writing".to_string(), writing.as_secs_f64().into())])
        .collect();
    json!({
        "wall_s": seconds,
        "threads": threads,
        "build": corpus::Build::of_this_binary(),
        "scenes": progress.done,
        "failed_scenes": progress.failed,
        "rays": progress.times.rays(),
        "cell_rows": progress.rows,
        "scenes_per_s": progress.done as f64 / seconds,
        "rays_per_s": progress.times.rays() as f64 / seconds,
        "cell_rows_per_s": progress.rows as f64 / seconds,
        "stage_thread_seconds": stages,
    })
}
