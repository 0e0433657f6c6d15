//! Scores of both classes -> ROC, AUC and the best threshold, in bounded memory.
//!
//! In: scores in [0, `reach`] of traversable and untraversable cells. Out: the area under the ROC curve, its points, the
//! threshold with the best balanced accuracy. Kept: a histogram of 65,536 equal bins. Two scores of one bin count as a tie
//! (half), so the AUC is off by at most [`Scores::auc_bound`], which is stated beside it; ties of equal scores are exact, as in
//! Mann & Whitney 1947. Memory is 1 MB, whatever the number of rows.

use serde::{Deserialize, Serialize};

/// Bins of the histogram: a power of two, so that borders are exact.
pub(crate) const BINS: usize = 1 << 16;

/// A histogram of scores by class.
#[derive(Clone, Debug)]
pub(crate) struct Scores {
    reach: f64,
    /// Traversable and untraversable cells per bin.
    bins: Vec<[u64; 2]>,
}

/// One threshold of a ROC curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RocPoint {
    pub threshold: f64,
    pub false_untraversable: f64,
    pub missed_untraversable: f64,
}

impl Scores {
    /// For scores up to `reach`; higher ones share the last bin, lower ones than 0 the first.
    pub(crate) fn new(reach: f64) -> Scores {
        Scores { reach, bins: vec![[0; 2]; BINS] }
    }

    /// Counts a cell. A NaN score is the caller's to keep away.
    pub(crate) fn add(&mut self, untraversable: bool, score: f64) {
        // `as` saturates: the bin is 0 below the range, the last one beyond it.
        let bin = ((score / self.reach * BINS as f64) as usize).min(BINS - 1);
        self.bins[bin][usize::from(untraversable)] += 1;
    }

    /// Traversable and untraversable cells.
    pub(crate) fn totals(&self) -> [u64; 2] {
        self.bins.iter().fold([0; 2], |sum, bin| [sum[0] + bin[0], sum[1] + bin[1]])
    }

    /// Probability that an untraversable cell scores higher than a traversable one, ties half; `None` where a class is empty.
    pub(crate) fn auc(&self) -> Option<f64> {
        let [traversable, untraversable] = self.totals();
        let mut below = 0u64;
        let mut wins = 0.0;
        for bin in &self.bins {
            wins += bin[1] as f64 * (below as f64 + 0.5 * bin[0] as f64);
            below += bin[0];
        }
        (traversable > 0 && untraversable > 0).then(|| wins / (traversable as f64 * untraversable as f64))
    }

    /// How far the AUC may be off because unequal scores shared a bin.
    pub(crate) fn auc_bound(&self) -> f64 {
        let [traversable, untraversable] = self.totals();
        let ties: f64 = self.bins.iter().map(|bin| bin[0] as f64 * bin[1] as f64).sum();
        let pairs = traversable as f64 * untraversable as f64;
        if pairs > 0.0 { 0.5 * ties / pairs } else { 0.0 }
    }

    /// The bins that hold a score, ascending: the middle of each, and its traversable and untraversable cells.
    pub(crate) fn bins(&self) -> impl Iterator<Item = (f64, [u64; 2])> + '_ {
        let middle = |bin: usize| 0.5 * (self.border(bin) + self.border(bin + 1));
        self.bins
            .iter()
            .enumerate()
            .filter(|(_, counts)| **counts != [0; 2])
            .map(move |(bin, counts)| (middle(bin), *counts))
    }

    /// Lower border of a bin: scores from it on are called untraversable.
    fn border(&self, bin: usize) -> f64 {
        bin as f64 / BINS as f64 * self.reach
    }

    /// The curve at every border where it moves, from "everything untraversable" to "nothing"; empty where a class is empty.
    pub(crate) fn roc(&self) -> Vec<RocPoint> {
        let [traversable, untraversable] = self.totals();
        if traversable == 0 || untraversable == 0 {
            return Vec::new();
        }
        let mut below = [0u64; 2];
        let mut points = Vec::new();
        let point = |bin: usize, below: [u64; 2]| RocPoint {
            threshold: self.border(bin),
            false_untraversable: (traversable - below[0]) as f64 / traversable as f64,
            missed_untraversable: below[1] as f64 / untraversable as f64,
        };
        points.push(point(0, below));
        for (bin, counts) in self.bins.iter().enumerate().filter(|(_, counts)| **counts != [0; 2]) {
            below = [below[0] + counts[0], below[1] + counts[1]];
            points.push(point(bin + 1, below));
        }
        points
    }

    /// The threshold of the best balanced accuracy: the middle of the first best stretch between two bins with cells.
    pub(crate) fn best_threshold(&self) -> Option<f64> {
        let [traversable, untraversable] = self.totals();
        if traversable == 0 || untraversable == 0 {
            return None;
        }
        let cost = |below: [u64; 2]| {
            (traversable - below[0]) as f64 / traversable as f64 + below[1] as f64 / untraversable as f64
        };
        let (mut below, mut best, mut best_cost) = ([0u64; 2], 0, cost([0; 2]));
        for (bin, counts) in self.bins.iter().enumerate() {
            below = [below[0] + counts[0], below[1] + counts[1]];
            if cost(below) < best_cost {
                (best, best_cost) = (bin + 1, cost(below));
            }
        }
        // Up to the next bin that holds a cell all thresholds call these cells alike; the middle is fairest to others.
        let next = self.bins.iter().skip(best).position(|counts| *counts != [0; 2]).map_or(best, |ahead| best + ahead);
        Some(0.5 * (self.border(best) + self.border(next)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;

    fn scores(pairs: &[(f64, bool)]) -> Scores {
        let mut scores = Scores::new(1.0);
        pairs.iter().for_each(|&(score, untraversable)| scores.add(untraversable, score));
        scores
    }

    #[test]
    fn exact_auc_of_separate_reversed_and_equal_scores() {
        assert_eq!(scores(&[(0.1, false), (0.9, true)]).auc(), Some(1.0));
        assert_eq!(scores(&[(0.9, false), (0.1, true)]).auc(), Some(0.0));
        assert_eq!(scores(&[(0.5, false), (0.5, true), (0.5, false)]).auc(), Some(0.5));
        // Of four pairs three are right and one is a tie.
        assert_eq!(scores(&[(0.1, false), (0.4, false), (0.4, true), (0.8, true)]).auc(), Some(3.5 / 4.0));
    }

    #[test]
    fn equal_auc_and_all_pairs_counted() {
        let pairs: Vec<(f64, bool)> = (0..400)
            .map(|k| {
                let x = f64::from(k);
                let untraversable = math::sin(1.7 * x) > 0.4;
                (0.5 + 0.3 * math::sin(0.9 * x) + if untraversable { 0.15 } else { 0.0 }, untraversable)
            })
            .collect();
        let of = |class: bool| pairs.iter().filter(move |pair| pair.1 == class).map(|pair| pair.0);
        let wins: f64 = of(true)
            .flat_map(|high| {
                of(false).map(move |low| {
                    if high > low {
                        1.0
                    } else if high == low {
                        0.5
                    } else {
                        0.0
                    }
                })
            })
            .sum();
        let exact = wins / (of(true).count() * of(false).count()) as f64;
        let scores = scores(&pairs);
        assert!((scores.auc().unwrap() - exact).abs() <= scores.auc_bound() + 1e-15);
        assert!(scores.auc_bound() < 1e-3);
    }

    #[test]
    fn extreme_one_class_or_none_has_no_auc_and_no_threshold() {
        for scores in [scores(&[]), scores(&[(0.3, true)]), scores(&[(0.3, false), (0.9, false)])] {
            assert_eq!((scores.auc(), scores.auc_bound(), scores.best_threshold()), (None, 0.0, None));
            assert!(scores.roc().is_empty());
        }
    }

    #[test]
    fn extreme_scores_beyond_the_range_take_the_outer_bins() {
        let scores = scores(&[(-3.0, false), (f64::INFINITY, true), (1.0, true), (0.0, false)]);
        assert_eq!((scores.bins[0], scores.bins[BINS - 1]), ([2, 0], [0, 2]));
    }

    #[test]
    fn exact_the_best_threshold_lies_midway_between_the_classes() {
        let threshold = scores(&[(0.1, false), (0.25, false), (0.75, true), (0.9, true)]).best_threshold().unwrap();
        assert!((threshold - 0.5).abs() < 1e-4, "{threshold}");
        // Classes count alike: one missed cell of two weighs as much as half of the traversable ones.
        let mut uneven: Vec<(f64, bool)> = (0..100).map(|k| (f64::from(k) / 200.0, false)).collect();
        uneven.extend([(0.4, true), (0.6, true)]);
        let threshold = scores(&uneven).best_threshold().unwrap();
        assert!((0.3949..=0.4001).contains(&threshold), "{threshold}");
    }
}
