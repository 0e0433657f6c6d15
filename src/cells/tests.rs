//! Cells against a second, slow and plain computation of the same definitions, and against numbers worked out by hand.

mod extremes;
mod overhang;
mod unseen;

use std::collections::BTreeMap;
use std::sync::Arc;

use super::params::{LabelParams, ObstacleRule};
use super::*;
use crate::geometry::{DVec2, DVec3, Pose, Transform};
use crate::math;
use crate::random::{Drawn, Purpose, Stage, Stream, Streams};
use crate::scene::params::HeightLaw;
use crate::scene::params::SceneParams;
use crate::scene::{Body, Class, Cylinder, Ground, Obstacle, Patch, Raster, Scene, Shape, Volume};
use crate::slam::{Estimate, truth};
use crate::sweep::{Pattern, Returns, Status, Sweep, TrueReturn};

/// A plane that rises by `slope` a metre along x.
fn ramp(slope: f64) -> Ground {
    let heights_m = (0..21 * 21).map(|i| slope * f64::from(i % 21)).collect();
    Ground::Raster(Raster::new(DVec2::ZERO, 1.0, 21, 21, heights_m))
}

/// Obstacles 0 and 1 stand 0.05 m and 0.30 m tall; bush 2 can be crossed, bush 3 not; patch 4 can be crossed, patch 5 not.
fn yard(slope: f64) -> Scene {
    let obstacle = |id, protrusion_m| {
        let shape = Shape::Cylinder(Cylinder { base_m: DVec3::ZERO, radius_m: 0.1, height_m: protrusion_m });
        Obstacle::new(id, Class::Rock, Body { shape, centre_m: DVec3::ZERO, radius_m: 1.0, protrusion_m })
    };
    let volume = |id, untraversable| Volume {
        id,
        class: Class::Bush,
        centre_m: DVec3::ZERO,
        semi_axes_m: DVec3::ONE,
        extinction_per_m: 2.0,
        untraversable,
        protrusion_m: 1.0,
    };
    let patch = |id, class, untraversable| Patch {
        id,
        class,
        centre_m: DVec2::ZERO,
        radius_m: 1.0,
        sigma_m: 0.1,
        height_law: HeightLaw::HalfNormal,
        untraversable,
    };
    Scene {
        extent_m: 20.0,
        ground: ramp(slope),
        obstacles: vec![obstacle(0, 0.05), obstacle(1, 0.30)],
        volumes: vec![volume(2, false), volume(3, true)],
        patches: vec![patch(4, Class::Grass, false), patch(5, Class::Bush, true)],
    }
}

/// A sweep that measures exactly these points of its own frame.
fn sweep_of(points: &[(DVec3, i32)]) -> Sweep {
    let pattern = Pattern {
        lines: 1,
        beams: points.len() as u32,
        directions: points.iter().map(|(p, _)| p.normalize()).collect(),
        times_s: vec![0.0; points.len()],
    };
    Sweep {
        returns: Returns {
            pattern: Arc::new(pattern),
            range_m: points.iter().map(|(p, _)| p.length()).collect(),
            status: vec![Status::Hit; points.len()],
            intensity: None,
        },
        mixed: None,
        truth: points
            .iter()
            .map(|&(p, object)| TrueReturn { range_m: p.length(), object, class: Some(Class::Ground), top: false })
            .collect(),
    }
}

fn estimate_at(pose: Pose) -> Estimate {
    let mut covariance = [[0.0; 6]; 6];
    // Sigmas 1 to 6 of x, y, z, roll, pitch, yaw.
    for (i, row) in covariance.iter_mut().enumerate() {
        row[i] = ((i + 1) * (i + 1)) as f64;
    }
    Estimate { covariance, ..truth(&pose) }
}

/// A scan of a sensor that sits where `mount` says.
fn scan_at<'a>(
    sweep: &'a Sweep,
    estimate: &'a Estimate,
    mount: &Transform,
    world_from_sensor: Transform,
) -> WindowScan<'a> {
    WindowScan { sweep, estimate, map_from_sensor: estimate.pose.transform() * *mount, world_from_sensor }
}

fn bin_one(params: &CellParams, points: &[(DVec3, i32)], pose: Pose, scene: &Scene) -> Cells {
    let (sweep, estimate) = (sweep_of(points), estimate_at(pose));
    let scan = scan_at(&sweep, &estimate, &Transform::IDENTITY, pose.transform());
    bin(params, &[scan], 0.1, 1e9, scene, &mut Scratch::default())
}

fn stream() -> Stream {
    Streams { seed: 11, scene: 0, attempt: 0, stage: Stage::Cells, step: 0 }.open(Purpose::GroundNoise)
}

#[test]
fn exact_two_cells_worked_out_by_hand() {
    // Rover at z = 2; cell (1, 3) holds heights 2.5 and 3.5, its eastern neighbour (1, 4) holds 1.0.
    let params = CellParams { size_m: 1.0, ..CellParams::default() };
    let at = DVec3::new(0.0, 0.0, 2.0);
    let points = [(3.25, 1.5, 2.5), (4.0, 1.0, 1.0), (3.75, 1.5, 3.5)].map(|(x, y, z)| (DVec3::new(x, y, z) - at, -1));
    let pose = Pose { position_m: at, ..Pose::default() };
    let cells = bin_one(&params, &points, pose, &yard(0.0));
    let index: Vec<(i32, i32)> = cells.rows.iter().map(|r| (r.index.row, r.index.col)).collect();
    assert_eq!(index, [(1, 3), (1, 4)]);
    let first = [1.0, 0.25, 1.0, 2.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 3.0, 4.0, 5.0, 1.0, 2.0, 6.0];
    let second =
        [-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0, 3.0, 4.0, 5.0, 1.0, 2.0, 6.0];
    for (got, want) in cells.features.iter().zip(first.iter().chain(&second)) {
        assert!((got - want).abs() < 1e-6, "{:?}", cells.features);
    }
    assert_eq!((cells.rows[0].neighbour_mask, cells.rows[1].neighbour_mask), (1 << 4, 1 << 3));
    assert_eq!((cells.rows[0].points, cells.rows[1].points), (2, 1));
    let mean_range = (math::hypot(3.25, 1.5) + math::hypot(3.75, 1.5)) / 2.0;
    assert!((f64::from(cells.rows[0].range_m) - mean_range).abs() < 1e-6);
}

/// The definitions once more, over a map of cells, without regard to speed: (row, col) -> (height, distance, intensity, object, top).
type Members = BTreeMap<(i64, i64), Vec<(f64, f64, f64, i32, bool)>>;

fn plainly(size_m: f64, window: &[WindowScan], mount: &Transform, max_range_m: f64) -> Members {
    let rover_z_m = window.last().unwrap().estimate.pose.position_m.z;
    let mut members = Members::new();
    for scan in window {
        let map_from_rover = scan.estimate.pose.transform();
        let sensor_m = map_from_rover.point(mount.translation_m);
        for (slot, &range_m) in scan.sweep.returns.range_m.iter().enumerate() {
            let in_rover = mount.point(scan.sweep.returns.pattern.directions[slot] * range_m);
            let p = map_from_rover.point(in_rover);
            let distance_m = math::hypot(p.x - sensor_m.x, p.y - sensor_m.y);
            if scan.sweep.returns.status[slot] != Status::Hit || distance_m > max_range_m || !p.is_finite() {
                continue;
            }
            let cell = ((p.y / size_m).floor() as i64, (p.x / size_m).floor() as i64);
            let intensity =
                scan.sweep.returns.intensity.as_ref().map_or(0.0, |i| f64::from(i[slot]) * range_m * range_m);
            let truth = scan.sweep.truth[slot];
            members.entry(cell).or_default().push((p.z - rover_z_m, distance_m, intensity, truth.object, truth.top));
        }
    }
    members
}

fn random_sweep(stream: &Stream, seed: u64, slots: u64) -> Sweep {
    let u = |i: u64, k: u64| stream.uniform((seed * 1_000_000 + i) * 8 + k);
    let points: Vec<(DVec3, i32)> = (0..slots)
        .map(|i| {
            let p = DVec3::new(4.0 * u(i, 0) - 1.0, 4.0 * u(i, 1) - 2.0, 0.3 * u(i, 2) - 0.5);
            (p, (u(i, 3) * 40.0) as i32 - 34)
        })
        .map(|(p, object)| (p, object.max(-1)))
        .collect();
    let mut sweep = sweep_of(&points);
    for i in 0..slots as usize {
        sweep.returns.status[i] = if u(i as u64, 4) < 0.05 { Status::None } else { Status::Hit };
        sweep.returns.range_m[i] =
            if sweep.returns.status[i] == Status::Hit { sweep.returns.range_m[i] } else { f64::NAN };
        sweep.truth[i].top = u(i as u64, 5) < 0.5;
    }
    sweep.returns.intensity = Some((0..slots).map(|i| u(i, 6) as f32).collect());
    sweep
}

/// Within 2 units in the last place of f32, as which features are stored, or 1e-9.
fn close(got: f32, want: f64) -> bool {
    let want32 = want as f32;
    let ulp = f32::from_bits(want32.abs().to_bits() + 1) - want32.abs();
    (f64::from(got) - want).abs() < 1e-9 || (got - want32).abs() <= 2.0 * ulp
}

#[test]
fn equal_cells_of_a_window_agree_with_a_plain_recomputation() {
    let stream = stream();
    let scene = yard(0.1);
    let mount = Pose { position_m: DVec3::new(0.3, 0.05, 0.4), pitch_rad: 0.2, ..Pose::default() }.transform();
    let mut scratch = Scratch::default();
    for (round, (neighbours, scans, size_m)) in
        [(8, 1, 0.1), (4, 3, 0.25), (24, 2, 0.07), (8, 2, 50.0)].into_iter().enumerate()
    {
        let params = CellParams { neighbours, size_m, max_range_m: Some(2.4), ..CellParams::default() };
        let sweeps: Vec<Sweep> = (0..scans).map(|s| random_sweep(&stream, (round * 10 + s) as u64, 3000)).collect();
        let estimates: Vec<Estimate> = (0..scans)
            .map(|s| {
                let a = s as f64;
                let position_m = DVec3::new(0.4 * a - 0.3, 0.2 * a - 0.4, 0.7 - 0.1 * a);
                estimate_at(Pose { position_m, roll_rad: 0.05 * a, pitch_rad: -0.1, yaw_rad: 0.7 * a + 0.2 })
            })
            .collect();
        let scan = |s: usize| scan_at(&sweeps[s], &estimates[s], &mount, Transform::IDENTITY);
        let window: Vec<WindowScan> = (0..scans).map(scan).collect();
        let cells = bin(&params, &window, 0.1, 100.0, &scene, &mut scratch);
        let members = plainly(size_m, &window, &mount, 2.4);
        let width = feature_columns(&params, true).len();
        // Without intensities: the same rows, the same features but for the last two.
        let without = |returns: &Returns| Returns { intensity: None, ..returns.clone() };
        let dark: Vec<Sweep> =
            sweeps.iter().map(|sweep| Sweep { returns: without(&sweep.returns), ..sweep.clone() }).collect();
        let dark: Vec<WindowScan> =
            window.iter().zip(&dark).map(|(scan, sweep)| WindowScan { sweep, ..*scan }).collect();
        let dark = bin(&params, &dark, 0.1, 100.0, &scene, &mut scratch);
        assert_eq!(format!("{:?}", dark.rows), format!("{:?}", cells.rows));
        let lit = cells.features.chunks(width).flat_map(|features| &features[..width - 2]);
        assert!(dark.features.iter().map(|f| f.to_bits()).eq(lit.map(|f| f.to_bits())));

        assert_eq!(cells.rows.len(), members.len());
        assert_eq!(cells.features.len(), width * members.len());
        let hits = sweeps.iter().flat_map(|s| &s.returns.status).filter(|&&s| s == Status::Hit).count() as u64;
        assert_eq!(cells.points_in, hits);
        assert_eq!(cells.points_in, cells.points_binned + cells.dropped_beyond_range + cells.dropped_off_grid);
        assert_eq!(cells.points_binned, members.values().map(|m| m.len() as u64).sum::<u64>());
        assert!(cells.dropped_beyond_range > 0, "the case should have far points");

        let mean = |m: &[(f64, f64, f64, i32, bool)]| m.iter().map(|p| p.0).sum::<f64>() / m.len() as f64;
        for ((row, features), (&(r, c), m)) in cells.rows.iter().zip(cells.features.chunks(width)).zip(&members) {
            assert_eq!((i64::from(row.index.row), i64::from(row.index.col), row.points as usize), (r, c, m.len()));
            let n = m.len() as f64;
            let own = mean(m);
            let variance = m.iter().map(|p| p.0 * p.0).sum::<f64>() / n - own * own;
            let high = m.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
            let low = m.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
            assert!(
                close(features[0], own) && close(features[1], variance) && close(features[2], high - low),
                "{features:?}"
            );
            assert_eq!(features[3], m.len() as f32);
            assert_eq!([features[4], features[5]], [-0.1_f32, (0.05 * (scans as f64 - 1.0)) as f32]);
            for (k, offset) in neighbour_offsets(neighbours).into_iter().enumerate() {
                let near = members.get(&(r + i64::from(offset.rows), c + i64::from(offset.cols)));
                assert!(close(features[6 + k], near.map_or(own, |m| mean(m))));
                assert_eq!(row.neighbour_mask >> k & 1 == 1, near.is_some());
            }
            assert_eq!(features[width - 8..width - 2], [3.0, 4.0, 5.0, 1.0, 2.0, 6.0]);
            let light = m.iter().map(|p| p.2).sum::<f64>() / n;
            assert!(close(features[width - 2], light));
            let spread = m.iter().map(|p| (p.2 - light) * (p.2 - light)).sum::<f64>() / n;
            assert!(close(features[width - 1], spread));
            assert!(close(row.range_m, m.iter().map(|p| p.1).sum::<f64>() / n));
            // Untraversable here: rock 1 (0.30 m against a 0.10 m wheel), bush 3, patch 5.
            let bad: Vec<_> = m.iter().filter(|p| [1, 3, 5].contains(&p.3)).collect();
            assert_eq!(row.truth.obstacle_points as usize, bad.len());
            assert_eq!(row.truth.top_points as usize, bad.iter().filter(|p| p.4).count());
            assert_eq!(row.label, Some(Label::untraversable_if(!bad.is_empty())));
            // What makes the label first: bush 3 (1.0 m), rock 1, patch 5; then bush 2 (1.0 m), rock 0, patch 4.
            let named = [3, 1, 5, 2, 0, 4].into_iter().find(|id| m.iter().any(|p| p.3 == *id));
            assert_eq!(row.truth.object, named.unwrap_or(-1));
        }
    }
}

#[test]
fn exact_a_point_on_a_border_belongs_to_the_cell_above_and_to_the_right() {
    let params = CellParams { size_m: 0.5, ..CellParams::default() };
    let up = DVec3::Z;
    // Along the axes a direction times a range is exact.
    let points = [DVec3::X * 1.5, DVec3::Y * 2.0, DVec3::X * -1.5, DVec3::Y * -2.0, up].map(|p| (p, -1));
    let cells = bin_one(&params, &points, Pose::default(), &yard(0.0));
    let index: Vec<(i32, i32)> = cells.rows.iter().map(|r| (r.index.row, r.index.col)).collect();
    assert_eq!(index, [(-4, 0), (0, -3), (0, 0), (0, 3), (4, 0)]);
}

#[test]
fn exact_one_point_a_cell_and_all_points_in_one_cell() {
    let points: Vec<(DVec3, i32)> =
        (0..100).map(|i| (DVec3::new(1.05 + 0.1 * f64::from(i), 0.05, f64::from(i % 2)), -1)).collect();
    let apart = bin_one(&CellParams::default(), &points, Pose::default(), &yard(0.0));
    assert_eq!(apart.rows.len(), 100);
    assert!(apart.features.chunks(20).all(|f| f[1] == 0.0 && f[2] == 0.0 && f[3] == 1.0));
    let together =
        bin_one(&CellParams { size_m: 100.0, ..CellParams::default() }, &points, Pose::default(), &yard(0.0));
    assert_eq!(together.rows.len(), 1);
    assert!((together.features[1] - 0.25).abs() < 1e-7 && (together.features[0] - 0.5).abs() < 1e-7);
    assert_eq!(together.rows[0].neighbour_mask, 0);
}

#[test]
fn extreme_a_map_a_thousand_kilometres_off_keeps_the_variance() {
    // Cells of 1 m; each height +-0.1 m: variance 0.01. At 1e6 m a coordinate holds 1.2e-10 m, so a variance 2.4e-11 m2.
    let points: Vec<(DVec3, i32)> = (0..400)
        .map(|i| {
            (DVec3::new(0.5 + f64::from(i / 4 % 10), 0.5 + f64::from(i / 40), if i % 2 == 0 { 0.1 } else { -0.1 }), -1)
        })
        .collect();
    let params = CellParams { size_m: 1.0, ..CellParams::default() };
    let pose = Pose { position_m: DVec3::new(1e6, -1e6, 1e6), ..Pose::default() };
    let cells = bin_one(&params, &points, pose, &yard(0.0));
    assert_eq!(cells.rows.len(), 100);
    for features in cells.features.chunks(20) {
        assert!(features[0].abs() < 1e-9 && (features[1] - 0.01).abs() < 1e-9, "{features:?}");
    }
    assert_eq!(cells.rows[0].index, crate::geometry::CellIndex { row: -1_000_000, col: 1_000_000 });
}

#[test]
fn extreme_slots_without_a_number_or_off_the_grid_are_counted_by_cause() {
    let mut sweep = sweep_of(&[(DVec3::X, -1); 8]);
    sweep.returns.range_m = vec![1.0, f64::NAN, f64::INFINITY, 1e300, 1e8, 11.0, f64::NAN, 2.0];
    sweep.returns.status[6] = Status::Dropped;
    sweep.returns.status[7] = Status::OutOfRange;
    let estimate = estimate_at(Pose::default());
    let scan = scan_at(&sweep, &estimate, &Transform::IDENTITY, Transform::IDENTITY);
    let run = |max_range_m, size_m| {
        let params = CellParams { max_range_m: Some(max_range_m), size_m, ..CellParams::default() };
        bin(&params, &[scan], 0.1, 5.0, &yard(0.0), &mut Scratch::default())
    };
    // NaN, and infinity along an axis (infinity times 0), are no place at all.
    let near = run(10.0, 0.1);
    assert_eq!((near.points_in, near.points_binned, near.dropped_beyond_range, near.dropped_off_grid), (6, 1, 3, 2));
    // A point far away: sorted by comparison; the endless ones and the one past the i32 range have no cell.
    let far = run(f64::INFINITY, 0.1);
    assert_eq!((far.points_in, far.points_binned, far.dropped_beyond_range, far.dropped_off_grid), (6, 3, 0, 3));
    assert_eq!(far.rows.last().map(|r| r.index.col), Some(1_000_000_000));
    // No sweep, no cells.
    let none = bin(&CellParams::default(), &[], 0.1, 5.0, &yard(0.0), &mut Scratch::default());
    assert!(none.rows.is_empty());
}

#[test]
fn exact_a_cell_of_several_things_names_the_one_that_made_its_label() {
    // Pairs of points in one cell each: grass under brush, a low stone in brush, a rock in a bush that can be crossed, brush at a rock's foot;
    // and two things that both let the rover pass: the taller is named.
    let pairs = [([4, 5], 5), ([0, 5], 5), ([1, 2], 1), ([1, 5], 1), ([0, 2], 2), ([4, 0], 0)];
    let params = CellParams { size_m: 1.0, ..CellParams::default() };
    for (objects, named) in pairs {
        for objects in [objects, [objects[1], objects[0]]] {
            let points = objects.map(|id| (DVec3::new(0.5, 0.5, 0.1), id));
            let truth = bin_one(&params, &points, Pose::default(), &yard(0.0)).rows[0].truth;
            assert_eq!(truth.object, named, "{objects:?}");
            let class = [Class::Rock, Class::Rock, Class::Bush, Class::Bush, Class::Grass, Class::Bush][named as usize];
            assert_eq!(truth.class, Some(class), "{objects:?}");
            let protrusion_m = [0.05, 0.3, 1.0, 1.0, 0.0, 0.0][named as usize];
            assert_eq!(truth.protrusion_m, protrusion_m, "{objects:?}");
        }
    }
}

/// Labels of single-point cells, one for each object (ground, then 0 to 5).
fn labels_by_object(rule: ObstacleRule, min_obstacle_points: u32) -> Vec<i8> {
    let labels = LabelParams { obstacle: rule, min_obstacle_points, ..LabelParams::default() };
    let params = CellParams { labels, size_m: 1.0, ..CellParams::default() };
    let points: Vec<(DVec3, i32)> = (-1..6).map(|id| (DVec3::new(0.5 + f64::from(id + 1), 0.5, 0.1), id)).collect();
    bin_one(&params, &points, Pose::default(), &yard(0.0)).rows.iter().map(|r| r.label.unwrap().number()).collect()
}

#[test]
fn exact_labels_follow_the_rule_for_solids_and_the_mark_for_plants() {
    assert_eq!(labels_by_object(ObstacleRule::TallerThanWheel, 1), [0, 0, 1, 0, 1, 0, 1]);
    assert_eq!(labels_by_object(ObstacleRule::All, 1), [0, 1, 1, 0, 1, 0, 1]);
    assert_eq!(labels_by_object(ObstacleRule::TallerThanM(0.3), 1), [0, 0, 0, 0, 1, 0, 1]);
    assert_eq!(labels_by_object(ObstacleRule::TallerThanM(0.049), 1), [0, 1, 1, 0, 1, 0, 1]);
    assert_eq!(labels_by_object(ObstacleRule::All, 2), [0; 7]);
}

#[test]
fn law_another_rule_by_the_stored_truth_labels_as_a_build_by_that_rule_would() {
    // Cells of one point of each object, of ground and the low rock, and of both rocks.
    let at = |col: i32| DVec3::new(0.5 + f64::from(col), 0.5, 0.1);
    let mut points: Vec<(DVec3, i32)> = (-1..6).map(|id| (at(id + 1), id)).collect();
    points.extend([(at(7), -1), (at(7), 0), (at(8), 0), (at(8), 1)]);
    let labelled = |obstacle, max_ground_slope_deg| {
        let labels = LabelParams { obstacle, max_ground_slope_deg, ..LabelParams::default() };
        let params = CellParams { labels, size_m: 1.0, ..CellParams::default() };
        bin_one(&params, &points, Pose::default(), &yard(0.3)).rows
    };
    let rules = [
        (ObstacleRule::All, super::Obstacle::All),
        (ObstacleRule::TallerThanWheel, super::Obstacle::TallerThanWheel(0.1)),
        (ObstacleRule::TallerThanM(0.04), super::Obstacle::TallerThanM(0.04)),
        (ObstacleRule::TallerThanM(0.5), super::Obstacle::TallerThanM(0.5)),
    ];
    for (built, max_ground_slope_deg) in rules.into_iter().flat_map(|(rule, _)| [(rule, None), (rule, Some(10.0))]) {
        let stored = labelled(built, None);
        for (wanted, obstacle) in rules {
            let rule = LabelRule { obstacle, max_ground_slope_deg, ..LabelRule::default() };
            let relabelled: Vec<Label> = stored.iter().map(|row| rule.label(&row.truth)).collect();
            let rebuilt: Vec<Label> =
                labelled(wanted, max_ground_slope_deg).iter().map(|row| row.label.unwrap()).collect();
            assert_eq!(relabelled, rebuilt, "{built:?} as {wanted:?}");
        }
    }
}

#[test]
fn exact_steep_ground_is_untraversable_where_a_config_limits_it() {
    // A ramp of 30 degrees, seen from a map that is turned and shifted: the slope is that of the true place.
    let slope = math::tan(30.0_f64.to_radians());
    let points = [(DVec3::new(5.2, 5.3, 0.0), -1)];
    let (sweep, estimate) = (sweep_of(&points), estimate_at(Pose { yaw_rad: 2.0, ..Pose::default() }));
    let scan = scan_at(&sweep, &estimate, &Transform::IDENTITY, Transform::IDENTITY);
    for (limit_deg, expected) in [(None, 0), (Some(29.9), 1), (Some(30.1), 0)] {
        let labels = LabelParams { max_ground_slope_deg: limit_deg, ..LabelParams::default() };
        let params = CellParams { labels, ..CellParams::default() };
        let cells = bin(&params, &[scan], 0.1, 50.0, &yard(slope), &mut Scratch::default());
        assert_eq!(cells.rows[0].label.map(Label::number), Some(expected));
        assert!((f64::from(cells.rows[0].truth.slope_rad).to_degrees() - 30.0).abs() < 1e-5);
    }
}

#[test]
fn law_the_order_of_points_moves_no_truth_and_hashes_tell_cells_apart() {
    let hash = |cells: &Cells| {
        let mut hasher = blake3::Hasher::new();
        cells.hash_into(&mut hasher);
        hasher.finalize()
    };
    let params = CellParams { size_m: 10.0, ..CellParams::default() };
    let points: Vec<(DVec3, i32)> = [3, 2, -1, 5, 0].map(|id| (DVec3::new(1.0 + f64::from(id), 2.0, 0.1), id)).to_vec();
    let reversed: Vec<(DVec3, i32)> = points.iter().rev().copied().collect();
    let one = bin_one(&params, &points, Pose::default(), &yard(0.0));
    let other = bin_one(&params, &reversed, Pose::default(), &yard(0.0));
    assert_eq!(one.rows[0].truth, other.rows[0].truth);
    assert_eq!(one.rows[0].truth.object, 3, "of two bushes as tall, the one that bars the way");
    let fewer = bin_one(&params, &points[1..], Pose::default(), &yard(0.0));
    assert_eq!(hash(&one), hash(&one.clone()));
    assert_ne!(hash(&one), hash(&fewer));
}

/// A rock's shape is computed when something asks for it. Which label a cell has must not depend on who asked before: casting computes
/// the shapes it meets, but a recorded sweep may be labelled in a yard that nobody has looked at.
#[test]
fn law_labels_of_a_yard_that_nothing_has_asked_of_are_those_of_one_that_was_cast_at() {
    let params: SceneParams =
        serde_saphyr::from_str("{extent_m: 10, rocks: {count: 12, diameter_m: {uniform: [0.05, 0.8]}}}").unwrap();
    let streams = Streams { seed: 5, scene: 0, attempt: 0, stage: Stage::Scene, step: 0 };
    let drawn = Drawn::draw(&streams, params.dists());
    let yard = || crate::scene::build(&params, &drawn, &streams).unwrap();
    let (asked, fresh) = (yard(), yard());
    let protrusions_m: Vec<f64> = asked.obstacles.iter().map(|rock| rock.body().protrusion_m).collect();
    let rule = LabelParams { obstacle: ObstacleRule::TallerThanM(0.15), ..LabelParams::default() };
    let params = CellParams { labels: rule, ..CellParams::default() };
    // One point by each rock, each in a cell of its own.
    let points: Vec<(DVec3, i32)> =
        (0..12).map(|id| (DVec3::new(1.05 + 0.2 * f64::from(id), 0.05, -0.5), id)).collect();
    let (sweep, estimate) = (sweep_of(&points), estimate_at(Pose::default()));
    let scan = scan_at(&sweep, &estimate, &Transform::IDENTITY, Transform::IDENTITY);
    let cells = |scene: &Scene| bin(&params, &[scan], 0.1, 50.0, scene, &mut Scratch::default());
    for scene in [&fresh, &asked] {
        let cells = cells(scene);
        let labels: Vec<Option<Label>> = cells.rows.iter().map(|row| row.label).collect();
        let wanted: Vec<Option<Label>> =
            protrusions_m.iter().map(|&height_m| Some(Label::untraversable_if(height_m > 0.15))).collect();
        assert_eq!(labels, wanted);
        let truths = cells.rows.iter().map(|row| row.truth.protrusion_m);
        assert!(truths.eq(protrusions_m.iter().map(|&height_m| height_m as f32)));
    }
    let tall = protrusions_m.iter().filter(|&&height_m| height_m > 0.15).count();
    assert!(tall > 2 && tall < 10, "both classes: {protrusions_m:?}");
}

#[test]
fn exact_what_a_row_says_of_its_label_and_a_local_height_of_itself() {
    let row = |label| CellRow { label, ..fixtures::row_at(0, 0) };
    assert_eq!(
        [Some(Label::Untraversable), Some(Label::Traversable), None].map(|label| row(label).untraversable()),
        [true, false, false]
    );
    assert_eq!(super::params::LocalHeightParams::default().words(), "percentile 10 within 1 m");
}
