//! Shard numbers -> those shards in their place: with enough free space, in the place of damaged ones, with a report.
//!
//! A stop, a disk that fills up or a folder that goes away may end the build; shards are there whole or not at all, those that the
//! scenes in hand make whole too, and the same build again goes on.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::shards::{BuildError, Event, Job, Outcome, build_shards};
use super::stage_hashes::StageHashFile;
use super::{Tally, expected};
use crate::corpus::{Build, CorpusError, CorpusSpec, FinishedShard, FreeSpace, Place, Status, Store, owner};
use crate::episode::{Prepared, SceneOutput};

/// A plan, its place, and how to build.
pub(crate) struct CorpusBuild<'a> {
    pub prepared: &'a Prepared,
    pub spec: &'a CorpusSpec,
    pub store: &'a dyn Store,
    pub place: &'a Place<'a>,
    pub threads: usize,
    /// To be left free on the disk.
    pub keep_free_bytes: u64,
    /// Hashes of the stages' results are added to this file.
    pub stage_hashes: Option<&'a Path>,
    /// Write report.json: nobody else builds other shards.
    pub report: bool,
}

/// What happens while a corpus is built, for progress and logs.
#[derive(Debug)]
pub enum CorpusEvent<'a> {
    /// The place is open: so many of the selected shards are to be built.
    Start { selected: usize, shards: &'a [u64] },
    /// Whole shards behind the plan's end were removed.
    Discarded { shards: u64 },
    /// Another program wrote shards that are there: equal values are promised for equal sources by one compiler.
    OtherProgram { shards: u64, there: &'a Build, here: &'a Build },
    /// A shard that is damaged is removed, to be built anew.
    Damaged { shard: u64, reason: &'a str },
    /// A scene's rows are there (or its failure).
    Scene { output: &'a SceneOutput, tally: &'a Tally },
    /// A shard is in its place.
    Shard { shard: u64, bytes: u64 },
}

/// What a build has done.
#[derive(Debug)]
pub(crate) struct Built {
    pub outcome: Outcome,
    pub tally: Tally,
}

/// Why shards could not be built in their place.
#[derive(Debug, thiserror::Error)]
pub enum CorpusBuildError {
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    #[error(transparent)]
    Build(BuildError<CorpusError>),
    #[error(transparent)]
    Pattern(#[from] crate::sweep::PatternError),
    #[error("{0}")]
    OtherFormat(String),
    #[error("{0}")]
    Selection(String),
    #[error(
        "{place}: shards {shards} were built and are not there, or damaged: somebody else, or the disk, has changed the folder"
    )]
    Gone { place: String, shards: String },
}

impl From<BuildError<CorpusError>> for CorpusBuildError {
    fn from(error: BuildError<CorpusError>) -> CorpusBuildError {
        match error {
            BuildError::Write(error) => CorpusBuildError::Corpus(error),
            other => CorpusBuildError::Build(other),
        }
    }
}

impl CorpusBuild<'_> {
    /// Builds these shards, ascending; `status` is that of the place.
    pub(crate) fn build(
        &self,
        status: &Status,
        shards: &[u64],
        stop: &AtomicBool,
        observe: &mut dyn FnMut(CorpusEvent),
    ) -> Result<Built, CorpusBuildError> {
        if let Some((_, reason)) = status.other_format.first() {
            return Err(CorpusBuildError::OtherFormat(reason.clone()));
        }
        if !shards.is_empty() {
            self.store.probe()?;
            tell_other_programs(status, observe);
        }
        let space = FreeSpace::new(self.store, self.keep_free_bytes);
        if let Some(bytes) = expected::bytes(self.prepared, self.spec, status, shards.len() as u64, stop)? {
            space.check(bytes, || format!("a build of {} shards", shards.len()))?;
        }
        for (shard, reason) in status.damaged.iter().filter(|(shard, _)| shards.binary_search(shard).is_ok()) {
            observe(CorpusEvent::Damaged { shard: *shard, reason });
            self.place.discard(*shard)?;
        }
        let hashes = self.stage_hashes.map(|file| StageHashFile::open(file, self.spec.scenes_per_shard)).transpose()?;
        let job = Job { shards, threads: self.threads, stop, hashes: hashes.is_some() };
        let mut tally = Tally::new(shards.len() as u64 * u64::from(self.spec.scenes_per_shard));
        let outcome = build_shards(
            self.prepared,
            self.spec,
            job,
            |event| match event {
                Event::Scene { output, record } => {
                    tally.scene(output, &record.times);
                    hashes.iter().for_each(|file| file.scene(output, record));
                    observe(CorpusEvent::Scene { output, tally: &tally });
                }
                Event::Shard { shard, written, took } => {
                    tally.writing += took;
                    observe(CorpusEvent::Shard { shard, bytes: *written });
                }
            },
            |finished| self.put(&space, hashes.as_ref(), &finished),
        )?;
        tally.end();
        self.place.still_there()?;
        if self.report {
            let report = format!("{:#}\n", tally.report(self.threads));
            self.store.replace(owner::REPORT, report.as_bytes())?;
        }
        Ok(Built { outcome, tally })
    }

    fn put(
        &self,
        space: &FreeSpace,
        hashes: Option<&StageHashFile>,
        finished: &FinishedShard,
    ) -> Result<u64, CorpusError> {
        let (shard, bytes) = (finished.receipt.shard, finished.files.iter().map(|(_, bytes)| bytes.len() as u64).sum());
        space.check(bytes, || format!("shard {shard}"))?;
        hashes.map_or(Ok(()), |file| file.shard(shard))?;
        self.place.commit(finished)?;
        Ok(bytes)
    }
}

fn tell_other_programs(status: &Status, observe: &mut dyn FnMut(CorpusEvent)) {
    let here = Build::of_this_binary();
    let others: Vec<_> = status.builds.iter().filter(|(build, _)| !here.is_like(build)).collect();
    if let Some((there, _)) = others.first() {
        let shards = others.iter().map(|(_, shards)| shards).sum();
        observe(CorpusEvent::OtherProgram { shards, there, here: &here });
    }
}
