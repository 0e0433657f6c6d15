use marsyard::cells::level;
use marsyard::cloud::{LabelMap, Options, read, trajectory};
use proptest::prelude::*;

use crate::edits::{apply, cases, edits};
use crate::heap::bounded;

const TOKENS: &[&str] = &[
    "\n",
    " ",
    ",",
    "nan",
    "inf",
    "-1",
    "ply\n",
    "end_header\n",
    "element vertex 4294967295\n",
    "element face 9223372036854775807\n",
    "property list uchar int vertex_indices\n",
    "property list double double x\n",
    "property float x\n",
    "property char label\n",
    "format binary_big_endian 1.0\n",
    "format ascii 1.0\n",
    "DATA binary\n",
    "DATA ascii\n",
    "DATA binary_compressed\n",
    "POINTS 0\n",
    "POINTS 18446744073709551615\n",
    "WIDTH 4294967295\nHEIGHT 4294967295\n",
    "COUNT 4294967295 1 1 1\n",
    "COUNT 0 0 0 0\n",
    "SIZE 8 8 8 8\n",
    "TYPE U U U U\n",
    "FIELDS x x x x\n",
    "#",
    "x y z\n",
    "x,y,z,label\n",
    "LASF",
];

/// One small valid file of each kind and encoding, by name.
fn clouds() -> Vec<(&'static str, Vec<u8>)> {
    let ply = |format: &str, before: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment by hand\n{before}element vertex 3\nproperty float x\nproperty double y\nproperty \
             short z\nproperty uchar label\nproperty list uchar int more\nproperty float intensity\nend_header\n"
        )
    };
    let rows = |big_endian: bool| {
        let mut body = Vec::new();
        for k in 0..3u8 {
            let mut put = |mut bytes: Vec<u8>| {
                if big_endian {
                    bytes.reverse();
                }
                body.extend(bytes);
            };
            put(f32::from(k).to_le_bytes().to_vec());
            put(f64::from(k).to_le_bytes().to_vec());
            put(i16::from(k).to_le_bytes().to_vec());
            put(vec![k]);
            put(vec![2]);
            put(7i32.to_le_bytes().to_vec());
            put(9i32.to_le_bytes().to_vec());
            put(0.5f32.to_le_bytes().to_vec());
        }
        body
    };
    let faces = "element face 2\nproperty list uchar uchar vertex_indices\n";
    let face_bytes = vec![3, 0, 1, 2, 1, 0];
    let pcd = |data: &str| {
        format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z label\nSIZE 4 4 4 2\nTYPE F F F U\nCOUNT 1 1 1 2\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 \
             0 0\nPOINTS 3\nDATA {data}\n"
        )
    };
    let by_point: Vec<u8> = (0..3u8).flat_map(|k| [[0, 0, 128, 63].repeat(3), vec![k, 0, 0, 0]].concat()).collect();
    let by_field: Vec<u8> = [[0, 0, 128, 63].repeat(9), [1, 0, 0, 0].repeat(3)].concat();
    // LZF of literals alone, 32 at a time, but for the last 12 bytes: a copy of three times 4.
    let literal = &by_field[..40];
    let mut packed: Vec<u8> =
        literal.chunks(32).flat_map(|part| [vec![part.len() as u8 - 1], part.to_vec()].concat()).collect();
    packed.extend([6 << 5, 3]);
    let sizes = [(packed.len() as u32).to_le_bytes(), 48u32.to_le_bytes()].concat();
    vec![
        (
            "a.ply",
            [ply("ascii", faces).as_bytes(), b"3 0 1 2\n1 0\n0 1 2 3 2 7 9 0.5\n1 1 2 3 0 0.5\n2 1 2 3 1 5 0.5\n"]
                .concat(),
        ),
        ("b.ply", [ply("binary_little_endian", faces).as_bytes(), &face_bytes, &rows(false)].concat()),
        ("c.ply", [ply("binary_big_endian", "").as_bytes(), &rows(true)].concat()),
        ("a.pcd", [pcd("ascii").as_bytes(), b"1 1 1 0 0\n1 2 1 1 0\nnan 1 1 2 0\n"].concat()),
        ("b.pcd", [pcd("binary").as_bytes(), &by_point].concat()),
        ("c.pcd", [pcd("binary_compressed").as_bytes(), &sizes, &packed].concat()),
        ("a.las", las()),
        ("a.csv", b"x,y,z,intensity,label\n1,2,3,0.5,4\n2,3,4,0.25,5\n".to_vec()),
        ("b.xyz", b"# a scan\n3\n1 2 3 0.5\n2 3 4 0.5\n3 4 5 0.5\n".to_vec()),
        ("a.bin", [1f32, 2.0, 3.0, 0.5].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().repeat(3)),
    ]
}

/// LAS 1.2, point format 0, three points (ASPRS LAS specification 1.2, tables 1 and 4).
fn las() -> Vec<u8> {
    let mut bytes = b"LASF".to_vec();
    bytes.resize(24, 0);
    bytes.extend([1, 2]);
    bytes.resize(94, 0);
    bytes.extend(227u16.to_le_bytes());
    bytes.extend(227u32.to_le_bytes());
    bytes.extend(0u32.to_le_bytes());
    bytes.push(0);
    bytes.extend(20u16.to_le_bytes());
    bytes.extend(3u32.to_le_bytes());
    bytes.resize(131, 0);
    for value in [0.01, 0.01, 0.01, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0] {
        bytes.extend(f64::to_le_bytes(value));
    }
    for k in 0..3i32 {
        for value in [100 * k, 50, 20] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([5, 0, 9, 2, 0, 0, 0, 0]);
    }
    bytes
}

#[test]
fn the_files_that_are_broken_below_are_whole() {
    for (name, bytes) in clouds() {
        let cloud = read(name, &bytes, None, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
        assert!(!cloud.points_m.is_empty(), "{name}");
    }
}

fn read_bounded(name: &str, bytes: &[u8], labels: Option<&[u8]>) {
    let size = bytes.len() + labels.map_or(0, <[u8]>::len);
    let cloud = bounded(size, || read(name, bytes, labels, &Options::default()));
    match cloud {
        Ok(cloud) => {
            let points = cloud.points_m.len();
            assert!(cloud.points_m.iter().all(|point| point.is_finite()));
            assert!(cloud.intensity.is_none_or(|values| values.len() == points));
            assert!(cloud.labels.is_none_or(|values| values.len() == points));
            // Coordinates may be anything finite: the ground is found in them or not.
            let _ = bounded(size, || level::level(&cloud.points_m, 0.5).map(|_| ()));
        }
        Err(error) => assert!(error.to_string().len() < 2000 && error.to_string().starts_with(name), "{error}"),
    }
}

proptest! {
    #![proptest_config(cases(400))]

    #[test]
    fn extreme_broken_clouds_are_read_or_refused(which in 0..10usize, edits in edits(TOKENS)) {
        let (name, bytes) = &clouds()[which];
        read_bounded(name, &apply(bytes, &edits), None);
    }

    /// A file under the name of another format.
    #[test]
    fn extreme_clouds_under_a_wrong_name_are_read_or_refused(which in 0..10usize, named in 0..10usize, edits in edits(TOKENS)) {
        read_bounded(clouds()[named].0, &apply(&clouds()[which].1, &edits), None);
    }

    #[test]
    fn extreme_broken_kitti_labels_are_read_or_refused(labels in prop::collection::vec(any::<u8>(), 0..20)) {
        read_bounded("a.bin", &clouds()[9].1, Some(&labels));
    }

    #[test]
    fn extreme_broken_trajectories_are_read_or_refused(edits in edits(&["\n", " ", "#", "nan", "1e308", ","])) {
        let text = "# t x y z qx qy qz qw\n100.0 1 0 0 0 0 0 1\n100.1 2 0 0 0 0 0.1 0.995\n";
        let text = String::from_utf8_lossy(&apply(text.as_bytes(), &edits)).into_owned();
        bounded(text.len(), || {
            if let Ok(poses) = trajectory::parse("a.tum", &text) {
                let finite = |pose: &marsyard::geometry::Pose| pose.position_m.is_finite() && pose.yaw_rad.is_finite();
                assert!(poses.iter().all(|(time_s, pose)| time_s.is_finite() && finite(pose)));
                let _ = trajectory::match_clouds("a.tum", &poses, &["100.1".into(), "x".into()], 0.02);
            }
        });
    }

    #[test]
    fn extreme_broken_label_mappings_are_read_or_refused(
        edits in edits(&["&a ", "*a", "{", "[", ": ", "- ", "<<: ", "\n", "!!binary ", "others: ", "? "]),
    ) {
        let text = "labels: {40: traversable, 50: untraversable, 0: ignore}\nothers: ignore\n";
        let text = String::from_utf8_lossy(&apply(text.as_bytes(), &edits)).into_owned();
        bounded(text.len(), || LabelMap::parse("labels.yaml", &text).map(|map| map.verdicts("a.ply", &[40, 7])).is_ok());
    }
}

#[test]
fn extreme_announced_counts_cost_nothing() {
    for count in ["2147483648", "9223372036854775808", "18446744073709551615"] {
        let number = |text: &[u8]| String::from_utf8_lossy(text).replace("3\n", &format!("{count}\n")).into_bytes();
        for (name, bytes) in clouds().into_iter().filter(|(name, _)| name.ends_with("ply") || name.ends_with("pcd")) {
            let body =
                bytes.windows(5).position(|w| w == b"DATA ").or(bytes.windows(10).position(|w| w == b"end_header"));
            let (head, rest) = bytes.split_at(body.expect("a header"));
            read_bounded(name, &[&number(head), rest].concat(), None);
        }
    }
}
