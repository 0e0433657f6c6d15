//! The true yard and a rover's limits -> can the rover cross this cell, and by how much: the labels of `cells.labels.rover`.
//!
//! In: the cells of a kept sweep, the scene, where the sensor was and was believed to be, a rover and its limits. Out: per cell a
//! [`Crossing`] (signed distance to the nearest limit, and which one), and the label: untraversable where the distance is negative, or
//! where what the cell names is a plant that is marked untraversable. Source: the clearance of the real rover as the label, ACE
//! of JPL's MLNav (Otsu et al. 2020; arXiv 2203.04563), of the cell and not of the pose: what a costmap wants that grows
//! obstacles by the rover's outline itself.
//!
//! Squares of cells are judged one after another on a lattice (`lattice`, `bodies`), whose gaps are found and bridged first (`gaps`); then
//! each row of nodes is asked what it demands of the rover along eight headings (`headings`, `kernel`), and each cell takes the worst of its
//! nodes. Frames: cells in `map`, ground in `world` (`placement`). Deviations and what is not modelled: whether the cell can be reached
//! (the floor of a hole wider than the rover is long is passable inside its ring); the wheel's width; what ground does under weight; places
//! outside the yard, where the edge's height holds. Wheels of a rover astride a cell stand on the ground, so that the belly bars all of a body
//! that stands higher than its clearance, be it broad enough to drive on.

mod bodies;
mod bounds;
#[cfg(test)]
mod brute;
#[cfg(test)]
mod drive_tests;
#[cfg(test)]
mod figure;
mod gaps;
mod headings;
mod kernel;
mod lattice;
mod outlines;
pub(super) mod params;
mod patch;
mod placement;
mod pose;
#[cfg(test)]
mod pose_brute;
#[cfg(test)]
mod pose_tests;
#[cfg(test)]
mod tests;
mod tracks;
mod way;

use super::{CellRow, CellTruth, Cells, Label};
use crate::drive::Rover;
use crate::geometry::{CellIndex, DVec2, DVec3, GridSpec, Transform};
use crate::scene::{Ground, Scene};
use crate::wide::widest;
use gaps::Gaps;
use headings::{Axis, Stance, axes, halo, stances};
use kernel::{Demands, Run};
use lattice::Lattice;
use params::{Limits, RoverRule};
use placement::Placement;
use pose::{PoseAssessor, Square};
pub use pose::{PoseTruth, PoseWorst};

/// Nodes stand no farther apart than this, and no closer than `FINEST_M` but for the finest cells.
const SPACING_M: f64 = 0.05;
const FINEST_M: f64 = 0.02;
/// Nodes along a square that is judged at once.
const SQUARE_NODES: i64 = 128;

/// How a rover gets over a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Distance to the nearest limit; negative beyond it.
    pub margin_m: f32,
    pub limit: Limit,
}

/// What bounds a rover; its number is the value of `cells.truth_limit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i8)]
pub enum Limit {
    /// A wheel climbs a step.
    Climb = 0,
    /// A wheel drops down a step.
    Drop = 1,
    /// A wheel bridges a gap.
    Gap = 2,
    /// The belly touches.
    Belly = 3,
    /// The slope under the rover.
    Tilt = 4,
    /// The slope across its heading.
    SideSlip = 5,
}

impl Limit {
    /// By number.
    pub const ALL: [Limit; 6] = [Limit::Climb, Limit::Drop, Limit::Gap, Limit::Belly, Limit::Tilt, Limit::SideSlip];

    pub fn number(self) -> i8 {
        self as i8
    }

    /// The limit with this number; `None` where no limit has it.
    pub fn of_number(number: i8) -> Option<Limit> {
        usize::try_from(number).ok().and_then(|number| Limit::ALL.get(number).copied())
    }

    pub fn name(self) -> &'static str {
        match self {
            Limit::Climb => "climb",
            Limit::Drop => "drop",
            Limit::Gap => "gap",
            Limit::Belly => "belly",
            Limit::Tilt => "tilt",
            Limit::SideSlip => "side slip",
        }
    }
}

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
struct Assessor<'a> {
    scene: &'a Scene,
    placement: Placement,
    limits: Limits,
    axes: [Axis; 4],
    stances: [Stance; 4],
    /// Nodes along a cell, cells along a square, and nodes around a square.
    nodes_a_cell: i64,
    cells_a_square: i64,
    halo: i64,
    spacing_m: f64,
    /// Judges poses too; `None` where the rule does not ask.
    poses: Option<PoseAssessor<'a>>,
}

/// A rover's rule, and the sweep whose cells it is asked about.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub rule: &'a RoverRule,
    pub rover: &'a Rover,
    /// A cell's side.
    pub size_m: f64,
    pub scene: &'a Scene,
    pub world_from_sensor: &'a Transform,
    pub map_from_sensor: &'a Transform,
}

/// Judges each cell by the rover, and labels it.
///
/// # Panics
/// Where a limit is neither in the rule nor in the rover's file: `config` refuses that.
pub(crate) fn judge(asked: &Asked, cells: &mut Cells, scratch: &mut Scratch) {
    let Asked { rule, rover, size_m, scene, world_from_sensor, map_from_sensor } = *asked;
    let limits = rule.limits(rover).expect("config refuses a rover's rule with a limit that nobody gives");
    let assessor = Assessor::new(limits, size_m, scene, Placement::of(world_from_sensor, map_from_sensor));
    let poses = rule.pose.then(|| PoseAssessor::new(rover, limits, scene));
    assessor.with_poses(poses).assess(cells, scratch);
}

/// The same for cells of a map that a fitted plane levels (`cells.frame`), which is tilted by as much as the ground: each cell is judged
/// where it truly lies, as the cell of the world's level grid around its centre at its mean height, at most half a cell away.
pub(crate) fn judge_of_plane(asked: &Asked, cells: &mut Cells, scratch: &mut Scratch) {
    let Asked { size_m, world_from_sensor, map_from_sensor, .. } = *asked;
    let world_from_map = *world_from_sensor * map_from_sensor.inverse();
    let (grid, width) = (GridSpec { size_m }, cells.features.len().checked_div(cells.rows.len()).unwrap_or(0));
    let place = |(row, features): (&CellRow, &[f32])| {
        let (x_m, y_m) = grid.centre_m(row.index);
        // The mean height is the first feature; the rover stands at the map's origin.
        let place_m = world_from_map.point(DVec3::new(x_m, y_m, f64::from(features[0])));
        grid.cell(place_m.x, place_m.y)
    };
    let places: Vec<Option<CellIndex>> =
        cells.rows.iter().zip(cells.features.chunks_exact(width.max(1))).map(place).collect();
    let mut indices: Vec<CellIndex> = places.iter().copied().flatten().collect();
    indices.sort_unstable();
    indices.dedup();
    let level =
        |index| CellRow { index, label: None, points: 0, range_m: 0.0, neighbour_mask: 0, truth: CellTruth::default() };
    let mut level = Cells { rows: indices.into_iter().map(level).collect(), ..Cells::default() };
    let level_asked =
        Asked { world_from_sensor: &Transform::IDENTITY, map_from_sensor: &Transform::IDENTITY, ..*asked };
    judge(&level_asked, &mut level, scratch);
    for (row, place) in cells.rows.iter_mut().zip(places) {
        let at = place.and_then(|index| level.rows.binary_search_by_key(&index, |there| there.index).ok());
        row.truth.crossing = at.and_then(|at| level.rows[at].truth.crossing);
        row.label = row.truth.crossing.map(|_| Label::untraversable_if(row.truth.bars_rover()));
    }
}

impl<'a> Assessor<'a> {
    fn new(limits: Limits, size_m: f64, scene: &'a Scene, placement: Placement) -> Assessor<'a> {
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
    fn with_poses(mut self, poses: Option<PoseAssessor<'a>>) -> Assessor<'a> {
        if let Some(poses) = &poses {
            let cell_m = self.nodes_a_cell as f64 * self.spacing_m;
            self.halo =
                self.halo.max((poses.reach_m(cell_m) / self.spacing_m).ceil() as i64 + self.axes[0].reach as i64 + 2);
            self.cells_a_square = (SQUARE_NODES.max(2 * self.halo) / self.nodes_a_cell).max(1);
        }
        Assessor { poses, ..self }
    }

    fn assess(&self, cells: &mut Cells, scratch: &mut Scratch) {
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
