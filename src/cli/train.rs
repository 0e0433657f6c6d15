//! Trains a network on finished corpora, or goes on where a training was interrupted.
//!
//! The verb ties configs and corpora to the training loop, and talks. All that is learnt from is in the run folder's files;
//! times go to `report.json` and `training.jsonl`.

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use serde_json::json;

use super::evaluate::{family_facts, files_of, model_file, read_model};
use super::leaks::{self, Learnt};
use super::options::{default_threads, labels_set, parse_threads};
use super::output::{errln, out};
use super::place::{self, StoreFault, check_folder, corpus_failure, must_be_local};
use super::progress::{TrainProgress, human, si};
use super::signals::stop_on_signals;
use super::{Failure, LogFormat, config_failure};
use crate::config::{self};
use crate::corpus::limits::FileKind;
use crate::corpus::store::read_folder;
use crate::corpus::{Build, CorpusError, LocalFolder, Split, Store};
use crate::evaluate::{EvaluateError, Options, evaluate};
use crate::train::filter::{Counters, MOST_WEIGHT};
use crate::train::folder::RunFolder;
use crate::train::run::{Init, Origin, Summary};
use crate::train::{Model, Outcome, Setup, Source, Sources, TrainError, TrainParams, folder, train};

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
    /// Start from a trained network (a model.safetensors or its run folder) and, where it is beside it, its covariance.
    #[arg(long, value_name = "MODEL")]
    init: Option<PathBuf>,
    /// Labels for another rover: taller_than_wheel=DIAMETER_M, taller_than_m=X, all or as_built; then, with commas,
    /// min_obstacle_points=N and max_ground_slope_deg=X; or the whole key: '{obstacle: {taller_than_m: 0.2}}'.
    #[arg(long, value_name = "RULE")]
    labels: Option<String>,
    /// Of initial weights and of the order of rows; short for --set seed=N.
    #[arg(long)]
    seed: Option<u64>,
    /// Learn also from corpora that have a yard in common in other splits, or the same rows twice; told, and kept in training.json.
    #[arg(long)]
    allow_shared_scenes: bool,
    /// Threads that look at the validation split; never changes a bit.
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
        TrainError::NoFeature { .. }
        | TrainError::FeatureTwice { .. }
        | TrainError::NoCells { .. }
        | TrainError::Unlike { .. }
        | TrainError::Twice { .. }
        | TrainError::FewRows { .. }
        | TrainError::NoRowsHeld { .. }
        | TrainError::Exists { .. }
        | TrainError::NoRun { .. }
        | TrainError::OtherRun { .. }
        | TrainError::OtherModel { .. }
        | TrainError::Init { .. }
        | TrainError::Filter(_) => Failure::USAGE,
        _ => Failure::FAILED,
    };
    Failure::new(code, miette::Report::msg(error.to_string()))
}

pub(super) fn run(args: &TrainArgs, log: LogFormat) -> Result<(), Failure> {
    let params = args.params()?;
    args.out.iter().try_for_each(|out| must_be_local("--out", out))?;
    let mut list = Vec::new();
    let mut origins: Vec<(PathBuf, Origin)> = Vec::new();
    let mut learnt: Vec<Learnt> = Vec::new();
    for (path, weight) in &args.corpora {
        check_folder(path)?;
        let mut source = open_source(path, *weight)?;
        let plan = place::finished_plan(path)?;
        if !source.yards.known() {
            source.yards.yards = plan.yards();
        }
        let (place, yards) = (path.display().to_string(), source.yards.clone());
        let shards = source.shards_by_values(Split::Train);
        learnt.push(Learnt { place, yards, rows_hash: plan.rows_hash(), shards });
        origins.push((path.clone(), Origin::of(&plan.families[0])));
        list.push(source);
    }
    let out = args.out.clone().map_or_else(|| numbered_folder(&list[0].name, args.resume), Ok)?;
    let (place, origin) = origins.remove(0);
    for (other, theirs) in &origins {
        check_grids((&place, &origin), (other, theirs))?;
    }
    let mut sources = Sources::new(list, &params.features, params.labels.clone()).map_err(train_failure)?;
    let init = args.init.as_deref().map(read_init).transpose()?;
    if let Some(of) = init.as_ref().and_then(|init| unknown_yards(&init.model)) {
        tracing::warn!(
            "whether the network of --init learnt from scenes of these corpora cannot be said: nothing is known of the yards of {of}"
        );
    }
    sources.shared_scenes = leaks::check(&learnt, init.as_ref().map(|init| &init.model), args.allow_shared_scenes)?;
    let setup = Setup {
        config_yaml: config::train_yaml(&params),
        params,
        sources: Arc::new(sources),
        origin,
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
            write_report(&run, &progress, args).map_err(goes_on)?;
            tell_end(&setup.out, &summary, &progress, log);
            evaluate_on_test(args, &setup, log).map_err(goes_on)
        }
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

/// The corpora that a model learnt from without saying which yards they hold, as those of before format 2.
fn unknown_yards(model: &Model) -> Option<String> {
    let learnt_from = model.about.learnt_from();
    let names: Vec<&str> =
        learnt_from.iter().filter(|corpus| !corpus.yards.known()).map(|corpus| corpus.name.as_str()).collect();
    (!names.is_empty()).then(|| names.join(", "))
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

/// The first free `runs/<name>-1`, `-2`, ...; to resume, the one with the highest number that is there.
pub(super) fn numbered_folder(name: &str, resume: bool) -> Result<PathBuf, Failure> {
    let runs = Path::new("runs");
    let entries = match read_folder(runs) {
        Err(error) if error.kind() == ErrorKind::NotFound => Vec::new(),
        entries => {
            entries.and_then(Iterator::collect).map_err(|error| corpus_failure(CorpusError::of_path(runs, error)))?
        }
    };
    let taken: BTreeSet<u64> =
        entries.iter().filter_map(|entry| number_of(entry.file_name().to_str()?, name)).collect();
    let number = taken.last().copied().filter(|_| resume);
    let number = number.or_else(|| (1..).find(|number| !taken.contains(number))).unwrap_or(1);
    Ok(runs.join(format!("{name}-{number}")))
}

/// The number in `<name>-<number>`, written as marsyard writes it.
fn number_of(entry: &str, name: &str) -> Option<u64> {
    let digits = entry.strip_prefix(name)?.strip_prefix('-')?;
    digits.parse().ok().filter(|number: &u64| *number > 0 && number.to_string() == digits)
}

/// Features mean the same on the same grid only.
fn check_grids((first, ours): (&Path, &Origin), (other, theirs): (&Path, &Origin)) -> Result<(), Failure> {
    let differ = |what: &str, ours: String, theirs: String| {
        if ours == theirs {
            return Ok(());
        }
        Err(Failure::usage(miette::miette!(
            help = "train on corpora with the same grid, or on one of them",
            "{} has cells.{what} {theirs}, {} has {ours}",
            other.display(),
            first.display()
        )))
    };
    differ("size_m", ours.cells.size_m.to_string(), theirs.cells.size_m.to_string())?;
    differ("neighbours", ours.cells.neighbours.to_string(), theirs.cells.neighbours.to_string())?;
    // One that lacks the column is told apart by its features, where they ask for it.
    match (&ours.cells.local_height, &theirs.cells.local_height) {
        (Some(ours), Some(theirs)) => differ("local_height", ours.words(), theirs.words()),
        _ => Ok(()),
    }
}

/// A model file, or the one in a run folder; and the filter's memory beside it.
fn read_init(path: &Path) -> Result<Init, Failure> {
    let file = model_file(path);
    let model = read_model(&file)?;
    let beside = file.with_file_name(folder::FILTER);
    let filter = if place::is_file(&beside)? { Some(place::read(&beside, FileKind::Checkpoint)?) } else { None };
    Ok(Init { path: file.display().to_string(), model, filter })
}

/// Judges the model on the test split of each corpus: `evaluation.json` and its figures, in a folder of their own for each where there
/// are several corpora.
fn evaluate_on_test(args: &TrainArgs, setup: &Setup, log: LogFormat) -> Result<(), Failure> {
    let (model, store) = (read_model(&setup.out)?, LocalFolder::new(&setup.out));
    for ((path, _), source) in args.corpora.iter().zip(&setup.sources.list) {
        let plan = place::finished_plan(path)?;
        let options = Options {
            labels: setup.params.labels.clone(),
            allow_shared_scenes: args.allow_shared_scenes,
            yards: plan.yards(),
            ..Options::of(Split::Test)
        };
        let report = match evaluate(&model, place::open(path)?.as_ref(), &family_facts(&plan), &options) {
            Ok(report) => report,
            Err(error @ EvaluateError::EmptySplit { .. }) => {
                tracing::warn!("not judged: {error}");
                continue;
            }
            Err(EvaluateError::Corpus(error)) => return Err(corpus_failure(error)),
            Err(error) => return Err(Failure::failed(error)),
        };
        let below = evaluation_folder(source, &setup.sources.list);
        // Beside the run's own files a killed one may have left some here.
        store.sweep_temporaries(below.trim_end_matches('/')).map_err(corpus_failure)?;
        // The store refuses names that leave it, whatever a corpus is called.
        let files = files_of(&report)?.into_iter().map(|(name, bytes)| (format!("{below}{name}"), bytes));
        folder::write_products(&store, &files.collect::<Vec<_>>(), &[]).map_err(corpus_failure)?;
        if log == LogFormat::Text {
            out!("{report}");
        }
    }
    Ok(())
}

/// Where in a run folder the judgement on a corpus lies, with `/` behind it: its own folder where there are several corpora, which
/// says more than the name where two have one.
fn evaluation_folder(source: &Source, all: &[Arc<Source>]) -> String {
    if all.len() == 1 {
        return String::new();
    }
    let namesakes = all.iter().filter(|other| other.name == source.name).count();
    let id: String = source.corpus_id.chars().take(12).collect();
    if namesakes == 1 { format!("evaluation/{}/", source.name) } else { format!("evaluation/{}-{id}/", source.name) }
}

/// Times and rates, which are no part of what a training is.
fn write_report(run: &RunFolder, progress: &TrainProgress, args: &TrainArgs) -> Result<(), Failure> {
    let report = json!({
        "wall_s": progress.elapsed().as_secs_f64(),
        "rows_learnt_by_this_process": progress.rows_here(),
        "rows_per_s": progress.rate(),
        "threads": args.threads,
        "prefetch": args.prefetch,
        "build": Build::of_this_binary(),
    });
    if progress.rows_here() == 0 && run.holds(folder::REPORT).map_err(train_failure)? {
        return Ok(());
    }
    run.write(folder::REPORT, format!("{report:#}\n").as_bytes()).map_err(train_failure)
}

/// For a training that was of no use.
const UNTRAINED: &str = "no look at the validation split was better than the first, before a row was learnt: this network knows \
                         nothing; build more scenes, or be more patient (--set patience=20)";

fn tell_end(out: &Path, summary: &Summary, progress: &TrainProgress, log: LogFormat) {
    let best = summary.best;
    let error = best.validation_error.unwrap_or(f64::NAN);
    let untrained = (best.rows == 0).then_some(UNTRAINED);
    if log == LogFormat::Json {
        untrained.iter().for_each(|note| tracing::warn!(event = "untrained", note));
        guards(&summary.counters).iter().for_each(|note| tracing::warn!(event = "guard", note));
        tracing::info!(event = "done", run = %out.display(), rows = summary.rows_learnt, best_rows = best.rows, best_validation_error = error);
        return;
    }
    let why = match summary.stopped {
        crate::train::stopping::Stop::Patience => {
            format!("no better validation error for {} looks", summary.config.patience)
        }
        crate::train::stopping::Stop::Epochs => "all epochs are over".to_string(),
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
    guards(&summary.counters).iter().for_each(|note| errln!("{note}"));
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
    fn exact_a_run_s_number_is_read_as_it_is_written() {
        let numbers = ["a-1", "a-12", "a-0", "a-01", "a-x", "a-b-3", "a", "b-2"].map(|entry| number_of(entry, "a"));
        assert_eq!(numbers, [Some(1), Some(12), None, None, None, None, None, None]);
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
