//! What a ray saw -> its colour: a low sun, sky light, some haze; grains of sand, leaves and labelled cells.
//!
//! Things have the colour of their class. Grain, tufts and leaves are drawn by noise and are not in the scene. Colours are linear light.

use super::super::colour::{Colour, Palette, lit, mix, of_class};
use super::super::noise::{grain, grain3, speckle3};
use super::Overlay;
use super::seen::{Scenery, Surface, Thing};
use crate::geometry::{DVec2, DVec3, GridSpec, Transform};
use crate::math;
use crate::scene::Volume;

/// Steps of a ray through a bush or a crown.
const LEAF_STEPS: usize = 24;

/// How what was seen is coloured.
pub(super) struct Light<'a> {
    scenery: &'a Scenery<'a>,
    palette: &'a Palette,
    overlay: Overlay,
    map_from_world: Transform,
    /// Heights that the soil's colour runs over.
    low_m: f64,
    relief_m: f64,
}

/// The labelled cell at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Drape {
    is_untraversable: bool,
    is_seam: bool,
}

impl<'a> Light<'a> {
    pub(super) fn new(scenery: &'a Scenery<'a>, palette: &'a Palette, overlay: Overlay) -> Light<'a> {
        let view = scenery.view;
        let (low_m, high_m) = heights_of(view.scene.extent_m, |x, y| view.scene.ground.height_m(x, y));
        let map_from_world = if view.levelled {
            view.map_from_sensor * view.world_from_sensor().inverse()
        } else {
            view.estimated_pose().transform() * view.true_pose().transform().inverse()
        };
        Light { scenery, palette, overlay, map_from_world, low_m, relief_m: (high_m - low_m).max(0.2) }
    }

    /// The point that a ray along `way` saw.
    fn point_m(&self, surface: &Surface, way: DVec3) -> DVec3 {
        self.scenery.camera.eye_m + way * f64::from(surface.range_m)
    }

    /// The colour along the ray `way` that saw a surface.
    pub(super) fn colour(&self, surface: &Surface, way: DVec3) -> Colour {
        let (point_m, range_m) = (self.point_m(surface, way), f64::from(surface.range_m));
        let bare = match surface.thing {
            Thing::Sky => {
                let share = (way.z.max(0.0) / 0.45).min(1.0).sqrt() as f32;
                mix(self.palette.horizon, self.palette.zenith, share)
            }
            Thing::Plain => self.haze(self.plain(point_m, range_m, surface.is_sunny), range_m),
            Thing::Rover(part) => {
                let sun = if surface.is_sunny { 1.0 } else { 0.0 };
                self.haze(self.light(self.scenery.model.colour(part), surface.normal(), sun), range_m)
            }
            Thing::Body(_) | Thing::Ground => self.haze(self.yard(surface, point_m), range_m),
        };
        let volumes = &self.scenery.view.scene.volumes;
        volumes.iter().fold(bare, |colour, volume| self.add_leaves(volume, way, range_m, colour))
    }

    /// Ground or a body.
    fn yard(&self, surface: &Surface, point_m: DVec3) -> Colour {
        // Grain fades with distance, where it would only flicker.
        let fade = 1.0 / (1.0 + f64::from(surface.range_m) / 12.0);
        let (albedo, rough) = match surface.thing {
            Thing::Body(id) => {
                let spots = speckle3(point_m, 0.02) * 0.5 + speckle3(point_m, 0.11) * 0.5;
                let class = self.scenery.view.scene.obstacles[id].class;
                (lit(of_class(class), (1.0 + (spots - 0.5) * 0.3 * fade) as f32), DVec3::ZERO)
            }
            _ => {
                let share = ((point_m.z - self.low_m) / self.relief_m) as f32;
                let soil = mix(self.palette.low_ground, self.palette.high_ground, share.clamp(0.0, 1.0));
                let (coarse, slope) = grain(point_m.truncate(), 0.09);
                let (fine, fine_slope) = grain(point_m.truncate(), 0.025);
                let soil = lit(soil, (0.97 + 0.10 * (coarse - 0.5) + 0.12 * (fine - 0.5) * fade) as f32);
                let rough = (slope * 0.010 + fine_slope * 0.0022 * fade).extend(0.0) * fade.sqrt();
                (self.tufted(soil, point_m), -rough)
            }
        };
        let albedo = self.drape_at(point_m).map_or(albedo, |drape| {
            let colour = if drape.is_untraversable { self.palette.untraversable } else { self.palette.traversable };
            mix(albedo, colour, if drape.is_seam { 0.45 } else { 0.8 })
        });
        let through = if surface.is_sunny { self.leaf_light(point_m) } else { 0.0 };
        self.light(albedo, (surface.normal() + rough).normalize(), through)
    }

    /// The painted plain.
    fn plain(&self, point_m: DVec3, range_m: f64, is_sunny: bool) -> Colour {
        let (dunes, _) = grain(point_m.truncate(), 3.0);
        let fade = 1.0 / (1.0 + range_m / 12.0);
        let (coarse, coarse_slope) = grain(point_m.truncate(), 0.3);
        let (fine, fine_slope) = grain(point_m.truncate(), 0.09);
        let soil = mix(self.palette.low_ground, self.palette.high_ground, 0.35 + 0.3 * dunes as f32);
        let soil = lit(soil, (0.88 + (0.14 * (coarse - 0.5) + 0.12 * (fine - 0.5)) * fade) as f32);
        let rough = ((coarse_slope * 0.03 + fine_slope * 0.01) * fade).extend(0.0);
        self.light(soil, (DVec3::Z - rough).normalize(), if is_sunny { 1.0 } else { 0.0 })
    }

    /// The cell that is laid over what a ray along `way` saw.
    pub(super) fn drape(&self, surface: &Surface, way: DVec3) -> Option<Drape> {
        let is_yard = matches!(surface.thing, Thing::Body(_) | Thing::Ground);
        if is_yard { self.drape_at(self.point_m(surface, way)) } else { None }
    }

    /// The cell that the point seems to lie in.
    fn drape_at(&self, point_m: DVec3) -> Option<Drape> {
        if self.overlay != Overlay::Cells {
            return None;
        }
        let size_m = self.scenery.view.cell_size_m;
        let at_m = self.map_from_world.point(point_m).truncate();
        let cell = GridSpec { size_m }.cell(at_m.x, at_m.y)?;
        let rows = &self.scenery.view.cells.rows;
        let row = rows.binary_search_by_key(&cell, |r| r.index).ok()?;
        let from_border = at_m / size_m - (at_m / size_m).floor();
        let is_seam = from_border.min(DVec2::ONE - from_border).min_element() < 0.05;
        Some(Drape { is_untraversable: rows[row].untraversable(), is_seam })
    }

    fn tufted(&self, soil: Colour, point_m: DVec3) -> Colour {
        self.scenery.view.scene.patches.iter().fold(soil, |colour, patch| {
            let off = (point_m.truncate() - patch.centre_m).length() / patch.radius_m;
            if off >= 1.0 {
                return colour;
            }
            let (blade, _) = grain(point_m.truncate(), 0.03);
            // Thinner toward the rim.
            let cover = (0.35 + 0.65 * blade) * (1.0 - off * off).sqrt().min(1.0);
            mix(colour, lit(of_class(patch.class), (0.55 + 0.75 * blade) as f32), cover as f32)
        })
    }

    /// Sun and sky on a matt surface; `sun` is the share of sunlight that arrives.
    fn light(&self, albedo: Colour, normal: DVec3, sun: f64) -> Colour {
        const SUNLIGHT: [f32; 3] = [1.30, 1.20, 1.06];
        const SKYLIGHT: [f32; 3] = [0.30, 0.29, 0.30];
        let direct = (normal.dot(self.scenery.sun).max(0.0) * sun) as f32;
        let sky = (0.55 + 0.45 * normal.z) as f32;
        std::array::from_fn(|i| albedo[i] * (SUNLIGHT[i] * direct + SKYLIGHT[i] * sky))
    }

    /// The share of sunlight that passes the bushes and crowns.
    fn leaf_light(&self, point_m: DVec3) -> f64 {
        self.scenery.view.scene.volumes.iter().fold(1.0, |light, volume| {
            match chord(volume, point_m, self.scenery.sun) {
                Some((from, to)) => light * math::exp(-volume.extinction_per_m.min(6.0) * (to - from.max(0.0))),
                None => light,
            }
        })
    }

    /// The leaves of a volume, laid over what lies behind them at `range_m`.
    fn add_leaves(&self, volume: &Volume, dir: DVec3, range_m: f64, behind: Colour) -> Colour {
        let eye_m = self.scenery.camera.eye_m;
        let Some((from, to)) = chord(volume, eye_m, dir) else { return behind };
        let (from, to) = (from.max(0.0), to.min(range_m));
        if from >= to {
            return behind;
        }
        // Steps through the leaves; noise gathers them in tufts and frays the rim.
        let step_m = (to - from) / LEAF_STEPS as f64;
        let (mut through, mut colour) = (1.0, [0.0_f32; 3]);
        for k in 0..LEAF_STEPS {
            let point_m = eye_m + dir * (from + (k as f64 + 0.5) * step_m);
            let off = (point_m - volume.centre_m) / volume.semi_axes_m;
            let tuft = 0.6 * grain3(point_m, 0.11) + 0.4 * grain3(point_m, 0.035);
            let density = ((1.0 - off.length()) * 1.6 + 2.4 * (tuft - 0.55)).max(0.0);
            let cover = 1.0 - math::exp(-volume.extinction_per_m.max(2.5) * 5.0 * density * step_m);
            // Leaves deep inside and away from the sun are darker.
            let depth = 0.35 + 0.65 * off.length() * (0.5 + 0.5 * off.normalize_or_zero().dot(self.scenery.sun));
            let albedo = lit(of_class(volume.class), (0.15 + 1.6 * tuft) as f32);
            let leaf =
                self.light(albedo, (off.normalize_or_zero() + self.scenery.sun * 0.4).normalize_or_zero(), depth);
            let share = (through * cover) as f32;
            colour = std::array::from_fn(|i| colour[i] + leaf[i] * share);
            through *= 1.0 - cover;
        }
        let seen = (1.0 - through) as f32;
        let hazed = self.haze(lit(colour, 1.0 / seen.max(1e-6)), from);
        mix(behind, hazed, seen)
    }

    fn haze(&self, colour: Colour, range_m: f64) -> Colour {
        mix(colour, self.palette.horizon, (1.0 - math::exp(-range_m / 70.0)) as f32)
    }
}

/// The lowest and highest of heights over a yard, on a grid.
pub(super) fn heights_of(extent_m: f64, height_m: impl Fn(f64, f64) -> f64) -> (f64, f64) {
    (0..=32 * 32)
        .map(|k| height_m(extent_m * f64::from(k % 33) / 33.0, extent_m * f64::from(k / 33) / 33.0))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), h| (a.min(h), b.max(h)))
}

/// Where a ray enters and leaves a volume.
fn chord(volume: &Volume, origin: DVec3, dir: DVec3) -> Option<(f64, f64)> {
    let (o, d) = ((origin - volume.centre_m) / volume.semi_axes_m, dir / volume.semi_axes_m);
    let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
    let root = b * b - a * c;
    let (from, to) = ((-b - root.sqrt()) / a, (-b + root.sqrt()) / a);
    (root > 0.0 && to > 0.0).then_some((from, to))
}
