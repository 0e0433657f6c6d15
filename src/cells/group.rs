//! Cell indices of points -> the cells that hold points, and each point's cell among them.
//!
//! Cells are numbered by (row, col). Where the points lie close together, a map with a bit a cell of their rectangle says which cells
//! are taken, and the bits before a cell are its number; where their spread would make the map long, the points are sorted by
//! comparison.

use crate::geometry::CellIndex;
use crate::wide::{Work, widest};

/// The map of bits is used where it needs no more than this many words for each point, and always up to `FREE_WORDS`.
const WORDS_A_POINT: i64 = 1;
const FREE_WORDS: i64 = 1 << 12;
/// A place in the map is a `u32`.
const MAX_WORDS: i64 = 1 << 26;

/// Reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Numbers {
    /// The cells that hold points, sorted.
    pub(super) cells: Vec<CellIndex>,
    /// Per point, its cell's place in that row.
    pub(super) of_point: Vec<u32>,
    map: Vec<BitWord>,
    by_cell: Vec<u32>,
}

/// Neighbours on a row, the first at bit 0.
#[derive(Clone, Copy, Debug, Default)]
struct BitWord {
    taken: u64,
    /// Taken cells in all words before.
    before: u32,
}

impl Numbers {
    pub(super) fn number(&mut self, of_points: &[CellIndex]) {
        self.cells.clear();
        self.of_point.clear();
        if of_points.is_empty() {
            return;
        }
        widest(AssignNumbers { numbers: self, of_points });
    }

    /// Inlined into each of its forms: most of it is comparing, shifting and counting bits.
    #[inline(always)]
    fn number_sized(&mut self, of_points: &[CellIndex]) {
        let (mut low, mut high) = (of_points[0], of_points[0]);
        for cell in of_points {
            low = CellIndex { row: low.row.min(cell.row), col: low.col.min(cell.col) };
            high = CellIndex { row: high.row.max(cell.row), col: high.col.max(cell.col) };
        }
        let span = |low: i32, high: i32| i64::from(high) - i64::from(low) + 1;
        let words_a_row = (span(low.col, high.col) + 63) / 64;
        let words = span(low.row, high.row) * words_a_row;
        if words > FREE_WORDS.max(WORDS_A_POINT * of_points.len() as i64).min(MAX_WORDS) {
            self.by_comparison(of_points);
        } else {
            self.by_map(of_points, low, words as usize, words_a_row as usize);
        }
    }

    #[inline(always)]
    fn by_map(&mut self, of_points: &[CellIndex], low: CellIndex, words: usize, words_a_row: usize) {
        let Numbers { cells, of_point, map, .. } = self;
        map.clear();
        map.resize(words, BitWord::default());
        for cell in of_points {
            // A span may be wider than i32, and is never wider than u32.
            let [row, col] =
                [cell.row.wrapping_sub(low.row), cell.col.wrapping_sub(low.col)].map(|away| away as u32 as usize);
            let (word, bit) = (row * words_a_row + col / 64, col % 64);
            // Most cells are taken already: a word that is not written need not be waited for.
            if map[word].taken >> bit & 1 == 0 {
                map[word].taken |= 1 << bit;
            }
            // The cell's place in the map, until its number is known.
            of_point.push((word << 6 | bit) as u32);
        }
        for (row, words) in (low.row..).zip(map.chunks_exact_mut(words_a_row)) {
            for (first, word) in (i64::from(low.col)..).step_by(64).zip(words) {
                word.before = cells.len() as u32;
                let mut left = word.taken;
                while left != 0 {
                    cells.push(CellIndex { row, col: (first + i64::from(left.trailing_zeros())) as i32 });
                    left &= left - 1;
                }
            }
        }
        for number in of_point {
            let BitWord { taken, before } = map[(*number >> 6) as usize];
            *number = before + (taken & ((1 << (*number & 63)) - 1)).count_ones();
        }
    }

    #[inline(never)]
    fn by_comparison(&mut self, of_points: &[CellIndex]) {
        let Numbers { cells, of_point, by_cell, .. } = self;
        by_cell.clear();
        by_cell.extend(0..of_points.len() as u32);
        by_cell.sort_unstable_by_key(|&i| of_points[i as usize]);
        of_point.resize(of_points.len(), 0);
        for &i in by_cell.iter() {
            let cell = of_points[i as usize];
            if cells.last() != Some(&cell) {
                cells.push(cell);
            }
            of_point[i as usize] = cells.len() as u32 - 1;
        }
    }
}

/// [`Numbers::number`], in the machine's widest form.
struct AssignNumbers<'a> {
    numbers: &'a mut Numbers,
    of_points: &'a [CellIndex],
}

impl Work for AssignNumbers<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.numbers.number_sized(self.of_points);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equal_numbers_by_map_and_by_comparison_are_those_of_the_sorted_cells(
            spread in prop::sample::select(vec![1, 30, 100, 400, 20_000, i32::MAX - 20]),
            seeds in prop::collection::vec((any::<i32>(), any::<i32>()), 0..300),
        ) {
            let of_points: Vec<CellIndex> =
                seeds.iter().map(|&(r, c)| CellIndex { row: r % spread, col: c % spread }).collect();
            let mut expected = of_points.clone();
            expected.sort();
            expected.dedup();
            let mut numbers = Numbers::default();
            numbers.number(&of_points);
            prop_assert_eq!(&numbers.cells, &expected);
            let found: Vec<CellIndex> = numbers.of_point.iter().map(|&cell| expected[cell as usize]).collect();
            prop_assert_eq!(found, of_points);
        }
    }
}
