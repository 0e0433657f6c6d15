//! Odometry, IMU and sun readings -> a pose's mean and covariance: the filter without features.
//!
//! In: [`GaussianPose`] and readings. Out: the same belief, later or sharper. State order x, y, z, roll, pitch, yaw; metres,
//! radians; position relative to the start; the odometry's scale is a seventh number ([`ScaleFactor`]). Source: Thrun et al. 2005, chapter 5
//! (velocity motion), on a slope; scalar Kalman updates. Deviation: the yaw of the middle of the step, so that a circle closes; noise grows with
//! the root of the distance, not with time. Not modelled: wheel contact; the filter does not know the ground, so to it the slope is a random
//! walk, as rough as roll and pitch read (`GroundSlope`, which needs both).

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::kalman;
use super::matrix::{Matrix, Vector, apply, cholesky_clamped, symmetrise};
use super::scale::ScaleFactor;
use crate::drive::{InstrumentNoise, Reading};
use crate::math;

/// Indices of the state.
pub(crate) const ROLL: usize = 3;
pub(crate) const PITCH: usize = 4;
pub(crate) const YAW: usize = 5;

/// How far the body climbs otherwise than along its pitch, over what its slope changes beyond [`SMOOTH_RAD_PER_SQRT_M`], metres per radian: on
/// rough ground, for its wheels stand on other ground than its middle, and where a wheel rolls over a stone, which lifts the body as it tilts it.
/// Chosen so that the standard deviation of z is near its error on the drives of the shipped configs (NEES of z in scripts/poses.py).
const CLIMB_M_PER_RAD: f64 = 0.04;
const STONE_CLIMB_M_PER_RAD: f64 = 0.15;
/// Ground whose slope walks no farther is bent, not rough: wheels and middle climb alike.
const SMOOTH_RAD_PER_SQRT_M: f64 = 4.0 * DEGREE;
/// Random walk of the ground's slope until readings tell of it, radians per square root of a metre, and the way of readings that it counts for.
const USUAL_SLOPE_RAD_PER_SQRT_M: f64 = 3.0 * DEGREE;
const USUAL_SLOPE_WAY_M: f64 = 0.2;
/// A step whose slope changes by so many times the walk's variance is taken for as steep as it reads.
const STEEP: f64 = 4.0;
/// Where a step changes by so many times what walk and instrument explain together, the ground is as rough as it reads (two standard deviations).
const ROUGH: f64 = 4.0;
/// Where it changes by so many times that, a wheel rolls over a stone.
const STONE: f64 = 9.0;
/// Chi-square of one degree of freedom at 99.9 %: a reading farther off what is believed is left out.
pub(super) const READING_GATE: f64 = 10.8;
/// Smoothest and roughest ground that is believed, radians per square root of a metre.
const SLOPE_BOUNDS_RAD_PER_SQRT_M: [f64; 2] = [0.5 * DEGREE, 30.0 * DEGREE];
/// Wheels stand some so far from the middle: on so much ground a turn of one radian takes them.
const TURNING_RADIUS_M: f64 = 0.25;
/// Noise of a turn as a share of it.
const YAW_SHARE: f64 = 0.05;
/// Least noise of a step: covers the error of the integration itself, without which exact instruments would leave a
/// covariance of zero and an error that is not.
const LEAST_STEP_M: f64 = 1e-3;
const LEAST_ANGLE_RAD: f64 = 0.01 * DEGREE;
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// A step longer or a turn wider than this is a broken reading.
const MOST_STEP: f64 = 100.0;

/// Mean and covariance of a pose, and of the odometry's scale beside it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GaussianPose {
    pub mean: Vector<6>,
    pub covariance: Matrix<6, 6>,
    pub scale: ScaleFactor,
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

    /// Takes the ground's slope to walk by that variance, squared radians a metre, and the body to climb by what makes it rough.
    fn set_ground(&mut self, slope_rad2_per_m: f64, rough_rad2_per_m: f64, climb_m_per_rad: f64) {
        let smooth_rad2_per_m = SMOOTH_RAD_PER_SQRT_M * SMOOTH_RAD_PER_SQRT_M;
        self.slope_rad_per_sqrt_m = slope_rad2_per_m.sqrt();
        self.climb_m_per_sqrt_m = climb_m_per_rad * (rough_rad2_per_m - smooth_rad2_per_m).max(0.0).sqrt();
    }
}

/// How rough the ground is, told by what roll and pitch read from step to step: a mean over the way so far, and where a step changes them by
/// far more, as rough as that: else the reading would be gated, and the way after it be reckoned with a slope that is none any more. A change
/// that the roughest ground does not explain (by some 20 degrees in 5 cm) is a broken reading, of which nothing is kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GroundSlope {
    /// Roll and pitch as last read.
    last_rad: Option<[f64; 2]>,
    /// Way since.
    way_m: f64,
    /// Squared differences of readings, without what the instrument's noise adds, and the way that they lie apart, both axes together.
    sum_rad2: f64,
    sum_m: f64,
}

impl GroundSlope {
    /// Takes in a step, its way, and the angles read after it, of that variance; sets what the step adds to slope and height.
    pub(super) fn take(
        &mut self,
        Control { distance_m, turn_rad }: Control,
        angles_rad: [Option<f64>; 2],
        variance_rad2: f64,
        noise: &mut MotionNoise,
    ) {
        let (mut steepest, mut is_rough, mut is_stone) = (0.0, false, false);
        self.way_m += distance_m.abs() + TURNING_RADIUS_M * turn_rad.abs();
        self.last_rad = self.last_rad.map(|tilt| turned(tilt, math::sin_cos(turn_rad)));
        if let [Some(roll_rad), Some(pitch_rad)] = angles_rad
            && roll_rad.is_finite()
            && pitch_rad.is_finite()
        {
            let now_rad = [roll_rad, pitch_rad];
            if let Some(last_rad) = self.last_rad.filter(|_| self.way_m > 0.0) {
                let apart = std::array::from_fn::<f64, 2, _>(|k| {
                    let apart = math::wrap_angle(now_rad[k] - last_rad[k]);
                    apart * apart
                });
                let most = apart[0].max(apart[1]);
                if most > READING_GATE * (bounded(f64::INFINITY) * self.way_m + 2.0 * variance_rad2) {
                    noise.set_ground(self.mean(), self.mean(), CLIMB_M_PER_RAD);
                    return;
                }
                steepest = (most - 2.0 * variance_rad2) / self.way_m;
                let explained_rad2 = self.mean() * self.way_m + 2.0 * variance_rad2;
                is_rough = most > ROUGH * explained_rad2;
                is_stone = most > STONE * explained_rad2;
                self.sum_rad2 += apart[0] + apart[1] - 4.0 * variance_rad2;
                self.sum_m += 2.0 * self.way_m;
            }
            (self.last_rad, self.way_m) = (Some(now_rad), 0.0);
        }
        let mean = self.mean();
        let slope = if steepest > STEEP * mean { bounded(steepest) } else { mean };
        let climb_m_per_rad = if is_stone { STONE_CLIMB_M_PER_RAD } else { CLIMB_M_PER_RAD };
        // Most of what the instrument's noise makes of a step is no roughness that would lift the body.
        noise.set_ground(slope, if is_rough { slope } else { mean }, climb_m_per_rad);
    }

    /// Of the squared changes a metre.
    fn mean(&self) -> f64 {
        let usual = USUAL_SLOPE_RAD_PER_SQRT_M * USUAL_SLOPE_RAD_PER_SQRT_M;
        bounded((usual * USUAL_SLOPE_WAY_M + self.sum_rad2) / (USUAL_SLOPE_WAY_M + self.sum_m))
    }
}

/// As a variance a metre that is believed.
fn bounded(slope: f64) -> f64 {
    let [least, most] = SLOPE_BOUNDS_RAD_PER_SQRT_M;
    slope.clamp(least * least, most * most)
}

/// Roll and pitch after a turn, of which sine and cosine are given, on a plane. Exact to the square of the angles.
#[inline(always)]
fn turned([roll, pitch]: [f64; 2], (sin, cos): (f64, f64)) -> [f64; 2] {
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
        let (sp, cp) = math::sin_cos(turned(tilt, half)[1]);
        let (sy, cy) = math::sin_cos(self.mean[YAW] + 0.5 * turn_rad);
        [self.mean[ROLL], self.mean[PITCH]] = turned(tilt, whole);
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
            let pitch = turned(tilt, half)[1];
            for r in 0..3 {
                p[r][c] += by_pitch[r] * pitch + by_yaw[r] * yaw;
            }
            [p[ROLL][c], p[PITCH][c]] = turned(tilt, whole);
        }
        let carry = |row: &mut Vector<6>| {
            let (tilt, yaw) = ([row[ROLL], row[PITCH]], row[YAW]);
            let pitch = turned(tilt, half)[1];
            for c in 0..3 {
                row[c] += by_pitch[c] * pitch + by_yaw[c] * yaw;
            }
            [row[ROLL], row[PITCH]] = turned(tilt, whole);
        };
        p.iter_mut().for_each(carry);
        if !self.scale.is_known() {
            carry(&mut self.scale.with_pose);
            self.scale.stretch(p, &ahead.map(|share| counted_m * share));
        }
        let root = d.abs().sqrt();
        let of_wheels = |sigma: f64| noise.inflation * sigma * sigma;
        let of_ground = |sigma: f64| sigma * sigma;
        // The noise is of the counted way, of which a share is driven.
        let along = of_wheels((self.scale.mean.abs() * noise.distance_m_per_sqrt_m * root).max(LEAST_STEP_M));
        let across = of_wheels((noise.sideways_m_per_sqrt_m * root).max(LEAST_STEP_M));
        let way_m = d.abs() + TURNING_RADIUS_M * turn_rad.abs();
        let slope = of_ground((noise.slope_rad_per_sqrt_m * way_m.sqrt()).max(LEAST_ANGLE_RAD));
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
        self.scale.draw(&factor, normals);
    }

    /// Kalman update by a direct reading of one angle; returns the logarithm of the reading's likelihood.
    #[inline(always)]
    pub(crate) fn read_angle(&mut self, component: usize, reading_rad: f64, variance_rad2: f64) -> f64 {
        let p = &mut self.covariance;
        let spread = p[component][component] + variance_rad2;
        let innovation = math::wrap_angle(reading_rad - self.mean[component]);
        let row = p[component];
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

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: InstrumentNoise = InstrumentNoise {
        imu_rad: 0.5 * DEGREE,
        imu_bias_rad: 0.0,
        sun_rad: 0.0,
        odometry_m_per_sqrt_m: 0.05,
        sideways_m_per_sqrt_m: 0.0,
        slip: 0.0,
        heading_rad_per_sqrt_m: 0.03,
    };
    const VARIANCE_RAD2: f64 = NOISE.imu_rad * NOISE.imu_rad;
    const AHEAD: Control = Control { distance_m: 0.05, turn_rad: 0.0 };

    /// What the last of these steps adds; each has its control, and roll and pitch read after it, degrees.
    fn after(steps: &[(Control, f64, f64)]) -> (GroundSlope, MotionNoise) {
        let (mut ground, mut noise) = (GroundSlope::default(), MotionNoise::new(&NOISE, 1.0));
        for &(control, roll_deg, pitch_deg) in steps {
            let angles_rad = [roll_deg, pitch_deg].map(|deg| Some(deg * DEGREE));
            ground.take(control, angles_rad, VARIANCE_RAD2, &mut noise);
        }
        (ground, noise)
    }

    #[test]
    fn exact_a_plane_is_smooth_however_the_rover_turns_on_it() {
        // What leans by 10 degrees to the side leans ahead after a quarter turn.
        let quarter = Control { distance_m: 0.0, turn_rad: std::f64::consts::FRAC_PI_2 };
        let steps = [(AHEAD, 10.0, 0.0), (quarter, 0.0, -10.0), (quarter, -10.0, 0.0), (quarter, 0.0, 10.0)];
        let (ground, noise) = after(&steps);
        // Nothing is left of the differences but the instrument's share, which is taken off.
        assert!((ground.sum_rad2 + 3.0 * 4.0 * VARIANCE_RAD2).abs() < 1e-12, "{ground:?}");
        assert!(noise.slope_rad_per_sqrt_m < USUAL_SLOPE_RAD_PER_SQRT_M);
    }

    #[test]
    fn exact_a_step_that_is_far_steeper_than_the_ground_so_far_counts_as_rough_as_it_reads() {
        let smooth = vec![(AHEAD, 0.0, 0.0); 40];
        let (before, level) = after(&smooth);
        assert!((level.slope_rad_per_sqrt_m - bounded(before.mean()).sqrt()).abs() < 1e-15);
        let (_, steep) = after(&[smooth, vec![(AHEAD, 0.0, 5.0)]].concat());
        let read = ((25.0 * DEGREE * DEGREE - 2.0 * VARIANCE_RAD2) / AHEAD.distance_m).sqrt();
        assert!((steep.slope_rad_per_sqrt_m - read).abs() < 1e-12, "{steep:?}");
        // It tilts by more than ground and instrument explain: a stone, which lifts the body too.
        let rough = (read * read - SMOOTH_RAD_PER_SQRT_M * SMOOTH_RAD_PER_SQRT_M).sqrt();
        assert!((steep.climb_m_per_sqrt_m - STONE_CLIMB_M_PER_RAD * rough).abs() < 1e-12, "{steep:?}");
        // What is smooth lifts nothing otherwise than along the pitch.
        assert_eq!(level.climb_m_per_sqrt_m, 0.0);
    }

    #[test]
    fn law_a_step_that_the_instruments_noise_explains_does_not_make_the_ground_rough() {
        // 1.3 degrees, of two readings with half a degree of noise each, are beyond the walk of smooth ground over 5 cm, not beyond both together.
        let smooth = vec![(AHEAD, 0.0, 0.0); 40];
        let [within, beyond] =
            [1.3, 2.5].map(|pitch_deg| after(&[smooth.clone(), vec![(AHEAD, 0.0, pitch_deg)]].concat()).1);
        assert!(within.slope_rad_per_sqrt_m > SMOOTH_RAD_PER_SQRT_M && within.climb_m_per_sqrt_m == 0.0, "{within:?}");
        assert!(beyond.climb_m_per_sqrt_m > 0.0, "{beyond:?}");
    }

    #[test]
    fn extreme_of_a_broken_reading_nothing_is_kept() {
        let smooth = vec![(AHEAD, 0.5, -0.5); 40];
        let (mut usual, mut broken) = (after(&smooth), after(&smooth));
        for (pitch_deg, (ground, noise)) in [(-0.5, &mut usual), (60.0, &mut broken)] {
            ground.take(AHEAD, [Some(0.5 * DEGREE), Some(pitch_deg * DEGREE)], VARIANCE_RAD2, noise);
        }
        assert!((broken.1.slope_rad_per_sqrt_m / usual.1.slope_rad_per_sqrt_m - 1.0).abs() < 0.05, "{broken:?}");
        assert_eq!(broken.0.last_rad, after(&smooth).0.last_rad);
        // The next good one is as far from the last good one as the rover came since.
        broken.0.take(AHEAD, [Some(0.5 * DEGREE), Some(-0.5 * DEGREE)], VARIANCE_RAD2, &mut broken.1);
        let steps = after(&vec![(AHEAD, 0.5, -0.5); 42]).0;
        assert!((broken.0.sum_m - steps.sum_m).abs() < 1e-12 && broken.0.way_m == 0.0, "{broken:?}");
    }

    #[test]
    fn extreme_without_both_angles_the_ground_is_as_rough_as_usual() {
        for angles_rad in [[None, Some(0.1)], [Some(0.1), None], [None, None], [Some(f64::NAN), Some(0.1)]] {
            let (mut ground, mut noise) = (GroundSlope::default(), MotionNoise::new(&NOISE, 1.0));
            (0..9).for_each(|_| ground.take(AHEAD, angles_rad, VARIANCE_RAD2, &mut noise));
            assert!((noise.slope_rad_per_sqrt_m - USUAL_SLOPE_RAD_PER_SQRT_M).abs() < 1e-15, "{angles_rad:?}");
        }
    }
}
