//! Looks at corpora: what is there, what is whole, what it holds; and merges what many machines built.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use clap::Args;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

use super::explain::plan_of;
use super::generate::{build_outcome, default_threads, judge_failures, parse_threads, spec_of, stop_on_signals};
use super::output::{out, outln};
use super::place::{self, corpus_failure};
use super::progress::Progress;
use super::{Failure, LogFormat};
use crate::corpus::verify::Finding;
use crate::corpus::{self, CorpusSpec, Place, Store, ranges, rebuild, verify};
use crate::pipeline::Prepared;
use crate::pipeline::generate::{self, Event, Outcome};

#[derive(Debug, Args)]
pub(super) struct PlaceArgs {
    /// Folder or URL of a corpus.
    place: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// Folder or URL of a corpus.
    place: PathBuf,
    /// Remove the damaged shards, so that `marsyard generate` builds them anew.
    #[arg(long)]
    repair: bool,
    /// Also build N shards again, taken at random, and compare every byte: is this corpus what its plan says, and would this
    /// program build it today? Names the first row and column that differ.
    #[arg(long, value_name = "N", default_value_t = 0)]
    rebuild: u64,
    /// Threads to build with.
    #[arg(long, default_value_t = default_threads(), value_parser = parse_threads)]
    threads: usize,
}

#[derive(Debug, Args)]
pub(super) struct StatusArgs {
    /// Folder or URL of a corpus.
    place: PathBuf,
    /// Print the shards that are missing or damaged as ranges, and nothing else; nothing where all are there.
    #[arg(long)]
    missing: bool,
}

#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// Folder or URL of a finished corpus.
    place: PathBuf,
}

/// The corpus at a place, by its own plan.yaml.
fn open(at: &Path) -> Result<(CorpusSpec, Arc<dyn Store>), Failure> {
    let (plan, _) = plan_of(&place::plan_file(at)?, &[])?;
    Ok((spec_of(&plan), place::open(at)?))
}

pub(super) fn status(args: &StatusArgs) -> Result<(), Failure> {
    let (spec, store) = open(&args.place)?;
    let status = corpus::status(store.as_ref(), &spec).map_err(corpus_failure)?;
    if !args.missing {
        out!("{status}");
    } else if !status.to_build().is_empty() {
        outln!("{}", ranges::to_text(&status.to_build()));
    }
    Ok(())
}

pub(super) fn finalize(args: &PlaceArgs) -> Result<(), Failure> {
    let (spec, store) = open(&args.place)?;
    let (plan, _) = plan_of(&args.place, &[])?;
    let manifest = corpus::finalize(store.as_ref(), &spec).map_err(corpus_failure)?;
    eprintln!("{}: {} shards, corpus_id {}", args.place.display(), manifest.shards, manifest.corpus_id);
    judge_failures(&plan, &manifest)
}

pub(super) fn verify(args: &VerifyArgs, log: LogFormat) -> Result<(), Failure> {
    let (spec, store) = open(&args.place)?;
    let place = args.place.display();
    let findings = verify::verify(store.as_ref(), &spec).map_err(corpus_failure)?;
    findings.iter().for_each(|finding| outln!("{finding}"));
    if findings.is_empty() {
        eprintln!("{place}: {} shards are as their receipts say", spec.shards());
        return rebuild(args, &spec, store.as_ref(), log);
    }
    let mut shards: Vec<u64> = findings.iter().filter_map(|finding| finding.shard).collect();
    shards.sort_unstable();
    shards.dedup();
    let ranges = ranges::to_text(&shards);
    let again = format!("marsyard generate {place}/plan.yaml --out {place}");
    if args.repair {
        let corpus = Place::open(store.as_ref(), &spec).map_err(corpus_failure)?;
        shards.iter().try_for_each(|&shard| corpus.discard(shard)).map_err(corpus_failure)?;
        return Err(Failure::failed(format!("shards {ranges} were damaged and are removed; build them anew: {again}")));
    }
    Err(Failure::failed(format!(
        "{} findings in shards {ranges}; cure: marsyard verify {place} --repair, then {again}",
        findings.len()
    )))
}

/// Builds shards of a sound corpus again and compares them.
fn rebuild(args: &VerifyArgs, spec: &CorpusSpec, store: &dyn Store, log: LogFormat) -> Result<(), Failure> {
    if args.rebuild == 0 {
        return Ok(());
    }
    let (plan, _) = plan_of(&args.place, &[])?;
    let seed = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |now| now.as_nanos() as u64);
    let count = args.rebuild.min(spec.shards()) as usize;
    let taken = rand::seq::index::sample(&mut ChaCha8Rng::seed_from_u64(seed), spec.shards() as usize, count);
    let mut shards: Vec<u64> = taken.into_iter().map(|shard| shard as u64).collect();
    shards.sort_unstable();
    let prepared = Prepared::new(plan).map_err(Failure::failed)?;
    let mut progress = Progress::new(shards.len() as u64 * u64::from(spec.scenes_per_shard), log);
    let mut findings: Vec<Finding> = Vec::new();
    let built = generate::generate(
        &prepared,
        &shards,
        args.threads,
        &*stop_on_signals()?,
        |event: Event<Vec<Finding>>| match event {
            Event::Scene { output, times } => {
                let replay = || format!("marsyard explain {} --scene {}", args.place.display(), output.scene_id);
                progress.scene(output, times, replay);
            }
            Event::Shard { written, .. } => findings.extend_from_slice(written),
        },
        |shard, scenes| rebuild::compare(store, spec, shard, &scenes),
    );
    progress.finish();
    let place = args.place.display();
    match build_outcome(built, |scene| format!("marsyard explain {place} --scene {scene}"))? {
        Outcome::Interrupted => {
            return Err(Failure::new(Failure::TRY_AGAIN, miette::miette!("interrupted: nothing was changed")));
        }
        Outcome::Done => {}
    }
    let ranges = ranges::to_text(&shards);
    if findings.is_empty() {
        eprintln!("{place}: shards {ranges}, built again, have the same bytes");
        return Ok(());
    }
    findings.sort_by_key(|finding| (finding.shard, finding.name.clone()));
    findings.iter().for_each(|finding| outln!("{finding}"));
    Err(Failure::failed(format!(
        "{} of the files of shards {ranges} differ when built again; the corpus is not what this program makes of its plan.yaml",
        findings.len()
    )))
}

pub(super) fn inspect(args: &InspectArgs) -> Result<(), Failure> {
    let (_, store) = open(&args.place)?;
    out!("{}", corpus::inspect(store.as_ref()).map_err(corpus_failure)?);
    Ok(())
}
