//! Weighted heights of cells -> the height of the ground at nodes between them.
//!
//! In: per cell a weight and the weight times a height; which rows of cells hold any, and which have changed. Out: at each node
//! the height of the plane that fits the cells around it under a Gaussian window. The window is separable, so that its moments
//! are two passes of short sums, first along y and then along x. The moments along y are kept: weights that have not changed
//! since the last fit are not summed again. Sums run over rows and over columns as they come; a cell without weight adds 0
//! to them and is left out where whole blocks have none.

use std::ops::Range;

use super::{CELLS_A_NODE, Cells};
use crate::math;
use crate::wide::LANES;

/// Standard deviation of the window, metres; it is cut at two and a half of them.
const WINDOW_M: f64 = 0.7;
const WINDOW_CUT: f64 = 2.5;
/// A node with less weight than this around it has no ground.
const LEAST_WEIGHT: f64 = 0.05;
/// Slopes are drawn to level by this share of the weight (cells squared): decides only where the cells lie on a line.
const LEVEL_SHARE: f64 = 1e-3;

/// Weight, weight times y, weight times y squared, height, height times y (of cells by their weights).
const MOMENTS: usize = 5;

/// The window `k` steps from its centre, where it is `g`.
#[derive(Clone, Debug)]
struct FilterTap {
    g: f64,
    /// 1, k, k^2.
    powers: [f64; 3],
    /// g, g k, g k^2.
    weighted: [f64; 3],
    /// Where the column so far from the first node lies among those by phase.
    place: usize,
}

/// Fits planes at the nodes of one grid.
#[derive(Clone, Debug)]
pub(super) struct Planes {
    side: usize,
    nodes: usize,
    taps: Vec<FilterTap>,
    /// Columns of nothing before the first, a multiple of `CELLS_A_NODE`; there are some after the last as well.
    before: usize,
    /// Moments along y by row of nodes, moment and column of cells.
    along_y: Vec<f64>,
    /// Those of the row of nodes in work. Columns that lie `CELLS_A_NODE` apart stand side by side (`phase_len` of them), so
    /// that what several nodes need next lies together.
    by_phase: Vec<f64>,
    phase_len: usize,
    /// Which blocks of columns have new moments at the current row of nodes.
    anew: Vec<bool>,
}

impl Planes {
    /// For a grid of `side` rows and columns of cells in blocks of `LANES` columns.
    pub(super) fn new(side: usize, cell_m: f64, nodes: usize) -> Planes {
        let reach = (WINDOW_CUT * WINDOW_M / cell_m) as usize;
        let before = reach.next_multiple_of(CELLS_A_NODE);
        let width = side.next_multiple_of(LANES);
        let after = nodes.next_multiple_of(LANES) * CELLS_A_NODE + reach;
        let phase_len = (before + after.max(width)) / CELLS_A_NODE + 1;
        let tap = |step: usize| {
            let k = step as f64 - reach as f64;
            let t = k * cell_m / WINDOW_M;
            let g = math::exp(-0.5 * t * t);
            let column = before + step - reach;
            let place = column % CELLS_A_NODE * phase_len + column / CELLS_A_NODE;
            FilterTap { g, powers: [1.0, k, k * k], weighted: [g, g * k, g * k * k], place }
        };
        Planes {
            side,
            nodes,
            taps: (0..=2 * reach).map(tap).collect(),
            before,
            along_y: vec![0.0; nodes * MOMENTS * CELLS_A_NODE * phase_len],
            by_phase: vec![0.0; MOMENTS * CELLS_A_NODE * phase_len],
            phase_len,
            anew: vec![false; width / LANES],
        }
    }

    /// Cells from a window's centre to its edge.
    #[inline(always)]
    fn reach(&self) -> usize {
        self.taps.len() / 2
    }

    /// The height at every node: written where cells around it lie in `changed` rows, else left as it is.
    ///
    /// Per block of columns: `held` and `changed` are the rows outside which no cell has a weight, or has another than it had.
    #[inline(always)]
    pub(super) fn fit(&mut self, cells: &Cells, held: &[Range<usize>], changed: &[Range<usize>], node_m: &mut [f64]) {
        let reach = self.reach();
        for node_row in 0..self.nodes {
            let centre = node_row * CELLS_A_NODE;
            let near = centre.saturating_sub(reach)..(centre + reach + 1).min(self.side);
            for block in 0..self.anew.len() {
                self.anew[block] = !overlap(&near, &changed[block]).is_empty();
                if self.anew[block] {
                    self.gather(cells, block, overlap(&near, &held[block]), node_row);
                }
            }
            if !self.anew.contains(&true) {
                continue;
            }
            self.part_phases(node_row);
            for first in (0..self.nodes).step_by(LANES) {
                let left = (first * CELLS_A_NODE).saturating_sub(reach) / LANES;
                let right = ((first + LANES - 1) * CELLS_A_NODE + reach) / LANES;
                let blocks = left..(right + 1).min(self.anew.len());
                if !self.anew[blocks.clone()].contains(&true) {
                    continue;
                }
                let count = LANES.min(self.nodes - first);
                let nodes_m = &mut node_m[node_row * self.nodes + first..][..count];
                if held[blocks].iter().all(|held| overlap(&near, held).is_empty()) {
                    nodes_m.fill(f64::NAN);
                } else {
                    nodes_m.copy_from_slice(&self.planes_m(first)[..count]);
                }
            }
        }
    }

    /// Moments of a block of columns over some rows, about a row of nodes.
    #[inline(always)]
    fn gather(&mut self, cells: &Cells, block: usize, rows: Range<usize>, node_row: usize) {
        let first_tap = rows.start + self.reach() - node_row * CELLS_A_NODE;
        let taps = &self.taps[first_tap..first_tap + rows.len()];
        let from = rows.start * cells.width + block * LANES;
        let (weight, weighted_m) = (&cells.weight[from..], &cells.weighted_m[from..]);
        let sums = [
            sum_along_y::<0>(taps, weight, cells.width),
            sum_along_y::<1>(taps, weight, cells.width),
            sum_along_y::<2>(taps, weight, cells.width),
            sum_along_y::<0>(taps, weighted_m, cells.width),
            sum_along_y::<1>(taps, weighted_m, cells.width),
        ];
        for (moment, sums) in sums.iter().enumerate() {
            let columns = self.columns(node_row, moment);
            self.along_y[columns][self.before + block * LANES..][..LANES].copy_from_slice(sums);
        }
    }

    /// Where a moment's columns lie.
    #[inline(always)]
    fn columns(&self, node_row: usize, moment: usize) -> Range<usize> {
        let count = CELLS_A_NODE * self.phase_len;
        let from = (node_row * MOMENTS + moment) * count;
        from..from + count
    }

    #[inline(always)]
    fn part_phases(&mut self, node_row: usize) {
        for (moment, phases) in self.by_phase.chunks_exact_mut(CELLS_A_NODE * self.phase_len).enumerate() {
            let from = (node_row * MOMENTS + moment) * phases.len();
            let columns = self.along_y[from..from + phases.len()].as_chunks::<CELLS_A_NODE>().0;
            let (first, rest) = phases.split_at_mut(self.phase_len);
            let (second, rest) = rest.split_at_mut(self.phase_len);
            let (third, fourth) = rest.split_at_mut(self.phase_len);
            let phases = first.iter_mut().zip(second).zip(third).zip(fourth);
            for ((((first, second), third), fourth), columns) in phases.zip(columns) {
                [*first, *second, *third, *fourth] = *columns;
            }
        }
    }

    /// The sum over columns of a moment by the window and a power of x, about nodes from one on.
    #[inline(always)]
    fn sum_along_x<const POWER: usize>(&self, moment: &[f64], first: usize) -> [f64; LANES] {
        let mut sum = [0.0; LANES];
        for tap in &self.taps {
            let values = &moment[tap.place + first..][..LANES];
            for l in 0..LANES {
                sum[l] += tap.powers[POWER] * (tap.g * values[l]);
            }
        }
        sum
    }

    /// The heights at nodes of a row, from one on, of the planes fitted around them.
    #[inline(always)]
    fn planes_m(&self, first: usize) -> [f64; LANES] {
        let len = CELLS_A_NODE * self.phase_len;
        let moment = |moment: usize| &self.by_phase[moment * len..][..len];
        let (w, wy, wyy, z, zy) = (moment(0), moment(1), moment(2), moment(3), moment(4));
        let s = self.sum_along_x::<0>(w, first);
        let sx = self.sum_along_x::<1>(w, first);
        let sxx = self.sum_along_x::<2>(w, first);
        let sy = self.sum_along_x::<0>(wy, first);
        let sxy = self.sum_along_x::<1>(wy, first);
        let syy = self.sum_along_x::<0>(wyy, first);
        let t = self.sum_along_x::<0>(z, first);
        let tx = self.sum_along_x::<1>(z, first);
        let ty = self.sum_along_x::<0>(zy, first);
        let mut heights_m = [0.0; LANES];
        for l in 0..LANES {
            // About the weighted mean the plane's height and its two slopes part.
            let (mx, my, mz) = (sx[l] / s[l], sy[l] / s[l], t[l] / s[l]);
            let xx = sxx[l] / s[l] - mx * mx + LEVEL_SHARE;
            let yy = syy[l] / s[l] - my * my + LEVEL_SHARE;
            let xy = sxy[l] / s[l] - mx * my;
            let (xz, yz) = (tx[l] / s[l] - mx * mz, ty[l] / s[l] - my * mz);
            let determinant = xx * yy - xy * xy;
            let slope_x = (xz * yy - yz * xy) / determinant;
            let slope_y = (yz * xx - xz * xy) / determinant;
            heights_m[l] = if s[l] < LEAST_WEIGHT { f64::NAN } else { mz - slope_x * mx - slope_y * my };
        }
        heights_m
    }
}

/// The sum over rows of values by the window and a power of y. One sum at a time: several in one loop
/// are vectorised across the sums, which is slower.
#[inline(always)]
fn sum_along_y<const POWER: usize>(taps: &[FilterTap], values: &[f64], width: usize) -> [f64; LANES] {
    let mut sum = [0.0; LANES];
    for (row, tap) in taps.iter().enumerate() {
        let values = &values[row * width..][..LANES];
        for l in 0..LANES {
            sum[l] += tap.weighted[POWER] * values[l];
        }
    }
    sum
}

/// The part of a range that lies in another as well.
#[inline(always)]
fn overlap(range: &Range<usize>, other: &Range<usize>) -> Range<usize> {
    let start = other.start.clamp(range.start, range.end);
    start..other.end.clamp(start, range.end)
}

#[cfg(test)]
mod tests;
