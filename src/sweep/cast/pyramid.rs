//! A raster ground -> the pyramid of planes that rays descend.
//!
//! In: a [`Raster`], heights in metres at nodes. Out: [`Level`]s of [`Block`]s of 2 x 2, 4 x 4, ... cells up to one of all; each with a plane and how far the
//! nodes of the block lie below and above it, and how far above those of half a block around. The bounds are those of the nodes, and a margin for rounding.
//! Nodes go by lanes (`wide`); extremes are the same in any order.

use super::newton::{larger, smaller};
use crate::scene::Raster;
use crate::wide::{self, LANES, Work};

/// Margin of the blocks' bounds: above the rounding of heights of a kilometre.
const MARGIN_M: f64 = 1e-12;

/// The highest level whose blocks know the ground around them.
pub(super) const AROUND_LEVELS: usize = 6;

/// Blocks of one size, row by row.
pub(super) struct Level {
    pub rows: usize,
    pub cols: usize,
    pub blocks: Vec<Block>,
}

/// The plane height + east * (x - x0) + north * (y - y0) from the block's south-west corner, x and y in cells, and where the
/// ground lies from it.
#[derive(Clone, Copy)]
pub(super) struct Block {
    pub height: f64,
    pub east: f64,
    pub north: f64,
    pub low: f64,
    pub high: f64,
    /// As `high`, for the block and half its side around it.
    pub high_around: f64,
}

/// All levels, the smallest blocks first.
pub(super) fn levels(raster: &Raster) -> Vec<Level> {
    let mut levels = Vec::new();
    let (mut rows, mut cols, mut side) = (raster.rows - 1, raster.cols - 1, 1);
    while rows > 1 || cols > 1 || side == 1 {
        (rows, cols, side) = (rows.div_ceil(2), cols.div_ceil(2), 2 * side);
        levels.push(Level { rows, cols, blocks: wide::widest(Blocks { raster, rows, cols, side }) });
    }
    levels
}

/// The blocks of a level, row by row.
struct Blocks<'a> {
    raster: &'a Raster,
    rows: usize,
    cols: usize,
    side: usize,
}

impl Work for Blocks<'_> {
    type Out = Vec<Block>;

    #[inline(always)]
    fn run(self) -> Vec<Block> {
        let Blocks { raster, rows, cols, side } = self;
        let mut blocks = Vec::with_capacity(rows * cols);
        for row in 0..rows {
            for col in 0..cols {
                blocks.push(block(raster, row * side, col * side, side));
            }
        }
        blocks
    }
}

/// The plane of a block through three of its corners, and the bounds of all its nodes.
#[inline(always)]
fn block(raster: &Raster, row: usize, col: usize, side: usize) -> Block {
    let (last_row, last_col) = ((row + side).min(raster.rows - 1), (col + side).min(raster.cols - 1));
    let node = |row: usize, col: usize| raster.heights_m[row * raster.cols + col];
    let (height, rows, cols) = (node(row, col), (last_row - row) as f64, (last_col - col) as f64);
    let east = 0.5 * (node(row, last_col) - height + node(last_row, last_col) - node(last_row, col)) / cols;
    let north = 0.5 * (node(last_row, col) - height + node(last_row, last_col) - node(row, last_col)) / rows;
    let (low, high) = above_plane(raster, (row, col), [height, east, north], [row, last_row], [col, last_col]);
    let margin = MARGIN_M * (1.0 + height.abs());
    let mut block = Block { height, east, north, low: low - margin, high: high + margin, high_around: f64::INFINITY };
    if side <= 1 << AROUND_LEVELS {
        let around =
            |from: usize, last: usize, nodes: usize| [from.saturating_sub(side / 2), (last + side / 2).min(nodes - 1)];
        let (rows, cols) = (around(row, last_row, raster.rows), around(col, last_col, raster.cols));
        block.high_around = above_plane(raster, (row, col), [height, east, north], rows, cols).1 + margin;
    }
    block
}

/// How far the nodes of [first, last] rows and columns lie below (or on) and above (or on) a plane through node (row, col).
#[inline(always)]
fn above_plane(
    raster: &Raster,
    from: (usize, usize),
    plane: [f64; 3],
    rows: [usize; 2],
    cols: [usize; 2],
) -> (f64, f64) {
    match cols[1] - cols[0] + 1 {
        0..4 => above_plane_by::<1>(raster, from, plane, rows, cols),
        4..LANES => above_plane_by::<4>(raster, from, plane, rows, cols),
        _ => above_plane_by::<LANES>(raster, from, plane, rows, cols),
    }
}

/// The same, `N` nodes of a row at a time, of which a row has as many at least.
#[inline(always)]
fn above_plane_by<const N: usize>(
    raster: &Raster,
    (row, col): (usize, usize),
    [height, east, north]: [f64; 3],
    rows: [usize; 2],
    cols: [usize; 2],
) -> (f64, f64) {
    let (mut low, mut high) = ([0.0; N], [0.0; N]);
    let last = cols[1] - cols[0] + 1 - N;
    for r in rows[0]..=rows[1] {
        let along = height + north * (r as f64 - row as f64) - east * (col as f64 - cols[0] as f64);
        let heights = &raster.heights_m[r * raster.cols + cols[0]..=r * raster.cols + cols[1]];
        let mut first = 0;
        loop {
            let nodes: &[f64; N] = heights[first..].first_chunk().expect("a row has as many nodes");
            for lane in 0..N {
                let above = nodes[lane] - (along + east * (first as f64 + lane as f64));
                low[lane] = smaller(low[lane], above);
                high[lane] = larger(high[lane], above);
            }
            if first == last {
                break;
            }
            // The last nodes of a row with some of those before them, which change nothing.
            first = (first + N).min(last);
        }
    }
    (low.into_iter().fold(0.0, smaller), high.into_iter().fold(0.0, larger))
}

#[cfg(test)]
mod tests;
