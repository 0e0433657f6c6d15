//! A study, and hours, cores and disk -> what to build: a setting and how many scenes of it, and the next best choice.
//!
//! In: learning curves of the study; what one scene costs here, of a few that were made on this machine. Out: scenes of a corpus, seconds of wall
//! for building it on all cores and for training on one, bytes, and the balanced accuracy to be expected, with an interval. The study's
//! times are scaled by how long this machine takes for the study's scenes; a study learns from memory, so what reading rows and judging them takes is
//! measured here and added. Of a corpus's scenes 14 in 20 train and 3 stop, of a study's 5 in 6
//! and 1, so that n scenes of a corpus are worth 0.84 n of a study. Fitted: the curve (`fit`), and how often a training goes through its rows (`passes`).
//! In which order settings come: `ranking`.

mod fit;
mod passes;
mod ranking;

use std::ops::Range;

use self::fit::{Fit, Measured};
use self::passes::Passes;
use self::ranking::{Candidate, Written, ranked};
use super::estimate::RowCost;
use super::study::{Study, StudySetting, StudySize};
use super::tradeoff::report::Told;
use super::tradeoff::sizes::SIZES;
use crate::corpus::write::ROW_GROUP_ROWS;
use crate::math;
use crate::statistics::Moments;
use crate::train::generalisation;
use crate::train::order::WINDOW_GROUPS;
use crate::train::quantiles::SAMPLE_ROWS;

pub(crate) use fit::Expected;

/// More scenes of a study that bring no more than this are told to bring nothing: half a point of balanced accuracy.
pub(crate) const FLAT: f64 = 0.005;
/// Twice the scenes of a plan, and so twice its hours, are told to bring nothing where they are expected to bring no more than a twentieth of a point,
/// and by any believed law no more than a tenth.
pub(crate) const FLAT_TWICE: (f64, f64) = (0.0005, 0.001);
/// Scenes of a study that train and stop as many as one scene of a corpus does: 14 / 20 of it train, 5 / 6 of the study's.
const STUDY_SCENES: f64 = SPLITS[0] * 6.0 / 5.0;
/// Shares of a corpus's scenes that train, stop and test.
const SPLITS: [f64; 3] = [0.7, 0.15, 0.15];
/// Windows that are there, or in the making, when training ends: half of the one that is learnt, one that waits, and the one after it.
const WINDOWS_LEFT: f64 = 2.5;
/// A corpus may take so many times the bytes that are forecast: a part of a disk is not planned for.
pub(crate) const DISK_MARGIN: f64 = 1.05;
/// Nobody is told that a curve is flat beyond so many times the most scenes that it was measured at.
const FLAT_UP_TO: f64 = 32.0;
/// Settings are ranked up to so many times the largest size that all of them were measured at.
const RANKED_UP_TO: f64 = 2.0;
/// Steps in the logarithm of the scenes at which a curve is looked through for where it is flat.
const STEPS: u32 = 200;

/// What there is to spend.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    pub wall_s: f64,
    pub cores: f64,
    /// `None` where nobody can say.
    pub disk_bytes: Option<f64>,
    /// Of the corpus, all splits together; `None` where as many as there is time for are wanted.
    pub rows: Option<f64>,
}

/// What a scene takes here, beside what the study says.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Here {
    /// CPU time of this machine over the study's for the same scenes.
    pub slowness: f64,
    /// Of writing a scene.
    pub writing_cpu_s: f64,
    pub bytes_per_scene: f64,
    pub rows_per_scene: f64,
    /// Of reading a row, and of judging it.
    pub row_cost: RowCost,
}

/// What ends the number of scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Bound {
    Hours,
    Disk,
    Rows,
    /// More scenes bring next to nothing.
    Flat,
    /// The first choice, whose curve is flat, takes no longer.
    SameTime,
}

/// A setting, and how many scenes of it.
#[derive(Clone, Debug)]
pub(crate) struct Choice<'s> {
    pub setting: &'s StudySetting,
    pub scenes: u64,
    pub bound: Bound,
    /// What hours, disk and rows would allow.
    pub most_scenes: u64,
    pub build_s: f64,
    pub train_s: f64,
    pub bytes: f64,
    pub rows: f64,
    pub expected: Expected,
    /// What twice as many scenes would bring, and what `most_scenes`: expected, and at most.
    pub twice: (f64, f64),
    pub left: (f64, f64),
    /// Scenes over the scenes of the largest measured size; above 1 the curve is extrapolated.
    pub beyond: f64,
    /// Whether what is expected is read off the reference's curve.
    pub by_reference: bool,
}

impl Choice<'_> {
    /// Building and training.
    fn seconds(&self) -> f64 {
        self.build_s + self.train_s
    }
}

/// A setting's curve and costs.
struct Curve<'s> {
    setting: &'s StudySetting,
    fit: Fit,
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

/// The settings of a study that can be built within the budget, the best first. `here` says what each costs on this machine; scenes are
/// whole multiples of `multiple`. Where the first ends before the budget because its curve is flat, the others have the time that it takes, if
/// that pays any scenes of theirs.
pub(crate) fn choices<'s>(
    study: &'s Study,
    budget: &Budget,
    here: impl Fn(&StudySetting) -> Here,
    multiple: u64,
) -> Vec<Choice<'s>> {
    let (errors, passes) = (standard_errors(study), Passes::of(study));
    let compared = compared_sizes(study);
    let common = study.settings.first().map_or(0.0, |setting| setting.sizes[compared - 1].scenes as f64);
    let candidates = study.settings.iter().filter_map(|setting| {
        let here = here(setting);
        let curve = Curve::of(setting, Teaches::of(setting, study), &errors, passes, &here, multiple);
        let choice = curve.choice(budget, &here, common, multiple)?;
        Some(Candidate { ranked_by: curve.ranked_by(choice.most_scenes, common), choice, curve, here })
    });
    let candidates: Vec<Candidate> = candidates.collect();
    let written = Written::of(&candidates, study);
    let mut ranked = ranked(candidates, study, written);
    if let Some((first, others)) = ranked.split_first_mut()
        && first.choice.bound == Bound::Flat
    {
        let time = Budget { wall_s: first.choice.seconds(), ..*budget };
        others.iter_mut().for_each(|other| other.cut_to(&time, common, multiple));
        // What ended them before, such as the disk, may do so no more.
        let others = self::ranked(ranked.split_off(1), study, written);
        ranked.extend(others);
    }
    ranked.into_iter().map(|candidate| candidate.choice).collect()
}

/// Whose accuracies tell what to expect of a setting.
struct Teaches<'s> {
    setting: &'s StudySetting,
    by_reference: bool,
    /// What the setting errs more than the other on as many scenes.
    more_error: f64,
}

impl<'s> Teaches<'s> {
    /// The reference, where that was followed to more scenes and the setting, which is not told apart from it at equal CPU, was not: a short
    /// curve of its own would promise what a few trainings happened to bring. What it errs more on the most scenes of both it is expected to err
    /// more on any; what it errs less is not believed.
    fn of(setting: &'s StudySetting, study: &'s Study) -> Teaches<'s> {
        let (compared, reference) = (compared_sizes(study), &study.settings[0]);
        let is_followed = |setting: &StudySetting| setting.sizes.len() > compared;
        let is_same = matches!(setting.told, Some(Told::NotApart | Told::OneSeed));
        if !is_same || !is_followed(reference) || is_followed(setting) {
            return Teaches { setting, by_reference: false, more_error: 0.0 };
        }
        let accuracy = |of: &StudySetting| of.sizes[compared - 1].balanced_accuracy.mean;
        Teaches {
            setting: reference,
            by_reference: true,
            more_error: (accuracy(reference) - accuracy(setting)).max(0.0),
        }
    }
}

/// At how many sizes settings are compared; those that were followed to more scenes have more.
fn compared_sizes(study: &Study) -> usize {
    study.settings.iter().map(|setting| setting.sizes.len().min(SIZES.len())).min().unwrap_or(0)
}

/// Of the mean over trainings, by size: pooled over the settings, for a few trainings alone say little of their own spread; and over all sizes
/// beyond those at which settings are compared. No size is known better than a larger one: where all trainings hold the same scenes, as they do at the last size of
/// a measurement, their spread tells nothing of the draw of the scenes.
fn standard_errors(study: &Study) -> Vec<f64> {
    let (compared, most) =
        (compared_sizes(study), study.settings.iter().map(|setting| setting.sizes.len()).max().unwrap_or(0));
    let pooled = |sizes: Range<usize>| {
        let measured = study.settings.iter().flat_map(|setting| setting.sizes.iter().take(sizes.end).skip(sizes.start));
        let variance = |size: &StudySize| Moments::of(size.by_seed.iter().copied())?.variance;
        let variances: Vec<f64> = measured.filter_map(variance).collect();
        let mean = variances.iter().sum::<f64>() / variances.len().max(1) as f64;
        // Trainings that agree to the last digit are no reason to divide by zero.
        (mean / study.seeds as f64).sqrt().max(1e-5)
    };
    let beyond = pooled(compared..most);
    let mut errors: Vec<f64> = (0..compared).map(|size| pooled(size..size + 1)).collect();
    errors.resize(most, beyond);
    for size in (1..most).rev() {
        errors[size - 1] = errors[size - 1].max(errors[size]);
    }
    errors
}

impl<'s> Curve<'s> {
    /// Costs are the setting's own.
    fn of(
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
        let mut interval = teacher.largest().balanced_accuracy;
        // What is open of its own accuracy is open of it with the other's curve, too.
        interval.half_width = interval.half_width.max(largest.balanced_accuracy.half_width);
        Curve {
            setting,
            fit: Fit::of(&measured, &interval),
            by_reference,
            scene_cpu_s: here.slowness * setting.scene_cpu_s() + here.writing_cpu_s,
            row_cpu_s: here.slowness * largest.train_cpu_s / largest.rows_learnt,
            rows_a_scene: largest.train_rows / scenes,
            rows_a_corpus_scene: here.rows_per_scene,
            rows_a_group: (here.rows_per_scene * multiple as f64).min(ROW_GROUP_ROWS as f64),
            row_cost: here.row_cost,
            passes,
            largest: scenes,
        }
    }

    /// What is expected of as many scenes, or of twice the largest size that all settings have.
    fn ranked_by(&self, scenes: u64, common: f64) -> f64 {
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
        let RowCost { reading_s, judging_s, judging_f32_s } = self.row_cost;
        let beside_s =
            reading_s * read + judging_s * (2.0 * validation + test) + judging_f32_s * 2.0 * (of_train + of_validation);
        (self.scene_cpu_s * scenes / cores, self.row_cpu_s * rows * passes + beside_s)
    }

    /// `None` where not even `multiple` scenes are within the budget; `common`: scenes of the largest size that all settings have.
    fn choice(&self, budget: &Budget, here: &Here, common: f64, multiple: u64) -> Option<Choice<'s>> {
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
        let flat = self.flat_from(common).map(|flat| flat.div_ceil(multiple).max(1) * multiple);
        let (scenes, bound) = match flat {
            Some(flat) if flat <= most_scenes => (flat, Bound::Flat),
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
            beyond: study_scenes(scenes) / self.largest,
            by_reference: self.by_reference,
        })
    }

    /// The fewest scenes, none fewer than all settings were measured at, from which on twice as many bring at most [`FLAT_TWICE`]; `None` where
    /// there are none up to [`FLAT_UP_TO`]. The budget does not say.
    fn flat_from(&self, common: f64) -> Option<u64> {
        let (first, last) = (common / STUDY_SCENES, FLAT_UP_TO * self.fit.largest_scenes() / STUDY_SCENES);
        let at = |step: u32| first * math::pow(last / first, f64::from(step) / f64::from(STEPS));
        let is_flat = |scenes: &f64| {
            let (expected, most) = self.fit.gain(STUDY_SCENES * scenes, 2.0 * STUDY_SCENES * scenes);
            expected <= FLAT_TWICE.0 && most <= FLAT_TWICE.1
        };
        (0..=STEPS).map(at).find(is_flat).map(|scenes| scenes.ceil() as u64)
    }
}

/// The largest multiple at which something that ends once still holds, up to a billion scenes; 0 where it never does.
fn most(holds: impl Fn(f64) -> bool, multiple: u64) -> u64 {
    let (mut low, mut high) = (0, 1_000_000_000 / multiple + 1);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if holds((middle * multiple) as f64) { low = middle } else { high = middle }
    }
    low * multiple
}

#[cfg(test)]
mod tests;
