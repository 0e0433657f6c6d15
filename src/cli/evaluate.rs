//! Judges a model on a split of a corpus: a table for people or JSON for machines, and figures.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::Failure;
use super::operating_point::PointArgs;
use super::options::rule_mapping;
use super::output::{errln, out};
use super::place::{self, check_folder, corpus_failure};
use crate::cells::LabelRule;
use crate::corpus::limits::FileKind;
use crate::corpus::store::may_pass;
use crate::corpus::{Outputs, Split, address};
use crate::evaluate::{self, EvaluateError, FamilyFacts, Options, Report};
use crate::train::{Model, ModelError, folder};

#[derive(Debug, Args)]
pub(super) struct EvaluateArgs {
    /// A trained model: the model.safetensors of a run folder, or the folder, or a URL of either.
    model: PathBuf,
    /// Folder or URL of a finished corpus.
    corpus: PathBuf,
    /// Which cells to judge on.
    #[arg(long, value_enum, default_value_t = SplitName::Test)]
    split: SplitName,
    /// Judge the scenes of this family alone, such as the one held out (repeatable); thresholds are still chosen on the
    /// validation split of all.
    #[arg(long = "family", value_name = "NAME")]
    families: Vec<String>,
    /// Labels for another rover, from the truth columns: --labels taller_than_m=0.2, or '{obstacle: {taller_than_m: 0.2}}'.
    #[arg(long, value_parser = parse_rule, value_name = "RULE")]
    labels: Option<LabelRule>,
    #[command(flatten)]
    point: PointArgs,
    /// Judge also on scenes that the model learnt from or was stopped by; the report says so.
    #[arg(long)]
    allow_shared_scenes: bool,
    /// Print JSON in place of the table.
    #[arg(long)]
    json: bool,
    /// Write evaluation.json and the figures (SVG) into this folder, or to this URL.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SplitName {
    Train,
    Validation,
    Test,
}

fn parse_rule(text: &str) -> Result<LabelRule, String> {
    let mapping = rule_mapping(text).map_err(|failure| failure.report.to_string())?;
    let rule: LabelRule = serde_saphyr::from_str(&mapping).map_err(|e| e.to_string())?;
    garde::Validate::validate(&rule).map_err(|e| e.to_string())?;
    rule.check_answerable().map_err(|e| e.to_string())?;
    Ok(rule)
}

/// The model's file, for it or for the run folder that holds it.
pub(super) fn model_file(path: &Path) -> PathBuf {
    let is_model = path.extension().is_some_and(|end| end == "safetensors");
    // What cannot be asked now is met again when it is read.
    let is_folder = match std::fs::metadata(path) {
        _ if address::is_url(path) => !is_model,
        Ok(facts) => facts.is_dir(),
        Err(error) => !is_model && may_pass(&error),
    };
    if is_folder { path.join(folder::MODEL) } else { path.into() }
}

/// A model from its file, or from the run folder that holds it.
pub(super) fn read_model(path: &Path) -> Result<Model, Failure> {
    let file = model_file(path);
    let model =
        if address::is_url(&file) { Model::load(&place::read(&file, FileKind::Model)?) } else { Model::read(&file) };
    let model = model.map_err(|error| match error {
        ModelError::Io { source, .. } => place::named_failure(&file, source, |source| {
            Failure::usage(miette::miette!(
                help = "give the model.safetensors that `marsyard train` wrote, or its run folder",
                "{}: {}",
                file.display(),
                place::fault_words(&source)
            ))
        }),
        error => Failure::usage(miette::Report::msg(format!("{}: {error}", file.display()))),
    })?;
    if !model.about.is_checked() {
        tracing::warn!(
            "{}: of format {}, which has no checksum: damage would not be noticed",
            file.display(),
            model.about.marsyard_model
        );
    }
    Ok(model)
}

/// What the user gave wrong is usage.
pub(super) fn evaluate_failure(error: EvaluateError) -> Failure {
    match error {
        EvaluateError::Corpus(error) => corpus_failure(error),
        error @ (EvaluateError::Model(_)
        | EvaluateError::Family { .. }
        | EvaluateError::EmptyFamilies { .. }
        | EvaluateError::Shared { .. }
        | EvaluateError::Rule(_)
        | EvaluateError::NoFamily { .. }) => Failure::usage(miette::Report::msg(error.to_string())),
        error => Failure::failed(error),
    }
}

pub(super) fn run(args: &EvaluateArgs) -> Result<(), Failure> {
    check_folder(&args.corpus)?;
    let model = read_model(&args.model)?;
    let open = |out: &PathBuf| Outputs::open(out, [Report::FILE], vec![model_file(&args.model)]);
    let outputs = args.out.as_ref().map(open).transpose().map_err(corpus_failure)?;
    let point = args.point.chosen();
    // A point that the model cannot keep is refused by `evaluate` below.
    let thresholds = model.thresholds(&point).unwrap_or_default();
    args.point.remarks(&model, &thresholds).iter().for_each(|remark| errln!("warning: {remark}"));
    let plan = place::finished_plan(&args.corpus)?;
    let split = match args.split {
        SplitName::Train => Split::Train,
        SplitName::Validation => Split::Validation,
        SplitName::Test => Split::Test,
    };
    let options = Options {
        labels: args.labels.clone(),
        point,
        only_families: args.families.clone(),
        allow_shared_scenes: args.allow_shared_scenes,
        yards: plan.yards(),
        ..Options::of(split)
    };
    let store = place::open(&args.corpus)?;
    let report = evaluate::evaluate(&model, store.as_ref(), &FamilyFacts::of(&plan), &options);
    let report = report.map_err(evaluate_failure)?;
    if let (Some(folder), Some(mut outputs)) = (&args.out, outputs) {
        outputs.write(&report.files()).map_err(corpus_failure)?;
        outputs.finish().map_err(corpus_failure)?;
        errln!("evaluation.json and figures are in {}", folder.display());
    }
    if args.json {
        out!("{}", report.to_json());
    } else {
        out!("{report}");
    }
    Ok(())
}
