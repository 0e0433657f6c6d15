//! The rows of a scan and their means -> the features that other cells and the beams tell of each: heights of the neighbours, height above the
//! ground around and its plane, curvature, the squares around, the beams that met it.
//!
//! In: what `summary` made of the points. Out: the same rows, these features written among theirs, neighbour masks set. What each of them is,
//! and its source, say the modules that make them.

use super::bin::Scratch;
use super::columns::neighbour_offsets;
use super::layout::Layout;
use super::params::{BeamParams, CurvatureParams, LocalHeightParams, SurroundingsParams};
use super::surroundings::Surroundings;
use super::{CellParams, Cells, curvature, local};
use crate::geometry::GridSpec;

pub(super) fn add(params: &CellParams, layout: &Layout, scratch: &mut Scratch, cells: &mut Cells) {
    neighbours(params.neighbours, layout, &scratch.mean_heights_m, cells);
    if let Some(of_ground) = &params.local_height {
        ground(of_ground, params.size_m, layout, scratch, cells);
    }
    if let Some(of_curvature) = &params.curvature {
        bends(of_curvature, params.size_m, layout, scratch, cells);
    }
    if params.surroundings.is_some() || params.beams.is_some() {
        scratch.squares.take(&cells.rows);
    }
    if let Some(of_squares) = &params.surroundings {
        squares(of_squares, params.size_m, layout, scratch, cells);
    }
    if let Some(of_beams) = &params.beams {
        beams(of_beams, params.size_m, layout, scratch, cells);
    }
}

/// The means of the neighbours that hold points, and the mask.
///
/// Rows are sorted, so each offset's neighbour moves forward only: one pointer an offset.
fn neighbours(count: u32, layout: &Layout, mean_heights_m: &[f64], cells: &mut Cells) {
    // One number for (row, col), in the same order.
    let key = |row: i32, col: i32| (i64::from(row) << 32) + i64::from(col);
    let keys: Vec<i64> = cells.rows.iter().map(|row| key(row.index.row, row.index.col)).collect();
    for (k, offset) in neighbour_offsets(count).iter().enumerate() {
        let away = key(offset.rows, offset.cols);
        let mut at = 0;
        for (row, &own) in keys.iter().enumerate() {
            while at < keys.len() && keys[at] < own + away {
                at += 1;
            }
            if at < keys.len() && keys[at] == own + away {
                cells.rows[row].neighbour_mask |= 1 << k;
                cells.features[row * layout.width + Layout::NEIGHBOURS + k] = mean_heights_m[at] as f32;
            }
        }
    }
}

/// The height above the ground around, and above the plane fitted to it with its slope.
fn ground(params: &LocalHeightParams, size_m: f64, layout: &Layout, scratch: &mut Scratch, cells: &mut Cells) {
    let Scratch { mean_heights_m, local, planes, .. } = scratch;
    let Cells { rows, features, .. } = cells;
    local::heights(params, size_m, rows, mean_heights_m, local, |row, height_m| {
        features[row * layout.width + layout.local] = height_m as f32;
    });
    if params.plane {
        planes.fit(params, size_m, rows, mean_heights_m);
        for (k, (row, &height_m)) in rows.iter().zip(&*mean_heights_m).enumerate() {
            let of_plane = planes.features(row.index, height_m).map(|value| value as f32);
            features[k * layout.width + layout.plane_height()..][..2].copy_from_slice(&of_plane);
        }
    }
}

fn bends(params: &CurvatureParams, size_m: f64, layout: &Layout, scratch: &mut Scratch, cells: &mut Cells) {
    let Scratch { mean_heights_m, curvature, .. } = scratch;
    let Cells { rows, features, .. } = cells;
    curvature::bends(params, size_m, rows, mean_heights_m, curvature, |row, distance, bend_m| {
        let of_distance = bend_m.map(|value| value as f32);
        features[row * layout.width + layout.curvature + 2 * distance..][..2].copy_from_slice(&of_distance);
    });
}

fn squares(params: &SurroundingsParams, size_m: f64, layout: &Layout, scratch: &Scratch, cells: &mut Cells) {
    let Cells { rows, features, .. } = cells;
    let (width, plane_height) = (layout.width, layout.plane_height());
    let around = Surroundings::new(&scratch.squares, features, width, plane_height);
    let all = rows.iter().zip(features.chunks_exact(width));
    let values: Vec<f32> = all.flat_map(|(row, own)| around.of(params, size_m, row.index, own[plane_height])).collect();
    let count = layout.beams - layout.squares;
    for (own, values) in features.chunks_exact_mut(width).zip(values.chunks_exact(count)) {
        own[layout.squares..][..count].copy_from_slice(values);
    }
}

fn beams(params: &BeamParams, size_m: f64, layout: &Layout, scratch: &mut Scratch, cells: &mut Cells) {
    let Scratch { sums, mean_heights_m, squares, beams, passages, .. } = scratch;
    let Cells { rows, features, .. } = cells;
    let (width, plane_height) = (layout.width, layout.plane_height());
    let grid = GridSpec { size_m };
    let of_cells = rows.iter().zip(features.chunks_exact(width)).zip(mean_heights_m.iter().zip(&*sums));
    passages.take(of_cells.map(|((row, own), (mean_m, sum))| {
        let plane_m = mean_m - f64::from(own[plane_height]);
        beams.passage(grid.centre_m(row.index).into(), size_m, plane_m, sum.high_m)
    }));
    let of_cells = rows.iter().zip(features.chunks_exact_mut(width)).zip(passages.of_cells());
    for ((row, own), passage) in of_cells {
        let values = passages.of(params, size_m, squares, row.index, passage);
        own[layout.beams..].iter_mut().zip(values).for_each(|(own, value)| *own = value);
    }
}
