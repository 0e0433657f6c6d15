//! A camera in a yard -> what each pixel sees: how far, of what, facing where, in the sun or not. No colours.
//!
//! Rays go through every fourth pixel, then through every second, then through each; but where the seen pixels around one agree that they
//! lie on one smooth surface, what it sees is their mean instead: the mean of inverse depths is exact for a plane. Things so small that
//! they could hide between rays are cast pixel by pixel. Pixels on an edge have four rays more. All ranges and lengths in metres.
//! Not modelled: light that was scattered; a shadow is sharp.

use rayon::prelude::*;

use super::super::View;
use super::super::model::Model;
use super::camera::Camera;
use crate::geometry::DVec3;
use crate::math;
use crate::sweep::{Caster, Hit};

/// Rays along each axis of a pixel with an edge in it.
pub(super) const FINE: usize = 2;
/// Pixels between the first rays.
const COARSE: usize = 4;
const FAR_M: f64 = 400.0;
/// A shadow falls no farther.
const SHADOW_M: f64 = 60.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Thing {
    Sky,
    /// Painted around the yard.
    Plain,
    /// A part of the rover.
    Rover(usize),
    /// A body of the yard.
    Body(usize),
    Ground,
}

/// What one ray met. Single precision: a picture has a million of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    pub thing: Thing,
    pub range_m: f32,
    normal: [f32; 3],
    pub is_sunny: bool,
}

impl Surface {
    const SKY: Surface = Surface { thing: Thing::Sky, range_m: FAR_M as f32, normal: [0.0, 0.0, 1.0], is_sunny: true };

    fn new(thing: Thing, range_m: f64, normal: DVec3, is_sunny: bool) -> Surface {
        Surface { thing, range_m: range_m as f32, normal: normal.to_array().map(|v| v as f32), is_sunny }
    }

    pub(super) fn normal(&self) -> DVec3 {
        DVec3::from(self.normal.map(f64::from))
    }

    /// What a ray close to `way`, along which this was seen, meets of the same plane.
    pub(super) fn beside(&self, way: DVec3, other: DVec3) -> Surface {
        let (down, other_down) = (way.dot(self.normal()), other.dot(self.normal()));
        // Along the plane nothing can be said.
        let share = if other_down.abs() > 1e-3 { (down / other_down).clamp(0.9, 1.1) } else { 1.0 };
        Surface { range_m: self.range_m * share as f32, ..*self }
    }

    /// Whether an edge runs between two neighbours.
    fn differs(&self, other: &Surface) -> bool {
        let jump = (self.range_m - other.range_m).abs() > 0.08 * self.range_m.min(other.range_m);
        self.thing != other.thing || self.is_sunny != other.is_sunny || jump || self.normal().dot(other.normal()) < 0.9
    }
}

/// What there is to be seen, and from where.
pub(super) struct Scenery<'a> {
    pub view: &'a View<'a>,
    pub caster: &'a Caster<'a>,
    pub camera: Camera,
    pub model: Model,
    /// Toward the sun.
    pub sun: DVec3,
    /// Height of the plain around the yard.
    pub plain_m: f64,
}

/// What was seen.
pub(super) struct Seen {
    /// One a pixel.
    pub pixels: Vec<Surface>,
    /// The pixels with an edge, ascending, and what their finer rays saw.
    pub edges: Vec<(usize, [Surface; FINE * FINE])>,
}

/// The middles of a pixel's parts, row by row.
pub(super) fn parts(x: usize, y: usize) -> [(f64, f64); FINE * FINE] {
    let part = |k: usize| (k as f64 + 0.5) / FINE as f64;
    std::array::from_fn(|n| (x as f64 + part(n % FINE), y as f64 + part(n / FINE)))
}

impl Scenery<'_> {
    pub(super) fn look(&self) -> Seen {
        let (width, height) = (self.camera.width, self.camera.height);
        let mut pixels = vec![Surface::SKY; width * height];
        let small = self.small_things();
        for step in [COARSE, COARSE / 2, COARSE / 4] {
            let row = |y: usize| -> Vec<(usize, Surface)> {
                let is_new = |x: usize| step == COARSE || !(x.is_multiple_of(2 * step) && y.is_multiple_of(2 * step));
                let see = |x: usize| {
                    let mean = if step < COARSE && !small[y * width + x] {
                        self.mean_around(&pixels, (x, y), 2 * step)
                    } else {
                        None
                    };
                    (y * width + x, mean.unwrap_or_else(|| self.cast(x as f64 + 0.5, y as f64 + 0.5)))
                };
                (0..width).step_by(step).filter(|&x| is_new(x)).map(see).collect()
            };
            let rows: Vec<_> = (0..height.div_ceil(step)).into_par_iter().map(|k| row(k * step)).collect();
            rows.into_iter().flatten().for_each(|(k, surface)| pixels[k] = surface);
        }
        let edge = |k: usize| {
            let (x, y) = (k % width, k / width);
            let around = [
                (x.saturating_sub(1), y),
                ((x + 1).min(width - 1), y),
                (x, y.saturating_sub(1)),
                (x, (y + 1).min(height - 1)),
            ];
            let has_edge = around.iter().any(|&(x, y)| pixels[k].differs(&pixels[y * width + x]));
            has_edge.then(|| (k, parts(x, y).map(|(x, y)| self.cast(x, y))))
        };
        let edges = (0..width * height).into_par_iter().filter_map(edge).collect();
        Seen { pixels, edges }
    }

    /// Pixels around bodies of a few pixels, and around their shadows.
    fn small_things(&self) -> Vec<bool> {
        let Camera { width, height, .. } = self.camera;
        let mut small = vec![false; width * height];
        for obstacle in &self.view.scene.obstacles {
            let body = obstacle.body();
            let Some(((x, y), range_m)) = self.camera.project(body.centre_m) else { continue };
            let radius = body.radius_m * self.camera.pixels_a_metre() / range_m;
            if radius > 2.5 * COARSE as f64 {
                continue;
            }
            // A shadow under the low sun is some two heights long.
            let reach = 3.0 * radius + 1.0;
            let range = |at: f64, end: usize| {
                ((at - reach).clamp(0.0, end as f64) as usize)..((at + reach).clamp(0.0, end as f64) as usize)
            };
            for row in range(y, height) {
                small[row * width..][range(x, width)].fill(true);
            }
        }
        small
    }

    /// What a pixel sees where the corners of its square of side `side` see one smooth surface.
    fn mean_around(&self, pixels: &[Surface], (x, y): (usize, usize), side: usize) -> Option<Surface> {
        let Camera { width, height, eye_m, ahead, .. } = self.camera;
        let ends = |at: usize| [at / side * side, at.div_ceil(side) * side];
        let ([left, right], [top, bottom]) = (ends(x), ends(y));
        if right >= width || bottom >= height {
            return None;
        }
        let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
        let seen = corners.map(|(x, y)| pixels[y * width + x]);
        let first = seen[0];
        if seen.iter().any(|other| other.thing != first.thing || other.is_sunny != first.is_sunny) {
            return None;
        }
        if first.thing == Thing::Sky {
            return Some(Surface::SKY);
        }
        let way = |x: usize, y: usize| self.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let ways = corners.map(|(x, y)| way(x, y));
        let points: [DVec3; 4] = std::array::from_fn(|k| eye_m + ways[k] * f64::from(seen[k].range_m));
        let normal = first.normal();
        // One facet, or a curve so gentle that it is flat here; and no crest with other ground behind it.
        let is_smooth = (1..4).all(|k| {
            let off = points[k] - points[0];
            normal.dot(seen[k].normal()) > 0.9995 && off.dot(normal).abs() <= 0.04 * off.length()
        });
        if !is_smooth {
            return None;
        }
        let inverse = (0..4).map(|k| 1.0 / (f64::from(seen[k].range_m) * ways[k].dot(ahead))).sum::<f64>() / 4.0;
        let normal = seen.iter().map(Surface::normal).sum::<DVec3>().normalize();
        Some(Surface::new(first.thing, 1.0 / (inverse * way(x, y).dot(ahead)), normal, first.is_sunny))
    }

    /// What the ray through a place of the picture sees.
    fn cast(&self, x: f64, y: f64) -> Surface {
        let (eye_m, way) = (self.camera.eye_m, self.camera.direction(x, y));
        let hit = self.caster.first_hit(eye_m, way, FAR_M);
        let surface = |thing, range_m: f64, normal: DVec3| {
            // Off the surface by more than roundings, so that nothing shades itself.
            let is_sunny = self.is_sunny(eye_m + way * range_m + normal * 2e-3);
            Surface::new(thing, range_m, normal, is_sunny)
        };
        if let Some(met) = self.model.first_hit(eye_m, way, hit.range_m.min(FAR_M)) {
            return surface(Thing::Rover(met.part), met.range_m, met.normal);
        }
        if hit.range_m.is_finite() {
            let thing = if hit.object == Hit::GROUND { Thing::Ground } else { Thing::Body(hit.object as usize) };
            return surface(thing, hit.range_m, self.caster.normal_at(hit.object, eye_m + way * hit.range_m));
        }
        let down_m = (self.plain_m - eye_m.z) / way.z;
        if way.z < 0.0 && down_m > 0.0 && down_m < 2000.0 {
            return surface(Thing::Plain, down_m, DVec3::Z);
        }
        Surface::SKY
    }

    fn is_sunny(&self, point_m: DVec3) -> bool {
        self.caster.first_hit(point_m, self.sun, SHADOW_M).range_m.is_infinite()
            && self.model.first_hit(point_m, self.sun, SHADOW_M).is_none()
    }
}

/// From the left of the rover and a little ahead, 24 degrees up: long shadows that fall across the picture.
pub(super) fn low_sun(yaw_rad: f64) -> DVec3 {
    let (sin, cos) = math::sin_cos(yaw_rad);
    let (forward, left) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
    (forward * 0.35 + left * 0.84 + DVec3::Z * 0.45).normalize()
}
