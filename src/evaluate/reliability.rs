//! Probabilities and labels -> how far the probabilities can be believed; outputs and labels -> what is left where the doubtful cells are
//! set aside.
//!
//! In: the probability that a model gives a cell, by its calibration, and the cell's label. Out: the expected calibration error over fifteen
//! equal bins (Naeini, Cooper & Hauskrecht 2015; Guo et al. 2017), the logarithmic loss in nats and Brier's score, the last two proper.
//! Every cell counts as one. Cells of one scene are alike: intervals are not modelled here.

use serde::{Deserialize, Serialize};

use crate::math;
use crate::train::{Model, OperatingPoint};

/// Bins of the probability.
const BINS: usize = 15;

/// Cells of one group, by the probability that was given to them.
#[derive(Clone, Debug, Default)]
pub(super) struct Reliability {
    bins: [Sums; BINS],
    log_loss: f64,
    squared: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    cells: u64,
    untraversable: u64,
    probability: f64,
}

/// How far the probabilities of a group can be believed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityReport {
    /// Mean over the cells of the distance between a bin's mean probability and its share of untraversable cells.
    pub expected_calibration_error: f64,
    /// Mean of -ln of the probability given to what a cell is.
    pub log_loss: f64,
    /// Mean squared distance of the probability from 0 or 1.
    pub brier: f64,
    /// Of the bins that hold a cell, ascending.
    pub bins: Vec<ReliabilityBin>,
}

/// Cells of about one probability.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityBin {
    pub cells: u64,
    pub mean_probability: f64,
    pub untraversable_share: f64,
}

impl Reliability {
    /// Counts a cell of that probability, which lies within 0 and 1.
    pub(super) fn add(&mut self, untraversable: bool, probability: f64) {
        let bin = &mut self.bins[((probability * BINS as f64) as usize).min(BINS - 1)];
        bin.cells += 1;
        bin.untraversable += u64::from(untraversable);
        bin.probability += probability;
        let of_truth = if untraversable { probability } else { 1.0 - probability };
        // A probability that rounds to 1 leaves nothing for the other class: such a cell costs 700 nats, and the sum stays a number.
        self.log_loss -= math::ln(of_truth.max(f64::MIN_POSITIVE));
        self.squared += (1.0 - of_truth) * (1.0 - of_truth);
    }

    /// `None` of nothing.
    pub(super) fn report(&self) -> Option<ReliabilityReport> {
        let cells = self.bins.iter().map(|bin| bin.cells).sum::<u64>() as f64;
        let off = |bin: &Sums| (bin.probability - bin.untraversable as f64).abs();
        let filled = self.bins.iter().filter(|bin| bin.cells > 0).map(|bin| ReliabilityBin {
            cells: bin.cells,
            mean_probability: bin.probability / bin.cells as f64,
            untraversable_share: bin.untraversable as f64 / bin.cells as f64,
        });
        (cells > 0.0).then(|| ReliabilityReport {
            expected_calibration_error: self.bins.iter().map(off).sum::<f64>() / cells,
            log_loss: self.log_loss / cells,
            brier: self.squared / cells,
            bins: filled.collect(),
        })
    }
}

/// What is doubtful, and how the calls on the rest fare.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Doubt {
    /// Of each class, the share that may be called wrongly on the validation scenes of the model; none where thresholds are given by their
    /// values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub allowed_share: Option<f64>,
    /// Outputs from the first on and below the second are doubtful; equal ones leave no doubt.
    pub between: [f64; 2],
    /// Traversable and untraversable cells.
    pub cells: [u64; 2],
    /// Those of them that are doubtful, and those that are called wrongly all the same.
    pub doubtful: [u64; 2],
    pub wrong: [u64; 2],
}

/// The share that a report allows where none is asked for.
const ALLOWED_SHARE: f64 = 0.01;

impl Doubt {
    /// Between the thresholds that are asked for; of a single one, as the model's validation scenes tell, and `None` for a model that
    /// knows nothing of them.
    pub(super) fn of(model: &Model, asked: &OperatingPoint) -> Option<Doubt> {
        let own = model.thresholds(asked).ok()?;
        let (allowed_share, thresholds) = match asked {
            OperatingPoint::Doubtful(share) => (Some(*share), own),
            _ if own.len() > 1 => (None, own),
            _ => (Some(ALLOWED_SHARE), model.thresholds(&OperatingPoint::Doubtful(ALLOWED_SHARE)).ok()?),
        };
        let between = [*thresholds.first()?, *thresholds.last()?];
        Some(Doubt { allowed_share, between, cells: [0; 2], doubtful: [0; 2], wrong: [0; 2] })
    }

    pub(super) fn add(&mut self, untraversable: bool, output: f64) {
        let [low, high] = self.between;
        let class = usize::from(untraversable);
        self.cells[class] += 1;
        if output >= low && output < high {
            self.doubtful[class] += 1;
        } else if (output >= high) != untraversable {
            self.wrong[class] += 1;
        }
    }

    /// The share of all cells that is doubtful; 0 of nothing.
    pub(super) fn share(&self) -> f64 {
        let sum = |of: [u64; 2]| (of[0] + of[1]) as f64;
        sum(self.doubtful) / sum(self.cells).max(1.0)
    }

    /// Of each class, the share that is called wrongly and not set aside; `None` where there is no such cell.
    pub(super) fn wrong_shares(&self) -> [Option<f64>; 2] {
        [0, 1].map(|class| (self.cells[class] > 0).then(|| self.wrong[class] as f64 / self.cells[class] as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Made by scikit-learn 1.9 (`log_loss`, `brier_score_loss`) and NumPy from the same formulas.
    #[test]
    fn golden_losses_are_scikit_learns() {
        let mut reliability = Reliability::default();
        for k in 0..1000u64 {
            let probability = (k * 7919 % 997) as f64 / 1000.0 + 0.001;
            reliability.add(k * 104_729 % 1013 < k * 7919 % 997, probability);
        }
        let report = reliability.report().unwrap();
        let [ece, log_loss, brier] = [0.026_417_000_000_000_003, 0.501_001_444_655_626_5, 0.166_632_433];
        assert!((report.expected_calibration_error - ece).abs() < 1e-12, "{report:?}");
        assert!((report.log_loss - log_loss).abs() < 1e-12 && (report.brier - brier).abs() < 1e-12, "{report:?}");
        assert_eq!(report.bins.len(), 15);
    }

    #[test]
    fn exact_ends_and_borders_of_bins() {
        let mut reliability = Reliability::default();
        assert!(reliability.report().is_none());
        for (untraversable, probability) in [(true, 1.0), (false, 0.0), (true, 0.5), (false, 0.5)] {
            reliability.add(untraversable, probability);
        }
        let report = reliability.report().unwrap();
        assert_eq!((report.expected_calibration_error, report.brier), (0.0, 0.125));
        assert!((report.log_loss - 0.5 * math::ln(2.0)).abs() < 1e-15);
        let shares: Vec<(u64, f64)> = report.bins.iter().map(|bin| (bin.cells, bin.untraversable_share)).collect();
        assert_eq!(shares, [(1, 0.0), (2, 0.5), (1, 1.0)]);
    }

    #[test]
    fn extreme_a_sure_cell_that_is_the_other_class_costs_a_number() {
        let mut reliability = Reliability::default();
        reliability.add(false, 1.0);
        reliability.add(true, 0.0);
        assert!(reliability.report().unwrap().log_loss == -math::ln(f64::MIN_POSITIVE));
    }

    #[test]
    fn exact_doubtful_cells_are_no_mistakes() {
        let mut doubt =
            Doubt { allowed_share: Some(0.1), between: [0.4, 0.6], cells: [0; 2], doubtful: [0; 2], wrong: [0; 2] };
        assert_eq!((doubt.share(), doubt.wrong_shares()), (0.0, [None; 2]));
        for (untraversable, output) in
            [(false, 0.1), (false, 0.4), (true, 0.39), (true, 0.5), (true, 0.9), (false, 0.6)]
        {
            doubt.add(untraversable, output);
        }
        assert_eq!((doubt.cells, doubt.doubtful, doubt.wrong), ([3, 3], [1, 1], [1, 1]));
        assert_eq!(doubt.share(), 2.0 / 6.0);
        assert_eq!(doubt.wrong_shares(), [Some(1.0 / 3.0); 2]);
        doubt.between = [0.5, 0.5];
        (doubt.cells, doubt.doubtful, doubt.wrong) = ([0; 2], [0; 2], [0; 2]);
        doubt.add(true, 0.5);
        doubt.add(false, 0.49);
        assert_eq!((doubt.doubtful, doubt.wrong), ([0; 2], [0; 2]));
    }
}
