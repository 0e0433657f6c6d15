//! What can go wrong between a corpus and a network; each message names the place, the rule and the cure.

use super::filter::FilterError;
use super::model::ModelError;
use crate::cells::Unanswerable;
use crate::corpus::CorpusError;
use crate::parallel::PoolError;
use crate::shell;

/// Why a network could not be trained.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    #[error(
        "{place}: `features: seen+unseen` learns cells that hold no point, and the corpus has no column of them; build it with \
         `cells.unseen: {{}}`, or train with `features: full`"
    )]
    NoGaps { place: String },
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    #[error("filter: {0}")]
    Filter(#[from] FilterError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Threads(#[from] PoolError),
    #[error(
        "{place}/{name}: {reason}; it is not the file that its corpus was finalized with: run `marsyard verify {}`, which names \
         the shards to build again",
        shell::word(place)
    )]
    Shard { place: String, name: String, reason: String },
    #[error("{place} holds no table `cells`; build it with `cells` among its tables")]
    NoCells { place: String },
    #[error("{place} has no feature '{feature}'; its features are {known}; choose others with --set features=...")]
    NoFeature { place: String, feature: String, known: String },
    #[error("the feature '{feature}' is named twice; name it once")]
    FeatureTwice { feature: String },
    #[error("{place} and {other} cannot be learnt together: {what}; train on corpora with the same grid and features")]
    Unlike { place: String, other: String, what: String },
    #[error(transparent)]
    Rule(#[from] Unanswerable),
    #[error("{place} is given twice; give it once, with a weight: {place}:2")]
    Twice { place: String },
    #[error(
        "the {split} split holds no row with a label ({shards} shards, {unlabelled} rows without a label, {not_finite} rows with a \
         value that is not finite); a corpus has all three splits from 7 shards on: raise `scenes`, or lower `scenes_per_shard`"
    )]
    NoRows { split: &'static str, shards: u64, unlabelled: u64, not_finite: u64 },
    #[error(
        "the {split} split holds no cell at all, in {shards} shards: its scenes failed, or no sweep of its scenes fell into one; \
         `marsyard inspect` says which, and where the points went: look at the sensor's mount and reach"
    )]
    EmptySplit { split: &'static str, shards: u64 },
    #[error("a scene is in one split, and is learnt from once: {leaks}")]
    SharedScenes { leaks: String },
    #[error(
        "there is no row to {purpose} ({unlabelled} rows without a label, {not_finite} with a value that is not finite); give some"
    )]
    NoRowsHeld { purpose: &'static str, unlabelled: u64, not_finite: u64 },
    #[error(
        "{rows} rows to learn for {weights} weights: a training set must hold at least as many rows as there are weights; build \
         more scenes, take a smaller network, or set allow_few_rows: true"
    )]
    FewRows { rows: u64, weights: usize },
    #[error(
        "all {rows} rows to learn are {label}: a network could only learn to say so; build scenes with both (`marsyard inspect` and `marsyard plan` \
         say what is weak), choose other --labels, or set allow_one_class: true"
    )]
    OneClass { rows: u64, label: &'static str },
    #[error("{path}: {source}")]
    Io { path: String, source: std::io::Error },
    #[error("{path} is there already; choose another --out, or go on with it by --resume")]
    Exists { path: String },
    #[error("{path}: another training or search writes there; wait until it is over, or choose another --out")]
    Busy { path: String },
    #[error("{path} is no run folder to go on with: {reason}")]
    NoRun { path: String, reason: String },
    #[error("{path} was begun otherwise: {what}; give what it was begun with, or begin another run")]
    OtherRun { path: String, what: String },
    #[error(
        "{path}: {reason}; delete that file, and the same command with --resume begins anew and ends in the same bits"
    )]
    BadState { path: String, reason: String },
    #[error(
        "{path}: it is of format {there}, which this marsyard does not read: go on with the one that wrote it; nothing was touched"
    )]
    Newer { path: String, there: u64 },
    #[error(
        "{path} is a whole model, but not the one that this run ended with; move it away, and the same command with --resume writes \
         the run's own"
    )]
    OtherModel { path: String },
    #[error("{path} cannot be started from: {reason}")]
    Init { path: String, reason: String },
}
