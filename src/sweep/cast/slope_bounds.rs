//! How high a raster ground stands around one sensor: sectors of azimuth, rings of distance, a certified bound in each.
//!
//! In: a [`RasterCaster`] and a sensor above its ground. Out: where along a ray its first crossing can lie at the earliest.
//! A ray from the sensor keeps one slope tan e = dz / d, d its horizontal distance; it is above the ground as long as that
//! exceeds (h - z) / d. Each sector and ring holds an upper bound of (h - z) / d over its part of the yard: under a plane
//! z + p + east x + north y the bound is p / d + (slope of the plane along the azimuth), so that a tilted plane costs nothing.
//! Planes and how far nodes rise above them come from the pyramid, for blocks with the cells around them. The first ring whose
//! running maximum reaches a ray's slope is where its search begins; what lies before it cannot be met. All bounds are rounded up.

use super::diamond_angle::{at_turn, turn_of};
use super::newton::larger;
use super::pyramid::AROUND_LEVELS;
use super::raster::{RasterCaster, RasterView};
use crate::geometry::{DVec2, DVec3};
use crate::wide::{self, Work};

/// Sectors of the turn.
const SECTORS: usize = 256;
/// Margin of azimuths and slopes: far above the rounding of either.
const MARGIN: f64 = 1e-9;

/// Certified slopes around a sensor.
pub(super) struct SlopeBounds {
    /// Border distances of the rings, metres: one more than there are rings.
    borders_m: Vec<f64>,
    /// Per sector `stride` slopes: those of the rings, then infinities.
    upper: Vec<f32>,
    /// Their running maxima.
    reached: Vec<f32>,
    /// Entries a sector: a power of two above the number of rings.
    stride: usize,
}

/// One ring.
struct DistanceBand {
    middle_m: f64,
    /// 1 / distance of its borders: the nearer first.
    per_m: [f64; 2],
    /// Blocks of this level, with what is around them, cover any of its bins; `None` where no level does.
    level: Option<usize>,
    /// How far a bin reaches from its middle, cells.
    radius: f64,
}

impl SlopeBounds {
    /// The slope bounds of a sensor in the yard and above its ground, as far as its rays reach.
    pub(super) fn new(ground: &RasterCaster, origin: DVec3, reach_m: f64) -> SlopeBounds {
        let rays = sector_rays();
        let half = rays.iter().map(|ray| ray.half).fold(0.0, larger);
        let view = ground.view(origin);
        let borders_m = borders(ground.farthest_m(origin).min(reach_m), 1.0 / view.per_m, half);
        let rings: Vec<DistanceBand> = borders_m
            .windows(2)
            .map(|ring| {
                let radius = (0.5 * (ring[1] - ring[0]) + ring[1] * half) * view.per_m * (1.0 + MARGIN);
                // A block of 2^(n + 1) cells has 2^n around it.
                let level = (0..AROUND_LEVELS).find(|&n| radius <= f64::from(1u32 << n));
                DistanceBand {
                    middle_m: 0.5 * (ring[0] + ring[1]),
                    per_m: [1.0 / ring[0], 1.0 / ring[1]],
                    level,
                    radius,
                }
            })
            .collect();
        let count = rings.len();
        let stride = (count + 1).next_power_of_two();
        let upper = wide::widest(SteepestSights { ground, view: &view, rays: &rays, rings: &rings, stride });
        let mut reached = upper.clone();
        for sector in reached.chunks_exact_mut(stride) {
            let mut most = f32::NEG_INFINITY;
            for slope in sector {
                most = if *slope > most { *slope } else { most };
                *slope = most;
            }
        }
        SlopeBounds { borders_m, upper, reached, stride }
    }

    /// Where a direction's sector begins in the tables.
    #[inline(always)]
    pub(super) fn sector(&self, x: f64, y: f64) -> usize {
        // A vertical ray has no azimuth: NaN, and any sector serves.
        ((turn_of(x, y) * SECTORS as f64) as usize).min(SECTORS - 1) * self.stride
    }

    /// The first ring in which a ray of a slope can meet the ground; infinite distance where there is none.
    #[inline(always)]
    pub(super) fn first_ring(&self, sector: usize, slope: f32) -> usize {
        let sector = &self.reached[sector..sector + self.stride];
        let (mut ring, mut half) = (0, self.stride / 2);
        while half > 0 {
            ring += if sector[ring + half - 1] < slope { half } else { 0 };
            half /= 2;
        }
        ring
    }

    /// Distance at which a ring begins, a hair towards the sensor; infinite beyond the last.
    #[inline(always)]
    pub(super) fn begins_m(&self, ring: usize) -> f64 {
        if ring + 1 < self.borders_m.len() { self.borders_m[ring] * (1.0 - MARGIN) } else { f64::INFINITY }
    }

    /// The distance from which on a ray that is at `distance_m` and above the ground can meet it next.
    pub(super) fn next_m(&self, sector: usize, slope: f32, distance_m: f64) -> f64 {
        let here = self.borders_m.partition_point(|&border| border <= distance_m).saturating_sub(1);
        let ahead = self.upper[sector + here..sector + self.stride].iter().position(|&upper| upper >= slope);
        let begins_m = ahead.map_or(f64::INFINITY, |skipped| self.begins_m(here + skipped));
        if begins_m > distance_m { begins_m } else { distance_m }
    }
}

/// The middle of a sector.
pub(super) struct SectorRay {
    pub dir: DVec2,
    /// Half its width, radians.
    pub half: f64,
}

fn sector_rays() -> Vec<SectorRay> {
    let border = |sector: usize| at_turn(sector as f64 / SECTORS as f64);
    (0..SECTORS)
        .map(|sector| {
            let (from, to) = (border(sector), border(sector + 1));
            let dir = (from + to).normalize();
            let sine = from.perp_dot(dir).abs();
            // asin s < s + s^3 for the small s of a sector.
            SectorRay { dir, half: sine * (1.0 + sine * sine) + MARGIN }
        })
        .collect()
}

/// Rings two cells wide; from where the sectors are wider than that, as wide as these. Finer rings and sectors cost more to bound
/// than they save on the way.
fn borders(last_m: f64, cell_m: f64, half_sector: f64) -> Vec<f64> {
    let mut borders_m = vec![0.0];
    let mut border_m = 0.0;
    while border_m < last_m {
        border_m += larger(2.0 * cell_m, 2.0 * border_m * half_sector);
        borders_m.push(border_m);
    }
    borders_m
}

/// The upper bounds of all bins, by sector; infinities behind a sector's rings.
struct SteepestSights<'a> {
    ground: &'a RasterCaster<'a>,
    view: &'a RasterView,
    rays: &'a [SectorRay],
    rings: &'a [DistanceBand],
    stride: usize,
}

impl Work for SteepestSights<'_> {
    type Out = Vec<f32>;

    #[inline(always)]
    fn run(self) -> Vec<f32> {
        let mut upper = vec![f32::INFINITY; SECTORS * self.stride];
        for (ray, sector) in self.rays.iter().zip(upper.chunks_exact_mut(self.stride)) {
            for (slope, ring) in sector.iter_mut().zip(self.rings) {
                *slope = steepest_sight(self.ground, self.view, ray, ring);
            }
        }
        upper
    }
}

/// Upper bound of (h - z) / d over one bin.
#[inline(always)]
fn steepest_sight(ground: &RasterCaster, view: &RasterView, ray: &SectorRay, ring: &DistanceBand) -> f32 {
    let Some(level) = ring.level else { return f32::INFINITY };
    let middle = ring.middle_m * view.per_m;
    let (col, row) = (ray.dir.x.mul_add(middle, view.x), ray.dir.y.mul_add(middle, view.y));
    let [x, y] = view.yard;
    let out = larger(larger(x[0] - col, col - x[1]), larger(y[0] - row, row - y[1]));
    // Points of the bin that lie in the yard are no farther from the yard's point nearest to the middle than from the middle.
    let [east, north, over] = ground.sight_around(level, col, row, view);
    let azimuth = east.mul_add(ray.dir.x, north * ray.dir.y) + (east.abs() + north.abs()) * ray.half;
    let sight = if over > 0.0 { over * ring.per_m[0] } else { over * ring.per_m[1] };
    let steepest = azimuth.mul_add(view.per_m, sight) + MARGIN * (1.0 + sight.abs());
    if out > ring.radius { f32::NEG_INFINITY } else { (steepest as f32).next_up() }
}
