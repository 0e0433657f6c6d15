//! Looks at corpora: what is there, what is whole, what it holds; and merges what many machines built.

use std::path::{Path, PathBuf};

use clap::Args;

use super::Failure;
use super::explain::plan_of;
use super::generate::{corpus_failure, judge_failures, spec_of};
use super::output::{out, outln};
use crate::corpus::{self, CorpusSpec, LocalFolder, Place, ranges, verify};

#[derive(Debug, Args)]
pub(super) struct PlaceArgs {
    /// Folder of a corpus.
    place: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// Folder of a corpus.
    place: PathBuf,
    /// Remove the damaged shards, so that `marsyard generate` builds them anew.
    #[arg(long)]
    repair: bool,
}

#[derive(Debug, Args)]
pub(super) struct StatusArgs {
    /// Folder of a corpus.
    place: PathBuf,
    /// Print the shards that are missing or damaged as ranges, and nothing else; nothing where all are there.
    #[arg(long)]
    missing: bool,
}

#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// Folder of a finished corpus.
    place: PathBuf,
}

/// The corpus in a folder, by its own plan.yaml.
fn open(place: &Path) -> Result<(CorpusSpec, LocalFolder), Failure> {
    if !place.join("plan.yaml").is_file() {
        return Err(Failure::usage(miette::miette!(
            help = "give the folder that `marsyard generate` named, such as corpora/quickstart",
            "{} is not a corpus: it holds no plan.yaml",
            place.display()
        )));
    }
    let (plan, _) = plan_of(place, &[])?;
    Ok((spec_of(&plan), LocalFolder::new(place)))
}

pub(super) fn status(args: &StatusArgs) -> Result<(), Failure> {
    let (spec, store) = open(&args.place)?;
    let status = corpus::status(&store, &spec).map_err(corpus_failure)?;
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
    let manifest = corpus::finalize(&store, &spec).map_err(corpus_failure)?;
    eprintln!("{}: {} shards, corpus_id {}", args.place.display(), manifest.shards, manifest.corpus_id);
    judge_failures(&plan, &manifest)
}

pub(super) fn verify(args: &VerifyArgs) -> Result<(), Failure> {
    let (spec, store) = open(&args.place)?;
    let place = args.place.display();
    let findings = verify::verify(&store, &spec).map_err(corpus_failure)?;
    findings.iter().for_each(|finding| outln!("{finding}"));
    if findings.is_empty() {
        eprintln!("{place}: {} shards are as their receipts say", spec.shards());
        return Ok(());
    }
    let mut shards: Vec<u64> = findings.iter().filter_map(|finding| finding.shard).collect();
    shards.sort_unstable();
    shards.dedup();
    let ranges = ranges::to_text(&shards);
    let again = format!("marsyard generate {place}/plan.yaml --out {place}");
    if args.repair {
        let corpus = Place::open(&store, &spec).map_err(corpus_failure)?;
        shards.iter().try_for_each(|&shard| corpus.discard(shard)).map_err(corpus_failure)?;
        return Err(Failure::failed(format!("shards {ranges} were damaged and are removed; build them anew: {again}")));
    }
    Err(Failure::failed(format!(
        "{} findings in shards {ranges}; cure: marsyard verify {place} --repair, then {again}",
        findings.len()
    )))
}

pub(super) fn inspect(args: &InspectArgs) -> Result<(), Failure> {
    let (_, store) = open(&args.place)?;
    out!("{}", corpus::inspect(&store).map_err(corpus_failure)?);
    Ok(())
}
