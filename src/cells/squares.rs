//! The cells of one scan -> those that lie in a square around a place.
//!
//! In: rows sorted by (row, col). Out: for a square that reaches some cells to each side, the cells in it, line by line: ranges of row
//! numbers, so that whatever is known of cells in their order can be summed. A table of the scan's extent says where each range begins;
//! where the extent is too large for one, it is searched.

use std::ops::Range;

use super::CellRow;
use super::extent::Extent;
use crate::geometry::CellIndex;

/// The cells of a scan, row by row; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Squares {
    cols: Vec<i32>,
    /// Rows that hold cells, ascending, with their cells.
    lines: Vec<(i32, Range<usize>)>,
    /// Where there is a table: of each line and each column of the extent, and of the one behind the last, the first cell of the line that is not
    /// before it.
    extent: Option<Extent>,
    entries: Vec<u32>,
}

impl Squares {
    /// Takes the rows of a scan, which are sorted by (row, col).
    pub(super) fn take(&mut self, rows: &[CellRow]) {
        self.cols.clear();
        self.cols.extend(rows.iter().map(|row| row.index.col));
        self.lines.clear();
        for (cell, row) in rows.iter().enumerate() {
            match self.lines.last_mut().filter(|(last, _)| *last == row.index.row) {
                Some((_, cells)) => cells.end = cell + 1,
                None => self.lines.push((row.index.row, cell..cell + 1)),
            }
        }
        self.extent = Extent::of(rows, 0);
        self.entries.clear();
        if let Some(extent) = self.extent {
            self.entries.extend(self.lines.iter().flat_map(|(_, cells)| entries(&self.cols, cells, &extent)));
        }
    }

    /// Calls `take` with the cells of each line of the square that reaches so many cells to each side.
    pub(super) fn each_line(&self, index: CellIndex, reach: i64, mut take: impl FnMut(Range<usize>)) {
        let (row, col) = (i64::from(index.row), i64::from(index.col));
        let first = self.lines.partition_point(|(line, _)| i64::from(*line) < row - reach);
        let lines = self.lines.iter().enumerate().skip(first);
        for (line, (_, cells)) in lines.take_while(|(_, (line, _))| i64::from(*line) <= row + reach) {
            let [from, to] = [col - reach, col + reach + 1].map(|col| self.entry(line, cells, col));
            take(from..to);
        }
    }

    /// The first cell of a line that is not before a column.
    fn entry(&self, line: usize, cells: &Range<usize>, col: i64) -> usize {
        match &self.extent {
            Some(extent) => self.entries[line * (extent.columns + 1) + extent.column(col)] as usize,
            None => cells.start + self.cols[cells.clone()].partition_point(|&own| i64::from(own) < col),
        }
    }
}

/// Of each column of the extent, and of the one behind the last, the first cell of a line that is not before it.
fn entries(cols: &[i32], cells: &Range<usize>, extent: &Extent) -> impl Iterator<Item = u32> {
    let (mut next, first_col) = (cells.clone(), extent.first_col);
    (0..=extent.columns as i64).map(move |column| {
        while next.start < next.end && i64::from(cols[next.start]) < first_col + column {
            next.start += 1;
        }
        next.start as u32
    })
}
