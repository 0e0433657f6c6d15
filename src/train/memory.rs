//! Rows in memory -> a trained network, on one thread and without files.
//!
//! For rows that fit: searches over many networks, and studies beside other classifiers. Learns as a training from shards does (the same
//! filters, weights, looks and stopping), with three differences: rows are scaled by their own statistics, an epoch is one
//! permutation of all rows instead of windows of row groups, and nothing is kept for a resume.

use std::sync::atomic::{AtomicBool, Ordering};

use super::filter::Counters;
use super::learner::Learner;
use super::order::Epoch;
use super::rows::{Rows, stride};
use super::scaling::{moments_of, scaler_of, scores_of, subtracted};
use super::stopping::{Look, Stop};
use super::validation::Objective;
use super::{Network, Scaler, TrainError, TrainParams};

/// Rows to learn and rows to judge by, and how both are scaled and weighed: by the rows to learn alone.
pub struct Held {
    pub train: Rows,
    pub validation: Rows,
    pub objective: Objective,
    /// Stride by which the given rows to judge by were thinned.
    pub looked_every: usize,
    /// Features that never vary in the rows to learn.
    pub constant: Vec<usize>,
}

/// How long to learn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Course {
    /// At most, rows of later epochs counted again.
    pub rows: u64,
    /// Rows between two looks.
    pub validate_every: u64,
}

/// What happens while training.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// So many rows are learnt.
    Rows(u64),
    /// The validation rows were looked at.
    Look { look: &'a Look, is_best: bool },
}

/// A finished training.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// With the weights of the best look.
    pub network: Network,
    pub looks: Vec<Look>,
    pub best: Look,
    pub stopped: Stop,
    pub rows_learnt: u64,
    /// Of the filter at its last update.
    pub counters: Counters,
}

impl Held {
    /// Scales and weighs as the parameters say; a row of each corpus counts as much as that corpus's weight.
    pub fn new(
        features: &[String],
        train: Rows,
        validation: Rows,
        corpora: &[f64],
        params: &TrainParams,
    ) -> Result<Held, TrainError> {
        for (rows, purpose) in [(&train, "learn"), (&validation, "validate by")] {
            if rows.is_empty() {
                let (unlabelled, not_finite) = (rows.left_out.unlabelled, rows.left_out.not_finite);
                return Err(TrainError::NoRowsHeld { purpose, unlabelled, not_finite });
            }
        }
        let minus = subtracted(features, params.neighbours);
        let moments = moments_of(&train, &minus);
        let mut counts = vec![[0; 2]; corpora.len()];
        for row in 0..train.len() {
            counts[usize::from(train.corpora[row])][train.labels[row].index()] += 1;
        }
        let validate_every = params.rows_between_looks(train.len() as u64);
        let looked_every = stride(validation.len() as u64, params.filter.look_rows(validate_every)) as usize;
        let validation = validation.thinned(looked_every);
        let scores = scores_of(&train, &minus, params);
        let (scaler, constant) = scaler_of(minus, moments.into_iter(), scores, params.clip);
        let objective = Objective::new(scaler, params, &counts, corpora);
        Ok(Held { objective, train, validation, looked_every, constant })
    }

    /// As long as the parameters say.
    pub fn course(&self, params: &TrainParams) -> Course {
        let rows = self.train.len() as u64;
        Course { rows: rows * u64::from(params.epochs), validate_every: params.rows_between_looks(rows) }
    }

    /// The weighted mean squared error over the validation rows.
    pub(crate) fn validation_error(&self, network: &Network) -> f64 {
        self.objective.sum_here(network, &self.validation).mean()
    }

    /// The output for each row.
    pub fn outputs(&self, network: &Network, rows: &Rows) -> Vec<f64> {
        outputs(&self.objective.scaler, network, rows)
    }
}

/// The output for each row, scaled so.
pub(crate) fn outputs(scaler: &Scaler, network: &Network, rows: &Rows) -> Vec<f64> {
    let mut scaled = vec![0.0; scaler.inputs() * rows.len()];
    scaler.scale(&rows.features, &mut scaled);
    let mut outputs = vec![0.0; rows.len()];
    network.outputs(&scaled, &mut outputs);
    outputs
}

/// Trains until the validation error rises or the course is over; `None` where `stop` was raised before.
pub fn train(
    params: &TrainParams,
    held: &Held,
    course: Course,
    stop: &AtomicBool,
    tell: &mut dyn FnMut(Event),
) -> Result<Option<Trained>, TrainError> {
    let mut learner = Learner::new(params, held.objective.clone(), course.validate_every)?;
    let (rows, weights) = (held.train.len(), learner.network.layout.weights_of_member());
    if rows < weights && !params.allow_few_rows {
        return Err(TrainError::FewRows { rows: rows as u64, weights });
    }
    let mut looks = Vec::new();
    let mut look = |learner: &mut Learner, epoch: u32, tell: &mut dyn FnMut(Event)| {
        let error = held.validation_error(&learner.network);
        let (look, is_best) = learner.look(epoch, error);
        looks.push(look);
        tell(Event::Look { look: &look, is_best });
    };
    look(&mut learner, 0, tell);
    let mut stopped = Stop::Epochs;
    let mut epoch = 0;
    'course: while learner.learnt.rows < course.rows {
        let mut order = Epoch::new(params.seed, epoch).rows(0, rows);
        order.truncate(usize::try_from(course.rows - learner.learnt.rows).unwrap_or(usize::MAX));
        let mut from = 0;
        while from < order.len() {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            from = learner.learn(&held.train, &order, from);
            tell(Event::Rows(learner.learnt.rows));
            if learner.is_look_due() {
                look(&mut learner, epoch, tell);
                if learner.is_over() {
                    stopped = Stop::Patience;
                    break 'course;
                }
            }
        }
        epoch += 1;
    }
    if learner.is_ahead_of_look() {
        look(&mut learner, epoch - 1, tell);
    }
    learner.revert();
    let best = learner.learnt.stopping.best.expect("a look was taken before the first row");
    Ok(Some(Trained {
        rows_learnt: learner.learnt.rows,
        counters: learner.filter.counters(),
        network: learner.network,
        looks,
        best,
        stopped,
    }))
}
