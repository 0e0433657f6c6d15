//! First hits of many rays from one point on convex bodies: shared-origin packets in inverse range.
//!
//! In: the obstacles within reach of a sensor, and blocks of unit directions with the ranges at which they already end. Out:
//! shorter ranges and ids. Bodies are sorted by their nearest point. A block of rays walks the list of its sector (see `sectors`) until
//! the bodies lie beyond all that it has met; the rays that come near a body's sphere are tried at its planes (see `planes`).

use std::cell::RefCell;
use std::ops::Range;

use super::convex;
use super::newton::{Dirs, LANES, Lanes, bits, each, smaller};
use super::obstacle_grid::ObstacleGrid;
use super::planes::Planes;
use super::sectors::{BlockCone, Cone, Sectors, of_all};
use crate::geometry::DVec3;
use crate::scene::{Cylinder, Obstacle, Shape};

/// The bodies in reach of a sensor.
pub(super) struct Packets<'a> {
    obstacles: &'a [Obstacle],
    origin: DVec3,
    /// Nearest first.
    bodies: Vec<PacketBody>,
    sectors: Sectors,
    planes: RefCell<Planes>,
}

struct PacketBody {
    /// Its place in the obstacles' row.
    index: u32,
    /// Bounding sphere: centre from the sensor, squared length of the tangent (minus infinity where the sensor is in it).
    centre: DVec3,
    tangent2: f64,
    /// Least cosine side: 0, or minus infinity where the sensor is in the sphere.
    ahead: f64,
    nearest: f64,
}

impl<'a> Packets<'a> {
    /// `None` where nothing is in reach.
    pub(super) fn new(
        obstacles: &'a [Obstacle],
        places: &ObstacleGrid,
        origin: DVec3,
        reach_m: f64,
    ) -> Option<Packets<'a>> {
        let mut near: Vec<(f64, usize, DVec3, f64)> = Vec::new();
        places.near(obstacles, origin.truncate(), reach_m, |index, (centre, radius)| {
            // A hair of slack for the rounding of the centre's place.
            let radius = radius + 1e-14 * (centre.abs().max_element() + origin.abs().max_element());
            let centre = centre - origin;
            let nearest = (centre.length() - radius).max(0.0);
            if nearest <= reach_m {
                near.push((nearest, index, centre, radius));
            }
        });
        if near.is_empty() {
            return None;
        }
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let bodies: Vec<PacketBody> = near
            .iter()
            .map(|&(nearest, index, centre, radius)| PacketBody::new(index, centre, radius, nearest))
            .collect();
        let cones = near.iter().map(|&(_, _, centre, radius)| Cone::of_sphere(centre, radius));
        let sectors = Sectors::new(cones, |rank| bodies[rank as usize].nearest);
        let planes = RefCell::new(Planes::new(bodies.len()));
        Some(Packets { obstacles, origin, bodies, sectors, planes })
    }

    /// Shortens the ranges of a block where a body is met first. `inverse` holds 1 / range of what each ray ends at.
    #[inline(always)]
    pub(super) fn solve(&self, dirs: Dirs, inverse: &mut Lanes, objects: &mut [i32; LANES]) {
        if self.bodies[0].nearest * of_all(inverse, smaller) > 1.0 {
            return;
        }
        let view = BlockCone::of(dirs);
        if !view.is_wide() {
            return self.walk(dirs, &view, !0, inverse, objects);
        }
        // Most often the end of a scanner's line and the beginning of the next.
        let jump = jump(dirs);
        for lanes in [0..jump, jump..LANES] {
            let mine = (1 << lanes.end) - (1 << lanes.start);
            let [x, y, z] = filled(dirs, lanes);
            let dirs = Dirs { x: &x, y: &y, z: &z };
            self.walk(dirs, &BlockCone::of(dirs), mine, inverse, objects);
        }
    }

    /// Tries the rays marked in `mine` at all bodies in view.
    #[inline(always)]
    fn walk(&self, dirs: Dirs, view: &BlockCone, mine: u32, inverse: &mut Lanes, objects: &mut [i32; LANES]) {
        let Dirs { x, y, z } = dirs;
        let mut least = of_all(inverse, smaller);
        let mut planes = self.planes.borrow_mut();
        for chunk in self.sectors.list(view, |rank| self.bodies[rank as usize].nearest) {
            if chunk.nearest * least > 1.0 {
                break;
            }
            let mut left = chunk.in_view(view);
            while left != 0 {
                let rank = chunk.rank[left.trailing_zeros() as usize];
                left &= left - 1;
                let body = &self.bodies[rank as usize];
                let seen = mine
                    & bits(|l| {
                        let along = x[l].mul_add(body.centre.x, y[l].mul_add(body.centre.y, z[l] * body.centre.z));
                        // A ray that ends before the sphere is not tried.
                        (along >= body.ahead) & (along * along >= body.tangent2) & (body.nearest * inverse[l] <= 1.0)
                    });
                if seen == 0 {
                    continue;
                }
                let upright = if planes.are_made(rank) { None } else { self.make(&mut planes, rank) };
                let met = match upright {
                    None => planes.intersect(rank, dirs, seen, inverse),
                    Some(cylinder) => meet_cylinder(&cylinder, dirs, seen, inverse),
                };
                if met == 0 {
                    continue;
                }
                let id = self.obstacles[body.index as usize].id;
                for (l, object) in objects.iter_mut().enumerate() {
                    *object = if met >> l & 1 != 0 { id } else { *object };
                }
                least = of_all(inverse, smaller);
            }
        }
    }

    /// A polyhedron's planes; a cylinder as it stands about the sensor.
    #[inline(never)]
    fn make(&self, planes: &mut Planes, rank: u32) -> Option<Cylinder> {
        match &self.obstacles[self.bodies[rank as usize].index as usize].body().shape {
            Shape::Convex(convex) => {
                planes.make(rank, convex, self.origin);
                None
            }
            Shape::Cylinder(upright) => Some(Cylinder { base_m: upright.base_m - self.origin, ..*upright }),
        }
    }
}

/// The ray that is farthest from the one before it.
fn jump(dirs: Dirs) -> usize {
    let cos = |l: usize| dirs.x[l] * dirs.x[l - 1] + dirs.y[l] * dirs.y[l - 1] + dirs.z[l] * dirs.z[l - 1];
    (1..LANES).fold(1, |farthest, l| if cos(l) < cos(farthest) { l } else { farthest })
}

/// Some rays of a block, the others' places taken by one of them.
fn filled(dirs: Dirs, lanes: Range<usize>) -> [Lanes; 3] {
    let ray = |l: usize| l.clamp(lanes.start, lanes.end - 1);
    [dirs.x, dirs.y, dirs.z].map(|of_axis| each(|l| of_axis[ray(l)]))
}

impl PacketBody {
    fn new(index: usize, centre: DVec3, radius: f64, nearest: f64) -> PacketBody {
        let distance2 = centre.length_squared();
        let within = distance2 <= radius * radius * (1.0 + 1e-9);
        PacketBody {
            index: index as u32,
            centre,
            // The last term is for the rounding of a ray's cosine side, which counts for small bodies far off.
            tangent2: if within { f64::NEG_INFINITY } else { distance2 - radius * radius - 1e-14 * distance2 },
            ahead: if within { f64::NEG_INFINITY } else { 0.0 },
            nearest,
        }
    }
}

/// One upright cylinder about the sensor, ray by ray; as for polyhedra.
fn meet_cylinder(cylinder: &Cylinder, dirs: Dirs, seen: u32, inverse: &mut Lanes) -> u32 {
    let (mut met, mut left) = (0, seen);
    while left != 0 {
        let l = left.trailing_zeros() as usize;
        left &= left - 1;
        let (dir, reach) = (DVec3::new(dirs.x[l], dirs.y[l], dirs.z[l]), 1.0 / inverse[l]);
        if let Some(range) = convex::cylinder_first_hit(cylinder, DVec3::ZERO, dir, reach)
            && range < reach
        {
            inverse[l] = 1.0 / range.max(1e-300);
            met |= 1 << l;
        }
    }
    met
}
