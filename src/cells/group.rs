//! Cell indices of points -> the points' order by cell.
//!
//! A stable sort by (row, col), so that points of a cell stay in slot order: by counting columns and then rows where the
//! points lie close together, by comparison where their spread would make the counts longer than the points are many.

use crate::geometry::CellIndex;

/// Counting pays up to this many rows and columns a point, and always up to `FREE_COUNTS`.
const COUNTS_A_POINT: i64 = 4;
const FREE_COUNTS: i64 = 1 << 14;

/// Reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Order {
    /// Point numbers, sorted by (row, col) and then by number.
    pub(super) by_cell: Vec<u32>,
    by_col: Vec<u32>,
    counts: Vec<u32>,
}

impl Order {
    pub(super) fn sort(&mut self, cells: &[CellIndex]) {
        let extent = |value: fn(&CellIndex) -> i32| {
            cells.iter().map(value).fold((i32::MAX, i32::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let ((row_min, row_max), (col_min, col_max)) = (extent(|c| c.row), extent(|c| c.col));
        let span = |low: i32, high: i32| i64::from(high) - i64::from(low) + 1;
        let counts = span(row_min, row_max).max(span(col_min, col_max));
        self.by_cell.clear();
        if cells.is_empty() {
            return;
        }
        if counts > FREE_COUNTS.max(COUNTS_A_POINT * cells.len() as i64) {
            self.by_cell.extend(0..cells.len() as u32);
            self.by_cell.sort_unstable_by_key(|&i| (cells[i as usize], i));
            return;
        }
        self.by_col.clear();
        self.by_col.resize(cells.len(), 0);
        self.by_cell.resize(cells.len(), 0);
        let col = |i: u32| (cells[i as usize].col - col_min) as usize;
        let row = |i: u32| (cells[i as usize].row - row_min) as usize;
        count_sort(0..cells.len() as u32, span(col_min, col_max) as usize, col, &mut self.counts, &mut self.by_col);
        let by_col = self.by_col.iter().copied();
        count_sort(by_col, span(row_min, row_max) as usize, row, &mut self.counts, &mut self.by_cell);
    }
}

/// Writes `items` to `out`, stably sorted by `key` in 0..keys.
fn count_sort(
    items: impl Iterator<Item = u32> + Clone,
    keys: usize,
    key: impl Fn(u32) -> usize,
    counts: &mut Vec<u32>,
    out: &mut [u32],
) {
    counts.clear();
    counts.resize(keys, 0);
    for item in items.clone() {
        counts[key(item)] += 1;
    }
    let mut next = 0;
    for count in counts.iter_mut() {
        next += std::mem::replace(count, next);
    }
    for item in items {
        let place = &mut counts[key(item)];
        out[*place as usize] = item;
        *place += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equal_both_sorts_agree_with_the_standard_stable_sort(
            spread in prop::sample::select(vec![1, 30, 20_000, i32::MAX - 20]),
            seeds in prop::collection::vec((any::<i32>(), any::<i32>()), 0..300),
        ) {
            let cells: Vec<CellIndex> = seeds.iter().map(|&(r, c)| CellIndex { row: r % spread, col: c % spread }).collect();
            let mut expected: Vec<u32> = (0..cells.len() as u32).collect();
            expected.sort_by_key(|&i| cells[i as usize]);
            let mut order = Order::default();
            order.sort(&cells);
            prop_assert_eq!(order.by_cell, expected);
        }
    }
}
