//! Cells of tests: rows that only their place tells apart, and squares of heights.

use super::{CellRow, CellTruth};
use crate::geometry::CellIndex;

/// A row of one point, of which nothing is known.
pub(super) fn row_at(row: i32, col: i32) -> CellRow {
    let index = CellIndex { row, col };
    CellRow { index, label: None, points: 1, range_m: 0.0, neighbour_mask: 0, truth: CellTruth::default() }
}

/// Rows and mean heights of cells (row, col, mean height).
pub(super) fn rows_and_heights(cells: &[(i32, i32, f64)]) -> (Vec<CellRow>, Vec<f64>) {
    cells.iter().map(|&(row, col, height_m)| (row_at(row, col), height_m)).unzip()
}

/// A full square of cells around (0, 0) with heights by (row, col).
pub(super) fn square(half: i32, height_m: impl Fn(i32, i32) -> f64) -> Vec<(i32, i32, f64)> {
    (-half..=half).flat_map(|r| (-half..=half).map(move |c| (r, c))).map(|(r, c)| (r, c, height_m(r, c))).collect()
}
