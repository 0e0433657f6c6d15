//! An output and its target -> what steps of what learns by batches lower.
//!
//! Source: the squared error is the paper's (Hewitt et al. 2017); the logarithmic loss is the negative log-likelihood of labels whose
//! probability is the output (Bishop 2006, section 5.2). With either, a row's least lies where the output is what the label is on average;
//! they differ in what they pay for a cell that is nearly sure. By the squared error the outputs of all easy cells crowd about their target, and
//! how they are ranked there is chance; by the logarithmic one a share of 0.001 and one of 0.01 are told apart.
//!
//! Not here: the errors that looks, reports and searches tell, which are squared whatever was lowered, so that none of them is without a bound.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What an output costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// Half of (target - output)^2, as the Kalman filters have it.
    Squared,
    /// -t ln output - (1 - t) ln(1 - output) of a target t: what is surely right or wrong is told apart down to the smallest shares.
    Logarithmic,
}

/// Targets by which the logarithmic loss tells shares apart right up to them.
const OF_PROBABILITIES: [f64; 2] = [0.0, 1.0];

impl Loss {
    /// Outputs for both classes where a config names none.
    pub(crate) fn usual_targets(self) -> [f64; 2] {
        match self {
            Loss::Squared => [0.1, 0.9],
            Loss::Logarithmic => OF_PROBABILITIES,
        }
    }

    /// d (weight * loss) / d sum of the output neuron, of the output.
    #[inline]
    pub(crate) fn slope(self, weight: f64, output: f64, target: f64) -> f64 {
        match self {
            Loss::Squared => weight * (output - target) * output * (1.0 - output),
            Loss::Logarithmic => weight * (output - target),
        }
    }

    /// Outputs nearer to their targets than this, in shares of the way between these, tell no more than one at this distance. Towards 0 and 1
    /// the logarithmic loss goes on telling shares apart, and 1e-4 is seven bins of the histogram that a calibration is of; about
    /// any other target outputs scatter, by either loss.
    pub(crate) fn edge(self, targets: [f64; 2]) -> f64 {
        match self {
            Loss::Logarithmic if targets == OF_PROBABILITIES => 1e-4,
            Loss::Squared | Loss::Logarithmic => 0.01,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;

    #[test]
    fn equal_slopes_and_differences_of_the_losses() {
        let output = |sum: f64| 1.0 / (1.0 + math::exp(-sum));
        for (target, sum) in [(0.1, -2.5), (0.9, 0.3), (0.0, -6.0), (1.0, 4.0), (0.0, 3.0)] {
            for loss in [Loss::Squared, Loss::Logarithmic] {
                let of = |y: f64| match loss {
                    Loss::Squared => 0.5 * (target - y) * (target - y),
                    Loss::Logarithmic => -target * math::ln(y) - (1.0 - target) * math::ln(1.0 - y),
                };
                let h = 1e-5;
                let wanted = 3.0 * (of(output(sum + h)) - of(output(sum - h))) / (2.0 * h);
                let slope = loss.slope(3.0, output(sum), target);
                assert!((slope - wanted).abs() < 1e-8, "{loss:?}, {target}, {sum}: {slope} {wanted}");
            }
        }
    }

    #[test]
    fn extreme_outputs_that_are_exactly_their_targets_or_the_opposite_have_finite_slopes() {
        for (output, target, slope) in [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 2.0), (0.0, 1.0, -2.0)] {
            assert_eq!(Loss::Logarithmic.slope(2.0, output, target), slope);
            assert_eq!(Loss::Squared.slope(2.0, output, target), 0.0);
        }
    }

    #[test]
    fn exact_the_edge_is_of_the_loss_and_its_targets() {
        assert_eq!(Loss::Logarithmic.edge([0.0, 1.0]), 1e-4);
        assert_eq!(Loss::Logarithmic.edge([0.1, 0.9]), 0.01);
        assert_eq!(Loss::Squared.edge([0.0, 1.0]), 0.01);
    }
}
