//! Settings that could be built -> their order, the best first.
//!
//! By what is told of them at equal CPU; where disk or rows bind, which know no CPU, only if they also take no longer than the config
//! as written and are expected to be no worse. Where settings were followed to more scenes, what is told better of the others was not put to that
//! test and ranks nothing. The config as written comes before what is not told apart. Of that the cheapest scenes come first, of settings which at
//! worst lose no more than half a point at equal CPU: of what is expected of them the luckiest would be the highest. Then, and among what is told
//! better, what is expected no farther than twice the largest size that all have decides. Left out: what is told to be worse.

use std::cmp::Ordering;

use super::{Bound, Budget, Choice, Curve, FLAT, Here, STUDY_SCENES, compared_sizes};
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
    /// As the study has it, for all of them alike.
    fn scene_cpu_s(&self) -> f64 {
        let largest = self.choice.setting.largest();
        largest.generate_cpu_s / largest.scenes as f64
    }

    /// Whether the study tells that it loses no more than half a point.
    fn loses_little(&self) -> bool {
        self.choice.setting.gain.is_some_and(|gain| gain.lower() >= -FLAT)
    }

    /// As many scenes as the time of another choice pays; as it was where that pays none.
    pub(super) fn cut_to(&mut self, time: &Budget, common: f64, multiple: u64) {
        if let Some(choice) = self.curve.choice(time, &self.here, common, multiple) {
            let bound = if choice.bound == Bound::Hours { Bound::SameTime } else { choice.bound };
            let most_scenes = self.choice.most_scenes;
            let [from, to] = [choice.scenes, most_scenes].map(|scenes| STUDY_SCENES * scenes as f64);
            self.choice = Choice { bound, most_scenes, left: self.curve.fit.gain(from, to), ..choice };
        }
    }
}

/// Without what is told to be worse, the best first.
pub(super) fn ranked<'s>(mut candidates: Vec<Candidate<'s>>, study: &Study) -> Vec<Candidate<'s>> {
    let written = candidates.iter().find(|candidate| candidate.choice.setting == study.as_written());
    let written = written.map(|written| (written.ranked_by, written.choice.seconds()));
    let is_no_dearer = |Candidate { choice, ranked_by, .. }: &Candidate| {
        written.is_none_or(|(other, of_other)| *ranked_by >= other && choice.seconds() <= SAME_SECONDS * of_other)
    };
    let is_capped = |choice: &Choice| matches!(choice.bound, Bound::Disk | Bound::Rows);
    let is_followed = |setting: &StudySetting| setting.sizes.len() > compared_sizes(study);
    let is_put_to_test = |setting: &StudySetting| is_followed(setting) || !study.settings.iter().any(is_followed);
    let rank = |candidate: &Candidate| match candidate.choice.setting.told {
        Some(Told::Better)
            if is_put_to_test(candidate.choice.setting)
                && (!is_capped(&candidate.choice) || is_no_dearer(candidate)) =>
        {
            2
        }
        _ => u8::from(candidate.choice.setting == study.as_written()),
    };
    candidates.retain(|candidate| candidate.choice.setting.told != Some(Told::Worse));
    let by_cost = |a: &Candidate, b: &Candidate| match (a.loses_little(), b.loses_little()) {
        (true, true) => a.scene_cpu_s().total_cmp(&b.scene_cpu_s()),
        (a, b) => b.cmp(&a),
    };
    candidates.sort_by(|a, b| {
        let of_rank = if rank(a) == 0 && rank(b) == 0 { by_cost(a, b) } else { Ordering::Equal };
        rank(b).cmp(&rank(a)).then(of_rank).then(b.ranked_by.total_cmp(&a.ranked_by))
    });
    candidates
}
