//! Why a training ended early -> the exit code, and what helps.
//!
//! In: an error of the training, a failure beside it, or the rows that were learnt until a signal came. Out: a [`Failure`] or the words
//! of one; where the same command may go on, it is told with which flags.

use std::path::Path;

use crate::cli::Failure;
use crate::cli::place::{StoreFault, corpus_failure};
use crate::corpus::CorpusError;
use crate::shell;
use crate::train::{Setup, TrainError};

/// Storage that fails may work again; what the user gave wrong is usage; everything else will not get better.
pub(in crate::cli) fn train_failure(error: TrainError) -> Failure {
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

/// Says of what may work another time how a run folder is gone on with.
pub(in crate::cli) fn goes_on(failure: Failure, out: &Path) -> Failure {
    if failure.code != Failure::TRY_AGAIN {
        return failure;
    }
    let flags = format!("with --resume --out {}", shell::word(out.display()));
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

pub(super) fn interrupted(setup: &Setup, rows: u64) -> miette::Report {
    miette::miette!(
        help = format!("the same command with --resume --out {} goes on from here", shell::word(setup.out.display())),
        "interrupted after {rows} rows: the checkpoint is written"
    )
}
