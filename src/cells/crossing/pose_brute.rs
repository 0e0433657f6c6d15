//! A second implementation of the stand and the belly, by dense points alone: what the contact solver and `clearance_m` are checked against.
//!
//! In: rovers of four and of six wheels, smooth ground and rasters, boxes. The wheel is the shape that `drive::rolled` documents (a ball flattened to
//! half its width, straight flanks from 75 degrees on, to the ground at the latest), held up by the highest of points that lie millimetres apart on the
//! bodies' upper faces and edges and on the ground. The stand of four wheels is the least sum of squares over z, pitch and roll by a search that halves its
//! steps; of six, which all touch, each wheel's centre is placed by turning links about their pivots, and must be where the points hold it. The
//! belly's clearance is the lowest of the same points below the plate. Nothing is shared with the solver but the rover's figures. Errors of the points:
//! below a millimetre on tops, below two beside walls.

use super::pose_tests::rover;
use super::tests::draws;
use crate::drive::params::ContactSolver;
use crate::drive::rover::Chassis;
use crate::drive::{ContactPose, GroundContact, Rover, clearance_m};
use crate::geometry::{DMat3, DVec2, DVec3};
use crate::math;
use crate::random::Stream;
use crate::scene::polynomial::term_count;
use crate::scene::{Class, Convex, Ground, Polynomial, Raster, Scene, Shape};

/// Points along edges, and across faces, metres.
const ALONG_M: f64 = 0.004;
const ACROSS_M: f64 = 0.012;

/// Nodes of the raster.
const RASTER_M: f64 = 0.05;

/// Stands that differ by less are one stand: what millimetres between points make of it.
const ALIKE_M: f64 = 0.002;
const ALIKE_RAD: f64 = 0.01;

/// A box's middle, half sides and yaw: its top is level.
type Box = (DVec3, DVec3, f64);

fn hills(seed: u64) -> Ground {
    let coefficients = (0..term_count(5) as u64).map(|k| 0.05 * draws(5000 + seed).normal(k)).collect();
    Ground::Polynomial(Polynomial::new(10.0, 5, coefficients))
}

/// Waves with roughness on every node, and ledges of up to three of Kapvik's wheels.
fn ledges(seed: u64) -> Ground {
    let stream = draws(5000 + seed);
    let height_m = move |x: f64, y: f64| {
        let node = ((x * 20.0).round() * 1000.0 + (y * 20.0).round()) as u64;
        let ledge_m = if (x + 0.4 * y).rem_euclid(2.0) < 1.0 { 0.3 * stream.uniform(1) } else { 0.0 };
        0.2 * math::sin(0.9 * x) * math::cos(0.7 * y) + 0.01 * stream.normal(1_000_000 + node) + ledge_m
    };
    Ground::Raster(Raster::sampled(10.0, RASTER_M, height_m))
}

/// Stones on the ground; the boxes that the scene's bodies were made of.
fn yard(ground: Ground, seed: u64) -> (Scene, Vec<Box>) {
    let stream = draws(5000 + seed);
    let mut scene = Scene::bare(10.0, ground);
    let mut boxes = Vec::new();
    for stone in 0..60 {
        let draw = |k: u64| stream.uniform(1000 + 10 * stone + k);
        let half = DVec3::new(0.05 + 0.25 * draw(2), 0.05 + 0.25 * draw(3), 0.02 + 0.1 * draw(4));
        let (x, y) = (2.0 + 6.0 * draw(0), 2.0 + 6.0 * draw(1));
        let at = DVec3::new(x, y, scene.ground_below_m(x, y));
        scene = scene.with_obstacle(Class::Rock, Shape::Convex(Convex::cuboid(at, half, 3.0 * draw(5))));
        boxes.push((at, half, 3.0 * draw(5)));
    }
    (scene, boxes)
}

/// Points on a box's top: dense along its edges, less so across it.
fn points_of(&(at, half, yaw_rad): &Box) -> Vec<DVec3> {
    let (sin, cos) = math::sin_cos(yaw_rad);
    let place = |x: f64, y: f64| at + DVec3::new(x * cos - y * sin, x * sin + y * cos, half.z);
    let spread = |half_m: f64, spacing_m: f64| {
        let count = (2.0 * half_m / spacing_m).ceil();
        (0..=count as u32).map(move |k| half_m * (2.0 * f64::from(k) / count - 1.0))
    };
    let mut points = Vec::new();
    for x in spread(half.x, ALONG_M) {
        points.extend([place(x, -half.y), place(x, half.y)]);
    }
    for y in spread(half.y, ALONG_M) {
        points.extend([place(-half.x, y), place(half.x, y)]);
    }
    for x in spread(half.x, ACROSS_M) {
        points.extend(spread(half.y, ACROSS_M).map(|y| place(x, y)));
    }
    points
}

struct Dense<'a> {
    scene: &'a Scene,
    points: Vec<DVec3>,
    /// Where the level rover's wheels stand, if it has four.
    wheels_m: [DVec2; 4],
    radius_m: f64,
}

impl Dense<'_> {
    /// The height of the centre of a wheel that a point holds, so far away from it, ahead and across, over a floor that would hold it at
    /// `floor_m`; the highest of what the point belongs to is at `top_m`.
    fn held_m(&self, point_m: f64, away: DVec2, floor_m: f64, top_m: f64) -> f64 {
        let far = math::hypot(away.x, 2.0 * away.y) / self.radius_m;
        let (sin, cos) = math::sin_cos(75_f64.to_radians());
        if far > 1.5 {
            f64::NEG_INFINITY
        } else if far > sin {
            let fall_m = (self.radius_m * (1.5 - sin) * sin / cos).max(top_m + self.radius_m * cos - floor_m);
            point_m + self.radius_m * cos - fall_m * (far - sin) / (1.5 - sin)
        } else {
            point_m + self.radius_m * (1.0 - far * far).sqrt()
        }
    }

    /// The height of a wheel's centre over a place: by the points, and by the ground's plane there.
    fn centre_m(&self, at: DVec2, ahead: DVec2) -> f64 {
        let ground_m = |at: DVec2| self.scene.ground_below_m(at.x, at.y);
        let near = self.points.iter().filter(|point| (point.truncate() - at).length() < 1.5 * self.radius_m);
        let by_points = |floor_m: f64, from_m: f64| {
            near.fold(from_m, |centre_m, point| {
                let away = point.truncate() - at;
                // Boxes are as high everywhere.
                centre_m.max(self.held_m(point.z, DVec2::new(ahead.dot(away), ahead.perp_dot(away)), floor_m, point.z))
            })
        };
        if matches!(self.scene.ground, Ground::Raster(_)) {
            // A raster holds a wheel along the heading, straight between grid lines.
            let floor_m = ground_m(at) + self.radius_m;
            let reach_m = 1.5 * self.radius_m;
            let lines = |from: f64, step: f64| {
                (-400..=400).map(move |line| (f64::from(line) * RASTER_M - from.rem_euclid(RASTER_M)) / step)
            };
            let mut ways_m: Vec<f64> = lines(at.x, ahead.x).chain(lines(at.y, ahead.y)).collect();
            ways_m.retain(|way_m| way_m.abs() < reach_m);
            ways_m.extend([-reach_m, 0.0, reach_m]);
            ways_m.sort_unstable_by(f64::total_cmp);
            let top_m = ways_m.iter().map(|&way_m| ground_m(at + ahead * way_m)).fold(f64::NEG_INFINITY, f64::max);
            let by_line = ways_m.windows(2).flat_map(|ends| {
                let heights_m = [ends[0], ends[1]].map(|way_m| ground_m(at + ahead * way_m));
                let (from_m, to_m) = (ends[0], ends[1]);
                (0..=100).map(move |k| {
                    let share = f64::from(k) / 100.0;
                    (from_m + (to_m - from_m) * share, heights_m[0] + (heights_m[1] - heights_m[0]) * share)
                })
            });
            let by_line =
                by_line.map(|(way_m, height_m)| self.held_m(height_m, DVec2::new(way_m, 0.0), floor_m, top_m));
            return by_points(floor_m, by_line.fold(floor_m, f64::max));
        }
        let hair_m = 1e-5;
        let slope = |by: DVec2| (ground_m(at + by * hair_m) - ground_m(at - by * hair_m)) / (2.0 * hair_m);
        let lean = (1.0 + DVec2::new(slope(DVec2::X), slope(DVec2::Y)).length_squared()).sqrt();
        let floor_m = ground_m(at) + self.radius_m * lean;
        by_points(floor_m, floor_m)
    }

    /// The sum of squares of a stand: how far its wheels' centres are from where they are held.
    fn cost(&self, at: DVec2, ahead: DVec2, [z_m, pitch_rad, roll_rad]: [f64; 3]) -> f64 {
        let [(sin_pitch, cos_pitch), (sin_roll, cos_roll)] = [pitch_rad, roll_rad].map(math::sin_cos);
        let off_m = self.wheels_m.iter().map(|wheel| {
            // Roll about the nose, then pitch about the axle, nose down positive.
            let rolled = DVec2::new(
                wheel.y * cos_roll - self.radius_m * sin_roll,
                wheel.y * sin_roll + self.radius_m * cos_roll,
            );
            let forward = wheel.x * cos_pitch + rolled.y * sin_pitch;
            let up = rolled.y * cos_pitch - wheel.x * sin_pitch;
            z_m + up - self.centre_m(at + ahead.rotate(DVec2::new(forward, rolled.x)), ahead)
        });
        off_m.map(|off_m| off_m * off_m).sum()
    }

    /// The least of the costs near a guess, by steps that halve.
    fn stand(&self, at: DVec2, ahead: DVec2, mut stance: [f64; 3]) -> ([f64; 3], f64) {
        let mut least = self.cost(at, ahead, stance);
        let mut step = 0.05;
        while step > 1e-5 {
            let mut is_better = false;
            for axis in 0..3 {
                for other in 0..3 {
                    for signs in [[1.0, 0.0], [-1.0, 0.0], [1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
                        let mut trial = stance;
                        trial[axis] += signs[0] * step;
                        trial[other] += signs[1] * step;
                        let cost = self.cost(at, ahead, trial);
                        if cost < least {
                            (stance, least, is_better) = (trial, cost, true);
                        }
                    }
                }
            }
            if !is_better {
                step *= 0.5;
            }
        }
        (stance, least)
    }
}

fn uniform(stream: &Stream, k: u64, low: f64, high: f64) -> f64 {
    low + (high - low) * stream.uniform(k)
}

#[test]
fn equal_stands_and_bellies_of_the_solver_and_of_dense_points() {
    let rovers = [
        include_str!("../../../configs/rovers/husky-a200.yaml"),
        include_str!("../../../configs/rovers/pioneer-3at.yaml"),
    ];
    let (mut stands, mut on_bodies, mut other) = (0, 0, 0);
    let (mut worst_m, mut worst_rad, mut worst_belly_m) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (seed, yaml) in (0..6).zip(rovers.into_iter().cycle()) {
        let rover: Rover = rover(yaml);
        let (scene, boxes) = yard(hills(seed), seed);
        let Chassis::Rigid(chassis) = &rover.chassis else { panic!("a rigid rover") };
        let (x, y) = (0.5 * chassis.wheelbase_m, 0.5 * chassis.track_m);
        let wheels_m = [(x, y), (x, -y), (-x, y), (-x, -y)].map(DVec2::from);
        let points: Vec<DVec3> = boxes.iter().flat_map(points_of).collect();
        let ground_alone = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
        let contact = ground_alone.clone().over_bodies(true);
        let stream = draws(7000 + seed);
        for k in 0..30 {
            let at = DVec2::new(uniform(&stream, 3 * k, 2.5, 7.5), uniform(&stream, 3 * k + 1, 2.5, 7.5));
            let yaw_rad = uniform(&stream, 3 * k + 2, -3.1, 3.1);
            let (sin, cos) = math::sin_cos(yaw_rad);
            let ahead = DVec2::new(cos, sin);
            let near = points.iter().copied().filter(|point| (point.truncate() - at).length() < 1.2).collect();
            let dense = Dense { scene: &scene, points: near, wheels_m, radius_m: rover.wheel_radius_m() };
            let Ok(found) = contact.stand(at.x, at.y, yaw_rad, None) else { continue };
            let pose = found.pose;
            let solved = [pose.position_m.z, pose.pitch_rad, pose.roll_rad];
            // From the ground's height, level: the search knows nothing of what the solver found.
            let from = [scene.ground_below_m(at.x, at.y) + 0.05, 0.0, 0.0];
            let (mut searched, mut cost) = dense.stand(at, ahead, from);
            let again = dense.stand(at, ahead, solved);
            // Beside walls a sum of squares may have two valleys.
            if again.1 < cost {
                (searched, cost) = again;
            }
            stands += 1;
            let on_ground = ground_alone.stand(at.x, at.y, yaw_rad, None).expect("hills").pose;
            on_bodies += u32::from((on_ground.position_m.z - solved[0]).abs() > 1e-3);
            let off_m = (searched[0] - solved[0]).abs();
            let off_rad = (searched[1] - solved[1]).abs().max((searched[2] - solved[2]).abs());
            let is_alike = off_m < ALIKE_M && off_rad < ALIKE_RAD;
            other += u32::from(!is_alike);
            if is_alike {
                (worst_m, worst_rad) = (worst_m.max(off_m), worst_rad.max(off_rad));
            } else {
                println!(
                    "{} {at} {yaw_rad}: {solved:?} {searched:?} {} {cost}",
                    rover.name,
                    dense.cost(at, ahead, solved)
                );
            }
            // The belly of the solver's own stand: points of bodies and of the ground, a centimetre apart, below the plate.
            let belly_m = rover.belly_clearance_m();
            let into = pose.transform().inverse();
            let half = 0.5 * DVec2::new(rover.length_m, rover.width_m);
            let grid =
                (0..100 * 100).map(|n| at + 0.016 * DVec2::new(f64::from(n % 100) - 49.5, f64::from(n / 100) - 49.5));
            let ground = grid.map(|at| at.extend(scene.ground_below_m(at.x, at.y)));
            let under = dense.points.iter().copied().chain(ground).map(|point| into.point(point));
            let inside = under.filter(|point| point.x.abs() <= half.x && point.y.abs() <= half.y);
            let searched_m = belly_m - inside.fold(f64::NEG_INFINITY, |highest_m, point| highest_m.max(point.z));
            let all: Vec<_> = scene.obstacles.iter().collect();
            match clearance_m(&rover, belly_m, &scene, &all, &pose) {
                Some(clearance_m) => worst_belly_m = worst_belly_m.max((clearance_m - searched_m).abs()),
                None => assert!(searched_m < 0.003, "{at} {yaw_rad}: touches, and {searched_m}"),
            }
        }
    }
    println!(
        "{stands} stands, {on_bodies} on bodies, {other} other; {worst_m} m, {worst_rad} rad, belly {worst_belly_m} m"
    );
    assert!(stands > 150 && on_bodies > 30, "{stands} {on_bodies}");
    assert!(worst_belly_m < 0.003, "{worst_belly_m}");
    assert_eq!(other, 0, "of {stands}");
}

/// Where the six wheels' centres are, in the world: each link turned about its pivot, nose down positive.
fn six_centres_m(rover: &Rover, stance: &ContactPose) -> Vec<DVec3> {
    let Chassis::RockerBogie(chassis) = &rover.chassis else { panic!("a rocker-bogie") };
    let ContactPose { pose, contact } = stance;
    let turned = |pivot: DVec3, angle_rad: f64, at: DVec3| pivot + DMat3::from_rotation_y(angle_rad) * (at - pivot);
    let mut centres_m = Vec::new();
    for (side, rocker_rad, bogie_rad) in
        [(1.0, contact.rocker_rad, contact.bogie_left_rad), (-1.0, -contact.rocker_rad, contact.bogie_right_rad)]
    {
        let y = 0.5 * side * chassis.track_m;
        let rocker_pivot = DVec3::new(chassis.rocker_pivot_x_m, y, chassis.rocker_pivot_z_m);
        let bogie_pivot = DVec3::new(chassis.bogie_pivot_x_m, y, chassis.bogie_pivot_z_m);
        let wheel = |x: f64| DVec3::new(x, y, rover.wheel_radius_m());
        centres_m.push(turned(rocker_pivot, rocker_rad, wheel(chassis.rocker_wheel_x_m)));
        for x in [chassis.bogie_front_x_m, chassis.bogie_rear_x_m] {
            centres_m.push(turned(rocker_pivot, rocker_rad, turned(bogie_pivot, bogie_rad, wheel(x))));
        }
    }
    centres_m.into_iter().map(|centre| pose.transform().point(centre)).collect()
}

#[test]
fn equal_six_wheels_are_where_dense_points_hold_them() {
    let rover = rover(include_str!("../../../configs/rovers/kapvik.yaml"));
    for (name, ground) in [("hills", hills as fn(u64) -> Ground), ("ledges", ledges)] {
        let (mut wheels, mut raised, mut worst_m) = (0, 0, 0.0_f64);
        for seed in 0..4 {
            let (scene, boxes) = yard(ground(seed), seed);
            let points: Vec<DVec3> = boxes.iter().flat_map(points_of).collect();
            let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton).over_bodies(true);
            let stream = draws(9000 + seed);
            for k in 0..40 {
                let at = DVec2::new(uniform(&stream, 3 * k, 2.5, 7.5), uniform(&stream, 3 * k + 1, 2.5, 7.5));
                let yaw_rad = uniform(&stream, 3 * k + 2, -3.1, 3.1);
                let (sin, cos) = math::sin_cos(yaw_rad);
                let ahead = DVec2::new(cos, sin);
                let near = points.iter().copied().filter(|point| (point.truncate() - at).length() < 1.2).collect();
                let dense =
                    Dense { scene: &scene, points: near, wheels_m: [DVec2::ZERO; 4], radius_m: rover.wheel_radius_m() };
                let Ok(stance) = contact.stand(at.x, at.y, yaw_rad, None) else { continue };
                for centre in six_centres_m(&rover, &stance) {
                    let off_m = (centre.z - dense.centre_m(centre.truncate(), ahead)).abs();
                    wheels += 1;
                    raised +=
                        u32::from(centre.z > scene.ground_below_m(centre.x, centre.y) + 1.2 * rover.wheel_radius_m());
                    worst_m = worst_m.max(off_m);
                    assert!(off_m < ALIKE_M, "{name} {at} {yaw_rad}: {centre} {off_m}");
                }
            }
        }
        println!("{name}: {wheels} wheels, {raised} raised, all within {worst_m} m");
        assert!(wheels > 900 && raised > 200, "{name} {wheels} {raised}");
    }
}
