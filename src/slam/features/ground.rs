//! Levelled points -> a smooth ground under them.
//!
//! In: points, sensor at the origin, x and y level. Out: the ground's height anywhere on the grid, metres above the sensor
//! (so usually negative). A plane fitted to the cells' lowest points under a Gaussian window, with outliers (rocks above,
//! noise below) weighed down four times over. The window is separable, so that its moments are two passes of short sums; they
//! are taken at nodes four cells apart, and the ground is bilinear between: over 0.4 m its bend is millimetres.

use crate::math;
use crate::wide::{LANES, Work, widest};

/// Standard deviation of the window, metres; it is cut at two and a half of them.
const WINDOW_M: f64 = 0.7;
const WINDOW_CUT: f64 = 2.5;
const NODE_CELLS: usize = 4;
const REWEIGHTINGS: usize = 4;
/// Cells more than this above the fitted ground hold a rock; more than that below, noise.
const HIGH_M: f64 = 0.03;
const LOW_M: f64 = 0.06;
const HIGH_WEIGHT: f64 = 0.02;
const LOW_WEIGHT: f64 = 0.5;
/// A node with less weight than this around it has no ground.
const LEAST_WEIGHT: f64 = 0.05;
/// Slopes are drawn to level by this share of the weight (cells squared): decides only where the cells lie on a line.
const LEVEL_SHARE: f64 = 1e-3;

/// Lowest and highest point of each cell, and the ground under them.
#[derive(Clone, Debug)]
pub struct GroundGrid {
    half_m: f64,
    cell_m: f64,
    side: usize,
    /// From row to row in the lists of cells: whole blocks of lanes; the last cells of a row may be off the grid, and stay empty.
    width: usize,
    lowest_m: Vec<f64>,
    highest_m: Vec<f64>,
    /// How far each cell's highest point stands above the ground; not a number where there is no point or no ground.
    standing_m: Vec<f64>,
    /// Per cell: weight in the fit, and weight times lowest point; 0 where empty.
    weight: Vec<f64>,
    weighted_m: Vec<f64>,
    nodes: usize,
    /// Ground height at the nodes; NaN where there is none.
    node_m: Vec<f64>,
    moments: Moments,
    window: Vec<f64>,
}

/// Moments along y at one row of nodes: five for each column of cells.
///
/// Columns that lie `NODE_CELLS` apart stand side by side, so that what several nodes need next lies together; there are columns
/// of nothing before the first and after the last.
#[derive(Clone, Debug)]
struct Moments {
    /// Columns of nothing before the first, a multiple of `NODE_CELLS`.
    before: usize,
    by_phase: [[Vec<f64>; NODE_CELLS]; 5],
}

impl Moments {
    fn new(side: usize, nodes: usize, reach: usize) -> Moments {
        let before = reach.next_multiple_of(NODE_CELLS);
        let last_column = (nodes.next_multiple_of(LANES) * NODE_CELLS + reach).max(side.next_multiple_of(LANES));
        let length = (before + last_column) / NODE_CELLS + 1;
        Moments { before, by_phase: std::array::from_fn(|_| std::array::from_fn(|_| vec![0.0; length])) }
    }
}

impl GroundGrid {
    /// A square grid of `2 half_m` a side around the sensor.
    pub fn new(half_m: f64, cell_m: f64) -> GroundGrid {
        let side = (2.0 * half_m / cell_m).ceil() as usize;
        let width = side.next_multiple_of(LANES);
        let cells = width * side;
        let nodes = side / NODE_CELLS + 2;
        let reach = (WINDOW_CUT * WINDOW_M / cell_m) as i64;
        let window = (-reach..=reach).map(|k| {
            let t = k as f64 * cell_m / WINDOW_M;
            math::exp(-0.5 * t * t)
        });
        GroundGrid {
            half_m: 0.5 * side as f64 * cell_m,
            cell_m,
            side,
            width,
            lowest_m: vec![f64::INFINITY; cells],
            highest_m: vec![f64::NEG_INFINITY; cells],
            standing_m: vec![f64::NAN; cells],
            weight: vec![0.0; cells],
            weighted_m: vec![0.0; cells],
            nodes,
            node_m: vec![f64::NAN; nodes * nodes],
            moments: Moments::new(side, nodes, reach as usize),
            window: window.collect(),
        }
    }

    /// Rows, and cells from one row to the next.
    pub fn rows_and_width(&self) -> (usize, usize) {
        (self.side, self.width)
    }

    pub fn clear(&mut self) {
        self.lowest_m.fill(f64::INFINITY);
        self.highest_m.fill(f64::NEG_INFINITY);
    }

    /// Column and row of a point, in cells: outside `0.0..side` it is not on the grid.
    #[inline(always)]
    pub fn place(&self, x_m: f64, y_m: f64) -> [f64; 2] {
        [(x_m + self.half_m) / self.cell_m, (y_m + self.half_m) / self.cell_m]
    }

    /// Enters the height of a point at a [`Self::place`]; its cell, if it lies on the grid.
    #[inline(always)]
    pub fn enter(&mut self, [col, row]: [f64; 2], height_m: f64) -> Option<u32> {
        let limit = self.side as f64;
        if !(col >= 0.0 && row >= 0.0 && col < limit && row < limit) {
            return None;
        }
        let cell = row as usize * self.width + col as usize;
        let (lowest_m, highest_m) = (&mut self.lowest_m[cell], &mut self.highest_m[cell]);
        *lowest_m = if height_m < *lowest_m { height_m } else { *lowest_m };
        *highest_m = if height_m > *highest_m { height_m } else { *highest_m };
        Some(cell as u32)
    }

    /// Fits the ground to what has been entered.
    pub fn fit(&mut self) {
        widest(Fit(self));
    }

    #[inline(always)]
    fn fit_plainly(&mut self) {
        for (weight, lowest_m) in self.weight.iter_mut().zip(&self.lowest_m) {
            *weight = if lowest_m.is_finite() { 1.0 } else { 0.0 };
        }
        self.fit_nodes();
        for _ in 0..REWEIGHTINGS {
            self.weigh_again();
            self.fit_nodes();
        }
        self.stand();
    }

    /// Weighs cells down that lie off the ground fitted so far.
    #[inline(always)]
    fn weigh_again(&mut self) {
        for row in 0..self.side {
            let cells = row * self.width..(row + 1) * self.width;
            let weights = self.weight[cells.clone()].as_chunks_mut::<NODE_CELLS>().0;
            let lowest_m = self.lowest_m[cells].as_chunks::<NODE_CELLS>().0;
            let ground = Between::new(&self.node_m, self.nodes, row);
            for (k, (weights, lowest_m)) in weights.iter_mut().zip(lowest_m).enumerate().take(self.nodes - 1) {
                let ground_m = ground.cells_m(k);
                for c in 0..NODE_CELLS {
                    let above_m = lowest_m[c] - ground_m[c];
                    let low = if above_m < -LOW_M { LOW_WEIGHT } else { 1.0 };
                    let again = if above_m > HIGH_M { HIGH_WEIGHT } else { low };
                    weights[c] = if weights[c] > 0.0 { again } else { weights[c] };
                }
            }
        }
    }

    /// How far each cell's highest point stands above the ground.
    #[inline(always)]
    fn stand(&mut self) {
        for row in 0..self.side {
            let cells = row * self.width..(row + 1) * self.width;
            let standing_m = self.standing_m[cells.clone()].as_chunks_mut::<NODE_CELLS>().0;
            let highest_m = self.highest_m[cells].as_chunks::<NODE_CELLS>().0;
            let ground = Between::new(&self.node_m, self.nodes, row);
            for (k, (standing_m, highest_m)) in standing_m.iter_mut().zip(highest_m).enumerate().take(self.nodes - 1) {
                let ground_m = ground.cells_m(k);
                for c in 0..NODE_CELLS {
                    let above_m = highest_m[c] - ground_m[c];
                    standing_m[c] = if highest_m[c] == f64::NEG_INFINITY { f64::NAN } else { above_m };
                }
            }
        }
    }

    /// The plane at every node from the weighted cells around it.
    #[inline(always)]
    fn fit_nodes(&mut self) {
        for ((weighted, &weight), &lowest_m) in self.weighted_m.iter_mut().zip(&self.weight).zip(&self.lowest_m) {
            *weighted = if weight > 0.0 { weight * lowest_m } else { 0.0 };
        }
        for node_row in 0..self.nodes {
            self.gather_moments(node_row * NODE_CELLS);
            for first in (0..self.nodes).step_by(LANES) {
                let heights_m = self.planes_m(first);
                let count = LANES.min(self.nodes - first);
                self.node_m[node_row * self.nodes + first..][..count].copy_from_slice(&heights_m[..count]);
            }
        }
    }

    /// Moments along y of every column, about a row of cells.
    #[inline(always)]
    fn gather_moments(&mut self, centre: usize) {
        let reach = self.window.len() / 2;
        let rows = centre.saturating_sub(reach)..(centre + reach + 1).min(self.side);
        for first in (0..self.width).step_by(LANES) {
            let mut sums = [[0.0; LANES]; 5];
            for row in rows.clone() {
                let g = self.window[row + reach - centre];
                let k = row as f64 - centre as f64;
                let (gk, gkk) = (g * k, g * k * k);
                let at = row * self.width + first;
                let (mut weights, mut heights) = ([0.0; LANES], [0.0; LANES]);
                weights.copy_from_slice(&self.weight[at..at + LANES]);
                heights.copy_from_slice(&self.weighted_m[at..at + LANES]);
                for c in 0..LANES {
                    sums[0][c] += g * weights[c];
                    sums[1][c] += gk * weights[c];
                    sums[2][c] += gkk * weights[c];
                    sums[3][c] += g * heights[c];
                    sums[4][c] += gk * heights[c];
                }
            }
            for (phases, sums) in self.moments.by_phase.iter_mut().zip(&sums) {
                for (c, sum) in sums.iter().enumerate() {
                    let column = self.moments.before + first + c;
                    phases[column % NODE_CELLS][column / NODE_CELLS] = *sum;
                }
            }
        }
    }

    /// The heights at nodes, from one on, of the planes fitted around them: columns of the current row of nodes.
    #[inline(always)]
    fn planes_m(&self, first: usize) -> [f64; LANES] {
        let reach = self.window.len() / 2;
        let [w, wy, wyy, z, zy] = &self.moments.by_phase;
        let [mut s, mut sx, mut sy, mut sxx, mut sxy, mut syy] = [[0.0; LANES]; 6];
        let [mut t, mut tx, mut ty] = [[0.0; LANES]; 3];
        for (step, &g) in self.window.iter().enumerate() {
            let k = step as f64 - reach as f64;
            let column = self.moments.before + step - reach;
            let (phase, place) = (column % NODE_CELLS, first + column / NODE_CELLS);
            let read = |of: &[Vec<f64>; NODE_CELLS]| {
                let mut lanes = [0.0; LANES];
                lanes.copy_from_slice(&of[phase][place..place + LANES]);
                lanes
            };
            let (w, wy, wyy, z, zy) = (read(w), read(wy), read(wyy), read(z), read(zy));
            for l in 0..LANES {
                let (gw, gwy, gz) = (g * w[l], g * wy[l], g * z[l]);
                s[l] += gw;
                sx[l] += k * gw;
                sxx[l] += k * k * gw;
                sy[l] += gwy;
                sxy[l] += k * gwy;
                syy[l] += g * wyy[l];
                t[l] += gz;
                tx[l] += k * gz;
                ty[l] += g * zy[l];
            }
        }
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

    /// The ground at a place; NaN where there is none.
    #[inline(always)]
    pub fn ground_m(&self, x_m: f64, y_m: f64) -> f64 {
        // Node k is the centre of cell 4 k.
        let at = |t_m: f64| ((t_m + self.half_m) / self.cell_m - 0.5) / NODE_CELLS as f64;
        let (col, row) = (at(x_m), at(y_m));
        let most = (self.nodes - 2) as f64;
        let (c, r) = (col.floor().clamp(0.0, most), row.floor().clamp(0.0, most));
        let rows = node_rows(&self.node_m, self.nodes, r as usize);
        between(rows, c as usize, col - c, row - r)
    }

    /// How far a cell's highest point stands above the fitted ground; not a number where there is no point or no ground.
    pub fn standing_m(&self, cell: usize) -> f64 {
        self.standing_m[cell]
    }
}

/// A row of cells between two rows of nodes.
struct Between<'a> {
    rows: [&'a [f64]; 2],
    /// From the first row of nodes to the second.
    share: f64,
}

impl<'a> Between<'a> {
    #[inline(always)]
    fn new(node_m: &'a [f64], nodes: usize, row: usize) -> Between<'a> {
        let share = (row % NODE_CELLS) as f64 / NODE_CELLS as f64;
        Between { rows: node_rows(node_m, nodes, row / NODE_CELLS), share }
    }

    /// The ground at the cells from one node of the row to the next.
    #[inline(always)]
    fn cells_m(&self, node: usize) -> [f64; NODE_CELLS] {
        let mut ground_m = [0.0; NODE_CELLS];
        for (c, ground_m) in ground_m.iter_mut().enumerate() {
            *ground_m = between(self.rows, node, c as f64 / NODE_CELLS as f64, self.share);
        }
        ground_m
    }
}

/// A row of nodes and the next.
#[inline(always)]
fn node_rows(node_m: &[f64], nodes: usize, row: usize) -> [&[f64]; 2] {
    [&node_m[row * nodes..(row + 1) * nodes], &node_m[(row + 1) * nodes..(row + 2) * nodes]]
}

/// The ground between the nodes `col` and `col + 1` of two rows.
#[inline(always)]
fn between(rows: [&[f64]; 2], col: usize, u: f64, v: f64) -> f64 {
    let [[a, b], [d, e]] = [[rows[0][col], rows[0][col + 1]], [rows[1][col], rows[1][col + 1]]];
    (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + e * u) * v
}

/// The fit, in the machine's widest form.
struct Fit<'a>(&'a mut GroundGrid);

impl Work for Fit<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.0.fit_plainly();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wide::every_form;

    /// A grid of bumps and rocks with holes in it.
    fn entered(half_m: f64, cell_m: f64) -> GroundGrid {
        let mut grid = GroundGrid::new(half_m, cell_m);
        for k in 0..60_000u32 {
            let along = |step: f64| half_m * (2.0 * (step * f64::from(k)).fract() - 1.0);
            let (x, y) = (along(0.618_033_988), along(0.414_213_562));
            if math::hypot(x - 1.0, y) < 0.6 || y < -0.7 * half_m {
                continue;
            }
            let rock = if math::hypot(x + 1.0, y - 0.5) < 0.3 { 0.4 } else { 0.0 };
            grid.enter(grid.place(x, y), 0.3 * math::sin(x) + 0.1 * math::cos(3.0 * y) + rock);
        }
        grid
    }

    /// The plane at a node, cell by cell: the definition, in the order of the sums that the grid takes.
    fn plane_by_cells_m(grid: &GroundGrid, node_row: usize, node_col: usize) -> f64 {
        let reach = grid.window.len() / 2;
        let near = |node: usize| {
            let centre = node * NODE_CELLS;
            (centre.saturating_sub(reach)..(centre + reach + 1).min(grid.side)).map(move |at| {
                let k = at as f64 - centre as f64;
                (at, k, grid.window[at + reach - centre])
            })
        };
        let mut sums = [0.0; 9];
        for (col, kx, gx) in near(node_col) {
            let mut along_y = [0.0; 5];
            for (row, ky, gy) in near(node_row) {
                let at = row * grid.width + col;
                let (weight, height) = (grid.weight[at], grid.weighted_m[at]);
                let terms = [gy * weight, gy * ky * weight, gy * ky * ky * weight, gy * height, gy * ky * height];
                along_y.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
            let [w, wy, wyy, z, zy] = along_y.map(|sum| gx * sum);
            let terms = [w, kx * w, wy, kx * kx * w, kx * wy, wyy, z, kx * z, zy];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        let [s, sx, sy, sxx, sxy, syy, t, tx, ty] = sums;
        if s < LEAST_WEIGHT {
            return f64::NAN;
        }
        let (mx, my, mz) = (sx / s, sy / s, t / s);
        let (xx, yy) = (sxx / s - mx * mx + LEVEL_SHARE, syy / s - my * my + LEVEL_SHARE);
        let (xy, xz, yz) = (sxy / s - mx * my, tx / s - mx * mz, ty / s - my * mz);
        let determinant = xx * yy - xy * xy;
        mz - (xz * yy - yz * xy) / determinant * mx - (yz * xx - xz * xy) / determinant * my
    }

    struct Whole(GroundGrid);

    impl Work for Whole {
        type Out = GroundGrid;
        #[inline(always)]
        fn run(mut self) -> GroundGrid {
            self.0.fit_plainly();
            self.0
        }
    }

    #[test]
    fn equal_planes_by_lanes_and_cell_by_cell_in_every_form() {
        // Sides of 85, 86, 88, 80 and 7 cells: at and off a whole number of lanes and of nodes.
        for (half_m, cell_m) in [(4.25, 0.1), (4.3, 0.1), (4.4, 0.1), (4.0, 0.1), (1.0, 0.3)] {
            for grid in every_form(|| Whole(entered(half_m, cell_m))) {
                let bits = |x: f64| if x.is_nan() { 0 } else { x.to_bits() };
                for node in 0..grid.nodes * grid.nodes {
                    let plain = plane_by_cells_m(&grid, node / grid.nodes, node % grid.nodes);
                    assert_eq!(bits(grid.node_m[node]), bits(plain), "{half_m} {cell_m}: node {node}");
                }
                for cell in (0..grid.width * grid.side).filter(|cell| cell % grid.width < grid.side) {
                    let centre_m = |k: usize| (k as f64 + 0.5) * grid.cell_m - grid.half_m;
                    let ground_m = grid.ground_m(centre_m(cell % grid.width), centre_m(cell / grid.width));
                    let standing_m = grid.highest_m[cell] - ground_m;
                    let near = (grid.standing_m(cell) - standing_m).abs() < 1e-12;
                    assert!(near || !standing_m.is_finite() && grid.standing_m(cell).is_nan(), "cell {cell}");
                }
            }
        }
    }
}
