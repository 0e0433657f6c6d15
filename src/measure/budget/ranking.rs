//! Settings that could be built -> their order, the best first.
//!
//! By what is told of them at equal CPU; where disk or rows bind, which know no CPU, only if they also take no longer than the config
//! as written and are expected to be no worse. Where settings were followed to more scenes, what is told better of the others was not put to that
//! test and ranks nothing. The config as written comes before the rest; the reference, where that is told to be worse. Among the rest the cheapest scenes come first, of settings that lose no more than a
//! tenth of a point at equal CPU, and half a one at the lower end of the interval: where a curve is flat they are there soonest. Where disk or rows
//! bind, no more than a tenth of a point less is to be expected of them, too. What curves promise would put the luckiest
//! first. Then, and among what is told better, what is expected no farther than twice the largest size that
//! all have decides. Left out: what is told to be worse.

use super::curve::Curve;
use super::{Bound, Budget, Choice, FLAT, FLAT_TWICE, Here, STUDY_SCENES, is_followed};
use crate::measure::study::{Study, StudySetting};
use crate::measure::tradeoff::report::Told;

/// Seconds that were measured at two moments are the same up to this.
const SAME_SECONDS: f64 = 1.05;

/// A setting that could be built.
pub(super) struct Candidate<'s> {
    pub choice: Choice<'s>,
    /// Balanced accuracy to be expected where settings are ranked.
    pub ranked_by: f64,
    pub curve: Curve<'s>,
    pub here: Here,
}

impl Candidate<'_> {
    /// CPU time of a scene, as the study has it, where the setting loses little at equal CPU time. Where disk or rows bind, a cheaper scene buys no
    /// further one, so that as many scenes must promise as much, too.
    fn cheap_s(&self, written: Written) -> Option<f64> {
        let setting = self.choice.setting;
        let of_written = written.brings.map_or(f64::NEG_INFINITY, |(of_written, _)| of_written);
        let loses_little = setting.gain.is_some_and(|gain| gain.mean >= -FLAT_TWICE.1 && gain.lower() >= -FLAT);
        let is_as_good = !is_capped(&self.choice) || self.ranked_by >= of_written - FLAT_TWICE.1;
        (loses_little && is_as_good).then(|| setting.scene_cpu_s())
    }

    /// As many scenes as the time of another choice pays; as it was where that pays none.
    pub(super) fn cut_to(&mut self, time: &Budget, common: f64, multiple: u64) {
        if let Some(choice) = self.curve.choice(time, &self.here, multiple) {
            let bound = if choice.bound == Bound::Hours { Bound::SameTime } else { choice.bound };
            let most_scenes = self.choice.most_scenes;
            let [from, to] = [choice.scenes, most_scenes].map(|scenes| STUDY_SCENES * scenes as f64);
            self.ranked_by = self.curve.ranked_by(choice.most_scenes, common);
            self.choice = Choice { bound, most_scenes, left: self.curve.fit.gain(from, to), ..choice };
        }
    }
}

/// Whether what ends the scenes knows no CPU time.
fn is_capped(choice: &Choice) -> bool {
    matches!(choice.bound, Bound::Disk | Bound::Rows)
}

/// What the config as written would bring within the budget, and take.
#[derive(Clone, Copy)]
pub(super) struct Written<'s> {
    setting: &'s StudySetting,
    brings: Option<(f64, f64)>,
}

impl<'s> Written<'s> {
    /// The reference in its place, where it is told to be worse.
    pub(super) fn of(candidates: &[Candidate<'s>], study: &'s Study) -> Written<'s> {
        let setting = study.as_planned();
        let found = candidates.iter().find(|candidate| candidate.choice.setting == setting);
        Written { setting, brings: found.map(|found| (found.ranked_by, found.choice.seconds())) }
    }
}

/// Without what is told to be worse, the best first.
pub(super) fn ranked<'s>(
    mut candidates: Vec<Candidate<'s>>,
    study: &Study,
    written: Written<'s>,
) -> Vec<Candidate<'s>> {
    let is_no_dearer = |Candidate { choice, ranked_by, .. }: &Candidate| {
        written
            .brings
            .is_none_or(|(other, of_other)| *ranked_by >= other && choice.seconds() <= SAME_SECONDS * of_other)
    };
    let none_followed = !study.settings.iter().any(|setting| is_followed(setting, study));
    let is_put_to_test =
        |setting: &StudySetting| none_followed || study.tells_few_scenes || is_followed(setting, study);
    let rank = |candidate: &Candidate| match candidate.choice.setting.told {
        Some(Told::Better)
            if is_put_to_test(candidate.choice.setting)
                && (!is_capped(&candidate.choice) || is_no_dearer(candidate)) =>
        {
            2
        }
        _ => u8::from(candidate.choice.setting == written.setting),
    };
    candidates.retain(|candidate| candidate.choice.setting.told != Some(Told::Worse));
    let cost =
        |candidate: &Candidate| candidate.cheap_s(written).filter(|_| rank(candidate) == 0).unwrap_or(f64::INFINITY);
    candidates.sort_by(|a, b| {
        let by_rank = rank(b).cmp(&rank(a));
        by_rank.then(cost(a).total_cmp(&cost(b))).then(b.ranked_by.total_cmp(&a.ranked_by))
    });
    candidates
}
