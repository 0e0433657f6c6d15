//! Mean heights of the cells of one scan -> each cell's height above the ground around it.
//!
//! Definition: of the cells of the same scan that hold points and whose centres lie within `radius_m` (the cell itself is
//! one of them; a centre on the circle lies within), take the mean heights; their percentile by nearest rank, the
//! ceil(percentile / 100 * n)-th of n from below and at least the first, is the local ground; the cell's own mean height
//! less the local ground is the feature. Heights and their difference are f64.
//!
//! Own construction; a low percentile of the surroundings stands in for the ground below an obstacle and follows slopes and
//! levelling errors. Running order statistic after Huang, Yang & Tang 1979 ("A fast two-dimensional median filtering
//! algorithm"): the window moves along a row, and only the cells on its rims go in and out of a set of ranks.
//! Deviation: ranks among the scan's cells instead of grey levels, so that the answer is exact.
//! Not modelled: the inside of the cells; an empty cell says nothing.

use super::CellRow;
use super::params::LocalHeightParams;

/// Reused memory; has no meaning between calls.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    /// Cell numbers by height, and the place of each cell in that order.
    by_rank: Vec<u32>,
    rank: Vec<u32>,
    rows: Vec<GridRow>,
    bands: Vec<WindowBand>,
    inside: OrderStatistics,
}

/// The cells of one row of the grid.
#[derive(Clone, Copy, Debug)]
struct GridRow {
    row: i64,
    from: usize,
    to: usize,
}

/// What the window covers of one row: cells `leave..enter` are inside.
#[derive(Clone, Copy, Debug)]
struct WindowBand {
    /// Columns to either side.
    half: i64,
    leave: usize,
    enter: usize,
    to: usize,
}

/// Calls `write(cell, height above the local ground)` for each cell; `rows` are sorted by (row, col), one height each.
pub(super) fn heights(
    params: &LocalHeightParams,
    size_m: f64,
    rows: &[CellRow],
    mean_heights_m: &[f64],
    scratch: &mut Scratch,
    mut write: impl FnMut(usize, f64),
) {
    let Scratch { by_rank, rank, rows: grid_rows, bands, inside } = scratch;
    by_rank.clear();
    by_rank.extend(0..rows.len() as u32);
    // Equal heights may stand in any order: the answer is a height.
    by_rank.sort_unstable_by(|&a, &b| mean_heights_m[a as usize].total_cmp(&mean_heights_m[b as usize]));
    rank.clear();
    rank.resize(rows.len(), 0);
    by_rank.iter().enumerate().for_each(|(place, &cell)| rank[cell as usize] = place as u32);
    grid_rows.clear();
    let mut from = 0;
    for of_row in rows.chunk_by(|a, b| a.index.row == b.index.row) {
        grid_rows.push(GridRow { row: i64::from(of_row[0].index.row), from, to: from + of_row.len() });
        from += of_row.len();
    }
    let col = |cell: usize| i64::from(rows[cell].index.col);
    let reach = reach_cells(params.radius_m, size_m);
    let mut first = 0;
    for &GridRow { row, from, to } in grid_rows.iter() {
        first += grid_rows[first..].iter().take_while(|other| ((row - other.row) as f64) > reach).count();
        let near = grid_rows[first..].iter().take_while(|other| (other.row - row) as f64 <= reach);
        bands.clear();
        bands.extend(near.map(|other| {
            let away = (other.row - row) as f64;
            let half = (reach * reach - away * away).sqrt().floor() as i64;
            WindowBand { half, leave: other.from, enter: other.from, to: other.to }
        }));
        inside.empty(rows.len());
        for cell in from..to {
            for band in bands.iter_mut() {
                while band.enter < band.to && col(band.enter) <= col(cell) + band.half {
                    inside.insert(rank[band.enter]);
                    band.enter += 1;
                }
                while band.leave < band.enter && col(band.leave) < col(cell) - band.half {
                    inside.remove(rank[band.leave]);
                    band.leave += 1;
                }
            }
            let ground = by_rank[inside.nth(nearest_rank(params.percentile, inside.len)) as usize];
            write(cell, mean_heights_m[cell] - mean_heights_m[ground as usize]);
        }
    }
}

/// The radius in cells. A billionth more: 0.3 m / 0.1 m is a rounding less than 3, and a centre on the circle lies within.
pub(super) fn reach_cells(radius_m: f64, size_m: f64) -> f64 {
    radius_m / size_m * (1.0 + 1e-9)
}

/// Which of `count` values, from 0, is their percentile.
pub(super) fn nearest_rank(percentile: f64, count: u32) -> u32 {
    ((percentile * f64::from(count) / 100.0).ceil() as u32).max(1) - 1
}

/// A set of ranks that finds its nth: a bit for each, and counts of 64 and of 4096.
#[derive(Clone, Debug, Default)]
struct OrderStatistics {
    bits: Vec<u64>,
    /// Of each word, and of each 64 words.
    in_word: Vec<u8>,
    in_block: Vec<u32>,
    len: u32,
}

impl OrderStatistics {
    /// Of ranks below `ranks`, none.
    fn empty(&mut self, ranks: usize) {
        let words = ranks.div_ceil(64);
        self.bits.clear();
        self.bits.resize(words, 0);
        self.in_word.clear();
        self.in_word.resize(words, 0);
        self.in_block.clear();
        self.in_block.resize(words.div_ceil(64), 0);
        self.len = 0;
    }

    /// `rank` is not in the set yet.
    fn insert(&mut self, rank: u32) {
        let word = rank as usize / 64;
        self.bits[word] |= 1 << (rank % 64);
        self.in_word[word] += 1;
        self.in_block[word / 64] += 1;
        self.len += 1;
    }

    /// `rank` is in the set.
    fn remove(&mut self, rank: u32) {
        let word = rank as usize / 64;
        self.bits[word] &= !(1 << (rank % 64));
        self.in_word[word] -= 1;
        self.in_block[word / 64] -= 1;
        self.len -= 1;
    }

    /// The nth rank from below, from 0; `nth` is less than `len`.
    fn nth(&self, mut nth: u32) -> u32 {
        let mut block = 0;
        while nth >= self.in_block[block] {
            nth -= self.in_block[block];
            block += 1;
        }
        let mut word = 64 * block;
        while nth >= u32::from(self.in_word[word]) {
            nth -= u32::from(self.in_word[word]);
            word += 1;
        }
        let mut bits = self.bits[word];
        for _ in 0..nth {
            bits &= bits - 1;
        }
        64 * word as u32 + bits.trailing_zeros()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::cells::fixtures::{rows_and_heights, square};

    const METRE: LocalHeightParams = LocalHeightParams { radius_m: 1.0, percentile: 10.0, plane: false };

    /// Of cells (row, col, mean height), sorted by row and column.
    fn computed(params: &LocalHeightParams, size_m: f64, cells: &[(i32, i32, f64)], scratch: &mut Scratch) -> Vec<f64> {
        let (rows, means) = rows_and_heights(cells);
        let mut out = vec![f64::NAN; rows.len()];
        heights(params, size_m, &rows, &means, scratch, |cell, height_m| out[cell] = height_m);
        out
    }

    /// The definition, pair by pair.
    fn plainly(params: &LocalHeightParams, size_m: f64, cells: &[(i32, i32, f64)]) -> Vec<f64> {
        let radius_cells = params.radius_m / size_m;
        let above = |&(row, col, mean): &(i32, i32, f64)| {
            let within = |&&(r, c, _): &&(i32, i32, f64)| {
                let (north, east) = (f64::from(r) - f64::from(row), f64::from(c) - f64::from(col));
                north * north + east * east <= radius_cells * radius_cells * (1.0 + 1e-9)
            };
            let mut near: Vec<f64> = cells.iter().filter(within).map(|cell| cell.2).collect();
            near.sort_by(f64::total_cmp);
            // The first that leaves no less than the percentile at or below it.
            let enough = |k: &usize| 100.0 * *k as f64 >= params.percentile * near.len() as f64;
            let nth = (1..=near.len()).find(enough);
            mean - near[nth.expect("the cell itself is near") - 1]
        };
        cells.iter().map(above).collect()
    }

    proptest! {
        #[test]
        fn exact_heights_are_those_of_the_definition_pair_by_pair(
            cells in prop::collection::btree_map((-30i32..30, -40i32..40), -2.0..2.0f64, 0..600),
            size_m in prop::sample::select(vec![0.1, 0.07, 0.25, 1.5]),
            radius_m in prop::sample::select(vec![0.1, 0.3, 0.7, 1.0, 3.0]),
            percentile in prop::sample::select(vec![0.0, 1.0, 10.0, 25.0, 50.0]),
            steps in prop::sample::select(vec![1e9, 3.0]),
        ) {
            // Coarse steps make ties.
            let cells: Vec<_> = cells.into_iter().map(|((r, c), h)| (r, c, (h * steps).round() / steps)).collect();
            let params = LocalHeightParams { radius_m, percentile, plane: false };
            let mut scratch = Scratch::default();
            let first = computed(&params, size_m, &cells, &mut scratch);
            prop_assert_eq!(&first, &plainly(&params, size_m, &cells));
            // What an earlier call left in the scratch has no meaning.
            computed(&METRE, 0.1, &square(9, |r, c| f64::from(r * c)), &mut scratch);
            prop_assert_eq!(first, computed(&params, size_m, &cells, &mut scratch));
        }
    }

    #[test]
    fn exact_level_ground_one_cell_alone_and_a_radius_below_a_cell_give_0() {
        let mut scratch = Scratch::default();
        for percentile in [0.0, 10.0, 50.0] {
            let params = LocalHeightParams { percentile, ..METRE };
            assert!(computed(&params, 0.1, &square(15, |_, _| 0.7), &mut scratch).iter().all(|h| *h == 0.0));
            assert_eq!(computed(&params, 0.1, &[(-7, 3, 123.4)], &mut scratch), [0.0]);
            let small = LocalHeightParams { radius_m: 0.1, percentile, plane: false };
            let rough = square(15, |r, c| f64::from(r * r - 3 * c));
            assert!(computed(&small, 0.101, &rough, &mut scratch).iter().all(|h| *h == 0.0));
        }
        assert!(computed(&METRE, 0.1, &[], &mut scratch).is_empty());
    }

    #[test]
    fn exact_a_centre_on_the_circle_lies_within() {
        // 0.3 / 0.1 is a rounding less than 3.
        let cells = [(0, 0, 0.0), (0, 3, 1.0), (0, 7, 5.0)];
        let lowest = LocalHeightParams { radius_m: 0.3, percentile: 0.0, plane: false };
        assert_eq!(computed(&lowest, 0.1, &cells, &mut Scratch::default()), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn exact_of_ranks_the_nearest_from_above_counts() {
        // A row of ten within reach of one another, heights 0 to 9.
        let cells: Vec<_> = (0..10).map(|c| (0, c, f64::from(c))).collect();
        for (percentile, ground_m) in [(0.0, 0.0), (10.0, 0.0), (10.1, 1.0), (20.0, 1.0), (45.0, 4.0), (50.0, 4.0)] {
            let params = LocalHeightParams { radius_m: 5.0, percentile, plane: false };
            let expected: Vec<f64> = cells.iter().map(|cell| cell.2 - ground_m).collect();
            assert_eq!(computed(&params, 0.1, &cells, &mut Scratch::default()), expected);
        }
    }

    #[test]
    fn law_a_step_on_a_tilted_plane_stands_out_by_its_height() {
        // Cells of 0.1 m on a slope of 0.1 to the east: 1 m lifts the ground by 0.1 m. A block of 3 x 3 cells, 0.4 m tall.
        let block = |r: i32, c: i32| r.abs() <= 1 && c.abs() <= 1;
        let cells = square(25, |r, c| 0.01 * f64::from(c) + if block(r, c) { 0.4 } else { 0.0 });
        let out = computed(&METRE, 0.1, &cells, &mut Scratch::default());
        for (&(r, c, _), &height_m) in cells.iter().zip(&out).filter(|((r, c, _), _)| r.abs() < 15 && c.abs() < 15) {
            // The lowest tenth of a disc ends 0.687 of the radius below its centre; the block among the cells moves that by one.
            let own_m = if block(r, c) { height_m - 0.4 } else { height_m };
            assert!((0.055..0.085).contains(&own_m), "{r} {c} {height_m}");
        }
    }

    #[test]
    fn extreme_cells_at_both_ends_of_the_grid_do_not_overflow() {
        let far = i32::MAX - 17;
        let cells = [(-far, -far, 1.0), (-far, far, 2.0), (0, 0, 3.0), (far, -far, 4.0), (far, far, 5.0)];
        assert_eq!(computed(&METRE, 0.01, &cells, &mut Scratch::default()), [0.0; 5]);
    }
}
