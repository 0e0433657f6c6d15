//! Validation errors at set intervals -> when to stop, and which weights were the best.
//!
//! Source: Hewitt et al. 2017, "Methodology for training": the validation error is looked at at set intervals; when it rises, training
//! ends and the weights revert to those at the minimum. Deviation: so many looks as the patience is may pass without an improvement
//! of 1 % before that is believed. What is smaller lies within the noise of a look: it is kept where it is the best, and waited for no
//! longer, or a large corpus would be learnt many times over for the fourth digit of its error. A learner may ask for more of that noise to
//! be borne: then the latest of the looks within it is the best, because what was learnt for longer errs less on other yards.

use serde::{Deserialize, Serialize};

/// The share by which the error has to fall for the patience to begin anew.
const IMPROVEMENT: f64 = 0.01;

/// One look at the validation split.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Look {
    /// Rows learnt before it.
    pub rows: u64,
    /// Epochs begun before it.
    pub epoch: u32,
    /// Weighted mean squared error of the rows since the last look, each judged before it was learnt; `None` at the first, and where fewer than a
    /// tenth as many were learnt as lie between two looks.
    pub train_error: Option<f64>,
    /// Weighted mean squared error over the validation split; `None` where it is not finite.
    pub validation_error: Option<f64>,
}

/// What the looks so far say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Stopping {
    pub looks: u64,
    pub last: Option<Look>,
    pub best: Option<Look>,
    /// The lowest error so far; `None` before the first, and in a checkpoint of an earlier marsyard, whose best look has it.
    #[serde(default)]
    lowest: Option<f64>,
    /// The error at the last improvement; `None` before the first, and in a checkpoint of an earlier marsyard.
    #[serde(default)]
    improved_to: Option<f64>,
    /// Looks since the last improvement.
    #[serde(alias = "worse")]
    pub waited: u32,
}

/// Why training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// No improvement of the validation error for as many looks as the patience is.
    Patience,
    /// All epochs are over.
    Epochs,
}

impl Stopping {
    /// Takes a look in; whether it is the best so far: the lowest, or one that is above the lowest by a share of no more than `noise`.
    pub(crate) fn take(&mut self, look: Look, noise: f64) -> bool {
        let finite = |look: &Look| look.validation_error.filter(|error| error.is_finite());
        let lowest = self.lowest.or_else(|| self.best.as_ref().and_then(finite));
        let better = match (finite(&look), lowest) {
            (Some(error), Some(lowest)) => error < (1.0 + noise) * lowest,
            (Some(_), None) => true,
            (None, _) => self.best.is_none(),
        };
        self.lowest = match (finite(&look), lowest) {
            (Some(error), Some(lowest)) => Some(error.min(lowest)),
            (error, lowest) => error.or(lowest),
        };
        self.looks += 1;
        self.last = Some(look);
        if better {
            self.best = Some(look);
        }
        // The weighted error is never negative; one of nought is the end of all improvement.
        let improves = match (finite(&look), self.improved_to) {
            (Some(error), Some(mark)) => error < (1.0 - IMPROVEMENT) * mark,
            (Some(_), None) => true,
            (None, _) => false,
        };
        if improves {
            (self.improved_to, self.waited) = (finite(&look), 0);
        } else {
            self.waited += 1;
        }
        better
    }

    pub(crate) fn is_over(&self, patience: u32) -> bool {
        self.waited >= patience
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(rows: u64, error: f64) -> Look {
        Look { rows, epoch: 1, train_error: None, validation_error: Some(error).filter(|e| e.is_finite()) }
    }

    #[test]
    fn exact_patience_counts_looks_since_the_last_improvement() {
        let mut stopping = Stopping::default();
        let taken: Vec<bool> = [0.3, 0.2, 0.25, 0.2, 0.1, 0.1, 0.11]
            .iter()
            .zip(1..)
            .map(|(&e, i)| stopping.take(look(i, e), 0.0))
            .collect();
        assert_eq!(taken, [true, true, false, false, true, false, false]);
        assert_eq!((stopping.best.map(|b| b.rows), stopping.waited, stopping.looks), (Some(5), 2, 7));
        assert!(stopping.is_over(2) && !stopping.is_over(3));
    }

    #[test]
    fn law_less_than_one_percent_is_kept_and_not_waited_for_but_adds_up() {
        let mut stopping = Stopping::default();
        // Steps of 0.4 %: each is the best, and every third of them is an improvement by then.
        let mut error = 0.2;
        for (step, waited) in (0..).zip([0, 1, 2, 0, 1, 2, 0]) {
            assert!(stopping.take(look(step, error), 0.0));
            assert_eq!(stopping.waited, waited, "step {step}");
            error *= 0.996;
        }
        assert_eq!(stopping.best, stopping.last);
    }

    #[test]
    fn exact_within_the_noise_the_latest_look_is_the_best_and_the_lowest_stays_the_measure() {
        let mut stopping = Stopping::default();
        // The lowest is 0.1: 0.104 lies within 5 % of it, 0.1055 does not, though it is within 5 % of the one before.
        let errors = [0.2, 0.1, 0.104, 0.1055, 0.103, 0.11];
        let taken: Vec<bool> = errors.iter().zip(1..).map(|(&e, i)| stopping.take(look(i, e), 0.05)).collect();
        assert_eq!(taken, [true, true, true, false, true, false]);
        assert_eq!((stopping.best.map(|b| b.rows), stopping.waited), (Some(5), 4));
    }

    #[test]
    fn extreme_an_error_that_is_not_finite_is_never_the_best() {
        let mut stopping = Stopping::default();
        assert!(stopping.take(look(0, 0.3), 0.0));
        assert!(!stopping.take(look(1, f64::NAN), 0.0));
        assert_eq!(stopping.best.map(|b| b.rows), Some(0));
        let mut from_the_start = Stopping::default();
        assert!(from_the_start.take(look(0, f64::NAN), 0.0));
        assert!(from_the_start.take(look(1, 0.5), 0.0));
    }
}
