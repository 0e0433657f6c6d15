//! Looks at corpora: what is there, what is whole, what it holds; and merges what many machines built.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use super::build::{build_failure, interrupted, judge_corpus};
use super::options::{default_threads, parse_threads, plan_of};
use super::output::{errln, out, outln};
use super::place::{self, corpus_failure};
use super::progress::{BuildProgress, counted};
use super::rebuild::{self, tell_before};
use super::signals::stop_on_signals;
use super::{Failure, LogFormat, sign};
use crate::build::{CorpusBuild, Outcome, Share};
use crate::corpus::verify::{self, Finding};
use crate::corpus::{self, Build, CorpusError, CorpusSpec, Finished, Known, Manifest, Place, Store, owner, ranges};
use crate::episode::Prepared;
use crate::shell;

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
    /// Also build shards again, taken at random, and compare every byte: is this corpus what its plan says, and would this program
    /// build it today? Names the first row and column that differ. What was found is kept in rebuilt.json.
    #[arg(long, value_name = "all|N|5%")]
    rebuild: Option<Share>,
    /// First check the manifest's signature (`marsyard sign`): a file with the public key, or the key itself.
    #[arg(long, value_name = "PUBLIC_KEY")]
    key: Option<String>,
    /// Where the signature is; default: manifest.json.minisig in the corpus.
    #[arg(long, value_name = "FILE", requires = "key")]
    signature: Option<PathBuf>,
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
    /// Print one JSON document (schemas/inspection.schema.json) instead of text.
    #[arg(long)]
    json: bool,
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
                    shell::word(at.display())
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
        tell_faults(store.as_ref(), &spec, status.to_build().is_empty())?;
    } else if !status.to_build().is_empty() {
        outln!("{}", ranges::to_text(&status.to_build()));
    }
    Ok(())
}

/// Faults that are told one by one.
const MOST_TOLD: usize = 20;

/// What readers would refuse of a finished corpus, and what is in the folders of an unfinished one and belongs to no shard.
fn tell_faults(store: &dyn Store, spec: &CorpusSpec, is_complete: bool) -> Result<(), Failure> {
    let faults: Vec<String> = match Manifest::read(store) {
        Err(CorpusError::BadManifest { .. }) if !is_finished(store)? => {
            let strays = verify::strays(store, spec).map_err(corpus_failure)?;
            let verb = if is_complete { "finalize" } else { "generate" };
            let unfinished = format!("not finished: `marsyard {verb} {}` does that", shell::word(store.place()));
            std::iter::once(unfinished).chain(strays.iter().map(ToString::to_string)).collect()
        }
        Err(error @ (CorpusError::BadManifest { .. } | CorpusError::OtherFormat { .. })) => vec![error.to_string()],
        Err(error) => return Err(corpus_failure(error)),
        Ok(_) => Finished::faults(store).map_err(corpus_failure)?.iter().map(ToString::to_string).collect(),
    };
    faults.iter().take(MOST_TOLD).for_each(|fault| outln!("  {fault}"));
    if faults.len() > MOST_TOLD {
        outln!("  and {} more", faults.len() - MOST_TOLD);
    }
    Ok(())
}

fn is_finished(store: &dyn Store) -> Result<bool, Failure> {
    Ok(store.size(corpus::manifest::NAME).map_err(corpus_failure)?.is_some())
}

pub(super) fn finalize(args: &PlaceArgs) -> Result<(), Failure> {
    let (spec, store) = open(&args.place)?;
    let (plan, _) = plan_of(&args.place, &[])?;
    let manifest = corpus::finalize(store.as_ref(), &spec).map_err(corpus_failure)?;
    errln!("{}: {} shards, corpus_id {}", args.place.display(), manifest.shards, manifest.corpus_id);
    judge_corpus(&plan, &manifest)
}

pub(super) fn verify(args: &VerifyArgs, log: LogFormat) -> Result<(), Failure> {
    let (spec, store) = open(&args.place)?;
    let place = args.place.display();
    let check = |key: &String| sign::check(&args.place, store.as_ref(), key, args.signature.as_deref());
    let signed = args.key.as_ref().map(check).transpose()?;
    let findings = verify::verify(store.as_ref(), &spec, signed.as_deref()).map_err(corpus_failure)?;
    findings.iter().for_each(|finding| outln!("{finding}"));
    if findings.is_empty() {
        errln!("{place}: {} shards are as their receipts say", spec.shards());
        if args.repair {
            // A repair that was killed when all was well again left no more than this.
            Place::open(store.as_ref(), &spec).and_then(|place| place.sweep()).map_err(corpus_failure)?;
        }
    } else if args.repair {
        repair(args, &spec, store.as_ref(), &shards_of(&findings), signed.as_deref(), log)?;
    } else {
        return Err(unsound(&findings, &place.to_string()));
    }
    tell_before(store.as_ref())?;
    let (plan, _) = plan_of(&args.place, &[])?;
    let again = |share| rebuild::run(&place.to_string(), &plan, store.as_ref(), share, args.threads, log);
    args.rebuild.map_or(Ok(()), again)
}

/// The shards in which something was found, ascending.
fn shards_of(findings: &[Finding]) -> Vec<u64> {
    let mut shards: Vec<u64> = findings.iter().filter_map(|finding| finding.shard).collect();
    shards.sort_unstable();
    shards.dedup();
    shards
}

fn unsound(findings: &[Finding], place: &str) -> Failure {
    let shards = shards_of(findings);
    let places = match shards.as_slice() {
        [] => String::new(),
        [shard] => format!(" in shard {shard}"),
        _ => format!(" in shards {}", ranges::to_text(&shards)),
    };
    // What no repair mends says itself what does.
    let cure = match findings.iter().any(Finding::is_repairable) {
        true => format!("; cure: marsyard verify {} --repair", shell::word(place)),
        false => findings.first().map_or_else(String::new, |first| format!("; the first: {first}")),
    };
    Failure::failed(format!("{}{places}{cure}", counted(findings.len() as u64, "finding")))
}

/// Builds shards anew in place of what is there, and merges the receipts again.
fn repair(
    args: &VerifyArgs,
    spec: &CorpusSpec,
    store: &dyn Store,
    shards: &[u64],
    signed: Option<&str>,
    log: LogFormat,
) -> Result<(), Failure> {
    let (plan, _) = plan_of(&args.place, &[])?;
    if signed.is_some() {
        refuse_other_program(&args.place, store, shards)?;
    }
    // What the corpus was, if that is known: where all shards are sound it is the manifest that is not, or it is another corpus's,
    // or that of the corpus before it was raised.
    let witness = |there: &Manifest| {
        !shards.is_empty() && there.scene_plan_hash == spec.scene_plan_hash && there.scenes == spec.scenes
    };
    let before = Manifest::read(store).ok().filter(witness).map(|manifest| manifest.corpus_id);
    let place = Place::open(store, spec).map_err(corpus_failure)?;
    let status = corpus::status(store, spec).map_err(corpus_failure)?;
    // All of them before the first is removed.
    let check = |&shard: &u64| owner::check_shard(store, &spec.scene_plan_hash, shard);
    shards.iter().try_for_each(check).map_err(corpus_failure)?;
    shards.iter().try_for_each(|&shard| place.discard(shard)).map_err(corpus_failure)?;
    for name in place.remove_strays().map_err(corpus_failure)? {
        errln!("{}/{name}: belonged to no shard, and is removed", args.place.display());
    }
    // By its plan: while shards are missing the corpus itself is refused.
    let plan_file = args.place.join("plan.yaml");
    let replay = |scene| format!("marsyard explain {} --scene {scene}", shell::word(plan_file.display()));
    let build = CorpusBuild {
        prepared: &Prepared::new(plan).map_err(Failure::failed)?,
        spec,
        store,
        place: &place,
        threads: args.threads,
        keep_free_bytes: 0,
        stage_hashes: None,
        report: true,
    };
    let stop = stop_on_signals()?;
    let mut progress = BuildProgress::new(log, store.place(), &replay);
    let built = build.build(&status, shards, &stop, &mut |event| progress.take(&event));
    progress.finish();
    if built.map_err(|error| build_failure(error, &replay))?.outcome == Outcome::Interrupted {
        return Err(interrupted());
    }
    let known = Known { built: shards, signed };
    let manifest = corpus::finalize_knowing(store, spec, known).map_err(|error| match error {
        // They were built just now.
        gaps @ CorpusError::Gaps { .. } => Failure::new(
            Failure::TRY_AGAIN,
            miette::miette!(
                help = "somebody else builds or repairs here: when they are done, the same command again",
                "{gaps}"
            ),
        ),
        error => corpus_failure(error),
    })?;
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

/// Refuses to build anew, in a corpus that was signed, what another program wrote: its receipts would name this one.
fn refuse_other_program(place: &Path, store: &dyn Store, shards: &[u64]) -> Result<(), Failure> {
    let manifest = Manifest::read(store).map_err(corpus_failure)?;
    let here = Build::of_this_binary();
    let Some(there) = shards.iter().map(|&shard| manifest.build_of(shard)).find(|there| **there != here) else {
        return Ok(());
    };
    Err(Failure::new(
        Failure::FAILED,
        miette::miette!(
            help = "use that marsyard; without --key the shards are built all the same, and the corpus is no longer the signed one",
            "{}: shards {} are to be built anew and were written by marsyard {there}, this is {here}: the signature would not cover them",
            place.display(),
            ranges::to_text(shards)
        ),
    ))
}

pub(super) fn inspect(args: &InspectArgs) -> Result<(), Failure> {
    let (_, store) = open(&args.place)?;
    let (plan, _) = plan_of(&place::plan_file(&args.place)?, &[])?;
    let grids = plan.families.iter().map(|family| (family.name.clone(), (&family.cells).into())).collect();
    let inspection = corpus::inspect_with(store.as_ref(), &grids).map_err(corpus_failure)?;
    if args.json {
        out!("{}", corpus::documents::text(&inspection.document()));
    } else {
        out!("{inspection}");
    }
    Ok(())
}
