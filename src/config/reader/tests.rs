use super::*;

#[test]
fn exact_faulty_patterns_are_refused_by_line() {
    for (text, expected) in [
        ("", "its header lacks 'time_s'"),
        ("time_s,azimuth_deg\n0,0\n", "its header lacks 'elevation_deg'"),
        ("time_s,azimuth_deg,elevation_deg\n", "it holds no beam"),
        ("time_s,azimuth_deg,elevation_deg\n0,0,0\n1,nan,0\n", "line 3: 'nan' is not a finite number"),
        ("time_s,azimuth_deg,elevation_deg\n0,0,91\n", "line 2: azimuth must lie in"),
        ("time_s,azimuth_deg,elevation_deg\n1,0,0\n0.5,0,0\n", "line 3: times must begin at 0 or later and never fall"),
        ("time_s,azimuth_deg,elevation_deg\n0,0\n", "CSV error"),
    ] {
        let fault = told(&pattern_of(text.as_bytes()).expect_err(text), true);
        assert!(fault.contains(expected), "{text:?}: {fault}");
    }
}

/// An NPY file of version 1.0 as numpy writes it.
fn npy(descr: &str, fortran: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}");
    let header = format!("{header:<117}\n");
    [b"\x93NUMPY\x01\x00", (header.len() as u16).to_le_bytes().as_slice(), header.as_bytes(), data].concat()
}

#[test]
fn exact_npy_heights_in_either_order_and_width() {
    let f32s: Vec<u8> = [1f32, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|h| h.to_le_bytes()).collect();
    let f64s: Vec<u8> = [1f64, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|h| h.to_be_bytes()).collect();
    let by_row = npy_heights(&npy("<f4", "False", "(2, 3)", &f32s)).unwrap();
    assert_eq!(by_row, (2, 3, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    let by_column = npy_heights(&npy(">f8", "True", "(2, 3)", &f64s)).unwrap();
    assert_eq!(by_column, (2, 3, vec![1.0, 3.0, 5.0, 2.0, 4.0, 6.0]));
}

#[test]
fn extreme_hostile_height_maps_are_refused() {
    let map =
        |name: &str, bytes: &[u8], white_m| height_map_of(Path::new(name), bytes, white_m).err().unwrap_or_default();
    let floats = 0f32.to_le_bytes().repeat(4);
    for (bytes, expected) in [
        (npy("<f4", "False", "(99999999, 99999999)", &floats), "at most"),
        (npy("<f4", "False", "(18446744073709551615, 2)", &floats), "at most"),
        (npy("<f4", "False", "(999999999, 999999999, 999999999)", &floats), "it has 3 dimensions"),
        (npy("<f4", "False", &"(".repeat(60), &floats), "lacks 'shape'"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff{}".to_vec(), "its header ends early"),
        (npy("<f4", "False", "(2, 2)", &floats[..10]), "it ends early"),
        (npy("<i4", "False", "(2, 2)", &floats), "holds float32 or float64"),
        (npy("<f4", "False", "(4,)", &floats), "it has 1 dimensions"),
        (npy("<f4", "False", "(1, 4)", &floats), "at least 2 of each"),
        (npy("<f4", "False", "(2, 2)", &f32::NAN.to_le_bytes().repeat(4)), "no height in metres"),
        (b"\x93NUMPY".to_vec(), "no NPY file"),
    ] {
        let fault = map("x.npy", &bytes, None);
        assert!(fault.contains(expected), "{fault}");
    }
    assert!(map("x.npy", &npy("<f4", "False", "(2, 2)", &floats), Some(1.0)).contains("take height_m out"));
    assert!(map("x.png", b"", None).contains("needs height_m"));
    assert!(map("x.png", b"\x89PNG", Some(1.0)).contains("no PNG"));
    assert!(map("x.tif", b"", None).contains(".npy or a .png"));
    let mut grey8 = Vec::new();
    let mut encoder = png::Encoder::new(&mut grey8, 2, 2);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[0; 4]).unwrap();
    assert!(map("x.png", &grey8, Some(1.0)).contains("not a 16-bit grey PNG"));
}
