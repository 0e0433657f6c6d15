//! Successive halving: all networks learn a little, the better ones more.
//!
//! Source: Jamieson & Talwalkar 2016; Hyperband's (Li et al. 2018) bracket without its restarts. Deviation: beside the best share of a
//! rung, every network goes on that no smaller one beats, so that the answer to "how small may it be?" is not thrown away early.

use serde::{Deserialize, Serialize};

use super::entry::Entry;
use crate::math;

/// One round.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Rung {
    /// That each network learns, rows of later epochs counted again.
    pub rows: u64,
    /// Networks that learn, the best of the rung before; those that no smaller one beats come on top.
    pub networks: usize,
}

/// `count` rungs: in the first each row is learnt once, in the last in all epochs, those between grow by one factor; a share `keep` of
/// the networks goes on from each to the next.
///
/// One pass is enough to rank networks by: of 69 of the paper's networks that were trained to the end, the ranks after one pass of 20,000
/// rows agree with the last by Spearman's rho 0.78, those after three passes by 1.00 (`scripts/results/search_full.md`).
pub(crate) fn rungs(networks: usize, rows: u64, epochs: u32, count: usize, keep: f64) -> Vec<Rung> {
    let mut left = networks;
    let mut rungs = Vec::new();
    for number in 1..=count {
        let part = (number as f64 - 1.0) / (count as f64 - 1.0);
        let passes = if number == count { f64::from(epochs) } else { math::exp(math::ln(f64::from(epochs)) * part) };
        rungs.push(Rung { rows: (passes * rows as f64).round() as u64, networks: left });
        left = ((left as f64 * keep).ceil() as usize).clamp(1, left);
    }
    rungs
}

/// The entries that go on, best first: the best `count`, and those that beat all smaller networks.
pub(crate) fn survivors(mut entries: Vec<Entry>, count: usize) -> Vec<Entry> {
    entries.sort_by(Entry::rank);
    let front: Vec<_> = front(&entries).into_iter().map(|entry| entry.hidden.clone()).collect();
    let goes_on = |(place, entry): (usize, Entry)| (place < count || front.contains(&entry.hidden)).then_some(entry);
    entries.into_iter().enumerate().filter_map(goes_on).collect()
}

/// The networks that have a lower error than every smaller one, smallest first.
pub(crate) fn front(entries: &[Entry]) -> Vec<&Entry> {
    let mut by_size: Vec<&Entry> = entries.iter().filter(|entry| entry.validation_error.is_some()).collect();
    by_size.sort_by(|a, b| a.weights.cmp(&b.weights).then_with(|| a.rank(b)));
    let mut front: Vec<&Entry> = Vec::new();
    for entry in by_size {
        if front.last().is_none_or(|best| entry.validation_error < best.validation_error) {
            front.push(entry);
        }
    }
    front
}

/// The smallest network whose error is above the lowest by a share of it of at most `margin`.
pub(crate) fn smallest_within(entries: &[Entry], margin: f64) -> Option<&Entry> {
    let front = front(entries);
    let limit = front.last()?.validation_error? * (1.0 + margin);
    front.into_iter().find(|entry| entry.validation_error.is_some_and(|error| error <= limit))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::train::stopping::Stop;

    pub(crate) fn entry(hidden: &[usize], weights: usize, error: f64) -> Entry {
        Entry {
            hidden: hidden.to_vec(),
            rung: 0,
            weights,
            rows: 100,
            best_rows: 100,
            validation_error: Some(error).filter(|error| error.is_finite()),
            error_by_scene: Vec::new(),
            balanced_accuracy: Some(1.0 - error),
            auc: Some(1.0 - 0.5 * error),
            stopped: Stop::Epochs,
            rejected: 0,
            rebuilt: 0,
            seconds: 0.5,
        }
    }

    #[test]
    fn exact_rungs_grow_from_one_pass_to_all_and_keep_their_share() {
        let rungs = rungs(258, 20_000, 8, 3, 0.25);
        let facts: Vec<(u64, usize)> = rungs.iter().map(|rung| (rung.rows, rung.networks)).collect();
        assert_eq!(facts, [(20_000, 258), (56_569, 65), (160_000, 17)]);
        assert_eq!(super::rungs(5, 10, 1, 1, 0.25), [Rung { rows: 10, networks: 5 }]);
        assert_eq!(super::rungs(3, 10, 1, 4, 0.01).last().map(|rung| rung.networks), Some(1));
    }

    #[test]
    fn exact_the_best_go_on_and_those_that_no_smaller_one_beats() {
        let entries = vec![
            entry(&[1], 10, 0.5),
            entry(&[2], 20, 0.6),
            entry(&[4], 40, 0.2),
            entry(&[8], 80, 0.1),
            entry(&[9], 90, 0.15),
            entry(&[3], 30, f64::NAN),
        ];
        let on = |count| survivors(entries.clone(), count).iter().map(|entry| entry.hidden[0]).collect::<Vec<_>>();
        assert_eq!(on(1), [8, 4, 1]);
        assert_eq!(on(2), [8, 9, 4, 1]);
        assert_eq!(on(6), [8, 9, 4, 1, 2, 3]);
    }

    #[test]
    fn exact_the_chosen_network_is_the_smallest_within_the_margin() {
        let entries = [entry(&[8], 80, 0.100), entry(&[4], 40, 0.104), entry(&[2], 20, 0.106), entry(&[5], 41, 0.101)];
        let chosen = |margin| smallest_within(&entries, margin).map(|entry| entry.hidden[0]);
        assert_eq!(chosen(0.0), Some(8));
        assert_eq!(chosen(0.015), Some(5));
        assert_eq!(chosen(0.05), Some(4));
        assert_eq!(chosen(1.0), Some(2));
        // Of two of one size the better one.
        let twins = [entry(&[3, 2], 40, 0.102), entry(&[2, 3], 40, 0.101), entry(&[9], 90, 0.1)];
        assert_eq!(smallest_within(&twins, 0.05).map(|entry| &entry.hidden[..]), Some(&[2, 3][..]));
    }

    #[test]
    fn extreme_no_network_or_none_with_a_finite_error_has_none_to_choose() {
        assert_eq!(smallest_within(&[], 0.1), None);
        assert_eq!(smallest_within(&[entry(&[1], 10, f64::NAN)], 0.1), None);
        assert_eq!(survivors(vec![entry(&[1], 10, f64::NAN)], 1).len(), 1);
    }
}
