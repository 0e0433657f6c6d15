//! Whole drives: where they lead, what the instruments say, what stays when something else changes.

use garde::Validate;

use super::fixtures::{
    ROVERS, driven, hills, kapvik, params, pioneer, plane, posts, rover, straight, streams, waypoints,
};
use super::params::{
    ArcParams, ControlNoise, DriveParams, InstrumentsParams, LengthParams, PathParams, PlannedParams, RandomWalkParams,
    StartParams,
};
use super::rover::{Chassis, RigidChassis};
use super::yard::{Yard, body};
use super::{DriveError, DriveLog, InstrumentNoise, Reading, drive};
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::random::{Dist, Drawn, Law, Purpose};
use crate::scene::Scene;

fn quiet() -> InstrumentsParams {
    InstrumentsParams {
        imu_deg: Dist::Constant(0.0),
        imu_bias_deg: None,
        sun_deg: Some(Dist::Constant(0.0)),
        odometry_m_per_sqrt_m: Dist::Constant(0.0),
        odometry_deg_per_sqrt_m: Dist::Constant(0.0),
        slip: None,
    }
}

fn noisy() -> InstrumentsParams {
    InstrumentsParams {
        imu_deg: Dist::Law(Law::Uniform([0.2, 1.0])),
        imu_bias_deg: Some(Dist::Constant(1.0)),
        sun_deg: Some(Dist::Constant(2.0)),
        odometry_m_per_sqrt_m: Dist::Constant(0.05),
        odometry_deg_per_sqrt_m: Dist::Constant(2.0),
        slip: Some(Dist::Constant(0.1)),
    }
}

fn bumps(speed: f64, yaw_rate: f64, heading: f64) -> Option<ControlNoise> {
    Some(ControlNoise { speed: speed.into(), yaw_rate: yaw_rate.into(), heading_deg_per_sqrt_m: heading.into() })
}

fn walk(length_m: f64) -> PathParams {
    PathParams::RandomWalk(RandomWalkParams {
        length_m: length_m.into(),
        leg_m: Dist::Law(Law::Uniform([0.3, 1.5])),
        turn_deg: Dist::Law(Law::Uniform([-90.0, 90.0])),
    })
}

/// Every kind of path.
fn paths() -> Vec<PathParams> {
    vec![
        straight(3.0),
        PathParams::Arc(ArcParams { length_m: 3.0.into(), radius_m: Dist::Law(Law::Uniform([-3.0, 3.0])) }),
        waypoints(&[[2.0, 2.0], [6.0, 3.0], [5.0, 8.0]]),
        walk(6.0),
        PathParams::TowardObstacle(LengthParams { length_m: 4.0.into() }),
        PathParams::Planned(PlannedParams { goal_m: 5.0.into(), clearance_m: 0.1 }),
    ]
}

/// Hills with two dozen posts; none near the waypoints' legs.
fn park() -> Scene {
    let draws = streams(77).open(Purpose::StartPlace);
    let all = (0..40)
        .map(|k| (20.0 * draws.uniform(3 * k), 20.0 * draws.uniform(3 * k + 1), 0.1 + 0.3 * draws.uniform(3 * k + 2)));
    let places: Vec<_> = all.filter(|&(x, y, _)| !(1.0..8.0).contains(&x) || !(1.0..9.5).contains(&y)).collect();
    posts(hills(2), &places)
}

fn way_m(log: &DriveLog) -> f64 {
    log.truth.windows(2).map(|pair| (pair[1].position_m - pair[0].position_m).length()).sum()
}

fn hash(log: &DriveLog) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    log.hash_into(&mut hasher);
    hasher.finalize()
}

#[test]
fn law_shipped_rovers_obey_the_rules() {
    for yaml in ROVERS {
        let rover = rover(yaml);
        rover.validate().unwrap();
        assert!(rover.source.len() > 50, "{} says where its figures come from", rover.name);
        assert!(rover.mount.rover_from_sensor().point(DVec3::ZERO).z == rover.mount.z_m);
    }
}

#[test]
fn law_the_body_never_touches_an_obstacle_or_leaves_the_yard() {
    let scene = park();
    for rover in [kapvik(), pioneer()] {
        let yard = Yard::new(&scene, &rover, None);
        for path in paths() {
            let mut params = params(rover.clone(), path);
            params.control_noise = bumps(0.1, 0.1, 5.0);
            for seed in 0..20 {
                let log = driven(&params, &scene, seed);
                for pose in &log.truth {
                    let at = DVec2::new(pose.position_m.x, pose.position_m.y);
                    assert!(yard.clear(&body(&rover, at, pose.yaw_rad), 0.0), "{:?} {seed}", params.path);
                }
                assert_eq!(log.truth.len(), log.readings.len());
                assert_eq!(log.truth.len(), log.contacts.len());
                assert_eq!(log.stops.last(), Some(&(log.truth.len() - 1)));
                assert!(log.stops.windows(2).all(|pair| pair[0] < pair[1]));
                assert!(log.contacts.iter().all(|c| c.residual_m < 0.1));
            }
        }
    }
}

#[test]
fn exact_the_start_is_as_near_the_nearest_obstacle_as_wanted_and_looks_at_it() {
    let scene = posts(plane(20.0, 0.0, DVec2::new(0.05, 0.0)), &[(6.0, 6.0, 0.3), (14.0, 7.0, 0.2), (9.0, 15.0, 0.5)]);
    let yard = Yard::new(&scene, &kapvik(), None);
    let mut params = params(kapvik(), PathParams::TowardObstacle(LengthParams { length_m: 10.0.into() }));
    params.start.near_obstacle_m = Some(Dist::Law(Law::Uniform([1.0, 4.0])));
    for seed in 0..100 {
        let log = driven(&params, &scene, seed);
        let wanted = Drawn::draw(&streams(seed), params.dists())[Purpose::StartNearObstacle];
        let start = log.truth[0];
        let at = DVec2::new(start.position_m.x, start.position_m.y);
        let (distance_m, surface) = yard.nearest(at).unwrap();
        assert!((distance_m - wanted).abs() < 1e-9, "{distance_m} {wanted}");
        assert!(
            ((surface - at).normalize() - DVec2::new(math::cos(start.yaw_rad), math::sin(start.yaw_rad))).length()
                < 1e-9
        );
        // It stops where the next step would touch: half its length and less than a step away.
        assert!(log.cut_short);
        let end = log.truth.last().unwrap().position_m;
        let left_m = yard.nearest(DVec2::new(end.x, end.y)).unwrap().0 - 0.5 * kapvik().length_m;
        assert!((0.0..=params.step_m).contains(&left_m), "{seed}: {left_m}");
    }
}

#[test]
fn law_in_a_crowd_the_start_is_the_place_that_comes_nearest_to_the_wish() {
    let places: Vec<_> =
        (0..8).flat_map(|i| (0..8).map(move |k| (1.5 + 2.4 * f64::from(i), 1.5 + 2.4 * f64::from(k), 0.1))).collect();
    let scene = posts(plane(20.0, 0.0, DVec2::ZERO), &places);
    let mut params = params(kapvik(), straight(1.0));
    params.start.near_obstacle_m = Some(3.9.into());
    let log = driven(&params, &scene, 3);
    let at = DVec2::new(log.truth[0].position_m.x, log.truth[0].position_m.y);
    let (distance_m, _) = Yard::new(&scene, &kapvik(), None).nearest(at).unwrap();
    // Mid between four posts 1.6 m, outside the crowd up to 1.5 m: no more than that is to be had.
    assert!(distance_m > 1.2, "{distance_m}");
}

#[test]
fn exact_paths_have_their_lengths_and_ends() {
    let flat = plane(40.0, 0.0, DVec2::new(0.2, -0.1));
    let roomy = StartParams { near_obstacle_m: None, margin_m: 10.0 };
    let drive_of =
        |path: PathParams| driven(&DriveParams { start: roomy.clone(), ..params(pioneer(), path) }, &flat, 4);

    let log = drive_of(straight(2.03));
    assert!((way_m(&log) - 2.03).abs() < 1e-9 && !log.cut_short);
    assert_eq!(log.truth.len(), 1 + 41, "41 steps of 5 cm, the last of 3 cm");

    let log = drive_of(walk(7.0));
    assert!((way_m(&log) - 7.0).abs() < 1e-9 && !log.cut_short);

    let log = drive_of(PathParams::Arc(ArcParams { length_m: 3.0.into(), radius_m: (-1.5).into() }));
    let turned: f64 = log.truth.windows(2).map(|pair| math::wrap_angle(pair[1].yaw_rad - pair[0].yaw_rad)).sum();
    assert!((turned + 2.0).abs() < 1e-9, "{turned}");

    let log = drive_of(waypoints(&[[12.0, 12.0], [18.0, 12.0], [15.0, 17.0], [14.0, 12.0]]));
    for point in [[18.0, 12.0], [15.0, 17.0], [14.0, 12.0]] {
        let nearest =
            log.truth.iter().map(|p| (DVec2::new(p.position_m.x, p.position_m.y) - DVec2::from(point)).length());
        assert!(nearest.fold(9.0, f64::min) < 0.25 * 0.05, "{point:?}");
    }
    assert!(!log.cut_short);
    assert!(log.readings.iter().any(|r| r.speed_mps == 0.0 && r.yaw_rate_radps != 0.0), "it turns in place");

    let log = drive_of(PathParams::Planned(PlannedParams { goal_m: 6.0.into(), clearance_m: 0.0 }));
    let (start, end) = (log.truth[0].position_m, log.truth.last().unwrap().position_m);
    assert!((math::hypot(end.x - start.x, end.y - start.y) - 6.0).abs() < 0.25 * 0.05);
}

#[test]
fn law_a_planned_way_reaches_its_goal_between_obstacles() {
    let scene = park();
    let params = params(kapvik(), PathParams::Planned(PlannedParams { goal_m: 9.0.into(), clearance_m: 0.05 }));
    for seed in 0..10 {
        let log = driven(&params, &scene, seed);
        let (start, end) = (log.truth[0].position_m, log.truth.last().unwrap().position_m);
        assert!(!log.cut_short && (math::hypot(end.x - start.x, end.y - start.y) - 9.0).abs() < 0.0125, "{seed}");
    }
}

#[test]
fn law_a_walk_turns_away_from_what_bars_it() {
    let scene = park();
    let logs: Vec<_> = (0..20).map(|seed| driven(&params(kapvik(), walk(15.0)), &scene, seed)).collect();
    let whole = logs.iter().filter(|log| !log.cut_short).count();
    assert!(whole >= 15, "{whole} of 20 walks of 15 m in a yard of 20 m came to their end");
}

#[test]
fn exact_quiet_instruments_read_the_truth() {
    let scene = hills(5);
    let mut params = params(pioneer(), walk(4.0));
    params.instruments = quiet();
    params.control_noise = bumps(0.1, 0.1, 3.0);
    let log = driven(&params, &scene, 9);
    assert_eq!(log.readings[0].dt_s, 0.0);
    assert_eq!((log.readings[0].speed_mps, log.readings[0].yaw_rate_radps), (0.0, 0.0));
    for (k, (pose, reading)) in log.truth.iter().zip(&log.readings).enumerate() {
        assert_eq!((reading.roll_rad, reading.pitch_rad), (Some(pose.roll_rad), Some(pose.pitch_rad)));
        assert_eq!(reading.yaw_rad, (k == 0 || log.stops.contains(&k)).then_some(pose.yaw_rad));
    }
    for (pair, reading) in log.truth.windows(2).zip(&log.readings[1..]) {
        let turn = math::wrap_angle(pair[1].yaw_rad - pair[0].yaw_rad);
        assert!((reading.yaw_rate_radps * reading.dt_s - turn).abs() < 1e-12);
        let way = (pair[1].position_m - pair[0].position_m).length();
        // An arc is longer than its chord by at most turn^2 / 24 of it.
        assert!((reading.speed_mps * reading.dt_s - way).abs() <= way * (turn * turn / 20.0 + 1e-12));
        assert!(reading.dt_s > 0.0 && reading.yaw_rate_radps.abs() < 1.5 * 300.0_f64.to_radians());
    }
}

#[test]
fn exact_slip_counts_way_that_was_not_driven() {
    let scene = plane(20.0, 0.0, DVec2::ZERO);
    let mut params = params(pioneer(), straight(2.0));
    params.start.margin_m = 4.0;
    params.instruments = InstrumentsParams { slip: Some(0.2.into()), ..quiet() };
    let log = driven(&params, &scene, 1);
    let counted: f64 = log.readings.iter().map(|r| r.speed_mps * r.dt_s).sum();
    assert!((counted - 2.0 / 0.8).abs() < 1e-9, "{counted}");
}

#[test]
fn order_dead_reckoning_with_quiet_instruments_closes_in_on_the_truth() {
    // The filter's motion model: along the nose at the step's start, an error of first order in the step. The rover is
    // small, since the nose of a long one is not quite tangent to its way over bumps.
    let scene = hills(11);
    let mut small = pioneer();
    small.chassis = Chassis::Rigid(RigidChassis { wheelbase_m: 0.02, track_m: 0.02 });
    small.wheel_diameter_m = 0.02;
    let error_m = |step_m: f64| {
        let mut params = params(small.clone(), waypoints(&[[5.0, 5.0], [13.0, 9.0]]));
        params.instruments = quiet();
        params.step_m = step_m;
        let log = driven(&params, &scene, 1);
        let mut at = log.truth[0].position_m;
        for (pair, reading) in log.truth.windows(2).zip(&log.readings[1..]) {
            let way = reading.speed_mps * reading.dt_s;
            at += pair[0].rotation().x_axis * way;
        }
        (at - log.truth.last().unwrap().position_m).length()
    };
    let (coarse, fine) = (error_m(0.2), error_m(0.05));
    assert!(coarse < 0.2 && fine < coarse / 3.0, "{coarse} {fine}");
}

/// Columns of a reading that one switch may change.
fn without(readings: &[Reading], columns: &[usize]) -> Vec<[Option<u64>; 6]> {
    let bits = |r: &Reading| {
        [Some(r.dt_s), Some(r.speed_mps), Some(r.yaw_rate_radps), r.roll_rad, r.pitch_rad, r.yaw_rad]
            .map(|v| v.map(f64::to_bits))
    };
    let mut kept: Vec<_> = readings.iter().map(bits).collect();
    kept.iter_mut().for_each(|row| columns.iter().for_each(|&c| row[c] = None));
    kept
}

#[test]
fn equal_each_instruments_noise_leaves_the_other_readings_and_the_truth() {
    let scene = hills(5);
    let with =
        |instruments: InstrumentsParams| driven(&DriveParams { instruments, ..params(kapvik(), walk(3.0)) }, &scene, 2);
    let base = with(noisy());
    let (speed, yaw_rate, roll, pitch, yaw) = (1, 2, 3, 4, 5);
    let cases = [
        (InstrumentsParams { imu_deg: 0.0.into(), ..noisy() }, vec![roll, pitch]),
        (InstrumentsParams { imu_bias_deg: None, ..noisy() }, vec![roll, pitch]),
        (InstrumentsParams { sun_deg: None, ..noisy() }, vec![yaw]),
        (InstrumentsParams { odometry_m_per_sqrt_m: 0.0.into(), ..noisy() }, vec![speed]),
        (InstrumentsParams { odometry_deg_per_sqrt_m: 0.0.into(), ..noisy() }, vec![yaw_rate]),
        (InstrumentsParams { slip: None, ..noisy() }, vec![speed]),
    ];
    for (instruments, columns) in cases {
        let log = with(instruments.clone());
        assert_eq!(log.truth, base.truth);
        assert_eq!(without(&log.readings, &columns), without(&base.readings, &columns), "{instruments:?}");
        assert_ne!(log.readings, base.readings);
    }
}

#[test]
fn equal_control_noise_and_speed_leave_start_and_instrument_draws() {
    let scene = hills(5);
    let base = DriveParams { instruments: noisy(), ..params(kapvik(), straight(3.0)) };
    let log = driven(&base, &scene, 2);
    // How far each IMU reading is off its truth: the draw itself, to rounding.
    let off = |log: &DriveLog| -> Vec<f64> {
        log.readings.iter().zip(&log.truth).map(|(r, p)| r.roll_rad.unwrap() - p.roll_rad).collect()
    };
    for changed in [
        DriveParams { control_noise: bumps(0.1, 0.0, 0.0), ..base.clone() },
        DriveParams { control_noise: bumps(0.0, 0.0, 4.0), ..base.clone() },
        DriveParams { speed_mps: Some(0.01.into()), ..base.clone() },
        DriveParams { stops: 9, ..base.clone() },
    ] {
        let other = driven(&changed, &scene, 2);
        assert_eq!(other.truth[0], log.truth[0]);
        assert!(off(&other).iter().zip(off(&log)).all(|(a, b)| (a - b).abs() < 1e-15));
    }
    // Speed noise at 0 and heading noise at 0 draw nothing and move nothing.
    let silent = driven(&DriveParams { control_noise: bumps(0.0, 0.0, 0.0), ..base.clone() }, &scene, 2);
    assert_eq!(hash(&silent), hash(&log));
}

#[test]
fn equal_the_same_address_gives_the_same_bits_and_another_gives_others() {
    let scene = park();
    for path in paths() {
        let params = DriveParams { control_noise: bumps(0.1, 0.1, 3.0), ..params(kapvik(), path) };
        let first = hash(&driven(&params, &scene, 6));
        assert_eq!(first, hash(&driven(&params, &scene, 6)));
        assert_ne!(first, hash(&driven(&params, &scene, 7)));
    }
}

#[test]
fn exact_the_noise_that_slam_is_told_is_the_noise_drawn() {
    let params = params(kapvik(), straight(1.0));
    let drawn = Drawn::draw(&streams(1), params.dists());
    let noise = InstrumentNoise::of(&params.instruments, &drawn);
    assert_eq!(noise.imu_rad, drawn[Purpose::ImuSd].to_radians());
    assert!((0.2..=1.0).contains(&noise.imu_rad.to_degrees()));
    // Simulated wheels do not slip aside.
    assert_eq!(noise.sideways_m_per_sqrt_m, 0.0);
    // Of slip no drive is told its own, but what drives have: of one that is always the same its size, of a law from 0 that is uniform its end over
    // the root of three.
    let told = |slip: Option<Dist>| {
        InstrumentNoise::of(&InstrumentsParams { slip, ..params.instruments.clone() }, &drawn).slip
    };
    let uniform = |ends| Some(Dist::Law(Law::Uniform(ends)));
    assert_eq!(told(None), 0.0);
    for (slip, wanted) in [
        (Some((-0.1).into()), 0.1),
        (uniform([0.0, 0.15]), 0.15 / 3f64.sqrt()),
        (uniform([-0.3, 0.3]), 0.3 / 3f64.sqrt()),
    ] {
        assert!((told(slip.clone()) - wanted).abs() < 1e-15, "{slip:?}");
    }
    let dark = InstrumentsParams { sun_deg: None, ..params.instruments.clone() };
    assert_eq!(InstrumentNoise::of(&dark, &drawn).sun_rad, 0.0);
}

#[test]
fn extreme_impossible_drives_say_why() {
    let attempt = |params: &DriveParams, scene: &Scene| {
        let streams = streams(1);
        drive(params, scene, &Drawn::draw(&streams, params.dists()), &streams)
    };
    let flat = plane(10.0, 0.0, DVec2::ZERO);
    let mut wide = params(kapvik(), straight(1.0));
    wide.start.margin_m = 6.0;
    assert!(matches!(attempt(&wide, &flat), Err(DriveError::NoStart { .. })));

    let steep = plane(10.0, 0.0, DVec2::new(2.5, 0.0));
    assert!(matches!(attempt(&params(kapvik(), straight(1.0)), &steep), Err(DriveError::NoStart { .. })));

    let outside = params(kapvik(), waypoints(&[[-3.0, 2.0], [4.0, 4.0]]));
    let message = attempt(&outside, &flat).unwrap_err().to_string();
    assert!(message.contains("first waypoint (-3, 2)"), "{message}");

    let far = params(kapvik(), PathParams::Planned(PlannedParams { goal_m: 50.0.into(), clearance_m: 0.0 }));
    let message = attempt(&far, &flat).unwrap_err().to_string();
    assert!(message.contains("goal_m"), "{message}");

    let mut endless = params(kapvik(), walk(5000.0));
    endless.step_m = 0.001;
    let message = attempt(&endless, &flat).unwrap_err().to_string();
    assert!(message.contains("control steps"), "{message}");
}

#[test]
fn extreme_a_path_of_no_length_is_one_stop_at_the_start() {
    let flat = plane(10.0, 0.0, DVec2::ZERO);
    for path in [straight(0.0), walk(0.0), waypoints(&[[4.0, 4.0], [4.0, 4.0]])] {
        let log = driven(&params(kapvik(), path), &flat, 1);
        assert_eq!((log.truth.len(), log.stops.clone(), log.cut_short), (1, vec![0], false));
    }
}

#[test]
fn extreme_without_obstacles_every_path_still_drives() {
    let flat = plane(20.0, 0.0, DVec2::ZERO);
    for path in paths() {
        let mut params = params(kapvik(), path);
        params.start.near_obstacle_m = Some(2.0.into());
        assert!(driven(&params, &flat, 1).truth.len() > 10);
    }
}

#[test]
fn extreme_a_cliff_ends_the_path() {
    let scene = super::fixtures::raster(10.0, 0.05, |x, _| if x < 6.0 { 0.0 } else { 4.0 });
    let log = driven(&params(kapvik(), waypoints(&[[3.0, 5.0], [9.0, 5.0]])), &scene, 1);
    assert!(log.cut_short && log.truth.iter().all(|p| p.position_m.is_finite() && p.position_m.x < 6.5));
}

/// Four legs of 1 m with a quarter turn between any two: a square, which ends where it began.
#[test]
fn exact_a_walk_of_equal_legs_and_quarter_turns_is_a_square() {
    let path = PathParams::RandomWalk(RandomWalkParams {
        length_m: 4.0.into(),
        leg_m: Dist::Constant(1.0),
        turn_deg: Dist::Constant(90.0),
    });
    let log = driven(&params(kapvik(), path), &plane(40.0, 0.0, DVec2::ZERO), 3);
    let (first, last) = (&log.truth[0], &log.truth[log.truth.len() - 1]);
    let off_m = (last.position_m - first.position_m).length();
    assert!(off_m < 0.01, "{off_m} m from the start");
    let turned_rad = math::wrap_angle(last.yaw_rad - first.yaw_rad);
    assert!((turned_rad + std::f64::consts::FRAC_PI_2).abs() < 1e-6, "{turned_rad}");
}
