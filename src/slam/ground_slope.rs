//! Roll and pitch from step to step -> how rough the ground is: what a step adds to the variance of slope and height.
//!
//! In: [`Control`]s and the angles read after them, radians, both or nothing is learnt. Out: the ground's part of a [`MotionNoise`]. To the filter
//! the slope is a random walk over the way that the wheels roll. Its variance is a mean over the way so far; where one step changes the angles by
//! far more, that step is as rough as it reads: else the reading would be gated, and the way after it be predicted with an
//! outdated slope. A change that the roughest ground does not explain (by some 20 degrees in 5 cm) is a broken reading, of which nothing is kept. Own
//! construction. Not modelled: ground that is rough in one direction alone.

use super::motion::{Control, DEGREE, MotionNoise, READING_GATE, turned_tilt};
use crate::math;

/// Where a wheel rolls over a stone, the body is lifted by more than its pitch tells, for the other wheels stand as they stood: by so much, metres, for
/// each radian of slope. Elsewhere the height follows the pitch: on the drives of quickstart, paper, mixed and mars.yaml what else it does is not told
/// apart from nothing (NEES of z in scripts/poses.py). What rolls into a trench and tilts by less falls by more than is told (holes.yaml).
const STONE_CLIMB_M_PER_RAD: f64 = 0.3;
/// Random walk of the ground's slope until readings tell of it, radians per square root of a metre, and the way of readings that it counts for.
pub(super) const USUAL_SLOPE_RAD_PER_SQRT_M: f64 = 3.0 * DEGREE;
const USUAL_SLOPE_WAY_M: f64 = 0.2;
/// A step whose slope changes by so many times the walk's variance is taken for as steep as it reads.
const STEEP: f64 = 4.0;
/// Where a step changes by so many times what walk and instrument explain together, a wheel rolls over a stone: by 3.5 standard deviations, which on
/// smooth ground the instrument's noise alone exceeds in one step of a thousand, in roll or in pitch.
const STONE: f64 = 12.0;
/// Smoothest and roughest ground that is believed, radians per square root of a metre.
const SLOPE_BOUNDS_RAD_PER_SQRT_M: [f64; 2] = [0.5 * DEGREE, 30.0 * DEGREE];

/// What roll and pitch have told of the ground so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GroundSlope {
    /// Roll and pitch as last read.
    last_rad: Option<[f64; 2]>,
    /// Way since, of the wheels.
    rolled_m: f64,
    /// Squared differences of readings, without what the instrument's noise adds, and the way that they lie apart, both axes together.
    sum_rad2: f64,
    sum_m: f64,
}

impl GroundSlope {
    /// Takes in a step, its way, and the angles read after it, of that variance; sets what the step adds to slope and height.
    pub(super) fn take(
        &mut self,
        control: Control,
        angles_rad: [Option<f64>; 2],
        variance_rad2: f64,
        noise: &mut MotionNoise,
    ) {
        let (mut steepest, mut is_stone) = (0.0, false);
        self.rolled_m += control.rolled_m();
        self.last_rad = self.last_rad.map(|tilt| turned_tilt(tilt, math::sin_cos(control.turn_rad)));
        if let [Some(roll_rad), Some(pitch_rad)] = angles_rad
            && roll_rad.is_finite()
            && pitch_rad.is_finite()
        {
            let now_rad = [roll_rad, pitch_rad];
            let mut is_broken = false;
            if let Some(last_rad) = self.last_rad.filter(|_| self.rolled_m > 0.0) {
                let apart = std::array::from_fn::<f64, 2, _>(|k| {
                    let apart = math::wrap_angle(now_rad[k] - last_rad[k]);
                    apart * apart
                });
                let most = apart[0].max(apart[1]);
                is_broken = most > READING_GATE * (bounded(f64::INFINITY) * self.rolled_m + 2.0 * variance_rad2);
                if !is_broken {
                    steepest = (most - 2.0 * variance_rad2) / self.rolled_m;
                    is_stone = most > STONE * (self.mean() * self.rolled_m + 2.0 * variance_rad2);
                    self.sum_rad2 += apart[0] + apart[1] - 4.0 * variance_rad2;
                    self.sum_m += 2.0 * self.rolled_m;
                }
            }
            if !is_broken {
                (self.last_rad, self.rolled_m) = (Some(now_rad), 0.0);
            }
        }
        let mean = self.mean();
        let slope_rad2_per_m = if steepest > STEEP * mean { bounded(steepest) } else { mean };
        noise.slope_rad_per_sqrt_m = slope_rad2_per_m.sqrt();
        noise.climb_m_per_sqrt_m = if is_stone { STONE_CLIMB_M_PER_RAD * noise.slope_rad_per_sqrt_m } else { 0.0 };
    }

    /// Variance of the slope's walk, squared radians a metre, over the way so far.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::InstrumentNoise;
    use crate::random::{Purpose, Stage, Streams};

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
        assert!((steep.climb_m_per_sqrt_m - STONE_CLIMB_M_PER_RAD * read).abs() < 1e-12, "{steep:?}");
        // What else lies under the wheels lifts the body along its pitch alone.
        assert_eq!(level.climb_m_per_sqrt_m, 0.0);
    }

    #[test]
    fn law_a_step_that_the_instruments_noise_explains_lifts_nothing() {
        // 2.3 degrees, of two readings with half a degree of noise each, are beyond the walk of smooth ground over 5 cm, but not beyond 3.5
        // standard deviations of both together.
        let smooth = vec![(AHEAD, 0.0, 0.0); 40];
        let [within, beyond] =
            [2.3, 3.0].map(|pitch_deg| after(&[smooth.clone(), vec![(AHEAD, 0.0, pitch_deg)]].concat()).1);
        assert!(within.slope_rad_per_sqrt_m > 9.0 * DEGREE && within.climb_m_per_sqrt_m == 0.0, "{within:?}");
        assert!(beyond.climb_m_per_sqrt_m > 0.0, "{beyond:?}");
    }

    #[test]
    fn dist_of_a_plane_that_a_noisy_instrument_reads_one_reading_in_a_thousand_is_a_stone() {
        let normals =
            Streams { seed: 7, scene: 0, attempt: 0, stage: Stage::Slam, step: 0 }.open(Purpose::SlamSurrogate);
        let (mut ground, mut noise) = (GroundSlope::default(), MotionNoise::new(&NOISE, 1.0));
        let stones = (0..100_000)
            .filter(|k| {
                let read = [2 * k, 2 * k + 1].map(|at| Some(NOISE.imu_rad * normals.normal(at)));
                ground.take(AHEAD, read, VARIANCE_RAD2, &mut noise);
                noise.climb_m_per_sqrt_m > 0.0
            })
            .count();
        // Twice what a normal number lies beyond 3.5 standard deviations, with five of its own.
        assert!((45..140).contains(&stones), "{stones}");
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
        assert!((broken.0.sum_m - steps.sum_m).abs() < 1e-12 && broken.0.rolled_m == 0.0, "{broken:?}");
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
