//! The pose now and the pose at a keyframe, as one Gaussian -> what a measurement of the way between them tells of both.
//!
//! In: the steps, readings, measurements and draws of a pose. Out: x, y, z and heading at the keyframe, with what they have in common with the
//! pose now and with the odometry's scale. Metres, radians, state order of [`GaussianPose`]. Source: stochastic cloning, Roumeliotis & Burdick 2002;
//! deviation: of the pose at the keyframe only what a way in the plane hangs on is kept, without roll and pitch.
//! A pose that was drawn at its keyframe knows it exactly, and nothing is carried: so it is with particles of FastSLAM that saw features there. A Gaussian that was not
//! drawn keeps what its heading there errs, and a later reading of the sun corrects the way since. Not modelled: more than one keyframe, and that two
//! ways in a row share a sweep, so that they err together.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::kalman;
use super::matrix::{Matrix, Vector, cholesky, half_solve_clamped, product, sum, transpose};
use super::motion::{GaussianPose, YAW};
use super::scale::ScaleFactor;

/// x, y, z and heading among the numbers of a pose.
const KEPT: [usize; 4] = [0, 1, 2, YAW];
/// Pose, keyframe and scale: where each begins among the numbers of all.
const ALL: usize = 11;
const KEYFRAME: usize = 6;
const SCALE: usize = 10;

/// Where the rover stood at the keyframe: x, y, z, heading.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClonedPose {
    pub mean: Vector<4>,
    /// `None`: known exactly.
    pub(super) covariances: Option<Box<CloneCovariances>>,
}

/// What is unsure of the keyframe.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CloneCovariances {
    own: Matrix<4, 4>,
    with_pose: Matrix<4, 6>,
    with_scale: Vector<4>,
}

impl ClonedPose {
    /// The pose now becomes the keyframe.
    pub(super) fn of(belief: &GaussianPose) -> ClonedPose {
        let GaussianPose { mean, covariance, scale, .. } = belief;
        let is_known = covariance.iter().flatten().all(|&v| v == 0.0);
        let covariances = || CloneCovariances {
            own: KEPT.map(|k| KEPT.map(|l| covariance[k][l])),
            with_pose: KEPT.map(|k| covariance[k]),
            with_scale: KEPT.map(|k| scale.with_pose[k]),
        };
        ClonedPose { mean: KEPT.map(|k| mean[k]), covariances: (!is_known).then(|| Box::new(covariances())) }
    }

    /// A step carries what the keyframe has in common with the pose as it does the pose's own rows; what is unsure of the scale moves the position
    /// by `by_scale`, and is in common with the keyframe as well.
    #[inline(always)]
    pub(super) fn drive(&mut self, carry: impl Fn(&mut Vector<6>), by_scale: &Vector<3>) {
        let Some(unsure) = &mut self.covariances else { return };
        for (row, common) in unsure.with_pose.iter_mut().zip(unsure.with_scale) {
            carry(row);
            for r in 0..3 {
                row[r] += common * by_scale[r];
            }
        }
    }

    /// What a reading of one number of the pose tells: `row` is that of the pose's covariance, and `spread` the innovation's variance.
    #[inline(always)]
    pub(super) fn read(
        &mut self,
        component: usize,
        row: &Vector<6>,
        scale: &ScaleFactor,
        spread: f64,
        innovation: f64,
    ) {
        let Some(unsure) = &mut self.covariances else { return };
        let common: Vector<4> = std::array::from_fn(|k| unsure.with_pose[k][component]);
        for k in 0..4 {
            let gain = common[k] / spread;
            self.mean[k] += gain * innovation;
            unsure.with_scale[k] -= gain * scale.with_pose[component];
            for l in 0..4 {
                unsure.own[k][l] -= gain * common[l];
            }
            for r in 0..6 {
                unsure.with_pose[k][r] -= gain * row[r];
            }
        }
    }

    /// What a draw of the pose tells, L n off its mean, where L L' was its covariance: as of the scale ([`ScaleFactor`]), which has not been told yet.
    pub(super) fn draw(&mut self, factor: &Matrix<6, 6>, normals: &Vector<6>, scale: &ScaleFactor) {
        let Some(unsure) = &mut self.covariances else { return };
        let told = unsure.with_pose.map(|row| half_solve_clamped(factor, &row));
        let of_scale = half_solve_clamped(factor, &scale.with_pose);
        for k in 0..4 {
            for i in 0..6 {
                self.mean[k] += told[k][i] * normals[i];
                unsure.with_scale[k] -= told[k][i] * of_scale[i];
                for l in 0..4 {
                    unsure.own[k][l] -= told[k][i] * told[l][i];
                }
            }
        }
        unsure.with_pose = [[0.0; 6]; 4];
    }

    pub(super) fn is_known(&self) -> bool {
        self.covariances.is_none()
    }
}

impl GaussianPose {
    /// Variance of the climb since the keyframe.
    pub(super) fn climb_m2(&self) -> f64 {
        let own_m2 = self.covariance[2][2];
        self.keyframe
            .covariances
            .as_ref()
            .map_or(own_m2, |unsure| own_m2 + unsure.own[2][2] - 2.0 * unsure.with_pose[2][2])
    }

    /// Covariance of three numbers of slopes `by_pose` and `by_keyframe`.
    #[inline(always)]
    pub(super) fn way_covariance(&self, by_pose: &Matrix<3, 6>, by_keyframe: &Matrix<3, 4>) -> Matrix<3, 3> {
        let of_pose = product(&product(by_pose, &self.covariance), &transpose(by_pose));
        let Some(unsure) = &self.keyframe.covariances else { return of_pose };
        let across = product(&product(by_keyframe, &unsure.with_pose), &transpose(by_pose));
        let of_keyframe = product(&product(by_keyframe, &unsure.own), &transpose(by_keyframe));
        sum(&sum(&of_pose, &of_keyframe), &sum(&across, &transpose(&across)))
    }

    /// Kalman update of pose, keyframe and scale by three numbers of slopes `by_pose` and `by_keyframe`; the factor of the innovation's covariance,
    /// or `None`, and nothing is updated, where that has none.
    pub(super) fn measure_way(
        &mut self,
        by_pose: &Matrix<3, 6>,
        by_keyframe: &Matrix<3, 4>,
        innovation: &Vector<3>,
        noise: &Matrix<3, 3>,
    ) -> Option<Matrix<3, 3>> {
        if self.keyframe.is_known() {
            let pull = product(by_pose, &self.covariance);
            let factor = cholesky(&sum(&product(&pull, &transpose(by_pose)), noise))?;
            self.measure(by_pose, &pull, &factor, innovation, noise);
            return Some(factor);
        }
        let (mut mean, mut covariance) = self.stacked();
        let mut slopes = [[0.0; ALL]; 3];
        for r in 0..3 {
            slopes[r][..KEYFRAME].copy_from_slice(&by_pose[r]);
            slopes[r][KEYFRAME..SCALE].copy_from_slice(&by_keyframe[r]);
        }
        let pull = product(&slopes, &covariance);
        let factor = cholesky(&sum(&product(&pull, &transpose(&slopes)), noise))?;
        kalman::update((&mut mean, &mut covariance), &slopes, &pull, &factor, innovation, noise);
        self.unstack(&mean, &covariance);
        self.wrap();
        Some(factor)
    }

    /// Pose, keyframe and scale in one column, and their covariance. A scale that is known has nothing in common with anything.
    fn stacked(&self) -> (Vector<ALL>, Matrix<ALL, ALL>) {
        let GaussianPose { mean: pose, covariance: of_pose, scale, keyframe } = self;
        let (mut mean, mut covariance) = ([0.0; ALL], [[0.0; ALL]; ALL]);
        mean[..KEYFRAME].copy_from_slice(pose);
        mean[KEYFRAME..SCALE].copy_from_slice(&keyframe.mean);
        (mean[SCALE], covariance[SCALE][SCALE]) = (scale.mean, scale.variance);
        for r in 0..KEYFRAME {
            covariance[r][..KEYFRAME].copy_from_slice(&of_pose[r]);
            (covariance[r][SCALE], covariance[SCALE][r]) = (scale.with_pose[r], scale.with_pose[r]);
        }
        if let Some(unsure) = &keyframe.covariances {
            for k in 0..4 {
                let row = KEYFRAME + k;
                covariance[row][..KEYFRAME].copy_from_slice(&unsure.with_pose[k]);
                covariance[row][KEYFRAME..SCALE].copy_from_slice(&unsure.own[k]);
                let with_scale = if scale.is_known() { 0.0 } else { unsure.with_scale[k] };
                (covariance[row][SCALE], covariance[SCALE][row]) = (with_scale, with_scale);
                for r in 0..KEYFRAME {
                    covariance[r][row] = unsure.with_pose[k][r];
                }
            }
        }
        (mean, covariance)
    }

    /// Takes back what [`GaussianPose::stacked`] gave.
    fn unstack(&mut self, mean: &Vector<ALL>, covariance: &Matrix<ALL, ALL>) {
        self.mean.copy_from_slice(&mean[..KEYFRAME]);
        self.keyframe.mean.copy_from_slice(&mean[KEYFRAME..SCALE]);
        for r in 0..KEYFRAME {
            self.covariance[r].copy_from_slice(&covariance[r][..KEYFRAME]);
        }
        if let Some(unsure) = &mut self.keyframe.covariances {
            for k in 0..4 {
                let row = &covariance[KEYFRAME + k];
                unsure.with_pose[k].copy_from_slice(&row[..KEYFRAME]);
                unsure.own[k].copy_from_slice(&row[KEYFRAME..SCALE]);
                unsure.with_scale[k] = row[SCALE];
            }
        }
        if !self.scale.is_known() {
            self.scale.take(mean[SCALE], covariance[SCALE][SCALE], std::array::from_fn(|r| covariance[SCALE][r]));
        }
    }
}

#[cfg(test)]
mod tests;
