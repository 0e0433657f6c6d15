//! First-hit ray casting: a yard and rays -> ranges and what was met.
//!
//! In: a [`Scene`] and rays in the `world` frame (unit directions), f64. Out: a [`Hit`] a ray. Sources: curvature-bounded
//! Newton on the polynomial (`series`), Haines 1991 for convex bodies (`convex`). [`Caster`] holds what is computed once a
//! scene, [`Origin`] what is computed once a sweep, because all beams of a sweep leave one point. Ground and bodies are
//! surfaces: a ray that starts below or inside meets them where it leaves. Outside the yard there is no ground.
//! Porous volumes and patches are not met here; the beam effects see to them.

mod cell;
mod convex;
mod march;
mod mesh;
mod newton;
mod packets;
mod polynomial;
mod raster;
mod series;
mod skyline;
mod tree;

use std::borrow::Cow;
use std::sync::OnceLock;

use march::Above;
use mesh::MeshCaster;
use newton::{Block, LANES, Lanes, Near};
use packets::{Packets, Sphere};
use polynomial::PolynomialCaster;
use raster::{RasterCaster, Waiting};
use tree::Tree;

use super::params::Cast;
use crate::cpu::Isa;
use crate::geometry::DVec3;
use crate::scene::{Ground, Raster, Scene};

/// Rays for which a look around pays.
pub(super) const SWEEP_RAYS: usize = 2000;

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, metres; infinite where nothing was met.
    pub range_m: f64,
    /// Id of the obstacle; [`Hit::GROUND`], or [`Hit::NOTHING`].
    pub object: i32,
}

impl Hit {
    pub const GROUND: i32 = -1;
    pub const NOTHING: i32 = -2;
    /// Nothing within reach.
    pub const NONE: Hit = Hit { range_m: f64::INFINITY, object: Hit::NOTHING };
}

/// Where a sensor must not be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inside {
    /// Below the ground, by this much.
    Ground {
        depth_m: f64,
    },
    Obstacle(i32),
}

/// A scene, ready to be cast at.
pub struct Caster<'a> {
    scene: &'a Scene,
    ground: GroundCaster<'a>,
    /// For rays of any origin; a sweep casts none.
    tree: OnceLock<Tree>,
    /// Per obstacle, centre and radius of a sphere that holds it, worked out when a sensor first comes near; none where a mesh holds
    /// the obstacles.
    spheres: Vec<Sphere>,
}

enum GroundCaster<'a> {
    Polynomial(PolynomialCaster<'a>),
    Raster(RasterCaster<'a>),
    /// Ground and obstacles together.
    Mesh(MeshCaster),
}

impl<'a> Caster<'a> {
    /// Prepares a scene: certified bounds of the ground.
    pub fn new(scene: &'a Scene, cast: &Cast) -> Caster<'a> {
        let extent_m = scene.extent_m;
        let ground = match (cast, &scene.ground) {
            (Cast::Exact, Ground::Polynomial(ground)) => {
                GroundCaster::Polynomial(PolynomialCaster::new(ground, extent_m))
            }
            (Cast::Exact, Ground::Raster(raster)) => {
                GroundCaster::Raster(RasterCaster::new(Cow::Borrowed(raster), extent_m))
            }
            (Cast::Raster(sampling), ground) => {
                let raster = Raster::sampled(extent_m, sampling.spacing_m, |x, y| ground.height_m(x, y));
                GroundCaster::Raster(RasterCaster::new(Cow::Owned(raster), extent_m))
            }
            (Cast::Mesh(sampling), _) => GroundCaster::Mesh(MeshCaster::new(scene, sampling.spacing_m)),
        };
        let own = !matches!(ground, GroundCaster::Mesh(_));
        let spheres = scene.obstacles.iter().filter(|_| own).map(|_| Sphere::new()).collect();
        Caster { scene, ground, tree: OnceLock::new(), spheres }
    }

    /// The scene that is cast at.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// What a ray of any origin meets within `max_m`.
    pub fn first_hit(&self, origin: DVec3, dir: DVec3, max_m: f64) -> Hit {
        if !is_ray(origin, dir) {
            return Hit::NONE;
        }
        let ground = match &self.ground {
            GroundCaster::Polynomial(ground) => ground.first_hit(origin, dir, 0.0, max_m),
            GroundCaster::Raster(ground) => ground.first_hit(origin, dir, max_m),
            GroundCaster::Mesh(mesh) => return mesh.first_hit(origin, dir, max_m),
        };
        let hit = ground.map_or(Hit::NONE, |range_m| Hit { range_m, object: Hit::GROUND });
        let tree = self.tree.get_or_init(|| Tree::new(&self.scene.obstacles));
        match tree.first_hit(&self.scene.obstacles, origin, dir, hit.range_m.min(max_m)) {
            Some((range_m, object)) if range_m < hit.range_m => Hit { range_m, object },
            _ => hit,
        }
    }

    /// Prepares a sensor position for rays up to `max_range_m`.
    pub fn from(&self, origin_m: DVec3, max_range_m: f64) -> Origin<'_> {
        let ground = match &self.ground {
            GroundCaster::Polynomial(ground) => match ground.near(origin_m, max_range_m) {
                Some(near) => GroundFrom::Near(Box::new(near), ground),
                None => GroundFrom::Polynomial(ground),
            },
            GroundCaster::Raster(ground) => GroundFrom::Raster(ground, OnceLock::new()),
            GroundCaster::Mesh(mesh) => GroundFrom::Mesh(mesh),
        };
        let packets = Packets::new(&self.scene.obstacles, &self.spheres, origin_m, max_range_m);
        Origin { ground, packets, origin_m, max_range_m }
    }

    /// Outward unit normal of what a ray met at a point; up for nothing.
    pub fn normal_at(&self, object: i32, point_m: DVec3) -> DVec3 {
        match object {
            Hit::GROUND => self.scene.ground.normal(point_m.x, point_m.y),
            Hit::NOTHING => DVec3::Z,
            id => self.scene.obstacles.get(id as usize).map_or(DVec3::Z, |o| convex::normal(&o.shape, point_m)),
        }
    }

    /// Whether a point lies below the ground or in an obstacle, where no sensor can be.
    pub fn inside(&self, point_m: DVec3) -> Option<Inside> {
        let ground = &self.scene.ground;
        let depth_m = ground.height_m(point_m.x, point_m.y) - point_m.z;
        if depth_m > 0.0 && ground.contains(point_m.x, point_m.y) {
            return Some(Inside::Ground { depth_m });
        }
        let near = self.scene.obstacles.iter().filter(|o| !o.is_beyond(point_m.truncate(), 0.0));
        near.filter(|o| convex::contains(&o.shape, point_m)).map(|o| Inside::Obstacle(o.id)).next()
    }
}

/// A sensor position in a scene, ready to be cast from.
pub struct Origin<'a> {
    ground: GroundFrom<'a>,
    packets: Packets,
    origin_m: DVec3,
    max_range_m: f64,
}

enum GroundFrom<'a> {
    /// An expansion about the sensor, and the ground itself for what lies beyond its reach.
    Near(Box<Near>, &'a PolynomialCaster<'a>),
    Polynomial(&'a PolynomialCaster<'a>),
    /// The ground, and how the sensor stands above it: looked at when a sweep is cast, not for a few rays.
    Raster(&'a RasterCaster<'a>, OnceLock<Option<Above>>),
    Mesh(&'a MeshCaster),
}

impl Origin<'_> {
    /// Casts rays in world unit directions; `hits` is overwritten, one entry a ray.
    pub fn cast(&self, dirs: &[DVec3], hits: &mut Vec<Hit>) {
        hits.clear();
        if let GroundFrom::Mesh(mesh) = &self.ground {
            hits.extend(dirs.iter().map(|&dir| {
                if is_ray(self.origin_m, dir) {
                    mesh.first_hit(self.origin_m, dir, self.max_range_m)
                } else {
                    Hit::NONE
                }
            }));
            return;
        }
        if let GroundFrom::Raster(ground, above) = &self.ground
            && dirs.len() >= SWEEP_RAYS
        {
            above.get_or_init(|| Above::new(ground, self.origin_m, self.max_range_m));
        }
        hits.reserve(dirs.len());
        cast_blocks(self, dirs, hits);
    }

    #[inline(always)]
    fn blocks<const N: usize>(&self, dirs: &[DVec3], hits: &mut Vec<Hit>) {
        let mut block = Block::new();
        let mut waiting = Waiting::default();
        let (whole, rest) = dirs.as_chunks::<LANES>();
        let padded: [DVec3; LANES] = std::array::from_fn(|l| *rest.get(l).or(rest.last()).unwrap_or(&DVec3::Z));
        let last = (!rest.is_empty()).then_some((&padded, rest.len()));
        for (rays, count) in whole.iter().map(|rays| (rays, LANES)).chain(last) {
            self.ground_block::<N>(rays, count, &mut block, &mut waiting);
            let mut inverse = [0.0; LANES];
            let mut objects = [Hit::NOTHING; LANES];
            for l in 0..LANES {
                let met = block.range_m[l] < f64::INFINITY;
                inverse[l] = 1.0 / if met { block.range_m[l] } else { self.max_range_m };
                objects[l] = if met { Hit::GROUND } else { Hit::NOTHING };
            }
            if !self.packets.is_empty() {
                self.packets.solve(rays, &mut inverse, &mut objects);
            }
            hits.extend((0..count).map(|l| Hit {
                range_m: if objects[l] >= 0 { 1.0 / inverse[l] } else { block.range_m[l] },
                object: objects[l],
            }));
        }
    }

    /// The ground's part of a block: `block.range_m`.
    #[inline(always)]
    fn ground_block<const N: usize>(
        &self,
        dirs: &[DVec3; LANES],
        count: usize,
        block: &mut Block,
        waiting: &mut Waiting,
    ) {
        match &self.ground {
            GroundFrom::Near(near, ground) if N > 0 => {
                newton::solve::<N>(near, dirs, self.max_range_m, block);
                for (l, &dir) in dirs.iter().enumerate().take(count) {
                    self.finish_ray(near, ground, dir, l, block);
                }
            }
            _ if N > 0 => unreachable!("a degree belongs to an expansion"),
            GroundFrom::Polynomial(ground) => self.each(dirs, count, &mut block.range_m, |dir| {
                ground.first_hit(self.origin_m, dir, 0.0, self.max_range_m)
            }),
            GroundFrom::Raster(ground, above) => match above.get() {
                Some(Some(above)) => above.solve(ground, dirs, self.max_range_m, &mut block.range_m),
                _ => self.each(dirs, count, &mut block.range_m, |dir| {
                    ground.first_hit_with(waiting, self.origin_m, dir, self.max_range_m)
                }),
            },
            GroundFrom::Near(..) | GroundFrom::Mesh(_) => block.range_m = [f64::INFINITY; LANES],
        }
    }

    #[inline(always)]
    fn each(
        &self,
        dirs: &[DVec3; LANES],
        count: usize,
        ranges: &mut Lanes,
        mut first_hit: impl FnMut(DVec3) -> Option<f64>,
    ) {
        for l in 0..count {
            let met = if is_ray(self.origin_m, dirs[l]) { first_hit(dirs[l]) } else { None };
            ranges[l] = met.unwrap_or(f64::INFINITY);
        }
    }

    /// What the block left open: a ray that did not settle, and the way beyond the expansion's reach.
    #[inline(always)]
    fn finish_ray(&self, near: &Near, ground: &PolynomialCaster, dir: DVec3, l: usize, block: &mut Block) {
        if !block.stuck_m[l].is_nan() {
            let series = block.series.map(|coefficient| coefficient[l]);
            let settled = series::first_crossing(&series, near.degree, block.stuck_m[l], block.end_m[l]);
            block.range_m[l] = settled.unwrap_or(f64::INFINITY);
        }
        let beyond = block.range_m[l] == f64::INFINITY && block.end_m[l] == near.reach_m;
        if beyond && near.reach_m < self.max_range_m && is_ray(self.origin_m, dir) {
            let beyond = ground.first_hit(self.origin_m, dir, near.reach_m, self.max_range_m);
            block.range_m[l] = beyond.unwrap_or(f64::INFINITY);
        }
    }
}

/// Whether there is a ray at all: finite, and with a direction.
fn is_ray(origin: DVec3, dir: DVec3) -> bool {
    origin.is_finite() && dir.is_finite() && dir != DVec3::ZERO
}

/// Casts with the widest vectors of the machine; every choice gives the same bits.
#[allow(unsafe_code)]
fn cast_blocks(origin: &Origin, dirs: &[DVec3], hits: &mut Vec<Hit>) {
    let degree = if let GroundFrom::Near(near, _) = &origin.ground { near.degree.max(1) } else { 0 };
    match Isa::detect() {
        // SAFETY: `detect` gave this set because the machine has it.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => unsafe { cast_avx512(degree, origin, dirs, hits) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => unsafe { cast_avx2(degree, origin, dirs, hits) },
        _ => cast_of_degree(degree, origin, dirs, hits),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx2,fma")]
fn cast_avx512(degree: usize, origin: &Origin, dirs: &[DVec3], hits: &mut Vec<Hit>) {
    cast_of_degree(degree, origin, dirs, hits);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn cast_avx2(degree: usize, origin: &Origin, dirs: &[DVec3], hits: &mut Vec<Hit>) {
    cast_of_degree(degree, origin, dirs, hits);
}

/// One loop a degree, so that each is unrolled; lower degrees are padded with zeros. Degree 0 is a ground without an expansion.
#[inline(always)]
fn cast_of_degree(degree: usize, origin: &Origin, dirs: &[DVec3], hits: &mut Vec<Hit>) {
    match degree {
        0 => origin.blocks::<0>(dirs, hits),
        1..=3 => origin.blocks::<3>(dirs, hits),
        4..=5 => origin.blocks::<5>(dirs, hits),
        6..=8 => origin.blocks::<8>(dirs, hits),
        _ => origin.blocks::<12>(dirs, hits),
    }
}

#[cfg(test)]
mod tests;
