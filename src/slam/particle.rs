//! One particle and one sweep's features -> its refined pose, its weight, its map.
//!
//! In: a [`Particle`], [`Observation`]s, the mount. Out: the same particle. Source: Montemerlo et al. 2003, in the gain form of
//! T. Bailey's fastslam2: the covariance is carried and never inverted (it is singular right after a step), and every
//! feature of a sweep refines the pose before it is drawn. Deviation: a feature that may be of two landmarks updates neither; those
//! of association are told in `associate`.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::associate::{AssociationResult, Candidate, Pair};
use super::gating::LandmarkIndex;
use super::landmark::Landmark;
use super::matrix::diagonal;
use super::measurement::{Mounting, SensorView};
use super::motion::GaussianPose;
use super::observation::Observation;
use super::visibility::Visibility;

/// What a particle took a feature for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Association {
    Matched(usize),
    New,
    /// Near two landmarks: the likelier and the other.
    Ambiguous([usize; 2]),
    /// Near a landmark but not near enough.
    Unclear,
}

/// One belief of pose and map.
#[derive(Debug, Default)]
pub(super) struct Particle {
    pub belief: GaussianPose,
    pub log_weight: f64,
    pub landmarks: Vec<Landmark>,
    /// Of the current sweep's features, in their order.
    pub associations: Vec<Association>,
    /// Normalised innovations squared of the current sweep's matches, summed.
    pub innovation_sum: f64,
}

impl Clone for Particle {
    fn clone(&self) -> Self {
        let mut copy = Particle::default();
        copy.clone_from(self);
        copy
    }

    // Written out so that resampling reuses the maps' memory.
    fn clone_from(&mut self, source: &Self) {
        self.belief.clone_from(&source.belief);
        self.log_weight = source.log_weight;
        self.landmarks.clone_from(&source.landmarks);
        self.associations.clone_from(&source.associations);
        self.innovation_sum = source.innovation_sum;
    }
}

/// A sweep's features, and what all particles need to take them in.
pub(super) struct SweepObservations<'a> {
    pub observations: &'a [Observation],
    pub mounting: &'a Mounting,
}

/// What a particle needs while it takes in a sweep; serves one after the other.
#[derive(Default)]
pub(super) struct Scratch {
    places: LandmarkIndex,
    pair: Pair,
    /// Landmarks that a feature was given to.
    taken: Vec<bool>,
}

/// -3/2 ln 2 pi: the constant of a density in three dimensions.
const LN_DENSITY: f64 = -2.756_815_599_614_018_3;

impl Particle {
    /// Associates each feature in order (nearest first), refines the pose by every match, and weighs the particle: one
    /// log term a feature whatever becomes of it, so that particles stay comparable.
    #[inline(always)]
    pub(super) fn update_pose(
        &mut self,
        &SweepObservations { observations, mounting }: &SweepObservations,
        scratch: &mut Scratch,
    ) {
        self.associations.clear();
        self.innovation_sum = 0.0;
        let Scratch { places, pair, taken } = scratch;
        places.fill(&self.landmarks);
        taken.clear();
        taken.resize(self.landmarks.len(), false);
        let mut view = SensorView::new(&self.belief.mean, mounting);
        let mut moved = false;
        for observation in observations {
            if moved {
                view = SensorView::new(&self.belief.mean, mounting);
            }
            moved = false;
            let noise = diagonal(&observation.variances);
            let association = match self.associate(observation, &view, &noise, taken, places, pair) {
                AssociationResult::Match { slot, ln_likelihood } => {
                    let candidate = &pair[slot];
                    taken[candidate.index] = true;
                    self.innovation_sum += candidate.distance2;
                    self.log_weight += ln_likelihood + LN_DENSITY;
                    self.kalman_update(candidate);
                    moved = true;
                    Association::Matched(candidate.index)
                }
                AssociationResult::Ambiguous { winner, loser, ln_likelihood } => {
                    self.log_weight += ln_likelihood + LN_DENSITY;
                    Association::Ambiguous([winner, loser])
                }
                AssociationResult::New => {
                    self.log_weight += observation.ln_unmatched;
                    Association::New
                }
                AssociationResult::Unclear => {
                    self.log_weight += observation.ln_unmatched;
                    Association::Unclear
                }
            };
            self.associations.push(association);
        }
    }

    /// Kalman update of the pose by a match.
    #[inline(always)]
    fn kalman_update(&mut self, candidate: &Candidate) {
        let Candidate { by_pose, pull, factor, innovation, spread, .. } = candidate;
        self.belief.measure(by_pose, pull, factor, innovation, spread);
    }

    /// Updates the landmarks from the pose as it now is: matches, newcomers, what should have been seen.
    #[inline(always)]
    pub(super) fn update_map(
        &mut self,
        &SweepObservations { observations, mounting }: &SweepObservations,
        visibility: &Visibility,
        Scratch { taken: seen, .. }: &mut Scratch,
    ) {
        let view = SensorView::new(&self.belief.mean, mounting);
        seen.clear();
        seen.resize(self.landmarks.len(), false);
        for (Observation { feature, variances, .. }, association) in observations.iter().zip(&self.associations) {
            let noise = diagonal(variances);
            match *association {
                Association::Matched(index) => {
                    seen[index] = true;
                    self.landmarks[index].see();
                    self.landmarks[index].kalman_update(feature, &view, &noise);
                }
                Association::New => {
                    // A number may be seen twice at its first sight.
                    let same = |landmark: &&mut Landmark| landmark.known == feature.known;
                    match feature.known.and_then(|_| self.landmarks.iter_mut().find(same)) {
                        Some(landmark) => landmark.kalman_update(feature, &view, &noise),
                        None => self.landmarks.push(Landmark::new(feature, &view, variances)),
                    }
                }
                Association::Ambiguous([winner, loser]) => {
                    // One of a pair of doubles fades away; two real neighbours take turns and both stay.
                    (seen[winner], seen[loser]) = (true, true);
                    self.landmarks[loser].miss();
                }
                Association::Unclear => {}
            }
        }
        for (landmark, &mut seen) in self.landmarks.iter_mut().zip(seen) {
            if !seen && visibility.sees(&view.in_sensor(&landmark.mean_m)) {
                landmark.miss();
            }
            landmark.bound_existence();
        }
        self.landmarks.retain(Landmark::is_kept);
    }
}

#[cfg(test)]
mod tests;
