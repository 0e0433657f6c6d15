//! This module counts, in one group of cells, what a classifier calls them.
//!
//! Cells, their scores and the thresholds go in, cell by cell. The confusions at each threshold come out, in the three weighings that `judge`
//! describes, with and without tops; beside them the scores of both classes.

use super::cell::Cell;
use super::confusion::Confusion;
use super::reliability::Reliability;
use super::threshold::Threshold;
use crate::statistics::scores::Scores;

/// Counts at one threshold, in three weighings, with and without tops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub cells: [Confusion; 2],
    pub points: [Confusion; 2],
    pub own_points: [Confusion; 2],
}

/// Index of the counts with tops, and without.
pub(super) const WITH_TOPS: usize = 0;
pub(super) const WITHOUT_TOPS: usize = 1;

/// One classifier in one group.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub scores: Scores,
    pub at: Vec<Counts>,
}

/// A group's cells by the network, and by the height difference alone.
#[derive(Clone, Debug)]
pub(super) struct Tally {
    pub cells: u64,
    pub points: u64,
    pub network: Panel,
    pub height: Panel,
    /// Of the probabilities, where the model gives any.
    pub reliability: Reliability,
}

impl Counts {
    fn add(&mut self, cell: &Cell, called: bool) {
        let points = cell.points.max(0) as u64;
        let (own, tops) = cell.own_truth();
        for (k, tops) in [(WITH_TOPS, 0), (WITHOUT_TOPS, tops)] {
            let only_tops = tops > 0 && tops == own;
            self.cells[k].add(cell.untraversable(), called, u64::from(!only_tops));
            self.points[k].add(cell.untraversable(), called, points - tops);
            self.own_points[k].add(true, called, own - tops);
            self.own_points[k].add(false, called, points - own);
        }
    }
}

impl Panel {
    pub(super) fn new(reach: f64, thresholds: usize) -> Panel {
        Panel { scores: Scores::new(reach), at: vec![Counts::default(); thresholds] }
    }

    pub(super) fn add(&mut self, cell: &Cell, score: f64, thresholds: &[Threshold]) {
        self.scores.add(cell.untraversable(), score);
        for (counts, threshold) in self.at.iter_mut().zip(thresholds) {
            counts.add(cell, score >= threshold.value);
        }
    }
}
