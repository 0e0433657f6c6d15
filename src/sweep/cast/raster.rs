//! First hits on a raster ground: bilinear cells under a pyramid of planes.
//!
//! In: a [`Raster`] over the yard [0, extent]^2, rays in the world frame, f64. Out: the range of the first crossing of the
//! bilinear surface, exact: along a ray the surface of one cell is a quadratic. Above the cells stand blocks of 2 x 2, 4 x 4, ...
//! cells; each knows a plane and how far its nodes lie below and above it (a bilinear surface minus a plane is extreme at
//! nodes, so the bounds are exact). Blocks are visited front to back; a ray is clipped to where it can meet the block at all.
//! A plane follows the slope of the ground, so that grazing rays are clipped well where a pyramid of greatest heights
//! would have to be descended. Blocks split a ray at shared times, so that none slips between two cells.

use std::borrow::Cow;

use super::polynomial::{clip_axis, clip_to_square};
use super::series::parabola_step;
use crate::geometry::DVec3;
use crate::scene::Raster;

/// Margin of the blocks' bounds: above the rounding of heights of a kilometre.
const MARGIN_M: f64 = 1e-12;

/// A raster ground, ready to be cast at.
pub struct RasterCaster<'a> {
    raster: Cow<'a, Raster>,
    extent_m: f64,
    /// Blocks of 2 x 2 cells first; each further level halves both sides, up to one block.
    levels: Vec<Level>,
}

struct Level {
    rows: usize,
    cols: usize,
    blocks: Vec<Block>,
}

/// The plane height + east * (x - x0) + north * (y - y0) from the block's south-west corner, x and y in cells, and where the
/// ground lies from it.
#[derive(Clone, Copy)]
struct Block {
    height: f64,
    east: f64,
    north: f64,
    low: f64,
    high: f64,
}

/// A ray in cells: x and y in cell sides from node (0, 0), z and times in metres.
struct CellRay {
    x: f64,
    y: f64,
    z: f64,
    dx: f64,
    dy: f64,
    dz: f64,
    /// 1 / dx and 1 / dy (1e300 for 0).
    ix: f64,
    iy: f64,
    /// 1 for a ray that comes from above the ground, -1 from below.
    side: f64,
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
pub struct Waiting(Vec<Visit>);

impl<'a> RasterCaster<'a> {
    pub fn new(raster: Cow<'a, Raster>, extent_m: f64) -> RasterCaster<'a> {
        let mut levels = Vec::new();
        let (mut rows, mut cols, mut side) = (raster.rows - 1, raster.cols - 1, 1);
        while rows > 1 || cols > 1 || side == 1 {
            (rows, cols, side) = (rows.div_ceil(2), cols.div_ceil(2), 2 * side);
            let places = (0..rows).flat_map(|row| (0..cols).map(move |col| (row * side, col * side)));
            let blocks = places.map(|(row, col)| block(&raster, row, col, side)).collect();
            levels.push(Level { rows, cols, blocks });
        }
        RasterCaster { raster, extent_m, levels }
    }

    /// Range of the first crossing in [0, to].
    pub fn first_hit(&self, origin: DVec3, dir: DVec3, to: f64) -> Option<f64> {
        self.first_hit_with(&mut Waiting::default(), origin, dir, to)
    }

    /// As [`Self::first_hit`], with a list that many rays share.
    #[inline]
    pub fn first_hit_with(&self, waiting: &mut Waiting, origin: DVec3, dir: DVec3, to: f64) -> Option<f64> {
        let (from, to) = clip_to_square(origin, dir, self.extent_m, 0.0, to)?;
        let (width, depth) = ((self.raster.cols - 1) as f64, (self.raster.rows - 1) as f64);
        let per_m = 1.0 / self.raster.spacing_m;
        let (dx, dy) = (dir.x * per_m, dir.y * per_m);
        let mut ray = CellRay {
            x: (origin.x - self.raster.origin_m.x) * per_m,
            y: (origin.y - self.raster.origin_m.y) * per_m,
            z: origin.z,
            dx,
            dy,
            dz: dir.z,
            ix: if dx == 0.0 { 1e300 } else { 1.0 / dx },
            iy: if dy == 0.0 { 1e300 } else { 1.0 / dy },
            side: 1.0,
        };
        let (from, to) = clip_axis(ray.x, ray.dx, 0.0, width, from, to)?;
        let (from, to) = clip_axis(ray.y, ray.dy, 0.0, depth, from, to)?;
        let start = origin + dir * from;
        if start.z < self.raster.height_m(start.x, start.y) {
            ray.side = -1.0;
        }
        let stack = &mut waiting.0;
        stack.clear();
        stack.push(Visit { level: self.levels.len() as u32, row: 0, col: 0, from, to });
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
                descend(&ray, &visit, stack);
            }
        }
        None
    }

    /// The first crossing in one cell.
    #[inline]
    fn cell_hit(&self, ray: &CellRay, visit: &Visit) -> Option<f64> {
        let (row, col, cols) = (visit.row as usize, visit.col as usize, self.raster.cols);
        if row + 1 >= self.raster.rows || col + 1 >= cols {
            return None;
        }
        let heights = &self.raster.heights_m[row * cols + col..];
        let [sw, se, nw, ne] = [heights[0], heights[1], heights[cols], heights[cols + 1]];
        let (x, y) = (ray.x + ray.dx * visit.from - col as f64, ray.y + ray.dy * visit.from - row as f64);
        let (east, north, twist) = (se - sw, nw - sw, (ne - nw) - (se - sw));
        // z - h along the ray, as a quadratic in the distance from the entry.
        let height = sw + east * x + north * y + twist * x * y;
        let g = ray.side * (ray.z + ray.dz * visit.from - height);
        let slope = ray.side * (ray.dz - (east * ray.dx + north * ray.dy + twist * (x * ray.dy + y * ray.dx)));
        let bend = ray.side * twist * ray.dx * ray.dy;
        if g <= 0.0 {
            // At or past the surface at the entry: the crossing rounded onto the border between two cells.
            return (slope < 0.0).then_some(visit.from);
        }
        let disc = slope * slope + 4.0 * bend * g;
        if disc < 0.0 || (slope >= 0.0 && bend <= 0.0) {
            return None;
        }
        let step = parabola_step(g, slope, 2.0 * bend);
        (step >= 0.0 && step <= visit.to - visit.from).then_some(visit.from + step)
    }
}

/// The plane of a block through three of its corners, and the bounds of all its nodes.
fn block(raster: &Raster, row: usize, col: usize, side: usize) -> Block {
    let (last_row, last_col) = ((row + side).min(raster.rows - 1), (col + side).min(raster.cols - 1));
    let node = |row: usize, col: usize| raster.heights_m[row * raster.cols + col];
    let (height, rows, cols) = (node(row, col), (last_row - row) as f64, (last_col - col) as f64);
    let east = 0.5 * (node(row, last_col) - height + node(last_row, last_col) - node(last_row, col)) / cols;
    let north = 0.5 * (node(last_row, col) - height + node(last_row, last_col) - node(row, last_col)) / rows;
    let (mut low, mut high) = (0.0f64, 0.0f64);
    for r in row..=last_row {
        let along = height + north * (r - row) as f64;
        let heights = &raster.heights_m[r * raster.cols + col..=r * raster.cols + last_col];
        for (c, h) in heights.iter().enumerate() {
            let above = h - (along + east * c as f64);
            low = low.min(above);
            high = high.max(above);
        }
    }
    let margin = MARGIN_M * (1.0 + height.abs());
    Block { height, east, north, low: low - margin, high: high + margin }
}

/// Cuts a visit down to where the ray may meet the block's ground; false where it cannot.
#[inline]
fn clip(block: &Block, ray: &CellRay, visit: &mut Visit) -> bool {
    let side = f64::from(1u32 << visit.level);
    let (x, y) = (ray.x - f64::from(visit.col) * side, ray.y - f64::from(visit.row) * side);
    let at = ray.z - block.height - block.east * x - block.north * y;
    let rate = ray.dz - block.east * ray.dx - block.north * ray.dy;
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
fn descend(ray: &CellRay, visit: &Visit, stack: &mut Vec<Visit>) {
    let side = f64::from(1u32 << (visit.level - 1));
    let (mid_x, mid_y) = (f64::from(2 * visit.col + 1) * side, f64::from(2 * visit.row + 1) * side);
    let (tx, ty) = ((mid_x - ray.x) * ray.ix, (mid_y - ray.y) * ray.iy);
    let east_at = |t: f64| if ray.dx == 0.0 { ray.x >= mid_x } else { (t > tx) == (ray.dx > 0.0) };
    let north_at = |t: f64| if ray.dy == 0.0 { ray.y >= mid_y } else { (t > ty) == (ray.dy > 0.0) };
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
