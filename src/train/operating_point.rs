//! What a user asks of a classifier -> borders between classes of a model's output.
//!
//! A trained network's own threshold treats both classes alike. Who would rather drive a detour than into a rock moves it: by its
//! value, or by the share of the untraversable cells that may be missed. Who can look twice takes two: what lies between them is
//! *doubtful*. Shares are of cells on the validation scenes that the model knows of; scenes of another kind have others.

use super::model::{About, ModelError};

/// Where outputs are told apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum OperatingPoint {
    /// The model's own thresholds.
    #[default]
    Model,
    /// These, rising within [0, 1].
    Thresholds(Vec<f64>),
    /// One that misses at most that share of the untraversable cells, as high as that allows.
    MissAtMost(f64),
    /// Two: below the first at most that share of the untraversable cells lies, from the second on at most that share of the traversable ones.
    /// Between them a cell is doubtful.
    Doubtful(f64),
}

/// Thresholds that a report or a scan may have at most.
pub(crate) const MOST_THRESHOLDS: usize = 16;

/// Class of an output: the number of thresholds at or below it.
pub(crate) fn class(thresholds: &[f64], output: f64) -> usize {
    thresholds.iter().filter(|&&threshold| output >= threshold).count()
}

impl OperatingPoint {
    pub(super) fn thresholds(&self, about: &About) -> Result<Vec<f64>, ModelError> {
        let calibration = about.calibration.as_ref().ok_or(ModelError::Uncalibrated);
        let unreached = |share: f64| ModelError::Unreached { share };
        match self {
            OperatingPoint::Model => Ok(about.thresholds.clone()),
            OperatingPoint::Thresholds(given) => {
                let rising = given.windows(2).all(|pair| pair[0] < pair[1]);
                let in_unit = given.iter().all(|threshold| (0.0..=1.0).contains(threshold));
                let sound = rising && in_unit && (1..=MOST_THRESHOLDS).contains(&given.len());
                if sound { Ok(given.clone()) } else { Err(ModelError::Thresholds(given.clone())) }
            }
            OperatingPoint::MissAtMost(share) => {
                Ok(vec![calibration?.missing_at_most(*share).ok_or_else(|| unreached(*share))?])
            }
            OperatingPoint::Doubtful(share) => {
                let calibration = calibration?;
                let low = calibration.missing_at_most(*share).ok_or_else(|| unreached(*share))?;
                let high = calibration.alarming_at_most(*share).ok_or_else(|| unreached(*share))?;
                // One threshold keeps both: any between them does, and nothing is doubtful.
                Ok(if low < high { vec![low, high] } else { vec![0.5 * (low + high)] })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Calibration;
    use crate::train::model::tests::model;

    fn calibrated() -> About {
        let mut about = model(&["a"], &[2], true).about;
        // Threshold, missed, false alarms.
        let curve = vec![[0.1, 0.0, 0.9], [0.3, 0.01, 0.2], [0.5, 0.05, 0.04], [0.6, 0.2, 0.01], [0.9, 1.0, 0.0]];
        about.calibration = Some(Calibration { slope: 1.0, offset: 0.0, edge: 0.01, cells: [100, 100], curve });
        about
    }

    #[test]
    fn exact_thresholds_by_what_is_asked() {
        let about = calibrated();
        let at = |point: OperatingPoint| point.thresholds(&about).unwrap();
        assert_eq!(at(OperatingPoint::Model), [0.5]);
        assert_eq!(at(OperatingPoint::Thresholds(vec![0.2, 0.4])), [0.2, 0.4]);
        assert_eq!(at(OperatingPoint::MissAtMost(0.01)), [0.3]);
        assert_eq!(at(OperatingPoint::MissAtMost(0.049)), [0.3]);
        assert_eq!(at(OperatingPoint::MissAtMost(0.5)), [0.6]);
        assert_eq!(at(OperatingPoint::Doubtful(0.01)), [0.3, 0.6]);
        // At 0.5 neither share is above 5 %.
        assert_eq!(at(OperatingPoint::Doubtful(0.05)), [0.5]);
        assert_eq!(at(OperatingPoint::Doubtful(0.2)), [0.5 * (0.6 + 0.3)]);
    }

    #[test]
    fn extreme_what_cannot_be_had_is_refused_with_a_cure() {
        let mut about = calibrated();
        let refused = |about: &About, point: OperatingPoint| point.thresholds(about).unwrap_err().to_string();
        for given in [vec![], vec![0.5, 0.5], vec![0.6, 0.4], vec![-0.1], vec![f64::NAN], vec![0.0; 17]] {
            assert!(refused(&about, OperatingPoint::Thresholds(given)).contains("rising numbers within 0 and 1"));
        }
        about.calibration.as_mut().unwrap().curve.remove(0);
        assert!(refused(&about, OperatingPoint::MissAtMost(0.001)).contains("0.1 %"));
        about.calibration = None;
        for point in [OperatingPoint::MissAtMost(0.01), OperatingPoint::Doubtful(0.01)] {
            assert!(refused(&about, point).contains("train again"));
        }
    }
}
