//! One network trained as far as one rung: what the journal keeps of it.

use std::cmp::Ordering;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::Setup;
use super::networks::Hidden;
use super::rungs::Rung;
use crate::evaluate::Confusion;
use crate::statistics::scores::Scores;
use crate::train::memory::{self, Course, Held};
use crate::train::stopping::Stop;
use crate::train::{TrainError, TrainParams};

/// A line of the journal. It has these keys and no others: the name of a checksum that a flipped bit spelt otherwise is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    pub hidden: Hidden,
    /// From 0.
    pub rung: usize,
    pub weights: usize,
    /// Rows learnt, and how many of them before the best look.
    pub rows: u64,
    pub best_rows: u64,
    /// Weighted mean squared error of the best look; `None` where it is not finite.
    pub validation_error: Option<f64>,
    /// What each validation scene adds to that error, of a training that is over; empty of one that the next rung begins anew, and in
    /// a journal of an earlier marsyard.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub error_by_scene: Vec<f64>,
    /// Of the best network on the validation rows.
    pub balanced_accuracy: Option<f64>,
    pub auc: Option<f64>,
    pub stopped: Stop,
    /// Rows that the filter rejected, and how often it rebuilt its covariance.
    pub rejected: u64,
    pub rebuilt: u64,
    /// How long it took; the only field that another run may have otherwise.
    pub seconds: f64,
}

impl Entry {
    /// By validation error, lower first; then smaller networks, then fewer and narrower layers.
    pub(crate) fn rank(&self, other: &Entry) -> Ordering {
        let error = |entry: &Entry| entry.validation_error.unwrap_or(f64::INFINITY);
        let shape = |entry: &Entry| (entry.weights, entry.hidden.len());
        error(self)
            .total_cmp(&error(other))
            .then_with(|| shape(self).cmp(&shape(other)))
            .then_with(|| self.hidden.cmp(&other.hidden))
    }

    /// Rows learnt a second, looks included.
    pub(crate) fn rows_per_s(&self) -> f64 {
        self.rows as f64 / self.seconds.max(1e-9)
    }
}

/// The parameters of one network of a search.
pub(crate) fn params_of(params: &TrainParams, hidden: &[usize]) -> TrainParams {
    let mut params = params.clone();
    params.network.hidden = hidden.to_vec();
    params
}

/// How a network learns up to a rung. Each rung's is the beginning of the next one's.
pub(crate) fn course(params: &TrainParams, held: &Held, rung: &Rung) -> Course {
    Course { rows: rung.rows, ..held.course(params) }
}

/// Trains a network from its first row to a rung; `None` where `stop` was raised before.
///
/// It begins anew at each rung: to keep the f32 covariances of the paper's 33,824 networks of 14 inputs takes 62 GB (4 bytes for each of
/// w (w + 1) / 2 elements, w weights). To learn the first rows again is a fifth of all rows learnt by three rungs that keep a quarter.
pub(crate) fn train(
    setup: &Setup,
    hidden: &[usize],
    (number, rung): (usize, &Rung),
    stop: &AtomicBool,
) -> Result<Option<Entry>, TrainError> {
    let begun = Instant::now();
    let held = &setup.held;
    let params = params_of(&setup.params, hidden);
    let course = course(&params, held, rung);
    let Some(trained) = memory::train(&params, held, course, stop, &mut |_| ())? else { return Ok(None) };
    let outputs = held.outputs(&trained.network, &held.validation);
    let (balanced_accuracy, auc) = judge(&params, held, &outputs);
    let is_over = trained.stopped == Stop::Patience || number + 1 == setup.rungs;
    Ok(Some(Entry {
        hidden: hidden.to_vec(),
        rung: number,
        weights: trained.network.weights.len(),
        rows: trained.rows_learnt,
        best_rows: trained.best.rows,
        validation_error: trained.best.validation_error,
        error_by_scene: if is_over { setup.scenes.errors(held, &outputs) } else { Vec::new() },
        balanced_accuracy,
        auc,
        stopped: trained.stopped,
        rejected: trained.counters.rejected,
        rebuilt: trained.counters.rebuilt,
        seconds: begun.elapsed().as_secs_f64(),
    }))
}

/// Balanced accuracy at the config's first threshold, and the area under the ROC curve.
fn judge(params: &TrainParams, held: &Held, outputs: &[f64]) -> (Option<f64>, Option<f64>) {
    let mut scores = Scores::new(1.0);
    let mut confusion = Confusion::default();
    for (output, label) in outputs.iter().zip(&held.validation.labels) {
        let untraversable = label.is_untraversable();
        scores.add(untraversable, *output);
        confusion.add(untraversable, *output >= params.thresholds[0], 1);
    }
    (confusion.rates().balanced_accuracy, scores.auc())
}
