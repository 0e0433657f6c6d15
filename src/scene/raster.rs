//! The raw ground: heights at the nodes of a square grid, bilinear between them.
//!
//! In: world x, y in metres. Out: height and gradient. Outside the grid the nearest border point's height holds, so that a
//! body that overhangs the yard's edge still has a height to be measured against; whether there *is* ground, `contains`
//! says. The gradient jumps at cell borders: a point on one belongs to the cell above or to the right of it.

use std::sync::Arc;

use crate::geometry::DVec2;

/// Heights at the nodes of a square grid, bilinear between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    pub spacing_m: f64,
    /// World position of node (row 0, col 0).
    pub origin_m: DVec2,
    pub rows: usize,
    pub cols: usize,
    /// Row-major: node (row, col) lies at origin + (col, row) * spacing.
    /// Shared by the scene and whatever is made of its ground later.
    pub heights_m: Arc<Vec<f64>>,
}

impl Raster {
    /// A raster from its nodes, row by row from the south.
    ///
    /// # Panics
    /// Where a side has fewer than two nodes or the number of heights does not fit.
    pub fn new(origin_m: DVec2, spacing_m: f64, rows: usize, cols: usize, heights_m: Vec<f64>) -> Raster {
        assert!(rows >= 2 && cols >= 2 && heights_m.len() == rows * cols, "{rows} x {cols} nodes need as many heights");
        assert!(spacing_m > 0.0, "spacing must be positive");
        Raster { spacing_m, origin_m, rows, cols, heights_m: heights_m.into() }
    }

    /// The yard [0, extent]^2 with so many nodes a side.
    pub(super) fn of_yard(extent_m: f64, nodes: usize, heights_m: Vec<f64>) -> Raster {
        Raster::new(DVec2::ZERO, extent_m / (nodes - 1) as f64, nodes, nodes, heights_m)
    }

    /// The yard [0, extent]^2 sampled at nodes no farther apart than `spacing_m` (an exact part of the extent).
    pub fn sampled(extent_m: f64, spacing_m: f64, height_m: impl Fn(f64, f64) -> f64) -> Raster {
        let nodes_m = Raster::nodes_m(extent_m, spacing_m);
        let heights_m = Raster::heights_on_grid(&nodes_m, height_m);
        Raster::of_yard(extent_m, nodes_m.len(), heights_m)
    }

    /// A surface at the nodes of a square grid, row by row from the south.
    pub(super) fn heights_on_grid(nodes_m: &[f64], height_m: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        let mut heights_m = Vec::with_capacity(nodes_m.len() * nodes_m.len());
        for &y_m in nodes_m {
            heights_m.extend(nodes_m.iter().map(|&x_m| height_m(x_m, y_m)));
        }
        heights_m
    }

    /// Where the nodes of a yard stand along a side, no farther apart than `spacing_m`.
    pub(super) fn nodes_m(extent_m: f64, spacing_m: f64) -> Vec<f64> {
        let cells = Raster::cells_of(extent_m, spacing_m);
        let spacing_m = extent_m / cells as f64;
        (0..=cells).map(|node| if node == cells { extent_m } else { node as f64 * spacing_m }).collect()
    }

    /// The number of cells along a yard whose nodes are no farther apart than asked.
    pub(super) fn cells_of(extent_m: f64, spacing_m: f64) -> usize {
        // 1e-9: 20 / 0.05 is 400 cells, not 401, whatever the last bit says.
        ((extent_m / spacing_m - 1e-9).ceil() as usize).max(1)
    }

    /// The cell of a coordinate along one axis and the place inside it, in [0, 1].
    #[inline]
    fn cell(&self, offset_m: f64, nodes: usize) -> (usize, f64) {
        let place = (offset_m / self.spacing_m).clamp(0.0, (nodes - 1) as f64);
        // A NaN casts to 0, and the height comes out NaN.
        let cell = (place as usize).min(nodes - 2);
        (cell, place - cell as f64)
    }

    /// The four corner heights (sw, se, nw, ne) of a point's cell, and its place in the cell.
    #[inline]
    fn corners(&self, x_m: f64, y_m: f64) -> ([f64; 4], f64, f64) {
        let (col, s) = self.cell(x_m - self.origin_m.x, self.cols);
        let (row, t) = self.cell(y_m - self.origin_m.y, self.rows);
        let south = row * self.cols + col;
        let north = south + self.cols;
        ([self.heights_m[south], self.heights_m[south + 1], self.heights_m[north], self.heights_m[north + 1]], s, t)
    }

    /// Height at a world point.
    #[inline]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let ([sw, se, nw, ne], s, t) = self.corners(x_m, y_m);
        let (south, north) = (sw + (se - sw) * s, nw + (ne - nw) * s);
        south + (north - south) * t
    }

    /// Slope along x and y at a world point.
    #[inline]
    pub fn gradient(&self, x_m: f64, y_m: f64) -> DVec2 {
        self.height_and_gradient(x_m, y_m).1
    }

    /// Height and gradient together.
    #[inline]
    pub fn height_and_gradient(&self, x_m: f64, y_m: f64) -> (f64, DVec2) {
        let ([sw, se, nw, ne], s, t) = self.corners(x_m, y_m);
        let (south, north) = (sw + (se - sw) * s, nw + (ne - nw) * s);
        let along_x = (se - sw) + ((ne - nw) - (se - sw)) * t;
        (south + (north - south) * t, DVec2::new(along_x, north - south) / self.spacing_m)
    }

    /// Whether the point lies on the grid (the border does).
    pub fn contains(&self, x_m: f64, y_m: f64) -> bool {
        let grown = 1.0 + 4.0 * f64::EPSILON;
        let (x, y) = ((x_m - self.origin_m.x) / self.spacing_m, (y_m - self.origin_m.y) / self.spacing_m);
        x >= 0.0 && y >= 0.0 && x <= (self.cols - 1) as f64 * grown && y <= (self.rows - 1) as f64 * grown
    }

    /// The steepest slope, as rise over run: exact, since the squared slope is convex in each cell and so greatest at a corner.
    pub(crate) fn max_slope(&self) -> f64 {
        let mut steepest = 0.0_f64;
        for row in 0..self.rows - 1 {
            let (south, north) = (&self.heights_m[row * self.cols..], &self.heights_m[(row + 1) * self.cols..]);
            for col in 0..self.cols - 1 {
                let [sw, se, nw, ne] = [south[col], south[col + 1], north[col], north[col + 1]];
                let along_x = (se - sw).abs().max((ne - nw).abs());
                let along_y = (nw - sw).abs().max((ne - se).abs());
                steepest = steepest.max(along_x * along_x + along_y * along_y);
            }
        }
        steepest.sqrt() / self.spacing_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_bilinear_surface_comes_back() {
        let z = |x: f64, y: f64| 0.5 + 0.1 * x - 0.2 * y + 0.03 * x * y;
        // One function over all cells: the bilinear form reproduces it between the nodes.
        let raster = Raster::sampled(20.0, 0.3, z);
        assert!(raster.spacing_m <= 0.3 && (raster.spacing_m * (raster.cols - 1) as f64 - 20.0).abs() < 1e-12);
        for (x, y) in [(0.0, 0.0), (20.0, 20.0), (7.123, 0.011), (19.999, 4.2)] {
            assert!((raster.height_m(x, y) - z(x, y)).abs() < 1e-13);
            assert!((raster.gradient(x, y) - DVec2::new(0.1 + 0.03 * y, -0.2 + 0.03 * x)).length() < 1e-12);
            assert!(raster.contains(x, y));
        }
        // The corner (20, 20) is steepest: |(0.7, 0.4)|; nodes reach it.
        assert!((raster.max_slope() - (0.7_f64 * 0.7 + 0.4 * 0.4).sqrt()).abs() < 1e-12);
        assert!(!raster.contains(-1e-9, 1.0) && !raster.contains(1.0, 20.0 + 1e-9));
    }

    #[test]
    fn extreme_points_outside_take_the_border_and_nan_stays_nan() {
        let raster = Raster::sampled(1.0, 0.5, |x, y| x + y);
        assert_eq!(raster.height_m(-1e300, 0.5), raster.height_m(0.0, 0.5));
        assert_eq!(raster.height_m(f64::INFINITY, 1.0), 2.0);
        assert!(raster.height_m(f64::NAN, 0.5).is_nan());
    }
}
