//! First hits on a raster ground: bilinear cells under a pyramid of least and greatest heights.
//!
//! In: a [`Raster`] over the yard [0, extent]^2, rays in the world frame, f64. Out: the range of the first crossing of the
//! bilinear surface, exact: along a ray the surface of one cell is a quadratic. The pyramid is descended front to back; a
//! block of cells is skipped where the ray stays above its highest (or, from below, under its lowest) node. Blocks split a
//! ray at shared times, so that no ray slips between two cells.

use std::borrow::Cow;

use super::polynomial::{clip_axis, clip_to_square};
use super::series::parabola_step;
use crate::geometry::DVec3;
use crate::scene::Raster;

/// A raster ground, ready to be cast at.
pub struct RasterCaster<'a> {
    pub raster: Cow<'a, Raster>,
    extent_m: f64,
    /// Level 0 has one entry a cell; each further level halves both sides, up to one block.
    levels: Vec<Level>,
}

struct Level {
    rows: usize,
    cols: usize,
    /// Lowest and highest node of each block, row by row.
    bounds: Vec<(f64, f64)>,
}

/// A ray in cells: x and y in cell sides from node (0, 0), z and times in metres.
struct CellRay {
    x: f64,
    y: f64,
    z: f64,
    dx: f64,
    dy: f64,
    dz: f64,
    /// 1 for a ray that comes from above the ground, -1 from below.
    side: f64,
}

/// A block of the pyramid and the part of the ray over it.
#[derive(Clone, Copy)]
struct Visit {
    level: u32,
    row: u32,
    col: u32,
    from: f64,
    to: f64,
}

impl<'a> RasterCaster<'a> {
    pub fn new(raster: Cow<'a, Raster>, extent_m: f64) -> RasterCaster<'a> {
        let (rows, cols) = (raster.rows - 1, raster.cols - 1);
        let mut bounds = Vec::with_capacity(rows * cols);
        for row in 0..rows {
            let (south, north) = (&raster.heights_m[row * raster.cols..], &raster.heights_m[(row + 1) * raster.cols..]);
            for col in 0..cols {
                let corners = [south[col], south[col + 1], north[col], north[col + 1]];
                bounds.push(corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |b, &h| (b.0.min(h), b.1.max(h))));
            }
        }
        let mut levels = vec![Level { rows, cols, bounds }];
        while let Some(last) = levels.last().filter(|l| l.rows > 1 || l.cols > 1) {
            let (rows, cols) = (last.rows.div_ceil(2), last.cols.div_ceil(2));
            let mut bounds = vec![(f64::INFINITY, f64::NEG_INFINITY); rows * cols];
            for row in 0..last.rows {
                for col in 0..last.cols {
                    let (low, high) = last.bounds[row * last.cols + col];
                    let block = &mut bounds[row / 2 * cols + col / 2];
                    *block = (block.0.min(low), block.1.max(high));
                }
            }
            levels.push(Level { rows, cols, bounds });
        }
        RasterCaster { raster, extent_m, levels }
    }

    /// Range of the first crossing in [from, to].
    pub fn first_hit(&self, origin: DVec3, dir: DVec3, from: f64, to: f64) -> Option<f64> {
        let (from, to) = clip_to_square(origin, dir, self.extent_m, from, to)?;
        let (width, depth) = ((self.raster.cols - 1) as f64, (self.raster.rows - 1) as f64);
        let per_m = 1.0 / self.raster.spacing_m;
        let mut ray = CellRay {
            x: (origin.x - self.raster.origin_m.x) * per_m,
            y: (origin.y - self.raster.origin_m.y) * per_m,
            z: origin.z,
            dx: dir.x * per_m,
            dy: dir.y * per_m,
            dz: dir.z,
            side: 1.0,
        };
        let (from, to) = clip_axis(ray.x, ray.dx, 0.0, width, from, to)?;
        let (from, to) = clip_axis(ray.y, ray.dy, 0.0, depth, from, to)?;
        let start = origin + dir * from;
        if start.z < self.raster.height_m(start.x, start.y) {
            ray.side = -1.0;
        }
        let top = self.levels.len() - 1;
        // Three more blocks a level wait at most.
        let mut stack = [Visit { level: top as u32, row: 0, col: 0, from, to }; 4 * usize::BITS as usize];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let visit = stack[waiting];
            let level = &self.levels[visit.level as usize];
            if visit.row as usize >= level.rows || visit.col as usize >= level.cols {
                continue;
            }
            let (low, high) = level.bounds[visit.row as usize * level.cols + visit.col as usize];
            let (a, b) = (ray.dz.mul_add(visit.from, ray.z), ray.dz.mul_add(visit.to, ray.z));
            // A block's own corner heights round; 1e-12 of margin keeps a touching ray in.
            let clear = if ray.side > 0.0 { a.min(b) > high + 1e-12 } else { a.max(b) < low - 1e-12 };
            if clear {
                continue;
            }
            if visit.level == 0 {
                if let Some(range) = self.cell_hit(&ray, &visit) {
                    return Some(range);
                }
                continue;
            }
            waiting = descend(&ray, &visit, &mut stack, waiting);
        }
        None
    }

    /// The first crossing in one cell.
    fn cell_hit(&self, ray: &CellRay, visit: &Visit) -> Option<f64> {
        let (row, col, cols) = (visit.row as usize, visit.col as usize, self.raster.cols);
        let heights = &self.raster.heights_m[row * cols + col..];
        let [sw, se, nw, ne] = [heights[0], heights[1], heights[cols], heights[cols + 1]];
        let (x, y) = (ray.dx.mul_add(visit.from, ray.x) - col as f64, ray.dy.mul_add(visit.from, ray.y) - row as f64);
        let (east, north, twist) = (se - sw, nw - sw, (ne - nw) - (se - sw));
        // z - h along the ray, as a quadratic in the distance from the entry.
        let height = sw + east * x + north * y + twist * x * y;
        let g = ray.side * (ray.dz.mul_add(visit.from, ray.z) - height);
        let slope = ray.side * (ray.dz - (east * ray.dx + north * ray.dy + twist * (x * ray.dy + y * ray.dx)));
        let bend = ray.side * twist * ray.dx * ray.dy;
        if g <= 0.0 {
            // At or past the surface at the entry: the crossing rounded onto the border between two cells.
            return (slope < 0.0).then_some(visit.from);
        }
        let disc = slope.mul_add(slope, 4.0 * bend * g);
        if disc < 0.0 || (slope >= 0.0 && bend <= 0.0) {
            return None;
        }
        let step = parabola_step(g, slope, 2.0 * bend);
        (step >= 0.0 && step <= visit.to - visit.from).then_some(visit.from + step)
    }
}

/// Puts the up to three quarters of a block that the ray passes on the stack, nearest on top.
#[inline]
fn descend(ray: &CellRay, visit: &Visit, stack: &mut [Visit], mut waiting: usize) -> usize {
    let side = f64::from(1u32 << (visit.level - 1));
    let (mid_x, mid_y) = (f64::from(2 * visit.col + 1) * side, f64::from(2 * visit.row + 1) * side);
    let time = |x: f64, dx: f64, mid: f64| if dx == 0.0 { f64::INFINITY } else { (mid - x) / dx };
    let (tx, ty) = (time(ray.x, ray.dx, mid_x), time(ray.y, ray.dy, mid_y));
    let (first, second) = (tx.min(ty).clamp(visit.from, visit.to), tx.max(ty).clamp(visit.from, visit.to));
    let upper = |t: f64, cross: f64, d: f64, x: f64, mid: f64| -> u32 {
        u32::from(if d == 0.0 { x >= mid } else { (t > cross) == (d > 0.0) })
    };
    for (from, to) in [(second, visit.to), (first, second), (visit.from, first)] {
        // A part of no length is a corner that its neighbours hold too; the whole visit may be one.
        if to > from || visit.from == visit.to {
            let middle = 0.5 * (from + to);
            let col = 2 * visit.col + upper(middle, tx, ray.dx, ray.x, mid_x);
            let row = 2 * visit.row + upper(middle, ty, ray.dy, ray.y, mid_y);
            stack[waiting] = Visit { level: visit.level - 1, row, col, from, to };
            waiting += 1;
        }
    }
    waiting
}
