//! A study, and hours, cores and disk -> what to build: a setting and how many scenes of it, and the next best choice.
//!
//! In: learning curves of the study; what one scene costs here, of a few that were made on this machine. Out: scenes of a corpus, seconds of wall
//! for building it on all cores and for training on one, bytes, and the balanced accuracy to be expected, with an interval. What a setting's
//! scenes took in the study is scaled by how long this machine takes for such scenes; what reading, learning and judging a row takes is
//! measured here, for learning suffers otherwise from another processor, or from busy memory, than casting. Of a corpus's scenes 14 in 20
//! train and 3 stop, of a study's 5 in 6 and 1, so that n scenes of a corpus are worth 0.84 n of a study. Fitted: the curve (`curve`, `fit`), and how often a training goes through its rows (`passes`).
//! In which order settings come: `ranking`.

mod curve;
mod fit;
mod passes;
mod ranking;

use std::ops::Range;

use self::curve::{Curve, Teaches};
use self::passes::Passes;
use self::ranking::{Candidate, Written, ranked};
use super::estimate::RowCost;
use super::study::{Study, StudySetting, StudySize};
use super::tradeoff::sizes::SIZES;
use crate::statistics::Moments;

pub(crate) use fit::Expected;

/// More scenes of a study that bring no more than this are told to bring nothing: half a point of balanced accuracy.
pub(crate) const FLAT: f64 = 0.005;
/// Twice the scenes of a plan, and so twice its hours, are told to bring nothing where they are expected to bring no more than a twentieth of a point,
/// and by any believed law no more than a tenth.
pub(crate) const FLAT_TWICE: (f64, f64) = (0.0005, 0.001);
/// A curve is believed up to so many times the most scenes that it was measured at: nobody is told to build more, nor that it is flat beyond.
pub(crate) const BELIEVED_UP_TO: f64 = 32.0;
/// Scenes of a study that train and stop as many as one scene of a corpus does: 14 / 20 of it train, 5 / 6 of the study's.
const STUDY_SCENES: f64 = SPLITS[0] * 6.0 / 5.0;
/// Shares of a corpus's scenes that train, stop and test.
const SPLITS: [f64; 3] = [0.7, 0.15, 0.15];
/// A corpus may take so many times the bytes that are forecast: a part of a disk is not planned for.
pub(crate) const DISK_MARGIN: f64 = 1.05;

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
    /// More scenes are too many times what the curve was measured at.
    Study,
    /// The first choice, which ends before the budget does, takes no longer.
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
    /// The most scenes that the curve which tells what is expected was measured at.
    pub measured_scenes: u64,
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

/// The settings of a study that can be built within the budget, the best first. `here` says what each costs on this machine; scenes are
/// whole multiples of `multiple`. Where the first ends before the budget because its curve is flat, or was not measured far enough, the others have
/// the time that it takes, if that pays any scenes of theirs.
pub(crate) fn choices<'s>(
    study: &'s Study,
    budget: &Budget,
    here: impl Fn(&StudySetting) -> Here,
    multiple: u64,
) -> Vec<Choice<'s>> {
    let (errors, passes, common) = (standard_errors(study), Passes::of(study), common_scenes(study));
    let candidates = study.settings.iter().filter_map(|setting| {
        let here = here(setting);
        let curve = Curve::of(setting, Teaches::of(setting, study), &errors, passes, &here, multiple);
        let choice = curve.choice(budget, &here, multiple)?;
        Some(Candidate { ranked_by: curve.ranked_by(choice.most_scenes, common), choice, curve, here })
    });
    let candidates: Vec<Candidate> = candidates.collect();
    let written = Written::of(&candidates, study);
    let mut in_order = ranked(candidates, study, written);
    if let Some((first, others)) = in_order.split_first_mut()
        && matches!(first.choice.bound, Bound::Flat | Bound::Study)
    {
        let time = Budget { wall_s: first.choice.seconds(), ..*budget };
        others.iter_mut().for_each(|other| other.cut_to(&time, common, multiple));
        // What ended them before, such as the disk, may do so no more.
        let others = ranked(in_order.split_off(1), study, written);
        in_order.extend(others);
    }
    in_order.into_iter().map(|candidate| candidate.choice).collect()
}

/// Whether the budget pays the config as written no more scenes than all settings are compared at.
pub(crate) fn pays_few_scenes(study: &Study, budget: &Budget, here: impl Fn(&StudySetting) -> Here) -> bool {
    let setting = study.as_planned();
    let of_written = choices(study, budget, here, 1).into_iter().find(|choice| choice.setting == setting);
    of_written.is_none_or(|choice| STUDY_SCENES * choice.most_scenes as f64 <= common_scenes(study))
}

/// The most scenes at which all settings are compared.
fn common_scenes(study: &Study) -> f64 {
    study.settings.first().map_or(0.0, |setting| setting.sizes[compared_sizes(study) - 1].scenes as f64)
}

/// At how many sizes settings are compared; those that were followed to more scenes have more.
fn compared_sizes(study: &Study) -> usize {
    study.settings.iter().map(|setting| setting.sizes.len().min(SIZES.len())).min().unwrap_or(0)
}

/// Whether a setting was followed to more scenes than all are compared at.
fn is_followed(setting: &StudySetting, study: &Study) -> bool {
    setting.sizes.len() > compared_sizes(study)
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

#[cfg(test)]
mod tests;
