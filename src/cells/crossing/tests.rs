//! Closed forms at the limits from both sides, and laws of turned yards.

use super::kernel::{Demands, Run};
use super::lattice::Lattice;
use super::params::Limits;
use super::*;
use crate::cells::fixtures::row_at;
use crate::cells::level::level;
use crate::geometry::{DVec2, DVec3, Pose};
use crate::math;
use crate::random::{Purpose, Stage, Stream, Streams};
use crate::scene::{Class, Convex, Ground, Polynomial, Raster, Shape};

pub(super) const SIZE_M: f64 = 0.1;
/// What stands beyond every closed form here.
const HAIR_M: f64 = 1e-9;

/// Kapvik's geometry, with limits that nothing reaches.
fn free() -> Limits {
    Limits {
        tilt: 2.0,
        side_slip: 2.0,
        belly_m: 5.0,
        step_m: 5.0,
        gap_m: 5.0,
        wheel_radius_m: 0.05,
        wheelbase_m: 0.6,
        track_m: 0.55,
        length_m: 0.8,
    }
}

/// What Kapvik's file says.
pub(super) fn kapvik() -> Limits {
    Limits { tilt: math::tan(0.5), side_slip: math::tan(0.4), belly_m: 0.15, step_m: 0.1, gap_m: 0.1, ..free() }
}

fn cells_of(rows: std::ops::Range<i32>, cols: std::ops::Range<i32>) -> Cells {
    let rows = rows.flat_map(|row| cols.clone().map(move |col| row_at(row, col))).collect();
    Cells { rows, ..Cells::default() }
}

/// The verdicts of a yard's cells by a map that lies as the world does.
pub(super) fn judged(
    limits: Limits,
    scene: &Scene,
    rows: std::ops::Range<i32>,
    cols: std::ops::Range<i32>,
) -> Vec<(CellIndex, Crossing)> {
    let mut cells = cells_of(rows, cols);
    let placement = Placement::of(&Transform::IDENTITY, &Transform::IDENTITY);
    Assessor::new(limits, SIZE_M, scene, placement).assess(&mut cells, &mut Scratch::default());
    let verdict = |row: &CellRow| (row.index, row.truth.crossing.expect("a rover was asked"));
    cells.rows.iter().map(verdict).collect()
}

/// The smallest margin around the middle of a yard of 10 m.
pub(super) fn least(limits: Limits, scene: &Scene) -> Crossing {
    let verdicts = judged(limits, scene, 30..70, 30..70);
    verdicts.into_iter().map(|(_, crossing)| crossing).min_by(|a, b| a.margin_m.total_cmp(&b.margin_m)).expect("cells")
}

fn flat() -> Scene {
    Scene::bare(10.0, Ground::Polynomial(Polynomial::flat(10.0)))
}

fn raster(spacing_m: f64, height_m: impl Fn(f64, f64) -> f64) -> Scene {
    Scene::bare(10.0, Ground::Raster(Raster::sampled(10.0, spacing_m, height_m)))
}

pub(super) fn draws(seed: u64) -> Stream {
    Streams { seed, scene: 0, attempt: 0, stage: Stage::Cells, step: 0 }.open(Purpose::GroundNoise)
}

/// A limit a hair above what the yard demands is kept, one a hair below is not: (with this much room, what is nearest then).
fn turns_at(demand: f64, scene: &Scene, with: impl Fn(f64) -> Limits, limits: &[Limit]) {
    let (above, below) = (least(with(demand + HAIR_M), scene), least(with(demand - HAIR_M), scene));
    assert!(above.margin_m >= 0.0 && above.margin_m < 1e-7, "{demand}: {above:?}");
    assert!(below.margin_m < 0.0 && below.margin_m > -1e-7, "{demand}: {below:?}");
    assert!(limits.contains(&above.limit) && limits.contains(&below.limit), "{above:?} {below:?}");
}

#[test]
fn exact_a_step_of_a_platform_passes_up_to_the_limit() {
    for height_m in [0.03, 0.1, 0.4] {
        let platform = Convex::cuboid(DVec3::new(5.0, 5.0, 0.0), DVec3::new(1.0, 1.2, height_m), 0.0);
        let scene = flat().with_obstacle(Class::Box, Shape::Convex(platform));
        turns_at(height_m, &scene, |step_m| Limits { step_m, ..free() }, &[Limit::Climb, Limit::Drop]);
    }
    // The wheel climbs from beside a platform lower than the belly and drops from its rim; its middle is crossed as level ground is.
    let platform = Convex::cuboid(DVec3::new(5.0, 5.0, 0.0), DVec3::new(0.99, 0.99, 0.13), 0.0);
    let scene = flat().with_obstacle(Class::Box, Shape::Convex(platform));
    for (index, crossing) in judged(kapvik(), &scene, 30..70, 50..51) {
        let beyond = match index.row {
            39 | 60 => Some(Limit::Climb),
            40 | 59 => Some(Limit::Drop),
            _ => None,
        };
        assert_eq!((crossing.margin_m < 0.0).then_some(crossing.limit), beyond, "{index:?} {crossing:?}");
    }
    // Wheels stand on the ground: the belly touches all of a higher one.
    let platform = Convex::cuboid(DVec3::new(5.0, 5.0, 0.0), DVec3::new(1.0, 1.0, 0.4), 0.0);
    let scene = flat().with_obstacle(Class::Box, Shape::Convex(platform));
    assert!(judged(kapvik(), &scene, 40..60, 40..60).iter().all(|(_, crossing)| crossing.margin_m < 0.0));
}

#[test]
fn exact_a_plane_passes_up_to_the_tilt_and_to_the_side_slip() {
    for slope_deg in [1.0, 15.0, 30.0_f64] {
        let slope = math::tan(slope_deg.to_radians());
        for along in [DVec2::X, DVec2::NEG_Y, DVec2::ONE.normalize()] {
            let scene = Scene::bare(10.0, Ground::Polynomial(Polynomial::plane(10.0, 0.3, along * slope)));
            turns_at(slope, &scene, |tilt| Limits { tilt, ..free() }, &[Limit::Tilt]);
            turns_at(slope, &scene, |side_slip| Limits { side_slip, ..free() }, &[Limit::SideSlip]);
        }
    }
    // A slope is no step, however large the wheels are.
    let scene = Scene::bare(10.0, Ground::Polynomial(Polynomial::plane(10.0, 0.0, DVec2::new(0.4, 0.3))));
    let large = least(Limits { step_m: HAIR_M, wheel_radius_m: 0.3, ..free() }, &scene);
    assert!(large.margin_m > 0.0, "{large:?}");
}

#[test]
fn exact_a_ridge_passes_up_to_the_belly() {
    for slope in [0.1, 0.3] {
        // A roof whose ridge lies on nodes; the outermost wheels stand six nodes of 0.05 m to either side of it.
        for along_y in [false, true] {
            let scene = raster(0.025, |x, y| -slope * (if along_y { y } else { x } - 5.025_f64).abs());
            turns_at(0.3 * slope, &scene, |belly_m| Limits { belly_m, ..free() }, &[Limit::Belly]);
        }
    }
}

#[test]
fn exact_a_wedge_passes_up_to_what_it_rises_within_a_wheels_reach() {
    for slope in [0.5, 1.5] {
        // From a foot on a node, up over more than a rover's length, to a plateau.
        let scene = raster(0.025, |x, _| slope * (x - 4.525).clamp(0.0, 1.0));
        turns_at(slope * 0.1, &scene, |step_m| Limits { step_m, tilt: 9.0, ..free() }, &[Limit::Climb, Limit::Drop]);
    }
}

/// A ditch of vertical walls but for one node of the raster, `width_m` at its mouth, around x = 5 m turned by an angle.
fn ditch(width_m: f64, yaw_rad: f64, depth_m: f64) -> Scene {
    let (sin, cos) = math::sin_cos(yaw_rad);
    raster(0.025, |x, y| {
        let across_m = (x - 5.0) * cos + (y - 5.0) * sin;
        if across_m.abs() < 0.5 * width_m { -depth_m } else { 0.0 }
    })
}

#[test]
fn exact_a_gap_passes_up_to_its_width_whatever_its_depth() {
    for depth_m in [0.2, 1.0, 3.0] {
        for nodes in [3, 9, 14] {
            // The nodes below lie within (5 - width / 2, 5 + width / 2); the walls fall from the nodes beside them, so that the level of
            // a step below the lips lies a share of a node within.
            let mouth_m = 0.025 * f64::from(nodes) * 2.0 - 0.01;
            let below = (0.5 * mouth_m / 0.025).ceil() - 1.0;
            let width_m = 2.0 * (below + 1.0 - 0.1 / depth_m) * 0.025;
            let scene = ditch(mouth_m, 0.0, depth_m);
            turns_at(width_m, &scene, |gap_m| Limits { gap_m, step_m: 0.1, ..free() }, &[Limit::Gap]);
        }
    }
}

#[test]
fn law_a_turned_ditch_is_a_gap_about_as_wide_as_its_shortest_crossing() {
    let stream = draws(5);
    for k in 0..12 {
        let yaw_rad = std::f64::consts::TAU * stream.uniform(2 * k);
        let mouth_m = 0.15 + 0.4 * stream.uniform(2 * k + 1);
        let scene = ditch(mouth_m, yaw_rad, 1.0);
        let quarter = std::f64::consts::FRAC_PI_4;
        let off_axis = (yaw_rad / quarter - (yaw_rad / quarter).round()) * quarter;
        let crossing_m = mouth_m / math::cos(off_axis);
        let bridged = least(Limits { gap_m: crossing_m + 0.07, step_m: 0.1, ..free() }, &scene);
        let open = judged(Limits { gap_m: crossing_m - 0.08, step_m: 0.1, ..free() }, &scene, 49..51, 49..51);
        assert!(bridged.margin_m >= 0.0, "{k}: {bridged:?}");
        assert!(
            open.iter().all(|(_, crossing)| crossing.margin_m < 0.0 && crossing.limit == Limit::Gap),
            "{k}: {open:?}"
        );
    }
}

#[test]
fn law_a_hole_wider_than_the_rover_is_a_ring_of_drops_and_climbs() {
    let scene = raster(0.025, |x, y| if math::hypot(x - 5.0, y - 5.0) < 1.0 { -0.5 } else { 0.0 });
    for (index, crossing) in judged(kapvik(), &scene, 30..70, 30..70) {
        let grid = crate::geometry::GridSpec { size_m: SIZE_M };
        let (x, y) = grid.centre_m(index);
        let away_m = (math::hypot(x - 5.0, y - 5.0) - 1.0).abs();
        if away_m < 0.05 {
            assert!(crossing.margin_m < 0.0, "the rim at {index:?}: {crossing:?}");
        } else if away_m > 0.3 {
            assert!(crossing.margin_m >= 0.0, "{index:?}: {crossing:?}");
        }
    }
}

#[test]
fn exact_grass_and_crowns_are_not_solid_and_marked_plants_bar() {
    let truth = |class, obstacle_points, margin_m| CellTruth {
        class: Some(class),
        obstacle_points,
        crossing: Some(Crossing { margin_m, limit: Limit::Climb }),
        ..CellTruth::default()
    };
    assert!(!truth(Class::Grass, 0, 0.1).bars_rover() && truth(Class::Bush, 2, 0.1).bars_rover());
    // A rock that the rule by points calls an obstacle, and the rover does not.
    assert!(!truth(Class::Rock, 5, 0.0).bars_rover() && truth(Class::Rock, 0, -1e-9).bars_rover());
}

/// Rough ground with a ditch and stones, and the same turned by a quarter about the yard's middle.
fn turned_pair(seed: u64) -> [Scene; 2] {
    let stream = draws(seed);
    let rough = |x: f64, y: f64| {
        let node = ((x * 20.0).round() * 1000.0 + (y * 20.0).round()) as u64;
        let ditch_m = if (x + 0.3 * y - 6.0).abs() < 0.1631 { 0.4 } else { 0.0 };
        0.3 * math::sin(0.9 * x) * math::cos(0.7 * y) + 0.01 * stream.normal(1000 + node) - ditch_m
    };
    // (x, y) of the yard stands at (10 - y, x) of the turned one.
    let mut yards = [raster(0.05, rough), raster(0.05, |x, y| rough(y, 10.0 - x))];
    for stone in 0..30 {
        let draw = |k: u64| stream.uniform(10 * stone + k);
        let half = DVec3::new(0.03 + 0.2 * draw(2), 0.03 + 0.2 * draw(3), 0.02 + 0.15 * draw(4));
        let (x, y, yaw_rad) = (10.0 * draw(0), 10.0 * draw(1), 3.0 * draw(5));
        let z_m = yards[0].ground_below_m(x, y);
        let places = [(x, y, yaw_rad), (10.0 - y, x, yaw_rad + std::f64::consts::FRAC_PI_2)];
        for (yard, (x, y, yaw_rad)) in yards.iter_mut().zip(places) {
            let body = Convex::cuboid(DVec3::new(x, y, z_m), half, yaw_rad);
            *yard = yard.clone().with_obstacle(Class::Rock, Shape::Convex(body));
        }
    }
    yards
}

#[test]
fn law_a_yard_turned_by_a_quarter_has_the_turned_labels() {
    let mut barred = 0;
    for seed in 0..3 {
        let yards = turned_pair(seed);
        let [here, turned] = yards.each_ref().map(|yard| judged(kapvik(), yard, 0..100, 0..100));
        for (index, crossing) in here {
            let CellIndex { row, col } = index;
            let (there, other) = turned[(col * 100 + 99 - row) as usize];
            assert_eq!(there, CellIndex { row: col, col: 99 - row });
            assert!((crossing.margin_m - other.margin_m).abs() < 1e-6, "{index:?}: {crossing:?} {other:?}");
            barred += usize::from(crossing.margin_m < 0.0);
        }
    }
    assert!((2_000..20_000).contains(&barred), "{barred}");
}

#[test]
fn equal_cells_judged_alone_and_with_their_scan() {
    let [yard, _] = turned_pair(9);
    let whole = judged(kapvik(), &yard, 0..100, 0..100);
    for (index, crossing) in whole.iter().step_by(97) {
        let alone = judged(kapvik(), &yard, index.row..index.row + 1, index.col..index.col + 1);
        assert_eq!(alone, [(*index, *crossing)]);
    }
}

#[test]
fn equal_forms_for_every_instruction_set() {
    let [yard, _] = turned_pair(4);
    let placement = Placement::of(&Transform::IDENTITY, &Transform::IDENTITY);
    let assessor = Assessor::new(kapvik(), SIZE_M, &yard, placement);
    let mut lattice = Lattice::default();
    lattice.sample(&yard, &placement, assessor.spacing_m, [20, 40], 100);
    bodies::raise(&yard, &placement, lattice.node_m(0, 0), lattice.node_m(99, 99), &mut lattice);
    let forms = crate::cpu::Isa::available().map(|isa| {
        let mut out = Demands::default();
        let (axes, stances) = (&assessor.axes, &assessor.stances);
        let run = Run {
            lattice: &lattice,
            axes,
            stances,
            tilt: 0.5,
            step_m: 0.1,
            row: 50,
            col: 20,
            count: 61,
            out: &mut out,
        };
        crate::wide::run(isa, run);
        let lists = [out.rise_m, out.fall_m, out.touch_m, out.slope_squared, out.side_slope];
        lists.map(|list| list.iter().map(|value| value.to_bits()).collect::<Vec<u64>>())
    });
    let forms: Vec<_> = forms.collect();
    assert!(forms.windows(2).all(|pair| pair[0] == pair[1]) && forms[0][0].iter().any(|bits| *bits != 0));
}

#[test]
fn exact_cells_of_a_fitted_plane_on_a_slope_are_judged_where_they_truly_lie() {
    // Ground that rises by 20 degrees along x, a post on it 6 m up the slope, and a sensor that stands upright on the slope: its plane is the
    // slope itself, on which the post stands at (6, 0). Seen from above it is 6 cos 20 degrees = 5.64 m away.
    let (tilt_rad, height_m) = (20.0_f64.to_radians(), 0.5);
    let (sin, cos) = math::sin_cos(tilt_rad);
    let ground = Ground::Polynomial(Polynomial::plane(20.0, 0.0, DVec2::new(sin / cos, 0.0)));
    let foot_m = DVec3::new(8.0, 10.0, 8.0 * sin / cos);
    let post_m = foot_m + 6.0 * DVec3::new(cos, 0.0, sin);
    let post = Convex::cuboid(post_m, DVec3::new(0.15, 0.15, 0.5), 0.0);
    let scene = Scene::bare(20.0, ground).with_obstacle(Class::Box, Shape::Convex(post));
    let position_m = foot_m + height_m * DVec3::new(-sin, 0.0, cos);
    let world_from_sensor = Pose { position_m, pitch_rad: -tilt_rad, ..Pose::default() }.transform();
    let grid =
        (10..80).flat_map(|i| (-30..30).map(move |j| DVec3::new(0.1 * f64::from(i), 0.1 * f64::from(j), -height_m)));
    let found = level(&grid.collect::<Vec<_>>(), height_m).expect("ground");

    let mut cells = cells_of(-20..20, 30..80);
    let rover: Rover = serde_saphyr::from_str(include_str!("../../../configs/rovers/kapvik.yaml")).expect("a rover");
    // One feature: the mean height, 0 on the plane.
    cells.features = vec![0.0; cells.rows.len()];
    let rule = RoverRule {
        max_tilt_deg: Some(40.0),
        max_side_slip_deg: Some(40.0),
        max_step_m: Some(0.1),
        max_gap_m: Some(0.1),
        ..RoverRule::default()
    };
    let (rule, rover, scene, map_from_sensor) = (&rule, &rover, &scene, &found.map_from_sensor);
    let asked = Asked { rule, rover, size_m: SIZE_M, scene, world_from_sensor: &world_from_sensor, map_from_sensor };
    judge_of_plane(&asked, &mut cells, &mut Scratch::default());
    let barred: Vec<CellIndex> = cells.rows.iter().filter(|row| row.untraversable()).map(|row| row.index).collect();
    assert!(barred.len() > 9 && barred.len() < cells.rows.len() / 2, "{}", barred.len());
    let mean = |of: fn(&CellIndex) -> i32| {
        SIZE_M * (0.5 + barred.iter().map(|index| f64::from(of(index))).sum::<f64>() / barred.len() as f64)
    };
    // To half a cell; the place seen from above would be three and a half cells off.
    let (x_m, y_m) = (mean(|index| index.col), mean(|index| index.row));
    assert!((x_m - 6.0).abs() < 0.06 && y_m.abs() < 0.06, "{x_m} {y_m}");
    // Off the plane a cell's height moves it: 1 m above the plane is sin 20 degrees nearer the foot, seen from above.
    cells.features.fill(1.0);
    judge_of_plane(&asked, &mut cells, &mut Scratch::default());
    let columns: Vec<i32> = cells.rows.iter().filter(|row| row.untraversable()).map(|row| row.index.col).collect();
    let x_m = SIZE_M * (0.5 + columns.iter().map(|&col| f64::from(col)).sum::<f64>() / columns.len() as f64);
    assert!((x_m - (6.0 + sin / cos)).abs() < 0.06, "{x_m}");
}
