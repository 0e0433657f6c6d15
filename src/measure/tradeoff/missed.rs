//! Outputs for the cells of some scenes -> the share of the untraversable missed where 2 % of the traversable are called so.
//!
//! In: outputs in [0, 1] and labels, scene by scene. Kept: how many cells of either class lie on the wrong side of some thresholds in each
//! scene, so that the share can be told of the scenes counted by any weights, as a bootstrap needs it: of other scenes another threshold calls
//! 2 % wrongly. The thresholds are those at which all scenes together have 0.125 to 32 % called so, each a quarter of an octave from the
//! next, and those that call all and none; between two of them the missed run straight in the falsely called. Not kept: the outputs.

use std::ops::Range;

use crate::math;
use crate::statistics::scores::Scores;

/// Share of the traversable cells called untraversable at which the missed ones are told.
pub(super) const FALSE_SHARE: f64 = 0.02;
/// Thresholds on either side of that share, and how many of them halve or double it.
const ON_A_SIDE: i32 = 16;
const AN_OCTAVE: f64 = 4.0;

/// Wrong cells of each scene of a group at some thresholds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WrongByThreshold {
    /// Of each threshold, ascending, and each scene: traversable cells called untraversable, and untraversable ones that are not. The first
    /// threshold calls all cells so, the last one none.
    wrong: Vec<Vec<[u32; 2]>>,
}

impl WrongByThreshold {
    /// Of the rows of each scene; `cell`: whether the cell of a row is untraversable, and the output for it.
    pub(super) fn of(scenes: &[Range<usize>], cell: impl Fn(usize) -> (bool, f64)) -> WrongByThreshold {
        let mut scores = Scores::new(1.0);
        scenes
            .iter()
            .flat_map(Range::clone)
            .map(&cell)
            .for_each(|(untraversable, output)| scores.add(untraversable, output));
        let roc = scores.roc();
        let threshold = |step: i32| {
            let share = FALSE_SHARE * math::pow(2.0, f64::from(step) / AN_OCTAVE);
            roc.iter().find(|at| at.false_untraversable <= share).map(|at| at.threshold)
        };
        let between = (-ON_A_SIDE..=ON_A_SIDE).rev().filter_map(threshold).filter(|&threshold| threshold < 1.0);
        let mut thresholds: Vec<f64> = [f64::NEG_INFINITY].into_iter().chain(between).chain([f64::INFINITY]).collect();
        thresholds.dedup();
        let mut kept = WrongByThreshold { wrong: vec![Vec::new(); thresholds.len()] };
        for rows in scenes {
            // By how many thresholds a cell is called untraversable -> such cells of either class.
            let mut called = vec![[0; 2]; thresholds.len() + 1];
            for (untraversable, output) in rows.clone().map(&cell) {
                called[thresholds.partition_point(|&threshold| threshold <= output)][usize::from(untraversable)] += 1;
            }
            let mut wrong = [called.iter().map(|counts| counts[0]).sum(), 0];
            for (at, counts) in kept.wrong.iter_mut().zip(&called) {
                wrong = [wrong[0] - counts[0], wrong[1] + counts[1]];
                at.push(wrong);
            }
        }
        kept
    }

    /// Share of the untraversable missed at [`FALSE_SHARE`], each scene counted so often; `None` where a class is absent.
    pub(super) fn missed(&self, weights: &[u64]) -> Option<f64> {
        let sum = |scenes: &[[u32; 2]], class: usize| {
            scenes.iter().zip(weights).map(|(counts, weight)| weight * u64::from(counts[class])).sum::<u64>() as f64
        };
        let (traversable, untraversable) = (sum(&self.wrong[0], 0), sum(&self.wrong[self.wrong.len() - 1], 1));
        if traversable == 0.0 || untraversable == 0.0 {
            return None;
        }
        let rates = |scenes: &[[u32; 2]]| [sum(scenes, 0) / traversable, sum(scenes, 1) / untraversable];
        let above = self.wrong.partition_point(|scenes| sum(scenes, 0) > FALSE_SHARE * traversable);
        let [[low_false, low_missed], [high_false, high_missed]] = [above - 1, above].map(|k| rates(&self.wrong[k]));
        let share = (low_false - FALSE_SHARE) / (low_false - high_false);
        Some(low_missed + share * (high_missed - low_missed))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::random::{Purpose, Stage, Streams};

    /// Scenes of cells that were drawn: an untraversable one in five, the outputs of either class overlapping.
    pub(in super::super) fn drawn(scenes: usize, cells: usize) -> (Vec<Range<usize>>, Vec<(bool, f64)>) {
        let stream =
            Streams { seed: 5, scene: 0, attempt: 0, stage: Stage::Train, step: 0 }.open(Purpose::TradeoffBootstrap);
        let cell = |k: usize| {
            let untraversable = k.is_multiple_of(5);
            let middle = if untraversable { 1.5 } else { -1.5 } + 0.5 * math::sin((k / cells) as f64);
            (untraversable, 1.0 / (1.0 + math::exp(-middle - stream.normal(k as u64))))
        };
        ((0..scenes).map(|scene| scene * cells..(scene + 1) * cells).collect(), (0..scenes * cells).map(cell).collect())
    }

    /// All outputs tried as a threshold, each scene's cells repeated as often as it counts.
    pub(in super::super) fn brute_force(scenes: &[Range<usize>], cells: &[(bool, f64)], weights: &[u64]) -> f64 {
        let mut all: Vec<(bool, f64)> = Vec::new();
        for (rows, &weight) in scenes.iter().zip(weights) {
            (0..weight).for_each(|_| all.extend(&cells[rows.clone()]));
        }
        let of = |class: bool| all.iter().filter(|cell| cell.0 == class).map(|cell| cell.1).collect::<Vec<f64>>();
        let (mut traversable, untraversable) = (of(false), of(true));
        traversable.sort_by(f64::total_cmp);
        let called = (FALSE_SHARE * traversable.len() as f64) as usize;
        let threshold = traversable[traversable.len() - called];
        untraversable.iter().filter(|output| **output < threshold).count() as f64 / untraversable.len() as f64
    }

    #[test]
    fn equal_missed_of_any_weights_and_every_output_tried_as_threshold() {
        let (scenes, cells) = drawn(24, 1000);
        let kept = WrongByThreshold::of(&scenes, |row| cells[row]);
        let weights = [vec![1; 24], (0..24).map(|k| k % 3).collect(), (0..24).map(|k| u64::from(k < 4)).collect()];
        for weights in weights {
            let (found, expected) = (kept.missed(&weights).unwrap(), brute_force(&scenes, &cells, &weights));
            // A quarter of an octave between thresholds, and 2 % of 3200 cells or more.
            assert!(expected > 0.02 && (found - expected).abs() < 0.01, "{found} {expected}");
        }
    }

    #[test]
    fn extreme_outputs_that_tell_nothing_and_scenes_of_one_class() {
        let one_scene = |cells: &[(bool, f64)]| {
            let cells = cells.to_vec();
            WrongByThreshold::of(std::slice::from_ref(&(0..cells.len())), |row| cells[row])
        };
        assert_eq!(one_scene(&[(true, 0.9), (true, 0.1)]).missed(&[1]), None);
        assert_eq!(one_scene(&[(true, 0.9), (false, 0.1)]).missed(&[0]), None);
        assert_eq!(one_scene(&[(true, 0.9), (false, 0.1)]).missed(&[1]), Some(0.0));
        // All alike, also where outputs have come to their end; and the wrong way round: by chance 2 % of both are called.
        for (untraversable, traversable) in [(0.5, 0.5), (0.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let found = one_scene(&[(true, untraversable), (false, traversable)]).missed(&[1]).unwrap();
            assert!((found - 0.98).abs() < 1e-12, "{untraversable} {traversable}: {found}");
        }
        // Scenes of one class each: together they hold both.
        let cells = [(true, 0.9), (true, 0.2), (false, 0.4), (false, 0.1)];
        let kept = WrongByThreshold::of(&[0..2, 2..4], |row| cells[row]);
        assert_eq!(kept.missed(&[1, 0]), None);
        // No threshold lies between the two traversable: half is missed without a false call, nothing where all are called.
        assert!((kept.missed(&[1, 1]).unwrap() - 0.49).abs() < 1e-12);
    }
}
