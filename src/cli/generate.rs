//! Builds a corpus, or goes on where an earlier run stopped.
//!
//! The verb ties the pipeline (scenes on all threads) to the corpus (shards in a place), and talks. A shard is on disk whole
//! or not at all, so there is nothing to repair after a crash: the same command again goes on.
//!
//! Many machines build one corpus by `--shards`: each looks at its own shards alone and writes nothing but them, so that a
//! thousand such runs do not read each other's receipts; `marsyard finalize` is the one that looks at all.

use std::path::{Path, PathBuf};

use clap::Args;

use super::build::{Builder, Built, is_stage_hashes};
use super::explain::plan_of;
use super::output::{errln, printable};
use super::place::{self, config_file, corpus_failure, inputs};
use super::progress::{Progress, human, si};
use super::{ConfigArgs, Failure, LogFormat};
use crate::corpus::limits::FileKind;
use crate::corpus::{self, Known, Manifest, Place, Selection, Split, owner, ranges};
use crate::episode::Prepared;
use crate::plan::Plan;

#[derive(Debug, Args)]
pub(super) struct GenerateArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Folder of the corpus, or a URL: s3://BUCKET/PATH, gs://..., az://..., file:///...; default: corpora/<name>, or the corpus that
    /// was given instead of a config.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Build these shards only: 0..8 (half open), 3,7,9..12, or 3/16 (part 3 of 16, counted from 0). When all parts are there,
    /// one machine runs `marsyard finalize`.
    #[arg(long, value_name = "SHARDS")]
    shards: Option<Selection>,
    /// Lay down plan.yaml and the files that it needs, and build nothing; then `marsyard generate PLACE --shards ...` on many
    /// machines.
    #[arg(long, conflicts_with = "shards")]
    plan_only: bool,
    /// Remove whole shards behind the plan's end, which a config of more scenes left in the folder; without this they are refused.
    #[arg(long, conflicts_with = "shards")]
    discard_beyond: bool,
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

/// More than any machine has cores for.
const MOST_THREADS: usize = 4096;

pub(super) fn parse_threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("at least one thread is needed".into()),
        Ok(threads) if threads > MOST_THREADS => Err(format!("at most {MOST_THREADS} threads are started")),
        Ok(threads) => Ok(threads),
        Err(e) => Err(format!("'{text}': {e}")),
    }
}

pub(super) fn run(args: &GenerateArgs, log: LogFormat) -> Result<(), Failure> {
    let (plan, corpus) = plan_of(&args.config.config, &args.config.sets)?;
    let default_out = || corpus.map_or_else(|| PathBuf::from("corpora").join(&plan.name), Path::to_path_buf);
    let out = args.out.clone().unwrap_or_else(default_out);
    let selected = selected_shards(args, &plan)?;
    let spec = plan.corpus_spec();
    if let Some(file) = &args.stage_hashes {
        owner::check_file(file, &inputs(&args.config.config), is_stage_hashes).map_err(corpus_failure)?;
    }
    let store = place::open(&out)?;
    let store = store.as_ref();
    let place = if args.discard_beyond {
        let (place, discarded) = Place::open_discarding(store, &spec).map_err(corpus_failure)?;
        tell_discarded(discarded, &out, log);
        place
    } else {
        Place::open(store, &spec).map_err(corpus_failure)?
    };
    for file in &plan.files {
        let bytes = place::read(&file.from, FileKind::Config)?;
        store.put(&file.path, &bytes).map_err(corpus_failure)?;
    }
    if args.plan_only {
        tell_plan_laid(&plan, &out, log);
        return Ok(());
    }
    let status = corpus::status_of(store, &spec, &selected).map_err(corpus_failure)?;
    let shards = status.to_build();
    tell_start(&plan, &out, selected.len(), &shards, args.threads, log);

    let builder = Builder {
        prepared: Prepared::new(plan).map_err(Failure::failed)?,
        spec: &spec,
        store,
        place: &place,
        threads: args.threads,
        keep_free_bytes: args.keep_free_mb.saturating_mul(1_000_000),
        stage_hashes: args.stage_hashes.as_deref(),
        report: args.shards.is_none(),
        log,
    };
    let built = builder.build(&status, &shards, |scene| replay_command(&args.config, scene))?;
    let gone = corpus::status_of(store, &spec, &selected).map_err(corpus_failure)?.to_build();
    if !gone.is_empty() {
        return Err(Failure::new(
            Failure::TRY_AGAIN,
            miette::miette!(
                help = "the same command again builds them anew",
                "{}: shards {} were built and are not there, or damaged: somebody else, or the disk, has changed the folder",
                store.place(),
                ranges::to_text(&gone)
            ),
        ));
    }
    if args.shards.is_some() {
        tell_part_end(&store.place(), &selected, &built.progress, log);
        return Ok(());
    }
    let known = Known { built: &shards, signed: None };
    let manifest = corpus::finalize_knowing(store, &spec, known).map_err(corpus_failure)?;
    tell_end(&manifest, &store.place(), &built, args.threads, log);
    judge_failures(&builder.prepared.plan, &manifest)
}

/// The shards that were asked for, ascending.
fn selected_shards(args: &GenerateArgs, plan: &Plan) -> Result<Vec<u64>, Failure> {
    let Some(selection) = &args.shards else { return Ok((0..plan.shards()).collect()) };
    selection.of(plan.shards()).map_err(|why| Failure::usage(miette::miette!("--shards {why}")))
}

fn tell_discarded(shards: u64, out: &Path, log: LogFormat) {
    if log == LogFormat::Json {
        tracing::info!(event = "discarded", corpus = %out.display(), shards);
    } else {
        errln!("{}: {shards} shards behind the plan's end were removed", out.display());
    }
}

fn tell_plan_laid(plan: &Plan, out: &Path, log: LogFormat) {
    if log == LogFormat::Json {
        tracing::info!(event = "plan_laid", corpus = %out.display(), shards = plan.shards());
        return;
    }
    errln!(
        "{} -> {}: the plan of {} shards is laid down; build it in N parts: marsyard generate {} --shards K/N, K from 0",
        plan.name,
        out.display(),
        plan.shards(),
        out.display()
    );
}

fn tell_start(plan: &Plan, out: &Path, selected: usize, shards: &[u64], threads: usize, log: LogFormat) {
    let there = selected - shards.len();
    if log == LogFormat::Json {
        tracing::info!(event = "start", corpus = %out.display(), shards_to_build = shards.len(), shards_there = there, threads);
        return;
    }
    let resumed = if there > 0 { format!(", {there} are there already") } else { String::new() };
    errln!(
        "{} -> {}: {} of {selected} shards to build, {} scenes each{resumed}; {threads} threads",
        plan.name,
        out.display(),
        shards.len(),
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
    // Of a corpus its plan: while it is built the corpus itself is refused.
    let file = config_file(&config.config);
    format!("marsyard explain {} --scene {scene}{sets}", file.display())
}

/// The end of a part: whether too many scenes failed is judged over the whole corpus, by `finalize`.
fn tell_part_end(place: &str, selected: &[u64], progress: &Progress, log: LogFormat) {
    let shards = ranges::to_text(selected);
    if log == LogFormat::Json {
        tracing::info!(
            event = "part_done",
            corpus = place,
            shards,
            scenes = progress.done,
            failed = progress.failed,
            cells = progress.rows,
            rays = progress.times.rays()
        );
        return;
    }
    let failed = if progress.failed > 0 { format!(" ({} scenes failed)", progress.failed) } else { String::new() };
    if selected.is_empty() {
        errln!("{place}: this part has no shards, there are more parts than shards");
    } else {
        errln!("{place}: shards {shards} are there{failed}; when all are: marsyard finalize {place}");
    }
}

/// Refuses a finished corpus of which too many scenes failed.
pub(super) fn judge_failures(plan: &Plan, manifest: &Manifest) -> Result<(), Failure> {
    let (failed, scenes) = (manifest.failed.len() as u64, manifest.scenes);
    if failed as f64 <= plan.max_failed_share * scenes as f64 {
        return Ok(());
    }
    let first = manifest
        .failed
        .first()
        .map(|f| format!("scene {}: {}; replay, in the corpus folder: {}", f.scene, printable(&f.error), f.replay))
        .unwrap_or_default();
    Err(Failure::failed(format!(
        "{failed} of {scenes} scenes failed, more than max_failed_share = {}; the first: {first}",
        plan.max_failed_share
    )))
}

fn tell_end(manifest: &Manifest, place: &str, built: &Built, threads: usize, log: LogFormat) {
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
            "built {} scenes in {}: {} rays ({} rays/s), {} rows/s, writing {:.1} % of the threads' time",
            progress.done,
            human(progress.elapsed()),
            si(progress.times.rays() as f64),
            si(progress.times.rays() as f64 / seconds),
            si(progress.rows as f64 / seconds),
            100.0 * writing.as_secs_f64() / (seconds * threads as f64)
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
