//! Levelled points -> a smooth ground under them.
//!
//! In: points, sensor at the origin, x and y level. Out: the ground's height anywhere on the grid, metres above the sensor
//! (so usually negative). A plane fitted to the cells' lowest points under a Gaussian window, with outliers (rocks above,
//! noise below) weighed down four times over. The window is separable, so that its moments are two passes of short sums; they
//! are taken at nodes four cells apart, and the ground is bilinear between: over 0.4 m its bend is millimetres.

use crate::geometry::DVec3;
use crate::math;

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
    lowest_m: Vec<f64>,
    highest_m: Vec<f64>,
    /// Per cell: weight in the fit, and weight times lowest point; 0 where empty.
    weight: Vec<f64>,
    weighted_m: Vec<f64>,
    nodes: usize,
    /// Ground height at the nodes; NaN where there is none.
    node_m: Vec<f64>,
    /// Moments along y at one row of nodes: five for each column of cells.
    moments: [Vec<f64>; 5],
    window: Vec<f64>,
}

impl GroundGrid {
    /// A square grid of `2 half_m` a side around the sensor.
    pub fn new(half_m: f64, cell_m: f64) -> GroundGrid {
        let side = (2.0 * half_m / cell_m).ceil() as usize;
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
            lowest_m: vec![f64::INFINITY; side * side],
            highest_m: vec![f64::NEG_INFINITY; side * side],
            weight: vec![0.0; side * side],
            weighted_m: vec![0.0; side * side],
            nodes,
            node_m: vec![f64::NAN; nodes * nodes],
            moments: std::array::from_fn(|_| vec![0.0; side]),
            window: window.collect(),
        }
    }

    pub fn side(&self) -> usize {
        self.side
    }

    pub fn clear(&mut self) {
        self.lowest_m.fill(f64::INFINITY);
        self.highest_m.fill(f64::NEG_INFINITY);
    }

    /// Enters a point; its cell, if it lies on the grid.
    #[inline]
    pub fn enter(&mut self, point_m: DVec3) -> Option<u32> {
        let col = (point_m.x + self.half_m) / self.cell_m;
        let row = (point_m.y + self.half_m) / self.cell_m;
        let limit = self.side as f64;
        if !(col >= 0.0 && row >= 0.0 && col < limit && row < limit) {
            return None;
        }
        let cell = row as usize * self.side + col as usize;
        self.lowest_m[cell] = self.lowest_m[cell].min(point_m.z);
        self.highest_m[cell] = self.highest_m[cell].max(point_m.z);
        Some(cell as u32)
    }

    /// Fits the ground to what has been entered.
    pub fn fit(&mut self) {
        for (weight, lowest_m) in self.weight.iter_mut().zip(&self.lowest_m) {
            *weight = f64::from(lowest_m.is_finite());
        }
        self.fit_nodes();
        for _ in 0..REWEIGHTINGS {
            for cell in 0..self.weight.len() {
                if self.weight[cell] > 0.0 {
                    let above_m = self.lowest_m[cell] - self.cell_ground_m(cell);
                    self.weight[cell] = match above_m {
                        a if a > HIGH_M => HIGH_WEIGHT,
                        a if a < -LOW_M => LOW_WEIGHT,
                        _ => 1.0,
                    };
                }
            }
            self.fit_nodes();
        }
    }

    /// The plane at every node from the weighted cells around it.
    fn fit_nodes(&mut self) {
        for ((weighted, &weight), &lowest_m) in self.weighted_m.iter_mut().zip(&self.weight).zip(&self.lowest_m) {
            *weighted = if weight > 0.0 { weight * lowest_m } else { 0.0 };
        }
        let reach = self.window.len() / 2;
        for node_row in 0..self.nodes {
            let centre = node_row * NODE_CELLS;
            let rows = centre.saturating_sub(reach)..(centre + reach + 1).min(self.side);
            self.moments.iter_mut().for_each(|m| m.fill(0.0));
            let [w, wy, wyy, z, zy] = &mut self.moments;
            for row in rows {
                let g = self.window[row + reach - centre];
                let k = row as f64 - centre as f64;
                let (gk, gkk) = (g * k, g * k * k);
                let cells = row * self.side..(row + 1) * self.side;
                let (weights, heights) = (&self.weight[cells.clone()], &self.weighted_m[cells]);
                for c in 0..self.side {
                    w[c] += g * weights[c];
                    wy[c] += gk * weights[c];
                    wyy[c] += gkk * weights[c];
                    z[c] += g * heights[c];
                    zy[c] += gk * heights[c];
                }
            }
            for node_col in 0..self.nodes {
                self.node_m[node_row * self.nodes + node_col] = self.plane_m(node_col * NODE_CELLS);
            }
        }
    }

    /// The height at a node of the plane fitted around it: columns of the current row of nodes, centred on one of them.
    fn plane_m(&self, centre: usize) -> f64 {
        let reach = self.window.len() / 2;
        let [w, wy, wyy, z, zy] = &self.moments;
        let (mut s, mut sx, mut sy, mut sxx, mut sxy, mut syy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut t, mut tx, mut ty) = (0.0, 0.0, 0.0);
        for col in centre.saturating_sub(reach)..(centre + reach + 1).min(self.side) {
            let g = self.window[col + reach - centre];
            let k = col as f64 - centre as f64;
            let (gw, gwy, gz) = (g * w[col], g * wy[col], g * z[col]);
            s += gw;
            sx += k * gw;
            sxx += k * k * gw;
            sy += gwy;
            sxy += k * gwy;
            syy += g * wyy[col];
            t += gz;
            tx += k * gz;
            ty += g * zy[col];
        }
        if s < LEAST_WEIGHT {
            return f64::NAN;
        }
        // About the weighted mean the plane's height and its two slopes part.
        let (mx, my, mz) = (sx / s, sy / s, t / s);
        let xx = sxx / s - mx * mx + LEVEL_SHARE;
        let yy = syy / s - my * my + LEVEL_SHARE;
        let xy = sxy / s - mx * my;
        let (xz, yz) = (tx / s - mx * mz, ty / s - my * mz);
        let determinant = xx * yy - xy * xy;
        let slope_x = (xz * yy - yz * xy) / determinant;
        let slope_y = (yz * xx - xz * xy) / determinant;
        mz - slope_x * mx - slope_y * my
    }

    /// The ground at a place; NaN where there is none.
    pub fn ground_m(&self, x_m: f64, y_m: f64) -> f64 {
        // Node k is the centre of cell 4 k.
        let at = |t_m: f64| ((t_m + self.half_m) / self.cell_m - 0.5) / NODE_CELLS as f64;
        self.between(at(x_m), at(y_m))
    }

    fn cell_ground_m(&self, cell: usize) -> f64 {
        let at = |k: usize| k as f64 / NODE_CELLS as f64;
        self.between(at(cell % self.side), at(cell / self.side))
    }

    fn between(&self, col: f64, row: f64) -> f64 {
        let most = (self.nodes - 2) as f64;
        let (c, r) = (col.floor().clamp(0.0, most), row.floor().clamp(0.0, most));
        let (u, v) = (col - c, row - r);
        let node = r as usize * self.nodes + c as usize;
        let [a, b] = [self.node_m[node], self.node_m[node + 1]];
        let [d, e] = [self.node_m[node + self.nodes], self.node_m[node + self.nodes + 1]];
        (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + e * u) * v
    }

    /// How far a cell's highest point stands above the ground; not a number where there is no point or no ground.
    pub fn standing_m(&self, cell: usize) -> f64 {
        if self.highest_m[cell] == f64::NEG_INFINITY {
            return f64::NAN;
        }
        self.highest_m[cell] - self.cell_ground_m(cell)
    }
}
