//! Cells of real sweeps against closed forms and against geometry that knows nothing of the sweep's truth columns.

use std::sync::Arc;
use std::time::Instant;

use marsyard::cells::{self, CellParams, Cells, Scratch, WindowScan};
use marsyard::geometry::{DVec3, Pose, Transform};
use marsyard::math;
use marsyard::preset::Preset;
use marsyard::random::{Dist, Drawn, Stage, Streams};
use marsyard::scene::params::{BoxesParams, RocksParams, TreesParams};
use marsyard::scene::{self, Class, Ground, Polynomial, Scene, SceneParams, Shape};
use marsyard::slam::{self, Estimate};
use marsyard::sweep::params::Cast;
use marsyard::sweep::{self, Caster, Pattern, Sensor, Status, Sweep, SweepParams};

fn streams(scene: u64, stage: Stage) -> Streams {
    Streams { seed: 3, scene, attempt: 0, stage, step: 0 }
}

fn urg() -> SweepParams {
    let sensor: Sensor = serde_saphyr::from_str(include_str!("../../configs/sensors/urg-04lx.yaml")).expect("a sensor");
    SweepParams { sensor: Preset::Inline(Box::new(sensor)), ..SweepParams::default() }
}

/// An exact sweep and its true pose as the estimate.
fn swept(scene: &Scene, pose: &Pose, rover_from_sensor: &Transform) -> (Sweep, Estimate, Transform) {
    let params = urg();
    let pattern = Arc::new(Pattern::build(&params.sensor).expect("a pattern"));
    let caster = Caster::new(scene, &Cast::Exact);
    let world_from_sensor = pose.transform() * *rover_from_sensor;
    let (drawn, streams) = (Drawn::default(), streams(0, Stage::Sweep));
    let sweep = sweep::sweep(&params, &pattern, &caster, &world_from_sensor, &drawn, &streams, &mut Default::default());
    (sweep.expect("a sweep"), slam::truth(pose), world_from_sensor)
}

fn head(height_m: f64) -> Transform {
    Transform { translation_m: DVec3::new(0.0, 0.0, height_m), ..Transform::IDENTITY }
}

/// A tilted scanner sends one beam per tilt step times beam step. On a plane h below the head the beam (tilt t, bearing b)
/// meets x = h / tan t, y = h tan b / sin t, so a square metre at (x, y) holds s^3 c^2 / (h^2 dt db) points with
/// s = sin t = h / sqrt(x^2 + h^2) and c = cos b, cos^2 b = 1 / (1 + (y s / h)^2).
#[test]
fn law_points_a_cell_on_flat_ground_follow_the_tilted_scanners_density() {
    let scene = Scene::bare(20.0, Ground::Polynomial(Polynomial::flat(20.0)));
    let (h, tilt_step, beam_step) = (0.4, 0.5_f64.to_radians(), (360.0 / 1024.0_f64).to_radians());
    let pose = Pose { position_m: DVec3::new(5.0, 10.0, 0.0), ..Pose::default() };
    let (sweep, estimate, world_from_sensor) = swept(&scene, &pose, &head(h));
    let params = CellParams::default();
    let scan = WindowScan { sweep: &sweep, estimate: &estimate, map_from_sensor: world_from_sensor, world_from_sensor };
    let cells = cells::bin(&params, &[scan], 0.1, 5.6, &scene, &mut Scratch::default());
    let counted = |from: i32, to: i32| -> f64 {
        let near =
            |r: &&cells::CellRow| (from..to).contains(&(r.index.col - 50)) && (-10..10).contains(&(r.index.row - 100));
        cells.rows.iter().filter(near).map(|r| f64::from(r.points)).sum()
    };
    let density = |x: f64, y: f64| {
        let s = h / (x * x + h * h).sqrt();
        let c2 = 1.0 / (1.0 + (y * s / h) * (y * s / h));
        s * s * s * c2 / (h * h * tilt_step * beam_step)
    };
    for (from, to) in [(5, 10), (10, 20), (20, 30), (30, 40)] {
        let mut law = 0.0;
        for col in 0..(to - from) * 10 {
            let x = f64::from(from) * 0.1 + (f64::from(col) + 0.5) * 0.01;
            law += (0..200).map(|k| density(x, (f64::from(k) + 0.5) * 0.01 - 1.0) * 1e-4).sum::<f64>();
        }
        let counted = counted(from, to);
        println!("{from}..{to}: counted {counted}, law {law:.1}");
        // A strip holds whole lines only: half a line at each end.
        let (first, last) = (math::atan2(h, f64::from(from) * 0.1), math::atan2(h, f64::from(to) * 0.1));
        let lines = (first - last) / tilt_step;
        assert!((counted / law - 1.0).abs() < 1.0 / lines, "{from}..{to}: {counted} points, the law says {law}");
    }
    // By hand, straight ahead: lines lie (x^2 + h^2) dt / h apart, beams sqrt(x^2 + h^2) db, and a cell has 0.01 m2.
    for (x, points) in [(1.0, 59.8), (2.0, 8.80), (3.0, 2.69)] {
        assert!((density(x, 0.0) * 0.01 / points - 1.0).abs() < 0.01);
    }
}

fn stony_yard(scene: u64) -> Scene {
    let rocks: RocksParams =
        serde_saphyr::from_str("{count: 120, diameter_m: {log_uniform: [0.05, 1.0]}}").expect("rocks");
    let constant = |value| Dist::Constant(value);
    let params = SceneParams {
        extent_m: 20.0,
        ground: Default::default(),
        rocks: Some(rocks),
        boxes: Some(BoxesParams {
            count: constant(12.0),
            length_m: constant(0.5),
            width_m: constant(0.4),
            height_m: constant(0.08),
        }),
        trees: Some(TreesParams {
            count: constant(12.0),
            diameter_m: constant(0.25),
            height_m: constant(2.0),
            crown: None,
        }),
        vegetation: None,
    };
    let streams = streams(scene, Stage::Scene);
    scene::build(&params, &Drawn::draw(&streams, params.dists()), &streams).expect("a yard")
}

/// How far outside a body a point lies: 0 on it, by its planes or its mantle, whoever cast the ray.
fn outside_m(shape: &Shape, p: DVec3) -> f64 {
    match shape {
        Shape::Convex(c) => c.planes.iter().map(|f| f.normal.dot(p) + f.offset_m).fold(f64::NEG_INFINITY, f64::max),
        Shape::Cylinder(c) => {
            let from_axis_m = (p - c.base_m).truncate().length() - c.radius_m;
            from_axis_m.max(p.z - c.base_m.z - c.height_m).max(c.base_m.z - p.z)
        }
    }
}

fn cells_of(scene: &Scene, params: &CellParams, pose: &Pose) -> Option<(Sweep, Cells, Transform)> {
    let caster = Caster::new(scene, &Cast::Exact);
    let mount = head(0.4);
    let world_from_sensor = pose.transform() * mount;
    caster.inside(world_from_sensor.translation_m).is_none().then(|| {
        let (sweep, estimate, _) = swept(scene, pose, &mount);
        let scan =
            WindowScan { sweep: &sweep, estimate: &estimate, map_from_sensor: world_from_sensor, world_from_sensor };
        let cells = cells::bin(params, &[scan], 0.1, 5.6, scene, &mut Scratch::default());
        (sweep, cells, world_from_sensor)
    })
}

#[test]
fn equal_labels_agree_with_where_the_points_lie() {
    let params: CellParams = serde_saphyr::from_str("{labels: {max_ground_slope_deg: 8}}").expect("cells");
    let (mut both, mut dark, mut steep) = (0, 0, 0);
    for number in 0..40 {
        let scene = stony_yard(number);
        let yaw_rad = 0.7 * number as f64;
        let (x, y) = (6.0 + 0.2 * number as f64, 14.0 - 0.2 * number as f64);
        let position_m = DVec3::new(x, y, scene.ground.height_m(x, y));
        let pose = Pose { position_m, yaw_rad, pitch_rad: 0.05, roll_rad: -0.03 };
        let Some((sweep, cells, world_from_sensor)) = cells_of(&scene, &params, &pose) else { continue };
        let mut obstacle = std::collections::BTreeMap::new();
        for slot in (0..sweep.returns.status.len()).filter(|&s| sweep.returns.status[s] == Status::Hit) {
            let p = world_from_sensor.point(sweep.returns.pattern.directions[slot] * sweep.returns.range_m[slot]);
            let cell = ((p.y / 0.1).floor() as i32, (p.x / 0.1).floor() as i32);
            let touched = scene.obstacles.iter().find(|o| outside_m(&o.body().shape, p).abs() < 1e-8);
            let entry = obstacle.entry(cell).or_insert((false, 0.0_f64));
            match touched {
                Some(o) => entry.0 |= o.body().protrusion_m > 0.1,
                None => {
                    let step = 1e-5;
                    let height = |dx: f64, dy: f64| scene.ground.height_m(p.x + dx, p.y + dy);
                    let slope_x = (height(step, 0.0) - height(-step, 0.0)) / (2.0 * step);
                    let slope_y = (height(0.0, step) - height(0.0, -step)) / (2.0 * step);
                    entry.1 = entry.1.max(math::atan(math::hypot(slope_x, slope_y)).to_degrees());
                }
            }
        }
        assert_eq!(cells.rows.len(), obstacle.len());
        for row in &cells.rows {
            let (obstacle, slope_deg) = obstacle[&(row.index.row, row.index.col)];
            assert!((f64::from(row.truth.slope_rad).to_degrees() - slope_deg).abs() < 1e-4, "{slope_deg}");
            if (slope_deg - 8.0).abs() > 1e-4 {
                assert_eq!(
                    row.label,
                    Some(cells::Label::untraversable_if(obstacle || slope_deg > 8.0)),
                    "yard {number}, {row:?}"
                );
            }
            dark += usize::from(obstacle);
            steep += usize::from(slope_deg > 8.0);
        }
        both += usize::from(obstacle.values().any(|c| c.0) && obstacle.values().any(|c| !c.0));
    }
    println!("{both} sweeps with both classes, {dark} cells with obstacles, {steep} steep");
    assert!(both > 25 && dark > 2000 && steep > 2000);
}

/// No claim but the printed one: cells of a whole URG sweep, every beam of which returns.
#[test]
fn rate_of_a_full_sweep_is_printed() {
    let scene = stony_yard(1);
    let position_m = DVec3::new(10.0, 10.0, scene.ground.height_m(10.0, 10.0));
    let (mut sweep, estimate, world_from_sensor) = swept(&scene, &Pose { position_m, ..Pose::default() }, &head(0.4));
    let ground = Some(Class::Ground);
    for slot in 0..sweep.returns.status.len() {
        if sweep.returns.status[slot] != Status::Hit {
            sweep.returns.status[slot] = Status::Hit;
            sweep.returns.range_m[slot] = 1.0 + 4.0 * (slot % 97) as f64 / 97.0;
            sweep.truth[slot] =
                sweep::TrueReturn { range_m: sweep.returns.range_m[slot], object: -1, class: ground, top: false };
        }
    }
    let scan = WindowScan { sweep: &sweep, estimate: &estimate, map_from_sensor: world_from_sensor, world_from_sensor };
    let mut scratch = Scratch::default();
    let mut best_ms = f64::INFINITY;
    let mut rows = 0;
    for _ in 0..30 {
        let start = Instant::now();
        rows = cells::bin(&CellParams::default(), &[scan], 0.1, 5.6, &scene, &mut scratch).rows.len();
        best_ms = best_ms.min(start.elapsed().as_secs_f64() * 1e3);
    }
    println!("{} points into {rows} cells: {best_ms:.2} ms", sweep.returns.status.len());
}
