//! Rays among grass, bushes and crowns -> where the light truly turned back.
//!
//! In: solid first hits, patches and porous volumes, one stream each. Out: the same returns, moved.
//!
//! Patches: a return from the ground of a patch gets a height above the ground, and so moves along its ray until it has that height
//! (to first order in the ground's slope), no farther than the edge of the patch. Source: Hewitt et al. 2017, "added variance on
//! measurements from designated areas": N(0, sigma), `height_law: normal`, which puts half of the returns below the ground. Deviation, and
//! the default: |N(0, sigma)|, blades on ground that light does not enter; sigma is then the root mean square height above the ground.
//! Where patches overlap, a return is that of the one that makes a label, brush before grass, and of two alike the first one's.
//! Not modelled: blades that stop a ray on its way to something beyond the patch; what stands where a return below the ground comes to lie.
//!
//! Volumes: a ray travels an exponential optical depth (Macedo et al. 2000: free path ~ Exp(extinction)) and returns where it
//! is used up, if that lies before the solid hit. One draw a ray serves all volumes it crosses; where volumes overlap their
//! extinctions add, and the return is the denser one's (of two alike, the lower id's).
//!
//! The sub-rays of a beam share its draws: a footprint is narrower than a tuft, and so switching sub-rays on leaves the
//! scatter of foliage as it was.

use super::TrueReturn;
use super::cast::{Caster, Hit};
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::random::Stream;
use crate::scene::params::HeightLaw;
use crate::scene::{Patch, Scene, Volume};

/// Rays are looked at in blocks of this many, so that most are dismissed without a test of their own.
pub(super) const BLOCK: usize = 32;

/// The vegetation that a sweep can reach, and room for a block's draws.
#[derive(Debug, Default)]
pub(super) struct Vegetation {
    patches: Vec<Patch>,
    volumes: Vec<NearVolume>,
    /// Volumes that a block of rays may touch.
    touched: Vec<usize>,
    /// Parts of one ray inside volumes: (entry, exit, volume), metres.
    spans: Vec<(f64, f64, usize)>,
    borders: Vec<f64>,
}

/// A volume with the cone that holds it as seen from the sensor.
#[derive(Clone, Copy, Debug)]
struct NearVolume {
    volume: Volume,
    toward: DVec3,
    /// Cosine and sine of the cone's half angle; `None` where the sensor is inside the bounding sphere.
    cone: Option<(f64, f64)>,
}

/// A run of rays of one origin, and the addresses of their draws.
pub(super) struct Rays<'a> {
    pub origin_m: DVec3,
    pub directions: &'a [DVec3],
    pub draws: Draws,
}

/// Where a block's draws stand in their stream.
#[derive(Clone, Copy, Debug)]
pub(super) enum Draws {
    /// One a ray, from this index on.
    From(u64),
    /// One for all: the sub-rays of one beam.
    Shared(u64),
}

impl Draws {
    fn uniform(self, stream: &Stream, out: &mut [f64]) {
        match self {
            Draws::From(first_index) => stream.fill_uniform(first_index, out),
            Draws::Shared(index) => out.fill(stream.uniform(index)),
        }
    }

    fn normal(self, stream: &Stream, out: &mut [f64]) {
        match self {
            Draws::From(first_index) => stream.fill_normal(first_index, out),
            Draws::Shared(index) => out.fill(stream.normal(index)),
        }
    }
}

impl Vegetation {
    /// Takes the part of the scene's vegetation that lies within reach.
    pub(super) fn reach(&mut self, scene: &Scene, origin_m: DVec3, reach_m: f64) {
        let near_patch = |p: &&Patch| p.centre_m.distance(origin_m.truncate()) <= reach_m + p.radius_m;
        self.patches.clear();
        self.patches.extend(scene.patches.iter().filter(near_patch).copied());
        self.volumes.clear();
        for volume in &scene.volumes {
            let to_centre = volume.centre_m - origin_m;
            let (distance_m, radius_m) = (to_centre.length(), volume.semi_axes_m.max_element());
            if distance_m > reach_m + radius_m {
                continue;
            }
            let sin = radius_m / distance_m;
            let cone = (sin < 1.0).then(|| ((1.0 - sin * sin).sqrt(), sin));
            self.volumes.push(NearVolume { volume: *volume, toward: to_centre / distance_m, cone });
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.patches.is_empty() && self.volumes.is_empty()
    }

    /// Moves the returns of one block of rays.
    pub(super) fn scatter(&mut self, caster: &Caster, rays: &Rays, streams: &[Stream; 2], returns: &mut [TrueReturn]) {
        debug_assert!(returns.len() <= BLOCK, "draws are made in blocks");
        self.scatter_patches(caster, rays, &streams[0], returns);
        self.scatter_volumes(rays, &streams[1], returns);
    }

    fn scatter_patches(&self, caster: &Caster, rays: &Rays, stream: &Stream, returns: &mut [TrueReturn]) {
        let foot = |i: usize, range_m: f64| (rays.origin_m + rays.directions[i] * range_m).truncate();
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for (i, ret) in returns.iter().enumerate().filter(|(_, ret)| ret.object == Hit::GROUND) {
            let point = foot(i, ret.range_m);
            (low, high) = (low.min(point), high.max(point));
        }
        let touches = |p: &Patch| p.centre_m.distance(p.centre_m.clamp(low, high)) <= p.radius_m;
        if low.x > high.x || !self.patches.iter().any(touches) {
            return;
        }
        let mut draws = [0.0; BLOCK];
        rays.draws.normal(stream, &mut draws[..returns.len()]);
        for (i, ret) in returns.iter_mut().enumerate().filter(|(_, ret)| ret.object == Hit::GROUND) {
            let point = foot(i, ret.range_m);
            let holding = self.patches.iter().filter(|p| p.centre_m.distance(point) <= p.radius_m);
            let Some(patch) = holding.min_by_key(|p| !p.untraversable) else { continue };
            let direction = rays.directions[i];
            let normal = caster.normal_at(Hit::GROUND, rays.origin_m + direction * ret.range_m);
            let added_m = patch.sigma_m * draws[i];
            let height_m = if patch.height_law == HeightLaw::HalfNormal { added_m.abs() } else { added_m };
            // Height above the tangent plane changes by |d . n| / n_z per metre along the ray.
            let back_m = height_m * normal.z / normal.dot(direction).abs();
            let [near_edge_m, far_edge_m] = ends_in_disc(patch, rays.origin_m.truncate(), direction.truncate());
            // A height of zero leaves the range as it was, also where the ray lies in the tangent plane (0 / 0).
            let range_m = if height_m > 0.0 {
                (ret.range_m - back_m).max(near_edge_m).min(ret.range_m)
            } else if height_m < 0.0 {
                (ret.range_m - back_m).min(far_edge_m).max(ret.range_m)
            } else {
                ret.range_m
            };
            *ret = TrueReturn { range_m, object: patch.id, class: Some(patch.class), top: false };
        }
    }

    fn scatter_volumes(&mut self, rays: &Rays, stream: &Stream, returns: &mut [TrueReturn]) {
        let block = Cone::around(rays.directions);
        self.touched.clear();
        self.touched.extend((0..self.volumes.len()).filter(|&k| block.may_touch(&self.volumes[k])));
        if self.touched.is_empty() {
            return;
        }
        let mut draws = [0.0; BLOCK];
        let mut drawn = false;
        for i in 0..returns.len() {
            self.spans.clear();
            for &k in &self.touched {
                let near = &self.volumes[k];
                if let Some((entry_m, exit_m)) = crossing(&near.volume, rays.origin_m, rays.directions[i]) {
                    let exit_m = exit_m.min(returns[i].range_m);
                    if entry_m < exit_m {
                        self.spans.push((entry_m, exit_m, k));
                    }
                }
            }
            if self.spans.is_empty() {
                continue;
            }
            if !drawn {
                rays.draws.uniform(stream, &mut draws[..returns.len()]);
                drawn = true;
            }
            if let Some((range_m, k)) = self.turning_point(-math::ln(draws[i])) {
                let volume = &self.volumes[k].volume;
                returns[i] = TrueReturn { range_m, object: volume.id, class: Some(volume.class), top: false };
            }
        }
    }

    /// Where the optical depth is used up along the ray's spans, and in which volume.
    fn turning_point(&mut self, mut depth: f64) -> Option<(f64, usize)> {
        self.borders.clear();
        self.borders.extend(self.spans.iter().flat_map(|&(entry_m, exit_m, _)| [entry_m, exit_m]));
        self.borders.sort_unstable_by(f64::total_cmp);
        for borders in self.borders.windows(2) {
            let (from_m, to_m) = (borders[0], borders[1]);
            let (mut extinction_per_m, mut densest) = (0.0, None::<(f64, usize)>);
            for &(_, _, k) in self.spans.iter().filter(|s| s.0 <= from_m && to_m <= s.1) {
                let own_per_m = self.volumes[k].volume.extinction_per_m;
                extinction_per_m += own_per_m;
                if densest.is_none_or(|(most, _)| own_per_m > most) {
                    densest = Some((own_per_m, k));
                }
            }
            let Some((_, k)) = densest else { continue };
            let range_m = from_m + depth / extinction_per_m;
            if range_m < to_m {
                return Some((range_m, k));
            }
            depth -= extinction_per_m * (to_m - from_m);
        }
        None
    }
}

/// Ranges at which the ray comes over the patch, 0 where the sensor stands in it, and leaves it, endless where it goes straight down.
fn ends_in_disc(patch: &Patch, origin_m: DVec2, direction: DVec2) -> [f64; 2] {
    let from_centre = origin_m - patch.centre_m;
    let a = direction.length_squared();
    let b = from_centre.dot(direction);
    let c = from_centre.length_squared() - patch.radius_m * patch.radius_m;
    if a == 0.0 {
        return [0.0, f64::INFINITY];
    }
    // The roots in the forms that do not cancel; the ray is known to reach the disc.
    let half_chord = (b * b - a * c).max(0.0).sqrt();
    let near_m = if c <= 0.0 { 0.0 } else { (c / (half_chord - b)).max(0.0) };
    let far_m = if b > 0.0 { -c / (half_chord + b) } else { (half_chord - b) / a };
    [near_m, far_m]
}

/// Ranges at which a ray enters and leaves an ellipsoid, from the origin on.
fn crossing(volume: &Volume, origin_m: DVec3, direction: DVec3) -> Option<(f64, f64)> {
    let o = (origin_m - volume.centre_m) / volume.semi_axes_m;
    let d = direction / volume.semi_axes_m;
    let (a, b) = (d.length_squared(), o.dot(d));
    // Distance of the ray's nearest point from the centre, squared: free of the cancellation in b^2 - a c.
    let miss_sq = (o - d * (b / a)).length_squared();
    if miss_sq >= 1.0 {
        return None;
    }
    let half = ((1.0 - miss_sq) / a).sqrt();
    let (entry_m, exit_m) = (-b / a - half, -b / a + half);
    (exit_m > 0.0).then_some((entry_m.max(0.0), exit_m))
}

/// A cone that holds a block of directions.
struct Cone {
    axis: DVec3,
    cos: f64,
    sin: f64,
}

impl Cone {
    fn around(directions: &[DVec3]) -> Cone {
        let axis = directions.iter().copied().sum::<DVec3>().normalize_or_zero();
        let cos = directions.iter().map(|d| d.dot(axis)).fold(1.0, f64::min);
        Cone { axis, cos, sin: (1.0 - cos * cos).max(0.0).sqrt() }
    }

    /// False only where no ray of the block meets the volume's bounding sphere.
    fn may_touch(&self, near: &NearVolume) -> bool {
        // Half angles below a right angle each add up to less than a half turn, where the cosine falls.
        match near.cone {
            Some((cos, sin)) if self.cos > 0.0 => {
                // The margin covers rounding: 1e-9 in the cosine.
                near.toward.dot(self.axis) >= self.cos * cos - self.sin * sin - 1e-9
            }
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests;
