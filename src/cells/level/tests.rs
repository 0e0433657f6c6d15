use super::*;
use crate::geometry::Pose;
use crate::random::{Purpose, Stage, Streams};

/// Rough ground with a wall, a box and strays, seen by a sensor of known height, roll and pitch.
fn scan(height_m: f64, roll_rad: f64, pitch_rad: f64, noise_m: f64) -> (Vec<DVec3>, Transform) {
    let stream = Streams { seed: 5, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 }.open(Purpose::GroundNoise);
    let u = |i: u64, k: u64| stream.uniform(8 * i + k);
    let pose = Pose { position_m: DVec3::new(0.0, 0.0, height_m), roll_rad, pitch_rad, yaw_rad: 0.0 };
    let sensor_from_map = pose.transform().inverse();
    let points = (0..20_000)
        .map(|i| {
            // Dense near the sensor, as scans are.
            let (range, azimuth) = (0.5 + 9.0 * u(i, 0) * u(i, 0), std::f64::consts::TAU * u(i, 1));
            let (x, y) = (range * math::cos(azimuth), range * math::sin(azimuth));
            let z = match i % 10 {
                0 | 1 if x > 2.0 => 1.5 * u(i, 2),
                2 if y < -1.0 => 0.3,
                3 => -0.2 + 0.8 * u(i, 2),
                _ => noise_m * 2.0 * (u(i, 3) + u(i, 4) + u(i, 5) - 1.5),
            };
            sensor_from_map.point(DVec3::new(x, y, z))
        })
        .collect();
    (points, pose.transform())
}

#[test]
fn exact_a_known_tilt_is_recovered_to_a_quarter_degree() {
    for (height_m, roll, pitch) in [(0.4, 0.0, 0.0), (0.5, 0.1, 0.35), (1.7, -0.2, 0.05), (0.3, 0.4, -0.6)] {
        let (points, truth) = scan(height_m, roll, pitch, 0.02);
        let level = level(&points, 1.1 * height_m).unwrap();
        let up_there = truth.inverse().direction(DVec3::Z);
        let up_here = level.map_from_sensor.inverse().direction(DVec3::Z);
        let off_deg = math::acos(up_there.dot(up_here).min(1.0)).to_degrees();
        assert!(off_deg < 0.25, "tilt off by {off_deg} degrees at {roll} {pitch}");
        assert!((level.height_m - height_m).abs() < 0.02, "{} {height_m}", level.height_m);
        assert!((level.tilt_rad - math::acos(up_there.z)).abs() < 0.005);
        // The map's x axis lies under the sensor's.
        let forward = level.map_from_sensor.direction(DVec3::X);
        assert!(forward.y.abs() < 1e-12 && forward.x > 0.0);
    }
}

#[test]
fn exact_a_noiseless_plane_is_found_to_rounding() {
    let pose = Pose { position_m: DVec3::new(0.0, 0.0, 0.6), roll_rad: 0.05, pitch_rad: 0.3, yaw_rad: 0.0 };
    let back = pose.transform().inverse();
    let grid =
        (0..60).flat_map(|i| (0..60).map(move |j| DVec3::new(0.1 * f64::from(i) + 0.3, 0.1 * f64::from(j) - 3.0, 0.0)));
    let points: Vec<DVec3> = grid.map(|p| back.point(p)).collect();
    let level = level(&points, 0.6).unwrap();
    assert!((level.height_m - 0.6).abs() < 1e-9 && level.rms_m < 1e-9 && level.near_share == 1.0);
    for p in points {
        assert!(level.map_from_sensor.point(p).z.abs() < 1e-9);
    }
}

#[test]
fn exact_a_second_level_of_the_yard_is_told_and_one_ground_has_no_rival() {
    // A floor 2 m below the sensor; from y = `from_m` on a second plane that rises from there.
    let of = |from_m: f64, step_m: f64, slope: f64| -> Vec<DVec3> {
        let place = |k: i32| (0.1 * f64::from(k % 80) - 4.0, 0.1 * f64::from(k / 80) - 4.0);
        let height_m = |y: f64| if y < from_m { 0.0 } else { step_m + slope * (y - from_m) };
        (0..6400).map(place).map(|(x, y)| DVec3::new(x, y, height_m(y) - 2.0)).collect()
    };
    let rival_of = |points: &[DVec3]| rival(points, 2.0, &level(points, 2.0).unwrap());
    let found = rival_of(&of(0.5, 0.45, 0.0)).expect("two levels");
    assert!((found.height_m - 1.55).abs() < 0.01 && found.angle_rad < 0.01 && found.share > 0.7, "{found:?}");
    // A ramp of 17 degrees that begins below the sensor.
    let found = rival_of(&of(0.0, 0.0, 0.3)).expect("a ramp");
    assert!((found.angle_rad - math::atan(0.3)).abs() < 0.02, "{found:?}");
    // Too few points, a wall instead of a floor, a ramp that misses the height below the sensor.
    for points in [of(3.0, 0.45, 0.0), of(2.0, 0.0, 4.0), of(2.0, 0.0, 0.6), of(9.0, 0.0, 0.0)] {
        assert_eq!(rival_of(&points), None);
    }
    for (height_m, roll, pitch) in [(0.4, 0.0, 0.0), (0.5, 0.1, 0.35), (1.7, -0.2, 0.05)] {
        let (points, _) = scan(height_m, roll, pitch, 0.04);
        assert_eq!(rival(&points, height_m, &level(&points, height_m).unwrap()), None);
    }
}

#[test]
fn extreme_a_plane_that_is_refined_far_from_the_said_height_is_refused() {
    let (points, _) = scan(0.5, 0.0, 0.0, 0.0);
    for said_m in [2.0, 3.0, 5.0, 20.0] {
        let error = level(&points, said_m).unwrap_err().to_string();
        assert!(error.starts_with("no ground to level by: ") && error.contains(&format!("{said_m} m")), "{error}");
    }
    for said_m in [0.45, 0.5, 0.6] {
        let found = level(&points, said_m).unwrap();
        assert!((found.height_m - 0.5).abs() < 5e-3 && found.tilt_rad < 0.02, "{found:?}");
    }
}

#[test]
fn extreme_scans_without_ground_are_refused_with_the_reason() {
    let wall: Vec<DVec3> =
        (0..2000).map(|i| DVec3::new(2.0, 0.05 * f64::from(i % 50) - 1.0, 0.05 * f64::from(i / 50))).collect();
    let line: Vec<DVec3> = (0..2000).map(|i| DVec3::new(0.01 * f64::from(i), 0.0, -0.5)).collect();
    let lone = vec![DVec3::new(1.0, 1.0, -0.5); 5000];
    for points in [&wall, &line, &lone, &vec![]] {
        let error = level(points, 0.5).unwrap_err().to_string();
        assert!(error.starts_with("no ground to level by: "), "{error}");
    }
    for height_m in [f64::NAN, 0.0, -1.0, 1e9] {
        assert!(level(&wall, height_m).is_err());
    }
}
