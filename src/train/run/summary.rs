//! A finished training -> `training.json` and the model.

use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

use super::{Setup, Training, identity};
use crate::train::filter::Counters;
use crate::train::folder::{self, RunFolder};
use crate::train::generalisation::{Generalisation, Judged};
use crate::train::learner::Learner;
use crate::train::rows::LeftOut;
use crate::train::stopping::{Look, Stop, Stopping};
use crate::train::{
    About, Calibration, MODEL_FORMAT, Model, Network, Scaler, TrainError, TrainParams, leaks, quantiles,
};

/// Of `training.json`.
const FORMAT: u32 = 1;

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
    /// Learnt or left out by `filter.ekf.rows`, rows of later epochs counted again; those learnt are `counters.updates`.
    pub rows_learnt: u64,
    /// In all epochs; the window in which patience ended a training counts whole.
    pub left_out: LeftOut,
    pub left_out_of_validation: LeftOut,
    pub class_weights: [f64; 2],
    pub weights: usize,
    pub features: Vec<String>,
    pub constant_features: Vec<String>,
    pub filter: String,
    /// Of the weights kept, on what was learnt and on the validation split; runs of before have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) generalisation: Option<Generalisation>,
    /// Of the filter at its last update; where it started from another run's covariance, that run's included.
    pub counters: Counters,
    pub corpora: Json,
    /// What was told of scenes in two splits, where that was allowed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shared_scenes: Vec<String>,
    /// Hash of the network and covariance it started from.
    pub init: Option<String>,
    /// SHA-256 of what it was begun with, which the model names too; that of the model's file. Runs of before had neither.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_sha256: Option<String>,
    pub config: TrainParams,
}

impl Summary {
    /// That of a run folder; `None` where there is none, or none that is whole.
    pub(super) fn read(run: &RunFolder) -> Result<Option<Summary>, TrainError> {
        let Some(bytes) = run.read_if_there(folder::SUMMARY)? else { return Ok(None) };
        let Ok(json) = serde_json::from_slice::<Json>(&bytes) else { return Ok(None) };
        match json["marsyard_training"].as_u64() {
            Some(there) if there > u64::from(FORMAT) => {
                Err(TrainError::Newer { path: run.path().join(folder::SUMMARY).display().to_string(), there })
            }
            _ => Ok(Summary::of(json)),
        }
    }

    /// What a file or a record says; `None` where that is not whole.
    pub(super) fn of(mut json: Json) -> Option<Summary> {
        json["config"] = identity::as_noted_now(json.get("config")?);
        serde_json::from_value(json).ok()
    }

    /// What the training was begun with.
    pub(super) fn identity(&self) -> Json {
        json!({"config": self.config, "corpora": self.corpora, "init": self.init})
    }
}

impl Training<'_> {
    /// Of the weights that are kept.
    pub(super) fn summary(&self) -> Result<Summary, TrainError> {
        let none = Look { rows: 0, epoch: 0, train_error: None, validation_error: None };
        let Stopping { looks, last, best, .. } = self.learner.learnt.stopping;
        let Setup { params, sources, .. } = self.setup;
        let Learner { objective, network, early, learnt, .. } = &self.learner;
        // A network that was learnt before may know the scenes already, and one class alone tells no error that more scenes could lower.
        let early = early.as_deref().filter(|_| self.setup.init.is_none() && !self.start.one_class);
        let judged = early.map(|early| Judged {
            sources,
            objective,
            network,
            early,
            early_rows: self.learner.validate_every,
            kept_rows: best.map_or(0, |best| best.rows),
            learnt: learnt.rows,
            train_rows: self.start.train_rows,
            seed: params.seed,
        });
        let generalisation = judged.map(|judged| Generalisation::of(&judged)).transpose()?.flatten();
        Ok(Summary {
            marsyard_training: FORMAT,
            stopped: self.place.stopped.unwrap_or(Stop::Epochs),
            best: best.unwrap_or(none),
            last: last.unwrap_or(none),
            looks,
            train_rows: self.start.train_rows,
            validation_rows: self.start.validation_rows,
            rows_learnt: self.learner.learnt.rows,
            left_out: self.place.left_out,
            left_out_of_validation: self.validation.left_out,
            class_weights: objective.weights.class,
            weights: self.start.weights,
            features: sources.features.clone(),
            constant_features: self.start.constant.clone(),
            filter: self.learner.best.filter.kind.clone(),
            generalisation,
            counters: self.learner.filter.counters(),
            corpora: self.identity["corpora"].clone(),
            shared_scenes: sources.shared_scenes.clone(),
            init: self.identity["init"].as_str().map(str::to_string),
            run: Some(identity::run_id(&self.identity)),
            model_sha256: None,
            config: params.clone(),
        })
    }
}

/// The network with everything that its use needs.
pub(super) fn model_of(setup: &Setup, run_id: String, scaler: Scaler, network: Network) -> Result<Model, TrainError> {
    let Setup { params, sources, origin, init, .. } = setup;
    let about = About {
        marsyard_model: MODEL_FORMAT,
        inputs: network.layout.inputs,
        hidden: network.layout.hidden.clone(),
        bias: network.layout.bias,
        members: network.layout.members,
        activation: network.layout.activation,
        features: sources.features.clone(),
        scaler,
        quantiles: Vec::new(),
        targets: params.targets,
        thresholds: params.thresholds.clone(),
        cells: origin.cells.clone(),
        frames: origin.frames.clone(),
        overhangs_m: origin.overhangs_m.clone(),
        reach_m: origin.reach_m,
        labels: params.labels.clone(),
        rover: origin.rover.clone(),
        sensor: origin.sensor.clone(),
        mount: origin.mount,
        corpus_ids: sources.list.iter().map(|source| source.corpus_id.clone()).collect(),
        corpus_names: sources.list.iter().map(|source| source.name.clone()).collect(),
        run: Some(run_id),
        learnt_from: leaks::learnt_from(sources, init.as_ref().map(|init| &init.model)),
        calibration: None,
    };
    let mut model = Model { network, about, sha256: None };
    // They read different splits, and neither needs the other: two threads read at once.
    let of_train = || quantiles::of_train_split(sources, params.seed, &model.about.scaler);
    let (quantiles, calibration) = rayon::join(of_train, || Calibration::of(&model, params.filter.loss(), sources));
    (model.about.quantiles, model.about.calibration) = (quantiles?, calibration?);
    Ok(model)
}
