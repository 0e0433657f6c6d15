//! A view and a caster -> the yard as a camera behind the rover would see it (figure 8a of the paper).
//!
//! One ray a pixel, and four where neighbours differ; a low sun with shadow rays, sky light, some haze. Things have the colour
//! of their class; grains of sand and leaves are drawn by noise and are not in the scene. The sweep's points are laid over
//! what hides none of them. Beyond the yard lies a plain that is painted only.

use embedded_graphics::text::Alignment;
use rayon::prelude::*;

use super::View;
use super::canvas::{Canvas, Spot, TITLE};
use super::colour::{Colour, Palette, lit, mix, of_class, palette};
use super::model::Model;
use super::noise::{grain, grain3, speckle3};
use crate::geometry::{DVec3, GridSpec, Transform};
use crate::math;
use crate::scene::Volume;
use crate::sweep::{Caster, Status};

const WIDTH: usize = 1440;
const HEIGHT: usize = 810;
/// Tangent of half the horizontal field of view (54 degrees).
const HALF_FIELD: f64 = 0.51;
/// Extra rays along each axis of a pixel with an edge in it.
const FINE: usize = 2;
const FAR_M: f64 = 400.0;

/// What is laid over the yard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overlay {
    /// The points of the sweep, where they truly were measured.
    Points,
    /// The labelled cells, where the estimate puts them, draped over all that stands in them.
    Cells,
}

/// PNG: the rover in the yard, from behind and above, with its sweep or its labelled cells.
pub fn perspective(view: &View, caster: &Caster, overlay: Overlay) -> Vec<u8> {
    render(view, caster, overlay, WIDTH, HEIGHT)
}

pub(super) fn render(view: &View, caster: &Caster, overlay: Overlay, width: usize, height: usize) -> Vec<u8> {
    let palette = palette();
    let picture = Picture::new(view, caster, overlay, &palette, (width, height));
    let coarse: Vec<Sample> = (0..width * height)
        .into_par_iter()
        .map(|k| picture.sample((k % width) as f64 + 0.5, (k / width) as f64 + 0.5))
        .collect();
    let fine = |k: usize| {
        let (x, y) = (k % width, k / width);
        let near = [
            (x.saturating_sub(1), y),
            ((x + 1).min(width - 1), y),
            (x, y.saturating_sub(1)),
            (x, (y + 1).min(height - 1)),
        ];
        if !near.iter().any(|&(x, y)| coarse[k].differs(&coarse[y * width + x])) {
            return coarse[k].colour;
        }
        let mut sum = [0.0_f32; 3];
        for (j, i) in (0..FINE * FINE).map(|n| (n / FINE, n % FINE)) {
            let part = |i: usize| (i as f64 + 0.5) / FINE as f64;
            let colour = picture.sample(x as f64 + part(i), y as f64 + part(j)).colour;
            sum = std::array::from_fn(|c| sum[c] + colour[c]);
        }
        sum.map(|c| c / (FINE * FINE) as f32)
    };
    let pixels = (0..width * height).into_par_iter().map(fine).collect();
    let mut canvas = Canvas { width, height, pixels };
    if overlay == Overlay::Points {
        picture.draw_points(&mut canvas, &coarse);
    }
    captions(&mut canvas, view, overlay, &palette);
    canvas.png()
}

/// What one ray saw.
#[derive(Clone, Copy)]
struct Sample {
    colour: Colour,
    range_m: f64,
    /// Object id, or a number of its own for rover and sky.
    thing: i32,
    normal: DVec3,
    sunny: bool,
    /// Which cell was draped here: 0 none, and whether its seam.
    drape: u8,
}

impl Sample {
    fn differs(&self, other: &Sample) -> bool {
        let jump = (self.range_m - other.range_m).abs() > 0.08 * self.range_m.min(other.range_m);
        self.thing != other.thing
            || self.drape != other.drape
            || self.sunny != other.sunny
            || jump
            || self.normal.dot(other.normal) < 0.9
    }
}

/// Points this much behind what a pixel shows are hidden, metres: their own noise must not hide them.
const HIDDEN_M: f64 = 0.06;
/// Steps of a ray through a bush or a crown.
const LEAF_STEPS: usize = 24;
const ROVER: i32 = -3;
const SKY: i32 = -4;

struct Picture<'a> {
    view: &'a View<'a>,
    caster: &'a Caster<'a>,
    overlay: Overlay,
    palette: &'a Palette,
    map_from_world: Transform,
    /// Pixels.
    width: usize,
    height: usize,
    model: Model,
    eye_m: DVec3,
    /// Unit vectors of the camera: to its right, up, and ahead.
    right: DVec3,
    up: DVec3,
    ahead: DVec3,
    sun: DVec3,
    plain_m: f64,
    /// Height that the soil's colour runs over.
    low_m: f64,
    relief_m: f64,
}

impl<'a> Picture<'a> {
    fn new(
        view: &'a View<'a>,
        caster: &'a Caster<'a>,
        overlay: Overlay,
        palette: &'a Palette,
        (width, height): (usize, usize),
    ) -> Picture<'a> {
        let pose = view.true_pose();
        let model = Model::new(view.rover, &pose, &view.rover_from_sensor, view.scene, palette);
        let (sin, cos) = math::sin_cos(pose.yaw_rad);
        let (forward, left) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
        let size_m = view.rover.length_m.max(view.rover.width_m).max(0.5);
        let target_m = pose.position_m + forward * 2.4 * size_m - left * 1.3 * size_m + DVec3::Z * 0.2 * size_m;
        let mut eye_m = pose.position_m - forward * 3.6 * size_m + left * 1.4 * size_m + DVec3::Z * 1.75 * size_m;
        // Nothing may stand between the camera and the rover: rise until the way is free.
        for _ in 0..20 {
            let way = pose.position_m + DVec3::Z * 0.5 * size_m - eye_m;
            let buried = eye_m.z < view.scene.ground_below_m(eye_m.x, eye_m.y) + 0.5;
            if !buried
                && caster.inside(eye_m).is_none()
                && caster.first_hit(eye_m, way.normalize(), way.length()).range_m.is_infinite()
            {
                break;
            }
            eye_m.z += 0.4 * size_m;
        }
        let ahead = (target_m - eye_m).normalize();
        let right = ahead.cross(DVec3::Z).normalize();
        // From the left and a little ahead, 24 degrees up: long shadows that fall across the picture.
        let sun = (forward * 0.35 + left * 0.84 + DVec3::Z * 0.45).normalize();
        let extent_m = view.scene.extent_m;
        let heights = (0..=32 * 32).map(|k| {
            view.scene.ground.height_m(extent_m * f64::from(k % 33) / 33.0, extent_m * f64::from(k / 33) / 33.0)
        });
        let (low_m, high_m) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), h| (a.min(h), b.max(h)));
        Picture {
            view,
            caster,
            overlay,
            palette,
            width,
            height,
            map_from_world: view.estimated_pose().transform() * pose.transform().inverse(),
            model,
            eye_m,
            right,
            up: right.cross(ahead),
            ahead,
            sun,
            plain_m: low_m,
            low_m,
            relief_m: (high_m - low_m).max(0.2),
        }
    }

    fn direction(&self, x: f64, y: f64) -> DVec3 {
        let scale = HALF_FIELD / (self.width as f64 / 2.0);
        let (across, above) = ((x - self.width as f64 / 2.0) * scale, (self.height as f64 / 2.0 - y) * scale);
        (self.ahead + self.right * across + self.up * above).normalize()
    }

    /// Where a point appears, with its distance; `None` behind the camera.
    fn project(&self, point_m: DVec3) -> Option<(Spot, f64)> {
        let off = point_m - self.eye_m;
        let depth = off.dot(self.ahead);
        let scale = self.width as f64 / 2.0 / HALF_FIELD / depth;
        let spot = (
            self.width as f64 / 2.0 + off.dot(self.right) * scale,
            self.height as f64 / 2.0 - off.dot(self.up) * scale,
        );
        (depth > 0.05).then(|| (spot, off.length()))
    }

    fn sample(&self, x: f64, y: f64) -> Sample {
        let dir = self.direction(x, y);
        let hit = self.caster.first_hit(self.eye_m, dir, FAR_M);
        let rover = self.model.first_hit(self.eye_m, dir, hit.range_m.min(FAR_M));
        let mut sample = if let Some(met) = rover {
            let sunny = self.sunny(self.eye_m + dir * met.range_m + met.normal * 2e-3);
            let colour = self.light(met.colour, met.normal, if sunny { 1.0 } else { 0.0 });
            Sample { colour, range_m: met.range_m, thing: ROVER, normal: met.normal, sunny, drape: 0 }
        } else if hit.range_m.is_finite() {
            self.surface(self.eye_m + dir * hit.range_m, hit.range_m, hit.object)
        } else {
            self.beyond(dir)
        };
        if sample.thing != SKY {
            sample.colour = self.haze(sample.colour, sample.range_m);
        }
        for volume in &self.view.scene.volumes {
            self.add_leaves(volume, dir, &mut sample);
        }
        sample
    }

    /// Ground or a body.
    fn surface(&self, point_m: DVec3, range_m: f64, object: i32) -> Sample {
        let normal = self.caster.normal_at(object, point_m);
        let obstacle = usize::try_from(object).ok().and_then(|id| self.view.scene.obstacles.get(id));
        // Grain fades with distance, where it would only flicker.
        let fade = 1.0 / (1.0 + range_m / 12.0);
        let (albedo, rough) = match obstacle {
            Some(obstacle) => {
                let spots = speckle3(point_m, 0.02) * 0.5 + speckle3(point_m, 0.11) * 0.5;
                (lit(of_class(obstacle.class), (1.0 + (spots - 0.5) * 0.3 * fade) as f32), DVec3::ZERO)
            }
            None => {
                let share = ((point_m.z - self.low_m) / self.relief_m) as f32;
                let soil = mix(self.palette.low_ground, self.palette.high_ground, share.clamp(0.0, 1.0));
                let (coarse, slope) = grain(point_m.truncate(), 0.09);
                let (fine, fine_slope) = grain(point_m.truncate(), 0.025);
                let soil = lit(soil, (0.97 + 0.10 * (coarse - 0.5) + 0.12 * (fine - 0.5) * fade) as f32);
                let rough = (slope * 0.010 + fine_slope * 0.0022 * fade).extend(0.0) * fade.sqrt();
                (self.tufted(soil, point_m), -rough)
            }
        };
        let (albedo, drape) = if self.overlay == Overlay::Cells { self.draped(albedo, point_m) } else { (albedo, 0) };
        let sunny = self.sunny(point_m + normal * 2e-3);
        let through = if sunny { self.leaf_light(point_m) } else { 0.0 };
        let colour = self.light(albedo, (normal + rough).normalize(), through);
        Sample { colour, range_m, thing: object, normal, sunny, drape }
    }

    /// The colour under the label of the cell that the point seems to lie in.
    fn draped(&self, albedo: Colour, point_m: DVec3) -> (Colour, u8) {
        let size_m = self.view.cell_size_m;
        let at_m = self.map_from_world.point(point_m).truncate();
        let cell = GridSpec { size_m }.cell(at_m.x, at_m.y);
        let rows = &self.view.cells.rows;
        let Some(row) = cell.and_then(|cell| rows.binary_search_by_key(&cell, |r| r.index).ok()) else {
            return (albedo, 0);
        };
        let colour = if rows[row].untraversable() { self.palette.untraversable } else { self.palette.traversable };
        let from_border = at_m / size_m - (at_m / size_m).floor();
        let seam = from_border.min(1.0 - from_border).min_element() < 0.05;
        let mark = if rows[row].untraversable() { 1 } else { 2 };
        (mix(albedo, colour, if seam { 0.45 } else { 0.8 }), if seam { mark + 2 } else { mark })
    }

    fn tufted(&self, soil: Colour, point_m: DVec3) -> Colour {
        self.view.scene.patches.iter().fold(soil, |colour, patch| {
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
        let direct = (normal.dot(self.sun).max(0.0) * sun) as f32;
        let sky = (0.55 + 0.45 * normal.z) as f32;
        std::array::from_fn(|i| albedo[i] * (SUNLIGHT[i] * direct + SKYLIGHT[i] * sky))
    }

    fn sunny(&self, point_m: DVec3) -> bool {
        self.caster.first_hit(point_m, self.sun, 60.0).range_m.is_infinite()
            && self.model.first_hit(point_m, self.sun, 60.0).is_none()
    }

    /// The share of sunlight that passes the bushes and crowns.
    fn leaf_light(&self, point_m: DVec3) -> f64 {
        self.view.scene.volumes.iter().fold(1.0, |light, volume| match chord(volume, point_m, self.sun) {
            Some((from, to)) => light * math::exp(-volume.extinction_per_m.min(6.0) * (to - from.max(0.0))),
            None => light,
        })
    }

    fn add_leaves(&self, volume: &Volume, dir: DVec3, sample: &mut Sample) {
        let Some((from, to)) = chord(volume, self.eye_m, dir) else { return };
        let (from, to) = (from.max(0.0), to.min(sample.range_m));
        if from >= to {
            return;
        }
        // Steps through the leaves; noise gathers them in tufts and frays the rim.
        let step_m = (to - from) / LEAF_STEPS as f64;
        let (mut through, mut colour) = (1.0, [0.0_f32; 3]);
        for k in 0..LEAF_STEPS {
            let point_m = self.eye_m + dir * (from + (k as f64 + 0.5) * step_m);
            let off = (point_m - volume.centre_m) / volume.semi_axes_m;
            let tuft = 0.6 * grain3(point_m, 0.11) + 0.4 * grain3(point_m, 0.035);
            let density = ((1.0 - off.length()) * 1.6 + 2.4 * (tuft - 0.55)).max(0.0);
            let cover = 1.0 - math::exp(-volume.extinction_per_m.max(2.5) * 5.0 * density * step_m);
            // Leaves deep inside and away from the sun are darker.
            let depth = 0.35 + 0.65 * off.length() * (0.5 + 0.5 * off.normalize_or_zero().dot(self.sun));
            let albedo = lit(of_class(volume.class), (0.15 + 1.6 * tuft) as f32);
            let leaf = self.light(albedo, (off.normalize_or_zero() + self.sun * 0.4).normalize_or_zero(), depth);
            let share = (through * cover) as f32;
            colour = std::array::from_fn(|i| colour[i] + leaf[i] * share);
            through *= 1.0 - cover;
        }
        let seen = (1.0 - through) as f32;
        let hazed = self.haze(lit(colour, 1.0 / seen.max(1e-6)), from);
        sample.colour = mix(sample.colour, hazed, seen);
    }

    /// The painted plain and the sky.
    fn beyond(&self, dir: DVec3) -> Sample {
        let down_m = (self.plain_m - self.eye_m.z) / dir.z;
        let sample =
            |colour, range_m, thing| Sample { colour, range_m, thing, normal: DVec3::Z, sunny: true, drape: 0 };
        if dir.z < 0.0 && down_m > 0.0 && down_m < 2000.0 {
            let point_m = self.eye_m + dir * down_m;
            let (dunes, _) = grain(point_m.truncate(), 3.0);
            let fade = 1.0 / (1.0 + down_m / 12.0);
            let (coarse, coarse_slope) = grain(point_m.truncate(), 0.3);
            let (fine, fine_slope) = grain(point_m.truncate(), 0.09);
            let soil = mix(self.palette.low_ground, self.palette.high_ground, 0.35 + 0.3 * dunes as f32);
            let soil = lit(soil, (0.88 + (0.14 * (coarse - 0.5) + 0.12 * (fine - 0.5)) * fade) as f32);
            let rough = ((coarse_slope * 0.03 + fine_slope * 0.01) * fade).extend(0.0);
            let sunny = if self.sunny(point_m) { 1.0 } else { 0.0 };
            return sample(self.light(soil, (DVec3::Z - rough).normalize(), sunny), down_m, SKY - 1);
        }
        let share = (dir.z.max(0.0) / 0.45).min(1.0).sqrt() as f32;
        sample(mix(self.palette.horizon, self.palette.zenith, share), FAR_M, SKY)
    }

    fn haze(&self, colour: Colour, range_m: f64) -> Colour {
        mix(colour, self.palette.horizon, (1.0 - math::exp(-range_m / 70.0)) as f32)
    }

    /// The sweep's points, larger when near, where nothing hides them.
    fn draw_points(&self, canvas: &mut Canvas, seen: &[Sample]) {
        let (sweep, world_from_sensor) = (self.view.sweep, self.view.world_from_sensor());
        let clip = canvas.whole();
        for (slot, &direction) in sweep.returns.pattern.directions.iter().enumerate() {
            if sweep.returns.status[slot] != Status::Hit {
                continue;
            }
            let Some((spot, range_m)) = self.project(world_from_sensor.point(direction * sweep.returns.range_m[slot]))
            else {
                continue;
            };
            let (colour, alpha) = if self.view.on_object(slot) {
                (self.palette.obstacle_point, 0.85)
            } else {
                (self.palette.ground_point, 0.55)
            };
            let uncovered = |x: usize, y: usize| range_m <= seen[y * self.width + x].range_m + HIDDEN_M;
            canvas.disc_where(clip, spot, (5.5 / range_m).clamp(0.7, 1.5), colour, alpha, uncovered);
        }
    }
}

/// Where a ray enters and leaves a volume.
fn chord(volume: &Volume, origin: DVec3, dir: DVec3) -> Option<(f64, f64)> {
    let (o, d) = ((origin - volume.centre_m) / volume.semi_axes_m, dir / volume.semi_axes_m);
    let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
    let root = b * b - a * c;
    let (from, to) = ((-b - root.sqrt()) / a, (-b + root.sqrt()) / a);
    (root > 0.0 && to > 0.0).then_some((from, to))
}

fn captions(canvas: &mut Canvas, view: &View, overlay: Overlay, palette: &Palette) {
    let whole = canvas.whole();
    canvas.haloed_text(view.title, (20.0, 16.0), TITLE, Alignment::Left, (palette.ink, palette.halo));
    let bottom = canvas.height as f64 - 32.0;
    canvas.rectangle(whole, (14.0, bottom - 8.0), (488.0, bottom + 22.0), palette.paper, 0.85);
    let entries = match overlay {
        Overlay::Points => {
            [(palette.ground_point, "point on the ground"), (palette.obstacle_point, "point on an object")]
        }
        Overlay::Cells => [(palette.traversable, "traversable cell"), (palette.untraversable, "untraversable cell")],
    };
    for (k, (colour, text)) in entries.into_iter().enumerate() {
        let at = (26.0 + 240.0 * k as f64, bottom);
        match overlay {
            Overlay::Points => canvas.dot_entry(at, colour, text, palette),
            Overlay::Cells => canvas.square_entry(at, colour, text, palette),
        }
    }
}
