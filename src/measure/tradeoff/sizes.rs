//! Scenes in a list, and a seed -> which of them a classifier learns from and which stop its training, at each of four sizes.
//!
//! Of every six scenes five train and one stops, nearly as the shards of a corpus do (14 and 3 of 20). The sizes are an eighth, a quarter,
//! a half and the whole of both, each holding the one before it, so that a curve's points differ by what was added. Each seed begins at
//! another place of the list and goes round: small sizes of different seeds hold different scenes, and the spread over seeds tells what the
//! draw of scenes does too. At the whole all seeds hold the same scenes. All settings share the scenes of a seed: common random numbers.

/// Shares of the scenes, as 1 / n.
pub(crate) const SIZES: [usize; 4] = [8, 4, 2, 1];

/// What a scene is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Train,
    Stop,
}

impl Role {
    /// Of the k-th scene.
    pub(super) fn of(k: usize) -> Role {
        if k % 6 == 3 { Role::Stop } else { Role::Train }
    }
}

/// Fractions that fill [0, 1) evenly, however many are taken: 0, 1/2, 1/4, 3/4, ... (van der Corput 1935).
fn evenly(k: usize) -> f64 {
    (k as u64).reverse_bits() as f64 / 18_446_744_073_709_551_616.0
}

/// Scenes of one training, by their places in the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Chosen {
    pub train: Vec<usize>,
    pub stop: Vec<usize>,
}

impl Chosen {
    /// Of `count` scenes at a size (a place in [`SIZES`]), for a seed, from 0 on, of rounds of `per_round` seeds. Those of later rounds begin
    /// between those of the earlier ones.
    pub(super) fn of(count: usize, size: usize, seed: usize, per_round: usize) -> Chosen {
        let part = |role| {
            let all: Vec<usize> = (0..count).filter(|&k| Role::of(k) == role).collect();
            let between = evenly(seed / per_round) * all.len() as f64 / per_round as f64;
            let first = seed % per_round * all.len() / per_round + between as usize;
            (0..all.len().div_ceil(SIZES[size])).map(|k| all[(first + k) % all.len()]).collect()
        };
        Chosen { train: part(Role::Train), stop: part(Role::Stop) }
    }

    pub(super) fn all(&self) -> impl Iterator<Item = usize> + '_ {
        self.train.iter().chain(&self.stop).copied()
    }

    /// Scenes that have to be made.
    pub(super) fn count(&self) -> usize {
        self.train.len() + self.stop.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_every_six_scenes_hold_both_roles() {
        for start in [0, 6, 60] {
            let count = |role| (start..start + 6).filter(|&k| Role::of(k) == role).count();
            assert_eq!([Role::Train, Role::Stop].map(count), [5, 1]);
        }
    }

    #[test]
    fn law_a_size_holds_the_one_before_it_and_no_scene_twice() {
        for (count, seeds) in [(8, 1), (8, 3), (61, 5), (240, 2)] {
            for seed in 0..seeds {
                let chosen: Vec<Chosen> = (0..4).map(|size| Chosen::of(count, size, seed, seeds)).collect();
                for pair in chosen.windows(2) {
                    assert!(pair[1].train.starts_with(&pair[0].train) && pair[1].stop.starts_with(&pair[0].stop));
                }
                let mut whole: Vec<usize> = chosen[3].all().collect();
                whole.sort_unstable();
                assert_eq!(whole, (0..count).collect::<Vec<_>>());
                assert!(chosen.iter().all(|one| !one.train.is_empty() && !one.stop.is_empty()));
            }
        }
    }

    #[test]
    fn exact_later_rounds_begin_between_the_seeds_of_earlier_ones() {
        let firsts =
            |seeds: std::ops::Range<usize>| seeds.map(|seed| Chosen::of(240, 0, seed, 2).train[0]).collect::<Vec<_>>();
        // Of 200 scenes that train, 0 and 100 steps on; then a half and a quarter of 100 more. Five of every six scenes train.
        let scene = |k: usize| (0..240).filter(|&k| Role::of(k) == Role::Train).nth(k).unwrap();
        assert_eq!(firsts(0..6), [0, 100, 50, 150, 25, 125].map(scene));
    }

    #[test]
    fn law_the_smallest_sizes_of_seeds_share_no_scene() {
        let smallest = |seed| Chosen::of(240, 0, seed, 5);
        assert_eq!((smallest(0).train.len(), smallest(0).stop.len()), (25, 5));
        for (one, other) in [(0, 1), (3, 4), (4, 0)] {
            assert!(smallest(one).all().all(|k| smallest(other).all().all(|other| other != k)));
        }
    }
}
