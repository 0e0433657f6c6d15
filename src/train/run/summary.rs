//! A finished training -> `training.json` and the model.

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::{Setup, Training};
use crate::train::filter::Counters;
use crate::train::rows::LeftOut;
use crate::train::stopping::{Look, Stop, Stopping};
use crate::train::{About, MODEL_FORMAT, Model, TrainError, TrainParams, folder};

/// `training.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    pub marsyard_training: u32,
    pub stopped: Stop,
    pub best: Look,
    pub last: Look,
    pub looks: u64,
    pub train_rows: u64,
    pub validation_rows: u64,
    /// Learnt, rows of later epochs counted again.
    pub rows_learnt: u64,
    /// In all epochs.
    pub left_out: LeftOut,
    pub left_out_of_validation: LeftOut,
    pub class_weights: [f64; 2],
    pub weights: usize,
    pub features: Vec<String>,
    pub constant_features: Vec<String>,
    pub filter: String,
    /// Of the filter at its last update; where it started from another run's covariance, that run's included.
    pub counters: Counters,
    pub corpora: Json,
    /// Hash of the network and covariance it started from.
    pub init: Option<String>,
    pub config: TrainParams,
}

impl Summary {
    /// That of a finished run; `None` where it is not finished.
    pub(super) fn read(setup: &Setup) -> Result<Option<Summary>, TrainError> {
        let path = setup.out.join(folder::SUMMARY);
        if !path.is_file() {
            return Ok(None);
        }
        let bad = |reason: String| TrainError::BadState { path: path.display().to_string(), reason };
        let bytes = std::fs::read(&path).map_err(|error| bad(error.to_string()))?;
        serde_json::from_slice(&bytes).map(Some).map_err(|error| bad(error.to_string()))
    }
}

impl Training<'_> {
    pub(super) fn summary(&self) -> Summary {
        let none = Look { rows: 0, epoch: 0, train_error: None, validation_error: None };
        let Stopping { looks, last, best, .. } = self.learner.learnt.stopping;
        Summary {
            marsyard_training: 1,
            stopped: self.place.stopped.unwrap_or(Stop::Epochs),
            best: best.unwrap_or(none),
            last: last.unwrap_or(none),
            looks,
            train_rows: self.start.train_rows,
            validation_rows: self.start.validation_rows,
            rows_learnt: self.learner.learnt.rows,
            left_out: self.place.left_out,
            left_out_of_validation: self.validation.left_out,
            class_weights: self.learner.judge.weights.class,
            weights: self.start.weights,
            features: self.setup.sources.features.clone(),
            constant_features: self.start.constant.clone(),
            filter: self.learner.best.filter.kind.clone(),
            counters: self.learner.filter.counters(),
            corpora: self.identity["corpora"].clone(),
            init: self.identity["init"].as_str().map(str::to_string),
            config: self.setup.params.clone(),
        }
    }

    pub(super) fn model(&self, quantiles: Vec<[f64; 7]>) -> Model {
        let Setup { params, sources, origin, .. } = self.setup;
        let network = self.learner.network.clone();
        Model {
            about: About {
                marsyard_model: MODEL_FORMAT,
                inputs: network.layout.inputs,
                hidden: network.layout.hidden.clone(),
                bias: network.layout.bias,
                features: sources.features.clone(),
                scaler: self.learner.judge.scaler.clone(),
                quantiles,
                targets: params.targets,
                thresholds: params.thresholds.clone(),
                cells: origin.cells.clone(),
                rover: origin.rover.clone(),
                sensor: origin.sensor.clone(),
                mount: origin.mount,
                corpus_ids: sources.list.iter().map(|source| source.corpus_id.clone()).collect(),
                corpus_names: sources.list.iter().map(|source| source.name.clone()).collect(),
            },
            network,
        }
    }
}
