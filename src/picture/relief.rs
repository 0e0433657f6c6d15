//! A yard -> its colours seen from above, with a low sun in the north-west, shadows and contour lines.
//!
//! Heights are sampled at twice the panel's resolution and averaged in linear light. Slopes of the ground are shaded at
//! `EXAGGERATION` times their steepness, as maps do; contours and shadows are not. Volumes are drawn half through, and
//! patches as tufts.

use rayon::prelude::*;

use super::canvas::Canvas;
use super::colour::{Colour, Palette, lit, mix, of_class};
use super::map::{Map, round_step};
use super::noise::speckle;
use crate::geometry::{DVec2, DVec3};
use crate::scene::{Class, Convex, Obstacle, Scene, Shape};

/// Samples a pixel along each axis.
const FINE: usize = 2;
const EXAGGERATION: f64 = 1.8;
/// Toward the sun: north-west, about 35 degrees up.
const SUN: DVec3 = DVec3::new(-0.58, 0.58, 0.574);
const AMBIENT: f64 = 0.42;

/// How a panel shows the yard.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    /// 0 full colours, 1 the paper's white: a background to draw cells on.
    pub fade: f32,
    pub contours: bool,
}

/// The yard, sampled from above.
struct Field {
    side: usize,
    spacing_m: f64,
    /// Ground, NaN outside the yard; row 0 is the north edge.
    ground_m: Vec<f64>,
    /// The highest solid surface, and the obstacle it belongs to with its facing.
    top_m: Vec<f64>,
    solid: Vec<Option<(Class, DVec3)>>,
}

pub(super) fn draw(canvas: &mut Canvas, map: &Map, scene: &Scene, style: Style, palette: &Palette) {
    let field = Field::sample(map, scene);
    let heights = field.ground_m.iter().copied().filter(|h| h.is_finite());
    let (low_m, high_m) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), h| (a.min(h), b.max(h)));
    let relief_m = (high_m - low_m).max(1e-3);
    let contour_m = round_step((relief_m / 12.0).max(0.011));
    let shaded = field.shaded();
    let colour_at = |x: usize, y: usize| -> Colour {
        let index = y * field.side + x;
        let (ground_m, gradient) = (field.ground_m[index], field.gradient(x, y));
        if !ground_m.is_finite() {
            return palette.paper;
        }
        let sunny = f64::from(u8::from(!shaded[index]));
        let light =
            |normal: DVec3| (AMBIENT + (1.18 - AMBIENT) * sunny * normal.dot(SUN).max(0.0) / SUN.z.max(0.7)) as f32;
        let at_m = map.world(((x as f64 + 0.5) / FINE as f64, (y as f64 + 0.5) / FINE as f64));
        let mut colour = match field.solid[index] {
            Some((class, normal)) => lit(of_class(class), light(normal) * 1.1),
            None => {
                let height_share = ((ground_m - low_m) / relief_m) as f32;
                let soil = tufted(mix(palette.low_ground, palette.high_ground, height_share), scene, at_m);
                let normal = DVec3::new(-EXAGGERATION * gradient.x, -EXAGGERATION * gradient.y, 1.0).normalize();
                let soil = lit(soil, light(normal));
                if style.contours {
                    mix(soil, palette.wheel, contour(ground_m, gradient, contour_m, field.spacing_m))
                } else {
                    soil
                }
            }
        };
        for volume in &scene.volumes {
            let off = (at_m - volume.centre_m.truncate()) / volume.semi_axes_m.truncate();
            let within = 1.0 - off.length_squared();
            if within > 0.0 {
                let normal = DVec3::new(off.x, off.y, within.sqrt());
                let leaves = 0.75 + 0.5 * speckle(at_m, 0.06) as f32;
                colour = mix(
                    colour,
                    lit(of_class(volume.class), light(normal) * leaves),
                    0.45 + 0.35 * within.sqrt() as f32,
                );
            }
        }
        mix(colour, palette.paper, style.fade)
    };
    let rows: Vec<Vec<Colour>> = (0..map.side)
        .into_par_iter()
        .map(|row| {
            let average = |column: usize| {
                let mut sum = [0.0_f32; 3];
                for (dy, dx) in (0..FINE * FINE).map(|k| (k / FINE, k % FINE)) {
                    let fine = colour_at(column * FINE + dx, row * FINE + dy);
                    sum = std::array::from_fn(|i| sum[i] + fine[i]);
                }
                sum.map(|c| c / (FINE * FINE) as f32)
            };
            (0..map.side).map(average).collect()
        })
        .collect();
    for (row, colours) in rows.into_iter().enumerate() {
        let start = (map.top + row) * canvas.width + map.left;
        canvas.pixels[start..start + map.side].copy_from_slice(&colours);
    }
}

impl Field {
    fn sample(map: &Map, scene: &Scene) -> Field {
        let side = map.side * FINE;
        let at = |x: usize, y: usize| map.world(((x as f64 + 0.5) / FINE as f64, (y as f64 + 0.5) / FINE as f64));
        let yard = 0.0..=scene.extent_m;
        let height = |index: usize| {
            let p = at(index % side, index / side);
            if yard.contains(&p.x) && yard.contains(&p.y) { scene.ground.height_m(p.x, p.y) } else { f64::NAN }
        };
        let ground_m: Vec<f64> = (0..side * side).into_par_iter().map(height).collect();
        let mut field = Field {
            side,
            spacing_m: map.metres_a_pixel / FINE as f64,
            top_m: ground_m.clone(),
            ground_m,
            solid: vec![None; side * side],
        };
        for obstacle in &scene.obstacles {
            field.stand(map, obstacle, at);
        }
        field
    }

    /// Writes an obstacle's upper surface over what is lower.
    fn stand(&mut self, map: &Map, obstacle: &Obstacle, at: impl Fn(usize, usize) -> DVec2) {
        let (x, y) = map.spot(obstacle.body().centre_m.truncate());
        let (x, y) = ((x - map.left as f64) * FINE as f64, (y - map.top as f64) * FINE as f64);
        let reach = obstacle.body().radius_m / self.spacing_m + 1.0;
        let range = |centre: f64| {
            let end = self.side as f64;
            ((centre - reach).clamp(0.0, end) as usize)..((centre + reach).ceil().clamp(0.0, end) as usize)
        };
        let columns = range(x);
        for row in range(y) {
            for column in columns.clone() {
                let index = row * self.side + column;
                if let Some((height_m, normal)) = top_of(&obstacle.body().shape, at(column, row))
                    && height_m > self.top_m[index]
                {
                    self.top_m[index] = height_m;
                    self.solid[index] = Some((obstacle.class, normal));
                }
            }
        }
    }

    /// Of the ground, by differences.
    fn gradient(&self, x: usize, y: usize) -> DVec2 {
        let at = |x: usize, y: usize| self.ground_m[y * self.side + x];
        let last = self.side - 1;
        let slope = |low: f64, high: f64, cells: usize| {
            let slope = (high - low) / (cells as f64 * self.spacing_m);
            if slope.is_finite() { slope } else { 0.0 }
        };
        let (west, east, north, south) =
            (x.saturating_sub(1), (x + 1).min(last), y.saturating_sub(1), (y + 1).min(last));
        DVec2::new(slope(at(west, y), at(east, y), east - west), slope(at(x, south), at(x, north), south - north))
    }

    /// Whether something stands between a sample and the sun, for each. The sun's azimuth lies along the diagonals: one walk away from the
    /// sun along each of them carries the highest ray that what was passed lets over itself.
    fn shaded(&self) -> Vec<bool> {
        // A step changes both axes by one sample.
        let rise_m = self.spacing_m * SUN.z / -SUN.x;
        let mut shaded = vec![false; self.side * self.side];
        let starts = (0..self.side).map(|x| (x, 0)).chain((1..self.side).map(|y| (0, y)));
        for (x, y) in starts {
            let mut highest_m = f64::NEG_INFINITY;
            for k in 0..self.side - x.max(y) {
                let index = (y + k) * self.side + x + k;
                let level_m = self.top_m[index] + rise_m * k as f64;
                // A hair above the surface; outside the yard nothing is known, nor casts a shadow.
                shaded[index] = highest_m > level_m + 0.004;
                highest_m = highest_m.max(level_m);
            }
        }
        shaded
    }
}

/// The height and facing of a body's upper surface over a place.
fn top_of(shape: &Shape, at_m: DVec2) -> Option<(f64, DVec3)> {
    match shape {
        Shape::Convex(convex) => top_of_convex(convex, at_m),
        Shape::Cylinder(cylinder) => {
            let off_m = (at_m - cylinder.base_m.truncate()).length();
            (off_m <= cylinder.radius_m).then_some((cylinder.base_m.z + cylinder.height_m, DVec3::Z))
        }
    }
}

fn top_of_convex(convex: &Convex, at_m: DVec2) -> Option<(f64, DVec3)> {
    let (mut top, mut bottom_m) = ((f64::INFINITY, DVec3::Z), f64::NEG_INFINITY);
    for plane in &convex.planes {
        let level = plane.normal.truncate().dot(at_m) + plane.offset_m;
        if plane.normal.z.abs() < 1e-12 {
            if level > 0.0 {
                return None;
            }
        } else if plane.normal.z > 0.0 {
            let height_m = -level / plane.normal.z;
            if height_m < top.0 {
                top = (height_m, plane.normal);
            }
        } else {
            bottom_m = bottom_m.max(-level / plane.normal.z);
        }
    }
    (top.0.is_finite() && top.0 >= bottom_m).then_some(top)
}

/// The share of a sample that a contour line covers; every fifth line is twice as strong.
fn contour(height_m: f64, gradient: DVec2, interval_m: f64, spacing_m: f64) -> f32 {
    let line = (height_m / interval_m).round();
    let away = (height_m - line * interval_m).abs() / (gradient.length().max(1e-4) * spacing_m);
    let fifth = line % 5.0 == 0.0;
    let strength = if fifth { 0.42 } else { 0.22 };
    // Flat places would be all line.
    let steep_enough = (gradient.length() / 0.01).min(1.0);
    ((FINE as f64 * 0.5 + 0.5 - away).clamp(0.0, 1.0) * strength * steep_enough) as f32
}

/// Soil, or the tufts of a patch.
fn tufted(soil: Colour, scene: &Scene, at_m: DVec2) -> Colour {
    scene.patches.iter().fold(soil, |colour, patch| {
        let off = (at_m - patch.centre_m).length() / patch.radius_m;
        if off >= 1.0 {
            return colour;
        }
        let tuft = speckle(at_m, 0.05);
        mix(colour, lit(of_class(patch.class), 0.75 + 0.5 * tuft as f32), (0.35 + 0.5 * tuft) as f32)
    })
}
