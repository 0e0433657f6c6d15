//! Errors of rows before they are learnt -> which of them are learnt, and with how much less noise.
//!
//! An update of the filter costs the same whatever the row teaches; the error before it costs a thirtieth of that. So a row is learnt with
//! a probability p that grows with its |error|, and R, which carries its weight, is multiplied by p: its weight is divided by p.
//! What a pass adds to the gradient B' R^-1 nu and to the information B' R^-1 B then has the expectation that it has where every row
//! is learnt. Source: importance sampling by a bound of the gradient, Katharopoulos & Fleuret 2018; that bound is, for one
//! output, |error| up to a factor. Deviation: p is a row's own and no share of a batch, so that the rows beside it do not change it.
//!
//! The errors are of the network as it is at the start of a portion: p may depend on all that is known before its draw. A draw has the
//! address (seed, rows of the training before it), which tells the epoch and the row in it: a training that goes on after a kill draws the same.

use super::params::{ByErrorParams, FilterParams, RowsLearnt};
use crate::random::{Purpose, Stage, Stream, Streams};

/// Draws which rows are learnt.
pub(super) struct Selection {
    rule: ByErrorParams,
    draws: Stream,
    units: Vec<f64>,
}

impl Selection {
    /// `None` where every row is learnt.
    pub(super) fn of(filter: &FilterParams, seed: u64) -> Option<Selection> {
        let FilterParams::Ekf(ekf) = filter else { return None };
        let RowsLearnt::ByError(rule) = &ekf.rows else { return None };
        let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
        Some(Selection { rule: rule.clone(), draws: streams.open(Purpose::TrainSelection), units: Vec::new() })
    }

    /// Of rows that follow one another, `first` rows of the training before them: the places of those to learn, whose noise is made less.
    pub(super) fn select(&mut self, first: u64, errors: &[f64], noise: &mut [f64], chosen: &mut Vec<usize>) {
        self.units.resize(errors.len(), 0.0);
        self.draws.fill_uniform(first, &mut self.units);
        chosen.clear();
        for (place, ((&error, noise), &unit)) in errors.iter().zip(noise).zip(&self.units).enumerate() {
            let p = self.probability(error);
            if unit < p {
                *noise *= p;
                chosen.push(place);
            }
        }
    }

    /// That a row of such an error is learnt. One whose error is no number is handed on, for the filter to refuse and to count.
    fn probability(&self, error: f64) -> f64 {
        let share = error.abs() / self.rule.full_error;
        if share < 1.0 { share.max(self.rule.floor) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests;
