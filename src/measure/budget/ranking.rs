//! Settings that could be built -> their order, the best first.
//!
//! By what is told of them at equal CPU; where disk or rows bind, which know no CPU, only if they also take no longer than the config
//! as written and are expected to be no worse. The config as written comes before what is not told apart; then what the study followed to more
//! scenes than the others, for it was the most accurate at equal CPU; then by what is expected no farther than twice the largest size that
//! all have. Left out: what is told to be worse.

use super::{Bound, Budget, Choice, Curve, Here};
use crate::measure::study::Study;
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
    /// As many scenes as the time of another choice pays; as it was where that pays none.
    pub(super) fn cut_to(&mut self, time: &Budget, common: f64, multiple: u64) {
        if let Some(choice) = self.curve.choice(time, &self.here, common, multiple) {
            let bound = if choice.bound == Bound::Hours { Bound::SameTime } else { choice.bound };
            self.choice = Choice { bound, ..choice };
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
    let rank = |candidate: &Candidate| match candidate.choice.setting.told {
        Some(Told::Better) if !is_capped(&candidate.choice) || is_no_dearer(candidate) => 2,
        _ => u8::from(candidate.choice.setting == study.as_written()),
    };
    let followed_to = |candidate: &Candidate| candidate.choice.setting.largest().scenes;
    candidates.retain(|candidate| candidate.choice.setting.told != Some(Told::Worse));
    candidates.sort_by(|a, b| {
        let by_rank = rank(b).cmp(&rank(a)).then(followed_to(b).cmp(&followed_to(a)));
        by_rank.then(b.ranked_by.total_cmp(&a.ranked_by))
    });
    candidates
}
