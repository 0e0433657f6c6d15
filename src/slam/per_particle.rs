//! What is done to every particle, compiled for registers of four numbers.
//!
//! In: particles, and what [`Particle`] takes for one. Out: the same particles. Rows of six numbers fill registers of eight badly: there
//! the compiler shuffles more than it saves (measured: a third slower than in fours).

use super::motion::{Control, MotionNoise};
use super::particle::{Particle, Scratch, SweepObservations};
use super::registration::Fix;
use super::visibility::Visibility;
use crate::wide::Work;

/// [`GaussianPose::drive`](super::motion::GaussianPose::drive).
pub(super) struct Drive<'a> {
    pub particles: &'a mut [Particle],
    pub control: Control,
    pub noise: &'a MotionNoise,
}

impl Work for Drive<'_> {
    type Out = ();
    #[inline(always)]
    fn run(self) {
        for particle in self.particles {
            particle.belief.drive(self.control, self.noise);
        }
    }
}

/// [`GaussianPose::read_angle`](super::motion::GaussianPose::read_angle), and its part of the weight.
pub(super) struct ReadAngle<'a> {
    pub particles: &'a mut [Particle],
    pub component: usize,
    pub angle_rad: f64,
    pub variance_rad2: f64,
}

impl Work for ReadAngle<'_> {
    type Out = ();
    #[inline(always)]
    fn run(self) {
        for particle in self.particles {
            particle.log_weight += particle.belief.read_angle(self.component, self.angle_rad, self.variance_rad2);
        }
    }
}

/// [`Particle::update_pose`].
pub(super) struct UpdatePose<'a> {
    pub particles: &'a mut [Particle],
    pub seen: SweepObservations<'a>,
    pub scratch: &'a mut Scratch,
}

impl Work for UpdatePose<'_> {
    type Out = ();
    #[inline(always)]
    fn run(self) {
        for particle in self.particles {
            particle.update_pose(&self.seen, self.scratch);
        }
    }
}

/// [`Particle::take_fix`].
pub(super) struct TakeFix<'a> {
    pub particles: &'a mut [Particle],
    pub fix: &'a Fix,
}

impl Work for TakeFix<'_> {
    type Out = ();
    #[inline(always)]
    fn run(self) {
        for particle in self.particles {
            particle.take_fix(self.fix);
        }
    }
}

/// [`Particle::update_map`].
pub(super) struct UpdateMap<'a> {
    pub particles: &'a mut [Particle],
    pub seen: SweepObservations<'a>,
    pub visibility: &'a Visibility<'a>,
    pub scratch: &'a mut Scratch,
}

impl Work for UpdateMap<'_> {
    type Out = ();
    #[inline(always)]
    fn run(self) {
        for particle in self.particles {
            particle.update_map(&self.seen, self.visibility, self.scratch);
        }
    }
}
