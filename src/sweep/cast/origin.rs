//! A sweep: rays of one point, block by block -> hits.
//!
//! In: what a [`Caster`](super::Caster) knows of ground and obstacles, a sensor position, and unit directions. Out: a [`Hit`] a ray. The
//! ground is met first; the obstacles then shorten the ranges.

use std::sync::OnceLock;

use super::march::HorizonProfile;
use super::mesh::MeshCaster;
use super::newton::{self, Block, Dirs, LANES, Lanes, LocalSeries, each, smaller};
use super::packets::Packets;
use super::polynomial::PolynomialCaster;
use super::raster::{MarchStack, RasterCaster};
use super::{Hit, is_ray, series};
use crate::geometry::DVec3;
use crate::wide::{self, Work};

/// Rays for which a look around pays.
pub(in crate::sweep) const SWEEP_RAYS: usize = 2000;
/// Blocks whose directions are parted into components at a time.
const BLOCKS: usize = 32;

/// A sensor position in a scene, ready to be cast from.
pub struct Origin<'a> {
    pub(super) ground: GroundFrom<'a>,
    /// None where no obstacle is in reach.
    pub(super) packets: Option<Packets<'a>>,
    pub(super) origin_m: DVec3,
    pub(super) max_range_m: f64,
}

pub(super) enum GroundFrom<'a> {
    /// An expansion about the sensor, and the ground itself for what lies beyond its reach.
    LocalSeries(Box<LocalSeries>, &'a PolynomialCaster<'a>),
    Polynomial(&'a PolynomialCaster<'a>),
    /// The ground, and how the sensor stands above it: looked at when a sweep is cast, not for a few rays.
    Raster(&'a RasterCaster<'a>, OnceLock<Option<HorizonProfile>>),
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
            above.get_or_init(|| HorizonProfile::new(ground, self.origin_m, self.max_range_m));
        }
        hits.reserve(dirs.len());
        wide::widest(CastBlocks { origin: self, dirs, hits });
    }

    #[inline(always)]
    fn blocks<const N: usize>(&self, dirs: &[DVec3], hits: &mut Vec<Hit>) {
        let mut block = Block::new();
        let mut waiting = MarchStack::default();
        let mut parted = [[[0.0; LANES]; BLOCKS]; 3];
        for rays in dirs.chunks(BLOCKS * LANES) {
            part(rays, &mut parted);
            let [x, y, z] = &parted;
            for (k, rays) in rays.chunks(LANES).enumerate() {
                let dirs = Dirs { x: &x[k], y: &y[k], z: &z[k] };
                self.ground_block::<N>(dirs, rays, &mut block, &mut waiting);
                let mut inverse = each(|l| 1.0 / smaller(block.range_m[l], self.max_range_m));
                let mut objects =
                    block.range_m.map(|range_m| if range_m < f64::INFINITY { Hit::GROUND } else { Hit::NOTHING });
                if let Some(packets) = &self.packets {
                    packets.solve(dirs, &mut inverse, &mut objects);
                }
                hits.extend((0..rays.len()).map(|l| Hit {
                    range_m: if objects[l] >= 0 { 1.0 / inverse[l] } else { block.range_m[l] },
                    object: objects[l],
                }));
            }
        }
    }

    /// The ground's part of a block: `block.range_m`. `rays` are the directions without what fills the block up.
    #[inline(always)]
    fn ground_block<const N: usize>(&self, dirs: Dirs, rays: &[DVec3], block: &mut Block, waiting: &mut MarchStack) {
        match &self.ground {
            GroundFrom::LocalSeries(near, ground) if N > 0 => {
                newton::solve::<N>(near, dirs, self.max_range_m, block);
                self.finish_rays(near, ground, rays, block);
            }
            _ if N > 0 => unreachable!("a degree belongs to an expansion"),
            GroundFrom::Polynomial(ground) => {
                self.each(rays, &mut block.range_m, |dir| ground.first_hit(self.origin_m, dir, 0.0, self.max_range_m))
            }
            GroundFrom::Raster(ground, above) => match above.get() {
                Some(Some(above)) => {
                    let dirs = std::array::from_fn(|l| DVec3::new(dirs.x[l], dirs.y[l], dirs.z[l]));
                    above.solve(ground, &dirs, self.max_range_m, &mut block.range_m);
                }
                _ => self.each(rays, &mut block.range_m, |dir| {
                    ground.first_hit_with(waiting, self.origin_m, dir, self.max_range_m)
                }),
            },
            GroundFrom::LocalSeries(..) | GroundFrom::Mesh(_) => block.range_m = [f64::INFINITY; LANES],
        }
    }

    #[inline(always)]
    fn each(&self, rays: &[DVec3], ranges: &mut Lanes, mut first_hit: impl FnMut(DVec3) -> Option<f64>) {
        for (range, &dir) in ranges.iter_mut().zip(rays) {
            let met = if is_ray(self.origin_m, dir) { first_hit(dir) } else { None };
            *range = met.unwrap_or(f64::INFINITY);
        }
    }

    /// What the block left open: rays that did not settle, and the way beyond the expansion's reach.
    #[inline(always)]
    fn finish_rays(&self, near: &LocalSeries, ground: &PolynomialCaster, rays: &[DVec3], block: &mut Block) {
        let farther = near.reach_m < self.max_range_m;
        let mut open = 0u32;
        for l in 0..LANES {
            let beyond = (block.range_m[l] == f64::INFINITY) & (block.end_m[l] == near.reach_m) & farther;
            open |= u32::from(beyond | !block.stuck_m[l].is_nan());
        }
        if open == 0 {
            return;
        }
        for (l, &dir) in rays.iter().enumerate() {
            if !block.stuck_m[l].is_nan() {
                let series = block.series.map(|coefficient| coefficient[l]);
                let settled = series::first_crossing(&series, near.degree, block.stuck_m[l], block.end_m[l]);
                block.range_m[l] = settled.unwrap_or(f64::INFINITY);
            }
            let beyond = block.range_m[l] == f64::INFINITY && block.end_m[l] == near.reach_m;
            if beyond && farther && is_ray(self.origin_m, dir) {
                let beyond = ground.first_hit(self.origin_m, dir, near.reach_m, self.max_range_m);
                block.range_m[l] = beyond.unwrap_or(f64::INFINITY);
            }
        }
    }
}

/// Directions by component, block by block; the last block is filled up with the last ray. One loop over many rays: sixteen alone
/// would be gathered number by number.
#[inline(always)]
fn part(rays: &[DVec3], parted: &mut [[Lanes; BLOCKS]; 3]) {
    let [x, y, z] = parted.each_mut().map(|blocks| blocks.as_flattened_mut());
    for (((ray, x), y), z) in rays.iter().zip(&mut *x).zip(&mut *y).zip(&mut *z) {
        (*x, *y, *z) = (ray.x, ray.y, ray.z);
    }
    let last = rays.last().unwrap_or(&DVec3::Z);
    for l in rays.len()..rays.len().next_multiple_of(LANES) {
        (x[l], y[l], z[l]) = (last.x, last.y, last.z);
    }
}

/// Casts a list of directions, in the machine's widest form.
pub(super) struct CastBlocks<'a> {
    pub(super) origin: &'a Origin<'a>,
    pub(super) dirs: &'a [DVec3],
    pub(super) hits: &'a mut Vec<Hit>,
}

impl Work for CastBlocks<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let CastBlocks { origin, dirs, hits } = self;
        let degree = if let GroundFrom::LocalSeries(near, _) = &origin.ground { near.degree.max(1) } else { 0 };
        cast_of_degree(degree, origin, dirs, hits);
    }
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
