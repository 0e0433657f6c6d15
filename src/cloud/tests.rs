//! Every format against points that are known; hostile files; the files that go out, read back.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::costmap::{Shown, cost_map};
use super::export::{self, Judged};
use super::*;
use crate::cells::{self, CellParams, Cells, Placer, WindowCloud};
use crate::geometry::{GridSpec, Pose, Transform};

/// Points that f32 holds exactly, with intensities and labels.
fn known() -> Cloud {
    let points_m = (0..37).map(|i| DVec3::new(0.25 * f64::from(i), -1.5, 0.125 * f64::from(i % 5))).collect();
    Cloud {
        points_m,
        intensity: Some((0..37).map(|i| 0.5 * i as f32).collect()),
        labels: Some((0..37).map(|i| i % 4).collect()),
        not_finite: 0,
    }
}

fn rows(cloud: &Cloud) -> impl Iterator<Item = (DVec3, f32, i64)> + '_ {
    let values = cloud.intensity.as_ref().unwrap().iter().zip(cloud.labels.as_ref().unwrap());
    cloud.points_m.iter().zip(values).map(|(&p, (&i, &l))| (p, i, l))
}

fn parse(name: &str, bytes: &[u8]) -> Result<Cloud, CloudError> {
    read(name, bytes, None, &Options::default())
}

fn text_rows(cloud: &Cloud, between: &str) -> String {
    rows(cloud)
        .map(|(p, i, l)| [p.x, p.y, p.z, f64::from(i), l as f64].map(|v| v.to_string()).join(between) + "\n")
        .collect()
}

/// An element before the vertices, a list and a stranger within them.
fn ply_bytes(format: &str) -> Vec<u8> {
    let big = format == "binary_big_endian";
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment made by hand\nelement camera 2\nproperty float fov\nproperty list uchar short ids\n\
         element vertex 37\nproperty float x\nproperty list uchar int tags\nproperty double y\nproperty float z\n\
         property ushort stranger\nproperty float intensity\nproperty uchar label\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let cloud = known();
    if format == "ascii" {
        bytes.extend(b"60 2 7 8\n60 0\n");
        for (k, (p, i, l)) in rows(&cloud).enumerate() {
            let tags = if k % 2 == 0 { "2 5 6" } else { "0" };
            bytes.extend(format!("{} {tags} {} {} 9 {i} {l}\n", p.x, p.y, p.z).into_bytes());
        }
        bytes.extend(b"3 0 1 2\n");
        return bytes;
    }
    let mut put = |value: &[u8]| {
        let mut value = value.to_vec();
        if big {
            value.reverse();
        }
        bytes.extend(value);
    };
    put(&60f32.to_le_bytes());
    put(&[2]);
    put(&7i16.to_le_bytes());
    put(&8i16.to_le_bytes());
    put(&60f32.to_le_bytes());
    put(&[0]);
    for (k, (p, i, l)) in rows(&cloud).enumerate() {
        put(&(p.x as f32).to_le_bytes());
        put(&[k as u8 % 3]);
        (0..k % 3).for_each(|tag| put(&(tag as i32).to_le_bytes()));
        put(&p.y.to_le_bytes());
        put(&(p.z as f32).to_le_bytes());
        put(&9u16.to_le_bytes());
        put(&i.to_le_bytes());
        put(&[l as u8]);
    }
    put(&[3]);
    (0..3).for_each(|v: i32| put(&v.to_le_bytes()));
    bytes
}

fn pcd_bytes(data: &str) -> Vec<u8> {
    let cloud = known();
    let mut bytes = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z normal intensity label\nSIZE 4 4 8 4 4 2\nTYPE F F F F F U\nCOUNT 1 1 1 3 1 1\n\
         WIDTH 37\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 37\nDATA {data}\n"
    )
    .into_bytes();
    let fields = |(p, i, l): (DVec3, f32, i64)| {
        [
            (p.x as f32).to_le_bytes().to_vec(),
            (p.y as f32).to_le_bytes().to_vec(),
            p.z.to_le_bytes().to_vec(),
            [1f32, 2.0, 3.0].iter().flat_map(|v| v.to_le_bytes()).collect(),
            i.to_le_bytes().to_vec(),
            (l as u16).to_le_bytes().to_vec(),
        ]
    };
    match data {
        "ascii" => {
            rows(&cloud).for_each(|(p, i, l)| bytes.extend(format!("{} {} {} 1 2 3 {i} {l}\n", p.x, p.y, p.z).bytes()))
        }
        "binary" => rows(&cloud).for_each(|row| fields(row).into_iter().for_each(|field| bytes.extend(field))),
        _ => {
            let plain: Vec<u8> = (0..6)
                .flat_map(|k| rows(&cloud).flat_map(move |row| fields(row)[k].clone()).collect::<Vec<u8>>())
                .collect();
            let packed = lzf::squeeze(&plain);
            bytes.extend((packed.len() as u32).to_le_bytes());
            bytes.extend((plain.len() as u32).to_le_bytes());
            bytes.extend(packed);
        }
    }
    bytes
}

fn las_bytes(format: u8, minor: u8) -> Vec<u8> {
    let mut builder = ::las::Builder::from((1, minor));
    builder.point_format = ::las::point::Format::new(format).unwrap();
    let axis = |offset| ::las::Transform { scale: 0.125, offset };
    builder.transforms = ::las::Vector { x: axis(100.0), y: axis(0.0), z: axis(-1.0) };
    let mut writer = ::las::Writer::new(std::io::Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for (p, i, l) in rows(&known()) {
        let classification = ::las::point::Classification::new(l as u8).unwrap();
        let format = ::las::point::Format::new(format).unwrap();
        let point = ::las::Point {
            x: p.x,
            y: p.y,
            z: p.z,
            intensity: (2.0 * i) as u16,
            classification,
            gps_time: format.has_gps_time.then_some(0.0),
            color: format.has_color.then(::las::Color::default),
            ..Default::default()
        };
        writer.write_point(point).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

fn kitti_bytes() -> (Vec<u8>, Vec<u8>) {
    let cloud = known();
    let points =
        rows(&cloud).flat_map(|(p, i, _)| [p.x as f32, p.y as f32, p.z as f32, i].map(f32::to_le_bytes).concat());
    // The upper half holds an instance.
    let labels = rows(&cloud).flat_map(|(_, _, l)| (0xabcd_0000 | l as u32).to_le_bytes());
    (points.collect(), labels.collect())
}

#[test]
fn exact_every_format_gives_the_points_that_were_written() {
    let known = known();
    let header = "label;intensity;Z;x;y;name\n";
    let turned: String = rows(&known).map(|(p, i, l)| format!("{l};{i};{};{};{};a\n", p.z, p.x, p.y)).collect();
    let files = [
        ("a.ply", ply_bytes("ascii")),
        ("b.ply", ply_bytes("binary_little_endian")),
        ("c.PLY", ply_bytes("binary_big_endian")),
        ("a.pcd", pcd_bytes("ascii")),
        ("b.pcd", pcd_bytes("binary")),
        ("c.pcd", pcd_bytes("binary_compressed")),
        ("a.csv", (header.to_string() + &turned).into_bytes()),
        (
            "b.csv",
            format!("\u{feff}x,y,z,intensity,class\r\n{}", text_rows(&known, ", ").replace('\n', "\r\n")).into_bytes(),
        ),
        ("a.xyz", format!("//X Y Z Intensity Classification\n# more\n\n{}", text_rows(&known, " ")).into_bytes()),
        ("a.txt", format!("x y z intensity label\n{}", text_rows(&known, "\t")).into_bytes()),
    ];
    for (name, bytes) in files {
        assert_eq!(parse(name, &bytes).unwrap(), known, "{name}");
    }
    let (points, labels) = kitti_bytes();
    assert_eq!(read("a.bin", &points, Some(&labels), &Options::default()).unwrap(), known);
    for (format, minor) in [(0, 0), (1, 2), (3, 2), (6, 4), (7, 4)] {
        let doubled = known.intensity.as_ref().map(|values| values.iter().map(|v| 2.0 * v).collect());
        let there = parse("a.las", &las_bytes(format, minor)).unwrap();
        assert_eq!(there, Cloud { intensity: doubled, ..known.clone() }, "format {format}");
    }
}

#[test]
fn exact_nameless_columns_are_x_y_z_and_of_four_the_intensity() {
    let three = parse("a.xyz", b"# a comment\n1 2 3\n4,5,6\n").unwrap();
    assert_eq!((three.points_m.len(), &three.intensity, &three.labels), (2, &None, &None));
    assert_eq!(three.points_m[1], DVec3::new(4.0, 5.0, 6.0));
    assert_eq!(parse("a.csv", b"1;2;3;9\n").unwrap().intensity, Some(vec![9.0]));
    let colours = parse("a.pts", b"2\n1 2 3 -7 255 0 0\n4 5 6 -8 255 0 0\n").unwrap();
    assert_eq!((colours.points_m.len(), colours.intensity), (2, None));
}

#[test]
fn exact_points_without_a_place_are_counted_and_left_out_with_their_labels() {
    let cloud = parse("a.csv", b"x,y,z,label\n1,2,3,7\nnan,0,0,8\n0,inf,0,9\n4,5,6,10\n0,0,0,11\n").unwrap();
    assert_eq!((cloud.points_m.len(), cloud.not_finite, cloud.labels.clone()), (3, 2, Some(vec![7, 10, 11])));
    let mut cloud = cloud;
    assert_eq!(cloud.drop_at(DVec3::ZERO), 1);
    assert_eq!((cloud.points_m.len(), cloud.labels), (2, Some(vec![7, 10])));
    let error = parse("a.csv", b"x,y,z\nnan,0,0\n").unwrap_err().to_string();
    assert!(error.contains("a.csv") && error.contains("1 are NaN or infinite"), "{error}");
}

#[test]
fn exact_the_label_column_can_be_named() {
    let text = b"x,y,z,label,truth_class\n1,2,3,7,1\n";
    let named = |name: &str| read("a.csv", text, None, &Options { label_field: Some(name.into()) });
    assert_eq!(named("truth_class").unwrap().labels, Some(vec![1]));
    assert!(named("other").unwrap_err().to_string().contains("no label column 'other'"));
}

#[test]
fn extreme_every_file_cut_anywhere_is_refused_or_says_what_is_there() {
    let files = [
        ("a.ply", ply_bytes("ascii")),
        ("b.ply", ply_bytes("binary_little_endian")),
        ("a.pcd", pcd_bytes("ascii")),
        ("b.pcd", pcd_bytes("binary")),
        ("c.pcd", pcd_bytes("binary_compressed")),
        ("a.las", las_bytes(3, 2)),
    ];
    for (name, bytes) in &files {
        // The face behind the vertices is never read, and a last digit may go unnoticed in text.
        let needed = bytes.len() - 40;
        for end in (0..needed).step_by(7) {
            let error = parse(name, &bytes[..end]).unwrap_err().to_string();
            assert!(error.starts_with(name), "{name} cut at {end}: {error}");
        }
    }
    let (points, labels) = kitti_bytes();
    assert!(parse("a.bin", &points[..37]).is_err());
    assert!(read("a.bin", &points, Some(&labels[..8]), &Options::default()).is_err());
    for name in ["a.ply", "a.pcd", "a.las", "a.csv", "a.bin", "a.laz", "a.e57", "a"] {
        assert!(parse(name, b"").unwrap_err().to_string().starts_with(name));
    }
}

#[test]
fn extreme_headers_that_promise_too_much_reserve_nothing() {
    let ply = |text: &str| parse("a.ply", text.as_bytes()).unwrap_err().to_string();
    let xyz = "property float x\nproperty float y\nproperty float z\nend_header\n1";
    for format in ["ascii", "binary_little_endian"] {
        ply(&format!("ply\nformat {format} 1.0\nelement vertex 18446744073709551615\n{xyz}"));
        ply(&format!(
            "ply\nformat {format} 1.0\nelement a 18446744073709551615\nproperty double b\nelement vertex 1\n{xyz}"
        ));
        ply(&format!("ply\nformat {format} 1.0\nelement a 18446744073709551615\nelement vertex 1\n{xyz}"));
        ply(&format!("ply\nformat {format} 1.0\nelement vertex 9\nproperty list uint double d\n{xyz}"));
    }
    let pcd = |size: &str, kind: &str, count: &str, points: &str, data: &str| {
        let text = format!(
            "FIELDS x y z\nSIZE {size}\nTYPE {kind}\nCOUNT {count}\nWIDTH 1\nHEIGHT 1\nPOINTS {points}\nDATA {data}\n12345678"
        );
        parse("a.pcd", text.as_bytes()).unwrap_err().to_string()
    };
    for data in ["ascii", "binary", "binary_compressed"] {
        pcd("4 4 4", "F F F", "1 1 1", "18446744073709551615", data);
        pcd("4 4 4", "F F F", "18446744073709551615 18446744073709551615 1", "2", data);
        pcd("4 4 4", "F F F", "0 0 0", "18446744073709551615", data);
        pcd("4 4 3", "F F F", "1 1 1", "1", data);
    }
    // A little LZF that claims 4 GB.
    let mut bomb =
        b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 357913941\nDATA binary_compressed\n".to_vec();
    bomb.extend(100u32.to_le_bytes());
    bomb.extend(u32::MAX.to_le_bytes());
    bomb.extend([0xff; 100]);
    assert!(parse("a.pcd", &bomb).is_err());
    let mut las = las_bytes(6, 4);
    // Number of points (1.4) at byte 247.
    las[247..255].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(parse("a.las", &las).unwrap_err().to_string().contains("the file was cut off"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn extreme_damaged_files_of_any_format_never_panic(
        which in 0usize..9,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let (name, mut bytes) = match which {
            0 => ("a.ply", ply_bytes("ascii")),
            1 => ("a.ply", ply_bytes("binary_little_endian")),
            2 => ("a.ply", ply_bytes("binary_big_endian")),
            3 => ("a.pcd", pcd_bytes("ascii")),
            4 => ("a.pcd", pcd_bytes("binary")),
            5 => ("a.pcd", pcd_bytes("binary_compressed")),
            6 => ("a.las", las_bytes(1, 2)),
            7 => ("a.las", las_bytes(6, 4)),
            _ => ("a.csv", format!("x,y,z,intensity,label\n{}", text_rows(&known(), ",")).into_bytes()),
        };
        for (at, value) in damage {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(cloud) = parse(name, &bytes) {
            prop_assert!(!cloud.points_m.is_empty() && cloud.points_m.iter().all(|p| p.is_finite()));
            prop_assert!(cloud.intensity.is_none_or(|values| values.len() == cloud.points_m.len()));
            prop_assert!(cloud.labels.is_none_or(|labels| labels.len() == cloud.points_m.len()));
        }
    }

    #[test]
    fn extreme_any_bytes_behind_any_name_never_panic(
        name in prop::sample::select(vec!["a.ply", "a.pcd", "a.las", "a.csv", "a.bin"]),
        bytes in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let _ = parse(name, &bytes);
    }
}

/// Cells of an L: (0, 0), (0, 1), (2, 0) and (1, 0), outputs rising; one of them not judged.
struct Ell {
    cells: Cells,
    outputs: Vec<Option<f64>>,
    classes: Vec<Option<usize>>,
}

fn ell() -> Ell {
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
    assert!(cells.rows.iter().all(|row| row.label.is_none() && row.truth.class == -1));
    // Rows in order: (20, -10), (20, -9), (21, -10), (22, -10).
    Ell { cells, outputs: vec![Some(0.1), Some(0.5), Some(1.0), None], classes: vec![Some(0), Some(1), Some(1), None] }
}

fn judged(ell: &Ell) -> Judged<'_> {
    Judged {
        cells: &ell.cells,
        outputs: &ell.outputs,
        classes: &ell.classes,
        of_classes: 2,
        targets: [0.1, 0.9],
        grid: GridSpec { size_m: 0.5 },
        rover_z_m: 1.0,
    }
}

#[test]
fn exact_cost_map_has_north_up_and_its_origin_at_the_lower_left_corner() {
    let ell = ell();
    let map = cost_map(&judged(&ell), "scan-cost.pgm", Shown::Output).unwrap();
    // From the top: (22) unknown, (21) output 1.0 beyond the target, (20) 0.1 and 0.5; the eastern column is empty but below.
    assert_eq!(map.pgm, b"P5\n2 3\n255\n\x80\x80\x00\x80\xff\x80".to_vec());
    assert_eq!(
        map.yaml,
        "image: scan-cost.pgm\nmode: scale\nresolution: 0.5\norigin: [-5.0, 10.0, 0.0]\nnegate: 0\n\
         occupied_thresh: 1.0\nfree_thresh: 0.0\n"
    );
    let map = cost_map(&judged(&ell), "scan-class.pgm", Shown::Class).unwrap();
    assert_eq!(map.pgm, b"P5\n2 3\n255\n\x80\x80\x00\x80\xff\x00".to_vec());
    assert!(map.yaml.contains("mode: trinary\n") && map.yaml.ends_with("occupied_thresh: 0.65\nfree_thresh: 0.25\n"));
}

/// What nav2_map_server makes of a pixel (map_io.cpp, `MapMode::Scale`): -1 unknown, 0 to 100.
fn nav2_scale(pixel: u8, free: f64, occupied: f64) -> i32 {
    let occupancy = 1.0 - f64::from(pixel) / 255.0;
    if occupied <= occupancy {
        100
    } else if occupancy <= free {
        0
    } else {
        ((occupancy - free) / (occupied - free) * 100.0).round() as i32
    }
}

#[test]
fn law_a_map_server_reads_costs_that_rise_with_the_output() {
    let mut ell = ell();
    let mut last = -1;
    for k in 0..=80 {
        let output = 0.1 + 0.01 * f64::from(k);
        ell.outputs[0] = Some(output);
        let pgm = cost_map(&judged(&ell), "a.pgm", Shown::Output).unwrap().pgm;
        let cost = nav2_scale(pgm[pgm.len() - 2], 0.0, 1.0);
        assert!((f64::from(cost) - 1.25 * f64::from(k)).abs() <= 1.0 && cost >= last, "{output}: {cost}");
        last = cost;
    }
    assert_eq!(last, 100);
}

#[test]
fn extreme_a_map_without_bounds_is_refused() {
    let mut ell = ell();
    ell.cells.rows[3].index.row = i32::MAX - 16;
    ell.cells.rows[3].index.col = -(i32::MAX - 16);
    let error = cost_map(&judged(&ell), "a.pgm", Shown::Output).unwrap_err().to_string();
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
    let placer = Placer::of_sensor(GridSpec { size_m: 0.5 }, 50.0, turn);
    let points = export::labelled(&cloud, &placer, false, &judged(&ell));
    assert_eq!(points.iter().map(|p| p.class).collect::<Vec<_>>(), [0, 1, -1, -1]);
    let options = |field: &str| Options { label_field: Some(field.into()) };
    for (name, bytes, grain_m) in
        [("a.ply", export::ply(&points, "two\nlines"), 1e-12), ("a.pcd", export::pcd(&points), 1e-6)]
    {
        let back = read(name, &bytes, None, &options("label")).unwrap();
        assert_eq!(back.labels, Some(vec![4, 5, 6, 7]));
        for (p, q) in back.points_m.iter().zip(there) {
            assert!((*p - q).length() < grain_m, "{name}: {p} {q}");
        }
        assert_eq!(read(name, &bytes, None, &options("class")).unwrap().labels, Some(vec![0, 1, -1, -1]));
    }
}

#[test]
fn exact_mesh_faces_join_the_cells_that_are_there_and_look_up() {
    let ell = ell();
    let bytes = export::mesh(&judged(&ell), "ell");
    let head = String::from_utf8_lossy(&bytes);
    assert!(head.contains("element vertex 4\n") && head.contains("element face 1\n"));
    // Three of the lower square: one triangle, (20, -10), (20, -9), (21, -10).
    let mut face = vec![3u8];
    [0i32, 1, 2].iter().for_each(|v| face.extend(v.to_le_bytes()));
    assert!(bytes.ends_with(&face));
    let vertices = parse("m.ply", &bytes).unwrap().points_m;
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
    let (outputs, classes) = (vec![Some(0.5); cells.rows.len()], vec![Some(1); cells.rows.len()]);
    let judged = Judged {
        cells: &cells,
        outputs: &outputs,
        classes: &classes,
        of_classes: 2,
        targets: [0.1, 0.9],
        grid: GridSpec { size_m: 1.0 },
        rover_z_m: 0.0,
    };
    let bytes = export::mesh(&judged, "disc");
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
        let [a, b, c] = [0, 1, 2].map(|k| points_m_of(&cells, corner(k)));
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
    assert_eq!(cells.rows.iter().map(|row| row.label).collect::<Vec<_>>(), [Some(1), Some(1), None, Some(0)]);
    assert_eq!(cells.rows.iter().map(|row| row.truth.obstacle_points).collect::<Vec<_>>(), [2, 1, 0, 0]);
    assert_eq!((known, cells.rows[3].points), (vec![2, 2, 0, 1], 2));
    assert_eq!(bin(2).0.rows[1].label, Some(0));
}
