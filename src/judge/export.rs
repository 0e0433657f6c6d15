//! Judged cells and points -> clouds and meshes for other tools, frame `map`: PLY and PCD (binary, little endian).

use super::JudgedCells;
use crate::cells::CellAssigner;
use crate::cloud::Cloud;
use crate::geometry::{CellIndex, DVec3};

/// A point of the scan, as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabelledPoint {
    pub point_m: DVec3,
    pub intensity: f32,
    /// The file's own label id; -1 where it has none.
    pub label: i64,
    /// The cell's output (NaN: none) and class (-1: none).
    pub output: f32,
    pub class: i8,
    shade: Option<f64>,
}

/// The points of a scan with what was said of their cells, in the file's order.
///
/// `hanging`: the points that are in no cell because they hang over free height, where any are marked; `in_map`: they are in the frame
/// map already.
pub(crate) fn labelled(
    cloud: &Cloud,
    hanging: &[bool],
    assigner: &CellAssigner,
    in_map: bool,
    judged: &JudgedCells,
) -> Vec<LabelledPoint> {
    let point = |(i, &p): (usize, &DVec3)| {
        let placed = if in_map { assigner.place_in_map(p) } else { assigner.place_point(p) };
        let cell = placed.cell.ok().filter(|_| hanging.get(i) != Some(&true));
        let row = cell.and_then(|cell| judged.find(cell));
        LabelledPoint {
            point_m: placed.point_m,
            intensity: cloud.intensity.as_ref().map_or(f32::NAN, |values| values[i]),
            label: cloud.labels.as_ref().map_or(-1, |labels| labels[i]),
            output: row.and_then(|row| judged.outputs[row]).map_or(f32::NAN, |output| output as f32),
            class: row.and_then(|row| judged.classes[row]).map_or(-1, |class| class as i8),
            shade: row.and_then(|row| judged.class_shade(row)),
        }
    };
    cloud.points_m.iter().enumerate().map(point).collect()
}

/// sRGB of light, dark and unknown, as in the pictures.
const LIGHT: [f64; 3] = [233.0, 230.0, 223.0];
const DARK: [f64; 3] = [51.0, 48.0, 45.0];
const UNKNOWN: [u8; 3] = [143, 160, 190];

fn colour(shade: Option<f64>) -> [u8; 3] {
    shade.map_or(UNKNOWN, |share| std::array::from_fn(|i| (LIGHT[i] + (DARK[i] - LIGHT[i]) * share).round() as u8))
}

/// Whether all labels are written as i32, which every reader takes; else as f64, which holds whole numbers up to 2^53.
fn has_short_labels(points: &[LabelledPoint]) -> bool {
    points.iter().all(|point| i32::try_from(point.label).is_ok())
}

fn put_label(bytes: &mut Vec<u8>, label: i64, is_short: bool) {
    if is_short { bytes.extend((label as i32).to_le_bytes()) } else { bytes.extend((label as f64).to_le_bytes()) }
}

/// PLY, coordinates in f64.
pub(crate) fn ply(points: &[LabelledPoint], title: &str) -> Vec<u8> {
    let is_short = has_short_labels(points);
    let mut bytes = ply_header(
        title,
        &[(
            "vertex",
            points.len(),
            &[
                "double x",
                "double y",
                "double z",
                "float intensity",
                if is_short { "int label" } else { "double label" },
                "float output",
                "char class",
                "uchar red",
                "uchar green",
                "uchar blue",
            ],
        )],
    );
    for point in points {
        point.point_m.to_array().iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.extend(point.intensity.to_le_bytes());
        put_label(&mut bytes, point.label, is_short);
        bytes.extend(point.output.to_le_bytes());
        bytes.extend(point.class.to_le_bytes());
        bytes.extend(colour(point.shade));
    }
    bytes
}

fn ply_header(title: &str, elements: &[(&str, usize, &[&str])]) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat binary_little_endian 1.0\ncomment marsyard: {}\ncomment frame map, metres\n",
        title.replace(['\n', '\r'], " ")
    );
    for (name, count, properties) in elements {
        text.push_str(&format!("element {name} {count}\n"));
        properties.iter().for_each(|property| text.push_str(&format!("property {property}\n")));
    }
    text.push_str("end_header\n");
    text.into_bytes()
}

/// What f32 coordinates may move a point by: less than any range sensor can tell.
const F32_MOST_M: f64 = 1e-3;

/// PCD 0.7, binary. Coordinates are f32, as the Point Cloud Library's own types are, where that moves no point by more than 1 mm
/// (32 km around the origin); else f64, so that none is lost far from it, as in UTM. VIEWPOINT stays the origin: CloudCompare (qPCL,
/// `PcdFilter::loadFile`) and PCL's viewer move the points by it, and these are in the map already. Where the sensor was stands in a
/// comment, for who orients normals towards it.
pub(crate) fn pcd(points: &[LabelledPoint], sensor_m: DVec3) -> Vec<u8> {
    let count = points.len();
    let is_near = |point: &LabelledPoint| {
        point.point_m.to_array().iter().all(|&value| (f64::from(value as f32) - value).abs() <= F32_MOST_M)
    };
    let is_single = points.iter().all(is_near);
    let size = if is_single { 4 } else { 8 };
    let is_short = has_short_labels(points);
    let (label_size, label_type) = if is_short { (4, 'I') } else { (8, 'F') };
    let mut bytes = format!(
        "# .PCD v0.7 - Point Cloud Data file format\n# frame map, metres; the sensor was at {} {} {}\nVERSION 0.7\n\
         FIELDS x y z intensity label output class rgb\nSIZE {size} {size} {size} 4 {label_size} 4 1 4\nTYPE F F F F {label_type} F I U\n\
         COUNT 1 1 1 1 1 1 1 1\nWIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n",
        sensor_m.x, sensor_m.y, sensor_m.z
    )
    .into_bytes();
    for point in points {
        for value in point.point_m.to_array() {
            if is_single { bytes.extend((value as f32).to_le_bytes()) } else { bytes.extend(value.to_le_bytes()) }
        }
        bytes.extend(point.intensity.to_le_bytes());
        put_label(&mut bytes, point.label, is_short);
        bytes.extend(point.output.to_le_bytes());
        bytes.extend(point.class.to_le_bytes());
        let [red, green, blue] = colour(point.shade);
        bytes.extend([blue, green, red, 0]);
    }
    bytes
}

/// PLY mesh of the mean heights (paper, figure 14b): a vertex a cell, at its centre; a triangle wherever three cells of a square
/// of four are there, two where all are. Coloured by the direct output.
pub(crate) fn mesh(judged: &JudgedCells) -> Vec<u8> {
    let rows = &judged.cells.rows;
    let mut faces: Vec<[usize; 3]> = Vec::new();
    for row in 0..rows.len() {
        let CellIndex { row: r, col: c } = rows[row].index;
        let at = |rows: i32, cols: i32| judged.find(CellIndex { row: r + rows, col: c + cols });
        // Counter-clockwise from above, so that normals point up. Each square is taken up by its least cell that is there.
        match (at(0, 1), at(1, 0), at(1, 1)) {
            (Some(east), Some(north), Some(far)) => faces.extend([[row, east, far], [row, far, north]]),
            (Some(east), Some(north), None) => faces.push([row, east, north]),
            (Some(east), None, Some(far)) => faces.push([row, east, far]),
            (None, Some(north), Some(far)) => faces.push([row, far, north]),
            _ => {}
        }
        // The square whose south-western cell is empty: this one is its south-eastern.
        if at(0, -1).is_none()
            && let (Some(north), Some(west)) = (at(1, 0), at(1, -1))
        {
            faces.push([row, north, west]);
        }
    }
    let mut bytes = ply_header(
        &judged.scan,
        &[
            (
                "vertex",
                rows.len(),
                &["double x", "double y", "double z", "float output", "uchar red", "uchar green", "uchar blue"],
            ),
            ("face", faces.len(), &["list uchar int vertex_indices"]),
        ],
    );
    for (row, cell) in rows.iter().enumerate() {
        let (x, y) = judged.grid.centre_m(cell.index);
        [x, y, judged.mean_z_m(row)].iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.extend(judged.outputs[row].map_or(f32::NAN, |output| output as f32).to_le_bytes());
        bytes.extend(colour(judged.shade(row)));
    }
    for face in &faces {
        bytes.push(3);
        face.iter().for_each(|&vertex| bytes.extend((vertex as i32).to_le_bytes()));
    }
    bytes
}
