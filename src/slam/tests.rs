//! The whole stage on flat ground among points: closed forms, invariants, and everything that may go wrong.

mod extremes;
mod maps;
mod readings;
mod registered;
mod steps;
mod sweeps;
mod textbook;

use super::matrix::{cholesky, diagonal, sum};
use super::*;
use crate::drive::{InstrumentNoise, Reading};
use crate::extremes::{Family, row};
use crate::geometry::{DVec3, Pose, Transform};
use crate::math;
use crate::random::{Stage, Streams};

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

/// Of many points, and nothing told of it.
pub(super) fn feature(polar: [f64; 3]) -> Feature {
    Feature { polar, points: 20, half_width_m: 0.1, known: None, sigmas: [None; 3] }
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
    slam.step(&rest(&pose)).expect("upright");
    slam.observe_features(&seen(&pose), &view, &streams(0)).expect("upright");
    for k in 1..=steps {
        let (s, c) = math::sin_cos(pose.yaw_rad);
        pose.position_m += 0.1 * DVec3::new(c, s, 0.0);
        let reading = Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&pose) };
        slam.step(&reading).expect("upright");
        if k % 5 == 0 {
            slam.observe_features(&seen(&pose), &view, &streams(k)).expect("upright");
            sound(slam);
        }
    }
    pose
}

/// A filter that drove ahead among rocks and stands still, and the reading of a step at rest that tells no angle.
fn driven_and_still() -> (Slam, Reading) {
    let start = Pose::default();
    let mut slam = slam(&fastslam(10), &start);
    drive_ahead(&mut slam, &start, &field(DVec3::ZERO), 10);
    let still = Reading { roll_rad: None, pitch_rad: None, yaw_rad: None, ..rest(&start) };
    slam.step(&still).expect("upright");
    (slam, still)
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
fn law_one_seed_one_result() {
    let hash = |seed| {
        let start = Pose::default();
        let mut slam = slam(&fastslam(20), &start);
        let view = everywhere(3.6);
        let streams = Streams { seed, ..streams(0) };
        slam.step(&rest(&start)).expect("upright");
        for step in 0..4 {
            let moved = Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&start) };
            slam.step(&moved).expect("upright");
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
    assert!(matches!(slam.step(&rest(&upended)), Err(SlamError::Upended { .. })));
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
