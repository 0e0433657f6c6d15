//! Convex polyhedra about a sensor: the plane vectors of those that rays come near, made when they first do, and where rays meet them.
//!
//! In: polyhedra of the scene, unit directions. Out: the inverse range at which a ray meets the surface. Source: Haines 1991 with the
//! origin folded in: for a plane n . x + d = 0 and the sensor at height c = n . o + d over it, a ray passes the plane at inverse
//! range q = w . dir, w = -n / c. Planes that the sensor is outside of (c > 0) bound q from above, the others from below; the ray
//! enters at the least upper bound, if it is not below the greatest lower bound. No division, three multiply-adds a plane.
//!
//! A body that most rays of a half block come near is solved plane by plane, the rays side by side; one that few come near ray by
//! ray, the planes side by side. Both do the same arithmetic, and the least of some numbers does not depend on their order.

use super::newton::{Dirs, LANES, Lanes, larger, smaller};
use super::sectors::of_all;
use crate::geometry::DVec3;
use crate::scene::Convex;
use crate::wide::{Work, widest};

/// Planes and rays side by side.
const SIDE: usize = 8;
/// Up to so many rays of a half block are solved one by one.
const FEW: u32 = 3;

/// Plane vectors by component.
type Chunk = [[f64; SIDE]; 3];

/// The plane vectors of the bodies that were asked for.
pub(super) struct Planes {
    /// Per body, its chunks; none yet where there are no fronts and no backs.
    made: Vec<PlaneRange>,
    chunks: Vec<Chunk>,
    /// Back planes of the body that is made.
    backs: Vec<Chunk>,
}

/// A body's chunks: front planes, then back planes; the last chunk of each is filled up with one of its own planes.
#[derive(Clone, Copy, Default)]
struct PlaneRange {
    first: u32,
    fronts: u32,
    backs: u32,
}

impl Planes {
    pub(super) fn new(bodies: usize) -> Planes {
        Planes { made: vec![PlaneRange::default(); bodies], chunks: Vec::new(), backs: Vec::new() }
    }

    #[inline(always)]
    pub(super) fn are_made(&self, rank: u32) -> bool {
        let made = self.made[rank as usize];
        made.fronts + made.backs > 0
    }

    pub(super) fn make(&mut self, rank: u32, convex: &Convex, origin: DVec3) {
        self.made[rank as usize] = widest(BuildPlanes { planes: self, convex, origin });
    }

    /// Shortens the ranges of the rays marked in `seen` that meet a body before they end, and marks those: `inverse` is 1 / range.
    #[inline(always)]
    pub(super) fn intersect(&self, rank: u32, dirs: Dirs, seen: u32, inverse: &mut Lanes) -> u32 {
        let made = self.made[rank as usize];
        let chunks = |count: u32| count.div_ceil(SIDE as u32) as usize;
        let (fronts, backs) = self.chunks[made.first as usize..].split_at(chunks(made.fronts));
        let backs = &backs[..chunks(made.backs)];
        let mut met = 0;
        for first in (0..LANES).step_by(SIDE) {
            let mut left = seen >> first & 0xff;
            if left.count_ones() > FEW {
                let (mut enter, mut exit) = ([f64::INFINITY; SIDE], [f64::NEG_INFINITY; SIDE]);
                each_plane(fronts, made.fronts, dirs, first, |l, q| enter[l] = smaller(enter[l], q));
                each_plane(backs, made.backs, dirs, first, |l, q| exit[l] = larger(exit[l], q));
                if made.fronts == 0 {
                    // The sensor is inside: the surface is met on the way out.
                    enter = exit;
                }
                for l in 0..SIDE {
                    let to = &mut inverse[first + l];
                    let here = (left >> l & 1 != 0) & (enter[l] > *to) & (enter[l] >= exit[l]) & (enter[l] > 0.0);
                    *to = if here { enter[l] } else { *to };
                    met |= u32::from(here) << (first + l);
                }
                continue;
            }
            while left != 0 {
                let l = first + left.trailing_zeros() as usize;
                left &= left - 1;
                let dir = [dirs.x[l], dirs.y[l], dirs.z[l]];
                let mut enter = of_planes(fronts, dir, f64::INFINITY, smaller);
                if made.fronts > 0 && enter <= inverse[l] {
                    continue;
                }
                let exit = of_planes(backs, dir, f64::NEG_INFINITY, larger);
                if made.fronts == 0 {
                    enter = exit;
                }
                if enter > inverse[l] && enter >= exit && enter > 0.0 {
                    inverse[l] = enter;
                    met |= 1 << l;
                }
            }
        }
        met
    }
}

/// Inverse ranges of half a block at every plane.
#[inline(always)]
fn each_plane(chunks: &[Chunk], count: u32, dirs: Dirs, first: usize, mut take: impl FnMut(usize, f64)) {
    for (c, [wx, wy, wz]) in chunks.iter().enumerate() {
        for ((wx, wy), wz) in wx.iter().zip(wy).zip(wz).take(count as usize - SIDE * c) {
            for l in 0..SIDE {
                let (x, y, z) = (dirs.x[first + l], dirs.y[first + l], dirs.z[first + l]);
                take(l, x.mul_add(*wx, y.mul_add(*wy, z * wz)));
            }
        }
    }
}

/// The least or greatest inverse range of a ray at all planes.
#[inline(always)]
fn of_planes(chunks: &[Chunk], [x, y, z]: [f64; 3], none: f64, pick: impl Fn(f64, f64) -> f64) -> f64 {
    let mut picked = [none; SIDE];
    for w in chunks {
        for k in 0..SIDE {
            picked[k] = pick(picked[k], x.mul_add(w[0][k], y.mul_add(w[1][k], z * w[2][k])));
        }
    }
    of_all(&picked, pick)
}

/// Makes the plane vectors of a body.
struct BuildPlanes<'a> {
    planes: &'a mut Planes,
    convex: &'a Convex,
    origin: DVec3,
}

impl Work for BuildPlanes<'_> {
    type Out = PlaneRange;

    #[inline(always)]
    fn run(self) -> PlaneRange {
        let Planes { chunks, backs, .. } = self.planes;
        let mut made = PlaneRange { first: chunks.len() as u32, ..PlaneRange::default() };
        backs.clear();
        for eight in self.convex.planes.chunks(SIDE) {
            let (mut w, mut over): (Chunk, _) = ([[0.0; SIDE]; 3], [1.0; SIDE]);
            for (k, plane) in eight.iter().enumerate() {
                for (axis, of_axis) in w.iter_mut().enumerate() {
                    of_axis[k] = plane.normal[axis];
                }
                over[k] = plane.offset_m;
            }
            let o = self.origin;
            for k in 0..SIDE {
                over[k] += w[0][k] * o.x + w[1][k] * o.y + w[2][k] * o.z;
            }
            for of_axis in &mut w {
                for k in 0..SIDE {
                    // A sensor on the plane counts as just outside.
                    of_axis[k] = -of_axis[k] / if over[k] == 0.0 { 1e-300 } else { over[k] };
                }
            }
            for k in 0..eight.len() {
                let (side, count) =
                    if over[k] >= 0.0 { (&mut *chunks, &mut made.fronts) } else { (&mut *backs, &mut made.backs) };
                let place = *count as usize % SIDE;
                if place == 0 {
                    // Filled up with the first, for whoever takes eight at a time.
                    side.push([0, 1, 2].map(|axis| [w[axis][k]; SIDE]));
                } else if let Some(last) = side.last_mut() {
                    (0..3).for_each(|axis| last[axis][place] = w[axis][k]);
                }
                *count += 1;
            }
        }
        chunks.extend_from_slice(backs);
        made
    }
}
