//! The outputs of a validation split -> what an output means: how probable it is that the cell is untraversable, and what other
//! thresholds are worth.
//!
//! A network that learns targets t0 and t1 with both classes weighed alike gives no probability: its output is near t0 + (t1 - t0) p, p as
//! if both classes were as frequent. Two numbers set both right: with q = (output - t0) / (t1 - t0), kept within [edge, 1 - edge] ([`Loss::edge`]),
//!
//! ```text
//! logit P(untraversable) = slope * logit q + offset
//! ```
//!
//! by maximum likelihood over the cells of the validation scenes. Source: Platt 1999, with his targets, which keep the slope finite where the
//! classes do not overlap; Newton's iteration as Lin, Lin & Weng 2007 guard it. Deviation: of q in place of the output, and from a
//! histogram of 65,536 bins, so that memory does not grow with the split. The probability is of a cell as cells occur on
//! the validation scenes: on ground with other shares of the classes it is off by their ratio of odds.
//!
//! A curve of thresholds beside it says which share of each class they called wrongly on the same cells.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::validation::each_group;
use super::{Loss, Model, Sources, TrainError};
use crate::corpus::Split;
use crate::math;
use crate::statistics::scores::Scores;

/// What the outputs of a network meant on its validation scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    pub slope: f64,
    pub offset: f64,
    /// How near to a target an output tells something yet, in shares of the way between them; 0.01 where it is not named.
    #[serde(default = "unnamed_edge", skip_serializing_if = "is_unnamed_edge")]
    pub edge: f64,
    /// Traversable and untraversable cells that it was fitted to.
    pub cells: [u64; 2],
    /// Rising thresholds of the output; for each, the share of the untraversable cells below it, which are missed, and of the traversable
    /// ones from it on, which are false alarms.
    pub curve: Vec<[f64; 3]>,
}

/// Shares of a class that a curve has a threshold for, in each decade from 1e-4 on, up to one half.
const SHARES: [f64; 6] = [1.0, 1.5, 2.0, 3.0, 5.0, 7.0];

/// Newton's steps at most; a fit takes some ten.
const MOST_STEPS: usize = 100;

impl Calibration {
    /// Of a model that learnt by a loss, on the validation scenes of what it was trained on; `None` where they lack a class.
    pub(super) fn of(model: &Model, loss: Loss, sources: &Arc<Sources>) -> Result<Option<Calibration>, TrainError> {
        let mut scores = Scores::new(1.0);
        each_group(Arc::clone(sources), Split::Validation, |rows| {
            let judged = rows
                .labels
                .iter()
                .zip(model.outputs_in_parallel(&rows.features))
                .filter(|(_, output)| !output.is_nan());
            judged.for_each(|(label, output)| scores.add(label.is_untraversable(), output));
        })?;
        Ok(Calibration::of_scores(&scores, model.about.targets, loss.edge(model.about.targets)))
    }

    fn of_scores(scores: &Scores, targets: [f64; 2], edge: f64) -> Option<Calibration> {
        let cells = scores.totals();
        if cells.contains(&0) {
            return None;
        }
        let bin = |(output, cells)| Bin { x: place(output, targets, edge), cells };
        let bins: Vec<Bin> = scores.bins().map(bin).collect();
        let [slope, offset] = fit(&bins, cells);
        Some(Calibration { slope, offset, edge, cells, curve: curve(scores) })
    }

    /// The probability that a cell of that output is untraversable; NaN for NaN.
    pub(crate) fn probability(&self, output: f64, targets: [f64; 2]) -> f64 {
        sigmoid(self.slope * place(output, targets, self.edge) + self.offset)
    }

    /// The highest threshold of the curve that misses at most that share of the untraversable cells.
    pub(super) fn missing_at_most(&self, share: f64) -> Option<f64> {
        self.curve.iter().rev().find(|[_, missed, _]| *missed <= share).map(|[threshold, ..]| *threshold)
    }

    /// The lowest threshold of the curve that calls at most that share of the traversable cells untraversable.
    pub(super) fn alarming_at_most(&self, share: f64) -> Option<f64> {
        self.curve.iter().find(|[_, _, alarms]| *alarms <= share).map(|[threshold, ..]| *threshold)
    }

    /// The shares missed and falsely called at a threshold of the curve.
    pub(crate) fn worth(&self, threshold: f64) -> Option<[f64; 2]> {
        self.curve.iter().find(|point| point[0] == threshold).map(|[_, missed, alarms]| [*missed, *alarms])
    }

    /// What contradicts itself.
    pub(super) fn fault(&self) -> Option<String> {
        let in_unit = |points: &[f64; 3]| points.iter().all(|share| (0.0..=1.0).contains(share));
        let rising =
            |pair: &[[f64; 3]]| pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1] && pair[0][2] >= pair[1][2];
        if ![self.slope, self.offset].iter().all(|number| number.abs() <= MOST) {
            return Some(format!("a calibration of slope {} and offset {}", self.slope, self.offset));
        }
        if !(LEAST_EDGE..0.5).contains(&self.edge) {
            return Some(format!("a calibration with an edge of {}, not of {LEAST_EDGE} to 0.5", self.edge));
        }
        let sound =
            self.curve.len() <= MOST_POINTS && self.curve.iter().all(in_unit) && self.curve.windows(2).all(rising);
        (!sound).then(|| "thresholds of the validation scenes that do not rise within 0 and 1".into())
    }
}

/// Beyond any slope or offset that a fit gives: Platt's targets keep it below the logarithm of the number of cells, over that of the edge.
const MOST: f64 = 1e6;
/// Less than any loss has, and enough for a logit that is finite.
const LEAST_EDGE: f64 = 1e-9;
/// More than a curve has.
const MOST_POINTS: usize = 256;

/// What files mean that name no edge: all of formats 3 to 6.
fn unnamed_edge() -> f64 {
    0.01
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde hands over a reference.
fn is_unnamed_edge(edge: &f64) -> bool {
    *edge == unnamed_edge()
}

/// The logit of where an output lies between its targets.
fn place(output: f64, [low, high]: [f64; 2], edge: f64) -> f64 {
    let share = ((output - low) / (high - low)).clamp(edge, 1.0 - edge);
    math::ln(share / (1.0 - share))
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + math::exp(-x))
}

/// Cells of one place.
struct Bin {
    x: f64,
    /// Traversable and untraversable.
    cells: [u64; 2],
}

/// Platt's loss at a slope and an offset, its gradient, and its second derivatives (slope, both, offset).
struct LogLoss {
    value: f64,
    gradient: [f64; 2],
    curvature: [f64; 3],
}

impl LogLoss {
    fn at(bins: &[Bin], targets: [f64; 2], [slope, offset]: [f64; 2]) -> LogLoss {
        let mut loss = LogLoss { value: 0.0, gradient: [0.0; 2], curvature: [0.0; 3] };
        for Bin { x, cells } in bins {
            let z = slope * x + offset;
            let p = sigmoid(z);
            // ln(1 + e^-|z|): neither p nor 1 - p is ever the argument of a logarithm.
            let soft = math::ln_1p(math::exp(-z.abs()));
            for (&count, target) in cells.iter().zip(targets) {
                let count = count as f64;
                loss.value += count * (soft + z.max(0.0) - target * z);
                loss.gradient[0] += count * (p - target) * x;
                loss.gradient[1] += count * (p - target);
            }
            let weight = (cells[0] + cells[1]) as f64 * p * (1.0 - p);
            for (sum, term) in loss.curvature.iter_mut().zip([x * x, *x, 1.0]) {
                *sum += weight * term;
            }
        }
        loss
    }
}

/// Slope and offset of the least loss.
fn fit(bins: &[Bin], [traversable, untraversable]: [u64; 2]) -> [f64; 2] {
    let (low, high) = (traversable as f64, untraversable as f64);
    let targets = [1.0 / (low + 2.0), (high + 1.0) / (high + 2.0)];
    let mut at = [0.0, math::ln((high + 1.0) / (low + 1.0))];
    let mut loss = LogLoss::at(bins, targets, at);
    for _ in 0..MOST_STEPS {
        // A ridge: where all cells are of one place, no slope is better than another.
        let [a, b, c] = loss.curvature;
        let (a, c) = (a + RIDGE, c + RIDGE);
        let determinant = a * c - b * b;
        let [g, h] = loss.gradient;
        let step = [(b * h - c * g) / determinant, (b * g - a * h) / determinant];
        let descent = g * step[0] + h * step[1];
        let lengths = std::iter::successors(Some(1.0), |length| Some(0.5 * length)).take(HALVINGS);
        let downhill = lengths.map(|length: f64| {
            let there = [at[0] + length * step[0], at[1] + length * step[1]];
            let found = LogLoss::at(bins, targets, there);
            (found.value < loss.value + ARMIJO * length * descent).then_some((there, found))
        });
        // No step is downhill: the least loss that the arithmetic can tell.
        let Some((there, found)) = downhill.flatten().next() else { break };
        let gained = loss.value - found.value;
        (at, loss) = (there, found);
        if gained <= 1e-14 * loss.value {
            break;
        }
    }
    at
}

const RIDGE: f64 = 1e-12;
const HALVINGS: usize = 30;
const ARMIJO: f64 = 1e-4;

/// For each share the highest threshold that misses at most so much, and the lowest that gives at most so many false alarms.
fn curve(scores: &Scores) -> Vec<[f64; 3]> {
    let all = scores.roc();
    let decades = [1e-4, 1e-3, 1e-2, 1e-1];
    let shares = || decades.iter().flat_map(|decade| SHARES.map(|share| share * decade)).filter(|share| *share <= 0.5);
    let missing = shares().filter_map(|share| all.iter().rposition(|point| point.missed_untraversable <= share));
    let alarming = shares().filter_map(|share| all.iter().position(|point| point.false_untraversable <= share));
    let mut kept: Vec<usize> = missing.chain(alarming).collect();
    kept.sort_unstable();
    kept.dedup();
    let numbers = |point: usize| {
        let point = &all[point];
        [point.threshold, point.missed_untraversable, point.false_untraversable]
    };
    kept.into_iter().map(numbers).collect()
}

#[cfg(test)]
mod tests;
