//! A stand, ground and solid bodies -> how far the rover's belly is from touching.
//!
//! In: a pose, the rover's outline and the height of its belly, the bodies near. Out: metres from the belly, a plate of the outline's length
//! and width at its height above the wheels' plane, to the highest of ground and bodies below it, along the rover's own z; negative where
//! something reaches through. Bodies are exact (their faces, cut to the outline), the ground is asked at places no more than 5 cm apart,
//! the outline's border among them. Frame: world. Not modelled: hollows and links below the plate; beyond the yard the edge's height holds.

use super::Rover;
use super::rolled::rim_m;
use crate::geometry::{DVec2, DVec3, Pose};
use crate::scene::{Obstacle, Scene, Shape};

/// Places where the ground is asked stand no farther apart.
const SPACING_M: f64 = 0.05;

/// Distance of the belly, `belly_m` above the wheels' plane, from what lies below it.
pub(crate) fn clearance_m(rover: &Rover, belly_m: f64, scene: &Scene, bodies: &[&Obstacle], pose: &Pose) -> f64 {
    let half = 0.5 * DVec2::new(rover.length_m, rover.width_m);
    let rover_from_world = pose.transform().inverse();
    let mut highest_m = f64::NEG_INFINITY;
    let [along, across] = [rover.length_m, rover.width_m].map(|side_m| (side_m / SPACING_M).ceil().max(1.0) as u32);
    let axes = pose.rotation();
    for (row, col) in (0..=across).flat_map(|row| (0..=along).map(move |col| (row, col))) {
        let place =
            half * (2.0 * DVec2::new(f64::from(col) / f64::from(along), f64::from(row) / f64::from(across)) - 1.0);
        let at = pose.position_m + axes.x_axis * place.x + axes.y_axis * place.y;
        let below = DVec3::new(at.x, at.y, scene.ground_below_m(at.x, at.y));
        highest_m = highest_m.max(rover_from_world.point(below).z);
        // No height at all is no clearance.
        if !below.z.is_finite() {
            return f64::NEG_INFINITY;
        }
    }
    for obstacle in bodies.iter().filter(|body| !body.is_beyond(pose.position_m.truncate(), half.length())) {
        let mut under = |corners: &mut dyn Iterator<Item = DVec3>| {
            let face: Vec<DVec3> = corners.map(|corner| rover_from_world.point(corner)).collect();
            highest_m = cut(face, half).into_iter().fold(highest_m, |highest_m, corner| highest_m.max(corner.z));
        };
        match &obstacle.body().shape {
            Shape::Convex(body) => {
                body.faces.iter().for_each(|face| under(&mut face.iter().map(|&k| body.vertices_m[k as usize])));
            }
            Shape::Cylinder(body) => under(&mut rim_m(body)),
        }
    }
    belly_m - highest_m
}

/// A polygon's part over the rectangle of these half sides (Sutherland & Hodgman 1974).
fn cut(polygon: Vec<DVec3>, half: DVec2) -> Vec<DVec3> {
    let sides = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y];
    sides.into_iter().fold(polygon, |polygon, outward| {
        let inside_m = |corner: DVec3| half.dot(outward.abs()) - outward.dot(corner.truncate());
        let mut kept = Vec::with_capacity(polygon.len() + 2);
        for (k, &corner) in polygon.iter().enumerate() {
            let next = polygon[(k + 1) % polygon.len()];
            let [here_m, there_m] = [corner, next].map(inside_m);
            if here_m >= 0.0 {
                kept.push(corner);
            }
            if (here_m >= 0.0) != (there_m >= 0.0) {
                kept.push(corner + (next - corner) * (here_m / (here_m - there_m)));
            }
        }
        kept
    })
}
