//! World coordinates -> a square panel seen from above: axes, scale bar, things drawn in metres.

use embedded_graphics::text::Alignment;

use super::canvas::{Canvas, Clip, SMALL, Spot};
use super::colour::{Colour, Palette};
use crate::geometry::{DVec2, Pose};
use crate::math;

/// A square window on the yard, north (y) up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Map {
    /// Upper left corner and side on the canvas, pixels.
    pub left: usize,
    pub top: usize,
    pub side: usize,
    /// Lower left corner (world) and scale.
    pub south_west_m: DVec2,
    pub metres_a_pixel: f64,
}

impl Map {
    pub(super) fn new((left, top): (usize, usize), side: usize, south_west_m: DVec2, side_m: f64) -> Map {
        Map { left, top, side, south_west_m, metres_a_pixel: side_m / side as f64 }
    }

    pub(super) fn clip(&self) -> Clip {
        Clip { left: self.left, top: self.top, right: self.left + self.side, bottom: self.top + self.side }
    }

    pub(super) fn spot(&self, at_m: DVec2) -> Spot {
        let from_corner = (at_m - self.south_west_m) / self.metres_a_pixel;
        (self.left as f64 + from_corner.x, (self.top + self.side) as f64 - from_corner.y)
    }

    /// The world position of a point of the panel (pixels from its upper left corner).
    pub(super) fn world(&self, (x, y): Spot) -> DVec2 {
        self.south_west_m + DVec2::new(x, self.side as f64 - y) * self.metres_a_pixel
    }

    fn side_m(&self) -> f64 {
        self.side as f64 * self.metres_a_pixel
    }

    /// Frame, ticks with metres on the west and south sides, and a scale bar in the lower right corner.
    pub(super) fn axes(&self, canvas: &mut Canvas, palette: &Palette) {
        let Clip { left, top, right, bottom } = self.clip();
        let whole = canvas.whole();
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)].map(|(x, y)| (x as f64, y as f64));
        canvas.outline(whole, &corners, 1.5, palette.ink);
        let step_m = round_step(self.side_m() / 7.0);
        let decimals = usize::from(step_m < 1.0);
        for axis in [DVec2::X, DVec2::Y] {
            let from_m = self.south_west_m.dot(axis);
            for value_m in ticks(from_m, from_m + self.side_m() + 1e-9, step_m) {
                let at = self.spot(self.south_west_m + axis * (value_m - from_m));
                let label = format!("{value_m:.decimals$}");
                if axis == DVec2::X {
                    canvas.line(whole, at, (at.0, at.1 + 5.0), 1.2, palette.ink, 1.0);
                    canvas.text(&label, (at.0, at.1 + 8.0), SMALL, Alignment::Center, palette.ink);
                } else {
                    canvas.line(whole, (at.0 - 5.0, at.1), at, 1.2, palette.ink, 1.0);
                    canvas.text(&label, (at.0 - 8.0, at.1 - 6.0), SMALL, Alignment::Right, palette.ink);
                }
            }
        }
        canvas.text(
            "x [m]",
            ((left + right) as f64 / 2.0, bottom as f64 + 24.0),
            SMALL,
            Alignment::Center,
            palette.ink,
        );
        canvas.text("y [m]", (left as f64 - 8.0, top as f64 - 18.0), SMALL, Alignment::Right, palette.ink);
        self.scale_bar(canvas, palette);
    }

    fn scale_bar(&self, canvas: &mut Canvas, palette: &Palette) {
        let length_m = round_step(self.side_m() / 6.0);
        let length = length_m / self.metres_a_pixel;
        let (right, bottom) = ((self.left + self.side) as f64 - 16.0, (self.top + self.side) as f64 - 16.0);
        let clip = self.clip();
        canvas.rectangle(
            clip,
            (right - length - 10.0, bottom - 26.0),
            (right + 10.0, bottom + 10.0),
            palette.halo,
            0.82,
        );
        canvas.rectangle(clip, (right - length, bottom - 4.0), (right - length / 2.0, bottom + 2.0), palette.ink, 1.0);
        canvas.rectangle(clip, (right - length / 2.0, bottom - 4.0), (right, bottom + 2.0), palette.faint_ink, 1.0);
        let label = if length_m < 1.0 { format!("{length_m:.1} m") } else { format!("{length_m:.0} m") };
        canvas.text(&label, (right - length / 2.0, bottom - 21.0), SMALL, Alignment::Center, palette.ink);
    }

    /// The corners of a rectangle that moves with a pose: from its back right corner, counter-clockwise.
    pub(super) fn footprint(&self, pose: &Pose, back_right_m: DVec2, front_left_m: DVec2) -> [Spot; 4] {
        let (sin, cos) = math::sin_cos(pose.yaw_rad);
        let centre_m = pose.position_m.truncate();
        [
            (back_right_m.x, back_right_m.y),
            (front_left_m.x, back_right_m.y),
            (front_left_m.x, front_left_m.y),
            (back_right_m.x, front_left_m.y),
        ]
        .map(|(x, y)| self.spot(centre_m + DVec2::new(cos * x - sin * y, sin * x + cos * y)))
    }

    /// A path with a pale border: solid, or dashed.
    pub(super) fn path(&self, canvas: &mut Canvas, poses: &[Pose], colour: Colour, halo: Colour, dashed: bool) {
        let spots: Vec<Spot> = poses.iter().map(|p| self.spot(p.position_m.truncate())).collect();
        let clip = self.clip();
        if dashed {
            canvas.dashed(clip, &spots, 2.6, 8.0, colour);
        } else {
            canvas.polyline(clip, &spots, 5.5, halo);
            canvas.polyline(clip, &spots, 2.8, colour);
        }
    }
}

/// Ticks of one side: a step is a seventh of it or a little less.
const MOST_TICKS: u32 = 20;

/// The multiples of a step between two values. They are counted, for so far out that doubles are wider apart than a step, none
/// follows another.
fn ticks(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (from / step).ceil();
    (0..MOST_TICKS).map(move |k| (first + f64::from(k)) * step).take_while(move |value| *value <= to)
}

/// The largest of 1, 2 or 5 times a power of ten that is at most `value`.
pub(super) fn round_step(value: f64) -> f64 {
    // A yard's side lies between 1 m and 10 km: the powers from 0.01 to 1000 suffice.
    let powers = [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0];
    let steps = powers.into_iter().flat_map(|p| [p, 2.0 * p, 5.0 * p]);
    steps.take_while(|s| *s <= value * 1.000_001).last().unwrap_or(0.01)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_spots_and_world_positions_go_both_ways() {
        let map = Map::new((60, 40), 700, DVec2::new(-2.0, 3.0), 14.0);
        for at_m in [DVec2::new(-2.0, 3.0), DVec2::new(4.5, 11.25)] {
            let (x, y) = map.spot(at_m);
            assert!((map.world((x - 60.0, y - 40.0)) - at_m).length() < 1e-12);
        }
        assert_eq!(map.spot(DVec2::new(12.0, 17.0)), (760.0, 40.0));
    }

    #[test]
    fn exact_ticks_are_the_multiples_within_and_end_however_far_out() {
        assert_eq!(ticks(-0.3, 1.2, 0.5).collect::<Vec<_>>(), [0.0, 0.5, 1.0]);
        assert_eq!(ticks(2.0, 4.0, 1.0).collect::<Vec<_>>(), [2.0, 3.0, 4.0]);
        for far in [1e15, -1e15, 1e17, 1e300, f64::NAN, f64::INFINITY] {
            assert!(ticks(far, far + 10.0, 0.5).count() <= MOST_TICKS as usize, "{far}");
        }
    }

    #[test]
    fn exact_steps_are_one_two_or_five() {
        assert_eq!([0.7, 2.9, 5.0, 49.0].map(round_step), [0.5, 2.0, 5.0, 20.0]);
    }
}
