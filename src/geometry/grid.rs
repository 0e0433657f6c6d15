//! Points -> cells of a square grid.
//!
//! Source: Hewitt et al. 2017, figure 3: cell (a, b) is row a, column b, counted from the bottom left. Half-open cells:
//! a point on a border belongs to the cell above or to the right of it.

/// A grid of square cells from the yard's corner (0, 0); indices may be negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSpec {
    pub size_m: f64,
}

/// Row (along y) and column (along x) of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CellIndex {
    pub row: i32,
    pub col: i32,
}

impl GridSpec {
    /// The cell that holds the point, or `None` where the index would leave the i32 range (or the point is not finite).
    #[inline]
    pub fn cell(&self, x_m: f64, y_m: f64) -> Option<CellIndex> {
        let (cell, is_one) = self.cell_or_not(x_m, y_m);
        is_one.then_some(cell)
    }

    /// The same without a branch, for blocks of points: an index, and whether it means anything.
    #[inline(always)]
    pub fn cell_or_not(&self, x_m: f64, y_m: f64) -> (CellIndex, bool) {
        let row = (y_m / self.size_m).floor();
        let col = (x_m / self.size_m).floor();
        // Headroom of 16 cells keeps neighbour arithmetic inside i32.
        let limit = f64::from(i32::MAX - 16);
        (CellIndex { row: row as i32, col: col as i32 }, (row.abs() < limit) & (col.abs() < limit))
    }

    /// The cell's centre (x, y).
    pub fn centre_m(&self, cell: CellIndex) -> (f64, f64) {
        ((f64::from(cell.col) + 0.5) * self.size_m, (f64::from(cell.row) + 0.5) * self.size_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_cells_are_half_open_and_may_be_negative() {
        let grid = GridSpec { size_m: 0.5 };
        assert_eq!(grid.cell(0.5, 0.0), Some(CellIndex { row: 0, col: 1 }));
        assert_eq!(grid.cell(-0.1, -0.6), Some(CellIndex { row: -2, col: -1 }));
        assert_eq!(grid.cell(f64::NAN, 0.0), None);
        assert_eq!(grid.cell(1e300, 0.0), None);
    }
}
