//! Registration alone: sweeps of posts on a rough ground at two stops, and what later readings tell of the way between them.

use super::*;
use crate::geometry::DVec2;
use crate::slam::features::tests::{mount, scan, tilted, yard};

const NOISE: InstrumentNoise = InstrumentNoise {
    imu_rad: 0.002,
    imu_bias_rad: 0.0,
    sun_rad: 0.05,
    odometry_m_per_sqrt_m: 0.1,
    sideways_m_per_sqrt_m: 0.0,
    slip: 0.0,
    heading_rad_per_sqrt_m: 0.03,
};
const METHOD: SlamParams = SlamParams::Registration(RegistrationParams { range_m: 5.3, every: 1 });
const DRIVEN_M: f64 = 0.5;

fn posts() -> crate::scene::Scene {
    let places = [(12.0, 10.6), (11.6, 9.2), (12.6, 9.7), (11.3, 11.1), (12.9, 11.0)];
    yard(DVec2::ZERO, &places.map(|(x, y)| (DVec2::new(x, y), 0.12, 0.4)))
}

fn stop(driven_m: f64) -> Pose {
    Pose { position_m: DVec3::new(10.0 + driven_m, 10.0, 0.0), ..Pose::default() }
}

fn reading(told_m: f64, yaw_rad: Option<f64>) -> Reading {
    let (roll_rad, pitch_rad) = (Some(0.0), Some(0.0));
    Reading { dt_s: 1.0, speed_mps: told_m, yaw_rate_radps: 0.0, roll_rad, pitch_rad, yaw_rad }
}

/// After a sweep at the start, where the sun told the heading wrongly by that.
fn at_start(method: &SlamParams, wrong_rad: f64) -> Slam {
    let mut slam = Slam::new(method, &NOISE, &stop(0.0), &mount()).expect("a filter");
    slam.step(&reading(0.0, Some(wrong_rad))).expect("upright");
    slam.observe(&scan(&posts(), &tilted(), &stop(0.0)), &streams(0)).expect("upright");
    slam
}

#[test]
fn law_the_second_sweep_brings_the_pose_in_and_is_told_to_be_found_again() {
    let mut slam = at_start(&METHOD, 0.0);
    assert!(!slam.found_again() || slam.mode() == Mode::Slam);
    slam.step(&reading(DRIVEN_M + 0.08, None)).expect("upright");
    let truth = stop(DRIVEN_M);
    let estimate = slam.observe(&scan(&posts(), &tilted(), &truth), &streams(1)).expect("upright");
    let off_m = (estimate.pose.position_m - truth.position_m).truncate().length();
    assert!(off_m < 0.012, "{off_m}");
    assert!(estimate.covariance[0][0] < 0.02 * 0.02, "{}", estimate.covariance[0][0]);
    assert_eq!((estimate.features, estimate.matched, estimate.landmarks), (0, 0, 0), "no landmarks");
    assert!(!estimate.sigma_optimistic && slam.ancestors() == 1 && slam.found_again());
    assert_eq!((slam.mode(), slam.counters()), (Mode::Slam, Counters::default()));
    // Nothing is drawn: the seed changes nothing.
    let mut other = at_start(&METHOD, 0.0);
    other.step(&reading(DRIVEN_M + 0.08, None)).expect("upright");
    let streams = Streams { seed: 99, ..streams(1) };
    assert_eq!(other.observe(&scan(&posts(), &tilted(), &truth), &streams).expect("upright"), estimate);
}

#[test]
fn equal_fastslam_that_is_given_no_feature_is_registration_alone() {
    // Nothing is drawn, so that all particles stay one Gaussian that carries the pose at the keyframe along.
    let particles = FastslamParams { particles: 20, max_features: 0, ..FastslamParams::default() };
    let run = |method: &SlamParams| {
        let mut slam = at_start(method, 0.02);
        slam.step(&reading(DRIVEN_M + 0.08, None)).expect("upright");
        slam.observe(&scan(&posts(), &tilted(), &stop(DRIVEN_M)), &streams(1)).expect("upright");
        slam.step(&reading(0.0, Some(0.0))).expect("upright");
        assert!(slam.found_again() && slam.ancestors() == method_particles(method));
        slam.estimate()
    };
    let [of_particles, alone] = [&SlamParams::Fastslam(particles), &METHOD].map(run);
    assert!((of_particles.pose.position_m - alone.pose.position_m).length() < 1e-9);
    assert!((of_particles.pose.yaw_rad - alone.pose.yaw_rad).abs() < 1e-9);
    for (own, other) in of_particles.covariance.iter().flatten().zip(alone.covariance.iter().flatten()) {
        assert!((own - other).abs() < 1e-9, "{own} {other}");
    }
}

fn method_particles(method: &SlamParams) -> usize {
    if let SlamParams::Fastslam(params) = method { params.particles as usize } else { 1 }
}

#[test]
fn law_what_the_sun_tells_later_corrects_the_way_before_as_particles_cannot() {
    let wrong_rad = 0.05;
    let aside_m = |method: &SlamParams| {
        let mut slam = at_start(method, wrong_rad);
        slam.step(&reading(DRIVEN_M, None)).expect("upright");
        slam.observe(&scan(&posts(), &tilted(), &stop(DRIVEN_M)), &streams(1)).expect("upright");
        let before_m = slam.estimate().pose.position_m.y - 10.0;
        for _ in 0..20 {
            slam.step(&reading(0.0, Some(0.0))).expect("upright");
        }
        (before_m, slam.estimate().pose.position_m.y - 10.0)
    };
    let (before_m, after_m) = aside_m(&METHOD);
    assert!((before_m - DRIVEN_M * wrong_rad).abs() < 0.008, "the whole map is turned: {before_m}");
    // Of twenty-one readings one was wrong.
    assert!(after_m.abs() < 0.25 * before_m, "{before_m} {after_m}");
}

#[test]
fn law_between_sweeps_and_without_any_it_is_dead_reckoning() {
    let run = |method: &SlamParams| {
        let mut slam = Slam::new(method, &NOISE, &stop(0.0), &mount()).expect("a filter");
        slam.step(&reading(0.0, Some(0.02))).expect("upright");
        for step in 0..4 {
            // Sweeps of an empty, level yard tell of no way.
            slam.observe(&scan(&yard(DVec2::ZERO, &[]), &tilted(), &stop(0.1 * step as f64)), &streams(step as u32))
                .expect("upright");
            slam.step(&reading(0.11, Some(0.01))).expect("upright");
        }
        (slam.estimate(), slam.found_again())
    };
    let ((registered, found_again), (reckoned, _)) = (run(&METHOD), run(&SlamParams::DeadReckoning));
    assert!(!found_again);
    assert_eq!((registered.pose, registered.covariance), (reckoned.pose, reckoned.covariance));
}

#[test]
fn extreme_features_of_ones_own_and_sweeps_of_nonsense() {
    let mut slam = at_start(&METHOD, 0.0);
    let visibility = Visibility::blind(5.0);
    for step in 1..6 {
        slam.step(&reading(0.05, Some(0.0))).expect("upright");
        let feature = feature([2.0 - 0.05 * f64::from(step), 0.3, -0.2]);
        let estimate = slam.observe_features(&[feature], &visibility, &streams(step)).expect("upright");
        assert!(estimate.covariance.iter().flatten().all(|v| v.is_finite()), "{step}");
        assert!((0..6).all(|i| estimate.covariance[i][i] >= 0.0), "{step}: {:?}", estimate.covariance);
        let mut returns = scan(&posts(), &tilted(), &stop(0.05 * f64::from(step)));
        for (slot, range_m) in returns.range_m.iter_mut().enumerate() {
            *range_m = [*range_m, f64::NAN, f64::INFINITY, -1.0, 1e300, 0.0][slot % 6];
        }
        let estimate = slam.observe(&returns, &streams(step)).expect("upright");
        assert!(estimate.pose.position_m.is_finite() && estimate.covariance.iter().flatten().all(|v| v.is_finite()));
    }
}
