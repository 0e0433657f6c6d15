//! A finished training <-> its files.
//!
//! `filter.safetensors` is the record: beside the best weights and their covariance it holds the summary and the looks. All other
//! files are made of it and of the corpora: at the end of a training, and again in a finished run where one of them is gone. The
//! checkpoint goes last, so that a kill between any two of them leaves a run to go on with.

use std::io::ErrorKind;

use serde_json::{Value as Json, json};

use super::summary::{Summary, model_of};
use super::{Event, Setup, Tell, identity};
use crate::corpus::sha256;
use crate::train::folder::{self, RunFolder};
use crate::train::looks::{self, Line, Looks};
use crate::train::scaling::scaler;
use crate::train::state::{self, Snapshot, State, Unreadable};
use crate::train::{Model, ModelError, Network, TrainError, curves};

/// What a training ended with.
pub(super) struct Finished {
    pub summary: Summary,
    pub looks: Looks,
    pub best: Snapshot,
}

/// The summary of a run that is finished, after whatever of it was gone is there again; `None` where there is something to learn.
pub(super) fn completed(
    setup: &Setup,
    run: &RunFolder,
    identity: &Json,
    tell: Tell,
) -> Result<Option<Summary>, TrainError> {
    let run_id = identity::run_id(identity);
    let record = read_record(run)?;
    let word = if matches!(record, Some(Err(_))) { "damaged" } else { "gone" };
    let is_of_before = matches!(&record, Some(Ok(state)) if !state.checked);
    let damage = record.as_ref().and_then(|record| record.as_ref().err().cloned());
    if let Some(finished) = record.and_then(Result::ok).and_then(Finished::of) {
        identity::check(setup, &finished.summary.identity(), identity)?;
        return finished.restore(setup, run, run_id, tell).map(Some);
    }
    let anew = |tell: Tell| {
        tell(Event::Note(&format!("the run is finished, but its {} is {word}: it is trained anew", folder::FILTER)));
    };
    let has_checkpoint = run.holds(folder::CHECKPOINT)?;
    let Some(summary) = Summary::read(run)? else {
        if has_checkpoint {
            return Ok(None);
        }
        if holds_model_of(run, Some(&run_id), None)? {
            anew(tell);
        } else if let Some(reason) = damage {
            let path = run.path().join(folder::FILTER).display().to_string();
            let reason = format!("{reason}, and nothing else there says what the run learnt");
            return Err(TrainError::BadState { path, reason });
        } else {
            run.check_unlearnt(&setup.config_yaml)?;
        }
        return Ok(None);
    };
    identity::check(setup, &summary.identity(), identity)?;
    if is_of_before && summary.run.is_none() && holds_model_of(run, None, None)? {
        run.remove(folder::CHECKPOINT)?;
        return Ok(Some(summary));
    }
    if !has_checkpoint {
        anew(tell);
    }
    Ok(None)
}

/// The record, or why it cannot be read; `None` where there is none. One of a newer format is left alone.
fn read_record(run: &RunFolder) -> Result<Option<Result<State, String>>, TrainError> {
    let Some(bytes) = run.read_if_there(folder::FILTER)? else { return Ok(None) };
    match state::from_bytes(&bytes) {
        Err(Unreadable::Newer { there }) => {
            Err(TrainError::Newer { path: run.path().join(folder::FILTER).display().to_string(), there })
        }
        Err(Unreadable::Damaged(reason)) => Ok(Some(Err(reason))),
        Ok(state) => Ok(Some(Ok(state))),
    }
}

/// Whether there is a whole model of the run of that id, with those weights; no other whole model is to be replaced.
fn holds_model_of(run: &RunFolder, run_id: Option<&str>, weights: Option<&[f64]>) -> Result<bool, TrainError> {
    let path = run.path().join(folder::MODEL);
    let shown = || path.display().to_string();
    match Model::read(&path) {
        Ok(model)
            if model.about.run.as_deref() == run_id && weights.is_none_or(|best| best == model.network.weights) =>
        {
            Ok(true)
        }
        Ok(_) => Err(TrainError::OtherModel { path: shown() }),
        Err(ModelError::Io { source, .. }) if source.kind() != ErrorKind::NotFound => {
            Err(TrainError::Io { path: shown(), source })
        }
        Err(ModelError::OtherVersion { there }) => Err(TrainError::Newer { path: shown(), there }),
        Err(_) => Ok(false),
    }
}

impl Finished {
    /// What a record says; `None` for one of an earlier marsyard, which says nothing of its training.
    fn of(record: State) -> Option<Finished> {
        let State { header, looks, mut snapshots, .. } = record;
        let summary = Summary::of(header["summary"].clone())?;
        Some(Finished { summary, looks: Looks::new(looks), best: snapshots.remove("best")? })
    }

    /// Writes again what is gone or damaged.
    fn restore(mut self, setup: &Setup, run: &RunFolder, run_id: String, tell: Tell) -> Result<Summary, TrainError> {
        let has_model = holds_model_of(run, Some(&run_id), Some(&self.best.weights))?;
        let log = looks::read(run.path(), u64::MAX);
        let has_log = log.iter().map(|line| line.timeless()).eq(self.looks.lines().iter().copied());
        let gone: Vec<&str> = [(folder::MODEL, has_model), (folder::LOOKS, has_log)]
            .into_iter()
            .chain([(folder::SUMMARY, run.holds(folder::SUMMARY)?)])
            .filter_map(|(name, is_there)| (!is_there).then_some(name))
            .collect();
        for name in gone {
            let word = if run.holds(name)? { "damaged" } else { "gone" };
            tell(Event::Note(&format!("{name} is {word}: written anew")));
        }
        if has_log {
            // Its times are nowhere else.
            self.looks = Looks::new(log);
        }
        let model = if has_model { None } else { Some(self.model(setup, run_id)?) };
        self.write(run, model.as_ref())
    }

    fn model(&self, setup: &Setup, run_id: String) -> Result<Model, TrainError> {
        let scaler = match &setup.init {
            Some(init) => init.model.about.scaler.clone(),
            None => scaler(&setup.sources, &setup.params)?.0,
        };
        let layout = setup.params.layout(setup.sources.features.len());
        model_of(setup, run_id, scaler, Network { layout, weights: self.best.weights.clone() })
    }

    /// Writes all files, the model where one is given, and ends with the checkpoint.
    pub(super) fn write(mut self, run: &RunFolder, model: Option<&Model>) -> Result<Summary, TrainError> {
        if let Some(model) = model {
            run.write(folder::MODEL, &model.save()?)?;
        }
        self.summary.model_sha256 = None;
        let header = json!({"features": self.summary.features, "best": self.summary.best, "summary": self.summary});
        let timeless: Vec<Line> = self.looks.lines().iter().map(|line| line.timeless()).collect();
        run.write(folder::FILTER, &state::to_bytes(&header, &timeless, &[("best", &self.best)]))?;
        let looks: Vec<_> = timeless.iter().map(|line| line.look).collect();
        if let Some(svg) = curves::svg(&looks, Some(&self.summary.best)) {
            run.write(folder::CURVES, svg.as_bytes())?;
        }
        run.log(&self.looks)?.sync()?;
        self.summary.model_sha256 = Some(sha256(&run.read(folder::MODEL)?));
        let text = serde_json::to_string_pretty(&self.summary).expect("a summary is plain data") + "\n";
        run.write(folder::SUMMARY, text.as_bytes())?;
        run.remove(folder::CHECKPOINT)?;
        Ok(self.summary)
    }
}
