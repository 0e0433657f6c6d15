//! The files that go out, read back.

use std::collections::BTreeMap;

use crate::cells::{self, CellAssigner, CellParams, Cells, Label, WindowCloud};
use crate::cloud::{Cloud, Options, read};
use crate::geometry::{DVec3, GridSpec, Pose, Transform};
use crate::judge::cost_map::cost_map;
use crate::judge::{JudgedCells, Shown, export};

/// Cells of an L: (0, 0), (0, 1), (2, 0) and (1, 0), outputs rising; one of them not judged.
fn ell() -> JudgedCells {
    let points = [(0.25, 0.25, 1.0), (0.75, 0.25, 1.5), (0.25, 0.75, 2.0), (0.25, 1.25, 2.5)];
    let points_m: Vec<DVec3> = points.iter().map(|&(x, y, z)| DVec3::new(x - 5.0, y + 10.0, z)).collect();
    let params = CellParams { size_m: 0.5, ..CellParams::default() };
    let estimate = crate::slam::truth(&Pose { position_m: DVec3::new(-5.0, 10.0, 1.0), ..Pose::default() });
    let map_from_sensor = Transform { translation_m: DVec3::new(-5.0, 10.0, 2.0), ..Transform::IDENTITY };
    let cloud = WindowCloud {
        points_m: &points_m,
        in_map: true,
        intensity: None,
        obstacle: None,
        estimate: &estimate,
        map_from_sensor,
    };
    let (cells, known) = cells::bin_clouds(&params, &[cloud], 50.0, &mut cells::Scratch::default());
    assert_eq!(known, [0; 4]);
    assert!(cells.rows.iter().all(|row| row.label.is_none() && row.truth.class.is_none()));
    // Rows in order: (20, -10), (20, -9), (21, -10), (22, -10).
    let outputs = vec![Some(0.1), Some(0.5), Some(1.0), None];
    JudgedCells { classes: vec![Some(0), Some(1), Some(1), None], ..judged(cells, outputs, 0.5, 1.0) }
}

/// All of one class.
fn judged(cells: Cells, outputs: Vec<Option<f64>>, size_m: f64, rover_z_m: f64) -> JudgedCells {
    JudgedCells {
        scan: "ell".into(),
        known_points: vec![0; cells.rows.len()],
        inputs: Vec::new(),
        classes: vec![Some(1); outputs.len()],
        probabilities: vec![None; outputs.len()],
        outputs,
        of_classes: 2,
        targets: [0.1, 0.9],
        grid: GridSpec { size_m },
        rover_z_m,
        cells,
    }
}

#[test]
fn exact_cost_map_has_north_up_and_its_origin_at_the_lower_left_corner() {
    let ell = ell();
    let map = cost_map(&ell, "scan-cost.pgm", Shown::Output).unwrap();
    // From the top: (22) unknown, (21) output 1.0 beyond the target, (20) 0.1 and 0.5; the eastern column is empty but below.
    assert_eq!(map.pgm, b"P5\n2 3\n255\n\xff\xff\x64\xff\x00\x32".to_vec());
    assert_eq!(
        map.yaml,
        "image: scan-cost.pgm\nmode: raw\nresolution: 0.5\norigin: [-5.0, 10.0, 0.0]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    );
    let map = cost_map(&ell, "scan-class.pgm", Shown::Class).unwrap();
    assert_eq!(map.pgm, b"P5\n2 3\n255\n\x80\x80\x00\x80\xff\x00".to_vec());
    assert!(map.yaml.contains("mode: trinary\n") && map.yaml.ends_with("occupied_thresh: 0.65\nfree_thresh: 0.25\n"));
}

/// What nav2_map_server makes of an opaque pixel (map_io.cpp, `loadMapFromFile`) and ROS 1's map_server of the same (image_loader.cpp):
/// -1 unknown, 0 free to 100 occupied.
fn map_servers(yaml: &str, pixel: u8) -> [i32; 2] {
    let value = |key: &str| yaml.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(": ")).unwrap();
    let [occupied, free] = ["occupied_thresh", "free_thresh"].map(|key| value(key).parse::<f64>().unwrap());
    assert_eq!(value("negate"), "0");
    let shade = f64::from(pixel) / 255.0;
    let occupancy = 1.0 - shade;
    let scaled = |occupancy: f64| ((occupancy - free) / (occupied - free) * 100.0).round_ties_even() as i32;
    let thresholds = |between: i32| {
        if occupied < occupancy {
            100
        } else if occupancy < free {
            0
        } else {
            between
        }
    };
    match value("mode") {
        "trinary" => [thresholds(-1); 2],
        "scale" => [thresholds(scaled(occupancy)); 2],
        "raw" => {
            let percent = (shade * 255.0).round() as i32;
            // ROS 1 copies the byte into an i8, where all below zero is unknown to who reads it.
            [if (0..=100).contains(&percent) { percent } else { -1 }, i32::from(pixel as i8)]
        }
        mode => panic!("{mode}"),
    }
}

#[test]
fn law_map_servers_read_costs_that_rise_with_the_output_and_unseen_cells_as_unknown() {
    let mut ell = ell();
    let mut last = -1;
    for k in 0..=80 {
        let output = 0.1 + 0.01 * f64::from(k);
        ell.outputs[0] = Some(output);
        let map = cost_map(&ell, "a.pgm", Shown::Output).unwrap();
        let costs = map_servers(&map.yaml, map.pgm[map.pgm.len() - 2]);
        for cost in costs {
            assert!((f64::from(cost) - 1.25 * f64::from(k)).abs() <= 0.5 + 1e-9 && cost >= last, "{output}: {cost}");
        }
        last = costs[0];
        // The eastern column holds no cell but the lowest; the topmost cell is not judged.
        for unseen in map.pgm[map.pgm.len() - 6..].iter().take(2) {
            assert_eq!(map_servers(&map.yaml, *unseen), [-1, -1]);
        }
    }
    assert_eq!(last, 100);
    let map = cost_map(&ell, "a.pgm", Shown::Class).unwrap();
    let read: Vec<i32> = map.pgm[map.pgm.len() - 6..].iter().map(|&pixel| map_servers(&map.yaml, pixel)[0]).collect();
    assert_eq!(read, [-1, -1, 100, -1, 0, 100]);
    // The test can tell: the old form read unseen cells as half occupied.
    assert_eq!(map_servers("mode: scale\nnegate: 0\noccupied_thresh: 1.0\nfree_thresh: 0.0", 128), [50, 50]);
}

#[test]
fn extreme_a_map_without_bounds_is_refused() {
    let mut ell = ell();
    ell.cells.rows[3].index.row = i32::MAX - 16;
    ell.cells.rows[3].index.col = -(i32::MAX - 16);
    let error = cost_map(&ell, "a.pgm", Shown::Output).unwrap_err().to_string();
    assert!(error.contains("shorten --max-range"), "{error}");
}

#[test]
fn equal_labelled_clouds_read_back_in_the_map_frame() {
    let ell = ell();
    let turn = Pose { position_m: DVec3::new(-5.0, 10.0, 2.0), yaw_rad: 0.5, ..Pose::default() }.transform();
    let in_sensor = |p: DVec3| turn.inverse().point(p);
    let there = [
        DVec3::new(-4.75, 10.25, 1.0),
        DVec3::new(-4.25, 10.25, 1.5),
        DVec3::new(-4.75, 11.25, 1.0),
        DVec3::new(3.0, 3.0, 3.0),
    ];
    let cloud = Cloud { points_m: there.map(in_sensor).to_vec(), labels: Some(vec![4, 5, 6, 7]), ..Cloud::default() };
    let assigner = CellAssigner::of_sensor(GridSpec { size_m: 0.5 }, 50.0, turn);
    let points = export::labelled(&cloud, &[], &assigner, false, &ell);
    assert_eq!(points.iter().map(|p| p.class).collect::<Vec<_>>(), [0, 1, -1, -1]);
    let options = |field: &str| Options { label_field: Some(field.into()) };
    for (name, bytes, grain_m) in [
        ("a.ply", export::ply(&points, "two\nlines"), 1e-12),
        ("a.pcd", export::pcd(&points, DVec3::new(-5.0, 10.0, 2.5)), 1e-6),
    ] {
        let back = read(name, &bytes, None, &options("label")).unwrap();
        assert_eq!(back.labels, Some(vec![4, 5, 6, 7]));
        for (p, q) in back.points_m.iter().zip(there) {
            assert!((*p - q).length() < grain_m, "{name}: {p} {q}");
        }
        assert_eq!(read(name, &bytes, None, &options("class")).unwrap().labels, Some(vec![0, 1, -1, -1]));
    }
}

#[test]
fn extreme_labels_beyond_32_bits_come_back_and_no_cells_make_a_map_of_one_unknown_pixel() {
    let ell = ell();
    let assigner = CellAssigner::of_sensor(GridSpec { size_m: 0.5 }, 50.0, Transform::IDENTITY);
    let labels = vec![i64::from(u32::MAX), 1 << 40];
    let cloud = Cloud { points_m: vec![DVec3::ONE, DVec3::Y], labels: Some(labels.clone()), ..Cloud::default() };
    let points = export::labelled(&cloud, &[], &assigner, true, &ell);
    for (name, bytes) in [("a.ply", export::ply(&points, "")), ("a.pcd", export::pcd(&points, DVec3::ZERO))] {
        let back = read(name, &bytes, None, &Options { label_field: Some("label".into()) }).unwrap();
        assert_eq!(back.labels, Some(labels.clone()), "{name}");
    }
    let mut empty = ell;
    empty.cells.rows.clear();
    let map = cost_map(&empty, "a.pgm", Shown::Class).unwrap();
    assert_eq!(map.pgm, b"P5\n1 1\n255\n\x80");
    assert!(map.yaml.contains("origin: [0.0, 0.0, 0.0]"), "{}", map.yaml);
}

#[test]
fn equal_far_coordinates_come_back_from_ply_and_pcd() {
    let far =
        [DVec3::new(445_000.123_456_789, 5_030_000.987_654_321, 1_234.5), DVec3::new(445_001.0, 5_030_001.0, 1_234.0)];
    let near = [DVec3::new(3.123_456_789, -999.1, 0.5), DVec3::new(0.1, 0.2, 0.3)];
    let assigner = CellAssigner::of_sensor(GridSpec { size_m: 0.5 }, 50.0, Transform::IDENTITY);
    let ell = ell();
    for (there, size, most_m) in [(far, "SIZE 8 8 8 4 4 4 1 4\n", 1e-9), (near, "SIZE 4 4 4 4 4 4 1 4\n", 1e-3)] {
        let cloud = Cloud { points_m: there.to_vec(), ..Cloud::default() };
        let points = export::labelled(&cloud, &[], &assigner, true, &ell);
        let pcd = export::pcd(&points, DVec3::new(-5.0, 10.0, 2.5));
        let head = String::from_utf8_lossy(&pcd);
        assert!(head.contains(size) && head.contains("VIEWPOINT 0 0 0 1 0 0 0\n"), "{head}");
        assert!(head.contains("\n# frame map, metres; the sensor was at -5 10 2.5\nVERSION"), "{head}");
        for (name, bytes, most_m) in [("a.pcd", pcd, most_m), ("a.ply", export::ply(&points, ""), 0.0)] {
            let back = read(name, &bytes, None, &Options::default()).unwrap();
            for (p, q) in back.points_m.iter().zip(there) {
                assert!((*p - q).abs().max_element() <= most_m, "{name}: {p} {q}");
            }
        }
    }
}

#[test]
fn exact_mesh_faces_join_the_cells_that_are_there_and_look_up() {
    let ell = ell();
    let bytes = export::mesh(&ell);
    let head = String::from_utf8_lossy(&bytes);
    assert!(head.contains("element vertex 4\n") && head.contains("element face 1\n"));
    // Three of the lower square: one triangle, (20, -10), (20, -9), (21, -10).
    let mut face = vec![3u8];
    [0i32, 1, 2].iter().for_each(|v| face.extend(v.to_le_bytes()));
    assert!(bytes.ends_with(&face));
    let vertices = read("m.ply", &bytes, None, &Options::default()).unwrap().points_m;
    assert_eq!(vertices[2], DVec3::new(-4.75, 10.75, 2.0));
    let up = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]);
    assert!(up.z > 0.0);
}

#[test]
fn law_a_full_square_of_cells_is_meshed_without_gap_or_overlap() {
    // A disc of cells with a hole: the area of all triangles is that of the squares with four corners plus half of those with three.
    let inside = |r: i32, c: i32| (4..50).contains(&(r * r + c * c)) && (r * 7 + c * 3) % 11 != 0;
    let indices: Vec<(i32, i32)> =
        (-8..8).flat_map(|r| (-8..8).map(move |c| (r, c))).filter(|&(r, c)| inside(r, c)).collect();
    let points_m: Vec<DVec3> =
        indices.iter().map(|&(r, c)| DVec3::new(f64::from(c) + 0.5, f64::from(r) + 0.5, 0.0)).collect();
    let params = CellParams { size_m: 1.0, ..CellParams::default() };
    let estimate = crate::slam::truth(&Pose::default());
    let map_from_sensor = Transform::IDENTITY;
    let cloud = WindowCloud {
        points_m: &points_m,
        in_map: true,
        intensity: None,
        obstacle: None,
        estimate: &estimate,
        map_from_sensor,
    };
    let (cells, _) = cells::bin_clouds(&params, &[cloud], 50.0, &mut cells::Scratch::default());
    let outputs = vec![Some(0.5); cells.rows.len()];
    let judged = judged(cells, outputs, 1.0, 0.0);
    let bytes = export::mesh(&judged);
    let corners =
        |r: i32, c: i32| [(0, 0), (0, 1), (1, 0), (1, 1)].iter().filter(|(i, j)| inside(r + i, c + j)).count();
    let squares = (-9..9).flat_map(|r| (-9..9).map(move |c| (r, c)));
    let triangles: usize = squares.map(|(r, c)| corners(r, c).saturating_sub(2)).sum();
    let head = String::from_utf8_lossy(&bytes);
    assert!(head.contains(&format!("element face {triangles}\n")), "{triangles}");
    // Each triangle looks up, and none is there twice.
    let mut seen = BTreeMap::new();
    for face in bytes[bytes.len() - 13 * triangles..].chunks(13) {
        let corner = |k: usize| i32::from_le_bytes(face[1 + 4 * k..5 + 4 * k].try_into().unwrap()) as usize;
        let [a, b, c] = [0, 1, 2].map(|k| points_m_of(&judged.cells, corner(k)));
        assert_eq!((b - a).cross(c - a).z, 1.0);
        *seen.entry(face.to_vec()).or_insert(0) += 1;
    }
    assert!(seen.values().all(|&count| count == 1));
}

fn points_m_of(cells: &Cells, row: usize) -> DVec3 {
    let (x, y) = GridSpec { size_m: 1.0 }.centre_m(cells.rows[row].index);
    DVec3::new(x, y, 0.0)
}

#[test]
fn exact_verdicts_of_points_make_the_labels_of_cells() {
    // Cells of 1 m along x: two obstacle points; one of each; an ignored one; an ignored one and a traversable one.
    let xs = [0.2, 0.7, 1.2, 1.7, 2.5, 3.2, 3.7];
    let verdicts = [Some(true), Some(true), Some(true), Some(false), None, None, Some(false)];
    let points_m = xs.map(|x| DVec3::new(x, 0.5, 0.0));
    let estimate = crate::slam::truth(&Pose::default());
    let bin = |min_obstacle_points| {
        let labels = crate::cells::params::LabelParams { min_obstacle_points, ..Default::default() };
        let params = CellParams { size_m: 1.0, labels, ..CellParams::default() };
        let cloud = WindowCloud {
            points_m: &points_m,
            in_map: false,
            intensity: None,
            obstacle: Some(&verdicts),
            estimate: &estimate,
            map_from_sensor: Transform::IDENTITY,
        };
        cells::bin_clouds(&params, &[cloud], 50.0, &mut cells::Scratch::default())
    };
    let (cells, known) = bin(1);
    assert_eq!(
        cells.rows.iter().map(|row| row.label.map(Label::number)).collect::<Vec<_>>(),
        [Some(1), Some(1), None, Some(0)]
    );
    assert_eq!(cells.rows.iter().map(|row| row.truth.obstacle_points).collect::<Vec<_>>(), [2, 1, 0, 0]);
    assert_eq!((known, cells.rows[3].points), (vec![2, 2, 0, 1], 2));
    assert_eq!(bin(2).0.rows[1].label, Some(Label::Traversable));
}
