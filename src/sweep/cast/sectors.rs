//! Which bodies a block of rays may meet: lists by sectors of azimuth, compared sixteen bodies at a time.
//!
//! In: the cones in which a sensor sees bodies, the directions of a block's rays. Out: the bodies that the block cannot pass by,
//! nearest first. A block is held by a cone and, as a scanner's line sweeps a plane, by a slab about the plane of its first and last
//! ray; a body whose cone leaves either is passed by. All in single precision with more slack than it rounds: too much may be let
//! through, never too little.
//!
//! The lists form a tree, the whole turn at its root; each is drawn from the one above it when a block first asks for it.

use std::cell::OnceCell;

use super::diamond_angle::{at_turn, turn_of};
use super::newton::{Dirs, LANES, each, larger, smaller};
use crate::geometry::DVec3;

/// Sectors of the turn, level by level: the whole turn, one level that is drawn from it, and multiples of that, drawn from it in turn.
/// Each sector's list holds the bodies in it and in the sectors beside it, so that a block which spills over a border still finds
/// all in one list.
const LEVELS: [usize; 7] = [1, 16, 32, 48, 64, 96, 128];
/// Bodies compared at a time: the lanes of the widest registers.
const CHUNK: usize = 16;
/// Up to so many chunks are walked as they are.
const FEW: usize = 2;
/// Cosine of the half angle from which on a block is wide.
const WIDE_COS: f32 = 0.9;
/// More than single precision rounds in the sums below, whose terms are at most 1.
const SLACK: f32 = 2e-6;

/// The directions in which a body is seen: about a unit vector, by its half angle.
#[derive(Clone, Copy)]
pub(super) struct Cone {
    axis: [f32; 3],
    sin: f32,
    cos: f32,
}

/// Cones side by side.
pub(super) struct Chunk {
    axis: [[f32; CHUNK]; 3],
    sin: [f32; CHUNK],
    cos: [f32; CHUNK],
    /// Places of the bodies in their order by distance.
    pub rank: [u32; CHUNK],
    /// Distance of the first, which is the least.
    pub nearest: f64,
}

/// What a block of rays covers.
pub(super) struct BlockCone {
    cone: Cone,
    /// Unit normal of the plane of its first and last ray, and the greatest cosine between it and a ray.
    normal: [f32; 3],
    off: f32,
}

/// Lists of bodies, nearest first.
pub(super) struct Sectors {
    /// Level by level.
    lists: Vec<OnceCell<Vec<Chunk>>>,
}

impl Cone {
    /// What holds every direction: all tests below let it through.
    const ALL: Cone = Cone { axis: [0.0; 3], sin: 8.0, cos: -4.0 };

    pub(super) fn of_sphere(centre: DVec3, radius: f64) -> Cone {
        let distance = centre.length();
        let sin = radius / distance;
        if sin >= 1.0 {
            return Cone::ALL;
        }
        let axis = centre / distance;
        Cone { axis: axis.to_array().map(|c| c as f32), sin: sin as f32, cos: (1.0 - sin * sin).sqrt() as f32 }
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Chunk {
    const EMPTY: Chunk =
        Chunk { axis: [[f32::NAN; CHUNK]; 3], sin: [0.0; CHUNK], cos: [0.0; CHUNK], rank: [0; CHUNK], nearest: 0.0 };

    #[inline(always)]
    fn cone(&self, k: usize) -> Cone {
        Cone { axis: [self.axis[0][k], self.axis[1][k], self.axis[2][k]], sin: self.sin[k], cos: self.cos[k] }
    }

    /// One bit a body that passes a test; none for the places that are not taken, whose axes are NaN.
    #[inline(always)]
    fn bits(&self, test: impl Fn(Cone) -> bool) -> u32 {
        let mut bits = 0;
        for k in 0..CHUNK {
            bits |= u32::from(test(self.cone(k))) << k;
        }
        bits
    }

    /// The bodies that may be in view.
    #[inline(always)]
    pub(super) fn in_view(&self, view: &BlockCone) -> u32 {
        self.bits(|cone| {
            // The axes are no farther apart than the sum of the half angles: cos(a + b) = cos a cos b - sin a sin b.
            let apart = dot(cone.axis, view.cone.axis) - cone.cos * view.cone.cos + cone.sin * view.cone.sin;
            (apart >= -SLACK) & (dot(cone.axis, view.normal).abs() <= cone.sin + view.off)
        })
    }
}

/// Bodies in rows of chunks.
fn chunked(bodies: impl Iterator<Item = (u32, Cone)>, nearest: impl Fn(u32) -> f64) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    let mut k = CHUNK;
    for (rank, cone) in bodies {
        if k == CHUNK {
            chunks.push(Chunk { nearest: nearest(rank), ..Chunk::EMPTY });
            k = 0;
        }
        let Some(chunk) = chunks.last_mut() else { break };
        (0..3).for_each(|c| chunk.axis[c][k] = cone.axis[c]);
        (chunk.sin[k], chunk.cos[k], chunk.rank[k]) = (cone.sin, cone.cos, rank);
        k += 1;
    }
    chunks
}

impl Sectors {
    /// In: the bodies' cones, nearest first; `nearest` gives a body's distance.
    pub(super) fn new(cones: impl Iterator<Item = Cone>, nearest: impl Fn(u32) -> f64) -> Sectors {
        let lists: Vec<_> = (0..LEVELS.iter().sum()).map(|_| OnceCell::new()).collect();
        _ = lists[0].set(chunked((0..).zip(cones), nearest));
        Sectors { lists }
    }

    /// All that a block can meet.
    #[inline(always)]
    pub(super) fn list(&self, view: &BlockCone, nearest: impl Fn(u32) -> f64) -> &[Chunk] {
        let [whole, ..] = &self.lists[..] else { return &[] };
        match whole.get() {
            Some(whole) if whole.len() <= FEW => return whole,
            _ => {}
        }
        let (level, sector) = sector_of(view.cone);
        match self.lists[place(level, sector)].get() {
            Some(list) => list,
            None => self.drawn(level, sector, &nearest),
        }
    }

    /// A sector's list, drawn from the list of the sector that holds it.
    #[inline(never)]
    fn drawn(&self, level: usize, sector: usize, nearest: &impl Fn(u32) -> f64) -> &[Chunk] {
        self.lists[place(level, sector)].get_or_init(|| {
            let above = usize::from(level > 1);
            let from = self.drawn(above, sector * LEVELS[above] / LEVELS[level], nearest);
            // Between two upright planes through the sensor, each by its normal into the window.
            let border = |sectors_on: f64| {
                let turn = (sector as f64 + sectors_on) / LEVELS[level] as f64;
                at_turn(turn - turn.floor()).perp()
            };
            let (after, before) = (border(-1.0), -border(2.0));
            let normals = [after, before].map(|n| n.extend(0.0).to_array().map(|c| c as f32));
            let inside = from.iter().flat_map(|chunk| {
                let bits = chunk.bits(|cone| {
                    let [after, before] = normals.map(|normal| dot(cone.axis, normal) >= -cone.sin - SLACK);
                    after & before
                });
                (0..CHUNK).filter(move |k| bits >> k & 1 != 0).map(|k| (chunk.rank[k], chunk.cone(k)))
            });
            chunked(inside, nearest)
        })
    }
}

/// Where a sector's list is among all.
#[inline(always)]
fn place(level: usize, sector: usize) -> usize {
    const BEFORE: [usize; LEVELS.len()] = {
        let mut before = [0; LEVELS.len()];
        let mut level = 1;
        while level < LEVELS.len() {
            before[level] = before[level - 1] + LEVELS[level - 1];
            level += 1;
        }
        before
    };
    BEFORE[level] + sector
}

impl BlockCone {
    /// Where a block's first or last ray is senseless, or its rays go all round.
    const ALL: BlockCone = BlockCone { cone: Cone { axis: [0.0; 3], sin: 1.0, cos: -1.0 }, normal: [0.0; 3], off: 0.0 };

    /// Whether the block is less a bundle than several.
    #[inline(always)]
    pub(super) fn is_wide(&self) -> bool {
        self.cone.cos < WIDE_COS
    }

    /// What a block of rays covers.
    #[inline(always)]
    pub(super) fn of(dirs: Dirs) -> BlockCone {
        let ray = |l: usize| DVec3::new(dirs.x[l], dirs.y[l], dirs.z[l]);
        let along = |v: DVec3| each(|l| dirs.x[l] * v.x + dirs.y[l] * v.y + dirs.z[l] * v.z);
        let (first, last) = (ray(0), ray(LANES - 1));
        let axis = first + last;
        let axis = axis / axis.length();
        // A senseless ray (NaN) must not hide its neighbours.
        let cos = of_all(&along(axis).map(|cos| smaller(cos, 1.0)), smaller);
        let sin = (1.0 - cos * cos).sqrt();
        if !axis.is_finite() || cos.is_nan() || cos <= 0.0 {
            return BlockCone::ALL;
        }
        let normal = first.cross(last);
        let length = normal.length();
        // Rays on one line: any plane will do, and none holds all.
        let normal = if length > 0.0 { normal / length } else { DVec3::ZERO };
        let off = of_all(&along(normal).map(|cos| larger(cos.abs(), 0.0)), larger);
        let single = |v: DVec3| v.to_array().map(|c| c as f32);
        let cone = Cone { axis: single(axis), sin: sin as f32, cos: cos as f32 };
        BlockCone { cone, normal: single(normal), off: off as f32 + SLACK }
    }
}

/// The finest level and sector whose list holds all that a cone can meet.
#[inline(always)]
fn sector_of(cone: Cone) -> (usize, usize) {
    // Sine of half the azimuths that the cone covers; asin s < s (1 + s^2 / 4) up to 1/2; a quarter turn a radian at most.
    let [x, y] = [cone.axis[0], cone.axis[1]].map(f64::from);
    let half = f64::from(cone.sin) / (x * x + y * y).sqrt();
    if half < 0.5 {
        let half = 0.25 * half * (1.0 + 0.25 * half * half);
        // The middle is in the sector; a sector's width on either side of it is in its list.
        let level = LEVELS.iter().skip(1).filter(|&&sectors| half * sectors as f64 <= 1.0).count();
        let count = LEVELS[level];
        return (level, ((turn_of(x, y) * count as f64) as usize).min(count - 1));
    }
    (0, 0)
}

/// The least or the greatest of a block, half onto half: a chain of sixteen comparisons takes longer than the tests it saves.
#[inline(always)]
pub(super) fn of_all<const N: usize>(lanes: &[f64; N], pick: impl Fn(f64, f64) -> f64) -> f64 {
    let mut lanes = *lanes;
    let mut half = N / 2;
    while half > 0 {
        for l in 0..half {
            lanes[l] = pick(lanes[l], lanes[l + half]);
        }
        half /= 2;
    }
    lanes[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;

    /// A sector's list holds what lies in it and in both beside it: all azimuths of the cone must lie there.
    #[test]
    fn law_the_sector_of_a_cone_and_its_neighbours_hold_its_azimuths() {
        for k in 0..64 {
            let (sin_turn, cos_turn) = math::sin_cos(std::f64::consts::TAU * (f64::from(k) + 0.3) / 64.0);
            for level_share in [1.0, 0.8, 0.3] {
                for step in 1..400 {
                    let sine = f64::from(step) / 400.0;
                    let axis =
                        [level_share * cos_turn, level_share * sin_turn, (1.0 - level_share * level_share).sqrt()];
                    let cos = (1.0 - sine * sine).sqrt();
                    let cone = Cone { axis: axis.map(|x| x as f32), sin: sine as f32, cos: cos as f32 };
                    let (level, sector) = sector_of(cone);
                    if level == 0 {
                        continue;
                    }
                    assert!(sine < level_share, "a cone around the zenith has all azimuths");
                    let half = math::asin(sine / level_share);
                    let count = LEVELS[level] as f64;
                    for side in [-half, 0.0, half] {
                        let azimuth = math::atan2(sin_turn, cos_turn) + side;
                        let turn = turn_of(math::cos(azimuth), math::sin(azimuth));
                        let sectors_on = (turn * count - sector as f64 + 1.0).rem_euclid(count);
                        assert!(sectors_on < 3.0 + 1e-4, "{axis:?} {sine}: sector {sector} of {count}, turn {turn}");
                    }
                }
            }
        }
    }
}
