//! Odometry, IMU and sun readings -> a pose's mean and covariance: the filter without features.
//!
//! In: [`GaussianPose`] and readings. Out: the same belief, later or sharper. State order x, y, z, roll, pitch, yaw; metres,
//! radians; position relative to the start; the odometry's scale is a seventh number ([`ScaleFactor`]), and the pose at a keyframe stands beside
//! them ([`ClonedPose`]). Source: Thrun et al. 2005, chapter 5
//! (velocity motion), on a slope; scalar Kalman updates. Deviation: the yaw of the middle of the step, so that a circle closes; noise grows with
//! the root of the distance, not with time. Not modelled: wheel contact; the filter does not know the ground, so to it the slope is a random
//! walk, as rough as roll and pitch read (`ground_slope`).

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::cloned::ClonedPose;
use super::ground_slope::USUAL_SLOPE_RAD_PER_SQRT_M;
use super::kalman;
use super::matrix::{Matrix, Vector, apply, cholesky_clamped, symmetrise};
use super::scale::ScaleFactor;
use crate::drive::{InstrumentNoise, Reading};
use crate::math;

/// Indices of the state.
pub(crate) const ROLL: usize = 3;
pub(crate) const PITCH: usize = 4;
pub(crate) const YAW: usize = 5;

/// Chi-square of one degree of freedom at 99.9 %: a reading farther off what is believed is left out.
pub(super) const READING_GATE: f64 = 10.8;
/// Wheels stand some so far from the middle: on so much ground a turn of one radian takes them.
const TURNING_RADIUS_M: f64 = 0.25;
/// Noise of a turn as a share of it.
const YAW_SHARE: f64 = 0.05;
/// Least noise of a step: covers the error of the integration itself, without which exact instruments would leave a
/// covariance of zero and an error that is not.
const LEAST_STEP_M: f64 = 1e-3;
const LEAST_ANGLE_RAD: f64 = 0.01 * DEGREE;
/// One degree, radians.
pub(super) const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// A step longer or a turn wider than this is a broken reading.
const MOST_STEP: f64 = 100.0;

/// Mean and covariance of a pose, and of the odometry's scale and a former pose beside it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GaussianPose {
    pub mean: Vector<6>,
    pub covariance: Matrix<6, 6>,
    pub scale: ScaleFactor,
    pub keyframe: ClonedPose,
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

    /// The way that the wheels roll: a turn takes them along as well.
    pub(crate) fn rolled_m(&self) -> f64 {
        self.distance_m.abs() + TURNING_RADIUS_M * self.turn_rad.abs()
    }
}

/// How far the motion is trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionNoise {
    /// Of driven distance, metres per square root of a metre.
    pub distance_m_per_sqrt_m: f64,
    /// Of the way aside, metres per square root of a metre.
    pub sideways_m_per_sqrt_m: f64,
    /// Of heading, radians per square root of a metre.
    pub heading_rad_per_sqrt_m: f64,
    /// Random walk of the ground's slope, radians per square root of a metre.
    pub slope_rad_per_sqrt_m: f64,
    /// Of the height otherwise than along the pitch, metres per square root of a metre.
    pub climb_m_per_sqrt_m: f64,
    /// Factor on what the wheels' part of a step adds to the covariance: way and heading, not slope and climb.
    pub inflation: f64,
}

impl MotionNoise {
    pub fn new(noise: &InstrumentNoise, inflation: f64) -> MotionNoise {
        MotionNoise {
            distance_m_per_sqrt_m: noise.odometry_m_per_sqrt_m,
            sideways_m_per_sqrt_m: noise.sideways_m_per_sqrt_m,
            heading_rad_per_sqrt_m: noise.heading_rad_per_sqrt_m,
            slope_rad_per_sqrt_m: USUAL_SLOPE_RAD_PER_SQRT_M,
            climb_m_per_sqrt_m: 0.0,
            inflation,
        }
    }
}

/// Roll and pitch after a turn, of which sine and cosine are given, on a plane that stays. Exact to the square of the angles.
#[inline(always)]
pub(super) fn turned_tilt([roll, pitch]: [f64; 2], (sin, cos): (f64, f64)) -> [f64; 2] {
    [cos * roll + sin * pitch, cos * pitch - sin * roll]
}

/// The standard deviation that slam works with for an angle that an instrument states as `sigma_rad`.
pub(crate) fn angle_sigma_rad(sigma_rad: f64) -> f64 {
    sigma_rad.max(LEAST_ANGLE_RAD)
}

impl GaussianPose {
    /// One step of driving. At rest nothing is added.
    #[inline(always)]
    pub fn drive(&mut self, control: Control, noise: &MotionNoise) {
        let Control { distance_m: counted_m, turn_rad } = control;
        if counted_m == 0.0 && turn_rad == 0.0 {
            return;
        }
        let d = self.scale.mean * counted_m;
        // A turn leaves the ground's slope where it is, so that what was roll becomes pitch.
        let (half, whole) = (math::sin_cos(0.5 * turn_rad), math::sin_cos(turn_rad));
        let tilt = [self.mean[ROLL], self.mean[PITCH]];
        let (sp, cp) = math::sin_cos(turned_tilt(tilt, half)[1]);
        let (sy, cy) = math::sin_cos(self.mean[YAW] + 0.5 * turn_rad);
        [self.mean[ROLL], self.mean[PITCH]] = turned_tilt(tilt, whole);
        self.mean[0] += d * cp * cy;
        self.mean[1] += d * cp * sy;
        self.mean[2] -= d * sp;
        self.mean[YAW] = math::wrap_angle(self.mean[YAW] + turn_rad);

        let (ahead, aside) = ([cp * cy, cp * sy, -sp], [-sy, cy, 0.0]);
        // F: position by the pitch in the middle of the turn and by the yaw, and roll and pitch by each other.
        let by_pitch = [-d * sp * cy, -d * sp * sy, -d * cp];
        let by_yaw = [-d * cp * sy, d * cp * cy, 0.0];
        let p = &mut self.covariance;
        for c in 0..6 {
            let (tilt, yaw) = ([p[ROLL][c], p[PITCH][c]], p[YAW][c]);
            let pitch = turned_tilt(tilt, half)[1];
            for r in 0..3 {
                p[r][c] += by_pitch[r] * pitch + by_yaw[r] * yaw;
            }
            [p[ROLL][c], p[PITCH][c]] = turned_tilt(tilt, whole);
        }
        let carry = |row: &mut Vector<6>| {
            let (tilt, yaw) = ([row[ROLL], row[PITCH]], row[YAW]);
            let pitch = turned_tilt(tilt, half)[1];
            for c in 0..3 {
                row[c] += by_pitch[c] * pitch + by_yaw[c] * yaw;
            }
            [row[ROLL], row[PITCH]] = turned_tilt(tilt, whole);
        };
        p.iter_mut().for_each(carry);
        let by_scale = if self.scale.is_known() { [0.0; 3] } else { ahead.map(|share| counted_m * share) };
        self.keyframe.drive(carry, &by_scale);
        if !self.scale.is_known() {
            carry(&mut self.scale.with_pose);
            self.scale.stretch(p, &by_scale);
        }
        let root = d.abs().sqrt();
        let of_wheels = |sigma: f64| noise.inflation * sigma * sigma;
        let of_ground = |sigma: f64| sigma * sigma;
        // The noise is of the counted way, of which a share is driven.
        let along = of_wheels((self.scale.mean.abs() * noise.distance_m_per_sqrt_m * root).max(LEAST_STEP_M));
        let across = of_wheels((noise.sideways_m_per_sqrt_m * root).max(LEAST_STEP_M));
        let rolled_m = Control { distance_m: d, turn_rad }.rolled_m();
        let slope = of_ground((noise.slope_rad_per_sqrt_m * rolled_m.sqrt()).max(LEAST_ANGLE_RAD));
        let yaw_sigma_rad = noise.heading_rad_per_sqrt_m * root + YAW_SHARE * turn_rad.abs();
        for r in 0..3 {
            for c in 0..3 {
                p[r][c] += ahead[r] * ahead[c] * along + aside[r] * aside[c] * across;
            }
        }
        p[2][2] += of_ground(noise.climb_m_per_sqrt_m * root);
        // The slope changes on the way, not at its end: half of what is read after it is in the height already.
        for r in 0..3 {
            p[r][PITCH] += 0.5 * by_pitch[r] * slope;
            p[PITCH][r] += 0.5 * by_pitch[r] * slope;
            for c in 0..3 {
                p[r][c] += by_pitch[r] * by_pitch[c] * slope / 3.0;
            }
        }
        p[ROLL][ROLL] += slope;
        p[PITCH][PITCH] += slope;
        p[YAW][YAW] += of_wheels(yaw_sigma_rad.max(LEAST_ANGLE_RAD));
        symmetrise(p);
    }

    /// Kalman update by three numbers of slopes `by_pose`; `pull` is H P, and `factor` that of H P H' + the noise.
    #[inline(always)]
    pub(super) fn measure(
        &mut self,
        by_pose: &Matrix<3, 6>,
        pull: &Matrix<3, 6>,
        factor: &Matrix<3, 3>,
        innovation: &Vector<3>,
        noise: &Matrix<3, 3>,
    ) {
        if !self.keyframe.is_known() {
            // Nothing that hangs on the keyframe, but what is in common with it.
            self.measure_way(by_pose, &[[0.0; 4]; 3], innovation, noise);
            return;
        }
        self.scale.measure(by_pose, pull, factor, innovation);
        kalman::update((&mut self.mean, &mut self.covariance), by_pose, pull, factor, innovation, noise);
        self.wrap();
    }

    /// Moves the pose to a draw from its belief (`normals`: six standard normals), after which it is known exactly, and the scale as well as
    /// the way to there tells it.
    pub(super) fn draw(&mut self, normals: &Vector<6>) {
        let factor = cholesky_clamped(&self.covariance);
        let step = apply(&factor, normals);
        for (mean, by) in self.mean.iter_mut().zip(step) {
            *mean += by;
        }
        self.wrap();
        self.covariance = [[0.0; 6]; 6];
        self.keyframe.draw(&factor, normals, &self.scale);
        self.scale.draw(&factor, normals);
    }

    /// Kalman update by a direct reading of one angle; returns the logarithm of the reading's likelihood.
    #[inline(always)]
    pub(crate) fn read_angle(&mut self, component: usize, reading_rad: f64, variance_rad2: f64) -> f64 {
        let p = &mut self.covariance;
        let spread = p[component][component] + variance_rad2;
        let innovation = math::wrap_angle(reading_rad - self.mean[component]);
        let row = p[component];
        self.keyframe.read(component, &row, &self.scale, spread, innovation);
        self.scale.read(component, &row, spread, innovation);
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
