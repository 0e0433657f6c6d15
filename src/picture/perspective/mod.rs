//! A view and a caster -> the yard as a camera behind the rover would see it (figure 8a of the paper).
//!
//! The rays are cast once ([`Perspective::new`]) and serve a picture with the sweep's points and one with the labelled cells. Points are
//! laid over what hides none of them. The bar in the corner is as long as a length at the rover's depth; nearer things are larger.

mod camera;
mod light;
mod seen;

use embedded_graphics::text::Alignment;
use rayon::prelude::*;

use super::View;
use super::canvas::{Canvas, SMALL, TITLE};
use super::colour::{Colour, Palette, palette};
use super::map::round_step;
use super::model::Model;
use crate::sweep::{Caster, Status};
use camera::Camera;
use light::{Light, heights_of};
use seen::{FINE, Scenery, Seen, low_sun, parts};

const WIDTH: usize = 1440;
const HEIGHT: usize = 810;
/// Points this much behind what a pixel shows are hidden, metres: their own noise must not hide them.
const HIDDEN_M: f64 = 0.06;

/// What is laid over the yard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Overlay {
    /// The points of the sweep, where they truly were measured.
    Points,
    /// The labelled cells, where the estimate puts them, draped over all that stands in them.
    Cells,
}

/// The rover in the yard, from behind and above.
pub(crate) struct Perspective<'a> {
    scenery: Scenery<'a>,
    seen: Seen,
    palette: Palette,
}

impl<'a> Perspective<'a> {
    /// Casts the rays, on the threads of rayon's pool.
    pub(crate) fn new(view: &'a View<'a>, caster: &'a Caster<'a>) -> Perspective<'a> {
        Perspective::of_size(view, caster, (WIDTH, HEIGHT))
    }

    pub(super) fn of_size(view: &'a View<'a>, caster: &'a Caster<'a>, size: (usize, usize)) -> Perspective<'a> {
        let (pose, palette) = (view.true_pose(), palette());
        let scenery = Scenery {
            view,
            caster,
            camera: Camera::behind(view, caster, size),
            model: Model::new(view.rover, &pose, &view.rover_from_sensor, view.scene, &palette),
            sun: low_sun(pose.yaw_rad),
            plain_m: heights_of(view.scene.extent_m, |x, y| view.scene.ground.height_m(x, y)).0,
        };
        let seen = scenery.look();
        Perspective { scenery, seen, palette }
    }

    /// PNG, with the sweep or its labelled cells.
    pub(crate) fn png(&self, overlay: Overlay) -> Vec<u8> {
        let Camera { width, height, .. } = self.scenery.camera;
        let mut canvas = Canvas { width, height, pixels: self.colours(overlay) };
        if overlay == Overlay::Points {
            self.draw_points(&mut canvas);
        }
        self.captions(&mut canvas, overlay);
        self.scale_bar(&mut canvas);
        canvas.png()
    }

    fn colours(&self, overlay: Overlay) -> Vec<Colour> {
        let light = Light::new(&self.scenery, &self.palette, overlay);
        let (camera, pixels) = (&self.scenery.camera, &self.seen.pixels);
        let way = |k: usize| camera.direction((k % camera.width) as f64 + 0.5, (k / camera.width) as f64 + 0.5);
        let all = (0..pixels.len()).into_par_iter();
        let mut colours: Vec<Colour> = if overlay == Overlay::Points {
            all.map(|k| light.colour(&pixels[k], way(k))).collect()
        } else {
            let drapes: Vec<_> = all.clone().map(|k| light.drape(&pixels[k], way(k))).collect();
            let has_border = |k: usize| {
                let (x, y) = (k % camera.width, k / camera.width);
                let left = if x > 0 { k - 1 } else { k };
                let above = if y > 0 { k - camera.width } else { k };
                let right = if x + 1 < camera.width { k + 1 } else { k };
                let below = if y + 1 < camera.height { k + camera.width } else { k };
                [left, above, right, below].into_iter().any(|other| drapes[other] != drapes[k])
            };
            let of_parts = |k: usize| {
                let ways = parts(k % camera.width, k / camera.width).map(|(x, y)| camera.direction(x, y));
                mean(ways.map(|part| light.colour(&pixels[k].beside(way(k), part), part)))
            };
            all.map(|k| if has_border(k) { of_parts(k) } else { light.colour(&pixels[k], way(k)) }).collect()
        };
        let fine: Vec<Colour> = (self.seen.edges.par_iter())
            .map(|(k, surfaces)| {
                let ways = parts(k % camera.width, k / camera.width).map(|(x, y)| camera.direction(x, y));
                mean(std::array::from_fn(|n| light.colour(&surfaces[n], ways[n])))
            })
            .collect();
        self.seen.edges.iter().zip(fine).for_each(|((k, _), colour)| colours[*k] = colour);
        colours
    }

    /// The sweep's points, larger when near, where nothing hides them.
    fn draw_points(&self, canvas: &mut Canvas) {
        let (view, palette) = (self.scenery.view, &self.palette);
        let (sweep, world_from_sensor) = (view.sweep, view.world_from_sensor());
        let clip = canvas.whole();
        let width = canvas.width;
        for (slot, &direction) in sweep.returns.pattern.directions.iter().enumerate() {
            if sweep.returns.status[slot] != Status::Hit {
                continue;
            }
            let point_m = world_from_sensor.point(direction * sweep.returns.range_m[slot]);
            let Some((spot, range_m)) = self.scenery.camera.project(point_m) else { continue };
            let (colour, alpha) =
                if view.on_object(slot) { (palette.obstacle_point, 0.85) } else { (palette.ground_point, 0.55) };
            let uncovered =
                |x: usize, y: usize| range_m <= f64::from(self.seen.pixels[y * width + x].range_m) + HIDDEN_M;
            canvas.disc_where(clip, spot, (5.5 / range_m).clamp(0.7, 1.5), colour, alpha, uncovered);
        }
    }

    /// A length as it looks where the rover stands.
    fn scale_bar(&self, canvas: &mut Canvas) {
        let (camera, palette) = (&self.scenery.camera, &self.palette);
        let pixels_a_metre =
            camera.pixels_a_metre() / camera.depth_m(self.scenery.view.true_pose().position_m).max(0.1);
        let length_m = round_step(0.16 * canvas.width as f64 / pixels_a_metre);
        let length = length_m * pixels_a_metre;
        let (right, bottom) = (canvas.width as f64 - 26.0, canvas.height as f64 - 24.0);
        let label = format!("{length_m} m, at the rover");
        let left = right - length.max(8.0 * label.len() as f64);
        let whole = canvas.whole();
        canvas.rectangle(whole, (left - 12.0, bottom - 24.0), (right + 12.0, bottom + 14.0), palette.paper, 0.85);
        canvas.rectangle(whole, (right - length, bottom), (right - length / 2.0, bottom + 6.0), palette.ink, 1.0);
        canvas.rectangle(whole, (right - length / 2.0, bottom), (right, bottom + 6.0), palette.faint_ink, 1.0);
        canvas.text(&label, (right, bottom - 19.0), SMALL, Alignment::Right, palette.ink);
    }

    fn captions(&self, canvas: &mut Canvas, overlay: Overlay) {
        let palette = &self.palette;
        let whole = canvas.whole();
        canvas.haloed_text(self.scenery.view.title, (20.0, 16.0), TITLE, Alignment::Left, (palette.ink, palette.halo));
        let bottom = canvas.height as f64 - 32.0;
        canvas.rectangle(whole, (14.0, bottom - 8.0), (488.0, bottom + 22.0), palette.paper, 0.85);
        let entries = match overlay {
            Overlay::Points => {
                [(palette.ground_point, "point on the ground"), (palette.obstacle_point, "point on an object")]
            }
            Overlay::Cells => {
                [(palette.traversable, "traversable cell"), (palette.untraversable, "untraversable cell")]
            }
        };
        for (k, (colour, text)) in entries.into_iter().enumerate() {
            let at = (26.0 + 240.0 * k as f64, bottom);
            match overlay {
                Overlay::Points => canvas.dot_entry(at, colour, text, palette),
                Overlay::Cells => canvas.square_entry(at, colour, text, palette),
            }
        }
    }
}

fn mean(colours: [Colour; FINE * FINE]) -> Colour {
    let sum = colours.iter().fold([0.0_f32; 3], |sum, colour| std::array::from_fn(|c| sum[c] + colour[c]));
    sum.map(|c| c / colours.len() as f32)
}
