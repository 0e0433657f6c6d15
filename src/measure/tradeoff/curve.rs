//! What a setting costs and brings at four sizes -> where it stands at any cost between, and what it gains on another at equal cost.
//!
//! Cost is seconds of CPU: of making the scenes that train and that stop, and of training. Between two sizes balanced accuracy, the share
//! missed and the number of scenes are taken to run straight in the logarithm of the cost. Beyond the ends nothing is said: two settings are
//! compared at the largest cost that both reach, and not at all where one's smallest size is dearer than the other's largest.

use super::resample::{Resampled, Resampling};
use crate::math;
use crate::statistics::Interval;

/// A size of a setting.
#[derive(Clone, Debug)]
pub(super) struct CurvePoint {
    pub scenes: f64,
    pub cpu_s: f64,
    pub accuracy: Resampled,
    /// Share of the untraversable missed at a fixed share of false calls.
    pub missed: Resampled,
}

/// The sizes of a setting, ascending in cost. More scenes may cost less where training ends earlier: the order is the cost's.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    points: Vec<CurvePoint>,
}

/// What one setting gains on another for the same CPU time.
#[derive(Clone, Debug)]
pub(super) struct EqualCost {
    pub cpu_s: f64,
    /// Scenes that each makes for it.
    pub scenes: f64,
    pub base_scenes: f64,
    /// Balanced accuracy, and how much less of the untraversable is missed.
    pub gain: Interval,
    pub fewer_missed: Interval,
    /// How many times larger the variance would be without common scenes, trainings and draws; `None` where it is not known.
    pub variance_ratio: Option<f64>,
}

impl Curve {
    /// Of at least one point; costs above zero.
    pub(super) fn new(mut points: Vec<CurvePoint>) -> Curve {
        points.sort_by(|a, b| a.cpu_s.total_cmp(&b.cpu_s));
        Curve { points }
    }

    fn ends(&self) -> (f64, f64) {
        (self.points[0].cpu_s, self.points[self.points.len() - 1].cpu_s)
    }

    /// The size that a cost pays; `None` beyond the ends.
    fn at(&self, cpu_s: f64) -> Option<CurvePoint> {
        let (first, last) = self.ends();
        if !(first..=last).contains(&cpu_s) {
            return None;
        }
        let above = self.points.iter().position(|point| point.cpu_s >= cpu_s)?;
        let high = &self.points[above];
        if high.cpu_s == cpu_s {
            return Some(high.clone());
        }
        let low = &self.points[above - 1];
        let share = math::ln(cpu_s / low.cpu_s) / math::ln(high.cpu_s / low.cpu_s);
        let scenes = low.scenes * math::pow(high.scenes / low.scenes, share);
        let (accuracy, missed) = (low.accuracy.towards(&high.accuracy, share), low.missed.towards(&high.missed, share));
        Some(CurvePoint { scenes, cpu_s, accuracy, missed })
    }

    /// Mean accuracy for at most so much: at the largest size where that costs less, since more scenes would not harm. `None` where the
    /// smallest size costs more.
    pub(super) fn mean_within(&self, cpu_s: f64) -> Option<f64> {
        self.at(cpu_s.min(self.ends().1)).map(|size| size.accuracy.mean())
    }

    /// What the largest size costs.
    pub(super) fn largest_cpu_s(&self) -> f64 {
        self.ends().1
    }

    /// What this curve gains on another at the largest cost that both reach; `None` where there is none.
    pub(super) fn against(&self, base: &Curve, resampling: &Resampling) -> Option<EqualCost> {
        let cpu_s = self.ends().1.min(base.ends().1);
        let (here, there) = (self.at(cpu_s)?, base.at(cpu_s)?);
        let gain = here.accuracy.minus(&there.accuracy);
        let variance = resampling.variance(&gain);
        let apart = resampling.variance(&here.accuracy) + resampling.variance(&there.accuracy);
        let is_known = variance > 0.0 && variance.is_finite() && apart.is_finite();
        Some(EqualCost {
            cpu_s,
            scenes: here.scenes,
            base_scenes: there.scenes,
            gain: resampling.interval(&gain),
            fewer_missed: resampling.interval(&there.missed.minus(&here.missed)),
            variance_ratio: is_known.then(|| apart / variance),
        })
    }
}

/// The smallest size from which on more scenes bring at most `limit` of balanced accuracy, at the upper end of the interval; `None`
/// where the curve still rises, or where too little was measured to say that it does not. Sizes ascending; the largest proves nothing of itself.
pub(super) fn flat_from(sizes: &[Resampled], resampling: &Resampling, limit: f64) -> Option<usize> {
    let (last, others) = sizes.split_last()?;
    let rises = |size: &Resampled| resampling.interval(&last.minus(size)).upper() > limit;
    let flat = others.iter().rev().take_while(|size| !rises(size)).count();
    (flat > 0).then(|| others.len() - flat)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::Confusion;
    use crate::measure::tradeoff::missed::WrongByThreshold;

    /// Of scenes that are all alike, each training missing so many of 1000.
    fn accuracy(resampling: &Resampling, missed: [u64; 2]) -> Resampled {
        let scenes = missed.map(|missed| {
            let scene = Confusion {
                true_traversable: 1000,
                false_untraversable: 0,
                missed_untraversable: missed,
                true_untraversable: 1000 - missed,
            };
            vec![scene; 4]
        });
        resampling.balanced_accuracy(&[&scenes[0], &scenes[1]])
    }

    /// The share missed of the same: at any threshold nothing is called wrongly, and so many of 1000 are below.
    fn wrong(resampling: &Resampling, missed: [u64; 2]) -> Resampled {
        let cell = |missed: u64| {
            move |row: usize| {
                let untraversable = row.is_multiple_of(2);
                (untraversable, if untraversable && row % 2000 / 2 >= missed as usize { 0.9 } else { 0.1 })
            }
        };
        let scenes: Vec<_> = (0..4).map(|scene| 2000 * scene..2000 * (scene + 1)).collect();
        let kept = missed.map(|missed| [WrongByThreshold::of(&scenes, cell(missed))]);
        resampling.missed(&[&kept[0], &kept[1]])
    }

    fn resampling() -> Resampling {
        Resampling::new(3, std::iter::once(0..4).collect(), 2)
    }

    fn curve(resampling: &Resampling, points: &[(f64, f64, u64)]) -> Curve {
        let point = |&(scenes, cpu_s, missed): &(f64, f64, u64)| {
            let accuracy = accuracy(resampling, [missed, missed + 10]);
            CurvePoint { scenes, cpu_s, accuracy, missed: wrong(resampling, [missed, missed + 10]) }
        };
        Curve::new(points.iter().map(point).collect())
    }

    #[test]
    fn exact_between_two_sizes_accuracy_is_straight_in_log_cost() {
        let resampling = resampling();
        let base = curve(&resampling, &[(10.0, 1.0, 200), (40.0, 4.0, 100), (160.0, 16.0, 80)]);
        let cheap = curve(&resampling, &[(10.0, 0.5, 150), (160.0, 8.0, 60)]);
        // At 8 s: the base is halfway in log cost between 4 s and 16 s, with 80 scenes; it misses 90 (95 with the other seed's 10).
        let equal = cheap.against(&base, &resampling).unwrap();
        assert_eq!((equal.cpu_s, equal.scenes), (8.0, 160.0));
        assert!((equal.base_scenes - 80.0).abs() < 1e-9);
        assert!((equal.gain.mean - 0.015).abs() < 1e-12, "{equal:?}");
        // Balanced accuracy loses half of what is missed; that is of no false call, and of all cells called 2 % are drawn by chance.
        assert!(
            (equal.fewer_missed.mean - 0.98 * 0.03).abs() < 1e-12 && equal.fewer_missed.half_width < 1e-9,
            "{equal:?}"
        );
        // Both seeds gain the same, and scenes are alike: the gain is sure, though neither accuracy is.
        assert!(equal.gain.half_width < 1e-9);
        // Seen from the other side.
        let lost = base.against(&cheap, &resampling).unwrap();
        assert!((lost.gain.mean + 0.015).abs() < 1e-12 && lost.cpu_s == 8.0);
    }

    #[test]
    fn extreme_a_setting_whose_smallest_size_is_too_dear_is_not_compared() {
        let resampling = resampling();
        let base = curve(&resampling, &[(10.0, 1.0, 200), (40.0, 4.0, 100)]);
        let dear = curve(&resampling, &[(10.0, 5.0, 200), (40.0, 20.0, 100)]);
        assert!(dear.against(&base, &resampling).is_none() && base.against(&dear, &resampling).is_none());
        assert_eq!(base.against(&base, &resampling).unwrap().gain.mean, 0.0);
        assert_eq!((dear.mean_within(4.0), base.mean_within(100.0)), (None, base.mean_within(4.0)));
        // Training ended so much earlier that more scenes cost less.
        let odd = curve(&resampling, &[(10.0, 6.0, 200), (40.0, 3.0, 100)]);
        assert_eq!(odd.against(&base, &resampling).unwrap().base_scenes, 40.0);
    }

    #[test]
    fn law_a_curve_is_flat_from_where_more_brings_next_to_nothing() {
        let resampling = resampling();
        let sizes = |missed: [u64; 4]| missed.map(|m| accuracy(&resampling, [m, m + 10]));
        // Half a thousandth a cell: 200, 104 and 100 missed are 5, 0.2 and 0 points below the last.
        assert_eq!(flat_from(&sizes([200, 104, 102, 100]), &resampling, 0.005), Some(1));
        assert_eq!(flat_from(&sizes([200, 104, 130, 100]), &resampling, 0.005), None);
        assert_eq!(flat_from(&sizes([100, 100, 100, 100]), &resampling, 0.005), Some(0));
        let one = Resampling::new(3, std::iter::once(0..4).collect(), 1);
        let sizes = [[200], [100]].map(|m| {
            let tested = [Confusion {
                true_traversable: 9,
                missed_untraversable: m[0],
                true_untraversable: 300,
                ..Confusion::default()
            }; 4];
            one.balanced_accuracy(&[&tested])
        });
        assert_eq!(flat_from(&sizes, &one, 0.5), None);
    }
}
