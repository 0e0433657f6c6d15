//! The whole stage on flat ground among points: closed forms, invariants, and everything that may go wrong.

mod extremes;
mod steps;
mod sweeps;
mod textbook;

use super::matrix::{cholesky, diagonal, sum};
use super::*;
use crate::drive::{InstrumentNoise, Reading};
use crate::extremes::{Family, row};
use crate::random::Stage;

const NOISE: InstrumentNoise = InstrumentNoise {
    imu_rad: 0.0087,
    imu_bias_rad: 0.0,
    sun_rad: 0.035,
    odometry_m_per_sqrt_m: 0.05,
    sideways_m_per_sqrt_m: 0.0,
    slip: 0.0,
    heading_rad_per_sqrt_m: 0.035,
};

const EXACT: InstrumentNoise = InstrumentNoise {
    imu_rad: 0.0,
    imu_bias_rad: 0.0,
    sun_rad: 0.0,
    odometry_m_per_sqrt_m: 0.0,
    sideways_m_per_sqrt_m: 0.0,
    slip: 0.0,
    heading_rad_per_sqrt_m: 0.0,
};

fn streams(step: u32) -> Streams {
    Streams { seed: 11, scene: 0, attempt: 0, stage: Stage::Slam, step }
}

fn mast() -> Transform {
    Transform { translation_m: DVec3::new(0.2, 0.0, 0.5), ..Transform::IDENTITY }
}

fn fastslam(particles: u32) -> SlamParams {
    SlamParams::Fastslam(FastslamParams { particles, ..FastslamParams::default() })
}

fn slam(params: &SlamParams, start: &Pose) -> Slam {
    Slam::new(params, &NOISE, start, &mast()).expect("a filter")
}

/// At rest, all instruments exact.
fn rest(pose: &Pose) -> Reading {
    Reading {
        dt_s: 0.0,
        speed_mps: 0.0,
        yaw_rate_radps: 0.0,
        roll_rad: Some(pose.roll_rad),
        pitch_rad: Some(pose.pitch_rad),
        yaw_rad: Some(pose.yaw_rad),
    }
}

fn feature(polar: [f64; 3]) -> Feature {
    Feature { polar, points: 20, half_width_m: 0.1, known: None }
}

fn everywhere(max_range_m: f64) -> Visibility<'static> {
    let directions: Vec<DVec3> = (0..40_000u32)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 40_000.0;
            let (s, c) = math::sin_cos(f64::from(i) * 2.399_963_229_728_653);
            DVec3::new(c * (1.0 - z * z).sqrt(), s * (1.0 - z * z).sqrt(), z)
        })
        .collect();
    Visibility::free(max_range_m, &directions)
}

/// What a sensor at a pose measures of points, without noise.
fn seen(points_m: &[DVec3], pose: &Pose) -> Vec<Feature> {
    let sensor_from_world = (pose.transform() * mast()).inverse();
    points_m
        .iter()
        .map(|point| sensor_from_world.point(*point))
        .filter(|q| q.length() < 4.0)
        .map(|q| feature([q.length(), math::atan2(q.y, q.x), math::atan2(q.z, math::hypot(q.x, q.y))]))
        .collect()
}

/// Rocks at 1.3 m from one another, well apart for the gates.
fn field(start_m: DVec3) -> Vec<DVec3> {
    let mut points = Vec::new();
    for i in -6..=6i32 {
        for j in -6..=6i32 {
            let (x, y) = (1.3 * f64::from(i) + 0.4, 1.3 * f64::from(j) + 0.6 + 0.2 * f64::from(i % 2));
            points.push(start_m + DVec3::new(x, y, 0.15 + 0.01 * f64::from((i + 2 * j).rem_euclid(7))));
        }
    }
    points
}

/// A drive straight ahead on flat ground with a sweep every 0.5 m; noise-free unless `normal` is used by the caller.
fn drive_ahead(slam: &mut Slam, start: &Pose, rocks: &[DVec3], steps: u32) -> Pose {
    drive_among(slam, start, rocks, steps, 11, false)
}

/// `known`: the features say which rock they are.
fn drive_among(slam: &mut Slam, start: &Pose, rocks: &[DVec3], steps: u32, seed: u64, known: bool) -> Pose {
    let streams = |step| Streams { seed, ..streams(step) };
    let seen = |pose: &Pose| -> Vec<Feature> {
        let rocks = rocks.iter().zip(0..);
        rocks
            .flat_map(|(r, id)| seen(&[*r], pose).into_iter().map(move |f| (f, id)))
            .map(|(f, id)| Feature { known: known.then_some(id), ..f })
            .collect()
    };
    let view = everywhere(3.6);
    let mut pose = *start;
    slam.step(&rest(&pose), &streams(0)).expect("upright");
    slam.observe_features(&seen(&pose), &view, &streams(0)).expect("upright");
    for k in 1..=steps {
        let (s, c) = math::sin_cos(pose.yaw_rad);
        pose.position_m += 0.1 * DVec3::new(c, s, 0.0);
        let reading = Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&pose) };
        slam.step(&reading, &streams(k)).expect("upright");
        if k % 5 == 0 {
            slam.observe_features(&seen(&pose), &view, &streams(k)).expect("upright");
            sound(slam);
        }
    }
    pose
}

/// No NaN, covariance symmetric and positive semi-definite to 1e-12, weights that sum to one.
fn sound(slam: &Slam) {
    let estimate = slam.estimate();
    let p = &estimate.covariance;
    for r in 0..6 {
        for c in 0..6 {
            assert!(p[r][c].is_finite() && (p[r][c] - p[c][r]).abs() <= 1e-12, "{p:?}");
        }
    }
    assert!(cholesky(&sum(p, &diagonal(&[1e-12; 6]))).is_some(), "not positive semi-definite: {p:?}");
    assert!(estimate.pose.position_m.is_finite());
    let total: f64 = slam.filter.cloud().weights().iter().sum();
    assert!((total - 1.0).abs() < 1e-9, "{total}");
    let (_, landmarks) = slam.best();
    assert!(landmarks.iter().all(|l| l.mean_m.iter().chain(l.covariance_m2.iter().flatten()).all(|v| v.is_finite())));
}

fn distance_m(a: &Pose, b: &Pose) -> f64 {
    a.position_m.distance(b.position_m)
}

#[test]
fn law_the_attitude_comes_from_the_first_readings_not_from_the_start() {
    let start = Pose { yaw_rad: 1.0, roll_rad: 0.1, ..Pose::default() };
    let mut slam = slam(&fastslam(3), &start);
    slam.step(&Reading { yaw_rad: Some(1.1), roll_rad: Some(0.12), ..rest(&start) }, &streams(0)).expect("upright");
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
fn law_features_bring_the_pose_in_and_the_map_stays_as_large_as_the_world() {
    let start = Pose::default();
    let rocks = field(start.position_m);
    let mut slam = slam(&fastslam(100), &start);
    let end = drive_ahead(&mut slam, &start, &rocks, 30);
    let estimate = slam.estimate();
    assert!(distance_m(&estimate.pose, &end) < 0.08, "{:?}", estimate.pose);
    assert!(estimate.matched >= 8 && estimate.landmarks >= 15, "{estimate:?}");
    assert_eq!(slam.mode(), Mode::Slam);
    let (_, landmarks) = slam.best();
    for landmark in landmarks.iter().filter(|l| l.existence > 0.8) {
        let at = DVec3::from_array(landmark.mean_m);
        assert!(rocks.iter().any(|r| r.distance(at) < 0.2), "{at}");
    }
}

#[test]
fn extreme_coordinates_a_million_metres_off_change_nothing() {
    let run = |offset: DVec3| {
        let start = Pose { position_m: offset, yaw_rad: 0.3, ..Pose::default() };
        let mut slam = slam(&fastslam(20), &start);
        // Features computed near the origin: it is the filter that is on trial.
        let near = Pose { position_m: DVec3::ZERO, ..start };
        drive_ahead(&mut slam, &near, &field(DVec3::ZERO), 25);
        let estimate = slam.estimate();
        (estimate.pose.position_m - offset, estimate.covariance)
    };
    let ((near, p), (far, q)) = (run(DVec3::ZERO), run(DVec3::new(1e6, -1e6, 1e6)));
    // The sum with 1e6 rounds at 1e-10; the filter itself is bit-equal.
    assert!(near.distance(far) < 1e-9);
    assert_eq!(p, q);
    // The same 25 steps of 0.1 m, summed as f32 coordinates.
    let single = (0..25).fold(1e6_f32, |x, _| x + 0.1 * math::cos(0.3) as f32) - 1e6;
    row(
        Family::Slam,
        "coordinates a thousand kilometres off",
        &format!("state in f32, 2.5 m driven: off by {:.2} m", (f64::from(single) - 2.5 * math::cos(0.3)).abs()),
        &format!("covariance equal to the bit, pose to {:.0e} m", near.distance(far)),
    );
}

#[test]
fn extreme_plus_and_minus_pi_are_one_heading() {
    use std::f64::consts::PI;
    let run = |yaw: f64| {
        let start = Pose { yaw_rad: yaw, ..Pose::default() };
        let mut slam = slam(&fastslam(10), &start);
        for k in 0..3 {
            let reading = Reading { yaw_rad: Some(yaw), speed_mps: 0.1, dt_s: f64::from(k), ..rest(&start) };
            slam.step(&reading, &streams(k as u32)).expect("upright");
        }
        slam.estimate()
    };
    let (a, b) = (run(PI), run(-PI));
    assert!(distance_m(&a.pose, &b.pose) < 1e-15);
    assert!(math::wrap_angle(a.pose.yaw_rad - b.pose.yaw_rad).abs() < 1e-15);
    // Around the seam: readings on both sides of it average to it.
    let start = Pose { yaw_rad: PI - 1e-9, ..Pose::default() };
    let mut slam = slam(&fastslam(10), &start);
    for (k, yaw) in [PI - 0.01, -PI + 0.01].into_iter().enumerate() {
        slam.step(&Reading { yaw_rad: Some(yaw), ..rest(&start) }, &streams(k as u32)).expect("upright");
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
fn law_one_seed_one_result() {
    let hash = |seed| {
        let start = Pose::default();
        let mut slam = slam(&fastslam(20), &start);
        let view = everywhere(3.6);
        let streams = Streams { seed, ..streams(0) };
        slam.step(&rest(&start), &streams).expect("upright");
        for step in 0..4 {
            let moved = Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&start) };
            slam.step(&moved, &streams.at_step(step)).expect("upright");
            slam.observe_features(&seen(&field(DVec3::ZERO), &start), &view, &streams.at_step(step)).expect("upright");
        }
        let mut hasher = blake3::Hasher::new();
        slam.estimate().hash_into(&mut hasher);
        hasher.finalize()
    };
    assert_eq!(hash(1), hash(1));
    assert_ne!(hash(1), hash(2));
}

#[test]
fn extreme_bad_parameters_are_refused() {
    let new = |params: &SlamParams, start: &Pose| Slam::new(params, &NOISE, start, &mast()).map(|_| ());
    assert_eq!(new(&fastslam(0), &Pose::default()), Err(SlamError::NoParticles));
    assert_eq!(new(&SlamParams::Truth, &Pose::default()), Err(SlamError::NoFilter { method: "truth" }));
    let nowhere = Pose { position_m: DVec3::new(f64::NAN, 0.0, 0.0), ..Pose::default() };
    assert_eq!(new(&fastslam(1), &nowhere), Err(SlamError::StartNotFinite));
    let mount = Transform { translation_m: DVec3::new(0.0, f64::INFINITY, 0.0), ..Transform::IDENTITY };
    let unmounted = Slam::new(&fastslam(1), &NOISE, &Pose::default(), &mount).map(|_| ());
    assert_eq!(unmounted, Err(SlamError::MountNotFinite));
    let upended = Pose { pitch_rad: 1.5, ..Pose::default() };
    assert!(matches!(new(&fastslam(1), &upended), Err(SlamError::Upended { .. })));
    let mut slam = slam(&fastslam(4), &Pose::default());
    assert!(matches!(slam.step(&rest(&upended), &streams(0)), Err(SlamError::Upended { .. })));
}

#[test]
fn extreme_one_particle_and_noise_free_instruments_stay_sound() {
    let start = Pose::default();
    for particles in [1, 40] {
        for noise in [
            NOISE,
            EXACT,
            InstrumentNoise { odometry_m_per_sqrt_m: 0.0, heading_rad_per_sqrt_m: 0.0, ..NOISE },
            InstrumentNoise { odometry_m_per_sqrt_m: 1.0, heading_rad_per_sqrt_m: 0.7, ..NOISE },
        ] {
            let mut slam = Slam::new(&fastslam(particles), &noise, &start, &mast()).expect("a filter");
            let end = drive_ahead(&mut slam, &start, &field(DVec3::ZERO), 20);
            sound(&slam);
            if noise == EXACT {
                assert!(distance_m(&slam.estimate().pose, &end) < 0.05, "{:?}", slam.estimate().pose);
            }
        }
    }
}

#[test]
fn extreme_measurement_noise_from_the_floor_to_useless() {
    let start = Pose::default();
    let run = |inflation: f64, seed: u64| {
        let params = FastslamParams { particles: 100, measurement_inflation: inflation, ..FastslamParams::default() };
        let mut slam = slam(&SlamParams::Fastslam(params), &start);
        drive_among(&mut slam, &start, &field(DVec3::ZERO), 20, seed, inflation > 1.0);
        sound(&slam);
        slam.estimate()
    };
    run(1e-12, 1);
    // Known landmarks: gates of any width would leave the associations to chance.
    let mut reckoned = slam(&SlamParams::DeadReckoning, &start);
    drive_ahead(&mut reckoned, &start, &[], 20);
    let reckoned = reckoned.estimate();
    let (mut ratios, mut offs, seeds) = ([0.0; 6], [0.0; 3], 40);
    for seed in 0..seeds {
        let useless = run(1e12, seed);
        let off_m = useless.pose.position_m - reckoned.pose.position_m;
        for (i, ratio) in ratios.iter_mut().enumerate() {
            *ratio += useless.covariance[i][i] / reckoned.covariance[i][i] / seeds as f64;
        }
        for (i, off) in offs.iter_mut().enumerate() {
            *off += off_m[i] / reckoned.sigmas()[i] / seeds as f64;
        }
    }
    // Each of the few resamplings of some 50 effective particles knows a variance to 20 %, a mean to 14 % of a sigma; with
    // five of them and 40 seeds the averages are known to 7 and 5 %: three of these.
    assert!(ratios.iter().all(|r| (r - 1.0).abs() < 0.21), "{ratios:?}");
    assert!(offs.iter().all(|off| off.abs() < 0.15), "{offs:?}");
}

#[test]
fn law_a_landmark_is_matched_once_in_a_sweep() {
    // Two features just far enough apart to both be taken, one landmark between them.
    let start = Pose::default();
    let view = everywhere(3.6);
    let mut slam = slam(&fastslam(20), &start);
    slam.step(&rest(&start), &streams(0)).expect("upright");
    slam.observe_features(&[feature([2.0, 0.0, -0.1])], &view, &streams(0)).expect("upright");
    slam.step(&rest(&start), &streams(1)).expect("upright");
    let two = [feature([2.0, 0.078, -0.1]), feature([2.0, -0.078, -0.1])];
    let estimate = slam.observe_features(&two, &view, &streams(1)).expect("upright");
    assert_eq!((estimate.features, estimate.matched), (2, 1));
    assert_eq!(estimate.new_landmarks, 0, "the other is too near to be new");
}

#[test]
fn extreme_senseless_readings_are_counted_and_change_nothing() {
    let start = Pose::default();
    let mut slam = slam(&fastslam(10), &start);
    drive_ahead(&mut slam, &start, &field(DVec3::ZERO), 10);
    let still = Reading { roll_rad: None, pitch_rad: None, yaw_rad: None, ..rest(&start) };
    slam.step(&still, &streams(90)).expect("upright");
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
            slam.step(&reading, &streams(91)).expect("upright");
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
    for step in 0..5 {
        slam.step(&rest(&start), &streams(step)).expect("upright");
    }
    let still = Reading { roll_rad: None, pitch_rad: None, yaw_rad: None, ..rest(&start) };
    slam.step(&still, &streams(8)).expect("upright");
    let before = slam.estimate();
    for reading in [
        Reading { pitch_rad: Some(0.35), ..still },
        Reading { roll_rad: Some(-0.35), ..still },
        Reading { yaw_rad: Some(2.0), ..still },
    ] {
        slam.step(&reading, &streams(9)).expect("upright");
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
        slam.step(&reading, &streams(k)).expect("upright");
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
    slam.step(&rest(&start), &streams(0)).expect("upright");
    for k in 1..=100 {
        slam.step(&Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&start) }, &streams(k)).expect("upright");
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
        slam.step(&Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&tilted) }, &streams(k))
    });
    assert!(matches!(climb, Err(SlamError::Upended { .. })));
}

#[test]
fn extreme_a_kidnapped_rover_does_not_match_wrong_landmarks() {
    let start = Pose::default();
    let view = everywhere(3.6);
    let rocks = [DVec3::new(2.0, 0.0, 0.2), DVec3::new(2.5, 1.5, 0.2), DVec3::new(1.0, -2.0, 0.2)];
    let mut slam = slam(&fastslam(50), &start);
    for step in 0..4 {
        slam.step(&rest(&start), &streams(step)).expect("upright");
        slam.observe_features(&seen(&rocks, &start), &view, &streams(step)).expect("upright");
    }
    let carried = Pose { position_m: DVec3::new(0.0, -2.0, 0.0), ..start };
    slam.step(&rest(&carried), &streams(9)).expect("upright");
    let estimate = slam.observe_features(&seen(&rocks, &carried), &view, &streams(9)).expect("upright");
    assert!(estimate.features >= 2);
    assert_eq!(estimate.matched, 0, "{estimate:?}");
    // The nearest landmark to where each feature seems to be, whatever its distance.
    let seem = |rock: &DVec3| *rock - carried.position_m;
    let nearest = |at: DVec3| (0..3).min_by(|&a, &b| rocks[a].distance(at).total_cmp(&rocks[b].distance(at)));
    let wrong = (0..3).filter(|&k| nearest(seem(&rocks[k])) != Some(k)).count();
    assert!(wrong > 0);
    row(
        Family::Slam,
        "carried 2 m aside between two sweeps",
        &format!("nearest landmark without a gate: {wrong} of 3 features matched to another's landmark"),
        &format!("none of {} features matched; new landmarks or left out", estimate.features),
    );
}

#[test]
fn extreme_lost_features_switch_the_mode_and_found_ones_switch_it_back() {
    let start = Pose::default();
    let rocks = field(DVec3::ZERO);
    let view = everywhere(3.6);
    let mut slam = slam(&fastslam(50), &start);
    drive_ahead(&mut slam, &start, &rocks, 10);
    assert_eq!(slam.mode(), Mode::Slam);
    let known = slam.estimate().sigmas()[0];
    let mut pose = Pose { position_m: DVec3::new(1.0, 0.0, 0.0), ..start };
    for k in 11..=25u32 {
        pose.position_m.x += 0.1;
        slam.step(&Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&pose) }, &streams(k)).expect("upright");
        if k % 5 == 0 {
            slam.observe_features(&[], &Visibility::blind(0.0), &streams(k)).expect("upright");
        }
    }
    assert_eq!(slam.mode(), Mode::DeadReckoning);
    let lost = slam.estimate();
    assert!(lost.sigmas()[0] > 1.5 * known);
    slam.step(&rest(&pose), &streams(26)).expect("upright");
    let regained = slam.observe_features(&seen(&rocks, &pose), &view, &streams(26)).expect("upright");
    assert_eq!(slam.mode(), Mode::Slam);
    assert!(regained.sigmas()[0] < 0.7 * lost.sigmas()[0]);
    assert!((regained.pose.position_m.x - pose.position_m.x).abs() < 3.0 * lost.sigmas()[0]);
}

#[test]
fn extreme_ten_thousand_landmarks() {
    let start = Pose::default();
    let params = FastslamParams { particles: 2, max_features: 20_000, ..FastslamParams::default() };
    let mut slam = slam(&SlamParams::Fastslam(params), &start);
    let many: Vec<Feature> = (0..10_000u32)
        .map(|i| {
            let polar = [1.0 + 3e-4 * f64::from(i), math::wrap_angle(0.7 * f64::from(i)), 0.0];
            Feature { known: Some(i), ..feature(polar) }
        })
        .collect();
    slam.step(&rest(&start), &streams(0)).expect("upright");
    slam.observe_features(&many, &Visibility::blind(0.0), &streams(0)).expect("upright");
    assert_eq!(slam.best().1.len(), 10_000);
    slam.step(&rest(&start), &streams(1)).expect("upright");
    slam.observe_features(&[feature([9.0, 0.0, 0.0])], &Visibility::blind(0.0), &streams(1)).expect("upright");
    sound(&slam);
    assert_eq!(slam.estimate().new_landmarks, 1);
    let state = 6.0 + 3.0 * 10_000.0;
    row(
        Family::Slam,
        "ten thousand landmarks",
        &format!("EKF-SLAM: one covariance of {state} x {state} numbers, {:.1} GB", state * state * 8e-9),
        &format!(
            "{} landmarks of {} bytes a particle; a new feature finds its place among them",
            10_000,
            std::mem::size_of::<Landmark>()
        ),
    );
}

#[test]
fn law_missing_landmarks_fade_and_hidden_ones_stay() {
    let start = Pose::default();
    let rock = [feature([2.0, 0.0, -0.1])];
    let run = |view: &Visibility| {
        let mut slam = slam(&fastslam(5), &start);
        for step in 0..12 {
            slam.step(&rest(&start), &streams(step)).expect("upright");
            let features: &[Feature] = if step < 3 { &rock } else { &[] };
            slam.observe_features(features, view, &streams(step)).expect("upright");
        }
        slam.best().1.len()
    };
    assert_eq!(run(&everywhere(3.6)), 0);
    assert_eq!(run(&everywhere(1.5)), 1, "out of reach");
    assert_eq!(run(&Visibility::blind(3.6)), 1, "never looked at");
}

#[test]
fn dist_surrogate_errors_have_the_stated_sizes_and_truth_has_none() {
    let params = SurrogateParams { xy_m: 0.3, z_m: 0.2, tilt_deg: 1.0, yaw_deg: 2.0 };
    let at = Pose { position_m: DVec3::new(1.0, 2.0, 3.0), yaw_rad: std::f64::consts::PI, ..Pose::default() };
    let (mut squares, n) = ([0.0; 6], 4000);
    for step in 0..n {
        let estimate = surrogate(&params, &at, &streams(step));
        let d = estimate.pose.position_m - at.position_m;
        let yaw = math::wrap_angle(estimate.pose.yaw_rad - at.yaw_rad);
        for (square, e) in squares.iter_mut().zip([d.x, d.y, d.z, estimate.pose.roll_rad, estimate.pose.pitch_rad, yaw])
        {
            *square += e * e / f64::from(n);
        }
    }
    let sigmas = surrogate(&params, &at, &streams(0)).sigmas();
    for i in 0..6 {
        // The variance of 4000 draws is known to 2.2 %: four of these.
        assert!((squares[i] / (sigmas[i] * sigmas[i]) - 1.0).abs() < 0.09, "component {i}");
    }
    assert!((sigmas[5] - 2f64.to_radians()).abs() < 1e-15);
    assert_eq!((truth(&at).pose, truth(&at).covariance), (at, [[0.0; 6]; 6]));
}

/// A normalised square is none before a sweep, and never negative; an error of the range alone adds to it.
#[test]
fn law_the_mean_innovation_grows_with_the_error_of_what_is_seen() {
    let start = Pose::default();
    let rocks = field(start.position_m);
    let innovation = |error_m: f64| {
        let mut slam = slam(&fastslam(20), &start);
        assert_eq!(slam.mean_innovation(), None);
        drive_ahead(&mut slam, &start, &rocks, 3);
        let here = slam.best().0;
        let mut found = seen(&rocks, &here);
        found.iter_mut().for_each(|feature| feature.polar[0] += error_m);
        slam.observe_features(&found, &everywhere(4.0), &streams(4)).expect("a sweep");
        slam.mean_innovation().expect("matches")
    };
    let (right, wrong) = (innovation(0.0), innovation(0.05));
    assert!(right >= 0.0 && wrong > right, "{right} {wrong}");
}
