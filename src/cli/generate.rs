//! Builds a corpus, or goes on where an earlier run stopped.
//!
//! The verb ties the pipeline (scenes on all threads) to the corpus (shards in a place), and talks. A shard is on disk whole
//! or not at all, so there is nothing to repair after a crash: the same command again goes on.
//!
//! Many machines build one corpus by `--shards`: each looks at its own shards alone and writes nothing but them, so that a
//! thousand such runs do not read each other's receipts; `marsyard finalize` is the one that looks at all.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use serde_json::json;

use super::explain::plan_of;
use super::progress::{Progress, human, si};
use super::{ConfigArgs, Failure, LogFormat};
use crate::cells::feature_columns;
use crate::config::Plan;
use crate::corpus::{
    self, Build, CorpusError, CorpusSpec, LocalFolder, Manifest, Place, SceneOutput, Selection, ShardWriter, Store,
    ranges,
};
use crate::pipeline::Prepared;
use crate::pipeline::generate::{self, BuildError, Event, Outcome};
use crate::random::Purpose;

#[derive(Debug, Args)]
pub(super) struct GenerateArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Folder of the corpus; default: corpora/<name>, or the corpus that was given instead of a config.
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

/// Storage that fails may work again; everything else will not.
pub(super) fn corpus_failure(error: CorpusError) -> Failure {
    use std::io::ErrorKind;
    let code = match &error {
        CorpusError::Io { source, .. } => match source.kind() {
            ErrorKind::NotADirectory
            | ErrorKind::PermissionDenied
            | ErrorKind::ReadOnlyFilesystem
            | ErrorKind::NotFound => Failure::FAILED,
            _ => Failure::TRY_AGAIN,
        },
        CorpusError::OtherPlan { .. } | CorpusError::ForeignPlan { .. } | CorpusError::BeyondPlan { .. } => {
            Failure::USAGE
        }
        _ => Failure::FAILED,
    };
    Failure::new(code, miette::Report::msg(error.to_string()))
}

pub(super) fn run(args: &GenerateArgs, log: LogFormat) -> Result<(), Failure> {
    let (plan, corpus) = plan_of(&args.config.config, &args.config.sets)?;
    let default_out = || corpus.map_or_else(|| PathBuf::from("corpora").join(&plan.name), Path::to_path_buf);
    let out = args.out.clone().unwrap_or_else(default_out);
    let selected = selected_shards(args, &plan)?;
    let spec = spec_of(&plan);
    let store = LocalFolder::new(&out);
    let place = Place::open(&store, &spec).map_err(corpus_failure)?;
    for file in &plan.files {
        let bytes = std::fs::read(&file.from).map_err(|e| Failure::failed(format!("{}: {e}", file.from.display())))?;
        store.put(&file.path, &bytes).map_err(corpus_failure)?;
    }
    if args.plan_only {
        tell_plan_laid(&plan, &out, log);
        return Ok(());
    }
    let status = corpus::status_of(&store, &spec, &selected).map_err(corpus_failure)?;
    for (shard, reason) in &status.damaged {
        tracing::warn!("shard {shard} is damaged and is built anew: {reason}");
        place.discard(*shard).map_err(corpus_failure)?;
    }
    let shards = status.to_build();
    tell_start(&plan, &out, selected.len(), &shards, args.threads, log);

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
        |shard, outputs| write_shard(&spec, &store, shard, &outputs),
    );
    progress.finish();
    let outcome = build_outcome(outcome, |scene| replay_command(&args.config, scene))?;
    if args.shards.is_none() {
        let report = report(&progress, writing, args.threads);
        store.replace("report.json", format!("{report:#}\n").as_bytes()).map_err(corpus_failure)?;
    }
    if outcome == Outcome::Interrupted {
        return Err(Failure::new(Failure::TRY_AGAIN, interrupted()));
    }
    if args.shards.is_some() {
        tell_part_end(&store.place(), &selected, &progress, log);
        return Ok(());
    }
    let manifest = corpus::finalize(&store, &spec).map_err(corpus_failure)?;
    tell_end(&manifest, &store.place(), &progress, writing, log);
    judge_failures(&prepared.plan, &manifest)
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

/// The shards that were asked for, ascending.
fn selected_shards(args: &GenerateArgs, plan: &Plan) -> Result<Vec<u64>, Failure> {
    let Some(selection) = &args.shards else { return Ok((0..plan.shards()).collect()) };
    selection.of(plan.shards()).map_err(|why| Failure::usage(miette::miette!("--shards {why}")))
}

fn tell_plan_laid(plan: &Plan, out: &Path, log: LogFormat) {
    if log == LogFormat::Json {
        tracing::info!(event = "plan_laid", corpus = %out.display(), shards = plan.shards());
        return;
    }
    eprintln!(
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
    eprintln!(
        "{} -> {}: {} of {selected} shards to build, {} scenes each{resumed}; {threads} threads",
        plan.name,
        out.display(),
        shards.len(),
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
        eprintln!("{place}: this part has no shards, there are more parts than shards");
    } else {
        eprintln!("{place}: shards {shards} are there{failed}; when all are: marsyard finalize {place}");
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
        .map(|f| format!("scene {}: {}; replay, in the corpus folder: {}", f.scene, f.error, f.replay))
        .unwrap_or_default();
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
