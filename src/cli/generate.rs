//! Builds a corpus, or goes on where an earlier run stopped.
//!
//! The verb ties the pipeline (scenes on all threads) to the corpus (shards in a place), and talks. A shard is on disk whole
//! or not at all, so there is nothing to repair after a crash: the same command again goes on.

use std::path::PathBuf;

use clap::Args;

use super::build::{Builder, Built};
use super::output::errln;
use super::progress::{human, si};
use super::{ConfigArgs, Failure, LogFormat};
use crate::config::Plan;
use crate::corpus::ranges::Ranges;
use crate::corpus::{self, CorpusError, CorpusSpec, LocalFolder, Manifest, Place, Split, Store};
use crate::pipeline::Prepared;

#[derive(Debug, Args)]
pub(super) struct GenerateArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Folder of the corpus; default: corpora/<name>.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Build these shards only: half-open ranges and numbers, as `marsyard status --missing` prints them; the last machine
    /// runs `marsyard finalize`.
    #[arg(long, value_name = "A..B,C")]
    shards: Option<Ranges>,
    /// Threads; never changes a byte.
    #[arg(long, default_value_t = default_threads(), value_parser = parse_threads)]
    threads: usize,
    /// Megabytes that are to stay free on the disk; a build that would take more stops before it does.
    #[arg(long, value_name = "MB", default_value_t = 100)]
    keep_free_mb: u64,
    /// Add a line of JSON to FILE for each scene, with the hashes of its stages' f64 results: what the f32 columns of two
    /// builds would hide.
    #[arg(long, value_name = "FILE")]
    stage_hashes: Option<PathBuf>,
}

pub(super) fn default_threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

pub(super) fn parse_threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("at least one thread is needed".into()),
        Ok(threads) => Ok(threads),
        Err(e) => Err(format!("'{text}': {e}")),
    }
}

/// Storage that fails may work again; everything else will not.
pub(super) fn corpus_failure(error: CorpusError) -> Failure {
    use std::io::ErrorKind;
    let again = "the same command again goes on";
    let (code, help) = match &error {
        CorpusError::Io { source, .. } => match source.kind() {
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                (Failure::FAILED, Some("make the folder writable, or choose another".into()))
            }
            ErrorKind::NotADirectory | ErrorKind::NotFound => (Failure::FAILED, None),
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
                (Failure::TRY_AGAIN, Some(format!("free some space, or choose another folder; {again}")))
            }
            ErrorKind::FileTooLarge => (Failure::TRY_AGAIN, Some(format!("raise the limit of `ulimit -f`; {again}"))),
            _ => (Failure::TRY_AGAIN, Some(again.into())),
        },
        CorpusError::NoRoom { .. } | CorpusError::Vanished { .. } => (Failure::TRY_AGAIN, None),
        CorpusError::OtherPlan { .. } | CorpusError::ForeignPlan { .. } | CorpusError::BeyondPlan { .. } => {
            (Failure::USAGE, None)
        }
        _ => (Failure::FAILED, None),
    };
    Failure::new(
        code,
        match help {
            Some(help) => miette::miette!(help = help, "{error}"),
            None => miette::Report::msg(error.to_string()),
        },
    )
}

pub(super) fn run(args: &GenerateArgs, log: LogFormat) -> Result<(), Failure> {
    let plan = args.config.load()?;
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("corpora").join(&plan.name));
    check_shards(args, &plan)?;
    let wanted = |shard: u64| args.shards.as_ref().is_none_or(|shards| shards.contains(shard));
    let spec = plan.corpus_spec();
    let store = LocalFolder::new(&out);
    let place = Place::open(&store, &spec).map_err(corpus_failure)?;
    for file in &plan.files {
        let bytes = std::fs::read(&file.from).map_err(|e| Failure::failed(format!("{}: {e}", file.from.display())))?;
        store.put(&file.path, &bytes).map_err(corpus_failure)?;
    }
    let status = corpus::status(&store, &spec).map_err(corpus_failure)?;
    let shards: Vec<u64> = status.to_build().into_iter().filter(|&shard| wanted(shard)).collect();
    let all = (0..plan.shards()).filter(|&shard| wanted(shard)).count();
    tell_start(&plan, &out, all, &shards, args.threads, log);

    let builder = Builder {
        prepared: Prepared::new(plan).map_err(Failure::failed)?,
        spec: &spec,
        store: &store,
        place: &place,
        threads: args.threads,
        keep_free_bytes: args.keep_free_mb.saturating_mul(1_000_000),
        stage_hashes: args.stage_hashes.as_deref(),
        log,
    };
    let built = builder.build(&status, &shards, |scene| replay_command(&args.config, scene))?;
    finish(&builder.prepared.plan, &spec, &store, wanted, &built, log)
}

fn check_shards(args: &GenerateArgs, plan: &Plan) -> Result<(), Failure> {
    let shards = plan.shards();
    match &args.shards {
        Some(ranges) if ranges.end() > shards => Err(Failure::usage(miette::miette!(
            help = format!("shards are numbered 0 to {}: the widest range is 0..{shards}", shards - 1),
            "--shards goes to {}: the plan has {shards} shards",
            ranges.end()
        ))),
        _ => Ok(()),
    }
}

fn tell_start(plan: &Plan, out: &std::path::Path, all: usize, shards: &[u64], threads: usize, log: LogFormat) {
    let there = all - shards.len();
    if log == LogFormat::Json {
        tracing::info!(event = "start", corpus = %out.display(), shards_to_build = shards.len(), shards_there = there, threads);
        return;
    }
    let resumed = if there > 0 { format!(", {there} are there already") } else { String::new() };
    errln!(
        "{} -> {}: {} of {} shards to build, {} scenes each{resumed}; {threads} threads",
        plan.name,
        out.display(),
        shards.len(),
        all,
        plan.scenes_per_shard
    );
    split_warnings(plan).iter().for_each(|warning| errln!("warning: {warning}"));
}

/// What a plan of so few shards leaves out.
pub(super) fn split_warnings(plan: &Plan) -> Vec<String> {
    let empty = |split| !(0..plan.shards().min(20)).any(|shard| Split::of_shard(shard) == split);
    let names: Vec<&str> = Split::ALL.into_iter().filter(|&split| empty(split)).map(Split::name).collect();
    let mut warnings = Vec::new();
    if !names.is_empty() {
        let names = names.join(" and ");
        warnings.push(format!("no shard is in the {names} split; from 7 shards on there is one in each: raise scenes or lower scenes_per_shard"));
    }
    if empty(Split::Test) {
        let held_out = plan.families.iter().filter(|family| family.hold_out);
        warnings.extend(held_out.map(|family| {
            format!(
                "family {} is held out for the test split, which has no shard: no scene of it is built",
                family.name
            )
        }));
    }
    warnings
}

/// The command that replays one scene, as it would be typed here.
fn replay_command(config: &ConfigArgs, scene: u64) -> String {
    let sets: String = config.sets.iter().map(|set| format!(" --set '{set}'")).collect();
    format!("marsyard explain {} --scene {scene}{sets}", config.config.display())
}

/// Finalizes when every shard of the plan is there, and judges the share of failed scenes.
fn finish(
    plan: &Plan,
    spec: &CorpusSpec,
    store: &LocalFolder,
    wanted: impl Fn(u64) -> bool,
    built: &Built,
    log: LogFormat,
) -> Result<(), Failure> {
    let status = corpus::status(store, spec).map_err(corpus_failure)?;
    let place = store.place();
    let missing = status.to_build();
    if missing.is_empty() {
        let manifest = corpus::finalize(store, spec).map_err(corpus_failure)?;
        tell_end(&manifest, &place, built, log);
        return judge_failures(plan, &manifest);
    }
    let gone: Vec<u64> = missing.iter().copied().filter(|&shard| wanted(shard)).collect();
    if !gone.is_empty() {
        return Err(Failure::new(
            Failure::TRY_AGAIN,
            miette::miette!(
                help = "the same command again builds them anew",
                "{place}: shards {} were built and are not there, or damaged: somebody else, or the disk, has changed the folder",
                corpus::ranges::to_text(&gone)
            ),
        ));
    }
    tracing::info!(
        "{place}: {} shards are still to be built ({}); then: marsyard finalize {place}",
        missing.len(),
        corpus::ranges::to_text(&missing)
    );
    too_many_failures(plan, built.progress.failed, built.progress.done, "listed above")
}

/// Refuses a finished corpus of which too many scenes failed.
pub(super) fn judge_failures(plan: &Plan, manifest: &Manifest) -> Result<(), Failure> {
    let first = manifest
        .failed
        .first()
        .map(|f| format!("scene {}: {}; replay, in the corpus folder: {}", f.scene, f.error, f.replay));
    too_many_failures(plan, manifest.failed.len() as u64, manifest.scenes, &first.unwrap_or_default())
}

fn too_many_failures(plan: &Plan, failed: u64, scenes: u64, first: &str) -> Result<(), Failure> {
    if failed as f64 <= plan.max_failed_share * scenes as f64 {
        return Ok(());
    }
    Err(Failure::failed(format!(
        "{failed} of {scenes} scenes failed, more than max_failed_share = {}; the first: {first}",
        plan.max_failed_share
    )))
}

fn tell_end(manifest: &Manifest, place: &str, built: &Built, log: LogFormat) {
    let Built { progress, writing } = built;
    let labels = manifest.labels();
    let cells = labels.traversable + labels.untraversable;
    let share = 100.0 * labels.untraversable as f64 / cells.max(1) as f64;
    let bytes: u64 = manifest.tables.values().map(|t| t.bytes).sum();
    if log == LogFormat::Json {
        tracing::info!(event = "done", corpus = place, corpus_id = %manifest.corpus_id, scenes = manifest.scenes, failed = manifest.failed.len(), cells, bytes);
        return;
    }
    let seconds = progress.elapsed().as_secs_f64().max(1e-9);
    if progress.done > 0 {
        errln!(
            "built {} scenes in {}: {} rays ({} rays/s), {} rows/s, writing {:.1} % of the time",
            progress.done,
            human(progress.elapsed()),
            si(progress.times.rays() as f64),
            si(progress.times.rays() as f64 / seconds),
            si(progress.rows as f64 / seconds),
            100.0 * writing.as_secs_f64() / seconds
        );
    }
    errln!(
        "{place}: {} scenes ({} failed), {cells} cells, {share:.1} % untraversable, {}B\ncorpus_id {}\nnext: marsyard inspect {place}",
        manifest.scenes,
        manifest.failed.len(),
        si(bytes as f64),
        manifest.corpus_id
    );
}
