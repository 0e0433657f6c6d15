//! Looks at corpora: what is there, what is whole, what it holds; and merges what many machines built.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use clap::Args;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

use super::build::{Builder, build_outcome};
use super::explain::plan_of;
use super::generate::{default_threads, judge_failures, parse_threads};
use super::output::{errln, out, outln};
use super::place::{self, corpus_failure};
use super::progress::Progress;
use super::signals::stop_on_signals;
use super::{Failure, LogFormat};
use crate::corpus::verify::Finding;
use crate::corpus::{self, CorpusSpec, Manifest, Place, Store, ranges, rebuild, verify};
use crate::pipeline::Prepared;
use crate::pipeline::generate::{self, Event, Job, Outcome};

#[derive(Debug, Args)]
pub(super) struct PlaceArgs {
    /// Folder or URL of a corpus.
    place: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// Folder or URL of a corpus.
    place: PathBuf,
    /// Build the damaged and missing shards anew, and merge the receipts again.
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
    let (spec, store) = (plan.corpus_spec(), place::open(at)?);
    // Its shards would all look like another plan's, and a repair would build them all anew.
    match corpus::place::owner(store.as_ref()).map_err(corpus_failure)? {
        Some(owner) if owner != spec.scene_plan_hash => Err(Failure::new(
            Failure::FAILED,
            miette::miette!(
                help = format!(
                    "marsyard generate CONFIG --out {}, with the config that it was built from, writes it anew",
                    at.display()
                ),
                "{}/plan.yaml: its keys give scene_plan_hash {}, its first line says {owner}: it was edited or damaged, or \
                 written by another version of marsyard",
                at.display(),
                spec.scene_plan_hash
            ),
        )),
        _ => Ok((spec, store)),
    }
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
    errln!("{}: {} shards, corpus_id {}", args.place.display(), manifest.shards, manifest.corpus_id);
    judge_failures(&plan, &manifest)
}

pub(super) fn verify(args: &VerifyArgs, log: LogFormat) -> Result<(), Failure> {
    let (spec, store) = open(&args.place)?;
    let place = args.place.display();
    let findings = verify::verify(store.as_ref(), &spec).map_err(corpus_failure)?;
    findings.iter().for_each(|finding| outln!("{finding}"));
    if findings.is_empty() {
        errln!("{place}: {} shards are as their receipts say", spec.shards());
        return rebuild(args, &spec, store.as_ref(), log);
    }
    let mut shards: Vec<u64> = findings.iter().filter_map(|finding| finding.shard).collect();
    shards.sort_unstable();
    shards.dedup();
    if args.repair {
        return repair(args, &spec, store.as_ref(), &shards, log);
    }
    let places = if shards.is_empty() { String::new() } else { format!(" in shards {}", ranges::to_text(&shards)) };
    Err(Failure::failed(format!("{} findings{places}; cure: marsyard verify {place} --repair", findings.len())))
}

/// Builds shards anew in place of what is there, and merges the receipts again.
fn repair(
    args: &VerifyArgs,
    spec: &CorpusSpec,
    store: &dyn Store,
    shards: &[u64],
    log: LogFormat,
) -> Result<(), Failure> {
    let (plan, _) = plan_of(&args.place, &[])?;
    // What the corpus was, if that is known: where all shards are sound it is the manifest that is not, or it is another corpus's,
    // or that of the corpus before it was raised.
    let witness = |there: &Manifest| {
        !shards.is_empty() && there.scene_plan_hash == spec.scene_plan_hash && there.scenes == spec.scenes
    };
    let before = Manifest::read(store).ok().filter(witness).map(|manifest| manifest.corpus_id);
    let place = Place::open(store, spec).map_err(corpus_failure)?;
    let status = corpus::status(store, spec).map_err(corpus_failure)?;
    shards.iter().try_for_each(|&shard| place.discard(shard)).map_err(corpus_failure)?;
    let (prepared, threads) = (Prepared::new(plan).map_err(Failure::failed)?, args.threads);
    let builder = Builder {
        prepared,
        spec,
        store,
        place: &place,
        threads,
        keep_free_bytes: 0,
        stage_hashes: None,
        report: true,
        log,
    };
    builder.build(&status, shards, |scene| format!("marsyard explain {} --scene {scene}", args.place.display()))?;
    let manifest = corpus::finalize(store, spec).map_err(corpus_failure)?;
    let (place, after) = (args.place.display(), &manifest.corpus_id);
    match before.filter(|before| before != after) {
        Some(before) => Err(Failure::failed(format!(
            "{place}: shards {} are built anew, but corpus_id was {before} and is {after}: the corpus was not what this program \
             makes of its plan.yaml",
            ranges::to_text(shards)
        ))),
        None => {
            let anew = match shards {
                [] => "what is merged from the receipts is written".to_string(),
                _ => format!("shards {} are built", ranges::to_text(shards)),
            };
            errln!("{place}: {anew} anew, corpus_id {after}");
            Ok(())
        }
    }
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
        spec,
        Job { shards: &shards, threads: args.threads, stop: &*stop_on_signals()?, hashes: false },
        |event: Event<Vec<Finding>>| match event {
            Event::Scene { output, record } => {
                let replay = || format!("marsyard explain {} --scene {}", args.place.display(), output.scene_id);
                progress.scene(output, &record.times, replay);
            }
            Event::Shard { written, .. } => findings.extend_from_slice(written),
        },
        |finished| rebuild::compare(store, spec, finished),
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
        errln!("{place}: shards {ranges}, built again, have the same bytes");
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
