//! Seed and epoch -> the order in which rows are learnt.
//!
//! Row groups are permuted, then the rows of eight of them at a time (a window). Each permutation is drawn at an address of its own,
//! so that any window can be had without those before it. Source: Fisher & Yates; Lemire 2019 for whole numbers below a bound.

use rand::Rng;

use crate::random::{Purpose, Stage, Streams};

/// Row groups whose rows are mixed with each other.
pub(crate) const WINDOW_GROUPS: usize = 8;

/// One pass over the train split.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Epoch {
    streams: Streams,
}

impl Epoch {
    pub(crate) fn new(seed: u64, epoch: u32) -> Epoch {
        let streams = Streams { seed, scene: u64::from(epoch), attempt: 0, stage: Stage::Train, step: 0 };
        Epoch { streams }
    }

    /// All row groups, each once.
    pub(crate) fn groups(&self, count: usize) -> Vec<u32> {
        permutation(count, &mut self.streams.open(Purpose::TrainGroups).generator_at(0))
    }

    /// The rows of a window, each once.
    pub(crate) fn rows(&self, window: u32, count: usize) -> Vec<u32> {
        permutation(count, &mut self.streams.open(Purpose::TrainRows).generator_at(u64::from(window)))
    }
}

/// 0, 1, ... in random order, all orders alike.
pub(crate) fn permutation(count: usize, rng: &mut impl Rng) -> Vec<u32> {
    let mut order: Vec<u32> = (0..count as u32).collect();
    for last in (1..count).rev() {
        order.swap(last, below(last as u32 + 1, rng) as usize);
    }
    order
}

/// A whole number in [0, bound), all alike: the few products that would favour some are drawn again.
fn below(bound: u32, rng: &mut impl Rng) -> u32 {
    loop {
        let product = u64::from(rng.next_u32()) * u64::from(bound);
        if product as u32 >= bound.wrapping_neg() % bound {
            return (product >> 32) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_permutation(order: &[u32]) -> bool {
        let mut sorted = order.to_vec();
        sorted.sort_unstable();
        sorted.iter().enumerate().all(|(i, &x)| i as u32 == x)
    }

    #[test]
    fn law_orders_hold_each_number_once_and_differ_by_epoch_window_and_seed() {
        for count in [0, 1, 2, 3, 1000] {
            assert!(is_permutation(&Epoch::new(3, 0).groups(count)));
            assert!(is_permutation(&Epoch::new(3, 0).rows(5, count)));
        }
        let base = Epoch::new(3, 0);
        assert_eq!(base.rows(0, 100), Epoch::new(3, 0).rows(0, 100));
        assert_ne!(base.groups(100), Epoch::new(3, 1).groups(100));
        assert_ne!(base.groups(100), Epoch::new(4, 0).groups(100));
        assert_ne!(base.rows(0, 100), base.rows(1, 100));
        assert_ne!(base.rows(0, 100), base.groups(100));
    }

    #[test]
    fn dist_every_row_is_as_likely_at_every_place() {
        // 60,000 permutations of 6: each of the 36 counts is 10,000 +- 91.
        let mut counts = [[0u32; 6]; 6];
        for window in 0..60_000 {
            for (place, row) in Epoch::new(1, 0).rows(window, 6).into_iter().enumerate() {
                counts[place][row as usize] += 1;
            }
        }
        let chi2: f64 = counts.iter().flatten().map(|&c| (f64::from(c) - 1e4) * (f64::from(c) - 1e4) / 1e4).sum();
        // 25 degrees of freedom: 99.9 % below 52.6.
        assert!(chi2 < 52.6, "{chi2}");
    }
}
