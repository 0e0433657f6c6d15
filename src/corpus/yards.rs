//! Two corpora -> the yards that both hold, and in which splits.
//!
//! A scene's yard follows from the seed, the scene's number and the `scene` section of its family: neither the drive nor the sensor
//! makes another yard of it, the same ground seen from elsewhere is still the same ground. So a corpus says one hash per kind of
//! yard (seed and `scene` section): where two corpora have one of these in common, scenes of equal number are taken for the same yard.
//! With several families that is an upper bound: a number may have been drawn for another family there, and one held out is drawn in
//! test shards alone.

use std::ops::AddAssign;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Split;

/// Which yards a corpus holds, and how they are dealt to the splits.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Yards {
    pub seed: u64,
    /// Hashes of the kinds of yard, ascending; none where that is not known.
    pub yards: Vec<String>,
    pub scenes: u64,
    pub scenes_per_shard: u32,
}

/// Scenes that two corpora have in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Common {
    pub scenes: u64,
    /// The lowest number among them, where there is any.
    pub first: Option<u64>,
}

impl AddAssign for Common {
    fn add_assign(&mut self, other: Common) {
        self.scenes += other.scenes;
        self.first = [self.first, other.first].into_iter().flatten().min();
    }
}

/// By the split here, then by the split there.
pub(crate) type CommonBySplit = [[Common; 3]; 3];

/// The greatest numbers that a config may have: what a file says beyond them is not counted through.
const MOST_SCENES: u64 = 1_000_000_000;
const MOST_SCENES_PER_SHARD: u32 = 100_000;

/// Shards after which the splits come again.
const TURN: u64 = 20;

impl Yards {
    /// Whether it can be said which yards these are.
    pub(crate) fn known(&self) -> bool {
        !self.yards.is_empty()
    }

    /// The scenes that both hold. Counted by whole shards, and by whole turns of both splits where there are many.
    pub(crate) fn common(&self, other: &Yards) -> CommonBySplit {
        let mut common = CommonBySplit::default();
        if !self.yards.iter().any(|kind| other.yards.contains(kind)) {
            return common;
        }
        let end = self.scenes.min(other.scenes).min(MOST_SCENES);
        let sizes = [self.size(), other.size()];
        let period = TURN * lcm(sizes[0], sizes[1]);
        for (times, end) in [(end / period, period), (1, end % period)] {
            for (here, there, scenes) in runs(sizes, if times == 0 { 0 } else { end }) {
                let count = times * (scenes.end - scenes.start);
                common[here as usize][there as usize] += Common { scenes: count, first: Some(scenes.start) };
            }
        }
        common
    }

    fn size(&self) -> u64 {
        u64::from(self.scenes_per_shard.clamp(1, MOST_SCENES_PER_SHARD))
    }
}

/// Scenes from 0 on, in runs that lie in one shard of either corpus.
fn runs([ours, theirs]: [u64; 2], end: u64) -> impl Iterator<Item = (Split, Split, std::ops::Range<u64>)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let (here, there) = (at / ours, at / theirs);
        let run = at..((here + 1) * ours).min((there + 1) * theirs).min(end);
        at = run.end;
        (!run.is_empty()).then(|| (Split::of_shard(here), Split::of_shard(there), run))
    })
}

fn lcm(a: u64, b: u64) -> u64 {
    let (mut gcd, mut rest) = (a, b);
    while rest > 0 {
        (gcd, rest) = (rest, gcd % rest);
    }
    a / gcd * b
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;
    use crate::plan::yard_kind;

    fn yards(kind: &str, scenes: u64, scenes_per_shard: u32) -> Yards {
        Yards { seed: 3, yards: vec![kind.into()], scenes, scenes_per_shard }
    }

    /// Scene by scene.
    fn listed(a: &Yards, b: &Yards) -> CommonBySplit {
        let mut common = CommonBySplit::default();
        for scene in 0..a.scenes.min(b.scenes) {
            let split = |yards: &Yards| Split::of_shard(scene / u64::from(yards.scenes_per_shard)) as usize;
            common[split(a)][split(b)] += Common { scenes: 1, first: Some(scene) };
        }
        common
    }

    #[test]
    fn equal_counts_by_runs_and_scene_by_scene() {
        for (ours, theirs) in
            [((28, 4), (28, 2)), ((7, 1), (14, 1)), ((1000, 3), (999, 7)), ((4000, 1), (4001, 10)), ((60, 60), (60, 1))]
        {
            let (a, b) = (yards("k", ours.0, ours.1), yards("k", theirs.0, theirs.1));
            assert_eq!(a.common(&b), listed(&a, &b), "{ours:?} {theirs:?}");
        }
    }

    #[test]
    fn exact_scenes_24_and_25_are_test_scenes_of_one_and_train_scenes_of_the_other() {
        let common = yards("k", 28, 4).common(&yards("k", 28, 2));
        assert_eq!(common[Split::Test as usize][Split::Train as usize], Common { scenes: 2, first: Some(24) });
    }

    #[test]
    fn law_equal_shards_share_within_splits_alone_and_other_kinds_nothing() {
        let common = yards("k", 100, 5).common(&yards("k", 700, 5));
        for (here, row) in common.iter().enumerate() {
            assert!(row.iter().enumerate().all(|(there, common)| (common.scenes > 0) == (here == there)));
        }
        assert_eq!(yards("k", 100, 5).common(&yards("l", 100, 5)), CommonBySplit::default());
        let unknown = Yards { yards: Vec::new(), ..yards("k", 100, 5) };
        assert_eq!(unknown.common(&unknown), CommonBySplit::default());
    }

    #[test]
    fn extreme_ten_million_scenes_and_absurd_numbers_are_counted_at_once() {
        let started = Instant::now();
        for (a, b) in [
            ((10_000_000, 1), (10_000_000, 3)),
            ((10_000_000, 997), (10_000_000, 1000)),
            ((u64::MAX, 0), (u64::MAX, u32::MAX)),
            ((1_000_000_000, 1), (1_000_000_000, 99_991)),
        ] {
            let common = yards("k", a.0, a.1).common(&yards("k", b.0, b.1));
            let all: u64 = common.iter().flatten().map(|common| common.scenes).sum();
            assert_eq!(all, a.0.min(MOST_SCENES));
        }
        // Some ten million steps at the very most in a build without optimisation; by listing it would be minutes.
        assert!(started.elapsed() < Duration::from_secs(10), "{:?}", started.elapsed());
    }

    #[test]
    fn exact_a_kind_is_of_seed_and_section() {
        let section = |rocks: u32| serde_json::json!({"extent_m": 20.0, "rocks": rocks});
        assert_eq!(yard_kind(3, &section(5)), yard_kind(3, &section(5)));
        assert_ne!(yard_kind(3, &section(5)), yard_kind(4, &section(5)));
        assert_ne!(yard_kind(3, &section(5)), yard_kind(3, &section(6)));
    }
}
