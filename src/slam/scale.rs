//! Where the rover is found to be -> how much of the counted way it drives.
//!
//! In: the steps, measurements and draws of a pose. Out: what is believed of one number beside it, the share of the counted way that is driven,
//! the same over the whole drive, as where wheels slip by a constant share. A seventh state of the Kalman filter, which
//! nothing measures but by the pose that it led to, and which a draw of the pose tells as far as the way there does (Rao-Blackwellised: each
//! particle has its own). Source: systematic errors of odometry are those of Borenstein & Feng 1996; that a filter learns them as states, Larsen et
//! al. 1998. The gain form without Joseph's is enough for one number that nothing else is drawn from. Not modelled: turns that are counted by
//! the same wheels, and slip that changes on the way, as with the slope; both are noise of the odometry. Of a scale that is known nothing is done.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::matrix::{Matrix, Vector, apply, half_solve_clamped, solve, square};

/// Mean and variance of the odometry's scale, a share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleFactor {
    pub mean: f64,
    pub variance: f64,
    /// Covariance with x, y, z, roll, pitch, yaw: metres, radians.
    pub with_pose: Vector<6>,
}

impl Default for ScaleFactor {
    /// Odometry that counts what is driven.
    fn default() -> Self {
        ScaleFactor { mean: 1.0, variance: 0.0, with_pose: [0.0; 6] }
    }
}

impl ScaleFactor {
    /// Odometry that counts what is driven, up to a share of that standard deviation.
    pub(super) fn of_slip(slip: f64) -> ScaleFactor {
        ScaleFactor { variance: slip * slip, ..ScaleFactor::default() }
    }

    /// Whether the scale is known exactly: it was from the start, or rounding left nothing to learn.
    #[inline(always)]
    pub(super) fn is_known(&self) -> bool {
        self.variance == 0.0
    }

    /// As a filter of all numbers tells it.
    pub(super) fn take(&mut self, mean: f64, variance: f64, with_pose: Vector<6>) {
        *self = ScaleFactor { mean, variance, with_pose };
        self.learn(0.0);
    }

    /// Takes what was learnt off the variance. Where rounding leaves none or less, the scale is known, and uncorrelated with the pose.
    #[inline(always)]
    fn learn(&mut self, variance: f64) {
        self.variance -= variance;
        if self.variance <= 0.0 {
            (self.variance, self.with_pose) = (0.0, [0.0; 6]);
        }
    }

    /// What is unsure of the scale v stretches a step, by whose slopes G it moves the position: P + c G' + G c' + G v G', where the step has
    /// carried the covariance c with the pose already.
    #[inline(always)]
    pub(super) fn stretch(&mut self, covariance: &mut Matrix<6, 6>, by_scale: &Vector<3>) {
        let (p, c, v) = (covariance, &mut self.with_pose, self.variance);
        for k in 0..3 {
            for r in 0..6 {
                p[r][k] += c[r] * by_scale[k];
                p[k][r] += c[r] * by_scale[k];
            }
            for r in 0..3 {
                p[r][k] += by_scale[r] * by_scale[k] * v;
            }
        }
        for r in 0..3 {
            c[r] += by_scale[r] * v;
        }
    }

    /// The seventh row of the gain of a measurement with slopes `by_pose`; `pull` is H P, and `factor` that of H P H' + the noise.
    #[inline(always)]
    pub(super) fn measure(
        &mut self,
        by_pose: &Matrix<3, 6>,
        pull: &Matrix<3, 6>,
        factor: &Matrix<3, 3>,
        innovation: &Vector<3>,
    ) {
        if self.is_known() {
            return;
        }
        let common = apply(by_pose, &self.with_pose);
        let gain = solve(factor, &common.map(|v| [v])).map(|[v]| v);
        for k in 0..3 {
            self.mean += gain[k] * innovation[k];
            for r in 0..6 {
                self.with_pose[r] -= gain[k] * pull[k][r];
            }
        }
        self.learn(gain.iter().zip(common).map(|(gain, common)| gain * common).sum());
    }

    /// The same of a reading of one number of the pose, of whose covariance `row` is the row, and `spread` the innovation's variance. Right after a
    /// draw an angle has nothing in common with the scale; it has where a measurement was taken in since.
    #[inline(always)]
    pub(super) fn read(&mut self, component: usize, row: &Vector<6>, spread: f64, innovation: f64) {
        if self.is_known() {
            return;
        }
        let common = self.with_pose[component];
        let gain = common / spread;
        self.mean += gain * innovation;
        for r in 0..6 {
            self.with_pose[r] -= gain * row[r];
        }
        self.learn(gain * common);
    }

    /// What a draw of the pose tells, L n off its mean, where L L' was its covariance P: P^-1 c leads there by (L^-1 c)' n.
    pub(super) fn draw(&mut self, factor: &Matrix<6, 6>, normals: &Vector<6>) {
        if self.is_known() {
            return;
        }
        let told = half_solve_clamped(factor, &self.with_pose);
        for (told, normal) in told.iter().zip(normals) {
            self.mean += told * normal;
        }
        self.with_pose = [0.0; 6];
        self.learn(square(&told));
    }
}

#[cfg(test)]
pub(in crate::slam) mod tests;
