//! Verbs: what was typed -> what happens, and the exit code.
//!
//! Data goes to stdout, talk to stderr. Exit codes: 0 done, 1 failed, 2 bad config or usage, 75 try again (storage,
//! interrupted).

mod build;
mod classify;
mod compare;
mod corpus;
mod evaluate;
mod explain;
mod export;
mod generate;
mod localise;
mod log;
mod operating_point;
mod options;
mod output;
mod place;
mod plan;
mod preview;
mod progress;
mod rebuild;
mod schema;
mod search;
mod sign;
mod signals;
mod tradeoff;
mod train;

use std::any::TypeId;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

use crate::config;
use crate::corpus::owner::RULE;
use crate::cpu;
use crate::plan::Plan;

/// Training corpora for rovers that must see where they can drive.
///
/// From one YAML file marsyard builds random yards, drives rovers through them, scans them with simulated LiDAR, estimates
/// the rover's pose with FastSLAM 2.0, and writes per-cell features and labels as Parquet shards.
#[derive(Debug, Parser)]
#[command(name = "marsyard", version, after_help = START)]
pub(crate) struct Cli {
    /// How to log: for people, or one JSON object a line for machines.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text)]
    log: LogFormat,
    #[command(subcommand)]
    verb: Verb,
}

const START: &str = "\
Start with:  marsyard plan configs/quickstart.yaml   (what would be built, and what it costs)
then:        marsyard generate configs/quickstart.yaml";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LogFormat {
    Text,
    Json,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Check a config; say what it models, and what it costs in time, rows and bytes.
    Plan(plan::PlanArgs),
    /// Build a corpus, or go on where an earlier run stopped (the same command again). More scenes are added to one that is there by
    /// --set scenes=2000 with the same --out: its shards stay byte for byte.
    #[command(after_help = RULE)]
    Generate(generate::GenerateArgs),
    /// Say which shards are done, missing, failed or damaged, as ranges ready for --shards.
    Status(corpus::StatusArgs),
    /// Merge the receipts of all shards (of many machines) into the manifest; refuses gaps.
    #[command(after_help = RULE)]
    Finalize(corpus::PlaceArgs),
    /// Check every shard of a corpus against its manifest: hashes, schema, counts.
    #[command(after_help = RULE)]
    Verify(corpus::VerifyArgs),
    /// Sign a finished corpus (minisign's format), or make a key for it; `verify --key` checks the signature.
    Sign(sign::SignArgs),
    /// Balance of labels, ranges of features, dead features.
    Inspect(corpus::InspectArgs),
    /// Say where two corpora differ, or a corpus and a config: keys of the plans, rows, labels, features, programs, shards.
    #[command(after_help = compare::CODES)]
    Compare(compare::CompareArgs),
    /// Replay one scene and say what was drawn and computed; for a cell, the arithmetic of each feature and label.
    Explain(explain::ExplainArgs),
    /// Pictures (PNG), cloud (PLY) and trajectories (TUM) of one scene.
    #[command(after_help = RULE)]
    Preview(preview::PreviewArgs),
    /// Train a network on finished corpora, or go on where a training was interrupted (--resume).
    #[command(after_help = RULE)]
    Train(train::TrainArgs),
    /// Judge a trained model on a split of a corpus: confusion, Table 1, error against density.
    #[command(after_help = RULE)]
    Evaluate(evaluate::EvaluateArgs),
    Search(Box<search::SearchArgs>),
    /// Write a model for other programs: ONNX, or weights as JSON.
    #[command(after_help = RULE)]
    Export(export::ExportArgs),
    /// Judge real scans: labelled clouds, cells, meshes, pictures and cost maps; with labels, Table 1.
    #[command(after_help = RULE)]
    Classify(Box<classify::ClassifyArgs>),
    /// Run the filter of corpora on one's own recording: odometry, and features or sweeps of a LiDAR, as CSV -> trajectory, covariances,
    /// map; with a truth, how far off they are.
    #[command(after_help = localise::FILES)]
    Localise(Box<localise::LocaliseArgs>),
    /// Measure what each choice between speed and accuracy costs, and the error it brings: a table, Parquet, a chart.
    #[command(after_help = RULE)]
    Tradeoff(tradeoff::TradeoffArgs),
    /// Print what a file that marsyard reads or writes looks like.
    Schema(schema::SchemaArgs),
    /// Print completions for a shell: marsyard completions bash > /etc/bash_completion.d/marsyard
    Completions {
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
}

/// A config and what is changed in it on the command line.
#[derive(Debug, Args)]
struct ConfigArgs {
    /// A corpus config (YAML); or the plan.yaml of a corpus.
    config: PathBuf,
    /// Override a key: --set scene.rocks.count=5 (repeatable).
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
}

impl ConfigArgs {
    fn load(&self) -> Result<Plan, Failure> {
        let (plan, remarks) = config::load_with_remarks(&self.config, &self.sets).map_err(config_failure)?;
        remarks.iter().for_each(|remark| tracing::warn!("warning: {remark}"));
        Ok(plan)
    }
}

/// Why a verb failed, and with which exit code.
#[derive(Debug)]
struct Failure {
    code: u8,
    report: miette::Report,
}

impl Failure {
    const FAILED: u8 = 1;
    const USAGE: u8 = 2;
    const TRY_AGAIN: u8 = 75;

    fn new(code: u8, report: impl Into<miette::Report>) -> Failure {
        Failure { code, report: report.into() }
    }

    /// Bad config or usage.
    fn usage(report: miette::Report) -> Failure {
        Failure { code: Failure::USAGE, report }
    }

    /// What was asked could not be done, and would fail again.
    fn failed(message: impl std::fmt::Display) -> Failure {
        Failure { code: Failure::FAILED, report: miette::Report::msg(message.to_string()) }
    }
}

/// A config that is wrong, or that could not be read for now.
fn config_failure(error: config::ConfigError) -> Failure {
    let code = match (error.untrusted, error.unreachable) {
        (true, _) => Failure::FAILED,
        (_, true) => Failure::TRY_AGAIN,
        _ => Failure::USAGE,
    };
    Failure::new(code, miette::Report::new(error))
}

/// Parses the command line, runs the verb and gives the process its exit code.
pub fn main() -> ExitCode {
    if let Err(failure) = place::refuse_credentials(std::env::args_os()) {
        eprintln!("{:?}", failure.report);
        return ExitCode::from(failure.code);
    }
    let cli = Cli::from_arg_matches(&command().get_matches()).unwrap_or_else(|error| error.exit());
    log::start(cli.log);
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            log::failure(cli.log, &failure);
            ExitCode::from(failure.code)
        }
    }
}

/// Without more said, the parser takes -1 for an option and tells a wrong cure; here an option of one number refuses it with a reason of its own.
fn command() -> clap::Command {
    let numbers =
        [TypeId::of::<f64>(), TypeId::of::<u8>(), TypeId::of::<u32>(), TypeId::of::<u64>(), TypeId::of::<usize>()];
    let told = move |arg: clap::Arg| {
        let takes_value = arg.get_action().takes_values() && !arg.is_positional() && arg.get_num_args().is_none();
        let is_number = numbers.iter().any(|number| arg.get_value_parser().type_id() == *number);
        if takes_value && is_number { arg.allow_hyphen_values(true) } else { arg }
    };
    Cli::command().mut_subcommands(|verb| verb.mut_args(told))
}

fn run(cli: &Cli) -> Result<(), Failure> {
    signals::survive_file_size_limits()?;
    cpu::check_environment().map_err(|e| Failure::usage(miette::Report::msg(e)))?;
    match &cli.verb {
        Verb::Plan(args) => plan::run(args, cli.log),
        Verb::Generate(args) => generate::run(args, cli.log),
        Verb::Status(args) => corpus::status(args),
        Verb::Finalize(args) => corpus::finalize(args),
        Verb::Verify(args) => corpus::verify(args, cli.log),
        Verb::Sign(args) => sign::run(args),
        Verb::Inspect(args) => corpus::inspect(args),
        Verb::Compare(args) => compare::run(args),
        Verb::Explain(args) => explain::run(args),
        Verb::Preview(args) => preview::run(args),
        Verb::Train(args) => train::run(args, cli.log),
        Verb::Evaluate(args) => evaluate::run(args),
        Verb::Search(args) => search::run(args, cli.log),
        Verb::Export(args) => export::run(args),
        Verb::Classify(args) => classify::run(args),
        Verb::Localise(args) => localise::run(args, cli.log),
        Verb::Tradeoff(args) => tradeoff::run(args, cli.log),
        Verb::Schema(args) => {
            schema::run(args);
            Ok(())
        }
        Verb::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut command(), "marsyard", &mut script);
            output::out!("{}", String::from_utf8_lossy(&script));
            Ok(())
        }
    }
}
