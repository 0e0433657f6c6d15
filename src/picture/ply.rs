//! A sweep with its labels -> a PLY point cloud (binary, little endian).
//!
//! Source: Turk, *The PLY Polygon File Format* (1994). One vertex a measured point: x y z in the map frame (f64), where the
//! estimate (or the fitted plane) puts it; intensity (f32, NaN where none is modelled); true class and object; the label of its cell (-1 where it
//! is in none); red, green, blue of the label, so that any viewer shows it.

use super::View;
use super::colour::{lit, of_class, srgb_byte};
use crate::cells::{CellAssigner, Label};
use crate::geometry::GridSpec;
use crate::scene::Class;
use crate::sweep::Status;

/// The bytes of a `.ply` file.
///
/// Distance limits play no part here: a point has the label of the cell that it lies in, if that cell was written
/// and the point does not hang over it.
pub(crate) fn labelled_cloud(view: &View) -> Vec<u8> {
    let sweep = view.sweep;
    let grid = GridSpec { size_m: view.cell_size_m };
    let assigner = CellAssigner::of_sensor(grid, f64::INFINITY, view.map_from_sensor);
    let mut body = Vec::new();
    let mut points = 0;
    for (slot, &direction) in sweep.returns.pattern.directions.iter().enumerate() {
        if sweep.returns.status[slot] != Status::Hit {
            continue;
        }
        points += 1;
        let placed = assigner.place(direction, sweep.returns.range_m[slot]);
        let cell = placed.cell.ok().filter(|_| view.hanging.get(slot) != Some(&true));
        let row = cell.and_then(|cell| view.cells.rows.binary_search_by_key(&cell, |r| r.index).ok());
        let label = row.and_then(|r| view.cells.rows[r].label).map_or(-1, Label::number);
        for value in placed.point_m.to_array() {
            body.extend(value.to_le_bytes());
        }
        let intensity = sweep.returns.intensity.as_ref().map_or(f32::NAN, |i| i[slot]);
        body.extend(intensity.to_le_bytes());
        let truth = &sweep.truth[slot];
        body.extend(Class::number_or_none(truth.class).to_le_bytes());
        body.extend(truth.object.to_le_bytes());
        body.extend(label.to_le_bytes());
        let colour = truth.class.map_or([0.5; 3], of_class);
        body.extend(lit(colour, if label == 1 { 0.45 } else { 1.15 }).map(srgb_byte));
    }
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\ncomment marsyard: {}\ncomment x y z in the map frame, metres\nelement vertex {points}\n",
        view.title.replace(['\n', '\r'], " ")
    );
    for property in [
        "double x",
        "double y",
        "double z",
        "float intensity",
        "char truth_class",
        "int truth_object_id",
        "char label",
        "uchar red",
        "uchar green",
        "uchar blue",
    ] {
        file.push_str("property ");
        file.push_str(property);
        file.push('\n');
    }
    file.push_str("end_header\n");
    let mut bytes = file.into_bytes();
    bytes.append(&mut body);
    bytes
}
