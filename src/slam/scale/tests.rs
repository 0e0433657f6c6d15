use super::*;
use crate::drive::InstrumentNoise;
use crate::math;
use crate::random::{Purpose, Stage, Streams};
use crate::slam::matrix::{cholesky, diagonal, product, sum, transpose};
use crate::slam::motion::{Control, GaussianPose, MotionNoise, PITCH, YAW};

const NOISE: InstrumentNoise = InstrumentNoise {
    imu_rad: 0.01,
    imu_bias_rad: 0.0,
    sun_rad: 0.03,
    odometry_m_per_sqrt_m: 0.02,
    sideways_m_per_sqrt_m: 0.01,
    slip: 0.1,
    heading_rad_per_sqrt_m: 0.03,
};
const CONTROL: Control = Control { distance_m: 0.4, turn_rad: 0.3 };

pub(in crate::slam) fn unsure() -> GaussianPose {
    let scale = ScaleFactor { mean: 0.95, variance: 0.01, with_pose: [0.0; 6] };
    let covariance = diagonal(&[1e-3, 2e-3, 1e-3, 1e-4, 2e-4, 1e-3]);
    GaussianPose { mean: [0.3, -0.2, 0.1, 0.1, -0.05, 0.8], covariance, scale, ..Default::default() }
}

/// Mean and covariance of all seven.
fn seven(belief: &GaussianPose) -> (Vector<7>, Matrix<7, 7>) {
    let scale = &belief.scale;
    let mean = std::array::from_fn(|i| if i < 6 { belief.mean[i] } else { scale.mean });
    let covariance = std::array::from_fn(|r| {
        std::array::from_fn(|c| match (r, c) {
            (6, 6) => scale.variance,
            (6, i) | (i, 6) => scale.with_pose[i],
            _ => belief.covariance[r][c],
        })
    });
    (mean, covariance)
}

fn assert_near(got: &(Vector<7>, Matrix<7, 7>), wanted: &(Vector<7>, Matrix<7, 7>), tolerance: f64) {
    for r in 0..7 {
        assert!((got.0[r] - wanted.0[r]).abs() < tolerance, "{r}: {} {}", got.0[r], wanted.0[r]);
        for c in 0..7 {
            assert!((got.1[r][c] - wanted.1[r][c]).abs() < tolerance, "{r} {c}: {} {}", got.1[r][c], wanted.1[r][c]);
        }
    }
}

/// One step further, with what the instruments leave unsure of it.
pub(in crate::slam) fn driven(mut belief: GaussianPose) -> GaussianPose {
    belief.drive(CONTROL, &MotionNoise::new(&NOISE, 1.0));
    belief
}

const SLOPES: Matrix<3, 6> =
    [[1.0, 0.2, 0.0, 0.0, 0.1, -0.3], [0.1, -0.9, 0.1, 0.0, 0.0, 0.5], [0.0, 0.3, 1.0, 0.2, -0.4, 0.0]];
const MEASURED_M2: Vector<3> = [1e-3, 2e-3, 3e-3];
const INNOVATION: Vector<3> = [0.02, -0.03, 0.01];

/// With three numbers taken in that tell of all of the pose.
fn measured(mut belief: GaussianPose) -> GaussianPose {
    let noise = diagonal(&MEASURED_M2);
    let pull = product(&SLOPES, &belief.covariance);
    let factor = cholesky(&sum(&product(&pull, &transpose(&SLOPES)), &noise)).expect("positive definite");
    belief.measure(&SLOPES, &pull, &factor, &INNOVATION, &noise);
    belief
}

/// F P F' + Q of all seven, F by central differences of the mean and Q what a known pose and scale have after the step.
#[test]
fn equal_a_step_and_that_of_a_filter_of_seven_numbers() {
    // Two steps, so that the scale and the pose have something in common before the one that is judged.
    let before = driven(unsure());
    let (mean, covariance) = seven(&before);
    let at = |mean: Vector<7>| {
        let scale = ScaleFactor { mean: mean[6], ..ScaleFactor::default() };
        let known = GaussianPose {
            mean: std::array::from_fn(|i| mean[i]),
            covariance: [[0.0; 6]; 6],
            scale,
            ..Default::default()
        };
        seven(&driven(known))
    };
    let columns: Matrix<7, 7> = std::array::from_fn(|column| {
        let moved = |h: f64| at(std::array::from_fn(|i| mean[i] + if i == column { h } else { 0.0 })).0;
        let (above, below) = (moved(1e-5), moved(-1e-5));
        std::array::from_fn(|row| (above[row] - below[row]) / 2e-5)
    });
    let (wanted_mean, noise) = at(mean);
    let wanted = sum(&product(&product(&transpose(&columns), &covariance), &columns), &noise);
    assert_near(&seven(&driven(before)), &(wanted_mean, wanted), 1e-8);
}

#[test]
fn equal_a_measurement_and_that_of_a_filter_of_seven_numbers() {
    let mut belief = driven(driven(unsure()));
    let (mean, covariance) = seven(&belief);
    let h: Matrix<3, 6> =
        [[1.0, 0.2, 0.0, 0.0, 0.1, -0.3], [0.1, -0.9, 0.1, 0.0, 0.0, 0.5], [0.0, 0.3, 1.0, 0.2, -0.4, 0.0]];
    let (noise, innovation) = (diagonal(&[1e-3, 2e-3, 3e-3]), [0.02, -0.03, 0.01]);
    let pull = product(&h, &belief.covariance);
    let factor = cholesky(&sum(&product(&pull, &transpose(&h)), &noise)).expect("positive definite");
    belief.measure(&h, &pull, &factor, &innovation, &noise);
    // K = P H' S^-1, x + K v and P - K H P.
    let wide: Matrix<3, 7> = std::array::from_fn(|r| std::array::from_fn(|c| if c < 6 { h[r][c] } else { 0.0 }));
    let gain = transpose(&solve(&factor, &product(&wide, &covariance)));
    let moved = apply(&gain, &innovation);
    let taken = product(&gain, &product(&wide, &covariance));
    let wanted = (std::array::from_fn(|i| mean[i] + moved[i]), sum(&covariance, &taken.map(|row| row.map(|v| -v))));
    assert_near(&seven(&belief), &wanted, 1e-14);
}

#[test]
fn equal_a_read_angle_and_that_of_a_filter_of_seven_numbers() {
    for component in [PITCH, YAW] {
        // Measured first, so that the angle and the scale have something in common.
        let mut belief = measured(driven(driven(unsure())));
        assert!(belief.scale.with_pose[component].abs() > 1e-6, "{belief:?}");
        let (mean, covariance) = seven(&belief);
        let (innovation, variance) = (0.02, 4e-4);
        belief.read_angle(component, mean[component] + innovation, variance);
        let spread = covariance[component][component] + variance;
        let gain: Vector<7> = std::array::from_fn(|i| covariance[i][component] / spread);
        let wanted = (
            std::array::from_fn(|i| mean[i] + gain[i] * innovation),
            std::array::from_fn(|r| std::array::from_fn(|c| covariance[r][c] - gain[r] * covariance[component][c])),
        );
        assert_near(&seven(&belief), &wanted, 1e-14);
    }
}

/// The scale given the pose, c' P^-1 (x - m), by a solve instead of the factor that drew it.
#[test]
fn equal_what_a_draw_tells_and_the_conditional_of_the_pose() {
    let before = driven(driven(unsure()));
    let mut after = before.clone();
    after.draw(&[0.3, -1.2, 0.8, 0.1, -0.4, 1.5]);
    let weights =
        solve(&cholesky(&before.covariance).expect("positive definite"), &before.scale.with_pose.map(|v| [v]));
    let (mut mean, mut variance) = (before.scale.mean, before.scale.variance);
    for (i, [weight]) in weights.into_iter().enumerate() {
        mean += weight * math::wrap_angle(after.mean[i] - before.mean[i]);
        variance -= weight * before.scale.with_pose[i];
    }
    assert!((after.scale.mean - mean).abs() < 1e-9 && (after.scale.variance - variance).abs() < 1e-12, "{after:?}");
    assert_eq!((after.scale.with_pose, after.covariance), ([0.0; 6], [[0.0; 6]; 6]));
}

/// A rover whose place is measured exactly at every step knows its scale as a regression of ways on counts does.
#[test]
fn dist_the_scale_that_is_learnt_errs_as_much_as_it_says() {
    let noise = MotionNoise::new(&NOISE, 1.0);
    let (mut squares, trials, sigma) = (0.0, 400, 0.1);
    for trial in 0..trials {
        let stream =
            Streams { seed: 1, scene: trial, attempt: 0, stage: Stage::Slam, step: 0 }.open(Purpose::SlamSample);
        let truth = 1.0 + sigma * stream.normal(0);
        let mut belief = GaussianPose::default();
        belief.scale.variance = sigma * sigma;
        for step in 1..=20 {
            // Half a metre is counted, with noise that grows with the root of the way driven.
            let driven_m = truth * 0.5;
            let way_m = driven_m + truth * NOISE.odometry_m_per_sqrt_m * driven_m.sqrt() * stream.normal(step);
            let start_m = belief.mean[0];
            belief.drive(Control { distance_m: 0.5, turn_rad: 0.0 }, &noise);
            let h: Matrix<3, 6> = std::array::from_fn(|r| std::array::from_fn(|c| f64::from(u8::from(r == c))));
            let noise = diagonal(&[1e-12; 3]);
            let pull = product(&h, &belief.covariance);
            let factor = cholesky(&sum(&product(&pull, &transpose(&h)), &noise)).expect("positive definite");
            let innovation = [start_m + way_m - belief.mean[0], 0.0, 0.0];
            belief.measure(&h, &pull, &factor, &innovation, &noise);
        }
        let off = belief.scale.mean - truth;
        squares += off * off / belief.scale.variance;
        // 20 ways of half a metre, each with a noise of 1.4 cm, beside the prior. What the first of them is worth is
        // reckoned by the scale believed then, which is off by up to a third: of all that may make a seventh.
        let of_ways = truth * truth * truth * NOISE.odometry_m_per_sqrt_m * NOISE.odometry_m_per_sqrt_m / (20.0 * 0.5);
        let wanted = 1.0 / (1.0 / (sigma * sigma) + 1.0 / of_ways);
        assert!((belief.scale.variance / wanted - 1.0).abs() < 0.15, "{} {wanted}", belief.scale.variance);
    }
    // A mean of 400 squares: four standard deviations of it.
    let nees = squares / trials as f64;
    assert!((nees - 1.0).abs() < 4.0 * (2.0 / trials as f64).sqrt(), "{nees}");
}

/// Drives, measurements, readings and draws of a scale that is known are those of a filter without one.
#[test]
fn extreme_a_known_scale_stays_known() {
    let mut belief = GaussianPose { scale: ScaleFactor::default(), ..unsure() };
    for _ in 0..50 {
        belief = measured(driven(belief));
        belief.read_angle(YAW, belief.mean[YAW] + 0.01, 1e-4);
    }
    belief.draw(&[1.0; 6]);
    assert_eq!(belief.scale, ScaleFactor::default());
}

/// On the spot nothing is told of the way; backwards as much as forwards; where all is counted and nothing driven, the place stays.
#[test]
fn extreme_turns_on_the_spot_ways_back_and_wheels_that_spin() {
    let noise = MotionNoise::new(&NOISE, 1.0);
    let mut spun = unsure();
    spun.drive(Control { distance_m: 0.0, turn_rad: 1.0 }, &noise);
    assert_eq!(spun.scale, unsure().scale);
    let level = |mean: f64| {
        let scale = ScaleFactor { mean, variance: 0.81, with_pose: [0.0; 6] };
        GaussianPose { mean: [0.0; 6], covariance: [[0.0; 6]; 6], scale, ..Default::default() }
    };
    let [ahead, back] = [0.4, -0.4].map(|distance_m| {
        let mut belief = level(1.0);
        belief.drive(Control { distance_m, turn_rad: 0.0 }, &noise);
        belief
    });
    assert!((ahead.covariance[0][0] - back.covariance[0][0]).abs() < 1e-15);
    assert!((ahead.scale.with_pose[0] + back.scale.with_pose[0]).abs() < 1e-15);
    assert!(
        (ahead.covariance[0][0] - (0.81 * 0.16 + NOISE.odometry_m_per_sqrt_m * NOISE.odometry_m_per_sqrt_m * 0.4))
            .abs()
            < 1e-15
    );
    for mean in [0.0, -0.3] {
        let mut spinning = level(mean);
        spinning.drive(CONTROL, &noise);
        let way_m = math::hypot(spinning.mean[0], spinning.mean[1]);
        assert!((way_m - 0.4 * mean.abs()).abs() < 1e-12, "{spinning:?}");
        let [x, y, ..] = spinning.scale.with_pose;
        assert!(spinning.covariance[0][0] > 0.0 && math::hypot(x, y) > 0.3, "{spinning:?}");
    }
}

/// What is learnt to the last digit is known, and has nothing left in common with the pose.
#[test]
fn extreme_a_variance_that_rounding_takes_below_nought_is_nought() {
    let mut scale = ScaleFactor { mean: 0.9, variance: 1e-4, with_pose: [1e-3, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let row = [1e-2, 0.0, 0.0, 0.0, 0.0, 0.0];
    // The covariance of both is singular, and nothing errs: rounding alone tells on which side of nought it ends.
    scale.read(0, &row, 1e-2 * (1.0 - f64::EPSILON), 1e-3);
    assert!(scale.is_known() && scale.with_pose == [0.0; 6], "{scale:?}");
}
