//! A setting of a study -> what it costs and brings at any number of scenes, and how many a budget pays.
//!
//! In: the setting's sizes, and what a scene takes here. Out: [`Choice`]s. Accuracies are the setting's own, or the reference's ([`Teaches`]); costs
//! are always its own. Seconds, shares of balanced accuracy, scenes of a corpus; those of a study are fewer by [`STUDY_SCENES`].

use super::fit::{Fit, Measured};
use super::passes::Passes;
use super::{
    BELIEVED_UP_TO, Bound, Budget, Choice, DISK_MARGIN, FLAT_TWICE, Here, SPLITS, STUDY_SCENES, compared_sizes,
    is_followed,
};
use crate::corpus::write::ROW_GROUP_ROWS;
use crate::math;
use crate::measure::estimate::RowCost;
use crate::measure::study::{Study, StudySetting};
use crate::measure::tradeoff::report::Told;
use crate::train::generalisation;
use crate::train::order::WINDOW_GROUPS;
use crate::train::quantiles::SAMPLE_ROWS;

/// Windows that are there, or in the making, when training ends: half of the one that is learnt, one that waits, and the one after it.
const WINDOWS_LEFT: f64 = 2.5;
/// Learning with its looks, over learning alone: looks take a twentieth at most where there are many rows (docs/training.md).
const WITH_LOOKS: f64 = 1.05;
/// Settings are ranked up to so many times the largest size that all of them were measured at.
const RANKED_UP_TO: f64 = 2.0;
/// Steps in the logarithm of the scenes at which a curve is looked through for where it is flat.
const STEPS: u32 = 200;

/// A setting's curve and costs.
pub(super) struct Curve<'s> {
    setting: &'s StudySetting,
    pub fit: Fit,
    by_reference: bool,
    scene_cpu_s: f64,
    /// Of learning a row once, and rows to learn of a scene of the study.
    row_cpu_s: f64,
    rows_a_scene: f64,
    /// Rows of a scene of a corpus, whatever its split, of one of its row groups, and what one takes beside learning.
    rows_a_corpus_scene: f64,
    rows_a_group: f64,
    row_cost: RowCost,
    passes: Passes,
    largest: f64,
}

/// Whose accuracies tell what to expect of a setting.
pub(super) struct Teaches<'s> {
    setting: &'s StudySetting,
    by_reference: bool,
    /// What the setting errs more than the other on as many scenes.
    more_error: f64,
}

impl<'s> Teaches<'s> {
    /// The reference, where that was followed to more scenes and the setting, which is not told apart from it at equal CPU, was not: a short
    /// curve of its own would promise what a few trainings happened to bring. What it errs more on the most scenes of both it is expected to err
    /// more on any; what it errs less is not believed.
    pub(super) fn of(setting: &'s StudySetting, study: &'s Study) -> Teaches<'s> {
        let reference = &study.settings[0];
        let is_same = matches!(setting.told, Some(Told::NotApart | Told::OneSeed));
        if !is_same || !is_followed(reference, study) || is_followed(setting, study) {
            return Teaches { setting, by_reference: false, more_error: 0.0 };
        }
        let compared = compared_sizes(study);
        let accuracy = |of: &StudySetting| of.sizes[compared - 1].balanced_accuracy.mean;
        Teaches {
            setting: reference,
            by_reference: true,
            more_error: (accuracy(reference) - accuracy(setting)).max(0.0),
        }
    }
}

impl<'s> Curve<'s> {
    /// Costs are the setting's own.
    pub(super) fn of(
        setting: &'s StudySetting,
        teaches: Teaches,
        errors: &[f64],
        passes: Passes,
        here: &Here,
        multiple: u64,
    ) -> Curve<'s> {
        let Teaches { setting: teacher, by_reference, more_error } = teaches;
        let measured: Vec<Measured> = teacher
            .sizes
            .iter()
            .zip(errors)
            .map(|(size, &standard_error)| Measured {
                scenes: size.scenes as f64,
                error: 1.0 - size.balanced_accuracy.mean + more_error,
                standard_error,
            })
            .collect();
        let largest = setting.largest();
        let scenes = largest.scenes as f64;
        let by_scenes_s = here.slowness * largest.train_cpu_s / largest.rows_learnt;
        let mut interval = teacher.largest().balanced_accuracy;
        // What is open of its own accuracy is open of it with the other's curve, too.
        interval.half_width = interval.half_width.max(largest.balanced_accuracy.half_width);
        Curve {
            setting,
            fit: Fit::of(&measured, &interval),
            by_reference,
            scene_cpu_s: here.slowness * setting.scene_cpu_s() + here.writing_cpu_s,
            row_cpu_s: here.row_cost.learning_s.map_or(by_scenes_s, |learning_s| WITH_LOOKS * learning_s),
            rows_a_scene: largest.train_rows / scenes,
            rows_a_corpus_scene: here.rows_per_scene,
            rows_a_group: (here.rows_per_scene * multiple as f64).min(ROW_GROUP_ROWS as f64),
            row_cost: here.row_cost,
            passes,
            largest: scenes,
        }
    }

    /// What is expected of as many scenes, or of twice the largest size that all settings have.
    pub(super) fn ranked_by(&self, scenes: u64, common: f64) -> f64 {
        self.fit.expected((STUDY_SCENES * scenes as f64).min(RANKED_UP_TO * common)).mean
    }

    /// Seconds of wall: building on all cores, and training on one; a second one would read while the first learns.
    fn seconds(&self, scenes: f64, cores: f64) -> (f64, f64) {
        let rows = self.rows_a_scene * STUDY_SCENES * scenes;
        let passes = self.passes.at(rows);
        let [train, validation, test] = SPLITS.map(|share| share * self.rows_a_corpus_scene * scenes);
        // Beside the passes: samples of the rows to learn, for the scaler and for the quantiles, and the windows that were read ahead when
        // training ended. Validation rows are read for the looks, the calibration and the choice of thresholds, and judged for the last two.
        let samples = 2.0 * train.min(SAMPLE_ROWS as f64);
        // What is left to learn is told of some rows of either split.
        let most = generalisation::rows_judged((train * passes) as u64) as f64;
        let [of_train, of_validation] = [train, validation].map(|rows| rows.min(most));
        let ahead = WINDOWS_LEFT * train.min(WINDOW_GROUPS as f64 * self.rows_a_group);
        let read = train * passes + ahead + samples + of_train + of_validation + 3.0 * validation + test;
        let RowCost { reading_s, judging_s, judging_f32_s, .. } = self.row_cost;
        let beside_s =
            reading_s * read + judging_s * (2.0 * validation + test) + judging_f32_s * 2.0 * (of_train + of_validation);
        (self.scene_cpu_s * scenes / cores, self.row_cpu_s * rows * passes + beside_s)
    }

    /// `None` where not even `multiple` scenes are within the budget.
    pub(super) fn choice(&self, budget: &Budget, here: &Here, multiple: u64) -> Option<Choice<'s>> {
        let fits = |scenes: f64| {
            let (build_s, train_s) = self.seconds(scenes, budget.cores);
            build_s + train_s <= budget.wall_s
        };
        let by_hours = most(fits, multiple);
        let by_disk =
            budget.disk_bytes.map_or(u64::MAX, |bytes| (bytes / (DISK_MARGIN * here.bytes_per_scene.max(1.0))) as u64);
        let by_rows = budget.rows.map_or(u64::MAX, |rows| (rows / here.rows_per_scene.max(1e-3)) as u64);
        let most_scenes = by_hours.min(by_disk).min(by_rows) / multiple * multiple;
        if most_scenes == 0 {
            return None;
        }
        let flat = self.flat_from().map(|flat| flat.div_ceil(multiple).max(1) * multiple);
        let believed = (BELIEVED_UP_TO * self.fit.largest_scenes() / STUDY_SCENES) as u64;
        // A shard is the least that can be built.
        let by_study = (believed / multiple).max(1) * multiple;
        let (scenes, bound) = match flat {
            Some(flat) if flat <= most_scenes => (flat, Bound::Flat),
            _ if by_study < most_scenes => (by_study, Bound::Study),
            _ if by_rows < by_hours.min(by_disk) => (most_scenes, Bound::Rows),
            _ if by_disk < by_hours => (most_scenes, Bound::Disk),
            _ => (most_scenes, Bound::Hours),
        };
        let study_scenes = |scenes: u64| STUDY_SCENES * scenes as f64;
        let (build_s, train_s) = self.seconds(scenes as f64, budget.cores);
        Some(Choice {
            setting: self.setting,
            scenes,
            bound,
            most_scenes,
            build_s,
            train_s,
            bytes: here.bytes_per_scene * scenes as f64,
            rows: here.rows_per_scene * scenes as f64,
            expected: self.fit.expected(study_scenes(scenes)),
            twice: self.fit.gain(study_scenes(scenes), 2.0 * study_scenes(scenes)),
            left: self.fit.gain(study_scenes(scenes), study_scenes(most_scenes)),
            measured_scenes: self.fit.largest_scenes() as u64,
            beyond: study_scenes(scenes) / self.largest,
            by_reference: self.by_reference,
        })
    }

    /// The fewest scenes, none fewer than the most that the curve was measured at, from which on twice as many bring at most [`FLAT_TWICE`];
    /// `None` where there are none up to [`BELIEVED_UP_TO`]. A study's own sizes are affordable, and their noise hides a tenth of a point:
    /// quickstart.yaml, measured up to 768 scenes, was once told flat from 231 on, and twice as many brought 0.12. The budget does not say.
    fn flat_from(&self) -> Option<u64> {
        let largest = self.fit.largest_scenes() / STUDY_SCENES;
        let at = |step: u32| largest * math::pow(BELIEVED_UP_TO, f64::from(step) / f64::from(STEPS));
        let is_flat = |scenes: &f64| {
            let (expected, most) = self.fit.gain(STUDY_SCENES * scenes, 2.0 * STUDY_SCENES * scenes);
            expected <= FLAT_TWICE.0 && most <= FLAT_TWICE.1
        };
        (0..=STEPS).map(at).find(is_flat).map(|scenes| scenes.ceil() as u64)
    }
}

/// The largest multiple at which something that ends once still holds, up to a billion scenes; 0 where it never does.
pub(super) fn most(holds: impl Fn(f64) -> bool, multiple: u64) -> u64 {
    let (mut low, mut high) = (0, 1_000_000_000 / multiple + 1);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if holds((middle * multiple) as f64) { low = middle } else { high = middle }
    }
    low * multiple
}
