//! Why a model cannot be used, in words that name the cure.
//!
//! In: what is wrong with a file, with the data or with what is asked of the model. Out: a [`ModelError`].

use super::MODEL_FORMAT;
use crate::train::operating_point::MOST_THRESHOLDS;

/// Why a model cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    #[error("{name}: {source}")]
    Io { name: String, source: std::io::Error },
    #[error("not a marsyard model: {reason}; give the `model.safetensors` of a run folder of `marsyard train`")]
    NotAModel { reason: String },
    #[error(
        "a model of format {there}, this marsyard reads formats 1 to {MODEL_FORMAT}: use the marsyard that wrote it, or train again"
    )]
    OtherVersion { there: u64 },
    #[error(
        "the model is damaged: {reason}; copy it again from where it came, or have its run write it anew: remove it and give the \
         command that trained it, with --resume"
    )]
    Damaged { reason: String },
    #[error("the model contradicts itself: {reason}; the file was damaged or changed by hand: train again")]
    Contradiction { reason: String },
    #[error(
        "the model takes {}, which the data does not have; build the corpus with the effects and cell features that give {}, or train with \
         `features: listed`",
        missing.join(", "),
        if missing.len() == 1 { "it" } else { "them" }
    )]
    MissingFeatures { missing: Vec<String> },
    #[error(
        "the model was trained on cells of {model_m} m, the data has cells of {data_m} m: a model fits its own cell size only; \
         build the data with `cells.size_m: {model_m}`, or train a model on cells of {data_m} m"
    )]
    OtherCellSize { model_m: f64, data_m: f64 },
    #[error(
        "the model was trained on heights above {model}, the data has those above {data}: the same column with another meaning; \
         build the data with the model's `cells.local_height`, or train again without `local_height_m`"
    )]
    OtherLocalHeight { model: String, data: String },
    #[error(
        "the model was trained on gaps in {model}, the data has those in {data}: the same columns with another meaning; build the data \
         with the model's `cells.unseen`, or train again"
    )]
    OtherUnseen { model: String, data: String },
    #[error("the thresholds {0:?} are not 1 to {MOST_THRESHOLDS} rising numbers within 0 and 1")]
    Thresholds(Vec<f64>),
    #[error(
        "the model does not know what its outputs mean: its validation scenes lacked a class, or it was trained by an earlier marsyard; \
         train again, or say --threshold"
    )]
    Uncalibrated,
    #[error(
        "no threshold keeps within {} % on the model's validation scenes; allow more, or train on a corpus with more scenes",
        100.0 * share
    )]
    Unreached { share: f64 },
}
