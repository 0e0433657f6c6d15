//! Trains a network on finished corpora, or goes on where a training was interrupted.
//!
//! The verb opens what was named, calls `train`, has the model judged on the test splits, and says what came of it: the
//! most important lines last, the rest is in the run folder's files.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::evaluate::{model_file, read_model};
use super::options::{default_threads, labels_set, parse_threads};
use super::output::{errln, out};
use super::place::{self, StoreFault, check_folder, corpus_failure, must_be_local};
use super::progress::{TrainProgress, human, si};
use super::signals::stop_on_signals;
use super::{Failure, LogFormat, config_failure};
use crate::config;
use crate::corpus::limits::FileKind;
use crate::corpus::{Build, CorpusError, LocalFolder, Split};
use crate::evaluate::{Brief, EvaluateError, FamilyFacts, Options, evaluate_into, evaluation_folder};
use crate::plan::Plan;
use crate::train::corpora::{self, CorpusToLearn, unknown_yards};
use crate::train::filter::{Counters, MOST_WEIGHT};
use crate::train::generalisation::Generalisation;
use crate::train::numbered::numbered;
use crate::train::run::{Init, Summary};
use crate::train::stopping::Stop;
use crate::train::{Outcome, Setup, Source, TrainError, TrainParams, folder, train};

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

/// Storage that fails may work again; what the user gave wrong is usage; everything else will not get better.
pub(super) fn train_failure(error: TrainError) -> Failure {
    let code = match error {
        TrainError::Corpus(error) => return corpus_failure(error),
        TrainError::Io { path, source } => return corpus_failure(CorpusError::of_path(Path::new(&path), source)),
        TrainError::Busy { .. } => Failure::TRY_AGAIN,
        TrainError::SharedScenes { .. } => {
            let help = "give each corpus a seed of its own (--set seed=N), or cut them into shards alike (the same scenes_per_shard), \
                        or learn from one of them; --allow-shared-scenes goes on, and training.json says so";
            return Failure::usage(miette::miette!(help = help, "{error}"));
        }
        TrainError::NoFeature { .. }
        | TrainError::FeatureTwice { .. }
        | TrainError::NoCells { .. }
        | TrainError::Unlike { .. }
        | TrainError::Twice { .. }
        | TrainError::FewRows { .. }
        | TrainError::OneClass { .. }
        | TrainError::NoRowsHeld { .. }
        | TrainError::Exists { .. }
        | TrainError::NoRun { .. }
        | TrainError::OtherRun { .. }
        | TrainError::OtherModel { .. }
        | TrainError::Init { .. }
        | TrainError::Rule(_)
        | TrainError::Filter(_) => Failure::USAGE,
        _ => Failure::FAILED,
    };
    Failure::new(code, miette::Report::msg(error.to_string()))
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
        tracing::warn!(event = "unlike_labels", "{rule}; {cure}");
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

/// Says of what may work another time how a run folder is gone on with.
pub(super) fn goes_on(failure: Failure, out: &Path) -> Failure {
    if failure.code != Failure::TRY_AGAIN {
        return failure;
    }
    let flags = format!("with --resume --out {}", out.display());
    let help = match failure.report.help() {
        Some(help) => format!("{help}: {flags}"),
        None => format!("the same command {flags} goes on from here"),
    };
    // A store's fault stays one, for whoever reads the log.
    match failure.report.downcast::<StoreFault>() {
        Ok(fault) => Failure::new(failure.code, StoreFault { help: Some(help), ..fault }),
        Err(report) => Failure::new(failure.code, miette::miette!(help = help, "{report}")),
    }
}

/// A finished corpus to learn from, and a word of what could not be checked of it.
pub(super) fn open_source(corpus: &Path, weight: f64) -> Result<Source, Failure> {
    let source = Source::open(place::open(corpus)?.as_ref(), weight).map_err(train_failure)?;
    source.unchecked.iter().for_each(|what| tracing::warn!("{what}"));
    Ok(source)
}

fn interrupted(setup: &Setup, rows: u64) -> miette::Report {
    miette::miette!(
        help = format!("the same command with --resume --out {} goes on from here", setup.out.display()),
        "interrupted after {rows} rows: the checkpoint is written"
    )
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

/// For a training that was of no use.
const UNTRAINED: &str = "no look at the validation split was better than the first, before a row was learnt: this network knows \
                         nothing; build more scenes, or be more patient (--set patience=20)";

/// How the training went.
fn tell_course(out: &Path, summary: &Summary, progress: &TrainProgress, log: LogFormat) {
    if log == LogFormat::Json {
        guards(&summary.counters).iter().for_each(|note| tracing::warn!(event = "guard", note));
        return;
    }
    let why = match summary.stopped {
        Stop::Patience => format!("the validation error did not fall by 1 % in {} looks", summary.config.patience),
        Stop::Epochs => "all epochs are over".to_string(),
    };
    let left_out = summary.left_out;
    errln!(
        "{}: {} rows in {} ({} rows/s); {why}",
        out.display(),
        summary.rows_learnt,
        human(progress.elapsed()),
        si(progress.rate())
    );
    if left_out.unlabelled + left_out.not_finite > 0 {
        errln!(
            "left out: {} rows without a label, {} with a value that is not finite",
            left_out.unlabelled,
            left_out.not_finite
        );
    }
    summary.generalisation.iter().for_each(|found| errln!("{}", of_more_scenes(found)));
    guards(&summary.counters).iter().for_each(|note| errln!("{note}"));
}

/// Whether more scenes would still teach.
fn of_more_scenes(found: &Generalisation) -> String {
    let gap = found.gap;
    let percent = |share: f64| 100.0 * share.clamp(0.0, 1.0);
    let [low, most, high] = [gap.mean - gap.half_width, gap.mean, gap.upper()].map(percent);
    let head = "more scenes of these kinds";
    if low > 0.0 {
        format!(
            "{head} would take off up to {most:.0} % of the error ({low:.0} to {high:.0}), for scenes that were learnt are judged so much better"
        )
    } else if found.is_closed() {
        format!("{head} would bring little ({high:.0} % of the error at most): vary the yards instead")
    } else {
        format!("{head}: whether they would bring something cannot be told (up to {high:.0} % of the error)")
    }
}

/// What came of it, last of all: what stands above may have scrolled off.
fn tell_end(args: &TrainArgs, setup: &Setup, summary: &Summary, log: LogFormat) {
    let out = &setup.out;
    let best = summary.best;
    let error = best.validation_error.unwrap_or(f64::NAN);
    let untrained = (best.rows == 0).then_some(UNTRAINED);
    if log == LogFormat::Json {
        untrained.iter().for_each(|note| tracing::warn!(event = "untrained", note));
        let gap = summary.generalisation.map(|found| found.gap.mean);
        tracing::info!(event = "done", run = %out.display(), rows = summary.rows_learnt, best_rows = best.rows, best_validation_error = error, generalisation_gap = gap);
        return;
    }
    let corpora = args.corpora.iter().map(|(path, _)| path.display());
    // Judged by the corpus's own labels it would be another network's task.
    let labels = setup.params.labels.as_ref().and_then(|rule| serde_json::to_string(rule).ok());
    let labels = labels.map_or(String::new(), |rule| format!(" --labels '{rule}'"));
    corpora.for_each(|corpus| errln!("all of it: marsyard evaluate {} {corpus}{labels}", out.display()));
    untrained.iter().for_each(|note| errln!("warning: {note}"));
    errln!(
        "kept the weights after {} rows: validation error {error:.5} (weighted mean squared error)\n{}",
        best.rows,
        out.join(folder::MODEL).display()
    );
}

/// What the filter's guards did, where they were needed.
fn guards(counters: &Counters) -> Vec<String> {
    let mut notes = Vec::new();
    let Counters { rejected, rebuilt, rebuilt_at, factored_at, clipped, cut_back, .. } = *counters;
    if clipped > 0 {
        notes.push(format!("{clipped} of the rows learnt had an input beyond the clip, and were clipped"));
    }
    if rejected > 0 {
        notes.push(format!("the filter rejected {rejected} rows, whose step was not finite"));
    }
    if let Some(at) = rebuilt_at {
        let then = factored_at.map_or(String::new(), |at| format!(", and went on factored after {at} rows"));
        notes.push(format!(
            "rounding spoilt the filter's covariance, the first time after {at} rows: it was rebuilt {rebuilt} times{then}; \
             `robust: true` needs none of it"
        ));
    }
    if cut_back > 0 {
        notes.push(format!("weights outgrew {MOST_WEIGHT:e} and were cut back, {cut_back} times: scale the features"));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::Interval;

    #[test]
    fn exact_corpora_carry_weights_behind_a_colon() {
        assert_eq!(parse_corpus("a/b:0.5"), Ok(("a/b".into(), 0.5)));
        assert_eq!(parse_corpus("a/b"), Ok(("a/b".into(), 1.0)));
        assert_eq!(parse_corpus("a:b/c"), Ok(("a:b/c".into(), 1.0)));
        for wrong in ["a:0", "a:-1", "a:nan", "a:inf"] {
            assert!(parse_corpus(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn law_what_a_machine_is_told_of_a_store_outlives_the_advice_to_resume() {
        let fault = std::io::Error::from_raw_os_error(rustix::io::Errno::IO.raw_os_error());
        let failure = goes_on(corpus_failure(CorpusError::of_path(Path::new("run/model"), fault)), Path::new("run"));
        assert_eq!(failure.code, Failure::TRY_AGAIN);
        let said = failure.report.downcast::<StoreFault>().expect("still a store's fault");
        assert_eq!((said.kind, said.place.as_str()), ("io", "run"));
        assert!(said.help.is_some_and(|help| help.contains("--resume --out run")));
    }

    #[test]
    fn exact_what_more_scenes_would_bring_is_told_as_far_as_it_is_known() {
        let told = |mean, half_width| {
            of_more_scenes(&Generalisation { learnt: 0.01, held_back: 0.02, gap: Interval { mean, half_width } })
        };
        assert!(
            told(0.5, 0.2).contains("would take off up to 50 % of the error (30 to 70), for"),
            "{}",
            told(0.5, 0.2)
        );
        assert!(told(0.02, 0.06).contains("bring little (8 % of the error at most): vary"), "{}", told(0.02, 0.06));
        assert!(told(-0.2, 0.1).contains("(0 % of the error at most)"), "{}", told(-0.2, 0.1));
        // Little, and surely not nothing, is told as what it is.
        assert!(told(0.2, 0.04).contains("up to 20 % of the error (16 to 24)"), "{}", told(0.2, 0.04));
        assert!(told(0.1, 0.3).ends_with("cannot be told (up to 40 % of the error)"), "{}", told(0.1, 0.3));
        assert!(told(0.1, f64::INFINITY).ends_with("cannot be told (up to 100 % of the error)"));
    }

    #[test]
    fn exact_guards_are_told_with_the_time_of_the_first() {
        assert!(guards(&Counters { updates: 9, ..Counters::default() }).is_empty());
        let spoilt = Counters { rebuilt: 2, rebuilt_at: Some(40), factored_at: Some(70), ..Counters::default() };
        let told = guards(&Counters { clipped: 3, rejected: 1, cut_back: 5, ..spoilt });
        assert_eq!(told.len(), 4);
        assert!(
            told[2].contains("after 40 rows: it was rebuilt 2 times, and went on factored after 70"),
            "{}",
            told[2]
        );
    }
}
