//! A trained model, and a corpus that it learnt from -> the judgement on a split of the corpus, written into the run folder.

use std::sync::Arc;

use super::corpus::{EvaluateError, FamilyFacts, Options, evaluate};
use super::report::Report;
use crate::corpus::{LocalFolder, Store};
use crate::train::{Model, Source, folder};

/// Judges a model on a corpus, and writes `evaluation.json` and its figures `below` (a folder's name with `/`, or nothing) the run's
/// folder.
pub(crate) fn evaluate_into(
    run: &LocalFolder,
    below: &str,
    model: &Model,
    corpus: &dyn Store,
    families: &[FamilyFacts],
    options: &Options,
) -> Result<Report, EvaluateError> {
    let report = evaluate(model, corpus, families, options)?;
    // Beside the run's own files a killed one may have left some here.
    run.sweep_temporaries(below.trim_end_matches('/'))?;
    // The store refuses names that leave it, whatever a corpus is called.
    let files = report.files().into_iter().map(|(name, bytes)| (format!("{below}{name}"), bytes));
    folder::write_products(run, &files.collect::<Vec<_>>(), &[])?;
    Ok(report)
}

/// Where in a run folder the judgement on a corpus lies, with `/` behind it: its own folder where there are several corpora, which
/// says more than the name where two have one.
pub(crate) fn evaluation_folder(source: &Source, all: &[Arc<Source>]) -> String {
    if all.len() == 1 {
        return String::new();
    }
    let namesakes = all.iter().filter(|other| other.name == source.name).count();
    let id: String = source.corpus_id.chars().take(12).collect();
    if namesakes == 1 { format!("evaluation/{}/", source.name) } else { format!("evaluation/{}-{id}/", source.name) }
}
