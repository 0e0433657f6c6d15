//! A trained network, scenes that it learnt and scenes held back -> what more scenes of the same kinds could still teach.
//!
//! A network knows the scenes that it learnt better than others like them. The more scenes there are, the closer both errors come, for both
//! tend to the error of endlessly many: one from below, the other from above (Cortes et al. 1993, "Learning curves: asymptotic values and rate of
//! convergence"). So the share by which the error on learnt scenes is the lower, the generalisation gap, is about the most that more scenes of these
//! kinds would take off the error. It says nothing of yards of other kinds.
//!
//! In: the objective, the weights kept, those of the first look, and both splits; of each whole row groups, a twentieth as many rows as were
//! learnt, a quarter of a million at least and two million at most. Those of the train split are of the windows that were learnt between the
//! first look and the weights kept, in the order in which they were; where there is only a window or two, all. Out: both weighted mean squared
//! errors, and the gap of a typical scene with its interval of 95 %. Scenes are hard or easy, and a few hard ones hold most of the error, which
//! moves the means of some hundred scenes more than a gap does. So of each scene the logarithm is taken of its error over that of the network
//! of the first look, which has seen none of these scenes, or some rows of them once. The gap is of the difference of these logarithms' means;
//! they scatter like other numbers do.

use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::order::{Epoch, WINDOW_GROUPS};
use super::validation::Objective;
use super::{Network, Sources, TrainError};
use crate::corpus::Split;
use crate::math;
use crate::statistics::{Interval, Moments, student};

/// Rows that are judged of a split, to the end of a row group: at least and at most.
const JUDGED: [u64; 2] = [262_144, 2_000_000];
/// One in so many of the rows that were learnt is judged: that costs little beside learning them.
const SHARE_OF_LEARNT: u64 = 20;
/// Added to the errors of a scene before a logarithm is taken: this share of the mean error of the network of the first look.
const FLOOR: f64 = 0.01;
/// A gap that is surely below this share of the error is not worth more scenes: about half a point where one cell in fifty is wrong.
const FLAT: f64 = 0.25;

/// Rows that are judged of each split after so many were learnt, where there are as many.
pub(crate) fn rows_judged(learnt: u64) -> u64 {
    (learnt / SHARE_OF_LEARNT).clamp(JUDGED[0], JUDGED[1])
}

/// How much less a network errs on what it learnt.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Generalisation {
    /// Weighted mean squared error on scenes that were learnt, and on scenes of the validation split.
    pub learnt: f64,
    pub held_back: f64,
    /// The share by which it is lower on a typical scene that was learnt, were both as hard; negative where it is higher.
    pub gap: Interval,
}

/// What is judged.
pub(super) struct Judged<'j> {
    pub sources: &'j Arc<Sources>,
    pub objective: &'j Objective,
    pub network: &'j Network,
    /// The weights of the first look.
    pub early: &'j [f64],
    /// Rows that were learnt before the first look, before the weights kept, and in all; rows to learn.
    pub early_rows: u64,
    pub kept_rows: u64,
    pub learnt: u64,
    pub train_rows: u64,
    pub seed: u64,
}

/// Weighted squared errors of a scene, by the network kept and by that of the first look, and the weight of its rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Scene {
    kept: f64,
    early: f64,
    weight: f64,
}

impl Generalisation {
    /// `None` where nothing was learnt between the first look and the weights kept, the first look knows all scenes already, or an error is not finite
    /// or nought.
    pub(super) fn of(judged: &Judged) -> Result<Option<Generalisation>, TrainError> {
        let groups = judged.sources.groups(Split::Train);
        let Judged { early_rows, kept_rows, train_rows, .. } = *judged;
        let windows = learnt_between(early_rows, kept_rows, train_rows, groups.len());
        if windows.is_empty() {
            return Ok(None);
        }
        let all = 0..judged.sources.groups(Split::Validation).len();
        // Scenes of one split are read while those of the other are judged.
        let (learnt, held_back) =
            rayon::join(|| judged.scenes(Split::Train, windows), || judged.scenes(Split::Validation, all));
        Ok(Generalisation::of_scenes(&learnt?, &held_back?))
    }

    fn of_scenes(learnt: &[Scene], held_back: &[Scene]) -> Option<Generalisation> {
        let sum = |of: fn(&Scene) -> f64| learnt.iter().chain(held_back).map(of).sum::<f64>();
        let floor = FLOOR * sum(|scene| scene.early) / sum(|scene| scene.weight);
        let [below, above] =
            [learnt, held_back].map(|scenes| Moments::of(scenes.iter().map(|scene| scene.log_share(floor))));
        let (below, above) = (below?, above?);
        let both = math::exp(below.mean - above.mean);
        if !both.is_finite() || both == 0.0 || floor == 0.0 {
            return None;
        }
        let of_mean =
            |moments: &Moments, scenes: &[Scene]| moments.variance.map(|variance| variance / scenes.len() as f64);
        let half_width = match (of_mean(&below, learnt), of_mean(&above, held_back)) {
            (Some(below), Some(above)) => {
                let t = student(learnt.len().min(held_back.len()) - 1, 0.95);
                both * t * (below + above).sqrt()
            }
            _ => f64::INFINITY,
        };
        let gap = Interval { mean: 1.0 - both, half_width };
        Some(Generalisation { learnt: error(learnt), held_back: error(held_back), gap })
    }

    /// Whether more scenes of the same kinds would hardly lower the error.
    pub(crate) fn is_closed(&self) -> bool {
        self.gap.upper() <= FLAT
    }
}

impl Judged<'_> {
    /// Of row groups at these places of a random order, as many as are to be judged.
    fn scenes(&self, split: Split, places: Range<usize>) -> Result<Vec<Scene>, TrainError> {
        let Judged { sources, objective, network, .. } = *self;
        let early = Network { layout: network.layout.clone(), weights: self.early.to_vec() };
        let groups = sources.groups(split);
        let (mut scenes, mut judged) = (Vec::new(), 0);
        for &group in &Epoch::new(self.seed, 0).groups(groups.len())[places] {
            for rows in sources.read_by_scene(split, groups[group as usize])? {
                judged += rows.len() as u64;
                let (kept, early) = (objective.sum(network, &rows), objective.sum(&early, &rows));
                scenes.push(Scene { kept: kept.squared, early: early.squared, weight: kept.weight });
            }
            if judged >= rows_judged(self.learnt) {
                break;
            }
        }
        scenes.retain(|scene| scene.weight > 0.0);
        Ok(scenes)
    }
}

/// Places in the first epoch's order of so many row groups that were learnt between two moments, told by the rows learnt before each; of
/// `train_rows` in all.
fn learnt_between(first: u64, last: u64, train_rows: u64, groups: usize) -> Range<usize> {
    if first >= last.min(train_rows) {
        return 0..0;
    }
    let windows = |rows: u64| rows as f64 / train_rows as f64 * groups as f64 / WINDOW_GROUPS as f64;
    let from = WINDOW_GROUPS * windows(first).ceil() as usize;
    let is_whole = last >= train_rows;
    let to = if is_whole { groups } else { WINDOW_GROUPS * windows(last) as usize };
    match (from < to, is_whole) {
        (true, _) => from..to,
        // The rows of a window are mixed: the first look has met some of each scene, once.
        (false, true) => 0..groups,
        (false, false) => 0..0,
    }
}

impl Scene {
    /// Logarithm of the error of the network kept over that of the first look's, both with something added, so that none is nought.
    fn log_share(&self, floor: f64) -> f64 {
        let floor = floor * self.weight;
        math::ln((self.kept + floor) / (self.early + floor))
    }
}

/// Of the network kept, over scenes.
fn error(scenes: &[Scene]) -> f64 {
    let (squared, weight) = scenes.iter().fold((0.0, 0.0), |sum, scene| (sum.0 + scene.kept, sum.1 + scene.weight));
    squared / weight
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stage, Streams};

    fn scenes(of: &[[f64; 3]]) -> Vec<Scene> {
        of.iter().map(|&[kept, early, weight]| Scene { kept, early, weight }).collect()
    }

    #[test]
    fn exact_windows_learnt_between_the_first_look_and_the_weights_kept_are_judged() {
        let of = |early_rows, kept_rows, groups| learnt_between(early_rows, kept_rows, 1000, groups);
        // 100 row groups of ten rows in windows of eight: the first look ends in the second window, the weights kept in the seventh.
        assert_eq!(of(100, 500, 100), 16..48);
        assert_eq!(of(100, 5000, 100), 16..100);
        assert_eq!(of(100, 180, 100), 0..0);
        assert_eq!(of(200, 1000, 5), 0..5);
        assert_eq!(of(200, 900, 5), 0..0);
        assert_eq!(of(500, 500, 100), 0..0);
        assert_eq!(of(1000, 3000, 100), 0..0);
    }

    #[test]
    fn exact_the_gap_of_two_scenes_each_by_hand() {
        // What is added is 0.01 of early's mean, which is 1: logarithms -1 and -2, and 0 and -1; variances 1/2; t of one degree of freedom is 12.706.
        let kept = |log: f64| 1.01 * math::exp(log) - 0.01;
        let learnt = scenes(&[[kept(-1.0), 1.0, 1.0], [kept(-2.0), 1.0, 1.0]]);
        let found = Generalisation::of_scenes(&learnt, &scenes(&[[1.0, 1.0, 1.0], [kept(-1.0), 1.0, 1.0]])).unwrap();
        assert!((found.learnt - 0.5 * (kept(-1.0) + kept(-2.0))).abs() < 1e-15);
        assert!((found.held_back - 0.5 * (1.0 + kept(-1.0))).abs() < 1e-15);
        let both = math::exp(-1.0);
        assert!((found.gap.mean - (1.0 - both)).abs() < 1e-14, "{found:?}");
        let expected = 12.706_204_736 * both * (0.25_f64 + 0.25).sqrt();
        assert!((found.gap.half_width - expected).abs() < 1e-8, "{} for {expected}", found.gap.half_width);
    }

    #[test]
    fn extreme_of_one_scene_nothing_is_sure_and_of_no_error_there_is_no_gap() {
        let two = scenes(&[[2.0, 4.0, 5.0], [3.0, 4.0, 5.0]]);
        let one = Generalisation::of_scenes(&scenes(&[[1.0, 4.0, 5.0]]), &two).unwrap();
        assert_eq!(one.gap.half_width, f64::INFINITY);
        assert!(!one.is_closed());
        for (kept, early) in [(0.0, 0.0), (f64::NAN, 1.0), (1.0, f64::INFINITY), (1.0, f64::NAN)] {
            let of = scenes(&[[kept, early, 5.0], [1.0, early, 5.0]]);
            assert_eq!(Generalisation::of_scenes(&of, &of), None, "{kept}, {early}");
        }
        assert_eq!(Generalisation::of_scenes(&[], &two), None);
    }

    #[test]
    fn law_the_interval_holds_the_true_gap_as_often_as_it_says_and_is_narrower_for_the_first_look() {
        let stream = Streams { seed: 5, scene: 0, attempt: 0, stage: Stage::Train, step: 0 }.open(Purpose::TrainScenes);
        let mut drawn_so_far = 0;
        let mut uniform = || {
            drawn_so_far += 1;
            stream.uniform(drawn_so_far)
        };
        // Scenes are up to ten times as hard as others, which both networks have; each errs by up to a quarter more or less beside it.
        let mut drawn = |mean: f64, count: usize| {
            let mut one = |_| {
                let (weight, hard) = (0.5 + uniform(), 0.1 + 0.9 * uniform());
                let kept = mean * hard * (0.75 + 0.5 * uniform());
                Scene { kept: weight * kept, early: weight * 2.0 * hard * (0.75 + 0.5 * uniform()), weight }
            };
            (0..count).map(&mut one).collect::<Vec<_>>()
        };
        let (rounds, mut held, mut widths) = (2000, 0, [0.0; 2]);
        for _ in 0..rounds {
            let (learnt, held_back) = (drawn(0.7, 40), drawn(1.0, 30));
            let found = Generalisation::of_scenes(&learnt, &held_back).unwrap();
            held += u32::from((found.gap.mean - 0.3).abs() <= found.gap.half_width);
            let as_if_alike =
                |of: &[Scene]| of.iter().map(|scene| Scene { early: scene.weight, ..*scene }).collect::<Vec<_>>();
            let plain = Generalisation::of_scenes(&as_if_alike(&learnt), &as_if_alike(&held_back)).unwrap();
            widths = [widths[0] + found.gap.half_width, widths[1] + plain.gap.half_width];
        }
        // 0.95 within four standard deviations, and half a point for what is added to the errors.
        let held = f64::from(held) / f64::from(rounds);
        assert!((held - 0.95).abs() < 4.0 * (0.95 * 0.05 / f64::from(rounds)).sqrt() + 0.005, "{held}");
        assert!(widths[0] < 0.5 * widths[1], "{widths:?}");
    }
}
