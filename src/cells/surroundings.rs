//! The cells of one scan -> what the ground looks like in a square around each.
//!
//! Definition: the window of a cell reaches `radius_m`, rounded to cells, to each side. Of the window's cells that hold points, the cell itself
//! among them: the mean and the population standard deviation of their heights above the plane around (`plane_height_m`), the share
//! of the window that they are, and the mean of the standard deviations of the heights within them. Where no cell of the window
//! holds a point, the height is the asking cell's own and the others are 0.
//! In: rows sorted by (row, col) with their features. Out: four features a window, in the order of [`NAMES`].
//!
//! Own construction: grass, a bush and a bank may give one cell the same height and scatter, and differ in what stands beside them; a cell
//! of one point says little, a window of 25 or 81 does. Sums run row by row, so that they are the same for any order of work.
//! Not modelled: distances within the window; what lies between cells without points.

use super::params::SurroundingsParams;
use super::squares::Squares;
use crate::geometry::CellIndex;

/// Where a row has the variance of its heights.
const VARIANCE: usize = 1;

/// Of the four features: what their columns are called, unit and meaning.
pub(super) const NAMES: [(&str, &str, &str); 4] = [
    ("height", "m", "mean height of the cells above the planes around them"),
    ("roughness", "m", "standard deviation of those heights"),
    ("spread", "m", "mean of the standard deviations of the heights within the cells"),
    ("cover", "1", "share of the cells that hold points"),
];

/// What is known of the cells of a scan, in their order.
pub(super) struct Surroundings<'a> {
    squares: &'a Squares,
    /// Of each cell: its height above the plane around, and the standard deviation of the heights within it.
    heights_m: Vec<f64>,
    spreads_m: Vec<f64>,
}

impl Surroundings<'_> {
    /// `squares`: of the cells whose `features` these are, `width` values each, the height above the plane at `plane_height`.
    pub(super) fn new<'a>(
        squares: &'a Squares,
        features: &[f32],
        width: usize,
        plane_height: usize,
    ) -> Surroundings<'a> {
        let of_cells = || features.chunks_exact(width);
        Surroundings {
            squares,
            heights_m: of_cells().map(|cell| f64::from(cell[plane_height])).collect(),
            spreads_m: of_cells().map(|cell| f64::from(cell[VARIANCE]).sqrt()).collect(),
        }
    }

    /// The features of every window of a cell, one after the other; `plane_height_m`: the cell's own.
    pub(super) fn of(
        &self,
        params: &SurroundingsParams,
        size_m: f64,
        index: CellIndex,
        plane_height_m: f32,
    ) -> impl Iterator<Item = f32> {
        params.radii_m.iter().flat_map(move |radius_m| {
            self.window(index, (radius_m / size_m).round() as i64, f64::from(plane_height_m)).map(|value| value as f32)
        })
    }

    fn window(&self, index: CellIndex, reach: i64, plane_height_m: f64) -> [f64; NAMES.len()] {
        let (mut cells, mut height_m, mut spread_m) = (0, 0.0, 0.0);
        self.squares.each_line(index, reach, |of_line| {
            cells += of_line.len();
            self.heights_m[of_line.clone()].iter().zip(&self.spreads_m[of_line]).for_each(|(height, spread)| {
                height_m += height;
                spread_m += spread;
            });
        });
        if cells == 0 {
            return [plane_height_m, 0.0, 0.0, 0.0];
        }
        let count = cells as f64;
        let mean_m = height_m / count;
        let mut squares_m2 = 0.0;
        self.squares.each_line(index, reach, |of_line| {
            self.heights_m[of_line].iter().for_each(|height_m| squares_m2 += (height_m - mean_m) * (height_m - mean_m));
        });
        let side = (2 * reach + 1) as f64;
        [mean_m, (squares_m2 / count).sqrt(), spread_m / count, count / (side * side)]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::cells::CellRow;
    use crate::cells::fixtures::{row_at, square};

    /// Of cells (row, col, height above the plane) whose variance is the square of a hundredth of their column.
    fn computed(radii_m: &[f64], size_m: f64, cells: &[(i32, i32, f64)]) -> Vec<Vec<f32>> {
        let rows: Vec<CellRow> = cells.iter().map(|&(row, col, _)| row_at(row, col)).collect();
        let features: Vec<f32> = cells.iter().flat_map(|&(_, col, h)| [0.0, variance(col), h as f32]).collect();
        let mut squares = Squares::default();
        squares.take(&rows);
        let around = Surroundings::new(&squares, &features, 3, 2);
        let params = SurroundingsParams { radii_m: radii_m.to_vec() };
        cells
            .iter()
            .map(|&(row, col, h)| around.of(&params, size_m, CellIndex { row, col }, h as f32).collect())
            .collect()
    }

    fn variance(col: i32) -> f32 {
        let sigma = 0.01 * col as f32;
        sigma * sigma
    }

    proptest! {
        #[test]
        fn exact_windows_are_those_of_the_definition_cell_by_cell(
            cells in prop::collection::btree_map((-20i32..20, -25i32..25), -2.0..2.0f64, 1..600),
            reach in 1i32..6,
        ) {
            let cells: Vec<_> = cells.into_iter().map(|((r, c), h)| (r, c, h)).collect();
            let computed = computed(&[0.1 * f64::from(reach)], 0.1, &cells);
            for (&(row, col, _), out) in cells.iter().zip(computed).step_by(7) {
                let near = |cell: &&(i32, i32, f64)| (cell.0 - row).abs() <= reach && (cell.1 - col).abs() <= reach;
                let near: Vec<_> = cells.iter().filter(near).collect();
                let n = near.len() as f64;
                let mean = |value: &dyn Fn(&(i32, i32, f64)) -> f64| near.iter().map(|cell| value(cell)).sum::<f64>() / n;
                let height_m = mean(&|cell| cell.2);
                let roughness_m = mean(&|cell| (cell.2 - height_m) * (cell.2 - height_m)).sqrt();
                let side = f64::from(2 * reach + 1);
                let expected = [height_m, roughness_m, mean(&|cell| 0.01 * f64::from(cell.1.abs())), n / (side * side)];
                prop_assert!(expected.iter().zip(&out).all(|(e, o)| (e - f64::from(*o)).abs() < 1e-6), "{out:?} {expected:?}");
            }
        }
    }

    #[test]
    fn exact_level_ground_lone_cells_and_cells_that_hold_no_point() {
        let level = square(4, |_, _| 0.25);
        let at = level.iter().position(|cell| (cell.0, cell.1) == (0, 0)).unwrap();
        assert_eq!(computed(&[0.1], 0.1, &level)[at][..2], [0.25, 0.0]);
        assert_eq!(computed(&[0.1], 0.1, &level)[at][3], 1.0);
        assert_eq!(computed(&[0.2], 0.1, &level)[0][3], 9.0 / 25.0, "beyond the corner nothing holds points");
        assert_eq!(computed(&[0.4], 0.1, &[(-7, 3, 0.5)])[0][..3], [0.5, 0.0, 0.03]);
        let squares = Squares::default();
        let none = Surroundings::new(&squares, &[], 3, 2);
        let params = SurroundingsParams { radii_m: vec![0.2] };
        let alone: Vec<f32> = none.of(&params, 0.1, CellIndex { row: 0, col: 0 }, 0.75).collect();
        assert_eq!(alone, [0.75, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn extreme_windows_at_the_ends_of_the_grid() {
        let far = i32::MAX - 17;
        let ends = [(-far, -far, 1.0), (-far, far, 2.0), (0, 0, 3.0), (far, -far, 4.0), (far, far, 5.0)];
        for (out, cell) in computed(&[1.0], 0.1, &ends).iter().zip(ends) {
            assert_eq!((f64::from(out[0]), out[1]), (cell.2, 0.0));
        }
    }
}
