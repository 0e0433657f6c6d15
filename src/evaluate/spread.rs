//! Errors by a measured number (points per cell, range) -> a table by bins, and Spearman's rank correlation.
//!
//! Source: Hewitt et al. 2017, figure 13: errors gather where the scan is sparse. The error of a cell is 0 or 1, so the ranks of
//! all cells follow from how many cells and errors there are at each distinct value: nothing has to be sorted or kept per cell.
//! Ties take their mean rank (Spearman 1904, Kendall 1948). Ranges are ranked to the centimetre.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::confusion::{Confusion, Rates};

/// Cells by a whole number: points, or centimetres.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spread {
    by_value: BTreeMap<u32, Confusion>,
}

/// The cells of one bin: values from `from` up to, not including, `to` (`None`: without end).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    pub from: f64,
    pub to: Option<f64>,
    pub counts: Confusion,
    #[serde(flatten)]
    pub rates: Rates,
}

impl Spread {
    pub(crate) fn add(&mut self, value: u32, untraversable: bool, called_untraversable: bool) {
        self.by_value.entry(value).or_default().add(untraversable, called_untraversable, 1);
    }

    /// Cells between ascending borders (`unit` to a border's 1); bins without a cell are left out.
    pub(crate) fn bins(&self, borders: &[u32], unit: f64) -> Vec<Bin> {
        let ends = borders.iter().skip(1).map(|&end| Some(end)).chain([None]);
        let bin = |(&from, to): (&u32, Option<u32>)| {
            let values = self.by_value.range(from..to.unwrap_or(u32::MAX));
            let mut counts = Confusion::default();
            values.for_each(|(_, &c)| counts += c);
            let (from, to) = (f64::from(from) / unit, to.map(|to| f64::from(to) / unit));
            Bin { from, to, counts, rates: counts.rates() }
        };
        borders.iter().zip(ends).map(bin).filter(|bin| bin.counts.total() > 0).collect()
    }

    /// Rank correlation of the value with being wrong, over all cells.
    pub(crate) fn rho(&self) -> Option<f64> {
        rho(self.by_value.values().map(|c| [c.total() - c.wrong(), c.wrong()]))
    }

    /// Rank correlation of the value with being called untraversable, over the truly traversable cells: figure 13's errors.
    pub(crate) fn rho_false_untraversable(&self) -> Option<f64> {
        rho(self.by_value.values().map(|c| [c.true_traversable, c.false_untraversable]))
    }
}

/// Spearman's rho of a value, ascending, with a mark: [cells without it, cells with it] at each value. `None` where all values or
/// all marks are one.
fn rho(at_each_value: impl Iterator<Item = [u64; 2]> + Clone) -> Option<f64> {
    let total: u64 = at_each_value.clone().map(|[a, b]| a + b).sum();
    let marked: u64 = at_each_value.clone().map(|[_, b]| b).sum();
    if marked == 0 || marked == total {
        return None;
    }
    let n = total as f64;
    let mean_rank = 0.5 * (n + 1.0);
    // Ranks of the mark: those without it share one mean rank, those with it the other.
    let without_rank = 0.5 * ((total - marked) as f64 + 1.0) - mean_rank;
    let with_rank = (total - marked) as f64 + 0.5 * (marked as f64 + 1.0) - mean_rank;
    let mark_squares = (total - marked) as f64 * without_rank * without_rank + marked as f64 * with_rank * with_rank;
    let (mut before, mut squares, mut products) = (0u64, 0.0, 0.0);
    for [without, with] in at_each_value {
        let here = without + with;
        let rank = before as f64 + 0.5 * (here as f64 + 1.0) - mean_rank;
        squares += here as f64 * rank * rank;
        products += rank * (without as f64 * without_rank + with as f64 * with_rank);
        before += here;
    }
    let scale = (squares * mark_squares).sqrt();
    (scale > 0.0).then(|| (products / scale).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_rho_is_plus_minus_one_for_marks_that_follow_the_value() {
        assert_eq!(rho([[1, 0], [0, 1]].into_iter()), Some(1.0));
        assert_eq!(rho([[0, 3], [3, 0]].into_iter()), Some(-1.0));
        assert_eq!(rho([[2, 2], [2, 2]].into_iter()), Some(0.0));
    }

    #[test]
    fn extreme_no_spread_has_no_rho() {
        let none: [[u64; 2]; 0] = [];
        assert_eq!(rho(none.into_iter()), None);
        assert_eq!(rho([[5, 5]].into_iter()), None);
        assert_eq!(rho([[5, 0], [2, 0]].into_iter()), None);
    }

    #[test]
    fn exact_bins_hold_what_lies_between_their_borders() {
        let mut spread = Spread::default();
        for points in 1..=10 {
            spread.add(points, false, points < 3);
        }
        let bins = spread.bins(&[1, 2, 3, 5, 9, 1000], 1.0);
        let seen: Vec<(f64, u64, u64)> = bins.iter().map(|b| (b.from, b.counts.total(), b.counts.wrong())).collect();
        assert_eq!(seen, [(1.0, 1, 1), (2.0, 1, 1), (3.0, 2, 0), (5.0, 4, 0), (9.0, 2, 0)]);
        assert_eq!(bins[4].to, Some(1000.0));
    }
}
