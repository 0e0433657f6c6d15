//! Drives over passable headings: what a rover meets between the middles of the cells that the truth of the pose calls passable.
//!
//! In: random yards (hills, roughness, ditches and steps of every depth, stones, walls), the truth of the pose of their cells, straight ways from cell to
//! cell whose heading every cell on the way allows. The rover is set down by the contact solver every 1.7 cm of the way, between the
//! middles too. Out: how many drives break a limit, which, and by how much. `docs/labels.md` states what was found.

use super::params::Limits;
use super::tests::{SIZE_M, draws};
use super::*;
use crate::cells::fixtures::row_at;
use crate::drive::params::ContactSolver;
use crate::drive::{GroundContact, clearance_m};
use crate::geometry::DVec2;
use crate::math;
use crate::random::Stream;
use crate::scene::polynomial::term_count;
use crate::scene::{Class, Convex, Ground, Polynomial, Raster, Shape};

/// The rover stands this far apart along its way: no part of a cell.
const STEP_M: f64 = 0.017;
/// Cells of a yard of 10 m that are judged.
const CELLS: std::ops::Range<i32> = 20..80;
const SIDE: i32 = 60;

/// Of the drives: how many broke each limit anywhere, and how many broke any by more than the slack below.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Broken {
    drives: u32,
    stands: u32,
    tilt: u32,
    side_slip: u32,
    belly: u32,
    step: u32,
    no_stand: u32,
    any: u32,
    grossly: u32,
}

/// A limit that is broken by no more than this is broken by little: slope, metres.
const SLACK: f64 = 0.1;
const SLACK_M: f64 = 0.03;

fn yard(seed: u64) -> Scene {
    let stream = draws(seed);
    let hill = |x: f64, y: f64| 0.2 * math::sin(0.9 * x + seed as f64) * math::cos(0.7 * y);
    let ground = match seed % 4 {
        0 | 3 => {
            let coefficients = (0..term_count(5) as u64).map(|k| 0.06 * stream.normal(k)).collect();
            Ground::Polynomial(Polynomial::new(10.0, 5, coefficients))
        }
        kind => {
            let node = |x: f64, y: f64| ((x * 20.0).round() * 1000.0 + (y * 20.0).round()) as u64;
            let [width_m, depth_m, step_m] =
                [0.03 + 0.5 * stream.uniform(1), 0.3 * stream.uniform(2), 0.15 * stream.uniform(3)];
            let ditch =
                move |x: f64, y: f64| if (x - 6.0 + 0.3 * (y - 5.0)).abs() < 0.5 * width_m { depth_m } else { 0.0 };
            let ledge = move |y: f64| if kind == 2 && y > 5.5 { step_m } else { 0.0 };
            let height_m = |x, y| hill(x, y) + 0.006 * stream.normal(1000 + node(x, y)) - ditch(x, y) + ledge(y);
            Ground::Raster(Raster::sampled(10.0, 0.05, height_m))
        }
    };
    (0..40).fold(Scene::bare(10.0, ground), |scene, stone| {
        let draw = |k: u64| stream.uniform(10_000_000 + 10 * stone + k);
        let is_wall = stone < 3 && seed % 4 == 3;
        let half = if is_wall {
            DVec3::new(0.5 + draw(2), 0.05, 0.1 + draw(4))
        } else {
            DVec3::new(0.03 + 0.2 * draw(2), 0.03 + 0.2 * draw(3), 0.02 + 0.12 * draw(4))
        };
        let (x, y) = (2.0 + 6.0 * draw(0), 2.0 + 6.0 * draw(1));
        let body = Convex::cuboid(DVec3::new(x, y, scene.ground_below_m(x, y)), half, 3.0 * draw(5));
        scene.with_obstacle(Class::Rock, Shape::Convex(body))
    })
}

/// The highest of the ground and the bodies over a place.
fn top_m(scene: &Scene, at: DVec2) -> f64 {
    let bodies = scene.obstacles.iter().filter(|obstacle| !obstacle.is_beyond(at, 0.0));
    bodies.fold(scene.ground_below_m(at.x, at.y), |top_m, obstacle| match &obstacle.body().shape {
        Shape::Convex(body) => body.top_m(at).map_or(top_m, |body_m| top_m.max(body_m)),
        Shape::Cylinder(_) => top_m,
    })
}

/// One rover in one yard.
struct Driver<'a> {
    scene: &'a Scene,
    rover: &'a Rover,
    limits: Limits,
    contact: GroundContact<'a>,
    wheels_m: Vec<DVec2>,
}

impl Driver<'_> {
    /// Drives straight from a place; whether anything was broken goes to `broken`.
    fn drive(&self, from: DVec2, heading: usize, way_m: f64, broken: &mut Broken) {
        let yaw_rad = math::wrap_angle(heading as f64 * std::f64::consts::FRAC_PI_4);
        let (sin, cos) = math::sin_cos(yaw_rad);
        let ahead = DVec2::new(cos, sin);
        let mut here = Broken::default();
        for k in 0..=(way_m / STEP_M) as u32 {
            let at = from + ahead * (f64::from(k) * STEP_M);
            here.stands += 1;
            self.stand(at, ahead, yaw_rad, &mut here);
        }
        let Broken { tilt, side_slip, belly, step, no_stand, grossly, .. } = here;
        let is_any = tilt + side_slip + belly + step + no_stand > 0;
        broken.drives += 1;
        broken.stands += here.stands;
        for (sum, count) in [
            (&mut broken.tilt, tilt),
            (&mut broken.side_slip, side_slip),
            (&mut broken.belly, belly),
            (&mut broken.step, step),
            (&mut broken.no_stand, no_stand),
            (&mut broken.grossly, grossly),
            (&mut broken.any, u32::from(is_any)),
        ] {
            *sum += u32::from(count > 0);
        }
    }

    fn stand(&self, at: DVec2, ahead: DVec2, yaw_rad: f64, here: &mut Broken) {
        let limits = &self.limits;
        let bodies = self.contact.bodies_near(at, 0.0);
        let Ok(stance) = self.contact.stand_among(&bodies, [at.x, at.y, yaw_rad], None) else {
            println!("{} finds no stand at {at}, {yaw_rad} rad", self.rover.name);
            here.no_stand += 1;
            here.grossly += 1;
            return;
        };
        let pose = stance.pose;
        let cos_tilt = math::cos(pose.pitch_rad) * math::cos(pose.roll_rad);
        let slope = math::tan(math::acos(cos_tilt.min(1.0)));
        let side = math::sin(pose.roll_rad).abs() / cos_tilt;
        let clears = |belly_m: f64| clearance_m(self.rover, belly_m, self.scene, &bodies, &pose).is_some();
        let rise = -math::tan(pose.pitch_rad);
        let step_m = self
            .wheels_m
            .iter()
            .map(|&wheel| self.step_m(at + ahead.rotate(wheel), ahead, rise))
            .fold(0.0_f64, f64::max);
        here.tilt += u32::from(slope > limits.tilt);
        here.side_slip += u32::from(side > limits.side_slip);
        here.belly += u32::from(!clears(limits.belly_m));
        here.step += u32::from(step_m > limits.step_m);
        let is_gross = slope > limits.tilt + SLACK
            || side > limits.side_slip + SLACK
            || !clears(limits.belly_m + SLACK_M)
            || step_m > limits.step_m + SLACK_M;
        here.grossly += u32::from(is_gross);
    }
}

impl Driver<'_> {
    /// The step that a wheel meets within its radius along the way, less what the rover's own pitch makes of it; 0 within a gap that it bridges.
    fn step_m(&self, place: DVec2, ahead: DVec2, rise: f64) -> f64 {
        let Limits { wheel_radius_m, step_m, gap_m, .. } = self.limits;
        let level_m = |way_m: f64| {
            let at = place + ahead * way_m;
            top_m(self.scene, at) - rise * way_m
        };
        let [here_m, there_m] = [0.0, wheel_radius_m].map(level_m);
        let met_m = there_m - here_m;
        let is_bridged = (1..=(gap_m / 0.01) as u32).map(|k| 0.01 * f64::from(k)).any(|way_m| {
            // The far lip of what falls away, the near lip of what rises.
            if met_m < 0.0 {
                level_m(wheel_radius_m + way_m) >= here_m - step_m
            } else {
                level_m(-way_m) >= there_m - step_m
            }
        });
        if met_m.abs() > step_m && is_bridged { 0.0 } else { met_m.abs() }
    }
}

/// Draws drives of a rover through a yard until there are enough: by the truth of the pose alone, and by the cells' own labels too.
fn driven(seed: u64, rover: &Rover, wanted: u32, broken: &mut [Broken; 2]) {
    let scene = yard(seed);
    let limits = RoverRule::default().limits(rover).expect("limits");
    let rows = CELLS.flat_map(|row| CELLS.map(move |col| row_at(row, col)));
    let mut cells = Cells { rows: rows.collect(), ..Cells::default() };
    let placement = Placement::of(&Transform::IDENTITY, &Transform::IDENTITY);
    let poses = PoseAssessor::new(rover, limits, &scene);
    Assessor::new(limits, SIZE_M, &scene, placement)
        .with_poses(Some(poses))
        .assess(&mut cells, &mut Scratch::default());
    let contact = GroundContact::new(rover, &scene, ContactSolver::GaussNewton).over_bodies(true);
    let wheels_m = rover.wheel_shares().into_iter().map(|wheel| wheel.place_m).collect();
    let driver = Driver { scene: &scene, rover, limits, contact, wheels_m };
    for (by_cell, broken) in [false, true].into_iter().zip(broken) {
        let is_passable = |[col, row]: [i32; 2], heading: usize| {
            let is_judged = CELLS.contains(&col) && CELLS.contains(&row);
            is_judged && {
                let truth = &cells.rows[((row - CELLS.start) * SIDE + col - CELLS.start) as usize].truth;
                let pose = truth.pose.expect("poses were asked");
                let is_clear = !by_cell || truth.crossing.expect("a rover was asked").margin_m >= 0.0;
                pose.headings & (1 << heading) != 0 && is_clear
            }
        };
        let stream: Stream = draws(1_000_000 + seed);
        let (mut tries, mut made) = (0, 0);
        while made < wanted && tries < 100 * u64::from(wanted) {
            let first = 4 * tries;
            let draw = |k: u64| stream.uniform(first + k);
            tries += 1;
            let cell = [draw(0), draw(1)].map(|share| CELLS.start + (share * f64::from(SIDE)) as i32);
            let heading = (draw(2) * 8.0) as usize;
            let count = 3 + (draw(3) * 15.0) as i32;
            let [east, north] = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]][heading];
            if !(0..=count).all(|k| is_passable([cell[0] + k * east, cell[1] + k * north], heading)) {
                continue;
            }
            let from = (DVec2::new(f64::from(cell[0]), f64::from(cell[1])) + 0.5) * SIZE_M;
            let way_m = f64::from(count) * SIZE_M * f64::from(east * east + north * north).sqrt();
            driver.drive(from, heading, way_m, broken);
            made += 1;
        }
    }
}

fn shipped() -> [Rover; 2] {
    [include_str!("../../../configs/rovers/kapvik.yaml"), include_str!("../../../configs/rovers/husky-a200.yaml")]
        .map(|yaml| serde_saphyr::from_str(yaml).expect("a shipped rover"))
}

/// Half of the drives by each rover.
fn broken_of(yards: std::ops::Range<u64>, drives_a_yard: u32) -> [Broken; 2] {
    let rovers = shipped();
    let mut broken = [Broken::default(); 2];
    for seed in yards {
        for rover in &rovers {
            driven(seed, rover, drives_a_yard / 2, &mut broken);
        }
    }
    for (name, broken) in ["by poses", "by poses and cells"].into_iter().zip(&broken) {
        println!("{name}: {broken:?}");
    }
    broken
}

/// What `docs/labels.md` promises: no limit is broken anywhere.
fn check(broken: &Broken, least: u32) {
    let Broken { drives, stands, .. } = *broken;
    assert!(drives >= least, "{broken:?}");
    assert_eq!(*broken, Broken { drives, stands, ..Broken::default() });
}

#[test]
fn law_drives_over_passable_headings_keep_the_limits() {
    for broken in broken_of(0..4, 130) {
        check(&broken, 500);
    }
}

#[test]
#[ignore = "takes minutes: cargo test --release --lib ten_thousand_drives -- --ignored --nocapture"]
fn law_ten_thousand_drives_over_passable_headings_keep_the_limits() {
    for broken in broken_of(0..50, 200) {
        check(&broken, 9500);
    }
}
