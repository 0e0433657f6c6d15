//! Measures what each choice between speed and accuracy costs, what error it brings, and what it is worth at equal CPU time.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;

use super::options::{default_threads, parse_positive, parse_threads};
use super::output::{errln, out};
use super::place::{corpus_failure, inputs, must_be_local};
use super::progress::TradeoffProgress;
use super::signals::stop_on_signals;
use super::{ConfigArgs, Failure, LogFormat, config_failure};
use crate::corpus::Outputs;
use crate::measure::study::Study;
use crate::measure::tradeoff::{self, Group, Options, Report, TradeoffError, chart, records, table};
use crate::plan::Plan;

/// The fewest scenes of which four sizes can train and stop a classifier.
const LEAST_SCENES: u64 = 8;
/// The fewest scenes that have a spread.
const LEAST_TEST_SCENES: u64 = 2;

#[derive(Debug, Args)]
pub(super) struct TradeoffArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Scenes to make at every setting: 5 in 6 train the classifiers, 1 in 6 stops them; curves are measured at an eighth, a quarter, a half
    /// and all of them. Their cells are held in memory: 4 MB a scene for configs/paper.yaml.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(LEAST_SCENES..=100_000))]
    scenes: u64,
    /// Scenes to judge every classifier on, of another seed: so many of the config's own kinds, and so many of each held-out family.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(LEAST_TEST_SCENES..=100_000))]
    test_scenes: u64,
    /// Turn these knobs only: --only cast,slam. The reference, and the same with other draws, are always measured.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "GROUPS")]
    only: Vec<Group>,
    /// The most promising combinations of knobs to measure beside single ones: of each group the setting that gained most may take part.
    #[arg(long, default_value_t = 4, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(0..=100))]
    combinations: u64,
    /// Measure what is recommended or told better of the pipeline, three settings at most, and the reference on so many times the scenes as well, so
    /// that `plan --hours` knows where curves end, and what is better there too. It takes the time and the memory of up to four settings times
    /// that, and --minutes does not bound it; 1 leaves it out.
    #[arg(long, default_value_t = 8, value_name = "TIMES", value_parser = clap::value_parser!(u64).range(1..=1000))]
    farther: u64,
    /// Trainings of each classifier at each size, with other first weights, orders of the rows and, at the smaller sizes, scenes.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Go on with rounds of as many other trainings and test scenes until each gain that may be the best is known to so many points of balanced
    /// accuracy (half of its 95 % interval): --resolve 0.3.
    #[arg(long, value_name = "POINTS", value_parser = parse_positive)]
    resolve: Option<f64>,
    /// Begin no further round that would end later than this, counted from the start. Without --resolve: as many rounds as there is time
    /// for. The first round is always finished; an interrupt after it writes what there is.
    #[arg(long, value_name = "MINUTES", value_parser = parse_positive)]
    minutes: Option<f64>,
    /// Folder for tradeoff.parquet, tradeoff.json, tradeoff.md, tradeoff.svg and study.json; default: tradeoffs/<name>, where `plan --hours` looks
    /// for the study.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Threads; times are CPU times of a thread, and all else, but which combinations look promising, is the same for any number.
    #[arg(long, default_value_t = default_threads(), value_parser = parse_threads)]
    threads: usize,
}

pub(super) fn run(args: &TradeoffArgs, log: LogFormat) -> Result<(), Failure> {
    args.out.iter().try_for_each(|out| must_be_local("--out", out))?;
    let plan = args.config.load()?;
    let out = args.out.clone().unwrap_or_else(|| default_place(&plan));
    let outputs = outputs(&out, &args.config.config)?;
    let stop = stop_on_signals()?;
    let options = Options {
        config: args.config.config.clone(),
        sets: args.config.sets.clone(),
        scenes: args.scenes,
        test_scenes: args.test_scenes,
        only: args.only.clone(),
        combinations: args.combinations as usize,
        farther: args.farther,
        seeds: args.seeds,
        resolve: args.resolve.map(|points| 0.01 * points),
        time: args.minutes.map(|minutes| Duration::from_secs_f64(60.0 * minutes)),
        threads: args.threads,
    };
    let report = measure(&options, log, &stop).map_err(failure)?.ok_or_else(interrupted)?;
    write(&report, outputs)?;
    out!("{}", table::text(&report));
    errln!(
        "\nwritten: {0}/tradeoff.parquet, .json, .md and .svg, and study.json for `marsyard plan --hours`",
        out.display()
    );
    Ok(())
}

/// Measures, and shows how far it is; `None` where it was interrupted.
pub(super) fn measure(options: &Options, log: LogFormat, stop: &AtomicBool) -> Result<Option<Report>, TradeoffError> {
    let mut progress = TradeoffProgress::new(log);
    let report = tradeoff::run(options, stop, &mut |event| progress.take(event));
    progress.finish();
    report
}

pub(super) fn interrupted() -> Failure {
    Failure::new(Failure::TRY_AGAIN, miette::miette!("interrupted: nothing was written"))
}

pub(super) fn failure(error: TradeoffError) -> Failure {
    match error {
        TradeoffError::Config(error) => config_failure(error),
        TradeoffError::NoSetting { .. } => Failure::usage(miette::Report::msg(error.to_string())),
        TradeoffError::Threads(_) => Failure::new(Failure::TRY_AGAIN, miette::Report::msg(error.to_string())),
        other => Failure::failed(other),
    }
}

const FILES: [&str; 5] = ["tradeoff.parquet", "tradeoff.json", "tradeoff.md", "tradeoff.svg", "study.json"];

/// Where a config's measurement goes, and where `plan --hours` looks for its study.
pub(super) fn default_place(plan: &Plan) -> PathBuf {
    Path::new("tradeoffs").join(&plan.name)
}

/// Takes the place before anything is measured.
pub(super) fn outputs(place: &Path, config: &Path) -> Result<Outputs, Failure> {
    Outputs::open(place, FILES, inputs(config)).map_err(corpus_failure)
}

pub(super) fn write(report: &Report, mut outputs: Outputs) -> Result<(), Failure> {
    let bytes = [
        Some(records::parquet(report).map_err(Failure::failed)?),
        Some(format!("{:#}\n", serde_json::json!(report)).into_bytes()),
        Some(table::markdown(report).into_bytes()),
        chart::svg(report).map(String::into_bytes),
        Study::of(report).map(|study| format!("{:#}\n", serde_json::json!(study)).into_bytes()),
    ];
    let files = FILES.into_iter().zip(bytes).filter_map(|(name, bytes)| Some((name.to_string(), bytes?)));
    outputs.write(&files.collect::<Vec<_>>()).map_err(corpus_failure)?;
    outputs.finish().map_err(corpus_failure)
}
