//! Sweeps of posts at two stops, and odometry that errs between them: what laying the one on the other brings.

use super::*;
use crate::geometry::DVec2;
use crate::scene::Scene;
use crate::slam::features::tests::{mount, scan, tilted, yard};

const NOISE: InstrumentNoise = InstrumentNoise {
    imu_rad: 0.002,
    imu_bias_rad: 0.0,
    sun_rad: 0.01,
    odometry_m_per_sqrt_m: 0.1,
    sideways_m_per_sqrt_m: 0.0,
    slip: 0.0,
    heading_rad_per_sqrt_m: 0.03,
};
const SLOPE: f64 = 0.1;
/// Driven, and what odometry says of it, metres.
const DRIVEN_M: f64 = 0.5;
const TOLD_M: f64 = 0.58;

fn posts(slope: f64) -> Scene {
    let places = [(12.0, 10.6), (11.6, 9.2), (12.6, 9.7), (11.3, 11.1), (12.9, 11.0)];
    yard(DVec2::new(slope, 0.0), &places.map(|(x, y)| (DVec2::new(x, y), 0.12, 0.4)))
}

/// Heading east up a slope, so far from the start.
fn stop(driven_m: f64, slope: f64) -> Pose {
    let x_m = 10.0 + driven_m;
    let pitch_rad = -math::atan2(slope, 1.0);
    Pose { position_m: DVec3::new(x_m, 10.0, slope * x_m), pitch_rad, ..Pose::default() }
}

fn reading(told_m: f64, slope: f64) -> Reading {
    let along_m = told_m * (1.0 + slope * slope).sqrt();
    let pitch_rad = Some(stop(0.0, slope).pitch_rad);
    Reading { dt_s: 1.0, speed_mps: along_m, yaw_rate_radps: 0.0, roll_rad: Some(0.0), pitch_rad, yaw_rad: Some(0.0) }
}

fn streams(step: u32) -> Streams {
    Streams { seed: 1, scene: 0, attempt: 0, stage: Stage::Slam, step }
}

fn at_start(params: FastslamParams, slope: f64) -> Slam {
    let start = stop(0.0, slope);
    let mut slam = Slam::new(&SlamParams::Fastslam(params), &NOISE, &start, &mount()).expect("a filter");
    slam.step(&reading(0.0, slope)).expect("upright");
    slam.observe(&scan(&posts(slope), &tilted(), &start), &streams(0)).expect("upright");
    slam
}

/// How far the estimate is from the truth along the way after the second sweep.
fn error_m(mut slam: Slam, slope: f64) -> f64 {
    slam.step(&reading(TOLD_M, slope)).expect("upright");
    let truth = stop(DRIVEN_M, slope);
    let estimate = slam.observe(&scan(&posts(slope), &tilted(), &truth), &streams(1)).expect("upright");
    estimate.pose.position_m.x - truth.position_m.x
}

#[test]
fn law_laying_sweeps_on_one_another_brings_the_pose_in_on_the_level_and_on_a_slope() {
    for slope in [0.0, SLOPE] {
        for particles in [1, 60] {
            let of = |registration| FastslamParams { particles, registration, ..FastslamParams::default() };
            let registered_m = error_m(at_start(of(true), slope), slope);
            assert!(registered_m.abs() < 0.012, "{particles} on {slope}: {registered_m}");
            let alone_m = error_m(at_start(of(false), slope), slope);
            assert!(alone_m.abs() > 1.5 * registered_m.abs(), "{particles} on {slope}: {registered_m} {alone_m}");
        }
    }
}

#[test]
fn law_a_sweep_of_nothing_leaves_the_keyframe_and_features_of_ones_own_do_too() {
    let mut slam = at_start(FastslamParams::default(), 0.0);
    let empty = yard(DVec2::ZERO, &[]);
    slam.observe(&scan(&empty, &tilted(), &stop(0.0, 0.0)), &streams(0)).expect("upright");
    slam.observe_features(&[], &Visibility::blind(5.0), &streams(0)).expect("upright");
    let error_m = error_m(slam, 0.0);
    assert!(error_m.abs() < 0.012, "{error_m}");
}

#[test]
fn law_two_sweeps_from_one_place_move_nothing_and_surfaces_keep_the_mode() {
    let mut slam = at_start(FastslamParams::default(), 0.0);
    for step in 1..5 {
        slam.observe(&scan(&posts(0.0), &tilted(), &stop(0.0, 0.0)), &streams(step)).expect("upright");
    }
    let off_m = slam.estimate().pose.position_m - stop(0.0, 0.0).position_m;
    assert!(off_m.length() < 0.01, "{off_m}");
    assert_eq!((slam.mode(), slam.counters().gated), (Mode::Slam, 0));
}
