//! A cloud of weighted particles -> its weights, means and covariances, and its resampling.
//!
//! In: [`Particle`]s whose log weights were added to. Out: what the cloud as a whole believes; metres, radians, position relative to the start. Means
//! and covariances are those of the mixture of the particles' Gaussians; angles are averaged as differences to the first particle's.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::matrix::{Matrix, Vector};
use super::motion::{GaussianPose, ROLL, YAW};
use super::particle::{Association, Particle};
use super::weights::{Genealogy, effective_samples, exponentials, normalise, systematic};
use crate::math;

/// Mean and covariance of the whole cloud, and how good it is; position relative to the start.
#[derive(Clone, Debug)]
pub(super) struct ParticleMoments {
    pub mean: Vector<6>,
    pub covariance: Matrix<6, 6>,
    pub effective_samples: f64,
}

/// Particles, and which of the first ones they descend from.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    pub particles: Vec<Particle>,
    spare: Vec<Particle>,
    /// Wins where log weights are equal: the first child of the particle that was likeliest before the last resampling; 0 before any.
    favourite: usize,
    ancestry: Genealogy,
}

impl Cloud {
    /// So many particles that believe the same.
    pub(super) fn new(count: usize, belief: GaussianPose) -> Cloud {
        let log_weight = -math::ln(count as f64);
        let particle = Particle { belief, log_weight, ..Particle::default() };
        let ancestry = Genealogy::new(count);
        Cloud { particles: vec![particle.clone(); count], spare: vec![particle; count], favourite: 0, ancestry }
    }

    /// Keeps the log weights normalised, so that none drifts out of range over a long drive; whether any weight was left.
    pub(super) fn normalise(&mut self) -> bool {
        let mut logs: Vec<f64> = self.particles.iter().map(|p| p.log_weight).collect();
        let is_left = normalise(&mut logs);
        for (particle, log) in self.particles.iter_mut().zip(logs) {
            particle.log_weight = log;
        }
        is_left
    }

    /// The particles' weights; they sum to 1.
    pub(super) fn weights(&self) -> Vec<f64> {
        exponentials(self.particles.iter().map(|p| p.log_weight).collect())
    }

    /// Mean and variance of one angle over the cloud.
    pub(super) fn angle(&self, component: usize) -> (f64, f64) {
        let reference = self.particles[0].belief.mean[component];
        // Within a step the weights are not normalised, and their logarithms may be large.
        let most = self.likeliest().log_weight;
        let weights = exponentials(self.particles.iter().map(|p| p.log_weight - most).collect());
        let (mut total, mut first, mut second, mut own) = (0.0, 0.0, 0.0, 0.0);
        for (particle, weight) in self.particles.iter().zip(weights) {
            let d = math::wrap_angle(particle.belief.mean[component] - reference);
            total += weight;
            first += weight * d;
            second += weight * d * d;
            own += weight * particle.belief.covariance[component][component];
        }
        let mean = first / total;
        (math::wrap_angle(reference + mean), (second / total - mean * mean).max(0.0) + own / total)
    }

    /// Mean and variance of the odometry's scale over the cloud.
    pub(super) fn scale(&self) -> (f64, f64) {
        // One that was known from the start is the same for all.
        if self.particles.iter().all(|p| p.belief.scale.is_known()) {
            return (self.likeliest().belief.scale.mean, 0.0);
        }
        let (mut mean, mut second) = (0.0, 0.0);
        for (particle, weight) in self.particles.iter().zip(self.weights()) {
            let scale = &particle.belief.scale;
            mean += weight * scale.mean;
            second += weight * (scale.variance + scale.mean * scale.mean);
        }
        (mean, (second - mean * mean).max(0.0))
    }

    /// Draws the particles anew by their weights; `start` lies in [0, 1).
    pub(super) fn resample(&mut self, start: f64) {
        let parents = systematic(&self.weights(), start);
        self.descend(&parents);
    }

    /// Each particle becomes the child of the one that is named for it, and all weigh the same.
    fn descend(&mut self, parents: &[u32]) {
        let best = self.likeliest_index() as u32;
        self.favourite = parents.iter().position(|&parent| parent == best).unwrap_or(0);
        let equal = -math::ln(self.particles.len() as f64);
        for (child, &parent) in self.spare.iter_mut().zip(parents) {
            child.clone_from(&self.particles[parent as usize]);
            child.log_weight = equal;
        }
        std::mem::swap(&mut self.particles, &mut self.spare);
        self.ancestry.record(parents);
    }

    pub(super) fn likeliest(&self) -> &Particle {
        &self.particles[self.likeliest_index()]
    }

    fn likeliest_index(&self) -> usize {
        let mut best = self.favourite;
        for (i, particle) in self.particles.iter().enumerate() {
            if particle.log_weight > self.particles[best].log_weight {
                best = i;
            }
        }
        best
    }

    /// Mean and covariance of the cloud as it is, angles as differences to the first particle's.
    pub(super) fn moments(&self) -> ParticleMoments {
        let weights = self.weights();
        let reference = self.particles[0].belief.mean;
        let apart = |mean: &Vector<6>| -> Vector<6> {
            std::array::from_fn(|i| {
                let d = mean[i] - reference[i];
                if i == ROLL || i == YAW { math::wrap_angle(d) } else { d }
            })
        };
        let mut shift = [0.0; 6];
        for (particle, &weight) in self.particles.iter().zip(&weights) {
            let d = apart(&particle.belief.mean);
            for i in 0..6 {
                shift[i] += weight * d[i];
            }
        }
        let mut covariance = [[0.0; 6]; 6];
        for (particle, &weight) in self.particles.iter().zip(&weights) {
            let d = apart(&particle.belief.mean);
            for r in 0..6 {
                for c in 0..6 {
                    let spread = (d[r] - shift[r]) * (d[c] - shift[c]);
                    covariance[r][c] += weight * (particle.belief.covariance[r][c] + spread);
                }
            }
        }
        let mut mean: Vector<6> = std::array::from_fn(|i| reference[i] + shift[i]);
        mean[ROLL] = math::wrap_angle(mean[ROLL]);
        mean[YAW] = math::wrap_angle(mean[YAW]);
        ParticleMoments { mean, covariance, effective_samples: effective_samples(&weights) }
    }

    /// Normalised innovation squared of a match, averaged with the weights from before the sweep.
    pub(super) fn innovation(&self, prior: &[f64]) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0.0);
        for (particle, weight) in self.particles.iter().zip(prior) {
            let matches = particle.associations.iter().filter(|a| matches!(a, Association::Matched(_))).count();
            sum += weight * particle.innovation_sum;
            count += weight * matches as f64;
        }
        (count > 0.0).then(|| sum / count)
    }

    /// How many of the first particles have descendants left.
    pub(super) fn ancestors(&self) -> usize {
        self.ancestry.distinct()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_the_likeliest_particle_is_the_one_of_the_greatest_weight_or_its_child() {
        for likeliest in 0..9 {
            let mut cloud = Cloud::new(9, GaussianPose::default());
            for (k, particle) in cloud.particles.iter_mut().enumerate() {
                particle.log_weight = -3.0 - k as f64 + if k == likeliest { 20.0 } else { 0.0 };
            }
            assert_eq!(cloud.likeliest_index(), likeliest);
            // Its children weigh as much as all others; the first of them is the likeliest still.
            let parents: Vec<u32> = (0..9).map(|child: u32| child.min(likeliest as u32)).collect();
            cloud.descend(&parents);
            assert_eq!(cloud.likeliest_index(), likeliest);
            cloud.descend(&[likeliest as u32; 9]);
            assert_eq!(cloud.likeliest_index(), 0);
        }
    }
}
