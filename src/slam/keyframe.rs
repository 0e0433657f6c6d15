//! What was seen at one stop and the particles' poses there -> the poses at the next, corrected.
//!
//! In: a [`Surface`] and the particles that saw it; later another surface and the same particles. Out: particles whose x, y and heading took in where
//! the one lies on the other. A particle that drew its pose where the keyframe was seen, as of FastSLAM with features in sight, has the way since to itself: the map stays one
//! of paths. One that did not carries that pose along, unsure as it is ([`ClonedPose`]). Source: sweeps laid on one another in a Rao-Blackwellised
//! filter are Haehnel et al. 2003; deviation: the registration is made once, from the mean of the cloud. A rock's points are in the fix, and their
//! middle is a feature matched after it: taken for independent, for what a middle errs (which side was seen, how far it was pushed back) is not what
//! the points err.

use super::cloned::ClonedPose;
use super::matrix::{Matrix, Vector, half_solve, ln_determinant, square};
use super::motion::YAW;
use super::particle::Particle;
use super::registration::{Fix, Motion, Registration, Surface, register};
use crate::math;

/// The surface that sweeps are laid on.
#[derive(Clone, Debug)]
pub(super) struct Keyframe {
    surface: Surface,
    /// Variance of roll and pitch, the larger, with which it was levelled.
    tilt_rad2: f64,
}

impl Keyframe {
    /// Of the particles as they now stand.
    pub(super) fn new(surface: Surface, tilt_rad2: f64, particles: &mut [Particle]) -> Keyframe {
        for particle in particles {
            particle.belief.keyframe = ClonedPose::of(&particle.belief);
        }
        Keyframe { surface, tilt_rad2 }
    }

    /// Lays a newer surface, levelled with that variance, on this one; the weights sum to 1.
    pub(super) fn register(
        &self,
        newer: &Surface,
        tilt_rad2: f64,
        particles: &[Particle],
        weights: &[f64],
    ) -> Registration {
        register(newer, &self.surface, &motion(particles, weights, tilt_rad2 + self.tilt_rad2))
    }
}

/// How the cloud came here from the keyframe.
fn motion(particles: &[Particle], weights: &[f64], tilt_rad2: f64) -> Motion {
    let (reference, ..) = particles[0].since_keyframe();
    let apart = |particle: &Particle| {
        let (state, slopes) = particle.since_keyframe();
        let [x, y, heading_rad]: Vector<3> = std::array::from_fn(|i| state[i] - reference[i]);
        let climb_m = particle.belief.mean[2] - particle.belief.keyframe.mean[2];
        ([x, y, math::wrap_angle(heading_rad), climb_m], slopes)
    };
    let mut mean = [0.0; 4];
    for (particle, &weight) in particles.iter().zip(weights) {
        let (d, _) = apart(particle);
        (0..4).for_each(|i| mean[i] += weight * d[i]);
    }
    let (mut covariance, mut climb_m2) = ([[0.0; 3]; 3], 0.0);
    for (particle, &weight) in particles.iter().zip(weights) {
        let (d, WaySlopes { by_pose, by_keyframe }) = apart(particle);
        let own = particle.belief.way_covariance(&by_pose, &by_keyframe);
        for r in 0..3 {
            for c in 0..3 {
                covariance[r][c] += weight * (own[r][c] + (d[r] - mean[r]) * (d[c] - mean[c]));
            }
        }
        climb_m2 += weight * (particle.belief.climb_m2() + (d[3] - mean[3]) * (d[3] - mean[3]));
    }
    let heading_rad = math::wrap_angle(reference[2] + mean[2]);
    let mean_of_way = [reference[0] + mean[0], reference[1] + mean[1], heading_rad];
    Motion { mean: mean_of_way, covariance, climb_m: mean[3], climb_m2, tilt_rad2 }
}

/// Slopes of x, y and heading since the keyframe, by the pose now and by that of the keyframe.
struct WaySlopes {
    by_pose: Matrix<3, 6>,
    by_keyframe: Matrix<3, 4>,
}

impl Particle {
    /// x, y and heading since the keyframe, in its level axes, and their slopes.
    #[inline(always)]
    fn since_keyframe(&self) -> (Vector<3>, WaySlopes) {
        let [x, y, _, heading_rad] = self.belief.keyframe.mean;
        let (sin, cos) = math::sin_cos(heading_rad);
        let (east, north) = (self.belief.mean[0] - x, self.belief.mean[1] - y);
        let heading_rad = math::wrap_angle(self.belief.mean[YAW] - heading_rad);
        let (along, across) = (cos * east + sin * north, cos * north - sin * east);
        let by_pose = [[cos, sin, 0.0, 0.0, 0.0, 0.0], [-sin, cos, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]];
        let by_keyframe = [[-cos, -sin, 0.0, across], [sin, -cos, 0.0, -along], [0.0, 0.0, 0.0, -1.0]];
        ([along, across, heading_rad], WaySlopes { by_pose, by_keyframe })
    }

    /// Kalman update of the pose by where the sweep lies on the keyframe's, and its part of the weight.
    #[inline(always)]
    pub(super) fn take_fix(&mut self, fix: &Fix) {
        let (state, WaySlopes { by_pose, by_keyframe }) = self.since_keyframe();
        let innovation = fix.innovation(&state);
        let Some(factor) = self.belief.measure_way(&by_pose, &by_keyframe, &innovation, &fix.covariance) else {
            return;
        };
        let distance2 = square(&half_solve(&factor, &innovation));
        self.log_weight -= 0.5 * (distance2 + ln_determinant(&factor));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slam::matrix::diagonal;
    use crate::slam::motion::GaussianPose;

    fn particle(mean: Vector<6>, keyframe: Vector<4>) -> Particle {
        let covariance = diagonal(&[4e-4, 9e-4, 1e-4, 1e-5, 1e-5, 1e-3]);
        let keyframe = ClonedPose { mean: keyframe, ..ClonedPose::default() };
        let belief = GaussianPose { mean, covariance, keyframe, ..GaussianPose::default() };
        Particle { belief, ..Particle::default() }
    }

    #[test]
    fn exact_slopes_of_the_way_are_its_differences() {
        let keyframe = [1.0, -2.0, 0.1, 2.8];
        let mean = [1.7, -1.4, 0.2, 0.05, -0.1, -3.0];
        let (way, WaySlopes { by_pose, by_keyframe }) = particle(mean, keyframe).since_keyframe();
        assert!((way[2] - (std::f64::consts::TAU - 5.8)).abs() < 1e-12, "through the half turn: {way:?}");
        assert!((math::hypot(way[0], way[1]) - math::hypot(0.7, 0.6)).abs() < 1e-12);
        for k in 0..6 {
            let mut moved = mean;
            moved[k] += 1e-6;
            let (other, _) = particle(moved, keyframe).since_keyframe();
            for r in 0..3 {
                assert!(((other[r] - way[r]) / 1e-6 - by_pose[r][k]).abs() < 1e-8, "({r}, {k})");
            }
        }
        for k in 0..4 {
            let mut moved = keyframe;
            moved[k] += 1e-6;
            let (other, _) = particle(mean, moved).since_keyframe();
            for r in 0..3 {
                assert!(((other[r] - way[r]) / 1e-6 - by_keyframe[r][k]).abs() < 2e-6, "keyframe's ({r}, {k})");
            }
        }
    }

    #[test]
    fn law_a_sure_fix_moves_the_pose_there_and_a_vague_one_leaves_it() {
        let keyframe = [0.0, 0.0, 0.0, 0.5];
        let before = particle([0.5, 0.3, 0.0, 0.0, 0.0, 0.6], keyframe);
        let (way, _) = before.since_keyframe();
        let mean = [way[0] + 0.02, way[1] - 0.03, way[2] + 0.02];
        for (sigma, share) in [(1e-5, 1.0), (1e3, 0.0)] {
            let mut after = before.clone();
            after.take_fix(&Fix { mean, covariance: diagonal(&[sigma * sigma; 3]) });
            let (moved, _) = after.since_keyframe();
            for k in 0..3 {
                assert!((moved[k] - way[k] - share * (mean[k] - way[k])).abs() < 1e-5, "{sigma}: {moved:?}");
            }
        }
    }

    #[test]
    fn law_of_two_particles_the_one_that_stands_where_the_fix_is_weighs_more_by_the_likelihoods_ratio() {
        let keyframe = [0.0; 4];
        let [mut near, mut far] = [0.5, 0.6].map(|x| particle([x, 0.0, 0.0, 0.0, 0.0, 0.0], keyframe));
        let fix = Fix { mean: [0.5, 0.0, 0.0], covariance: diagonal(&[5e-4, 1e-4, 1e-4]) };
        near.take_fix(&fix);
        far.take_fix(&fix);
        // x errs by 2 cm of the belief and 2.2 cm of the fix.
        let want = 0.5 * 0.1 * 0.1 / (4e-4 + 5e-4);
        assert!((near.log_weight - far.log_weight - want).abs() < 1e-9, "{} {}", near.log_weight, far.log_weight);
    }

    #[test]
    fn exact_the_clouds_way_is_the_mean_of_the_particles_and_its_spread_theirs() {
        let particles = [0.4, 0.6].map(|x| particle([x, 0.1, 0.3, 0.0, 0.0, 0.0], [0.0, 0.0, 0.2, 0.0]));
        let way = motion(&particles, &[0.25, 0.75], 1e-4);
        assert!((way.mean[0] - 0.55).abs() < 1e-12 && (way.mean[1] - 0.1).abs() < 1e-12);
        assert!((way.covariance[0][0] - (4e-4 + 0.25 * 0.75 * 0.04)).abs() < 1e-12, "{way:?}");
        assert!((way.covariance[1][1] - 9e-4).abs() < 1e-12);
        assert!((way.climb_m - 0.1).abs() < 1e-12 && (way.climb_m2 - 1e-4).abs() < 1e-12);
    }
}
