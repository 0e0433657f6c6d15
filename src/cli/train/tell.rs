//! The summary of a training -> what is told of it: how it went, and last of all what came of it.
//!
//! In: the summary and the run folder, with times and rates. Out: lines on standard error, or one JSON line for machines with warnings
//! before it. Not here: how far a training is while it runs, and the judgement on the test splits.

use std::path::Path;

use super::TrainArgs;
use crate::cli::LogFormat;
use crate::cli::output::errln;
use crate::cli::progress::{TrainProgress, human, si};
use crate::shell;
use crate::train::filter::{Counters, MOST_WEIGHT};
use crate::train::generalisation::Generalisation;
use crate::train::run::Summary;
use crate::train::stopping::Stop;
use crate::train::{Setup, folder};

/// For a training that was of no use.
const UNTRAINED: &str = "no look at the validation split was better than the first, before a row was learnt: this network knows \
                         nothing; build more scenes, or be more patient (--set patience=20)";

/// How the training went.
pub(super) fn tell_course(out: &Path, summary: &Summary, progress: &TrainProgress, log: LogFormat) {
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
pub(super) fn of_more_scenes(found: &Generalisation) -> String {
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
pub(super) fn tell_end(args: &TrainArgs, setup: &Setup, summary: &Summary, log: LogFormat) {
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
    let corpora = args.corpora.iter().map(|(path, _)| shell::word(path.display()));
    // Judged by the corpus's own labels it would be another network's task.
    let labels = setup.params.labels.as_ref().and_then(|rule| serde_json::to_string(rule).ok());
    let labels = labels.map_or(String::new(), |rule| format!(" --labels {}", shell::quoted(rule)));
    corpora.for_each(|corpus| errln!("all of it: marsyard evaluate {} {corpus}{labels}", shell::word(out.display())));
    untrained.iter().for_each(|note| errln!("warning: {note}"));
    errln!(
        "kept the weights after {} rows: validation error {error:.5} (weighted mean squared error of targets {} and {})\n{}",
        best.rows,
        setup.params.targets[0],
        setup.params.targets[1],
        out.join(folder::MODEL).display()
    );
}

/// What the filter's guards did, where they were needed.
pub(super) fn guards(counters: &Counters) -> Vec<String> {
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
