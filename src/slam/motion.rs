//! Odometry, IMU and sun readings -> a pose's mean and covariance: the filter without features.
//!
//! In: [`GaussianPose`] and readings. Out: the same belief, later or sharper. State order x, y, z, roll, pitch, yaw; metres,
//! radians; position relative to the start. Source: Thrun et al. 2005, chapter 5 (velocity motion), on a slope; scalar
//! Kalman updates. Deviation: the yaw of the middle of the step, so that a circle closes; noise grows with the root of the
//! distance, not with time. Not modelled: wheel contact; the filter does not know the ground, so to it the slope is a
//! random walk.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::matrix::{Matrix, Vector, symmetrise};
use crate::drive::{InstrumentNoise, Reading};
use crate::math;

/// Indices of the state.
pub(crate) const ROLL: usize = 3;
pub(crate) const PITCH: usize = 4;
pub(crate) const YAW: usize = 5;

/// Sideways and vertical slip, metres per square root of a metre.
const LATERAL_M_PER_SQRT_M: f64 = 0.02;
const VERTICAL_M_PER_SQRT_M: f64 = 0.02;
/// Random walk of the ground's slope, radians per square root of a metre: 6 degrees.
const SLOPE_RAD_PER_SQRT_M: f64 = 6.0 * DEGREE;
/// Noise of a turn as a share of it.
const YAW_SHARE: f64 = 0.05;
/// Least noise of a step: covers the error of the integration itself, without which exact instruments would leave a
/// covariance of zero and an error that is not.
const LEAST_STEP_M: f64 = 1e-3;
const LEAST_ANGLE_RAD: f64 = 0.01 * DEGREE;
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// A step longer or a turn wider than this is a broken reading.
const MOST_STEP: f64 = 100.0;

/// Mean and covariance of a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct GaussianPose {
    pub mean: Vector<6>,
    pub covariance: Matrix<6, 6>,
}

/// Distance driven and yaw turned in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    pub distance_m: f64,
    pub turn_rad: f64,
}

impl Control {
    /// What the odometry says; `None` where it makes no sense (not finite, or too much for one step).
    pub fn of(reading: &Reading) -> Option<Control> {
        let distance_m = reading.speed_mps * reading.dt_s;
        let turn_rad = reading.yaw_rate_radps * reading.dt_s;
        let sane = distance_m.abs() <= MOST_STEP && turn_rad.abs() <= MOST_STEP && reading.dt_s >= 0.0;
        sane.then_some(Control { distance_m, turn_rad })
    }
}

/// How far the motion is trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionNoise {
    /// Of driven distance, metres per square root of a metre.
    pub distance_m_per_sqrt_m: f64,
    /// Of heading, radians per square root of a metre.
    pub heading_rad_per_sqrt_m: f64,
    /// Factor on the covariance that a step adds.
    pub inflation: f64,
}

impl MotionNoise {
    pub fn new(noise: &InstrumentNoise, inflation: f64) -> MotionNoise {
        MotionNoise {
            distance_m_per_sqrt_m: noise.odometry_m_per_sqrt_m,
            heading_rad_per_sqrt_m: noise.heading_rad_per_sqrt_m,
            inflation,
        }
    }
}

/// The standard deviation that slam works with for an angle that an instrument states as `sigma_rad`.
pub(crate) fn angle_sigma_rad(sigma_rad: f64) -> f64 {
    sigma_rad.max(LEAST_ANGLE_RAD)
}

impl GaussianPose {
    /// One step of driving. At rest nothing is added.
    #[inline(always)]
    pub fn drive(&mut self, control: Control, noise: &MotionNoise) {
        let Control { distance_m: d, turn_rad } = control;
        if d == 0.0 && turn_rad == 0.0 {
            return;
        }
        let (sp, cp) = math::sin_cos(self.mean[PITCH]);
        let (sy, cy) = math::sin_cos(self.mean[YAW] + 0.5 * turn_rad);
        self.mean[0] += d * cp * cy;
        self.mean[1] += d * cp * sy;
        self.mean[2] -= d * sp;
        self.mean[YAW] = math::wrap_angle(self.mean[YAW] + turn_rad);

        // F = I + (these two columns in the position rows).
        let by_pitch = [-d * sp * cy, -d * sp * sy, -d * cp];
        let by_yaw = [-d * cp * sy, d * cp * cy, 0.0];
        let p = &mut self.covariance;
        for c in 0..6 {
            let (pitch, yaw) = (p[PITCH][c], p[YAW][c]);
            for r in 0..3 {
                p[r][c] += by_pitch[r] * pitch + by_yaw[r] * yaw;
            }
        }
        for row in p.iter_mut() {
            let (pitch, yaw) = (row[PITCH], row[YAW]);
            for c in 0..3 {
                row[c] += by_pitch[c] * pitch + by_yaw[c] * yaw;
            }
        }
        let root = d.abs().sqrt();
        let variance = |sigma: f64| noise.inflation * sigma * sigma;
        let along = variance((noise.distance_m_per_sqrt_m * root).max(LEAST_STEP_M));
        let across = variance(LATERAL_M_PER_SQRT_M * root);
        let slope = variance((SLOPE_RAD_PER_SQRT_M * root).max(LEAST_ANGLE_RAD));
        let yaw_sigma_rad = noise.heading_rad_per_sqrt_m * root + YAW_SHARE * turn_rad.abs();
        let (ahead, aside) = ([cp * cy, cp * sy, -sp], [-sy, cy, 0.0]);
        for r in 0..3 {
            for c in 0..3 {
                p[r][c] += ahead[r] * ahead[c] * along + aside[r] * aside[c] * across;
            }
        }
        p[2][2] += variance(VERTICAL_M_PER_SQRT_M * root);
        p[ROLL][ROLL] += slope;
        p[PITCH][PITCH] += slope;
        p[YAW][YAW] += variance(yaw_sigma_rad.max(LEAST_ANGLE_RAD));
        symmetrise(p);
    }

    /// Kalman update by a direct reading of one angle; returns the logarithm of the reading's likelihood.
    #[inline(always)]
    pub(crate) fn read_angle(&mut self, component: usize, reading_rad: f64, variance_rad2: f64) -> f64 {
        let p = &mut self.covariance;
        let spread = p[component][component] + variance_rad2;
        let innovation = math::wrap_angle(reading_rad - self.mean[component]);
        let row = p[component];
        for r in 0..6 {
            let gain = row[r] / spread;
            self.mean[r] += gain * innovation;
            for c in 0..6 {
                p[r][c] -= gain * row[c];
            }
        }
        symmetrise(p);
        self.wrap();
        -0.5 * (innovation * innovation / spread + math::ln(std::f64::consts::TAU * spread))
    }

    /// Brings roll and yaw back to (-pi, pi].
    #[inline(always)]
    pub(crate) fn wrap(&mut self) {
        self.mean[ROLL] = math::wrap_angle(self.mean[ROLL]);
        self.mean[YAW] = math::wrap_angle(self.mean[YAW]);
    }
}
