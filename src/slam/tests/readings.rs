//! What instruments read, and readings that make no sense.

use super::*;
use crate::random::Purpose;

#[test]
fn law_the_attitude_comes_from_the_first_readings_not_from_the_start() {
    let start = Pose { yaw_rad: 1.0, roll_rad: 0.1, ..Pose::default() };
    let mut slam = slam(&fastslam(3), &start);
    slam.step(&Reading { yaw_rad: Some(1.1), roll_rad: Some(0.12), ..rest(&start) }).expect("upright");
    let estimate = slam.estimate();
    assert!((estimate.pose.yaw_rad - 1.1).abs() < 1e-12 && (estimate.pose.roll_rad - 0.12).abs() < 1e-12);
    assert!((estimate.sigmas()[5] - NOISE.sun_rad).abs() < 1e-12);
}

#[test]
fn equal_dead_reckoning_and_fastslam_without_features() {
    let start = Pose { yaw_rad: 2.0, ..Pose::default() };
    let mut reckoned = slam(&SlamParams::DeadReckoning, &start);
    drive_ahead(&mut reckoned, &start, &[], 30);
    for particles in [1, 7] {
        let mut slam = slam(&fastslam(particles), &start);
        drive_ahead(&mut slam, &start, &[], 30);
        let (a, b) = (reckoned.estimate(), slam.estimate());
        assert!(distance_m(&a.pose, &b.pose) < 1e-9);
        assert!((0..36).all(|i| (a.covariance[i / 6][i % 6] - b.covariance[i / 6][i % 6]).abs() < 1e-9));
        assert_eq!(slam.mode(), Mode::DeadReckoning);
    }
}

#[test]
fn extreme_plus_and_minus_pi_are_one_heading() {
    use std::f64::consts::PI;
    let run = |yaw: f64| {
        let start = Pose { yaw_rad: yaw, ..Pose::default() };
        let mut slam = slam(&fastslam(10), &start);
        for k in 0..3 {
            let reading = Reading { yaw_rad: Some(yaw), speed_mps: 0.1, dt_s: f64::from(k), ..rest(&start) };
            slam.step(&reading).expect("upright");
        }
        slam.estimate()
    };
    let (a, b) = (run(PI), run(-PI));
    assert!(distance_m(&a.pose, &b.pose) < 1e-15);
    assert!(math::wrap_angle(a.pose.yaw_rad - b.pose.yaw_rad).abs() < 1e-15);
    // Around the seam: readings on both sides of it average to it.
    let start = Pose { yaw_rad: PI - 1e-9, ..Pose::default() };
    let mut slam = slam(&fastslam(10), &start);
    for yaw in [PI - 0.01, -PI + 0.01] {
        slam.step(&Reading { yaw_rad: Some(yaw), ..rest(&start) }).expect("upright");
    }
    let off_rad = math::wrap_angle(slam.estimate().pose.yaw_rad - PI).abs();
    assert!(off_rad < 1e-12);
    let mut naive = textbook::Planar { mean: [0.0, 0.0, PI - 0.01], covariance: [[1e-3; 3]; 3] };
    naive.read_heading(-PI + 0.01, 1e-3);
    row(
        Family::Slam,
        "headings of pi - 0.01 and -pi + 0.01, averaged",
        &format!("difference not wrapped: off by {:.2} rad", math::wrap_angle(naive.mean[2] - PI).abs()),
        &format!("off by {off_rad:.0e} rad; readings of pi and of -pi give one pose"),
    );
}

#[test]
fn extreme_senseless_readings_are_counted_and_change_nothing() {
    let (mut slam, still) = driven_and_still();
    let before = slam.estimate();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for reading in [
            Reading { speed_mps: bad, dt_s: 1.0, ..still },
            Reading { yaw_rate_radps: bad, dt_s: 1.0, ..still },
            Reading { dt_s: bad, speed_mps: 0.1, ..still },
            Reading { roll_rad: Some(bad), ..still },
            Reading { pitch_rad: Some(bad), ..still },
            Reading { yaw_rad: Some(bad), ..still },
            Reading { speed_mps: 1e200, dt_s: 1e200, ..still },
        ] {
            let skipped = slam.estimate().skipped;
            slam.step(&reading).expect("upright");
            let after = slam.estimate();
            assert_eq!((after.pose, after.covariance), (before.pose, before.covariance), "{reading:?}");
            assert_eq!(after.skipped, skipped + 1, "{reading:?}");
        }
        for polar in [[bad, 0.0, 0.0], [2.0, bad, 0.0], [2.0, 0.0, bad], [0.1, 0.0, 0.0], [2.0, 0.0, 1.57]] {
            let skipped = slam.estimate().skipped;
            slam.observe_features(&[feature(polar)], &Visibility::blind(0.0), &streams(92)).expect("upright");
            let after = slam.estimate();
            assert_eq!((after.pose, after.features, after.skipped), (before.pose, 0, skipped + 1), "{polar:?}");
        }
    }
}

#[test]
fn extreme_a_reading_far_off_is_gated_for_all_particles() {
    let start = Pose::default();
    let mut slam = slam(&fastslam(10), &start);
    for _ in 0..5 {
        slam.step(&rest(&start)).expect("upright");
    }
    let still = Reading { roll_rad: None, pitch_rad: None, yaw_rad: None, ..rest(&start) };
    slam.step(&still).expect("upright");
    let before = slam.estimate();
    for reading in [
        Reading { pitch_rad: Some(0.35), ..still },
        Reading { roll_rad: Some(-0.35), ..still },
        Reading { yaw_rad: Some(2.0), ..still },
    ] {
        slam.step(&reading).expect("upright");
    }
    let after = slam.estimate();
    assert_eq!(slam.counters().gated, 3);
    assert_eq!((after.pose, after.covariance), (before.pose, before.covariance));
}

#[test]
fn regress_the_gate_stays_shut_at_its_stated_rate_while_weights_are_uneven() {
    // Weights that did not sum to one between the readings of a step once shut the gate on good readings.
    let start = Pose::default();
    let rocks = field(DVec3::ZERO);
    let view = everywhere(3.6);
    let mut slam = slam(&fastslam(50), &start);
    let noise = Streams { stage: Stage::Drive, ..streams(0) }.open(Purpose::SlamSurrogate);
    let mut pose = start;
    for k in 0..200u32 {
        let draw = |i: u64| noise.normal(u64::from(k) * 4 + i);
        if k > 0 {
            pose.position_m.x += 0.02;
        }
        let reading = Reading {
            dt_s: 1.0,
            speed_mps: if k > 0 { 0.02 + 0.05 * 0.02f64.sqrt() * draw(0) } else { 0.0 },
            yaw_rate_radps: 0.0,
            roll_rad: Some(NOISE.imu_rad * draw(1)),
            pitch_rad: Some(NOISE.imu_rad * draw(2)),
            yaw_rad: Some(NOISE.sun_rad * draw(3)),
        };
        slam.step(&reading).expect("upright");
        slam.observe_features(&seen(&rocks, &pose), &view, &streams(k)).expect("upright");
    }
    // One in a thousand of 600 readings: four or more would be a one-in-300 chance.
    assert!(slam.counters().gated <= 3, "{:?}", slam.counters());
}

#[test]
fn extreme_slopes_of_45_degrees_work_and_beyond_80_is_an_error() {
    for (roll, pitch) in [(0.78, 0.0), (-0.78, 0.0), (0.0, 0.78), (0.0, -0.78), (0.5, -0.5)] {
        let start = Pose { roll_rad: roll, pitch_rad: pitch, ..Pose::default() };
        let mut slam = slam(&fastslam(20), &start);
        drive_ahead(&mut slam, &start, &field(DVec3::ZERO), 10);
        let got = slam.estimate().pose;
        assert!((got.roll_rad - roll).abs() < 0.01 && (got.pitch_rad - pitch).abs() < 0.01, "{got:?}");
    }
    // Ten metres down a slope of 45 degrees.
    let start = Pose { pitch_rad: std::f64::consts::FRAC_PI_4, ..Pose::default() };
    let mut slam = slam(&SlamParams::DeadReckoning, &start);
    slam.step(&rest(&start)).expect("upright");
    for _ in 1..=100 {
        slam.step(&Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&start) }).expect("upright");
    }
    let (at, level_m) = (slam.estimate().pose.position_m, 10.0 * std::f64::consts::FRAC_1_SQRT_2);
    let off_m = (at - DVec3::new(level_m, 0.0, -level_m)).length();
    assert!(off_m < 1e-12, "{at}");
    let mut planar = textbook::Planar::default();
    (0..100).for_each(|_| planar.drive(0.1, 0.0, [0.0; 3]));
    row(
        Family::Slam,
        "10 m along a slope of 45 degrees; beyond 80 degrees",
        &format!("planar motion: off by {:.1} m", math::hypot(planar.mean[0] - level_m, level_m)),
        &format!("off by {off_m:.0e} m; beyond 80 degrees an error that names the pitch"),
    );
    let start = Pose::default();
    let mut slam = self::slam(&SlamParams::DeadReckoning, &start);
    let climb = (0..100u32).try_for_each(|k| {
        let tilted = Pose { pitch_rad: -0.02 * f64::from(k), ..start };
        slam.step(&Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&tilted) })
    });
    assert!(matches!(climb, Err(SlamError::Upended { .. })));
}
