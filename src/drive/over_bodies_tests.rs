//! Drives over bodies (`drive.over_bodies`): closed forms on a slab, ways around what a rover cannot cross, limits kept all along.

use super::fixtures::{
    ROVERS, driven, hills, kapvik, params, plane, posts, raster, rover, rubble, straight, streams, waypoints,
};
use super::params::{ContactSolver, DriveParams, PathParams, PlannedParams, RandomWalkParams};
use super::rolled::Rolling;
use super::surface::Surface;
use super::yard::{Yard, body};
use super::{DriveError, DriveLog, GroundContact, Rover, clearance_m, drive};
use crate::geometry::{DVec2, DVec3, Pose};
use crate::math;
use crate::random::{Dist, Drawn, Law, Purpose};
use crate::scene::{Class, Convex, Scene, Shape};

fn over_bodies(rover: Rover, path: PathParams) -> DriveParams {
    DriveParams { over_bodies: true, ..params(rover, path) }
}

fn between(from: [f64; 2], to: [f64; 2]) -> PathParams {
    waypoints(&[from, to])
}

fn with_box(scene: Scene, at: [f64; 2], half: [f64; 2], height_m: f64) -> Scene {
    let [x, y] = at;
    let ground_m = scene.ground_below_m(x, y);
    let body = Convex::cuboid(DVec3::new(x, y, ground_m), DVec3::new(half[0], half[1], height_m), 0.0);
    scene.with_obstacle(Class::Rock, Shape::Convex(body))
}

/// Pitch of a rover whose front axle stands on a slab: of a rigid one, the wheels' line; of Kapvik, the rocker's through the raised bogie.
fn pitch_with_front_raised(rover: &Rover, height_m: f64) -> f64 {
    if rover.name == "kapvik" {
        // Wheels 0.3 m apart carry the bogie, its pivot 0.05 m above their axles' middle; the rocker's wheel is 0.45 m behind and 0.05 m below it.
        let bogie_rad = math::asin(height_m / 0.3);
        let raised_m = 0.5 * height_m + 0.05 * math::cos(bogie_rad);
        math::atan2(0.05, 0.45) - math::asin(raised_m / math::hypot(0.45, 0.05))
    } else {
        -math::asin(height_m / rover.wheelbase_m())
    }
}

#[test]
fn exact_a_rover_that_drives_onto_a_slab_pitches_by_the_closed_form() {
    let height_m = 0.04;
    let scene = with_box(plane(20.0, 0.0, DVec2::ZERO), [10.0, 10.0], [1.5, 3.0], height_m);
    for yaml in ROVERS {
        let rover = rover(yaml);
        let log = driven(&over_bodies(rover.clone(), between([6.0, 10.0], [14.0, 10.0])), &scene, 1);
        assert!(!log.cut_short, "{}", rover.name);
        let mut met = [0; 3];
        for pose in &log.truth {
            let x_m = pose.position_m.x;
            // On the slab from its edge on; on the ground up to a wheel's reach before it, flank and all. A pitched wheel is nearly where a level one is.
            let (front_m, next_m) =
                (0.5 * rover.wheelbase_m(), if rover.name == "kapvik" { 0.0 } else { -0.5 * rover.wheelbase_m() });
            let (is_front_on, is_next_off) = (x_m + front_m > 8.51, x_m + next_m < 8.49 - 1.5 * rover.wheel_radius_m());
            let (part, pitch_rad, z_m) = if x_m < 8.5 - front_m - rover.wheel_diameter_m {
                (0, 0.0, Some(0.0))
            } else if is_front_on && is_next_off {
                (1, pitch_with_front_raised(&rover, height_m), None)
            } else if (9.5..10.5).contains(&x_m) {
                (2, 0.0, Some(height_m))
            } else {
                continue;
            };
            met[part] += 1;
            assert!((pose.pitch_rad - pitch_rad).abs() < 1e-8, "{} at {x_m}: {pose:?} {pitch_rad}", rover.name);
            assert!(pose.roll_rad.abs() < 1e-8 && z_m.is_none_or(|z_m: f64| (pose.position_m.z - z_m).abs() < 1e-8));
        }
        // A Pioneer's wheels are too large for its wheelbase: one of them feels the edge all the way up.
        assert!(met[0] > 5 && met[2] > 5 && (met[1] > 3 || rover.name == "pioneer-3at"), "{} {met:?}", rover.name);
    }
}

#[test]
fn exact_both_wheels_of_a_side_on_a_plank_roll_the_rover_by_its_height_over_the_track() {
    let height_m = 0.04;
    for yaml in ROVERS {
        let rover = rover(yaml);
        let scene = with_box(plane(20.0, 0.0, DVec2::ZERO), [10.0, 10.0 + 0.5 * rover.track_m()], [2.0, 0.1], height_m);
        let log = driven(&over_bodies(rover.clone(), between([6.0, 10.0], [14.0, 10.0])), &scene, 1);
        let on = log.truth.iter().filter(|pose| (9.0..11.0).contains(&pose.position_m.x));
        let off_rad: Vec<f64> =
            on.map(|pose| (math::sin(pose.roll_rad).abs() - height_m / rover.track_m()).abs()).collect();
        assert!(off_rad.len() > 5 && off_rad.iter().all(|off| *off < 2e-3), "{} {off_rad:?}", rover.name);
    }
}

#[test]
fn equal_bits_where_there_is_no_body_and_nothing_that_bars() {
    for path in
        [between([4.0, 4.0], [15.0, 12.0]), PathParams::Planned(PlannedParams { goal_m: 5.0.into(), clearance_m: 0.1 })]
    {
        let scene = plane(20.0, 0.3, DVec2::new(0.2, -0.1));
        let hash = |params: &DriveParams| {
            let mut hasher = blake3::Hasher::new();
            driven(params, &scene, 5).hash_into(&mut hasher);
            hasher.finalize()
        };
        let plain = params(kapvik(), path);
        assert_eq!(hash(&plain), hash(&DriveParams { over_bodies: true, ..plain.clone() }));
    }
}

/// Kapvik with legs for steps of 0.05 m.
fn careful() -> Rover {
    let mut rover = kapvik();
    rover.limits.as_mut().expect("a shipped rover has limits").max_step_m = 0.05;
    rover
}

fn widest_m(log: &DriveLog) -> f64 {
    log.truth.iter().fold(0.0, |most, pose| (pose.position_m.y - 10.0).abs().max(most))
}

#[test]
fn law_a_planned_way_goes_over_what_a_rover_climbs_and_round_what_it_does_not() {
    // Waypoints go straight: the drive ends before what bars it. A planned way of the same yard leads round.
    let stone = with_box(plane(20.0, 0.0, DVec2::ZERO), [10.0, 10.0], [0.15, 1.5], 0.08);
    let ledge = raster(20.0, 0.05, |x, y| if (x - 10.0).abs() < 0.3 && (y - 10.0).abs() < 1.5 { 0.3 } else { 0.0 });
    let slot = raster(20.0, 0.05, |x, y| if (x - 10.0).abs() < 0.3 && (y - 10.0).abs() < 1.5 { -0.4 } else { 0.0 });
    for (name, scene, rover, is_barred) in [
        ("a stone it climbs", &stone, kapvik(), false),
        ("a stone it does not climb", &stone, careful(), true),
        ("a ledge of ground", &ledge, kapvik(), true),
        ("a ditch", &slot, kapvik(), true),
    ] {
        let log = driven(&over_bodies(rover.clone(), between([8.0, 10.0], [12.0, 10.0])), scene, 1);
        assert_eq!(log.cut_short, is_barred, "{name}");
        assert!(log.truth.iter().all(|pose| !is_barred || pose.position_m.x < 10.0), "{name}");
        let limits = rover.limits.as_ref();
        let yard = Yard::new(scene, &rover, limits);
        let way = super::route::around(&yard, DVec2::new(8.0, 10.0), DVec2::new(12.0, 10.0), rover.turning_radius_m());
        let points: Vec<[f64; 2]> = way.expect("there is a way round").into_iter().map(Into::into).collect();
        assert_eq!(points.len() > 2, is_barred, "{name}: {points:?}");
        let path = waypoints(&points);
        let log = driven(&over_bodies(rover, path), scene, 1);
        assert!(!log.cut_short && (widest_m(&log) > 1.5) == is_barred, "{name}: {}", widest_m(&log));
    }
    // Without the switch the lower stone is not there at all.
    let log = driven(&params(careful(), between([8.0, 10.0], [12.0, 10.0])), &stone, 1);
    assert!(!log.cut_short && log.truth.iter().all(|pose| pose.pitch_rad == 0.0));
}

/// Stones of all sizes on hills or rubble, and posts.
fn strewn(seed: u64) -> Scene {
    let draws = streams(seed).open(Purpose::StartPlace);
    let ground = if seed.is_multiple_of(2) { hills(seed) } else { rubble(seed, 0.008) };
    let extent_m = ground.extent_m;
    let scene = posts(ground, &[(0.3 * extent_m, 0.4 * extent_m, 0.2), (0.7 * extent_m, 0.6 * extent_m, 0.3)]);
    (0..4 * extent_m as u64).fold(scene, |scene, stone| {
        let draw = |k: u64| draws.uniform(1000 + 10 * stone + k);
        let at = [extent_m * draw(0), extent_m * draw(1)];
        with_box(scene, at, [0.03 + 0.15 * draw(2), 0.03 + 0.15 * draw(3)], 0.02 + 0.15 * draw(4))
    })
}

fn tilt_rad(pose: &Pose) -> f64 {
    math::acos((math::cos(pose.pitch_rad) * math::cos(pose.roll_rad)).min(1.0))
}

#[test]
fn law_every_stand_of_a_drive_over_bodies_keeps_the_limits_and_feels_the_stones() {
    let walk = PathParams::RandomWalk(RandomWalkParams {
        length_m: 4.0.into(),
        leg_m: Dist::Law(Law::Uniform([0.3, 1.5])),
        turn_deg: Dist::Law(Law::Uniform([-90.0, 90.0])),
    });
    let planned = PathParams::Planned(PlannedParams { goal_m: 3.0.into(), clearance_m: 0.0 });
    let straight = straight(4.0);
    let (mut stands, mut turned) = (0, 0);
    for seed in 0..6 {
        let scene = strewn(seed);
        for (path, rover) in [&walk, &planned, &straight].into_iter().zip(ROVERS.map(rover)) {
            let params = over_bodies(rover.clone(), path.clone());
            let streams = streams(seed);
            let made = drive(&params, &scene, &Drawn::draw(&streams, params.dists()), &streams);
            // A crowd may leave no way to any goal.
            let log = match made {
                Err(DriveError::NoWay { .. } | DriveError::NoStart { .. }) => continue,
                made => made.expect("a drive"),
            };
            let limits = rover.limits.as_ref().expect("a shipped rover has limits");
            let yard = Yard::new(&scene, &rover, Some(limits));
            let all: Vec<_> = scene.obstacles.iter().collect();
            for pose in &log.truth {
                let at = pose.position_m.truncate();
                assert!(yard.clear(&body(&rover, at, pose.yaw_rad), 0.0), "{seed} {}", rover.name);
                assert!(tilt_rad(pose) <= limits.max_tilt_deg.to_radians() + 1e-12);
                assert!(clearance_m(&rover, rover.belly_clearance_m(), &scene, &all, pose).is_some());
                stands += 1;
            }
            let plain = driven(&DriveParams { over_bodies: false, ..params }, &scene, seed);
            turned += usize::from(log.truth.iter().zip(&plain.truth).any(|(a, b)| a.pitch_rad != b.pitch_rad));
        }
    }
    assert!(stands > 500 && turned > 8, "{stands} {turned}");
}

#[test]
fn extreme_a_rover_without_limits_does_not_drive_over_bodies() {
    let rover = Rover { limits: None, ..kapvik() };
    let (params, streams) = (over_bodies(rover, between([4.0, 4.0], [6.0, 6.0])), streams(1));
    let refused = drive(&params, &plane(10.0, 0.0, DVec2::ZERO), &Drawn::draw(&streams, params.dists()), &streams);
    assert!(refused.expect_err("no limits").to_string().contains("has none"));
}

/// Boxes of every height up to ten of Kapvik's wheels, and posts, on hills or rubble.
fn walled(seed: u64) -> Scene {
    let draws = streams(seed).open(Purpose::StartPlace);
    let ground = if seed.is_multiple_of(2) { hills(seed) } else { rubble(seed, 0.004) };
    let extent_m = ground.extent_m;
    let scene = posts(ground, &[(0.3 * extent_m, 0.4 * extent_m, 0.2), (0.7 * extent_m, 0.6 * extent_m, 0.1)]);
    (0..2 * extent_m as u64).fold(scene, |scene, wall| {
        let draw = |k: u64| draws.uniform(1000 + 10 * wall + k);
        let at = [extent_m * draw(0), extent_m * draw(1)];
        with_box(scene, at, [0.05 + 0.5 * draw(2), 0.05 + 0.5 * draw(3)], 0.02 + draw(4))
    })
}

#[test]
fn law_a_wheel_rises_without_a_jump_beside_walls_of_every_height() {
    let (radius_m, step_m) = (0.05, 1e-6);
    for height_m in [0.01, 0.1, 0.134, 0.136, 0.2, 1.0, 10.0] {
        for slope in [DVec2::ZERO, DVec2::new(0.3, -0.2)] {
            let scene = with_box(plane(20.0, 0.0, slope), [10.0, 10.0], [1.0, 1.0], height_m);
            let bodies: Vec<_> = scene.obstacles.iter().collect();
            for ahead in [DVec2::X, DVec2::Y, DVec2::new(0.6, 0.8)] {
                let surface = Surface::new(&scene).with(Rolling { bodies: &bodies, ahead, radius_m });
                let touch = |x_m: f64| surface.touch(x_m, 9.7).expect("in the yard");
                let centre_m = |x_m: f64| {
                    let touch = touch(x_m);
                    touch.height_m + radius_m * (1.0 + touch.slope.length_squared()).sqrt()
                };
                // From a centimetre before the wheel's reach to where it is on top: no step is higher than twice the steepest flank makes it.
                let from_m = 9.0 - 1.5 * radius_m - 0.01;
                let most_m = 2.0 * step_m * (2.0 * (height_m + 1.0) / (0.5 * radius_m));
                for k in 0..90_000 {
                    let x_m = from_m + step_m * f64::from(k);
                    let rise_m = centre_m(x_m + step_m) - centre_m(x_m);
                    assert!(rise_m.abs() < most_m, "{height_m} {slope} {ahead} at {x_m}: {rise_m}");
                }
                // The derivative is the height's, on the flank and on the ball.
                for x_m in [9.0 - 1.2 * radius_m, 9.0 - 0.5 * radius_m] {
                    let by_x = (centre_m(x_m + step_m) - centre_m(x_m - step_m)) / (2.0 * step_m);
                    let told = touch(x_m).gradient.x;
                    assert!(
                        (told - by_x).abs() < 1e-5 * (1.0 + by_x.abs()),
                        "{height_m} {slope} {ahead} {x_m}: {told} {by_x}"
                    );
                }
            }
        }
    }
}

/// A roof whose ridge rises by `rise` from its foot at x = 10: an edge, and two faces beside it.
fn roof(scene: Scene, rise: f64, height_m: f64) -> Scene {
    let (from_m, to_m) = (10.0, 10.0 + height_m / rise);
    let corners = [(from_m, 10.0, 0.0), (to_m, 10.0, height_m)].into_iter().chain([
        (from_m, 9.97, -0.2),
        (from_m, 10.03, -0.2),
        (to_m, 9.9, -0.2),
        (to_m, 10.1, -0.2),
    ]);
    let body = Convex::hull(&corners.map(DVec3::from).collect::<Vec<_>>()).expect("a solid");
    scene.with_obstacle(Class::Rock, Shape::Convex(body))
}

#[test]
fn law_a_wheel_beside_sloping_edges_rises_without_a_jump_by_its_derivative() {
    let (radius_m, step_m) = (0.05, 2e-6);
    for rise in [0.5, 1.0, 2.0, 3.0, 5.0, 20.0] {
        for height_m in [0.1, 0.5] {
            let scene = roof(plane(20.0, -1.5, DVec2::new(0.1, 0.05)), rise, height_m);
            let bodies: Vec<_> = scene.obstacles.iter().collect();
            for ahead in [DVec2::X, DVec2::Y] {
                let surface = Surface::new(&scene).with(Rolling { bodies: &bodies, ahead, radius_m });
                let touch = |at: DVec2| surface.touch(at.x, at.y).expect("in the yard");
                let centre_m = |at: DVec2| {
                    let touch = touch(at);
                    touch.height_m + radius_m * (1.0 + touch.slope.length_squared()).sqrt()
                };
                let (mut told, mut off) = (0, 0);
                for x_m in [9.95, 10.0 + 0.3 * height_m / rise, 10.0 + height_m / rise] {
                    // Across the edge, from one side's reach to the other's.
                    let places = (0..100_000).map(|k| DVec2::new(x_m, 9.9 + step_m * f64::from(k)));
                    let heights_m: Vec<f64> = places.clone().map(centre_m).collect();
                    let most_m =
                        heights_m.windows(2).fold(0.0_f64, |most_m, pair| most_m.max((pair[1] - pair[0]).abs()));
                    // No step is higher than a few times the steepest flank, or the rim's tangent over a step, makes it.
                    let steepest = 4.0 * (height_m + 0.3) / (0.5 * radius_m);
                    assert!(
                        most_m < 3.0 * steepest * step_m + rise * (2.0 * radius_m * step_m).sqrt(),
                        "{rise} {height_m} {ahead} {x_m}: {most_m}"
                    );
                    for at in places.step_by(97) {
                        let hair = DVec2::new(0.0, 1e-8);
                        let sides = [centre_m(at + hair) - centre_m(at), centre_m(at) - centre_m(at - hair)]
                            .map(|rise_m| rise_m / hair.y);
                        // At a kink the two sides differ.
                        if (sides[0] - sides[1]).abs() < 1e-4 * (1.0 + sides[0].abs()) && touch(at).slope == DVec2::ZERO
                        {
                            told += 1;
                            off += u32::from((touch(at).gradient.y - sides[0]).abs() > 1e-3 * (1.0 + sides[0].abs()));
                        }
                    }
                }
                assert!(told > 300 && off == 0, "{rise} {height_m} {ahead}: {off} of {told}");
            }
        }
    }
}

#[test]
fn law_six_wheels_find_a_stand_beside_walls_of_every_height() {
    let rover = kapvik();
    let (mut stands, mut steep) = (0, 0);
    for seed in 0..20 {
        let scene = walled(seed);
        let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton).over_bodies(true);
        let draws = streams(seed).open(Purpose::StartHeading);
        for k in 0..200 {
            let place = |k: u64| 1.0 + (scene.extent_m - 2.0) * draws.uniform(k);
            let (x_m, y_m, yaw_rad) = (place(3 * k), place(3 * k + 1), 6.2 * draws.uniform(3 * k + 2));
            match contact.stand(x_m, y_m, yaw_rad, None) {
                Ok(_) => stands += 1,
                Err(DriveError::NoContact { reason, .. }) if reason.contains("steep") => steep += 1,
                Err(error) => panic!("{seed} {x_m} {y_m} {yaw_rad}: {error}"),
            }
        }
    }
    // The others tip over: a wheel high up on a wall.
    assert!(stands > 3000 && steep > 100, "{stands} {steep}");
}
