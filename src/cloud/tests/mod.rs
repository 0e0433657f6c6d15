//! What all of these tests stand on: points that are known, as the bytes of every format.

mod formats;

use super::*;

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
