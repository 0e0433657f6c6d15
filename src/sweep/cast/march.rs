//! First hits of many rays from one point on a raster ground: the fast path of a sweep.
//!
//! In: a sensor above the ground and unit directions. Out: the range of each first crossing, to the bit what the pyramid of
//! [`raster`] finds. A ray starts where the [`SlopeBounds`] lets it first meet the ground and goes from cell to cell; after a few
//! cells that it has flown over, the slope bounds say again how far nothing can be met. Rays go in blocks of [`LANES`], lane by lane
//! the same arithmetic.
//!
//! [`raster`]: super::raster

use super::cell::{Axis, CellRay};
use super::is_ray;
use super::newton::{LANES, Lanes, smaller};
use super::raster::{RasterCaster, RasterView};
use super::slope_bounds::SlopeBounds;
use crate::geometry::DVec3;

/// Cells from one look at the slope bounds to the next.
const STRIDE_CELLS: usize = 8;

/// A sensor above a raster ground, ready to be cast from.
pub(super) struct HorizonProfile {
    slope_bounds: SlopeBounds,
    view: RasterView,
    origin_m: DVec3,
    /// The last cell of a row, and of a column.
    last: [f64; 2],
}

/// Rays of a block, part by part.
struct Rays {
    x: Axes,
    y: Axes,
    dz: Lanes,
    /// Where a ray's search ends; minus infinity for a ray that is done.
    to: Lanes,
}

struct Axes {
    place: f64,
    rate: Lanes,
    inverse: Lanes,
    enters: Lanes,
    leaves: Lanes,
}

impl Axes {
    #[inline(always)]
    fn still(place: f64) -> Axes {
        Axes { place, rate: [0.0; LANES], inverse: [0.0; LANES], enters: [0.0; LANES], leaves: [0.0; LANES] }
    }

    #[inline(always)]
    fn set(&mut self, l: usize, axis: Axis) {
        (self.rate[l], self.inverse[l]) = (axis.rate, axis.inverse);
        (self.enters[l], self.leaves[l]) = (axis.enters, axis.leaves);
    }

    #[inline(always)]
    fn get(&self, l: usize) -> Axis {
        Axis {
            place: self.place,
            rate: self.rate[l],
            inverse: self.inverse[l],
            enters: self.enters[l],
            leaves: self.leaves[l],
        }
    }
}

impl HorizonProfile {
    /// `None` for a sensor beside the yard or below its ground.
    pub(super) fn new(ground: &RasterCaster, origin_m: DVec3, reach_m: f64) -> Option<HorizonProfile> {
        ground.is_under(origin_m).then(|| HorizonProfile {
            slope_bounds: SlopeBounds::new(ground, origin_m, reach_m),
            view: ground.view(origin_m),
            origin_m,
            last: ground.last_cell(),
        })
    }

    /// Solves one block of rays up to `max_m`.
    #[inline(always)]
    pub(super) fn solve(&self, ground: &RasterCaster, dirs: &[DVec3; LANES], max_m: f64, ranges: &mut Lanes) {
        let HorizonProfile { slope_bounds, view, .. } = self;
        let mut rays = Rays { x: Axes::still(view.x), y: Axes::still(view.y), dz: [0.0; LANES], to: [0.0; LANES] };
        let (mut level, mut slope) = ([0.0; LANES], [0.0f64; LANES]);
        for l in 0..LANES {
            let ray = view.ray(dirs[l], max_m);
            rays.x.set(l, ray.x);
            rays.y.set(l, ray.y);
            (rays.dz[l], rays.to[l]) = (ray.dz, ray.to);
            level[l] = dirs[l].x.mul_add(dirs[l].x, dirs[l].y * dirs[l].y).sqrt();
            slope[l] = dirs[l].z / level[l];
        }
        *ranges = [f64::INFINITY; LANES];
        let (mut at, mut sectors, mut slopes) = ([f64::INFINITY; LANES], [0; LANES], [0.0f32; LANES]);
        let mut open = 0u32;
        for l in 0..LANES {
            if is_ray(self.origin_m, dirs[l]) {
                // Rounded towards the ground.
                slopes[l] = (slope[l] as f32).next_down();
                sectors[l] = slope_bounds.sector(dirs[l].x, dirs[l].y);
                let begins_m = slope_bounds.begins_m(slope_bounds.first_ring(sectors[l], slopes[l]));
                at[l] = if begins_m > 0.0 { begins_m / level[l] } else { 0.0 };
                open |= u32::from(at[l] <= rays.to[l]) << l;
            }
        }
        while open != 0 {
            self.march(ground, &mut rays, &mut at, &mut open, ranges);
            for l in 0..LANES {
                if open >> l & 1 == 1 {
                    at[l] = slope_bounds.next_m(sectors[l], slopes[l], at[l] * level[l]) / level[l];
                    open &= !(u32::from(at[l] > rays.to[l]) << l);
                }
            }
        }
    }

    /// Takes the open rays a few cells on from `at`.
    #[inline(always)]
    fn march(&self, ground: &RasterCaster, rays: &mut Rays, at: &mut Lanes, open: &mut u32, ranges: &mut Lanes) {
        let (mut col, mut row) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let cell = |axes: &Axes, last: f64| {
                let place = axes.rate[l].mul_add(at[l], axes.place);
                // The last cell's far border belongs to it.
                if place >= 0.0 && place <= last + 1.0 { smaller(place.floor(), last) } else { f64::NAN }
            };
            (col[l], row[l]) = (cell(&rays.x, self.last[0]), cell(&rays.y, self.last[1]));
            let lost = *open >> l & 1 == 0 || col[l].is_nan() || row[l].is_nan();
            if lost {
                *open &= !(1 << l);
                (rays.to[l], col[l], row[l]) = (f64::NEG_INFINITY, 0.0, 0.0);
            }
        }
        for _ in 0..STRIDE_CELLS {
            let (mut sw, mut se, mut nw, mut ne) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                [sw[l], se[l], nw[l], ne[l]] = ground.corners(row[l] as i32 as usize, col[l] as i32 as usize);
            }
            let mut going = [false; LANES];
            for l in 0..LANES {
                let (x, y) = (rays.x.get(l), rays.y.get(l));
                let to = rays.to[l];
                let ray = CellRay { x, y, z: self.view.z, dz: rays.dz[l], from: 0.0, to, side: 1.0 };
                let met = ray.crossing(col[l], row[l], [sw[l], se[l], nw[l], ne[l]]);
                ranges[l] = smaller(met, ranges[l]);
                let (leaves_x, leaves_y) = (x.leaves_at(col[l]), y.leaves_at(row[l]));
                at[l] = smaller(leaves_x, leaves_y);
                let aside = leaves_x < leaves_y;
                let next_col = if aside { col[l] + x.step() } else { col[l] };
                let next_row = if aside { row[l] } else { row[l] + y.step() };
                let inside =
                    (next_col >= 0.0) & (next_row >= 0.0) & (next_col <= self.last[0]) & (next_row <= self.last[1]);
                let on = (met == f64::INFINITY) & (at[l] <= to) & inside;
                (col[l], row[l]) = (if on { next_col } else { 0.0 }, if on { next_row } else { 0.0 });
                rays.to[l] = if on { to } else { f64::NEG_INFINITY };
                going[l] = on;
            }
            let bits = going.iter().enumerate().fold(0, |bits, (l, &on)| bits | u32::from(on) << l);
            *open = bits;
            if bits == 0 {
                return;
            }
        }
    }
}
