//! Trains a network on finished corpora, or goes on where a training was interrupted.
//!
//! The verb opens what was named, calls `train`, has the model judged on the test splits, and says what came of it: the
//! most important lines last, the rest is in the run folder's files.

mod failure;
mod tell;

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use failure::interrupted;
pub(super) use failure::{goes_on, train_failure};
use tell::{tell_course, tell_end};

use super::evaluate::{model_file, read_model};
use super::options::{default_threads, labels_set, parse_threads};
use super::output::out;
use super::place::{self, check_folder, corpus_failure, must_be_local};
use super::progress::TrainProgress;
use super::signals::stop_on_signals;
use super::{Failure, LogFormat, config_failure};
use crate::config;
use crate::corpus::limits::FileKind;
use crate::corpus::{Build, LocalFolder, Split};
use crate::evaluate::{Brief, EvaluateError, FamilyFacts, Options, evaluate_into, evaluation_folder};
use crate::plan::Plan;
use crate::train::corpora::{self, CorpusToLearn, unknown_yards};
use crate::train::numbered::numbered;
use crate::train::run::Init;
use crate::train::{Outcome, Setup, Source, TrainParams, folder, train};

#[derive(Debug, Args)]
pub(super) struct TrainArgs {
    /// Folders or URLs of finished corpora, learnt together; with :WEIGHT behind it, a row of that corpus counts so many times.
    #[arg(required = true, value_name = "CORPUS[:WEIGHT]", value_parser = parse_corpus)]
    corpora: Vec<(PathBuf, f64)>,
    /// A training config (YAML), such as configs/train/paper.yaml; default: all defaults.
    #[arg(long)]
    config: Option<PathBuf>,
    /// The run folder, which must not be there yet; default: runs/<corpus>-1, or the next free number.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Override a key: --set network.hidden=[8] (repeatable).
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Go on in the run folder where training was interrupted; begin where nothing is there; write again what a finished run
    /// lacks. Default --out: the last number.
    #[arg(long)]
    resume: bool,
    /// Start from a trained network (a model.safetensors or its run folder) and, where it is beside it, its filter.safetensors.
    #[arg(long, value_name = "MODEL")]
    init: Option<PathBuf>,
    /// Labels for another rover: taller_than_wheel=DIAMETER_M, taller_than_m=X, all or as_built; then, with commas,
    /// min_obstacle_points=N, max_ground_slope_deg=X and max_drop_m=X; or min_margin_m=X alone, where a rover labelled the corpus; or the whole key: '{obstacle: {taller_than_m: 0.2}}'.
    #[arg(long, value_name = "RULE")]
    labels: Option<String>,
    /// Of initial weights and of the order of rows; short for --set seed=N.
    #[arg(long)]
    seed: Option<u64>,
    /// Learn also from corpora that have a yard in common in other splits, or the same rows twice; told, and kept in training.json.
    #[arg(long)]
    allow_shared_scenes: bool,
    /// Threads that learn (batches) and look at the validation split; never changes a bit.
    #[arg(long, default_value_t = default_threads(), value_parser = parse_threads)]
    threads: usize,
    /// Windows of eight row groups read ahead; never changes a bit.
    #[arg(long, default_value_t = 1, value_name = "WINDOWS", hide_short_help = true)]
    prefetch: usize,
}

/// `corpora/mixed:0.5`; a path that holds a colon itself needs a weight behind it.
fn parse_corpus(text: &str) -> Result<(PathBuf, f64), String> {
    match text.rsplit_once(':').map(|(path, weight)| (path, weight.parse::<f64>())) {
        Some((path, Ok(weight))) if !path.is_empty() => {
            if weight > 0.0 && weight.is_finite() {
                Ok((path.into(), weight))
            } else {
                Err(format!("the weight {weight} is not a positive number"))
            }
        }
        _ => Ok((text.into(), 1.0)),
    }
}

impl TrainArgs {
    fn params(&self) -> Result<TrainParams, Failure> {
        let mut sets = self.sets.clone();
        sets.extend(self.labels.as_deref().map(labels_set).transpose()?);
        sets.extend(self.seed.map(|seed| format!("seed={seed}")));
        config::load_train(self.config.as_deref(), &sets).map_err(config_failure)
    }
}

pub(super) fn run(args: &TrainArgs, log: LogFormat) -> Result<(), Failure> {
    let params = args.params()?;
    args.out.iter().try_for_each(|out| must_be_local("--out", out))?;
    let corpora: Vec<CorpusToLearn> = args.corpora.iter().map(open_corpus).collect::<Result<_, _>>()?;
    let out = run_folder(args.out.as_deref(), &corpora[0].source.name, args.resume)?;
    let tests: Vec<TestSplit> = corpora.iter().map(|corpus| TestSplit::of(&corpus.plan)).collect();
    let init = args.init.as_deref().map(read_init).transpose()?;
    let before = init.as_ref().map(|init| &init.model);
    let joined = corpora::join(corpora, &params, before, args.allow_shared_scenes).map_err(train_failure)?;
    if let Some(of) = before.map(unknown_yards).filter(|names| !names.is_empty()) {
        let of = of.join(", ");
        tracing::warn!(
            "whether the network of --init learnt from scenes of these corpora cannot be said: nothing is known of the yards of {of}"
        );
    }
    joined.sources.shared_scenes.iter().for_each(|leak| tracing::warn!("{leak}"));
    if let Some([rule, cure]) = &joined.unlike_labels {
        tracing::warn!("{rule}; {cure}");
    }
    let setup = Setup {
        config_yaml: config::train_yaml(&params),
        params,
        sources: joined.sources,
        origin: joined.origin,
        out,
        resume: args.resume,
        init,
        ahead: args.prefetch,
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build_global()
        .map_err(|error| Failure::new(Failure::TRY_AGAIN, miette::Report::msg(error.to_string())))?;
    let stop = stop_on_signals()?;
    let mut progress = TrainProgress::new(&setup, log);
    let outcome = train(&setup, &stop, &mut |event| progress.take(&event));
    progress.finish();
    let goes_on = |failure| goes_on(failure, &setup.out);
    match outcome.map_err(train_failure).map_err(goes_on)? {
        Outcome::Interrupted { rows } => Err(Failure::new(Failure::TRY_AGAIN, interrupted(&setup, rows))),
        Outcome::Done(summary, run) => {
            run.report(progress.rows_here() == 0, &times(&progress, args)).map_err(train_failure).map_err(goes_on)?;
            tell_course(&setup.out, &summary, &progress, log);
            let judged = evaluate_on_test(args, &setup, &tests, log);
            tell_end(args, &setup, &summary, log);
            judged.map_err(goes_on)
        }
    }
}

/// A corpus to learn from, with the weight behind it.
fn open_corpus((path, weight): &(PathBuf, f64)) -> Result<CorpusToLearn, Failure> {
    check_folder(path)?;
    let source = open_source(path, *weight)?;
    Ok(CorpusToLearn { place: path.display().to_string(), source, plan: place::finished_plan(path)? })
}

/// The run folder that was named, or the next one of that name below `runs`.
pub(super) fn run_folder(out: Option<&Path>, name: &str, resume: bool) -> Result<PathBuf, Failure> {
    match out {
        Some(out) => Ok(out.into()),
        None => numbered(Path::new("runs"), name, resume).map_err(corpus_failure),
    }
}

/// A finished corpus to learn from, and a word of what could not be checked of it.
pub(super) fn open_source(corpus: &Path, weight: f64) -> Result<Source, Failure> {
    let source = Source::open(place::open(corpus)?.as_ref(), weight).map_err(train_failure)?;
    source.unchecked.iter().for_each(|what| tracing::warn!("{what}"));
    Ok(source)
}

/// A model file, or the one in a run folder; and the filter's memory beside it.
fn read_init(path: &Path) -> Result<Init, Failure> {
    let file = model_file(path);
    let model = read_model(&file)?;
    let beside = file.with_file_name(folder::FILTER);
    let filter = if place::is_file(&beside)? { Some(place::read(&beside, FileKind::Checkpoint)?) } else { None };
    Ok(Init { path: file.display().to_string(), model, filter })
}

/// What judging on a corpus's test split needs to know of its plan.
struct TestSplit {
    families: Vec<FamilyFacts>,
    yards: Vec<String>,
}

impl TestSplit {
    fn of(plan: &Plan) -> TestSplit {
        TestSplit { families: FamilyFacts::of(plan), yards: plan.yards() }
    }
}

/// Judges the model on the test split of each corpus, and says the first of each judgement.
fn evaluate_on_test(args: &TrainArgs, setup: &Setup, tests: &[TestSplit], log: LogFormat) -> Result<(), Failure> {
    let (model, store, all) = (read_model(&setup.out)?, LocalFolder::new(&setup.out), &setup.sources.list);
    for (((path, _), source), test) in args.corpora.iter().zip(all).zip(tests) {
        let options = Options {
            labels: setup.params.labels.clone(),
            allow_shared_scenes: args.allow_shared_scenes,
            yards: test.yards.clone(),
            ..Options::of(Split::Test)
        };
        let below = evaluation_folder(source, all);
        match evaluate_into(&store, &below, &model, place::open(path)?.as_ref(), &test.families, &options) {
            Ok(report) if log == LogFormat::Text => out!("\n{}", Brief(&report)),
            Ok(_) => {}
            Err(error @ EvaluateError::EmptySplit { .. }) => tracing::warn!("not judged: {error}"),
            Err(EvaluateError::Corpus(error)) => return Err(corpus_failure(error)),
            Err(error) => return Err(Failure::failed(error)),
        }
    }
    Ok(())
}

/// Times and rates, which are no part of what a training is.
fn times(progress: &TrainProgress, args: &TrainArgs) -> serde_json::Value {
    json!({
        "wall_s": progress.elapsed().as_secs_f64(),
        "rows_learnt_by_this_process": progress.rows_here(),
        "rows_per_s": progress.rate(),
        "threads": args.threads,
        "prefetch": args.prefetch,
        "build": Build::of_this_binary(),
    })
}

#[cfg(test)]
mod tests;
