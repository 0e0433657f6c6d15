//! This module judges the cells of one sweep, square by square, by the limits of a rover.
//!
//! A rover's [`Limits`], the scene, the [`Placement`] of the map and the cells go in. Each cell's [`Crossing`] and its label come out, and the truth
//! of its poses where they are asked for. Each square is sampled once, and a cell takes the worst that its own nodes demand.

use super::bodies;
use super::gaps::Gaps;
use super::headings::{Axis, Stance, axes, halo, stances};
use super::kernel::{Demands, Run};
use super::lattice::Lattice;
use super::limit::{Crossing, Limit};
use super::params::Limits;
use super::placement::Placement;
use super::pose::{self, PoseAssessor, Square};
use crate::cells::{Cells, Label};
use crate::geometry::{CellIndex, DVec2};
use crate::scene::{Ground, Scene};
use crate::wide::widest;

/// Nodes stand no farther apart than this, and no closer than `FINEST_M` but for the finest cells.
const SPACING_M: f64 = 0.05;
const FINEST_M: f64 = 0.02;
/// Nodes along a square that is judged at once.
const SQUARE_NODES: i64 = 128;

/// Reused memory; has no meaning between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    lattice: Lattice,
    gaps: Gaps,
    demands: Demands,
    poses: pose::Scratch,
    /// Square (row, column) of each cell, and its place among the rows.
    squares: Vec<([i32; 2], u32)>,
    worst: Vec<Worst>,
}

/// The worst that the nodes of a cell demand.
#[derive(Clone, Copy, Debug)]
struct Worst {
    rise_m: f64,
    fall_m: f64,
    touch_m: f64,
    slope_squared: f64,
    side_slope: f64,
    gap_margin_m: f64,
}

/// What judges the cells of one sweep.
pub(super) struct Assessor<'a> {
    scene: &'a Scene,
    placement: Placement,
    limits: Limits,
    pub axes: [Axis; 4],
    pub stances: [Stance; 4],
    /// Nodes along a cell, cells along a square, and nodes around a square.
    nodes_a_cell: i64,
    cells_a_square: i64,
    halo: i64,
    pub spacing_m: f64,
    /// Judges poses too; `None` where the rule does not ask.
    poses: Option<PoseAssessor<'a>>,
}

impl<'a> Assessor<'a> {
    pub(super) fn new(limits: Limits, size_m: f64, scene: &'a Scene, placement: Placement) -> Assessor<'a> {
        let wanted_m = limits.wheel_radius_m.clamp(FINEST_M, SPACING_M);
        // A hair less: a cell of 0.1 m has two nodes of 0.05 m along it, whatever the last bit says.
        let nodes_a_cell = (size_m / wanted_m * (1.0 - 1e-9)).ceil().max(1.0);
        let spacing_m = size_m / nodes_a_cell;
        let (axes, stances) = (axes(&limits, spacing_m), stances(&limits, spacing_m));
        // Lips of gaps that the wheels stand on or reach.
        let lips = (limits.length_m / spacing_m).ceil() as usize + 2;
        let has_gaps = matches!(scene.ground, Ground::Raster(_));
        let halo = (halo(&axes, &stances) + if has_gaps { lips } else { 0 }) as i64;
        let nodes_a_cell = nodes_a_cell as i64;
        let cells_a_square = (SQUARE_NODES.max(2 * halo) / nodes_a_cell).max(1);
        let poses = None;
        Assessor { scene, placement, limits, axes, stances, nodes_a_cell, cells_a_square, halo, spacing_m, poses }
    }

    /// The same, poses too: squares reach as far as a rover does.
    pub(super) fn with_poses(mut self, poses: Option<PoseAssessor<'a>>) -> Assessor<'a> {
        if let Some(poses) = &poses {
            let cell_m = self.nodes_a_cell as f64 * self.spacing_m;
            self.halo =
                self.halo.max((poses.reach_m(cell_m) / self.spacing_m).ceil() as i64 + self.axes[0].reach as i64 + 2);
            self.cells_a_square = (SQUARE_NODES.max(2 * self.halo) / self.nodes_a_cell).max(1);
        }
        Assessor { poses, ..self }
    }

    pub(super) fn assess(&self, cells: &mut Cells, scratch: &mut Scratch) {
        let mut squares = std::mem::take(&mut scratch.squares);
        squares.clear();
        let square_of = |along: i32| i64::from(along).div_euclid(self.cells_a_square) as i32;
        let rows = (0..).zip(&cells.rows);
        squares.extend(rows.map(|(k, row)| ([square_of(row.index.row), square_of(row.index.col)], k)));
        squares.sort_unstable();
        for square in squares.chunk_by(|a, b| a.0 == b.0) {
            self.assess_square(square, cells, scratch);
        }
        scratch.squares = squares;
    }

    /// Judges the cells of one square.
    fn assess_square(&self, square: &[([i32; 2], u32)], cells: &mut Cells, scratch: &mut Scratch) {
        let Scratch { lattice, gaps, demands, poses: pose_scratch, worst, .. } = scratch;
        let [row, col] = square[0].0.map(|along| i64::from(along) * self.cells_a_square);
        let first = [col, row].map(|cell| cell * self.nodes_a_cell - self.halo);
        let side = (self.cells_a_square * self.nodes_a_cell + 2 * self.halo) as usize;
        lattice.sample(self.scene, &self.placement, self.spacing_m, first, side);
        gaps.find(self.scene, &self.placement, &self.limits, &self.axes, lattice);
        let (low_m, high_m) = (lattice.node_m(0, 0), lattice.node_m(side - 1, side - 1));
        // Beyond a wheel's reach of the square's cells no body counts.
        let unread = if self.poses.is_some() { 0 } else { self.halo - self.axes[0].reach as i64 - 1 };
        let unread_m = unread as f64 * self.spacing_m;
        let unread_m = DVec2::splat(unread_m);
        bodies::raise(self.scene, &self.placement, low_m + unread_m, high_m - unread_m, lattice);
        if self.poses.is_some() {
            lattice.spread(self.scene, &self.placement);
        }
        worst.clear();
        worst.resize(square.len(), Worst::NONE);
        let index_of = |&(_, k): &([i32; 2], u32)| cells.rows[k as usize].index;
        let mut begun = 0;
        for on_row in square.chunk_by(|a, b| index_of(a).row == index_of(b).row) {
            let worst = &mut worst[begun..begun + on_row.len()];
            begun += on_row.len();
            let columns = [index_of(&on_row[0]), index_of(&on_row[on_row.len() - 1])]
                .map(|index| self.inside(index, row, col)[1]);
            let span = columns[0]..columns[1] + self.nodes_a_cell as usize;
            let first_row = self.inside(index_of(&on_row[0]), row, col)[0];
            for node_row in first_row..first_row + self.nodes_a_cell as usize {
                widest(Run {
                    lattice,
                    axes: &self.axes,
                    stances: &self.stances,
                    tilt: self.limits.tilt,
                    step_m: self.limits.step_m,
                    row: node_row,
                    col: span.start,
                    count: span.len(),
                    out: demands,
                });
                for (cell, worst) in on_row.iter().zip(&mut *worst) {
                    let from = self.inside(index_of(cell), row, col)[1] - span.start;
                    for node in from..from + self.nodes_a_cell as usize {
                        let at = node_row * side + span.start + node;
                        let width_m = gaps.width_m.get(at).copied().unwrap_or(f64::INFINITY);
                        worst.take(demands, node, self.limits.gap_m - width_m);
                    }
                }
            }
        }
        for (&(_, k), worst) in square.iter().zip(&*worst) {
            let row = &mut cells.rows[k as usize];
            row.truth.crossing = Some(worst.crossing(&self.limits));
            row.truth.pose = self.poses.as_ref().map(|poses| {
                let Assessor { axes, placement, .. } = self;
                let cell_m = self.nodes_a_cell as f64 * self.spacing_m;
                let middle_m = (DVec2::new(f64::from(row.index.col), f64::from(row.index.row)) + 0.5) * cell_m;
                poses.assess(&Square { lattice, gaps, axes, placement, cell_m }, middle_m, pose_scratch)
            });
            row.label = Some(Label::untraversable_if(row.truth.bars_rover()));
        }
    }

    /// Row and column of a cell's first node in the lattice of a square that begins at these cells.
    fn inside(&self, index: CellIndex, row: i64, col: i64) -> [usize; 2] {
        [i64::from(index.row) - row, i64::from(index.col) - col]
            .map(|cells| (cells * self.nodes_a_cell + self.halo) as usize)
    }
}

impl Worst {
    /// Of no node.
    const NONE: Worst = Worst {
        rise_m: 0.0,
        fall_m: 0.0,
        touch_m: f64::NEG_INFINITY,
        slope_squared: 0.0,
        side_slope: 0.0,
        gap_margin_m: f64::INFINITY,
    };

    fn take(&mut self, demands: &Demands, node: usize, gap_margin_m: f64) {
        self.rise_m = self.rise_m.max(demands.rise_m[node]);
        self.fall_m = self.fall_m.max(demands.fall_m[node]);
        self.touch_m = self.touch_m.max(demands.touch_m[node]);
        self.slope_squared = self.slope_squared.max(demands.slope_squared[node]);
        self.side_slope = self.side_slope.max(demands.side_slope[node]);
        // A node within no gap has an infinite width, which is no width at all.
        if gap_margin_m.is_finite() {
            self.gap_margin_m = self.gap_margin_m.min(gap_margin_m);
        }
    }

    fn crossing(&self, limits: &Limits) -> Crossing {
        let margins_m = [
            limits.step_m - self.rise_m,
            limits.step_m - self.fall_m,
            self.gap_margin_m,
            limits.belly_m - self.touch_m,
            (limits.tilt - self.slope_squared.sqrt()) * limits.wheelbase_m,
            (limits.side_slip - self.side_slope) * limits.track_m,
        ];
        // Of equals the first.
        let nearest =
            margins_m.iter().zip(Limit::ALL).fold((f64::INFINITY, Limit::Climb), |nearest, (&margin_m, limit)| {
                if margin_m < nearest.0 { (margin_m, limit) } else { nearest }
            });
        Crossing { margin_m: nearest.0 as f32, limit: nearest.1 }
    }
}
