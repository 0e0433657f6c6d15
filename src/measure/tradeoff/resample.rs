//! Test scenes in groups, and trainings by seed -> how sure a figure of both is.
//!
//! A figure depends on the scenes that were drawn to test and on the trainings that were drawn to be tested. Both are drawn anew, each with
//! replacement and independently of the other, scenes within their groups (Owen 2007, "The pigeonhole bootstrap": the variance of a mean
//! over a crossed table, never too small on average). Of n there are n - 1 drawn, so that the variance of a mean is s^2 / n, and not
//! (n - 1) / n of it, however few seeds there are (Rao & Wu 1988). The same draws serve every setting, so differences are of pairs.
//! An interval of 95 % is Student's: degrees of freedom by Welch & Satterthwaite from what seeds and scenes each bring. Not covered: the draw
//! of the scenes that all seeds train on at the whole size; the setting with other draws tells what that does.

use std::ops::Range;

use super::missed::WrongByThreshold;
use crate::evaluate::Confusion;
use crate::random::{Purpose, Stage, Streams};
use crate::statistics::{Interval, Moments, student};

/// Draws of the bootstrap: the relative error of a standard deviation is then 1 / sqrt(2 * 800), 2.5 %.
const DRAWS: usize = 800;

/// Which scenes and which trainings each draw holds; scenes of several groups.
pub(super) struct Resampling {
    groups: Vec<Range<usize>>,
    seeds: usize,
    draws: Vec<Draw>,
}

/// How often a draw holds each scene (group after group) and each training.
struct Draw {
    scenes: Vec<u64>,
    seeds: Vec<f64>,
}

/// A figure of each training on all scenes, and on the scenes of each draw.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Resampled {
    by_seed: Vec<f64>,
    /// Draw after draw, of each the trainings; NaN where a draw holds no scene with some class.
    by_draw: Vec<f64>,
}

impl Resampling {
    /// Of scenes in groups (by their places) and so many trainings.
    pub(super) fn new(seed: u64, groups: Vec<Range<usize>>, seeds: usize) -> Resampling {
        let draws = (0..DRAWS as u64).map(|draw| {
            let counts = |step: usize, of: usize| {
                let streams = Streams { seed, scene: draw, attempt: 0, stage: Stage::Train, step: step as u32 };
                let stream = streams.open(Purpose::TradeoffBootstrap);
                let mut counts = vec![0; of];
                for k in 0..of.saturating_sub(1).max(usize::from(of == 1)) {
                    counts[((stream.uniform(k as u64) * of as f64) as usize).min(of - 1)] += 1;
                }
                counts
            };
            let scenes = groups.iter().enumerate().flat_map(|(step, group)| counts(step, group.len())).collect();
            let drawn = counts(groups.len(), seeds);
            let total = drawn.iter().sum::<u64>().max(1) as f64;
            Draw { scenes, seeds: drawn.into_iter().map(|count| count as f64 / total).collect() }
        });
        let draws = draws.collect();
        Resampling { groups, seeds, draws }
    }

    /// The mean balanced accuracy of the groups that hold both classes; of each training what it makes of all scenes.
    pub(super) fn balanced_accuracy(&self, trainings: &[&[Confusion]]) -> Resampled {
        self.resampled(trainings.len(), |training, group, weights| {
            pooled(&trainings[training][self.groups[group].clone()], weights)
        })
    }

    /// The mean share of the untraversable missed at a fixed share of false calls; of each training what it makes of each group.
    pub(super) fn missed(&self, trainings: &[&[WrongByThreshold]]) -> Resampled {
        self.resampled(trainings.len(), |training, group, weights| trainings[training][group].missed(weights))
    }

    /// The mean over groups of a figure of a training, a group and how often each of its scenes counts.
    fn resampled(&self, trainings: usize, figure: impl Fn(usize, usize, &[u64]) -> Option<f64>) -> Resampled {
        let mean = |training: usize, scenes: &[u64]| {
            let (mut sum, mut count, mut first) = (0.0, 0.0, 0);
            for (group, members) in self.groups.iter().enumerate() {
                let weights = &scenes[first..first + members.len()];
                first += members.len();
                if let Some(value) = figure(training, group, weights) {
                    sum += value;
                    count += 1.0;
                }
            }
            sum / count
        };
        let of = |scenes: &[u64]| (0..trainings).map(|training| mean(training, scenes)).collect::<Vec<_>>();
        let ones = vec![1; self.groups.iter().map(Range::len).sum()];
        Resampled { by_seed: of(&ones), by_draw: self.draws.iter().flat_map(|draw| of(&draw.scenes)).collect() }
    }

    /// Variance of the mean over trainings, of scenes and trainings together; infinite for a single training, which says nothing of others.
    pub(super) fn variance(&self, figure: &Resampled) -> f64 {
        if self.seeds < 2 {
            return f64::INFINITY;
        }
        let drawn = figure.by_draw.chunks_exact(self.seeds).zip(&self.draws);
        let means =
            drawn.map(|(of, draw)| of.iter().zip(&draw.seeds).map(|(value, weight)| weight * value).sum::<f64>());
        Moments::of(means.filter(|mean| !mean.is_nan())).and_then(|moments| moments.variance).unwrap_or(f64::INFINITY)
    }

    /// Mean over trainings, and its interval of 95 %.
    pub(super) fn interval(&self, figure: &Resampled) -> Interval {
        let (mean, variance) = (figure.mean(), self.variance(figure));
        if variance == 0.0 || variance.is_infinite() {
            return Interval { mean, half_width: variance };
        }
        let of_seeds = Moments::of(figure.by_seed.iter().copied()).map_or(0.0, |m| m.standard_error());
        let seeds = (of_seeds * of_seeds).min(variance);
        let scenes = variance - seeds;
        let free = |part: f64, freedom: usize| part * part / freedom.max(1) as f64;
        let scenes_free: usize = self.groups.iter().map(|group| group.len().saturating_sub(1)).sum();
        let freedom = variance * variance / (free(seeds, self.seeds - 1) + free(scenes, scenes_free));
        Interval { mean, half_width: student((freedom as usize).max(1), 0.95) * variance.sqrt() }
    }
}

/// Balanced accuracy over all cells of scenes, each counted so often; `None` where a class is absent.
fn pooled(scenes: &[Confusion], weights: &[u64]) -> Option<f64> {
    let mut sum = Confusion::default();
    for (scene, weight) in scenes.iter().zip(weights) {
        sum.true_traversable += weight * scene.true_traversable;
        sum.false_untraversable += weight * scene.false_untraversable;
        sum.missed_untraversable += weight * scene.missed_untraversable;
        sum.true_untraversable += weight * scene.true_untraversable;
    }
    sum.rates().balanced_accuracy
}

/// Of one group, over all its scenes.
pub(super) fn of_group(tested: &[Confusion], group: &Range<usize>) -> Option<f64> {
    pooled(&tested[group.clone()], &vec![1; group.len()])
}

impl Resampled {
    pub(super) fn mean(&self) -> f64 {
        self.by_seed.iter().sum::<f64>() / self.by_seed.len() as f64
    }

    pub(super) fn by_seed(&self) -> &[f64] {
        &self.by_seed
    }

    /// `self + share * (other - self)`, training by training and draw by draw.
    pub(super) fn towards(&self, other: &Resampled, share: f64) -> Resampled {
        self.combined(other, |a, b| a + share * (b - a))
    }

    /// `self - other`.
    pub(super) fn minus(&self, other: &Resampled) -> Resampled {
        self.combined(other, |a, b| a - b)
    }

    fn combined(&self, other: &Resampled, of: impl Fn(f64, f64) -> f64) -> Resampled {
        let both = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(&a, &b)| of(a, b)).collect();
        Resampled { by_seed: both(&self.by_seed, &other.by_seed), by_draw: both(&self.by_draw, &other.by_draw) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::missed::tests::{brute_force, drawn};
    use super::*;

    /// Scenes of 1000 cells of each class: balanced accuracy is then a mean over scenes, whose variance is known on paper.
    fn tested(wrong: impl Fn(usize) -> u64, scenes: usize) -> Vec<Confusion> {
        let scene = |k: usize| Confusion {
            true_traversable: 1000,
            false_untraversable: 0,
            missed_untraversable: wrong(k),
            true_untraversable: 1000 - wrong(k),
        };
        (0..scenes).map(scene).collect()
    }

    fn one_group(scenes: usize) -> Vec<Range<usize>> {
        std::iter::once(0..scenes).collect()
    }

    fn resampled(resampling: &Resampling, by_seed: &[Vec<Confusion>]) -> Resampled {
        resampling.balanced_accuracy(&by_seed.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }

    fn variance(values: impl Iterator<Item = f64> + Clone) -> f64 {
        Moments::of(values).unwrap().variance.unwrap()
    }

    #[test]
    fn law_the_variance_is_that_of_both_means_where_effects_add_up() {
        let (scenes, seeds) = (40, 5);
        let resampling = Resampling::new(7, one_group(scenes), seeds);
        let (of_scene, of_seed) = (|k: usize| (k * 37 % 101) as u64, |s: usize| (s * 17 % 29) as u64);
        let all: Vec<_> = (0..seeds).map(|s| tested(|k| of_scene(k) + of_seed(s), scenes)).collect();
        let figure = resampled(&resampling, &all);
        // A cell of 1000 missed is half a thousandth of balanced accuracy.
        let part = |values: &[u64]| variance(values.iter().map(|&v| 0.0005 * v as f64)) / values.len() as f64;
        let expected =
            part(&(0..scenes).map(of_scene).collect::<Vec<_>>()) + part(&(0..seeds).map(of_seed).collect::<Vec<_>>());
        // 800 draws: the variance has a relative standard error of sqrt(2 / 800), 5 %.
        let found = resampling.variance(&figure);
        assert!((found / expected - 1.0).abs() < 0.2, "{found} {expected}");
        let mean =
            all.iter().flatten().map(|c| c.rates().balanced_accuracy.unwrap()).sum::<f64>() / (scenes * seeds) as f64;
        assert!((figure.mean() - mean).abs() < 1e-12);
    }

    #[test]
    fn law_what_settings_share_is_in_no_difference() {
        let resampling = Resampling::new(7, one_group(30), 3);
        let one: Vec<_> = (0..3).map(|s| tested(|k| (k * 31 % 97 + 11 * s) as u64, 30)).collect();
        let two: Vec<_> = (0..3).map(|s| tested(|k| (k * 31 % 97 + 11 * s) as u64 + 20, 30)).collect();
        let gain = resampled(&resampling, &one).minus(&resampled(&resampling, &two));
        let interval = resampling.interval(&gain);
        assert!((interval.mean - 0.01).abs() < 1e-12 && interval.half_width < 1e-12, "{interval:?}");
        let of_one = resampling.interval(&resampled(&resampling, &one));
        assert!(of_one.half_width > 0.005, "{of_one:?}");
    }

    #[test]
    fn equal_missed_of_each_draw_and_its_cells_repeated() {
        // Two groups behind a scene that is in none; the second has every fourth output lowered, and each training its own outputs.
        let (scenes, cells) = drawn(14, 400);
        let groups = [1..6, 6..14];
        let output = |training: usize, row: usize| {
            let (untraversable, output) = cells[(row + 5 * training) % cells.len()];
            let lower = row >= scenes[6].start && row.is_multiple_of(4);
            (untraversable, if lower { 0.3 * output } else { output })
        };
        let all: Vec<Vec<(bool, f64)>> =
            (0..3).map(|training| (0..cells.len()).map(|row| output(training, row)).collect()).collect();
        let kept: Vec<Vec<WrongByThreshold>> = all
            .iter()
            .map(|cells| groups.iter().map(|g| WrongByThreshold::of(&scenes[g.clone()], |row| cells[row])).collect())
            .collect();
        let resampling = Resampling::new(3, groups.to_vec(), 3);
        let figure = resampling.missed(&kept.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let expected = |cells: &[(bool, f64)], weights: &[u64]| {
            0.5 * (brute_force(&scenes[1..6], cells, &weights[..5]) + brute_force(&scenes[6..14], cells, &weights[5..]))
        };
        let mut off = Vec::new();
        for (draw, found) in resampling.draws.iter().zip(figure.by_draw.chunks_exact(3)) {
            off.extend(found.iter().zip(&all).map(|(found, cells)| found - expected(cells, &draw.scenes)));
        }
        // The missed are no straight line between two thresholds, and 2 % of 1280 cells are 25 or 26.
        let (mean, most) =
            (off.iter().sum::<f64>() / off.len() as f64, off.iter().fold(0.0, |most: f64, o| most.max(o.abs())));
        assert!(mean.abs() < 0.005 && most < 0.04, "{mean} {most}");
        let means: Vec<f64> = all.iter().map(|cells| expected(cells, &[1; 13])).collect();
        assert!((figure.mean() - means.iter().sum::<f64>() / 3.0).abs() < 0.01, "{} {means:?}", figure.mean());
        assert!(resampling.interval(&figure).half_width > 0.01);
        // What trainings share is in no difference.
        assert!(resampling.interval(&figure.minus(&figure)).half_width < 1e-12);
    }

    #[test]
    fn exact_the_interval_of_trainings_alone_is_students() {
        // Scenes are all alike: mean 0.985, sd of the trainings 0.0025 * sqrt(2.5), four degrees of freedom.
        let resampling = Resampling::new(1, one_group(50), 5);
        let all: Vec<_> = (0..5).map(|s| tested(|_| 20 + 5 * s as u64, 50)).collect();
        let figure = resampled(&resampling, &all);
        let interval = resampling.interval(&figure);
        let expected = 2.776_445_105 * 0.0025 * (2.5f64 / 5.0).sqrt();
        assert!((interval.mean - 0.985).abs() < 1e-12);
        assert!((interval.half_width / expected - 1.0).abs() < 0.12, "{interval:?} {expected}");
    }

    #[test]
    fn exact_groups_count_alike_and_cells_of_a_group_are_pooled() {
        let resampling = Resampling::new(1, vec![0..2, 3..4], 1);
        let mut all = tested(|k| [100, 300, 900, 500][k], 4);
        all[1].missed_untraversable *= 3;
        all[1].true_untraversable *= 3;
        let figure = resampled(&resampling, &[all.clone()]);
        // Group one: 1000 of 4000 untraversable missed; group two: half. Scene 2 is in none.
        assert!((figure.mean() - 0.5 * (0.875 + 0.75)).abs() < 1e-12, "{}", figure.mean());
        assert_eq!(of_group(&all, &(3..4)), Some(0.75));
        // One training says nothing of others.
        assert_eq!(resampling.interval(&figure).half_width, f64::INFINITY);
        // Halfway between a figure and twice it.
        let twice = figure.combined(&figure, |a, b| a + b);
        assert!((figure.towards(&twice, 0.5).mean() - 1.5 * figure.mean()).abs() < 1e-12);
        assert!((twice.minus(&figure).mean() - figure.mean()).abs() < 1e-12);
    }
}
