//! The cells of a scan -> the rectangle of the grid that holds them, where tables of its places pay.
//!
//! Cells of a scan lie within metres of the sensor, and a table of all places between them is small. A cloud may hold a point a thousand
//! kilometres off: there is no table then, and what is looked for is searched.

use super::CellRow;

/// A table is built where it has no more places than this for each cell.
const MOST_PLACES_A_CELL: usize = 64;

/// Rows and columns from the first to the last that are within `margin` of a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    first_row: i64,
    pub first_col: i64,
    rows: usize,
    pub columns: usize,
}

impl Extent {
    /// `None` where there are no cells, or too few for so large a rectangle.
    pub(super) fn of(cells: &[CellRow], margin: i64) -> Option<Extent> {
        let ends = |value: fn(&CellRow) -> i32| {
            let (least, most) = (cells.iter().map(value).min()?, cells.iter().map(value).max()?);
            let first = i64::from(least) - margin;
            Some((first, (i64::from(most) + margin - first + 1) as usize))
        };
        let ((first_row, rows), (first_col, columns)) = (ends(|cell| cell.index.row)?, ends(|cell| cell.index.col)?);
        let is_small = rows.saturating_mul(columns) <= MOST_PLACES_A_CELL.saturating_mul(cells.len());
        is_small.then_some(Extent { first_row, first_col, rows, columns })
    }

    pub(super) fn places(&self) -> usize {
        self.rows * self.columns
    }

    /// Where a place stands in a table, row by row; `None` outside.
    pub(super) fn place(&self, row: i64, col: i64) -> Option<usize> {
        let (row, col) = (usize::try_from(row - self.first_row).ok()?, usize::try_from(col - self.first_col).ok()?);
        (row < self.rows && col < self.columns).then_some(row * self.columns + col)
    }

    /// The column, counted from the first; those outside are the first and the one behind the last.
    pub(super) fn column(&self, col: i64) -> usize {
        (col - self.first_col).clamp(0, self.columns as i64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::fixtures::row_at;

    #[test]
    fn exact_places_are_numbered_row_by_row_and_end_at_the_margin() {
        let cells = [row_at(-3, 5), row_at(-1, 4)];
        let extent = Extent::of(&cells, 1).unwrap();
        assert_eq!((extent.places(), extent.columns), (5 * 4, 4));
        let at = |row, col| extent.place(row, col);
        assert_eq!([at(-4, 3), at(-4, 6), at(-3, 3), at(0, 6)], [Some(0), Some(3), Some(4), Some(19)]);
        assert_eq!([at(-5, 4), at(1, 4), at(-2, 2), at(-2, 7), at(i64::MIN / 4, i64::MAX / 4)], [None; 5]);
        assert_eq!([-9, 3, 6, 7, 99].map(|col| extent.column(col)), [0, 0, 3, 4, 4]);
    }

    #[test]
    fn extreme_cells_at_the_ends_of_the_grid_have_no_table() {
        let far = i32::MAX;
        assert!(Extent::of(&[row_at(-far, -far), row_at(far, far)], 1).is_none());
        assert!(Extent::of(&[], 0).is_none());
        assert_eq!(Extent::of(&[row_at(far, -far)], 1).unwrap().places(), 9);
    }
}
