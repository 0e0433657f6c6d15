//! Levelled points -> a smooth ground under them.
//!
//! In: points, sensor at the origin, x and y level. Out: the ground's height anywhere on the grid, metres above the sensor (so usually negative);
//! and, where asked for, the mean of each cell of ground. Planes fitted to the cells' lowest points (see [`Planes`]), with outliers (rocks above,
//! noise below) weighed down up to four times over, until no weight changes. The planes stand at nodes four cells apart, and the ground is bilinear
//! between: over 0.4 m its bend is millimetres.

mod means;
mod planes;

use std::ops::Range;

use crate::wide::{LANES, Work, widest};
use planes::Planes;

/// Cells from one node to the next.
pub(super) const CELLS_A_NODE: usize = 4;
const REWEIGHTINGS: usize = 4;
/// Cells more than this above the fitted ground hold a rock; more than that below, noise.
const HIGH_M: f64 = 0.03;
const LOW_M: f64 = 0.06;
const HIGH_WEIGHT: f64 = 0.02;
const LOW_WEIGHT: f64 = 0.5;

/// Lowest and highest point of each cell, and the ground under them.
#[derive(Clone, Debug)]
pub(super) struct GroundGrid {
    half_m: f64,
    cell_m: f64,
    side: usize,
    /// Highest point of each cell; the last entry, here as in `cells.lowest_m`, is no cell.
    highest_m: Vec<f64>,
    /// How far each cell's highest point stands above the ground; not a number where there is no point or no ground.
    standing_m: Vec<f64>,
    cells: Cells,
    /// Count, x, y and z of each cell's points, summed; empty where nobody asks for means.
    sums: Vec<[f64; 4]>,
    /// Per block of `LANES` columns: rows outside which no cell holds a point, or has another weight than at the last fit.
    held: Vec<Range<usize>>,
    changed: Vec<Range<usize>>,
    nodes: usize,
    /// Ground height at the nodes; NaN where there is none.
    node_m: Vec<f64>,
    planes: Planes,
}

/// What the ground is fitted to.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// From row to row: whole blocks of lanes; the last cells of a row may be off the grid, and stay empty.
    pub width: usize,
    pub lowest_m: Vec<f64>,
    /// Weight in the fit, and weight times lowest point; 0 where empty.
    pub weight: Vec<f64>,
    pub weighted_m: Vec<f64>,
}

impl GroundGrid {
    /// A square grid of `2 half_m` a side around the sensor.
    pub(super) fn new(half_m: f64, cell_m: f64) -> GroundGrid {
        let side = (2.0 * half_m / cell_m).ceil() as usize;
        let width = side.next_multiple_of(LANES);
        let count = width * side;
        let nodes = side / CELLS_A_NODE + 2;
        let none = || vec![0..0; width / LANES];
        GroundGrid {
            half_m: 0.5 * side as f64 * cell_m,
            cell_m,
            side,
            highest_m: vec![f64::NEG_INFINITY; count + 1],
            standing_m: vec![f64::NAN; count],
            cells: Cells {
                width,
                lowest_m: vec![f64::INFINITY; count + 1],
                weight: vec![0.0; count],
                weighted_m: vec![0.0; count],
            },
            sums: Vec::new(),
            held: none(),
            changed: none(),
            nodes,
            node_m: vec![f64::NAN; nodes * nodes],
            planes: Planes::new(side, cell_m, nodes),
        }
    }

    /// Rows, and cells from one row to the next.
    pub(super) fn rows_and_width(&self) -> (usize, usize) {
        (self.side, self.cells.width)
    }

    /// Stands for the cell of a point that has none; may be entered.
    #[inline(always)]
    pub(super) fn nowhere(&self) -> u32 {
        (self.side * self.cells.width) as u32
    }

    pub(super) fn clear(&mut self) {
        self.cells.lowest_m.fill(f64::INFINITY);
        self.highest_m.fill(f64::NEG_INFINITY);
        self.sums.fill([0.0; 4]);
    }

    /// Finds the cells of points that are `taken`; leaves those of others, and of points that are not on the grid.
    #[inline(always)]
    pub(super) fn place<const N: usize>(
        &self,
        x_m: &[f64; N],
        y_m: &[f64; N],
        taken: &[bool; N],
        cells: &mut [u32; N],
    ) {
        let (half_m, cell_m, limit, width) = (self.half_m, self.cell_m, self.side as f64, self.cells.width as f64);
        for l in 0..N {
            let (col, row) = ((x_m[l] + half_m) / cell_m, (y_m[l] + half_m) / cell_m);
            let inside = taken[l] & (col >= 0.0) & (row >= 0.0) & (col < limit) & (row < limit);
            let cell = lowest_bits(whole(row) * width + whole(col));
            cells[l] = if inside { cell } else { cells[l] };
        }
    }

    /// Enters the height of a point in a cell.
    #[inline(always)]
    pub(super) fn enter(&mut self, cell: u32, height_m: f64) {
        let (lowest_m, highest_m) = (&mut self.cells.lowest_m[cell as usize], &mut self.highest_m[cell as usize]);
        *lowest_m = if height_m < *lowest_m { height_m } else { *lowest_m };
        *highest_m = if height_m > *highest_m { height_m } else { *highest_m };
    }

    /// Fits the ground to what has been entered.
    pub(super) fn fit(&mut self) {
        widest(PlaneFit(self));
    }

    #[inline(always)]
    fn fit_plainly(&mut self) {
        self.begin();
        self.planes.fit(&self.cells, &self.held, &self.changed, &mut self.node_m);
        for _ in 0..REWEIGHTINGS {
            if !self.weigh_again() {
                break;
            }
            self.planes.fit(&self.cells, &self.held, &self.changed, &mut self.node_m);
        }
        self.stand();
    }

    /// Full weight to every cell that holds a point.
    #[inline(always)]
    fn begin(&mut self) {
        let Cells { width, lowest_m, weight, weighted_m } = &mut self.cells;
        self.held.fill(0..0);
        for row in 0..self.side {
            for (block, held) in self.held.iter_mut().enumerate() {
                let at = row * *width + block * LANES;
                let cells = at..at + LANES;
                let (lowest_m, weight) = (&lowest_m[cells.clone()], &mut weight[cells.clone()]);
                let weighted_m = &mut weighted_m[cells];
                let mut any = false;
                for c in 0..LANES {
                    let full = lowest_m[c].is_finite();
                    any |= full;
                    weight[c] = if full { 1.0 } else { 0.0 };
                    weighted_m[c] = if full { lowest_m[c] } else { 0.0 };
                }
                if any {
                    widen(held, row);
                }
            }
        }
        self.changed.fill(0..self.side);
    }

    /// Weighs cells down that lie off the ground fitted so far; whether a weight has changed.
    #[inline(always)]
    fn weigh_again(&mut self) -> bool {
        let Cells { width, lowest_m, weight, weighted_m } = &mut self.cells;
        let mut any = false;
        for ((block, held), changed) in self.held.iter().enumerate().zip(&mut self.changed) {
            *changed = 0..0;
            for row in held.clone() {
                let at = row * *width + block * LANES;
                let cells = at..at + LANES;
                let (lowest_m, weight) = (&lowest_m[cells.clone()], &mut weight[cells.clone()]);
                let weighted_m = &mut weighted_m[cells];
                let ground_m = Bilinear::new(&self.node_m, self.nodes, row).block_m(block);
                let mut other = false;
                for c in 0..LANES {
                    let above_m = lowest_m[c] - ground_m[c];
                    let low = if above_m < -LOW_M { LOW_WEIGHT } else { 1.0 };
                    let again = if above_m > HIGH_M { HIGH_WEIGHT } else { low };
                    let again = if weight[c] > 0.0 { again } else { 0.0 };
                    other |= again != weight[c];
                    weight[c] = again;
                    weighted_m[c] = if again > 0.0 { again * lowest_m[c] } else { 0.0 };
                }
                if other {
                    widen(changed, row);
                    any = true;
                }
            }
        }
        any
    }

    /// How far each cell's highest point stands above the ground.
    #[inline(always)]
    fn stand(&mut self) {
        self.standing_m.fill(f64::NAN);
        for (block, held) in self.held.iter().enumerate() {
            for row in held.clone() {
                let at = row * self.cells.width + block * LANES;
                let highest_m = &self.highest_m[at..at + LANES];
                let standing_m = &mut self.standing_m[at..at + LANES];
                let ground_m = Bilinear::new(&self.node_m, self.nodes, row).block_m(block);
                for c in 0..LANES {
                    let above_m = highest_m[c] - ground_m[c];
                    standing_m[c] = if highest_m[c] == f64::NEG_INFINITY { f64::NAN } else { above_m };
                }
            }
        }
    }

    /// The ground at a place; NaN where there is none.
    #[inline(always)]
    pub(super) fn ground_m(&self, x_m: f64, y_m: f64) -> f64 {
        // Node k is the centre of cell 4 k.
        let at = |t_m: f64| ((t_m + self.half_m) / self.cell_m - 0.5) / CELLS_A_NODE as f64;
        let (col, row) = (at(x_m), at(y_m));
        // A cast takes what is below 0, and what is no number, to 0.
        let node = |at: f64| (at as usize).min(self.nodes - 2);
        let (c, r) = (node(col), node(row));
        between(node_rows(&self.node_m, self.nodes, r), c, col - c as f64, row - r as f64)
    }

    /// How far a cell's highest point stands above the fitted ground; not a number where there is no point or no ground.
    pub(super) fn standing_m(&self, cell: usize) -> f64 {
        self.standing_m[cell]
    }
}

/// Added to a smaller number that is not negative, it leaves no digits behind the point: 2^52.
const WHOLE: f64 = 4_503_599_627_370_496.0;

/// The number without its digits behind the point, for numbers in 0..2^51: a cast would see to all others as well, lane by lane.
#[inline(always)]
fn whole(number: f64) -> f64 {
    let nearest = (number + WHOLE) - WHOLE;
    if nearest > number { nearest - 1.0 } else { nearest }
}

/// A whole number of 0..2^32 as an integer; nonsense for others.
#[inline(always)]
fn lowest_bits(whole: f64) -> u32 {
    (whole + WHOLE).to_bits() as u32
}

/// Takes a row into a range of rows; rows come in order.
#[inline(always)]
fn widen(rows: &mut Range<usize>, row: usize) {
    *rows = if Range::is_empty(rows) { row..row + 1 } else { rows.start..row + 1 };
}

/// A row of cells between two rows of nodes.
struct Bilinear<'a> {
    rows: [&'a [f64]; 2],
    /// From the first row of nodes to the second.
    share: f64,
}

impl<'a> Bilinear<'a> {
    #[inline(always)]
    fn new(node_m: &'a [f64], nodes: usize, row: usize) -> Bilinear<'a> {
        let share = (row % CELLS_A_NODE) as f64 / CELLS_A_NODE as f64;
        Bilinear { rows: node_rows(node_m, nodes, row / CELLS_A_NODE), share }
    }

    /// The ground at the cells of a block; nonsense beyond the last node.
    #[inline(always)]
    fn block_m(&self, block: usize) -> [f64; LANES] {
        const NODES: usize = LANES / CELLS_A_NODE;
        let last = self.rows[0].len() - 2;
        let mut ground_m = [0.0; LANES];
        for (k, ground_m) in ground_m.as_chunks_mut::<CELLS_A_NODE>().0.iter_mut().enumerate() {
            let node = (block * NODES + k).min(last);
            for (c, ground_m) in ground_m.iter_mut().enumerate() {
                *ground_m = between(self.rows, node, c as f64 / CELLS_A_NODE as f64, self.share);
            }
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
struct PlaneFit<'a>(&'a mut GroundGrid);

impl Work for PlaneFit<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.0.fit_plainly();
    }
}
