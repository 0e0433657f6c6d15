//! Brute force: the definitions node by node and heading by heading, bodies at many points, the contact solver itself.

use super::lattice::Lattice;
use super::params::Limits;
use super::tests::{SIZE_M, draws, judged, kapvik, least};
use super::*;
use crate::drive::params::ContactSolver;
use crate::drive::{GroundContact, Rover};
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::random::{Purpose, Stage, Streams};
use crate::scene::polynomial::term_count;
use crate::scene::{Class, Convex, Ground, Polynomial, Raster, Shape};

const SPACING_M: f64 = 0.05;

/// A hilly yard of 10 m, or the same with roughness of 2 cm on nodes of 5 cm, and stones in and on it.
fn yard(seed: u64, is_rough: bool) -> Scene {
    let stream = draws(seed);
    let coefficients = (0..term_count(5) as u64).map(|k| 0.06 * stream.normal(k)).collect();
    let hills = Polynomial::new(10.0, 5, coefficients);
    let ground = if is_rough {
        let node = |x: f64, y: f64| ((x * 20.0).round() * 1000.0 + (y * 20.0).round()) as u64;
        let rough = |x, y| hills.height_m(x, y) + 0.02 * stream.normal(100 + node(x, y));
        Ground::Raster(Raster::sampled(10.0, 0.05, rough))
    } else {
        Ground::Polynomial(hills)
    };
    (0..60).fold(Scene::bare(10.0, ground), |scene, stone| {
        let draw = |k: u64| stream.uniform(1_000_000 + 10 * stone + k);
        let half = DVec3::new(0.02 + 0.2 * draw(2), 0.02 + 0.2 * draw(3), 0.02 + 0.12 * draw(4));
        let (x, y) = (2.5 + 5.0 * draw(0), 2.5 + 5.0 * draw(1));
        let body = Convex::cuboid(DVec3::new(x, y, scene.ground_below_m(x, y)), half, 3.0 * draw(5));
        scene.with_obstacle(Class::Rock, Shape::Convex(body))
    })
}

/// The height of ground or bodies at a place, by the polygons of the bodies' faces.
fn top_m(scene: &Scene, x: f64, y: f64, ground_m: f64) -> f64 {
    let at = DVec2::new(x, y);
    let bodies = scene.obstacles.iter().filter_map(|obstacle| match &obstacle.body().shape {
        Shape::Convex(body) => Some(body),
        Shape::Cylinder(_) => None,
    });
    let faces = bodies.flat_map(|body| body.faces.iter().map(move |face| (body, face)));
    faces.fold(ground_m, |top_m, (body, face)| {
        let corner = |k: usize| body.vertices_m[face[k % face.len()] as usize];
        let sides = (0..face.len()).map(|k| (corner(k + 1) - corner(k)).truncate().perp_dot(at - corner(k).truncate()));
        // Counter-clockwise from above: an upper face, which has the place to the left of every edge.
        let normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
        if normal.z > 1e-12 && sides.clone().all(|side| side >= 0.0) {
            top_m.max(corner(0).z - normal.truncate().dot(at - corner(0).truncate()) / normal.z)
        } else {
            top_m
        }
    })
}

/// The definitions: nodes are (column, row) numbers of the whole map.
struct Definition<'a> {
    limits: Limits,
    ground_m: &'a dyn Fn([i64; 2]) -> f64,
    top_m: &'a dyn Fn([i64; 2]) -> f64,
}

impl Definition<'_> {
    fn margin_m(&self, [col, row]: [i64; 2]) -> f64 {
        let Limits { tilt, side_slip, belly_m, step_m, wheelbase_m, track_m, .. } = self.limits;
        let ground = |[c, r]: [i64; 2]| (self.ground_m)([col + c, row + r]);
        let top = |[c, r]: [i64; 2]| (self.top_m)([col + c, row + r]);
        let shared = |a: f64, b: f64| if a * b <= 0.0 { 0.0 } else { a.signum() * a.abs().min(b.abs()) };
        let mut margin_m = f64::INFINITY;
        for heading in 0..8 {
            let yaw_rad = f64::from(heading) * std::f64::consts::FRAC_PI_4;
            let (sin, cos) = math::sin_cos(yaw_rad);
            let wheel = |ahead_m: f64, aside_m: f64| {
                let nodes = if heading % 2 == 0 {
                    let (a, b) = ((ahead_m / SPACING_M).round(), (aside_m / SPACING_M).round());
                    [a * cos - b * sin, a * sin + b * cos]
                } else {
                    [ahead_m * cos - aside_m * sin, ahead_m * sin + aside_m * cos].map(|metres| metres / SPACING_M)
                };
                nodes.map(|nodes| nodes.round() as i64)
            };
            let (a_m, b_m) = (0.5 * wheelbase_m, 0.5 * track_m);
            let wheels = [wheel(a_m, b_m), wheel(a_m, -b_m), wheel(-a_m, b_m), wheel(-a_m, -b_m)];
            let [fl, fr, rl, rr] = wheels.map(ground);
            let between = |p: usize, q: usize| {
                let [p, q] = [wheels[p], wheels[q]];
                0.5 * SPACING_M * (((p[0] + q[0]).pow(2) + (p[1] + q[1]).pow(2)) as f64).sqrt()
            };
            let (own, ahead_m, aside_m) = (ground([0, 0]), between(0, 1), between(0, 2));
            let pitch = shared((0.5 * (fl + fr) - own) / ahead_m, (own - 0.5 * (rl + rr)) / ahead_m);
            let roll = shared((0.5 * (fl + rl) - own) / aside_m, (own - 0.5 * (fr + rr)) / aside_m);
            margin_m = margin_m.min((tilt - math::hypot(pitch, roll)) * wheelbase_m);
            margin_m = margin_m.min((side_slip - roll.abs()) * track_m);
            let explained_m = tilt * math::hypot(ahead_m, aside_m) + step_m;
            if [fl, fr, rl, rr].iter().all(|wheel_m| (wheel_m - own).abs() <= explained_m) {
                margin_m = margin_m.min(belly_m - (top([0, 0]) - 0.25 * (fl + fr + rl + rr)));
            }
            let step = [cos, sin].map(|share| (share * 1.2).round() as i64);
            for nodes in 1..=if heading % 2 == 0 { 2 } else { 1 } {
                let way_m = nodes as f64 * SPACING_M * math::hypot(step[0] as f64, step[1] as f64);
                let met_m = top(step.map(|along| nodes * along)) - top([0, 0]) - pitch * way_m;
                margin_m = margin_m.min(step_m - met_m.abs());
            }
        }
        margin_m
    }

    /// The worst of a cell's four nodes.
    fn of_cell(&self, index: CellIndex) -> f64 {
        let [col, row] = [index.col, index.row].map(|cell| 2 * i64::from(cell));
        let nodes = [[col, row], [col + 1, row], [col, row + 1], [col + 1, row + 1]];
        nodes.into_iter().map(|node| self.margin_m(node)).fold(f64::INFINITY, f64::min)
    }
}

#[test]
fn equal_verdicts_and_the_definitions_node_by_node() {
    let (mut cells, mut barred, mut differ) = (0, 0, 0);
    for seed in 0..4 {
        let scene = yard(seed, seed % 2 == 1);
        let placement = Placement::of(&Transform::IDENTITY, &Transform::IDENTITY);
        let mut lattice = Lattice::default();
        lattice.sample(&scene, &placement, SPACING_M, [40, 40], 120);
        bodies::raise(&scene, &placement, lattice.node_m(0, 0), lattice.node_m(119, 119), &mut lattice);
        let number = |[col, row]: [i64; 2]| ((row - 40) * 120 + col - 40) as usize;
        let ground_m = |[col, row]: [i64; 2]| {
            let [x, y] = [col, row].map(|node| (node as f64 + 0.5) * SPACING_M);
            scene.ground_below_m(x, y)
        };
        // The highest of a node's square at 7 x 7 places, of bodies alone.
        let dense_m: Vec<f64> = (0..120 * 120)
            .map(|at: i64| {
                let node = [40 + at % 120, 40 + at / 120];
                let places = (0..49).map(|k| [k % 7, k / 7].map(|part| f64::from(part) / 6.0));
                places.fold(ground_m(node), |top, [u, v]| {
                    let (x, y) = ((node[0] as f64 + u) * SPACING_M, (node[1] as f64 + v) * SPACING_M);
                    top.max(top_m(&scene, x, y, f64::NEG_INFINITY))
                })
            })
            .collect();
        for (at, (&found_m, &dense_m)) in lattice.top_m.iter().zip(&dense_m).enumerate() {
            let node = [40 + at as i64 % 120, 40 + at as i64 / 120];
            let [x, y] = node.map(|node| (node as f64 + 0.5) * SPACING_M);
            let middle_m = top_m(&scene, x, y, ground_m(node));
            // Stones' tops are level here: a node is as high as its middle, or as an edge that the places may just miss.
            assert!(found_m >= middle_m - 1e-9, "{node:?}: {found_m} {middle_m}");
            differ += usize::from((found_m - dense_m).abs() > 0.01);
        }
        let by_lattice = |node: [i64; 2]| lattice.top_m[number(node)];
        let definition = Definition { limits: kapvik(), ground_m: &ground_m, top_m: &by_lattice };
        for (index, crossing) in judged(kapvik(), &scene, 30..70, 30..70) {
            let margin_m = definition.of_cell(index);
            assert!((margin_m - f64::from(crossing.margin_m)).abs() < 1e-6, "{index:?}: {crossing:?} {margin_m}");
            cells += 1;
            barred += usize::from(margin_m < 0.0);
        }
    }
    assert!(cells == 6400 && (600..5000).contains(&barred), "{barred} of {cells}");
    // Squares whose corner alone a stone covers.
    assert!(differ < 4 * 120 * 120 / 50, "{differ}");
}

#[test]
fn law_on_smooth_ground_the_tilt_is_the_contact_solvers() {
    let rover: Rover = serde_saphyr::from_str(include_str!("../../../configs/rovers/kapvik.yaml")).expect("a rover");
    for seed in 0..3 {
        let stream = Streams { seed, scene: 0, attempt: 0, stage: Stage::Cells, step: 0 }.open(Purpose::GroundNoise);
        let coefficients = (0..term_count(5) as u64).map(|k| 0.08 * stream.normal(k)).collect();
        let scene = Scene::bare(10.0, Ground::Polynomial(Polynomial::new(10.0, 5, coefficients)));
        let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
        for (index, _) in judged(kapvik(), &scene, 30..70, 30..70).into_iter().step_by(37) {
            let (x, y) = crate::geometry::GridSpec { size_m: SIZE_M }.centre_m(index);
            let tilts = (0..8).map(|heading| {
                let yaw_rad = f64::from(heading) * std::f64::consts::FRAC_PI_4;
                let stance = contact.stand(x, y, crate::math::wrap_angle(yaw_rad), None).expect("a stance");
                math::acos(math::cos(stance.pose.pitch_rad) * math::cos(stance.pose.roll_rad))
            });
            let worst = math::tan(tilts.fold(0.0, f64::max));
            // Of a rule with the tilt limit alone the margin is the slope.
            let free = Limits { tilt: 9.0, side_slip: 1e3, belly_m: 1e3, step_m: 1e3, ..kapvik() };
            let at = judged(free, &scene, index.row..index.row + 1, index.col..index.col + 1)[0].1;
            let slope = 9.0 - f64::from(at.margin_m) / free.wheelbase_m;
            assert!((slope - worst).abs() < 0.06, "{index:?}: {slope} {worst}");
        }
    }
    assert!(least(kapvik(), &yard(1, true)).margin_m < 0.0);
}
