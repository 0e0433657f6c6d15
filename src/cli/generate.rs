//! Builds a corpus, or goes on where an earlier run stopped.
//!
//! The verb says what to build and where, and tells what happens; the work, and why a build can be gone on with, is `build::generate`'s.

use std::path::{Path, PathBuf};

use clap::Args;

use super::build::{build_failure, interrupted, judge_corpus};
use super::options::{default_out, default_threads, parse_threads, plan_of, split_warnings, typed_sets};
use super::output::errln;
use super::place::{self, config_file, corpus_failure, inputs};
use super::progress::{BuildProgress, counted, human, si};
use super::signals::stop_on_signals;
use super::{ConfigArgs, Failure, LogFormat};
use crate::build::{self, CorpusEvent, Generate, Generated, KEEP_FREE_BYTES, Tally, Whole};
use crate::corpus::{Selection, owner, ranges};
use crate::plan::Plan;
use crate::shell;

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
    #[arg(long, value_name = "MB", default_value_t = KEEP_FREE_BYTES / 1_000_000)]
    keep_free_mb: u64,
    /// Add a line of JSON to FILE for each scene of a whole shard, with the hashes of its stages' f64 results: what the f32 columns of two
    /// builds would hide.
    #[arg(long, value_name = "FILE")]
    stage_hashes: Option<PathBuf>,
}

pub(super) fn run(args: &GenerateArgs, log: LogFormat) -> Result<(), Failure> {
    let (plan, corpus) = plan_of(&args.config.config, &args.config.sets)?;
    let default_out = || corpus.map_or_else(|| default_out(&plan), Path::to_path_buf);
    let out = args.out.clone().unwrap_or_else(default_out);
    let replay = |scene| replay_command(&args.config, scene);
    // Before anything is opened: a part that there is not has no place.
    build::selected_shards(&plan, args.shards.as_ref()).map_err(|error| build_failure(error, &replay))?;
    if let Some(file) = &args.stage_hashes {
        owner::check_file(file, &inputs(&args.config.config), build::is_stage_hashes).map_err(corpus_failure)?;
    }
    let store = place::open(&out)?;
    let how = Generate {
        selection: args.shards.as_ref(),
        plan_only: args.plan_only,
        discard_beyond: args.discard_beyond,
        threads: args.threads,
        keep_free_bytes: args.keep_free_mb.saturating_mul(1_000_000),
        stage_hashes: args.stage_hashes.as_deref(),
    };
    let stop = stop_on_signals()?;
    let mut progress = BuildProgress::new(log, store.place(), &replay);
    let generated = build::generate(&plan, store.as_ref(), &how, &stop, &mut |event| match event {
        CorpusEvent::Start { selected, shards } => tell_start(&plan, &out, selected, shards, args.threads, log),
        CorpusEvent::Discarded { shards } => tell_discarded(shards, &out, log),
        event => progress.take(&event),
    });
    progress.finish();
    match generated.map_err(|error| build_failure(error, &replay))? {
        Generated::Plan => tell_plan_laid(&plan, &out, log),
        Generated::Interrupted => return Err(interrupted()),
        Generated::Part { shards, tally } => tell_part_end(&store.place(), &shards, &tally, log),
        Generated::Whole(whole) => {
            let verdict = judge_corpus(&plan, &whole.manifest);
            let all_failed = whole.manifest.failed.len() as u64 == whole.manifest.scenes;
            tell_end(&whole, &store.place(), args.threads, verdict.is_ok() && !all_failed, log);
            return verdict;
        }
    }
    Ok(())
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
        shell::word(out.display())
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
        "{} -> {}: {} of {selected} shards to build, {} each{resumed}; {}",
        plan.name,
        out.display(),
        shards.len(),
        counted(u64::from(plan.scenes_per_shard), "scene"),
        counted(threads as u64, "thread")
    );
    split_warnings(plan).iter().for_each(|warning| errln!("warning: {warning}"));
}

/// The command that replays one scene, as it would be typed here.
fn replay_command(config: &ConfigArgs, scene: u64) -> String {
    let sets = typed_sets(&config.sets);
    // Of a corpus its plan: while it is built the corpus itself is refused.
    let file = config_file(&config.config);
    format!("marsyard explain {} --scene {scene}{sets}", shell::word(file.display()))
}

/// The end of a part: whether too many scenes failed is judged over the whole corpus, by `finalize`.
fn tell_part_end(place: &str, selected: &[u64], tally: &Tally, log: LogFormat) {
    let shards = ranges::to_text(selected);
    if log == LogFormat::Json {
        tracing::info!(
            event = "part_done",
            corpus = place,
            shards,
            scenes = tally.done,
            failed = tally.failed,
            cells = tally.rows,
            rays = tally.times.rays()
        );
        return;
    }
    let failed = if tally.failed > 0 { format!(" ({} failed)", counted(tally.failed, "scene")) } else { String::new() };
    if selected.is_empty() {
        errln!("{place}: this part has no shards, there are more parts than shards");
    } else {
        errln!("{place}: shards {shards} are there{failed}; when all are: marsyard finalize {}", shell::word(place));
    }
}

fn tell_end(whole: &Whole, place: &str, threads: usize, is_good: bool, log: LogFormat) {
    let Whole { manifest, tally } = whole;
    let labels = manifest.labels();
    let cells = labels.traversable + labels.untraversable;
    let share = 100.0 * labels.untraversable as f64 / cells.max(1) as f64;
    let bytes: u64 = manifest.tables.values().map(|t| t.bytes).sum();
    if log == LogFormat::Json {
        tracing::info!(event = "done", corpus = place, corpus_id = %manifest.corpus_id, scenes = manifest.scenes, failed = manifest.failed.len(), cells, bytes);
        return;
    }
    if tally.done > 0 {
        errln!(
            "built {} in {}: {} rays ({} rays/s), {} rows/s, writing {:.1} % of the threads' time",
            counted(tally.done, "scene"),
            human(tally.elapsed()),
            si(tally.times.rays() as f64),
            si(tally.per_second(tally.times.rays())),
            si(tally.per_second(tally.rows)),
            100.0 * tally.writing_share(threads)
        );
    }
    errln!(
        "{place}: {} ({} failed), {cells} cells, {share:.1} % untraversable, {}B\ncorpus_id {}",
        counted(manifest.scenes, "scene"),
        manifest.failed.len(),
        si(bytes as f64),
        manifest.corpus_id
    );
    if is_good {
        errln!("next: marsyard inspect {}", shell::word(place));
    }
}
