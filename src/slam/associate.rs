//! A feature and a particle's map -> which landmark it is.
//!
//! In: a [`Particle`], a feature, where the sensor stands. Out: an [`AssociationResult`]; for a match all that the update needs. Source:
//! Montemerlo et al. 2003, association by particle. Deviations: likelihood instead of distance picks a landmark (MRPT's matching
//! likelihood); a feature that may be of two landmarks weighs as the mean of both.

use super::gating::{LandmarkIndex, RangeGate};
use super::matrix::{Matrix, Vector, cholesky, half_solve, ln_determinant, product, square, sum, transpose};
use super::measurement::{Polar, SensorView, innovation};
use super::observation::{Feature, Observation};
use super::particle::Particle;
use crate::math;

/// Chi-square of three degrees of freedom at 99 %.
pub(super) const GATE: f64 = 11.34;
/// A feature is new beyond this distance squared from every landmark; between the two gates
/// it neither matches a landmark nor starts one.
pub(super) const NEW_BEYOND: f64 = 25.0;
/// Two landmarks are told apart from this ratio of likelihoods on.
const LN_RATIO: f64 = 1.098_612_288_668_109_8;

/// A landmark judged against a feature.
#[derive(Default)]
pub(super) struct Candidate {
    pub index: usize,
    pub by_pose: Matrix<3, 6>,
    /// The same times the pose's covariance.
    pub pull: Matrix<3, 6>,
    pub innovation: Vector<3>,
    /// Covariance of the measurement and of the landmark alone, and the factor of all of it with the pose's.
    pub spread: Matrix<3, 3>,
    pub factor: Matrix<3, 3>,
    pub distance2: f64,
}

impl Candidate {
    /// Without the density's constant.
    #[inline(always)]
    fn ln_likelihood(&self) -> f64 {
        -0.5 * (self.distance2 + ln_determinant(&self.factor))
    }
}

/// The best landmark so far and the next one.
pub(super) type Pair = [Candidate; 2];

/// What a feature turns out to be.
pub(super) enum AssociationResult {
    /// Of which of the pair, and `ln_likelihood` without the density's constant.
    Match {
        slot: usize,
        ln_likelihood: f64,
    },
    /// Of one of two landmarks, the likelier and the other; `ln_likelihood` without the density's constant.
    Ambiguous {
        winner: usize,
        loser: usize,
        ln_likelihood: f64,
    },
    New,
    Unclear,
}

impl Particle {
    /// Which landmark a feature is, if any. `pair` is scratch to judge in.
    #[inline(always)]
    pub(super) fn associate(
        &self,
        observation: &Observation,
        view: &SensorView,
        noise: &Matrix<3, 3>,
        taken: &[bool],
        places: &mut LandmarkIndex,
        pair: &mut Pair,
    ) -> AssociationResult {
        let feature = &observation.feature;
        if let Some(id) = feature.known {
            let index = self.landmarks.iter().position(|l| l.known == Some(id));
            let known = index.is_some_and(|i| self.judge(i, feature, view, noise, f64::INFINITY, &mut pair[0]));
            return if known {
                AssociationResult::Match { slot: 0, ln_likelihood: pair[0].ln_likelihood() }
            } else {
                AssociationResult::New
            };
        }
        let ring = self.ring(&feature.polar, view, noise);
        let reach_m = ring.reach_m(noise[1][1] + noise[2][2], places.most_variance_m2());
        let mut best: Option<(usize, f64)> = None;
        let mut runner_up: Option<(usize, f64)> = None;
        let mut nearest = f64::INFINITY;
        let mut crowded = false;
        for &index in places.within(reach_m, &view.in_map(&observation.point_m)) {
            let index = index as usize;
            let slot = best.map_or(0, |(slot, _)| 1 - slot);
            if ring.rules_out(&self.landmarks[index])
                || !self.judge(index, feature, view, noise, NEW_BEYOND, &mut pair[slot])
            {
                continue;
            }
            let candidate = &pair[slot];
            if taken[index] {
                crowded |= candidate.distance2 <= GATE;
                continue;
            }
            nearest = nearest.min(candidate.distance2);
            if candidate.distance2 > GATE {
                continue;
            }
            let ln_likelihood = candidate.ln_likelihood();
            let rival = match best {
                Some((_, leader)) if leader >= ln_likelihood => (index, ln_likelihood),
                _ => match best.replace((slot, ln_likelihood)) {
                    Some((old, ln_likelihood)) => (pair[old].index, ln_likelihood),
                    None => continue,
                },
            };
            if runner_up.is_none_or(|(_, ln)| rival.1 > ln) {
                runner_up = Some(rival);
            }
        }
        match (best, runner_up) {
            (Some((slot, best)), Some((loser, ln))) if best - ln < LN_RATIO => {
                // The mean of the two likelihoods: it is one of them, and neither is known to be it.
                let ln_likelihood = best + math::ln(0.5 * (1.0 + math::exp(ln - best)));
                AssociationResult::Ambiguous { winner: pair[slot].index, loser, ln_likelihood }
            }
            (Some((slot, ln_likelihood)), _) => AssociationResult::Match { slot, ln_likelihood },
            (None, _) if nearest > NEW_BEYOND && !crowded => AssociationResult::New,
            (None, _) => AssociationResult::Unclear,
        }
    }

    /// What the range of a feature says of landmarks.
    #[inline(always)]
    pub(super) fn ring(&self, polar: &Polar, view: &SensorView, noise: &Matrix<3, 3>) -> RangeGate {
        let p = &self.belief.covariance;
        RangeGate {
            range_m: polar[0],
            variance_m2: noise[0][0],
            sensor_m: view.sensor_m(),
            lever_m: view.lever_m(),
            moved_m: (p[0][0] + p[1][1] + p[2][2]).sqrt(),
            turned_rad: (p[3][3] + p[4][4] + p[5][5]).sqrt(),
        }
    }

    /// Judges a landmark; false where it cannot be judged, or where the range's part of the distance squared, which is a sum of
    /// squares, is beyond `limit` by itself: most landmarks need no arc tangents then.
    #[inline(always)]
    pub(super) fn judge(
        &self,
        index: usize,
        feature: &Feature,
        view: &SensorView,
        noise: &Matrix<3, 3>,
        limit: f64,
        to: &mut Candidate,
    ) -> bool {
        let landmark = &self.landmarks[index];
        let Some(sight) = view.sight(&landmark.mean_m) else { return false };
        let (hm, hs) = view.slopes(&sight);
        let pull = product(&hs, &self.belief.covariance);
        let spread = sum(&product(&product(&hm, &landmark.covariance_m2), &transpose(&hm)), noise);
        let Some(factor) = cholesky(&sum(&product(&pull, &transpose(&hs)), &spread)) else { return false };
        let first = (feature.polar[0] - sight.range) / factor[0][0];
        if first * first > limit {
            return false;
        }
        let innovation = innovation(&feature.polar, &sight.polar());
        let distance2 = square(&half_solve(&factor, &innovation));
        *to = Candidate { index, by_pose: hs, pull, innovation, spread, factor, distance2 };
        true
    }
}
