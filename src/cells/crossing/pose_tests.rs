//! The truth of the pose: closed forms from both sides, bounds against the solver, turned yards, extremes.

use super::params::Limits;
use super::tests::{draws, kapvik};
use super::*;
use crate::cells::fixtures::row_at;
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::scene::{Class, Convex, Ground, Polynomial, Raster, Shape};

const SIZE_M: f64 = 0.1;

pub(super) fn rover(yaml: &str) -> Rover {
    serde_saphyr::from_str(yaml).expect("a shipped rover")
}

fn shipped() -> [Rover; 2] {
    [include_str!("../../../configs/rovers/kapvik.yaml"), include_str!("../../../configs/rovers/husky-a200.yaml")]
        .map(rover)
}

/// Poses of a yard's cells, with the bounds or by the solver alone.
fn poses(
    rover: &Rover,
    limits: Limits,
    scene: &Scene,
    cells: &[(i32, i32)],
    has_bounds: bool,
) -> Vec<(CellIndex, PoseTruth)> {
    let rows = cells.iter().map(|&(row, col)| row_at(row, col));
    let mut cells = Cells { rows: rows.collect(), ..Cells::default() };
    let placement = Placement::of(&Transform::IDENTITY, &Transform::IDENTITY);
    let mut poses = PoseAssessor::new(rover, limits, scene);
    poses.has_bounds = has_bounds;
    let assessor = Assessor::new(limits, SIZE_M, scene, placement).with_poses(Some(poses));
    assessor.assess(&mut cells, &mut Scratch::default());
    cells.rows.iter().map(|row| (row.index, row.truth.pose.expect("poses were asked"))).collect()
}

fn middle(rover: &Rover, limits: Limits, scene: &Scene) -> PoseTruth {
    poses(rover, limits, scene, &[(50, 50)], true)[0].1
}

fn flat() -> Scene {
    Scene::bare(10.0, Ground::Polynomial(Polynomial::flat(10.0)))
}

#[test]
fn exact_a_plane_passes_up_to_the_tilt_and_across_up_to_the_side_slip() {
    for rover in shipped() {
        let slope = 0.4;
        let scene = Scene::bare(10.0, Ground::Polynomial(Polynomial::plane(10.0, 0.0, DVec2::new(slope, 0.0))));
        let with = |tilt, side_slip| middle(&rover, Limits { tilt, side_slip, ..kapvik() }, &scene);
        let all = with(slope + 1e-9, slope + 1e-9);
        assert_eq!(all.headings, 0xff, "{all:?}");
        assert!((f64::from(all.worst.expect("stands").tilt_rad) - math::atan(slope)).abs() < 1e-6);
        let none = with(slope - 1e-9, 1.0);
        assert_eq!((none.headings, none.cost, none.worst), (0, 1.0, None));
        // Along the slope alone: headings 0 and 180 degrees, whatever the side slip.
        assert_eq!(with(1.0, slope - 1e-9).headings & 0b0100_0100, 0);
        assert_eq!(with(1.0, 1e-9).headings, 0b0001_0001);
    }
}

#[test]
fn exact_a_box_under_the_belly_passes_up_to_its_clearance() {
    for rover in shipped() {
        let height_m = 0.08;
        let body = Convex::cuboid(DVec3::new(5.05, 5.05, 0.0), DVec3::new(0.06, 0.04, height_m), 0.3);
        let scene = flat().with_obstacle(Class::Box, Shape::Convex(body));
        let with = |belly_m| middle(&rover, Limits { belly_m, step_m: 1.0, ..kapvik() }, &scene);
        // Kapvik's middle wheels stand beside the box, on the ground: nothing but the belly meets it.
        assert_eq!(with(height_m + 1e-9).headings, 0xff);
        assert_eq!(with(height_m - 1e-9).headings, 0);
    }
}

#[test]
fn exact_a_wheel_on_a_box_lifts_a_rigid_rover_by_the_boxes_height() {
    let [_, husky] = shipped();
    // Both left wheels on a plank: the roll's sine is the height over the track.
    let plank = Convex::cuboid(DVec3::new(5.05, 5.05 + 0.2854, 0.0), DVec3::new(2.0, 0.1, 0.06), 0.0);
    let scene = flat().with_obstacle(Class::Box, Shape::Convex(plank));
    let contact = crate::drive::GroundContact::new(&husky, &scene, crate::drive::params::ContactSolver::GaussNewton);
    let stance = contact.over_bodies(true).stand(5.05, 5.05, 0.0, None).expect("a stance");
    assert!((math::sin(stance.pose.roll_rad).abs() - 0.06 / 0.5708).abs() < 1e-9, "{stance:?}");
    assert!(stance.contact.residual_m < 1e-9);
}

/// Hills, stones, and on every second yard roughness with a ditch.
fn yard(seed: u64) -> Scene {
    let stream = draws(seed);
    let hill = |x: f64, y: f64| 0.25 * math::sin(0.9 * x + seed as f64) * math::cos(0.7 * y);
    let node = |x: f64, y: f64| ((x * 20.0).round() * 1000.0 + (y * 20.0).round()) as u64;
    let ground = if seed.is_multiple_of(2) {
        let coefficients =
            (0..crate::scene::polynomial::term_count(5) as u64).map(|k| 0.06 * stream.normal(k)).collect();
        Ground::Polynomial(Polynomial::new(10.0, 5, coefficients))
    } else {
        let ditch = |x: f64| if (x - 6.0).abs() < 0.2 { 0.4 } else { 0.0 };
        let rough = |x, y| hill(x, y) + 0.01 * stream.normal(1000 + node(x, y)) - ditch(x);
        Ground::Raster(Raster::sampled(10.0, 0.05, rough))
    };
    (0..40).fold(Scene::bare(10.0, ground), |scene, stone| {
        let draw = |k: u64| stream.uniform(10_000_000 + 10 * stone + k);
        let half = DVec3::new(0.03 + 0.2 * draw(2), 0.03 + 0.2 * draw(3), 0.02 + 0.12 * draw(4));
        let (x, y) = (2.5 + 5.0 * draw(0), 2.5 + 5.0 * draw(1));
        let body = Convex::cuboid(DVec3::new(x, y, scene.ground_below_m(x, y)), half, 3.0 * draw(5));
        scene.with_obstacle(Class::Rock, Shape::Convex(body))
    })
}

#[test]
fn equal_bits_with_bounds_and_by_the_solver_at_every_heading() {
    let cells: Vec<(i32, i32)> =
        (22..78).step_by(3).flat_map(|row| (22..78).step_by(3).map(move |col| (row, col))).collect();
    let (mut headings, mut passable) = (0, 0);
    for (seed, rover) in (0..4).zip(shipped().iter().cycle()) {
        let scene = yard(seed);
        let limits = RoverRule::default().limits(rover).expect("limits");
        let [bounded, solved] = [true, false].map(|has| poses(rover, limits, &scene, &cells, has));
        for ((index, bounded), (_, solved)) in bounded.into_iter().zip(solved) {
            assert_eq!(bounded.headings, solved.headings, "yard {seed}, {index:?}: {bounded:?} {solved:?}");
            assert!((bounded.cost - solved.cost).abs() < 0.2, "yard {seed}, {index:?}: {bounded:?} {solved:?}");
            headings += 8;
            passable += bounded.headings.count_ones();
        }
    }
    assert!(passable > headings / 5 && passable < headings * 19 / 20, "{passable} of {headings}");
}

#[test]
fn law_a_yard_turned_by_a_quarter_has_the_headings_turned_by_two() {
    let [kapvik_rover, _] = shipped();
    let yard_of = |is_turned: bool| {
        let boxes = [(5.2, 5.3, 0.3), (4.7, 5.1, 1.1), (5.6, 4.6, 0.0), (4.4, 4.4, 0.7)];
        boxes.iter().fold(flat(), |scene, &(x, y, yaw_rad)| {
            let (x, y, yaw_rad) =
                if is_turned { (10.0 - y, x, yaw_rad + std::f64::consts::FRAC_PI_2) } else { (x, y, yaw_rad) };
            let body = Convex::cuboid(DVec3::new(x, y, 0.0), DVec3::new(0.12, 0.07, 0.07), yaw_rad);
            scene.with_obstacle(Class::Box, Shape::Convex(body))
        })
    };
    let cells: Vec<(i32, i32)> = (42..58).flat_map(|row| (42..58).map(move |col| (row, col))).collect();
    let turned_cells: Vec<(i32, i32)> = cells.iter().map(|&(row, col)| (col, 99 - row)).collect();
    let here = poses(&kapvik_rover, kapvik(), &yard_of(false), &cells, true);
    let there = poses(&kapvik_rover, kapvik(), &yard_of(true), &turned_cells, true);
    for ((index, a), (_, b)) in here.into_iter().zip(there) {
        assert_eq!(a.headings.rotate_left(2), b.headings, "{index:?}: {a:?} {b:?}");
        assert!((a.cost - b.cost).abs() < 1e-6, "{index:?}: {a:?} {b:?}");
    }
}

#[test]
fn extreme_no_rover_stands_on_no_ground_or_over_the_yards_edge() {
    let [kapvik_rover, _] = shipped();
    let at = |scene: &Scene, cell| poses(&kapvik_rover, kapvik(), scene, &[cell], true)[0].1;
    assert_eq!(at(&flat(), (50, 50)).headings, 0xff);
    assert!(at(&flat(), (50, 50)).cost < 1e-6);
    for cell in [(-3, 50), (50, 101), (0, 0), (1, 50)] {
        assert_ne!(at(&flat(), cell).headings, 0xff, "{cell:?}");
    }
    assert_eq!(at(&flat(), (-30, 50)), PoseTruth { headings: 0, cost: 1.0, worst: None });
    let hole =
        Scene::bare(10.0, Ground::Raster(Raster::sampled(10.0, 0.05, |x, _| if x > 5.0 { f64::NAN } else { 0.0 })));
    assert_eq!(at(&hole, (50, 52)).headings, 0);
    assert_eq!(at(&hole, (50, 30)).headings, 0xff);
}
