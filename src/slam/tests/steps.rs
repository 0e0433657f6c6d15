//! Steps, and the angles read after them, without any feature.

use super::super::motion;
use super::*;

/// A step at constant speed and yaw rate is an arc. The chord of the arc points half the turn to the side, and is shorter than the arc
/// by a share of turn^2 / 24: what the filter predicts is the arc's end within that, and never the end of a straight line.
#[test]
fn law_a_predicted_step_ends_where_the_arc_ends() {
    let noise = motion::MotionNoise::new(&EXACT, 1.0);
    for (yaw_rad, turn_rad) in [(0.0, 0.1), (0.7, -0.3), (3.0, 0.5), (-2.0, 0.02), (1.0, 0.0)] {
        let mut belief = motion::GaussianPose { mean: [0.0; 6], covariance: [[0.0; 6]; 6], ..Default::default() };
        belief.mean[motion::YAW] = yaw_rad;
        belief.drive(motion::Control { distance_m: 2.0, turn_rad }, &noise);
        let end = yaw_rad + turn_rad;
        let arc = if turn_rad == 0.0 {
            [2.0 * math::cos(yaw_rad), 2.0 * math::sin(yaw_rad)]
        } else {
            let radius_m = 2.0 / turn_rad;
            [radius_m * (math::sin(end) - math::sin(yaw_rad)), radius_m * (math::cos(yaw_rad) - math::cos(end))]
        };
        let off_m = math::hypot(belief.mean[0] - arc[0], belief.mean[1] - arc[1]);
        assert!(off_m <= 2.0 * turn_rad * turn_rad / 24.0 + 1e-12, "yaw {yaw_rad}, turn {turn_rad}: {off_m} m");
        assert!((belief.mean[motion::YAW] - math::wrap_angle(end)).abs() < 1e-15);
    }
}

#[test]
fn exact_dead_reckoning_variance_grows_by_the_metre() {
    let start = Pose::default();
    let mut slam = slam(&SlamParams::DeadReckoning, &start);
    slam.step(&rest(&start)).expect("upright");
    for _ in 1..=40 {
        slam.step(&Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&start) }).expect("upright");
    }
    let estimate = slam.estimate();
    assert!((estimate.pose.position_m.x - 4.0).abs() < 1e-12);
    // Level and straight: 0.05^2 m^2 a metre along the way.
    assert!((estimate.covariance[0][0] - 4.0 * 0.0025).abs() < 1e-12, "{}", estimate.covariance[0][0]);
}

/// Ground on which the same drive's slope changes more leaves the height less certain, and a stone much less.
#[test]
fn law_the_height_is_as_uncertain_as_the_ground_is_rough() {
    let sigma_z_m = |steps_rad: f64| {
        let start = Pose::default();
        let mut slam = slam(&SlamParams::DeadReckoning, &start);
        slam.step(&rest(&start)).expect("upright");
        let mut pitch_rad = 0.0;
        for k in 1..=40 {
            pitch_rad += if k % 4 < 2 { steps_rad } else { -steps_rad };
            let reading = Reading { dt_s: 1.0, speed_mps: 0.1, pitch_rad: Some(pitch_rad), ..rest(&start) };
            slam.step(&reading).expect("upright");
        }
        assert_eq!(slam.counters(), Counters::default());
        slam.estimate().sigmas()[2]
    };
    let [smooth, bent, rough, rougher] = [0.0, 0.03, 0.045, 0.09].map(sigma_z_m);
    // What exact odometry and the IMU's 0.5 degrees leave, up to centimetres.
    assert!(0.002 < smooth && smooth < 0.008, "{smooth}");
    assert!(1.3 * smooth < rough && 2.0 * rough < rougher && rougher < 0.1, "{smooth} {rough} {rougher}");
    // Without a stone it is less certain by its slope alone.
    assert!(1.1 * smooth < bent && bent < 1.3 * smooth, "{smooth} {bent}");
}

/// On a plane a turn makes pitch of roll, and the height along any way is the plane's.
#[test]
fn exact_a_turn_on_a_slope_leaves_the_slope_where_it_is() {
    let noise = motion::MotionNoise::new(&EXACT, 1.0);
    let slope = 0.05;
    let mut belief = motion::GaussianPose { mean: [0.0; 6], covariance: [[0.0; 6]; 6], ..Default::default() };
    belief.mean[motion::ROLL] = slope;
    let covariance = [(motion::ROLL, 1e-4), (motion::PITCH, 4e-4)];
    covariance.iter().for_each(|&(angle, variance)| belief.covariance[angle][angle] = variance);
    for _ in 0..90 {
        belief.drive(motion::Control { distance_m: 0.02, turn_rad: 1f64.to_radians() }, &noise);
    }
    let [_, y_m, z_m, roll_rad, pitch_rad, _] = belief.mean;
    // Left is up: what was ahead of it is now to its right, and it climbs.
    assert!(roll_rad.abs() < 1e-12 && (pitch_rad + slope).abs() < 1e-12, "{roll_rad} {pitch_rad}");
    assert!((z_m - slope * y_m).abs() < 1e-3 * z_m, "{z_m} {y_m}");
    // The variances change places too, but for what the way adds.
    let walk = noise.slope_rad_per_sqrt_m;
    let added = 90.0 * (walk * walk * (0.02 + 0.25 * 1f64.to_radians()));
    let variances = [motion::ROLL, motion::PITCH].map(|angle| belief.covariance[angle][angle] - added);
    assert!((variances[0] - 4e-4).abs() < 1e-9 && (variances[1] - 1e-4).abs() < 1e-9, "{variances:?}");
}

/// The covariance of a step is that of its mean, told by central differences.
#[test]
fn exact_a_steps_covariance_follows_the_differences_of_its_mean() {
    let noise = motion::MotionNoise::new(&EXACT, 1.0);
    let control = motion::Control { distance_m: 0.3, turn_rad: 0.4 };
    let mean = [0.1, -0.2, 0.3, 0.2, -0.15, 2.0];
    let driven = |mean: [f64; 6]| {
        let mut belief = motion::GaussianPose { mean, covariance: [[0.0; 6]; 6], ..Default::default() };
        belief.drive(control, &noise);
        belief.mean
    };
    let slope = |column: usize| {
        let at = |h: f64| driven(std::array::from_fn(|i| mean[i] + if i == column { h } else { 0.0 }));
        let (above, below) = (at(1e-5), at(-1e-5));
        std::array::from_fn::<f64, 6, _>(|row| (above[row] - below[row]) / 2e-5)
    };
    let columns: Vec<[f64; 6]> = (0..6).map(slope).collect();
    // Any symmetric start.
    let start: [[f64; 6]; 6] =
        std::array::from_fn(|r| std::array::from_fn(|c| if r == c { 2.0 } else { 1.0 / (1 + r + c) as f64 }));
    // The noise of the step is what a pose that was known has after it.
    let [belief, known] = [start, [[0.0; 6]; 6]].map(|covariance| {
        let mut belief = motion::GaussianPose { mean, covariance, ..Default::default() };
        belief.drive(control, &noise);
        belief
    });
    for r in 0..6 {
        for c in 0..6 {
            let wanted: f64 = (0..6)
                .flat_map(|a| (0..6).map(move |b| (a, b)))
                .map(|(a, b)| columns[a][r] * start[a][b] * columns[b][c])
                .sum();
            let carried = belief.covariance[r][c] - known.covariance[r][c];
            assert!((carried - wanted).abs() < 1e-8, "{r} {c}: {carried} {wanted}");
        }
    }
}

/// A bias that nobody can see is in roll and pitch as it is, and in the height by the way.
#[test]
fn exact_a_stated_bias_widens_roll_pitch_and_with_the_way_the_height() {
    let start = Pose::default();
    let bias_rad = 0.02;
    let covariance = |imu_bias_rad: f64| {
        let noise = InstrumentNoise { imu_bias_rad, ..NOISE };
        let mut slam = Slam::new(&SlamParams::DeadReckoning, &noise, &start, &mast()).expect("a filter");
        slam.step(&rest(&start)).expect("upright");
        for _ in 1..=40 {
            slam.step(&Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&start) }).expect("upright");
        }
        slam.estimate().covariance
    };
    let (with, without) = (covariance(bias_rad), covariance(0.0));
    let variance = bias_rad * bias_rad;
    for (r, c, added) in [(2, 2, 16.0), (2, 4, -4.0), (4, 2, -4.0), (3, 3, 1.0), (4, 4, 1.0), (0, 0, 0.0), (2, 3, 0.0)]
    {
        assert!((with[r][c] - without[r][c] - added * variance).abs() < 1e-12, "{r} {c}");
    }
}

#[test]
fn exact_readings_at_rest_average_as_a_scalar_kalman_filter_does() {
    let start = Pose::default();
    let mut slam = slam(&fastslam(1), &start);
    let readings = [0.03, -0.01, 0.02, 0.05, 0.01];
    for yaw in readings {
        slam.step(&Reading { yaw_rad: Some(yaw), ..rest(&start) }).expect("upright");
    }
    let estimate = slam.estimate();
    assert!((estimate.pose.yaw_rad - 0.02).abs() < 1e-15, "the mean of the readings");
    assert!((estimate.covariance[5][5] - 0.035 * 0.035 / 5.0).abs() < 1e-15, "the variance of a mean of five");
}

/// A straight step adds its noise along the heading and across it, and none that joins the two.
#[test]
fn exact_the_noise_of_a_step_lies_along_the_heading_and_across_it() {
    // Aside at least a millimetre a step.
    for (yaw_rad, sideways_m_per_sqrt_m, aside_m) in
        [(0.0, 0.02, 0.04), (0.6, 0.02, 0.04), (2.2, 0.0, 1e-3), (-0.9, 0.0, 1e-3)]
    {
        let noise = motion::MotionNoise::new(&InstrumentNoise { sideways_m_per_sqrt_m, ..NOISE }, 1.0);
        let mut belief = motion::GaussianPose { mean: [0.0; 6], covariance: [[0.0; 6]; 6], ..Default::default() };
        belief.mean[motion::YAW] = yaw_rad;
        belief.drive(motion::Control { distance_m: 4.0, turn_rad: 0.0 }, &noise);
        let (sin, cos) = math::sin_cos(yaw_rad);
        let p = &belief.covariance;
        let between = |a: [f64; 2], b: [f64; 2]| -> f64 {
            (0..2).flat_map(|r| (0..2).map(move |c| (r, c))).map(|(r, c)| a[r] * p[r][c] * b[c]).sum()
        };
        let (ahead, aside) = ([cos, sin], [-sin, cos]);
        // 0.05 m per square root of a metre, over 4 m.
        assert!((between(ahead, ahead) - 0.05 * 0.05 * 4.0).abs() < 1e-15, "{yaw_rad}");
        assert!((between(aside, aside) - aside_m * aside_m).abs() < 1e-15, "{yaw_rad}");
        assert!(between(ahead, aside).abs() < 1e-15, "{yaw_rad}: {}", between(ahead, aside));
    }
}

/// Wheels that are trusted less leave the slope and the height as sure as they are: of those the IMU tells.
#[test]
fn exact_the_motions_inflation_is_of_what_wheels_tell_alone() {
    let [once, inflated] = [1.0, 6.0].map(|inflation| {
        let mut belief = motion::GaussianPose { mean: [0.0; 6], covariance: [[0.0; 6]; 6], ..Default::default() };
        let noise = motion::MotionNoise::new(&NOISE, inflation);
        belief.drive(motion::Control { distance_m: 4.0, turn_rad: 0.3 }, &noise);
        belief.covariance
    });
    for (k, factor) in [6.0, 6.0, 1.0, 1.0, 1.0, 6.0].into_iter().enumerate() {
        assert!(once[k][k] > 0.0 && (inflated[k][k] / once[k][k] - factor).abs() < 1e-12, "{k}");
    }
}

#[test]
fn extreme_one_broken_reading_on_the_way_is_left_out_and_leaves_nothing_behind() {
    let start = Pose::default();
    let drive = |broken: bool| {
        let mut slam = slam(&fastslam(10), &start);
        for step in 0..40 {
            let ahead = Reading { dt_s: 1.0, speed_mps: 0.05, yaw_rad: None, ..rest(&start) };
            let pitch_rad = if broken && step == 20 { Some(0.7) } else { ahead.pitch_rad };
            slam.step(&Reading { pitch_rad, ..ahead }).expect("upright");
        }
        slam
    };
    let (without, with) = (drive(false), drive(true));
    assert_eq!((without.counters().gated, with.counters().gated), (0, 1));
    let (without, with) = (without.estimate(), with.estimate());
    assert!(with.pose.position_m.distance(without.pose.position_m) < 1e-6, "{:?}", with.pose);
    for axis in 0..6 {
        let share = with.covariance[axis][axis] / without.covariance[axis][axis];
        assert!((share - 1.0).abs() < 0.05, "axis {axis}: {share}");
    }
}

#[test]
fn extreme_ten_thousand_steps_at_rest_change_nothing() {
    let (mut slam, still) = driven_and_still();
    let before = slam.estimate();
    for _ in 0..10_000 {
        slam.step(&still).expect("upright");
    }
    let after = slam.estimate();
    assert_eq!((before.pose, before.covariance), (after.pose, after.covariance));
    assert!((before.effective_samples - after.effective_samples).abs() < 1e-6);
    let mut timed = textbook::Planar::default();
    (0..10_000).for_each(|_| timed.drive(0.0, 0.0, [2.5e-4, 2.5e-4, 1e-4]));
    row(
        Family::Slam,
        "ten thousand steps at rest, dt = 0",
        &format!(
            "noise by the step: sigma {:.1} m and {:.1} rad",
            timed.covariance[0][0].sqrt(),
            timed.covariance[2][2].sqrt()
        ),
        "pose and covariance as before, to the bit",
    );
}
