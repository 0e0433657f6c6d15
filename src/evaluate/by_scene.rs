//! Counts of each scene -> how far a rate can be told, given that other scenes might have been drawn.
//!
//! In: a confusion of each scene's cells. Out: intervals of 95 % of the three rates that a report begins with. A rate is a ratio of two sums
//! over scenes, and cells of a scene are alike, so that scenes are what was drawn: the variance is that of the linearised ratio (Cochran 1977,
//! "Sampling Techniques", section 6.3), the interval is formed on the logit, which keeps it within 0 and 1, with Student's t. Not modelled: that
//! families were drawn by weights; and where a rate is 0 or 1 in every scene, or of one scene alone, there is no interval.

use serde::{Deserialize, Serialize};

use super::confusion::Confusion;
use crate::math;
use crate::statistics::student;

/// The rates that a report begins with, as intervals of 95 % over the draw of scenes; `None` where it cannot be told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OverScenes {
    /// Scenes with a judged cell; for scans from elsewhere, scans.
    pub scenes: u64,
    pub missed_untraversable: Option<[f64; 2]>,
    pub false_untraversable: Option<[f64; 2]>,
    /// Of the cells called untraversable, the share that is.
    pub precision: Option<[f64; 2]>,
}

/// Gathers the counts of scenes, scan by scan.
#[derive(Clone, Debug, Default)]
pub(super) struct ByScene {
    /// The scene whose scans are being added.
    open: Option<(i64, Confusion)>,
    scenes: u64,
    missed: Ratio,
    false_alarms: Ratio,
    precision: Ratio,
}

/// Sums over scenes of a part, of the whole that it is of, and of their products.
#[derive(Clone, Copy, Debug, Default)]
struct Ratio {
    /// Scenes that hold any of the whole.
    scenes: u64,
    part: f64,
    whole: f64,
    part_part: f64,
    part_whole: f64,
    whole_whole: f64,
}

impl ByScene {
    /// Adds a scan; scans of one scene follow each other, and one of no scene is one by itself.
    pub(super) fn add(&mut self, scene: Option<i64>, counts: Confusion) {
        match (&mut self.open, scene) {
            (Some((open, sum)), Some(scene)) if *open == scene => *sum += counts,
            _ => {
                self.close();
                match scene {
                    Some(scene) => self.open = Some((scene, counts)),
                    None => self.add_scene(counts),
                }
            }
        }
    }

    fn close(&mut self) {
        if let Some((_, counts)) = self.open.take() {
            self.add_scene(counts);
        }
    }

    fn add_scene(&mut self, counts: Confusion) {
        self.scenes += 1;
        self.missed.add(counts.missed_untraversable, counts.untraversable());
        self.false_alarms.add(counts.false_untraversable, counts.traversable());
        self.precision.add(counts.true_untraversable, counts.called_untraversable());
    }

    pub(super) fn report(&self) -> OverScenes {
        let mut all = self.clone();
        all.close();
        OverScenes {
            scenes: all.scenes,
            missed_untraversable: all.missed.interval(),
            false_untraversable: all.false_alarms.interval(),
            precision: all.precision.interval(),
        }
    }
}

impl Ratio {
    fn add(&mut self, part: u64, whole: u64) {
        let (part, of) = (part as f64, whole as f64);
        self.scenes += u64::from(whole > 0);
        self.part += part;
        self.whole += of;
        self.part_part += part * part;
        self.part_whole += part * of;
        self.whole_whole += of * of;
    }

    fn interval(&self) -> Option<[f64; 2]> {
        let rate = self.part / self.whole;
        if self.scenes < 2 || self.part == 0.0 || self.part == self.whole {
            return None;
        }
        let scenes = self.scenes as f64;
        // The sum of (part - rate * whole)^2 over the scenes; rounding may take it below nought where all scenes have one rate.
        let squares = self.part_part - 2.0 * rate * self.part_whole + rate * rate * self.whole_whole;
        let variance = scenes / (scenes - 1.0) * squares.max(0.0) / (self.whole * self.whole);
        let odds = rate * (1.0 - rate);
        let reach = student((self.scenes - 1) as usize, 0.95) * variance.sqrt() / odds;
        let middle = math::ln(rate / (1.0 - rate));
        Some([middle - reach, middle + reach].map(|logit| 1.0 / (1.0 + math::exp(-logit))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(missed: u64, untraversable: u64) -> Confusion {
        Confusion {
            missed_untraversable: missed,
            true_untraversable: untraversable - missed,
            true_traversable: 10,
            ..Confusion::default()
        }
    }

    #[test]
    fn exact_the_interval_is_that_of_a_ratio_over_scenes() {
        let mut all = ByScene::default();
        // Scans of one scene are one draw.
        for (scene, missed, of) in [(1, 1, 20), (1, 1, 20), (4, 0, 30), (5, 4, 50), (9, 3, 80)] {
            all.add(Some(scene), counts(missed, of));
        }
        let report = all.report();
        assert_eq!((report.scenes, report.false_untraversable), (4, None));
        // NumPy: r = 9 / 200, d = m - r w of (2, 0, 4, 3) and (40, 30, 50, 80), se = sqrt(4 / 3 (d @ d)) / 200; SciPy: t of 3 degrees.
        let [low, high] = report.missed_untraversable.expect("errors in some scenes");
        assert!((low - 0.017_328_136).abs() < 1e-8 && (high - 0.111_832_913).abs() < 1e-8, "{low} {high}");
    }

    #[test]
    fn extreme_what_cannot_be_told_has_no_interval() {
        let of = |scans: &[(Option<i64>, u64, u64)]| {
            let mut all = ByScene::default();
            scans.iter().for_each(|&(scene, missed, of)| all.add(scene, counts(missed, of)));
            all.report()
        };
        assert_eq!(of(&[]).scenes, 0);
        // One scene; none missed; all missed; and scenes that hold none of the class count for nothing.
        assert_eq!(of(&[(Some(3), 1, 5), (Some(3), 1, 5)]).missed_untraversable, None);
        assert_eq!(of(&[(Some(3), 0, 5), (Some(4), 0, 9)]).missed_untraversable, None);
        assert_eq!(of(&[(Some(3), 5, 5), (Some(4), 9, 9)]).missed_untraversable, None);
        assert_eq!(of(&[(Some(3), 2, 5), (Some(4), 0, 0)]).missed_untraversable, None);
        // Scans of no scene are scenes of their own; equal rates leave nothing open.
        let equal = of(&[(None, 1, 4), (None, 2, 8)]);
        let [low, high] = equal.missed_untraversable.expect("two scans");
        assert!(equal.scenes == 2 && (low - 0.25).abs() < 1e-9 && (high - 0.25).abs() < 1e-9, "{low} {high}");
    }

    #[test]
    fn law_nineteen_of_twenty_intervals_hold_the_rate() {
        // 2000 draws of 30 scenes, whose own rates are 0.02 or 0.18 and whose sizes differ: the rate of them all is known.
        let mut state = 20_261_127_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut held, draws) = (0, 2000);
        for _ in 0..draws {
            let mut all = ByScene::default();
            for scene in 0..30 {
                let rate = if uniform() < 0.5 { 0.02 } else { 0.18 };
                let whole = 20 + (uniform() * 60.0) as u64;
                let missed = (0..whole).filter(|_| uniform() < rate).count() as u64;
                all.add(Some(scene), counts(missed, whole));
            }
            let [low, high] = all.report().missed_untraversable.expect("errors");
            held += i32::from(low <= 0.1 && 0.1 <= high);
        }
        let share = f64::from(held) / f64::from(draws);
        assert!((0.93..=0.97).contains(&share), "{share}");
    }
}
