//! A model, a corpus and how to judge -> the report, or why there is none.
//!
//! Whether the model may be judged on these scenes is known before a row is read. Columns that only some corpora have (truth, height
//! difference) may be missing; those that the model needs may not.

use std::collections::BTreeMap;

use super::judge::Judge;
use super::reading::Reader;
use super::report::{DataFacts, Report};
use super::threshold::{Threshold, ThresholdOrigin};
use crate::cells::params::{LabelParams, LocalHeightParams, UnseenParams};
use crate::cells::{CellFrame, LabelRule, Unanswerable};
use crate::corpus::{CorpusError, Finished, Split, Store};
use crate::plan::{Family, Plan};
use crate::shell;
use crate::train::{Model, ModelError, OperatingPoint, leaks};

/// What the plan says of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct FamilyFacts {
    pub name: String,
    /// In the test split alone, so that nobody learns from it.
    pub hold_out: bool,
    pub sensor: String,
    pub cell_size_m: f64,
    pub local_height: Option<LocalHeightParams>,
    pub unseen: Option<UnseenParams>,
    pub frame: CellFrame,
    /// Height of its overhang rule, metres.
    pub overhang_m: Option<f64>,
    /// The rule of its labels.
    pub labels: LabelParams,
}

/// How to judge.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    pub split: Split,
    /// Labels by another rule than the corpus's.
    pub labels: Option<LabelRule>,
    /// Where outputs are told apart.
    pub point: OperatingPoint,
    /// Choose a threshold on the validation split, too.
    pub choose: bool,
    /// Judge the scenes of these families alone; empty = all. Thresholds are chosen on all families all the same: one that is held
    /// out has no validation scenes.
    pub only_families: Vec<String>,
    /// Judge also scenes that the model learnt from, and tell it.
    pub allow_shared_scenes: bool,
    /// Hashes of the corpus's kinds of yard, by its plan, for a manifest that does not say them (format 1).
    pub yards: Vec<String>,
}

impl FamilyFacts {
    /// Of each family of a plan.
    pub(crate) fn of(plan: &Plan) -> Vec<FamilyFacts> {
        let facts = |family: &Family| FamilyFacts {
            name: family.name.clone(),
            hold_out: family.hold_out,
            sensor: family.sweep.sensor.name.clone(),
            cell_size_m: family.cells.size_m,
            local_height: family.cells.local_height.clone(),
            unseen: family.cells.unseen.clone(),
            frame: family.cells.frame,
            overhang_m: family.cells.above_m(),
            labels: family.cells.labels.clone(),
        };
        plan.families.iter().map(facts).collect()
    }
}

impl Options {
    pub fn of(split: Split) -> Options {
        Options {
            split,
            labels: None,
            point: OperatingPoint::Model,
            choose: true,
            only_families: Vec::new(),
            allow_shared_scenes: false,
            yards: Vec::new(),
        }
    }
}

/// Why a model could not be judged.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(
        "{place}/{name}: {reason}; run `marsyard verify {}` to see whether the corpus is whole",
        shell::word(place)
    )]
    Table { place: String, name: String, reason: String },
    #[error(
        "{place}: the {split} split holds no cell with a known label; build at least 7 shards, or choose another `--split`"
    )]
    EmptySplit { place: String, split: &'static str },
    #[error(
        "{place}: the {split} split holds no cell with a known label of {families}; choose another `--split` or `--family`"
    )]
    EmptyFamilies { place: String, split: &'static str, families: String },
    #[error("family '{family}': {source}")]
    Family { family: String, source: ModelError },
    #[error("the corpus has no family '{family}'; it has {known}")]
    NoFamily { family: String, known: String },
    #[error(
        "{place}: {leaks}: a model is judged on scenes that it knows nothing of; judge it on another corpus, or say \
         --allow-shared-scenes to have it told in the report"
    )]
    Shared { place: String, leaks: String },
    #[error(transparent)]
    Rule(#[from] Unanswerable),
}

/// Judges a model on a split. `families` may be empty: then nothing is known of sensors and cell sizes.
pub fn evaluate(
    model: &Model,
    store: &dyn Store,
    families: &[FamilyFacts],
    options: &Options,
) -> Result<Report, EvaluateError> {
    options.labels.as_ref().map_or(Ok(()), LabelRule::check_answerable)?;
    for family in families {
        let named = |source| EvaluateError::Family { family: family.name.clone(), source };
        model.check_cell_size(family.cell_size_m).map_err(named)?;
        model.check_local_height(family.local_height.as_ref()).map_err(named)?;
        model.check_unseen(family.unseen.as_ref()).map_err(named)?;
    }
    if let Some(family) = options.only_families.iter().find(|name| families.iter().all(|f| f.name != **name)) {
        let known: Vec<&str> = families.iter().map(|f| f.name.as_str()).collect();
        return Err(EvaluateError::NoFamily { family: family.clone(), known: known.join(", ") });
    }
    let corpus = Finished::open(store)?;
    let manifest = &corpus.manifest;
    let columns: Vec<&str> = manifest.features.iter().map(|feature| feature.name.as_str()).collect();
    model.inputs_of(&columns)?;
    let reader = Reader { model, corpus: &corpus, families, labels: options.labels.as_ref() };
    let mut thresholds = thresholds(model, options)?;
    let mut notes = corpus.unchecked.clone();
    notes.extend(shared_scenes(model, &corpus, options)?);
    notes.extend(other_cells(model, families, &options.only_families));
    let mut height_threshold = None;
    if options.choose {
        let chosen = reader.judge(Split::Validation, &[], Judge::new(Vec::new(), None))?.0.best_thresholds();
        let origin = ThresholdOrigin::Validation;
        thresholds.extend(chosen.map(|(value, _)| Threshold { value, origin }));
        height_threshold = chosen.map(|(_, value)| Threshold { value, origin });
        match chosen {
            None => {
                notes.push("no threshold was chosen: the validation split lacks one of the two classes".to_string())
            }
            Some(_) if options.split == Split::Validation => {
                notes.push("the chosen thresholds were chosen on these very cells: they flatter".to_string());
            }
            Some(_) => {}
        }
    }
    let judge = Judge::new(thresholds, height_threshold).with_probabilities(model, &options.point);
    let (judge, scans) = reader.judge(options.split, &options.only_families, judge)?;
    if judge.groups.is_empty() {
        let (place, split, families) = (store.place(), options.split.name(), options.only_families.join(", "));
        return Err(match families.as_str() {
            "" => EvaluateError::EmptySplit { place, split },
            _ => EvaluateError::EmptyFamilies { place, split, families },
        });
    }
    if !options.only_families.is_empty() {
        notes.push(format!("judged on the scenes of {} alone", options.only_families.join(", ")));
    }
    if options.split == Split::Train {
        notes.push("the model may have learnt these very cells: quote the test split".to_string());
    }
    if options.split == Split::Validation && model.about.corpus_ids.contains(&corpus.manifest.corpus_id) {
        notes.push("the model was stopped by these scenes: quote the test split".to_string());
    }
    if options.labels.is_some() {
        notes.push("labels were derived anew from the truth columns by another rule than the corpus's".to_string());
    }
    notes.extend(model.other_labels(options.labels.as_ref()));
    if judge.not_finite_cells > 0 {
        notes.push(format!("{} cells were left out: a feature is NaN or infinite", judge.not_finite_cells));
    }
    let data = DataFacts {
        name: manifest.name.clone(),
        corpus_id: manifest.corpus_id.clone(),
        split: options.split.name().into(),
        labels: rule_text(families, options.labels.as_ref()),
        scans,
        held_out: families.iter().filter(|family| family.hold_out).map(|family| family.name.clone()).collect(),
        ..DataFacts::default()
    };
    Ok(Report::new(model, &judge, data, notes))
}

/// What is to be told of families whose cells lie in a frame, or were made by an overhang rule, that the model never learnt from.
fn other_cells(model: &Model, families: &[FamilyFacts], only: &[String]) -> Vec<String> {
    let judged: Vec<&FamilyFacts> =
        families.iter().filter(|family| only.is_empty() || only.contains(&family.name)).collect();
    let mut told: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for family in &judged {
        for note in model.other_frame(family.frame).into_iter().chain(model.other_overhang(family.overhang_m)) {
            told.entry(note).or_default().push(&family.name);
        }
    }
    let of_families = |(note, names): (String, Vec<&str>)| {
        if names.len() == judged.len() { note } else { format!("{}: {note}", names.join(", ")) }
    };
    told.into_iter().map(of_families).collect()
}

/// Refuses scenes that the model used more than their split says; what is to be told where that is allowed, or cannot be known.
fn shared_scenes(model: &Model, corpus: &Finished, options: &Options) -> Result<Vec<String>, EvaluateError> {
    let manifest = &corpus.manifest;
    let mut judged = manifest.yards();
    if !judged.known() {
        judged.yards.clone_from(&options.yards);
    }
    let learnt_from = model.about.learnt_from();
    let leaks = leaks::of_judging(("this corpus", &judged), options.split, &learnt_from);
    let mut notes: Vec<String> =
        leaks.iter().map(|leak| format!("{leak}, which the model learnt from or was stopped by")).collect();
    if !notes.is_empty() && !options.allow_shared_scenes {
        return Err(EvaluateError::Shared { place: corpus.store().place(), leaks: notes.join("; ") });
    }
    let unknown = leaks::unknown(&judged, &manifest.corpus_id, &learnt_from);
    if !unknown.is_empty() {
        let of = unknown.join(", ");
        notes.push(format!(
            "whether the model learnt from scenes of this corpus cannot be said: nothing is known of the yards of {of}"
        ));
    }
    Ok(notes)
}

fn thresholds(model: &Model, options: &Options) -> Result<Vec<Threshold>, EvaluateError> {
    let of_model = options.point == OperatingPoint::Model;
    let origin = if of_model { ThresholdOrigin::Model } else { ThresholdOrigin::Given };
    let values = model.thresholds(&options.point)?;
    Ok(values.into_iter().map(|value| Threshold { value, origin }).collect())
}

fn rule_text(families: &[FamilyFacts], rule: Option<&LabelRule>) -> String {
    const PLAIN: &str = "a rule is plain data";
    if let Some(rule) = rule {
        return serde_json::to_string(rule).expect(PLAIN);
    }
    let mut rules: Vec<String> =
        families.iter().map(|family| serde_json::to_string(&family.labels).expect(PLAIN)).collect();
    rules.dedup();
    if rules.is_empty() { "as the corpus has them".into() } else { rules.join(" | ") }
}
