//! Every format against points that are known; hostile files.

use proptest::prelude::*;

use super::*;
use crate::cloud::*;

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
    let three = parse("a.xyz", b"# a comment\n1 2 3\n4 5 6\n").unwrap();
    assert_eq!((three.points_m.len(), &three.intensity, &three.labels), (2, &None, &None));
    assert_eq!(three.points_m[1], DVec3::new(4.0, 5.0, 6.0));
    assert_eq!(parse("a.csv", b"1;2;3;9\n").unwrap().intensity, Some(vec![9.0]));
    let colours = parse("a.pts", b"2\n1 2 3 -7 255 0 0\n4 5 6 -8 255 0 0\n").unwrap();
    assert_eq!((colours.points_m.len(), colours.intensity), (2, None));
}

#[test]
fn exact_nothing_between_two_separators_is_a_value_that_is_not_there() {
    let cloud = parse("a.csv", b",x,y,z,intensity,ring,label\n0,1,2,3,9,5,7\n1,4,5,,9,6,8\n2,7,8,9,,6,\n").unwrap();
    assert_eq!(
        (cloud.points_m.as_slice(), cloud.not_finite),
        ([DVec3::new(1.0, 2.0, 3.0), DVec3::new(7.0, 8.0, 9.0)].as_slice(), 1)
    );
    assert_eq!(cloud.labels, Some(vec![7, -1]));
    assert!(cloud.intensity.unwrap()[1].is_nan());
    // A separator at the end of lines holds no value, unless a column is there.
    assert_eq!(parse("a.csv", b"x;y;z;\n1;2;3;\n4;5;6\n").unwrap().points_m.len(), 2);
    assert_eq!(parse("a.csv", b"x,y,z,intensity\n1,2,3,\n").unwrap().points_m.len(), 1);
}

#[test]
fn exact_lines_of_other_lengths_and_decimal_commas_are_refused() {
    let refused = |text: &str| parse("a.csv", text.as_bytes()).unwrap_err().to_string();
    for (text, cure) in [
        ("x,y,z\n1,2,3\n1,2,3,4\n", "decimals are written with points"),
        ("1 2 3\n1 2 3 4\n", "all lines need as many"),
        ("x,y,z,ring\n1,2,3,4\n1,2,3\n", "all lines need as many"),
        ("x\ty\tz\n1\t2\t3\n1\t\t2\t3\n", "all lines need as many"),
    ] {
        let error = refused(text);
        assert!(
            error.starts_with("a.csv: line ")
                && error.contains("values where the lines before have")
                && error.contains(cure),
            "{text}: {error}"
        );
    }
    assert_eq!(
        refused("x;y;z\n3,6;3,6;-0,5\n"),
        "a.csv: line 2: '3,6' is not a number; decimals are written with points"
    );
    assert!(
        refused("x y z\n1,5 2,5 3,5\n").ends_with("line 2: '1,5' is not a number; decimals are written with points")
    );
    for text in ["1,5;0,5;-0,1\n", "1,5 0,5 -0,1\n"] {
        assert!(
            refused(text).ends_with("line 1: numbers that cannot be told apart; decimals are written with points"),
            "{}",
            refused(text)
        );
    }
}

#[test]
fn exact_names_are_found_as_other_programs_write_them() {
    let whole = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)];
    for text in [
        "# z, y, x [m]\n3,2,1\n6,5,4\n",
        "# intensity, x [m], y [m], z [m]\n9,1,2,3\n9,4,5,6\n",
        "x (m) y (m) z (m)\n1 2 3\n4 5 6\n",
        "# x y z intensity (normalized)\n1 2 3 9\n4 5 6 9\n",
        "# x y z\n1,2,3\n4,5,6\n",
        "//X Y Z\n2\n1 2 3\n4 5 6\n",
        "\"X\" \"Y\" \"Z\" \"Scalar field\"\n1 2 3 9\n4 5 6 9\n",
        "x,y,z,name\n1,2,3,\"a, b\"\n4,5,6,c\n",
        "x,y,z,tag\n1,2,3,a;b\n4,5,6,c\n",
        "x,y,z\n1,2,3,,\n4,5,6\n",
        "\tx\ty\tz\n0\t1\t2\t3\n1\t4\t5\t6\n",
        "1\t\t2\t3\n4\t5\t\t6\n",
        "# made by a scanner, in a yard\n1,2,3,9\n4,5,6,9\n",
        "x_m,y_m,z_m\n1,2,3\n4,5,6\n",
        "x,y,z\n# 9,9,9\n1,2,3\n4,5,6\n",
        "2\nx y z\n1 2 3\n4 5 6\n",
    ] {
        assert_eq!(
            parse("a.txt", text.as_bytes()).unwrap_or_else(|error| panic!("{text}: {error}")).points_m,
            whole,
            "{text}"
        );
    }
    // A list of names that lacks a coordinate, or has it in another unit, is not taken for a remark.
    for text in [
        "# TIMESTAMP (ns), RANGE (mm), X (mm), Y (mm), Z (mm)\n1,2,3,4,5\n",
        "x [mm],y [mm],z [mm]\n1,2,3\n",
        "# t, a, b\n1,2,3\n",
    ] {
        let error = parse("a.csv", text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("line 1 (column names): there is no column x"), "{error}");
    }
}

#[test]
fn exact_labels_are_whole_numbers_and_other_columns_none() {
    let text = b"x,y,z,label\nnan,0,0,1\n1,2,3,4.0\n1,2,3,0.5\n";
    let cloud = parse("a.csv", text).unwrap();
    assert_eq!((cloud.points_m.len(), cloud.labels), (2, None));
    let named = Options { label_field: Some("label".into()) };
    let error = read("a.csv", text, None, &named).unwrap_err().to_string();
    assert!(error.contains("a.csv: point 2: its label is 0.5, "), "{error}");
    assert_eq!(parse("a.csv", b"x,y,z,label\n1,2,3,4.0\n1,2,3,nan\n").unwrap().labels, Some(vec![4, -1]));
    assert!(read("a.csv", b"x,y,z,label\n1,2,3,1e300\n", None, &named).is_err());
}

#[test]
fn exact_files_that_hold_more_than_they_announce_are_refused() {
    let ply = |format: &str, body: &[u8]| {
        let head = format!(
            "ply\nformat {format} 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        );
        parse("a.ply", &[head.as_bytes(), body].concat())
    };
    let pcd = |data: &str, body: &[u8]| {
        let head = format!(
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA {data}\n"
        );
        parse("a.pcd", &[head.as_bytes(), body].concat())
    };
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let more = |result: Result<Cloud, CloudError>| result.unwrap_err().to_string();
    let announced = "the header: it announces 1 points, and more follow";
    for (text, format) in [("ascii", "ascii"), ("binary", "binary_little_endian")] {
        let bodies = |values: &[f32]| match text {
            "ascii" => values
                .chunks(3)
                .map(|row| format!("{} {} {}\n", row[0], row[1], row[2]))
                .collect::<String>()
                .into_bytes(),
            _ => floats(values),
        };
        let (one, two) = (bodies(&[1.0, 2.0, 3.0]), bodies(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!((ply(format, &one).unwrap().points_m.len(), pcd(text, &one).unwrap().points_m.len()), (1, 1));
        assert!(more(ply(format, &two)).contains(announced) && more(pcd(text, &two)).contains(announced));
        // Blank lines, remarks, or zeros up to a full block, are no points.
        let padding: &[u8] = if text == "ascii" { b"\n \n\0\0\nmade by a scanner\n" } else { &[0; 40] };
        let padded = [&one, padding].concat();
        assert!(ply(format, &padded).is_ok() && pcd(text, &padded).is_ok());
    }
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
    // The intensity may be asked for as the label, and is both then.
    let text = b"x,y,z,intensity\n1,2,3,40\n";
    let both = read("a.csv", text, None, &Options { label_field: Some("intensity".into()) }).unwrap();
    assert_eq!((both.labels, both.intensity), (Some(vec![40]), Some(vec![40.0])));
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
