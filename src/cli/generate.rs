//! Builds a corpus, or goes on where an earlier run stopped.
//!
//! The verb ties the pipeline (scenes on all threads) to the corpus (shards in a place), and talks. A shard is on disk whole
//! or not at all, so there is nothing to repair after a crash: the same command again goes on.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use serde_json::json;

use super::place::{self, corpus_failure};
use super::progress::{Progress, human, si};
use super::{ConfigArgs, Failure, LogFormat};
use crate::cells::feature_columns;
use crate::config::Plan;
use crate::corpus::{self, Build, CorpusError, CorpusSpec, Manifest, Place, SceneOutput, ShardWriter, Store};
use crate::pipeline::Prepared;
use crate::pipeline::generate::{self, BuildError, Event, Outcome};
use crate::random::Purpose;

#[derive(Debug, Args)]
pub(super) struct GenerateArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Folder of the corpus, or a URL: s3://BUCKET/PATH, gs://..., az://..., file:///...; default: corpora/<name>.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Build these shards only, half open; the last machine runs `marsyard finalize`.
    #[arg(long, value_parser = parse_range, value_name = "A..B")]
    shards: Option<Range<u64>>,
    /// Threads; never changes a byte.
    #[arg(long, default_value_t = default_threads(), value_parser = parse_threads)]
    threads: usize,
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

fn parse_range(text: &str) -> Result<Range<u64>, String> {
    let parse = |s: &str| s.trim().parse::<u64>().map_err(|e| format!("'{s}': {e}"));
    let (a, b) = text.split_once("..").ok_or("a range is A..B, half open, such as 0..8")?;
    let range = parse(a)?..parse(b)?;
    if range.is_empty() { Err(format!("{text} is empty: B must be greater than A")) } else { Ok(range) }
}

/// What the corpus needs to know of a plan.
pub(super) fn spec_of(plan: &Plan) -> CorpusSpec {
    let first = &plan.families[0];
    let drawn: BTreeSet<Purpose> = plan
        .families
        .iter()
        .flat_map(|f| f.scene.dists().into_iter().chain(f.drive.dists()).chain(f.sweep.dists()))
        .map(|(purpose, _)| purpose)
        .collect();
    CorpusSpec {
        name: plan.name.clone(),
        seed: plan.seed,
        scenes: plan.scenes,
        scenes_per_shard: plan.scenes_per_shard,
        tables: plan.tables.clone(),
        // Checked by config: the same for all families.
        features: feature_columns(&first.cells, first.sweep.effects.intensity.is_some()),
        drawn: drawn.into_iter().collect(),
        families: plan.families.iter().map(|f| f.name.clone()).collect(),
        scene_plan_hash: plan.scene_plan_hash(),
        plan_yaml: plan.to_yaml(),
        license: "unknown".into(),
    }
}

pub(super) fn run(args: &GenerateArgs, log: LogFormat) -> Result<(), Failure> {
    let plan = args.config.load()?;
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("corpora").join(&plan.name));
    let range = shard_range(args, &plan)?;
    let spec = spec_of(&plan);
    let store = place::open(&out)?;
    let store = store.as_ref();
    let place = Place::open(store, &spec).map_err(corpus_failure)?;
    for file in &plan.files {
        let bytes = place::read(&file.from)?;
        store.put(&file.path, &bytes).map_err(corpus_failure)?;
    }
    let status = corpus::status(store, &spec).map_err(corpus_failure)?;
    for (shard, reason) in status.damaged.iter().filter(|(shard, _)| range.contains(shard)) {
        tracing::warn!("shard {shard} is damaged and is built anew: {reason}");
        place.discard(*shard).map_err(corpus_failure)?;
    }
    let shards: Vec<u64> = status.to_build().into_iter().filter(|shard| range.contains(shard)).collect();
    tell_start(&plan, &out, &range, &shards, args.threads, log);

    let prepared = Prepared::new(plan).map_err(Failure::failed)?;
    let stop = stop_on_signals()?;
    let mut progress = Progress::new(shards.len() as u64 * u64::from(spec.scenes_per_shard), log);
    let mut writing = std::time::Duration::ZERO;
    let outcome = generate::generate(
        &prepared,
        &shards,
        args.threads,
        &stop,
        |event| match event {
            Event::Scene { output, times } => {
                progress.scene(output, times, || replay_command(&args.config, output.scene_id));
            }
            Event::Shard { shard, written, took } => {
                writing += took;
                progress.shard(shard, *written);
            }
        },
        |shard, outputs| write_shard(&spec, store, shard, &outputs),
    );
    progress.finish();
    let outcome = build_outcome(outcome, |scene| replay_command(&args.config, scene))?;
    let report = report(&progress, writing, args.threads);
    store.replace("report.json", format!("{report:#}\n").as_bytes()).map_err(corpus_failure)?;
    if outcome == Outcome::Interrupted {
        return Err(Failure::new(Failure::TRY_AGAIN, interrupted()));
    }
    finish(&prepared.plan, &spec, store, &progress, writing, log)
}

/// How a build ended, or why it failed.
pub(super) fn build_outcome(
    built: Result<Outcome, BuildError<CorpusError>>,
    replay: impl FnOnce(u64) -> String,
) -> Result<Outcome, Failure> {
    built.map_err(|error| match error {
        BuildError::Write(error) => corpus_failure(error),
        BuildError::Panic { scene, .. } => Failure::failed(format!("{error}\n  replay: {}", replay(scene))),
        BuildError::Threads { .. } => Failure::new(Failure::TRY_AGAIN, miette::Report::msg(error.to_string())),
    })
}

fn interrupted() -> miette::Report {
    miette::miette!(
        help = "the same command again goes on from here",
        "interrupted: finished shards are kept, the shard in hand was discarded"
    )
}

fn shard_range(args: &GenerateArgs, plan: &Plan) -> Result<Range<u64>, Failure> {
    let all = 0..plan.shards();
    match &args.shards {
        None => Ok(all),
        Some(range) if range.end <= all.end => Ok(range.clone()),
        Some(range) => Err(Failure::usage(miette::miette!(
            help = format!("shards are numbered 0 to {}: the widest range is 0..{}", all.end - 1, all.end),
            "--shards {}..{}: the plan has {} shards",
            range.start,
            range.end,
            all.end
        ))),
    }
}

fn tell_start(plan: &Plan, out: &std::path::Path, range: &Range<u64>, shards: &[u64], threads: usize, log: LogFormat) {
    let there = (range.end - range.start) as usize - shards.len();
    if log == LogFormat::Json {
        tracing::info!(event = "start", corpus = %out.display(), shards_to_build = shards.len(), shards_there = there, threads);
        return;
    }
    let resumed = if there > 0 { format!(", {there} are there already") } else { String::new() };
    eprintln!(
        "{} -> {}: {} of {} shards to build, {} scenes each{resumed}; {threads} threads",
        plan.name,
        out.display(),
        shards.len(),
        range.end - range.start,
        plan.scenes_per_shard
    );
    if plan.shards() < 7 {
        eprintln!("warning: fewer than 7 shards leave a split empty; raise scenes or lower scenes_per_shard");
    }
}

/// SIGINT and SIGTERM ask the build to stop; a second one ends the process at once.
pub(super) fn stop_on_signals() -> Result<Arc<AtomicBool>, Failure> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // Order matters: the first signal finds the flag down and raises it, the second finds it up.
        signal_hook::flag::register_conditional_shutdown(signal, i32::from(Failure::TRY_AGAIN), Arc::clone(&stop))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)))
            .map_err(|e| Failure::failed(format!("cannot listen for signal {signal}: {e}")))?;
    }
    Ok(stop)
}

fn write_shard(spec: &CorpusSpec, store: &dyn Store, shard: u64, outputs: &[SceneOutput]) -> Result<u64, CorpusError> {
    let mut writer = ShardWriter::new(spec, shard)?;
    outputs.iter().try_for_each(|output| writer.push(output))?;
    let finished = writer.finish()?;
    finished.commit(store)?;
    Ok(finished.files.iter().map(|(_, bytes)| bytes.len() as u64).sum())
}

/// The command that replays one scene, as it would be typed here.
fn replay_command(config: &ConfigArgs, scene: u64) -> String {
    let sets: String = config.sets.iter().map(|set| format!(" --set '{set}'")).collect();
    format!("marsyard explain {} --scene {scene}{sets}", config.config.display())
}

/// Times and rates: not part of the corpus's identity.
fn report(progress: &Progress, writing: std::time::Duration, threads: usize) -> serde_json::Value {
    let seconds = progress.elapsed().as_secs_f64().max(1e-9);
    let stages: serde_json::Map<_, _> = progress
        .times
        .spent()
        .map(|(name, time)| (name.to_string(), time.as_secs_f64().into()))
        .chain([("writing".to_string(), writing.as_secs_f64().into())])
        .collect();
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    json!({
        "wall_s": seconds,
        "threads": threads,
        "host": host.trim(),
        "build": Build::of_this_binary(),
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

/// Finalizes when every shard of the plan is there, and judges the share of failed scenes.
fn finish(
    plan: &Plan,
    spec: &CorpusSpec,
    store: &dyn Store,
    progress: &Progress,
    writing: std::time::Duration,
    log: LogFormat,
) -> Result<(), Failure> {
    let status = corpus::status(store, spec).map_err(corpus_failure)?;
    let place = store.place();
    let missing = status.to_build();
    if missing.is_empty() {
        let manifest = corpus::finalize(store, spec).map_err(corpus_failure)?;
        tell_end(&manifest, &place, progress, writing, log);
        return judge_failures(plan, &manifest);
    }
    tracing::info!(
        "{place}: {} shards are still to be built ({}); then: marsyard finalize {place}",
        missing.len(),
        corpus::ranges::to_text(&missing)
    );
    too_many_failures(plan, progress.failed, progress.done, "listed above")
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

fn tell_end(manifest: &Manifest, place: &str, progress: &Progress, writing: std::time::Duration, log: LogFormat) {
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
        eprintln!(
            "built {} scenes in {}: {} rays ({} rays/s), {} rows/s, writing {:.1} % of the time",
            progress.done,
            human(progress.elapsed()),
            si(progress.times.rays() as f64),
            si(progress.times.rays() as f64 / seconds),
            si(progress.rows as f64 / seconds),
            100.0 * writing.as_secs_f64() / seconds
        );
    }
    eprintln!(
        "{place}: {} scenes ({} failed), {cells} cells, {share:.1} % untraversable, {}B\ncorpus_id {}\nnext: marsyard inspect {place}",
        manifest.scenes,
        manifest.failed.len(),
        si(bytes as f64),
        manifest.corpus_id
    );
}
