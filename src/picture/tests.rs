//! Pictures of a yard made by hand.

use std::sync::Arc;

use super::*;
use crate::cells::{self, CellFrame, CellParams, ScanPose, WindowScan};
use crate::drive::rover::{Chassis, Mount, RockerBogieChassis};
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::random::{Purpose, Stage, Streams};
use crate::scene::params::HeightLaw;
use crate::scene::{Class, Convex, Cylinder, Ground, Patch, Polynomial, Shape, Volume};
use crate::slam;
use crate::sweep::params::Cast;
use crate::sweep::{Caster, Hit, Pattern, Returns, Status, TrueReturn};

fn kapvik_like() -> Rover {
    Rover {
        name: "test".into(),
        source: String::new(),
        chassis: Chassis::RockerBogie(RockerBogieChassis {
            track_m: 0.5,
            rocker_wheel_x_m: -0.32,
            bogie_front_x_m: 0.32,
            bogie_rear_x_m: 0.04,
            rocker_pivot_x_m: 0.0,
            rocker_pivot_z_m: 0.2,
            bogie_pivot_x_m: 0.18,
            bogie_pivot_z_m: 0.12,
        }),
        wheel_diameter_m: 0.15,
        length_m: 0.8,
        width_m: 0.6,
        height_m: None,
        max_speed_mps: 0.2,
        max_yaw_rate_degps: 30.0,
        mount: Mount { x_m: 0.2, y_m: 0.0, z_m: 0.6, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 },
        limits: None,
    }
}

fn yard() -> Scene {
    let streams = Streams { seed: 5, scene: 0, attempt: 0, stage: Stage::Scene, step: 0 };
    let stream = streams.open(Purpose::GroundNoise);
    let mut coefficients: Vec<f64> = (0..21).map(|i| 0.10 * stream.normal(i)).collect();
    coefficients[0] = 0.0;
    let mut scene = Scene::bare(20.0, Ground::Polynomial(Polynomial::new(20.0, 5, coefficients)));
    for rock in 0..26 {
        let u = |k: u64| stream.uniform(1000 + rock * 100 + k);
        let (x, y) = (1.0 + 18.0 * u(0), 1.0 + 18.0 * u(1));
        if math::hypot(x - 9.0, y - 8.5) < 1.2 {
            continue;
        }
        let radius_m = 0.1 + 0.45 * u(2) * u(2);
        let centre_m = DVec3::new(x, y, scene.ground.height_m(x, y) + 0.1 * radius_m);
        let points: Vec<DVec3> = (0..18)
            .map(|k| {
                let d = DVec3::new(
                    stream.normal(5000 + rock * 100 + k),
                    stream.normal(9000 + rock * 100 + k),
                    stream.normal(13000 + rock * 100 + k),
                );
                centre_m + d.normalize() * radius_m * DVec3::new(1.0, 0.8, 0.85)
            })
            .collect();
        scene = scene.with_obstacle(Class::Rock, Shape::Convex(Convex::hull(&points).unwrap()));
    }
    let at = |x: f64, y: f64, up: f64| DVec3::new(x, y, scene.ground.height_m(x, y) + up);
    let crate_box = Shape::Convex(Convex::cuboid(at(12.3, 11.0, 0.2), DVec3::new(0.4, 0.25, 0.2), 0.5));
    let trunk = Shape::Cylinder(Cylinder { base_m: at(6.5, 12.5, -0.3), radius_m: 0.14, height_m: 2.2 });
    let (crown_at, bush_at) = (at(6.5, 12.5, 2.0), at(12.5, 7.2, 0.25));
    scene = scene.with_obstacle(Class::Box, crate_box).with_obstacle(Class::Trunk, trunk);
    let id = scene.obstacles.len() as i32;
    let volume = |id, class, centre_m, semi_axes_m, protrusion_m| Volume {
        id,
        class,
        centre_m,
        semi_axes_m,
        extinction_per_m: 4.0,
        untraversable: true,
        protrusion_m,
    };
    scene.volumes.push(volume(id, Class::Bush, bush_at, DVec3::new(0.5, 0.5, 0.35), 0.6));
    scene.volumes.push(volume(id + 1, Class::Crown, crown_at, DVec3::new(1.1, 1.1, 0.8), 2.8));
    scene.patches.push(Patch {
        id: id + 2,
        class: Class::Grass,
        centre_m: DVec2::new(10.5, 6.5),
        radius_m: 1.1,
        sigma_m: 0.05,
        height_law: HeightLaw::HalfNormal,
        untraversable: false,
    });
    scene
}

fn sweep_from(caster: &Caster, world_from_sensor: &Transform, scene: &Scene) -> Sweep {
    let (lines, beams) = (100_u32, 682_u32);
    let mut directions = Vec::new();
    for line in 0..lines {
        let (st, ct) = math::sin_cos((-45.0 + 0.5 * f64::from(line)).to_radians());
        for beam in 0..beams {
            let (s, c) = math::sin_cos((-119.9 + 0.3516 * f64::from(beam)).to_radians());
            directions.push(DVec3::new(c * ct, s, c * st));
        }
    }
    let mut hits = Vec::new();
    let world: Vec<DVec3> = directions.iter().map(|&d| world_from_sensor.direction(d)).collect();
    caster.from(world_from_sensor.translation_m, 5.6).cast(&world, &mut hits);
    let class = |object: i32| match scene.obstacles.get(object as usize) {
        Some(obstacle) => Some(obstacle.class),
        None => (object == Hit::GROUND).then_some(Class::Ground),
    };
    let truth =
        hits.iter().map(|h| TrueReturn { range_m: h.range_m, object: h.object, class: class(h.object), top: false });
    let status = hits.iter().map(|h| if h.range_m.is_finite() { Status::Hit } else { Status::None }).collect();
    let range_m = hits.iter().map(|h| if h.range_m.is_finite() { h.range_m } else { f64::NAN }).collect();
    let truth = truth.collect();
    let times_s = vec![0.0; directions.len()];
    let pattern = Arc::new(Pattern { lines, beams, directions, times_s });
    Sweep { returns: Returns { pattern, range_m, status, intensity: None }, mixed: None, truth }
}

/// Runs a claim on a view of the yard by hand: a rover that drove 3 m, and one sweep's cells.
fn with_view(claim: impl FnOnce(&View, &Caster)) {
    with_view_in(CellFrame::EstimatedPose, claim);
}

fn with_view_in(frame: CellFrame, claim: impl FnOnce(&View, &Caster)) {
    let scene = yard();
    let caster = Caster::new(&scene, &Cast::Exact);
    let rover = kapvik_like();
    let stand = |s: f64| {
        let (x, y) = (6.6 + 0.85 * s, 6.9 + 0.53 * s + 0.04 * s * s);
        Pose { position_m: DVec3::new(x, y, scene.ground.height_m(x, y)), yaw_rad: 0.56 + 0.08 * s, ..Pose::default() }
    };
    let truth: Vec<Pose> = (0..60).map(|k| stand(0.05 * f64::from(k))).collect();
    let drift = DVec3::new(0.001, -0.002, 0.0);
    let drifted = |(k, pose): (usize, &Pose)| Pose { position_m: pose.position_m + drift * k as f64, ..*pose };
    let estimates: Vec<Pose> = truth.iter().enumerate().map(drifted).collect();
    let rover_from_sensor = Transform { translation_m: DVec3::new(0.2, 0.0, 0.6), ..Transform::IDENTITY };
    let world_from_sensor = stand(0.05 * 59.0).transform() * rover_from_sensor;
    let sweep = sweep_from(&caster, &world_from_sensor, &scene);
    let estimate = slam::truth(&estimates[59]);
    let ScanPose { estimate, map_from_sensor } =
        ScanPose::of_sweep(frame, &sweep.returns, &estimate, &rover_from_sensor).expect("ground");
    let scan = WindowScan { sweep: &sweep, estimate: &estimate, map_from_sensor, world_from_sensor };
    let (params, mut scratch) = (CellParams::default(), cells::Scratch::default());
    let cells = cells::bin(&params, &[scan], rover.wheel_diameter_m, 5.6, &scene, &mut scratch);
    let view = View {
        title: "yard, scene 0, scan 3",
        scene: &scene,
        rover: &rover,
        truth: &truth,
        estimates: &estimates,
        rover_from_sensor,
        map_from_sensor: scan.map_from_sensor,
        levelled: frame == CellFrame::FittedPlane,
        sweep: &sweep,
        hanging: &[],
        cells: &cells,
        cell_size_m: params.size_m,
    };
    claim(&view, &caster);
}

fn decoded(file: &[u8]) -> (usize, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG file");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut bytes).expect("pixels");
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    (info.width as usize, bytes.as_chunks().0.to_vec())
}

#[test]
fn exact_the_map_shades_each_cell_by_its_label() {
    with_view(|view, _| cells_have_their_shades(view));
}

#[test]
fn exact_the_map_of_a_levelled_sweep_shades_each_cell_where_it_truly_lies() {
    with_view_in(CellFrame::FittedPlane, |view, caster| {
        cells_have_their_shades(view);
        let beside = |row: &&crate::cells::CellRow| {
            let (x_m, y_m) = crate::geometry::GridSpec { size_m: view.cell_size_m }.centre_m(row.index);
            let place_m = view.place_m(DVec2::new(x_m, y_m));
            view.scene.obstacles.iter().all(|obstacle| obstacle.is_beyond(place_m, 0.3))
        };
        // Its rows count from the foot of the sensor, metres away from the yard's corner; drawn they lie on the bodies that they are of.
        let solid =
            |row: &&crate::cells::CellRow| row.untraversable() && row.truth.object < view.scene.obstacles.len() as i32;
        let untraversable = view.cells.rows.iter().filter(solid);
        assert!(untraversable.clone().count() > 20);
        assert_eq!(untraversable.filter(beside).count(), 0);
        let perspective = Perspective::of_size(view, caster, (360, 202));
        let (points, cells) =
            (decoded(&perspective.png(Overlay::Points)).1, decoded(&perspective.png(Overlay::Cells)).1);
        assert!(points.iter().zip(&cells).filter(|(a, b)| a != b).count() > 1000, "cells lie on the ground");
    });
}

/// Of a map's cells nearly all are drawn light or dark, as their label says, where they lie.
fn cells_have_their_shades(view: &View) {
    let (width, pixels) = decoded(&top_view(view));
    let (corner_m, side_m) = top::scanned_square(view);
    let map = map::Map::new((top::LEFT + top::SIDE + top::BETWEEN, top::TOP), top::SIDE, corner_m, side_m);
    let (mut light, mut dark) = (0, 0);
    for row in &view.cells.rows {
        let (x_m, y_m) = crate::geometry::GridSpec { size_m: view.cell_size_m }.centre_m(row.index);
        let (x, y) = map.spot(view.place_m(DVec2::new(x_m, y_m)));
        let brightness = pixels[y as usize * width + x as usize].map(u32::from).iter().sum::<u32>() / 3;
        // Outlines cross some cells: nearly all must have their own shade.
        light += usize::from(!row.untraversable() && brightness > 200);
        dark += usize::from(row.untraversable() && brightness < 90);
    }
    let untraversable = view.cells.rows.iter().filter(|r| r.untraversable()).count();
    assert!(untraversable > 40 && dark * 10 > untraversable * 8, "{dark} of {untraversable}");
    assert!(light * 100 > (view.cells.rows.len() - untraversable) * 98, "{light} of {}", view.cells.rows.len());
}

#[test]
fn equal_pictures_have_the_same_bytes_on_one_thread_and_on_four() {
    with_view(|view, caster| {
        let all = || [top_view(view), Perspective::of_size(view, caster, (240, 135)).png(Overlay::Cells)];
        let on = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(all);
        assert!(on(1) == on(4));
    });
}

#[test]
fn exact_the_perspective_lays_cells_on_the_ground_and_none_on_the_sky() {
    with_view(|view, caster| {
        let perspective = Perspective::of_size(view, caster, (360, 202));
        let seen = |overlay| decoded(&perspective.png(overlay));
        let ((width, points), (_, cells)) = (seen(Overlay::Points), seen(Overlay::Cells));
        assert_eq!((width, points.len()), (360, 360 * 202));
        // The sky shows no overlay, the ground before the rover does.
        assert_eq!(points[25 * width + 175], cells[25 * width + 175]);
        assert!((122..150).all(|y| points[y * width + 75] != cells[y * width + 75]));
    });
}

#[test]
fn exact_the_cloud_holds_every_return_with_its_label() {
    with_view(|view, _| {
        let file = labelled_cloud(view);
        let end = b"end_header\n";
        let body = file.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
        let hits = view.sweep.returns.status.iter().filter(|&&s| s == Status::Hit).count();
        let header = String::from_utf8(file[..body].to_vec()).expect("a text header");
        assert!(
            header.starts_with("ply\nformat binary_little_endian 1.0\n")
                && header.contains(&format!("element vertex {hits}\n"))
        );
        const VERTEX: usize = 3 * 8 + 4 + 1 + 4 + 1 + 3;
        assert_eq!(file.len() - body, hits * VERTEX);
        // Every written cell gets back as many points as it was made of.
        let mut labelled = 0;
        for vertex in file[body..].chunks(VERTEX) {
            let number = |k: usize| f64::from_le_bytes(vertex[8 * k..8 * k + 8].try_into().expect("8 bytes"));
            let cell =
                crate::geometry::GridSpec { size_m: view.cell_size_m }.cell(number(0), number(1)).expect("a cell");
            let row = view.cells.rows.iter().find(|r| r.index == cell).expect("a written cell");
            assert_eq!(vertex[33] as i8, row.label.expect("a label").number());
            labelled += 1;
        }
        assert_eq!(labelled, view.cells.points_binned);
    });
}

#[test]
fn extreme_a_view_without_cells_poses_or_returns_still_makes_pictures() {
    with_view(|view, caster| {
        let (none, mut blind) = (Cells::default(), view.sweep.clone());
        blind.returns.status.fill(Status::None);
        blind.returns.range_m.fill(f64::NAN);
        let bare = View { truth: &view.truth[..1], estimates: &[], cells: &none, sweep: &blind, title: "", ..*view };
        decoded(&top_view(&bare));
        decoded(&scan_view(&bare));
        decoded(&Perspective::of_size(&bare, caster, (160, 90)).png(Overlay::Points));
        let rosette = Pattern { lines: 1, beams: 68_200, ..(*blind.returns.pattern).clone() };
        let returns = Returns { pattern: Arc::new(rosette), ..view.sweep.returns.clone() };
        let by_angles = Sweep { returns, ..view.sweep.clone() };
        decoded(&scan_view(&View { sweep: &by_angles, ..*view }));
    });
}
