//! Solid bodies around a cell -> which rectangles along the headings they cannot reach.
//!
//! In: the bodies near, where the map lies in the world, the cell's middle. Out: how far each reaches along the four lines of the eight
//! headings, seen from above: an octagon around it, so that a wheel's way along a heading and a body beside it are told apart to the
//! millimetre and not to a node (discrete oriented polytopes: Klosowski et al. 1998); and the bodies' corners. Frame: map, metres from the
//! cell's middle, heights of the world. Not modelled: hollows; an octagon may reach where its body does not.

use super::bounds::LEVEL;
use super::placement::Placement;
use crate::geometry::{DVec2, DVec3};
use crate::scene::{Obstacle, Shape};

/// Lines that the headings run along, and their opposites.
const LINES: usize = 4;

/// The bodies near one cell; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Outlines {
    /// Of each body: least and most along each line.
    spans_m: Vec<[[f64; 2]; LINES]>,
    corners_m: Vec<DVec3>,
}

impl Outlines {
    pub(super) fn fill(&mut self, bodies: &[&Obstacle], placement: &Placement, at: DVec2) {
        let (spans_m, corners_m) = (&mut self.spans_m, &mut self.corners_m);
        spans_m.clear();
        corners_m.clear();
        let back = DVec2::new(placement.turn.x, -placement.turn.y);
        for obstacle in bodies {
            let (mut span_m, more_m) = ([[f64::INFINITY, f64::NEG_INFINITY]; LINES], outer_m(obstacle));
            let mut take = |corner: DVec3| {
                let away = back.rotate(corner.truncate() - at);
                for (span_m, line) in span_m.iter_mut().zip(&LEVEL) {
                    let along_m = away.dot(*line);
                    *span_m = [span_m[0].min(along_m - more_m), span_m[1].max(along_m + more_m)];
                }
                away.extend(corner.z)
            };
            match &obstacle.body().shape {
                Shape::Convex(body) => corners_m.extend(body.vertices_m.iter().map(|&corner| take(corner))),
                Shape::Cylinder(body) => {
                    let middle = take(body.base_m);
                    corners_m.push(middle + DVec3::Z * body.height_m);
                }
            }
            spans_m.push(span_m);
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.spans_m.is_empty()
    }

    /// Whether any body may reach into a rectangle around a place, as long and wide to each side as `half_m`, along a heading.
    pub(super) fn meet(&self, place: DVec2, heading: usize, half_m: DVec2) -> bool {
        let (ahead, left) = (LEVEL[heading], LEVEL[heading].perp());
        let window: [[f64; 2]; LINES] = std::array::from_fn(|k| {
            let (middle_m, line) = (place.dot(LEVEL[k]), LEVEL[k]);
            let reach_m = half_m.x * ahead.dot(line).abs() + half_m.y * left.dot(line).abs();
            [middle_m - reach_m, middle_m + reach_m]
        });
        self.spans_m.iter().any(|span_m| span_m.iter().zip(&window).all(|(a, b)| a[0] <= b[1] && b[0] <= a[1]))
    }

    /// Corners of all bodies; of a cylinder the middle of its top.
    pub(super) fn corners(&self) -> impl Iterator<Item = DVec3> {
        self.corners_m.iter().copied()
    }
}

/// How far a body reaches beyond the corners that are asked.
fn outer_m(obstacle: &Obstacle) -> f64 {
    match &obstacle.body().shape {
        Shape::Convex(_) => 0.0,
        Shape::Cylinder(body) => body.radius_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;
    use crate::scene::{Class, Convex, Ground, Polynomial, Scene};

    #[test]
    fn exact_a_box_is_met_up_to_its_border_along_every_heading_of_a_turned_map() {
        let (at, yaw_rad) = (DVec2::new(5.0, 4.0), 0.3);
        let placement = Placement::turned(DVec2::new(1.0, 2.0), at, yaw_rad);
        for (heading, ahead) in LEVEL.into_iter().enumerate() {
            // A cube of 0.2 m, its middle 0.5 m ahead along the heading, and turned with it.
            let turn_rad = yaw_rad + heading as f64 * std::f64::consts::FRAC_PI_4;
            let (sin, cos) = math::sin_cos(turn_rad);
            let middle = at + DVec2::new(cos, sin) * 0.5;
            let cube = Convex::cuboid(middle.extend(0.0), DVec3::splat(0.1), turn_rad);
            let scene = Scene::bare(10.0, Ground::Polynomial(Polynomial::flat(10.0)))
                .with_obstacle(Class::Box, Shape::Convex(cube));
            let mut outlines = Outlines::default();
            outlines.fill(&scene.obstacles.iter().collect::<Vec<_>>(), &placement, at);
            for (half_m, is_met) in [(0.4 - 1e-9, false), (0.4 + 1e-9, true)] {
                assert_eq!(outlines.meet(DVec2::ZERO, heading, DVec2::new(half_m, 0.01)), is_met, "{heading}");
                let beside = ahead * 0.5 + ahead.perp() * 0.5;
                assert_eq!(outlines.meet(beside, heading, DVec2::new(0.01, half_m)), is_met, "{heading}");
            }
            assert_eq!(outlines.corners().count(), 8);
        }
    }
}
