//! First hits on a raster ground: bilinear cells under a pyramid of planes.
//!
//! In: a [`Raster`] over the yard [0, extent]^2, rays in the world frame, f64. Out: the range of the first crossing of the
//! bilinear surface, exact: along a ray the surface of one cell is a quadratic. Above the cells stand blocks of 2 x 2, 4 x 4, ...
//! cells; each knows a plane and how far its nodes lie below and above it (a bilinear surface minus a plane is extreme at
//! nodes, so the bounds are exact). Blocks are visited front to back; a ray is clipped to where it can meet the block at all.
//! A plane follows the slope of the ground, so that grazing rays are clipped well where a pyramid of greatest heights
//! would have to be descended. Blocks split a ray at shared times, so that none slips between two cells.

use std::borrow::Cow;

use super::cell::{Axis, CellRay};
use super::newton::larger;
use super::pyramid::{Block, Level, levels};
use crate::geometry::DVec3;
use crate::scene::Raster;

/// A raster ground, ready to be cast at.
pub(super) struct RasterCaster<'a> {
    raster: Cow<'a, Raster>,
    /// What of the grid lies in the yard, in cells from node (0, 0): least and greatest x, then y.
    yard: [[f64; 2]; 2],
    /// Blocks of 2 x 2 cells first; each further level halves both sides, up to one block.
    levels: Vec<Level>,
}

/// A sensor over the grid: what all its rays share.
#[derive(Clone, Copy)]
pub(super) struct RasterView {
    /// Its place in cells, its height in metres.
    pub x: f64,
    pub y: f64,
    pub z: f64,
    /// Cells in a metre.
    pub per_m: f64,
    /// See [`RasterCaster::yard`].
    pub yard: [[f64; 2]; 2],
}

impl RasterView {
    /// A ray of the sensor, up to `to` metres, as one that comes from above.
    #[inline(always)]
    pub(super) fn ray(&self, dir: DVec3, to: f64) -> CellRay {
        let (x, y) = (Axis::new(self.x, dir.x * self.per_m), Axis::new(self.y, dir.y * self.per_m));
        let (from, to) = x.clip(self.yard[0], 0.0, to);
        let (from, to) = y.clip(self.yard[1], from, to);
        CellRay { x, y, z: self.z, dz: dir.z, from, to, side: 1.0 }
    }
}

/// A block (level 0: a cell) and the part of the ray over it.
#[derive(Clone, Copy)]
struct Visit {
    level: u32,
    row: u32,
    col: u32,
    from: f64,
    to: f64,
}

/// Blocks that wait for their visit, nearest last.
#[derive(Default)]
pub(super) struct MarchStack(Vec<Visit>);

impl<'a> RasterCaster<'a> {
    pub(super) fn new(raster: Cow<'a, Raster>, extent_m: f64) -> RasterCaster<'a> {
        let levels = levels(&raster);
        let per_m = 1.0 / raster.spacing_m;
        let side = |from_m: f64, nodes: usize| {
            [(-from_m * per_m).max(0.0), ((extent_m - from_m) * per_m).min((nodes - 1) as f64)]
        };
        let yard = [side(raster.origin_m.x, raster.cols), side(raster.origin_m.y, raster.rows)];
        RasterCaster { raster, yard, levels }
    }

    /// The grid as a sensor sees it.
    #[inline(always)]
    pub(super) fn view(&self, origin: DVec3) -> RasterView {
        let per_m = 1.0 / self.raster.spacing_m;
        let from = self.raster.origin_m;
        RasterView {
            x: (origin.x - from.x) * per_m,
            y: (origin.y - from.y) * per_m,
            z: origin.z,
            per_m,
            yard: self.yard,
        }
    }

    /// Range of the first crossing in [0, to].
    pub(super) fn first_hit(&self, origin: DVec3, dir: DVec3, to: f64) -> Option<f64> {
        self.first_hit_with(&mut MarchStack::default(), origin, dir, to)
    }

    /// As [`Self::first_hit`], with a list that many rays share.
    #[inline]
    pub(super) fn first_hit_with(&self, waiting: &mut MarchStack, origin: DVec3, dir: DVec3, to: f64) -> Option<f64> {
        let mut ray = self.view(origin).ray(dir, to);
        if ray.from > ray.to {
            return None;
        }
        let start = origin + dir * ray.from;
        if start.z < self.raster.height_m(start.x, start.y) {
            ray.side = -1.0;
        }
        let stack = &mut waiting.0;
        stack.clear();
        stack.push(Visit { level: self.levels.len() as u32, row: 0, col: 0, from: ray.from, to: ray.to });
        while let Some(mut visit) = stack.pop() {
            if visit.level == 0 {
                if let Some(range) = self.cell_hit(&ray, &visit) {
                    return Some(range);
                }
                continue;
            }
            let level = &self.levels[visit.level as usize - 1];
            if visit.row as usize >= level.rows || visit.col as usize >= level.cols {
                continue;
            }
            let block = &level.blocks[visit.row as usize * level.cols + visit.col as usize];
            if clip(block, &ray, &mut visit) {
                descend(&ray, &visit, self.last_cell(), stack);
            }
        }
        None
    }

    /// The first crossing in one cell.
    #[inline]
    fn cell_hit(&self, ray: &CellRay, visit: &Visit) -> Option<f64> {
        let (row, col) = (visit.row as usize, visit.col as usize);
        if row + 1 >= self.raster.rows || col + 1 >= self.raster.cols {
            return None;
        }
        let time = ray.crossing(col as f64, row as f64, self.corners(row, col));
        (time < f64::INFINITY).then_some(time)
    }

    /// Distance to the farthest corner of the grid, metres.
    pub(super) fn farthest_m(&self, origin: DVec3) -> f64 {
        let view = self.view(origin);
        let farthest = |place: f64, nodes: usize| larger(place.abs(), ((nodes - 1) as f64 - place).abs());
        let (x, y) = (farthest(view.x, self.raster.cols), farthest(view.y, self.raster.rows));
        (x * x + y * y).sqrt() * self.raster.spacing_m
    }

    /// The last cell of a row, and of a column.
    pub(super) fn last_cell(&self) -> [f64; 2] {
        [(self.raster.cols - 2) as f64, (self.raster.rows - 2) as f64]
    }

    /// Whether a sensor stands in the yard and not below its ground.
    pub(super) fn is_under(&self, origin: DVec3) -> bool {
        let view = self.view(origin);
        let within = |place: f64, [low, high]: [f64; 2]| place >= low && place <= high;
        within(view.x, self.yard[0])
            && within(view.y, self.yard[1])
            && origin.z >= self.raster.height_m(origin.x, origin.y)
    }

    /// The ground around a place in cells, or around the place of the grid that comes nearest to it, by blocks of a level: the slope
    /// of a plane along x and y per cell, and how high above the sensor no node there rises over the plane, at the sensor's place.
    #[inline(always)]
    pub(super) fn sight_around(&self, level: usize, col: f64, row: f64, view: &RasterView) -> [f64; 3] {
        // One block of the last level is the whole grid.
        let level = level.min(self.levels.len() - 1);
        let Level { rows, cols, blocks } = &self.levels[level];
        let side = f64::from(2u32 << level);
        let (row, col) = (((row / side) as usize).min(rows - 1), ((col / side) as usize).min(cols - 1));
        let block = &blocks[row * cols + col];
        let (x, y) = (view.x - col as f64 * side, view.y - row as f64 * side);
        let over = block.east.mul_add(x, block.north.mul_add(y, block.height + block.high_around - view.z));
        [block.east, block.north, over]
    }

    /// The corner heights of a cell of the grid: south-west, south-east, north-west, north-east.
    #[inline(always)]
    pub(super) fn corners(&self, row: usize, col: usize) -> [f64; 4] {
        let cols = self.raster.cols;
        let heights = &self.raster.heights_m[row * cols + col..row * cols + col + cols + 2];
        [heights[0], heights[1], heights[cols], heights[cols + 1]]
    }
}

/// Cuts a visit down to where the ray may meet the block's ground; false where it cannot.
#[inline]
fn clip(block: &Block, ray: &CellRay, visit: &mut Visit) -> bool {
    let side = f64::from(1u32 << visit.level);
    let (x, y) = (ray.x.place - f64::from(visit.col) * side, ray.y.place - f64::from(visit.row) * side);
    let at = ray.z - block.height - block.east * x - block.north * y;
    let rate = ray.dz - block.east * ray.x.rate - block.north * ray.y.rate;
    // How far the ray is beyond the block's bound, on its own side of the ground.
    let bound = if ray.side > 0.0 { block.high } else { -block.low };
    let (at, rate) = (ray.side * at - bound, ray.side * rate);
    let (begin, end) = (at + rate * visit.from, at + rate * visit.to);
    if begin <= 0.0 && end <= 0.0 {
        return true;
    }
    if begin > 0.0 && end > 0.0 {
        return false;
    }
    let crossing = (-at / rate).clamp(visit.from, visit.to);
    if begin > 0.0 {
        visit.from = crossing;
    } else {
        visit.to = crossing;
    }
    true
}

/// Puts the up to three quarters of a block that the ray passes on the stack, nearest on top.
#[inline]
fn descend(ray: &CellRay, visit: &Visit, last_cell: [f64; 2], stack: &mut Vec<Visit>) {
    let side = f64::from(1u32 << (visit.level - 1));
    let (mid_x, mid_y) = (f64::from(2 * visit.col + 1) * side, f64::from(2 * visit.row + 1) * side);
    let time = |axis: &Axis, middle: f64| {
        if axis.rate == 0.0 { f64::INFINITY } else { (middle - axis.place) * axis.inverse }
    };
    let (tx, ty) = (time(&ray.x, mid_x), time(&ray.y, mid_y));
    let beyond = |axis: &Axis, middle: f64, crossed: f64, last: f64, t: f64| {
        // The last cell's far border belongs to it: no ray stands still beyond.
        if axis.rate == 0.0 { axis.place >= middle && middle <= last } else { (t > crossed) == (axis.rate > 0.0) }
    };
    let east_at = |t: f64| beyond(&ray.x, mid_x, tx, last_cell[0], t);
    let north_at = |t: f64| beyond(&ray.y, mid_y, ty, last_cell[1], t);
    // A line that runs along an axis never crosses the other middle; its time lies at the ends of the world.
    let (first, second) = if tx < ty { (tx, ty) } else { (ty, tx) };
    let (first, second) = (first.clamp(visit.from, visit.to), second.clamp(visit.from, visit.to));
    for (from, to) in [(second, visit.to), (first, second), (visit.from, first)] {
        // A part of no length is a corner that its neighbours hold too; the whole visit may be one.
        if to > from || visit.from == visit.to {
            let middle = 0.5 * (from + to);
            let col = 2 * visit.col + u32::from(east_at(middle));
            let row = 2 * visit.row + u32::from(north_at(middle));
            stack.push(Visit { level: visit.level - 1, row, col, from, to });
        }
    }
}
