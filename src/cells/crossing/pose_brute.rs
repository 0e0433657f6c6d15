//! A second implementation of the stand and the belly, by dense points alone: what the contact solver and `clearance_m` are checked against.
//!
//! In: a rigid rover of four wheels, smooth ground, boxes. The wheel is the shape that `drive::rolled` documents (a ball flattened to half its width,
//! straight flanks from 75 degrees on), held up by the highest of points that lie millimetres apart on the bodies' upper faces and edges and on the
//! ground; the stand is the least sum of squares over z, pitch and roll by a search that halves its steps; the belly's clearance is the lowest of the
//! same points below the plate. Nothing is shared with the solver but the rover's figures. Errors of the points: below a millimetre on tops, below two
//! beside walls.

use super::pose_tests::rover;
use super::tests::draws;
use crate::drive::params::ContactSolver;
use crate::drive::rover::Chassis;
use crate::drive::{GroundContact, Rover, clearance_m};
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::random::Stream;
use crate::scene::polynomial::term_count;
use crate::scene::{Class, Convex, Ground, Polynomial, Scene, Shape};

/// Points along edges, and across faces, metres.
const ALONG_M: f64 = 0.004;
const ACROSS_M: f64 = 0.012;

/// Stands that differ by less are one stand: what millimetres between points make of it.
const ALIKE_M: f64 = 0.002;
const ALIKE_RAD: f64 = 0.01;

/// A box's middle, half sides and yaw: its top is level.
type Box = (DVec3, DVec3, f64);

/// Hills and stones; the boxes that the scene's bodies were made of.
fn yard(seed: u64) -> (Scene, Vec<Box>) {
    let stream = draws(5000 + seed);
    let coefficients = (0..term_count(5) as u64).map(|k| 0.05 * stream.normal(k)).collect();
    let mut scene = Scene::bare(10.0, Ground::Polynomial(Polynomial::new(10.0, 5, coefficients)));
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
    /// Where the level rover's wheels stand.
    wheels_m: [DVec2; 4],
    radius_m: f64,
}

impl Dense<'_> {
    /// How much higher than a point the centre of a wheel is held that is so far away from it, ahead and across.
    fn held_m(&self, away: DVec2) -> f64 {
        let far = math::hypot(away.x, 2.0 * away.y) / self.radius_m;
        let (sin, cos) = math::sin_cos(75_f64.to_radians());
        if far > 1.5 {
            f64::NEG_INFINITY
        } else if far > sin {
            self.radius_m * (cos - (far - sin) * sin / cos)
        } else {
            self.radius_m * (1.0 - far * far).sqrt()
        }
    }

    /// The height of a wheel's centre over a place: by the points, and by the ground's plane there.
    fn centre_m(&self, at: DVec2, ahead: DVec2) -> f64 {
        let ground_m = self.scene.ground_below_m(at.x, at.y);
        let hair_m = 1e-5;
        let slope = |by: DVec2| {
            let [far, near] = [at + by * hair_m, at - by * hair_m].map(|at| self.scene.ground_below_m(at.x, at.y));
            (far - near) / (2.0 * hair_m)
        };
        let lean = (1.0 + DVec2::new(slope(DVec2::X), slope(DVec2::Y)).length_squared()).sqrt();
        let near = self.points.iter().filter(|point| (point.truncate() - at).length() < 1.5 * self.radius_m);
        near.fold(ground_m + self.radius_m * lean, |centre_m, point| {
            let away = point.truncate() - at;
            centre_m.max(point.z + self.held_m(DVec2::new(ahead.dot(away), ahead.perp_dot(away))))
        })
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
        let (scene, boxes) = yard(seed);
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
