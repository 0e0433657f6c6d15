//! A stand, ground and solid bodies -> how far the rover's belly is from touching.
//!
//! In: a pose, the rover's outline and the height of its belly, the bodies near. Out: metres from the belly, a plate of the outline's length
//! and width at its height above the wheels' plane, to the highest of ground and bodies below it, along the rover's own z; nothing where
//! something reaches through, which is asked of the few bodies before the many places of the ground. Bodies are exact (their faces, cut to the outline), the ground is asked at places no more than 5 cm apart,
//! the outline's border among them. Frame: world. Not modelled: hollows and links below the plate; beyond the yard the edge's height holds.

use super::Rover;
use crate::geometry::{DVec2, DVec3, Pose, Transform};
use crate::scene::{Obstacle, Scene, Shape};
use crate::wide::{LANES, Work, widest};

/// Places where the ground is asked stand no farther apart.
const SPACING_M: f64 = 0.05;

/// Distance of the belly, `belly_m` above the wheels' plane, from what lies below it; `None` where it touches, or the ground has no height.
pub(crate) fn clearance_m(
    rover: &Rover,
    belly_m: f64,
    scene: &Scene,
    bodies: &[&Obstacle],
    pose: &Pose,
) -> Option<f64> {
    plate_clearance_m(0.5 * DVec2::new(rover.length_m, rover.width_m), belly_m, scene, bodies, pose)
}

/// The same of a plate with these half sides.
pub(crate) fn plate_clearance_m(
    half: DVec2,
    belly_m: f64,
    scene: &Scene,
    bodies: &[&Obstacle],
    pose: &Pose,
) -> Option<f64> {
    let rover_from_world = pose.transform().inverse();
    let mut highest_m = f64::NEG_INFINITY;
    for obstacle in bodies.iter().filter(|body| !body.is_beyond(pose.position_m.truncate(), half.length())) {
        let mut under = |corners: &mut dyn Iterator<Item = DVec3>| {
            let face: Vec<DVec3> = corners.map(|corner| rover_from_world.point(corner)).collect();
            highest_m = cut(face, half).into_iter().fold(highest_m, |highest_m, corner| highest_m.max(corner.z));
        };
        match &obstacle.body().shape {
            Shape::Convex(body) => {
                body.faces.iter().for_each(|face| under(&mut face.iter().map(|&k| body.vertices_m[k as usize])));
            }
            Shape::Cylinder(body) => under(&mut body.rim_m().into_iter()),
        }
        if highest_m > belly_m {
            return None;
        }
    }
    let ground_m = widest(Ground { half, scene, pose, rover_from_world: &rover_from_world, most_m: belly_m })?;
    Some(belly_m - highest_m.max(ground_m))
}

/// The ground's highest over the rectangle of these half sides, by the rover's own z; `None` where it is above `most_m`, or has no height.
struct Ground<'a> {
    half: DVec2,
    scene: &'a Scene,
    pose: &'a Pose,
    rover_from_world: &'a Transform,
    most_m: f64,
}

impl Work for Ground<'_> {
    type Out = Option<f64>;

    #[inline(always)]
    fn run(self) -> Option<f64> {
        let Ground { half, scene, pose, rover_from_world, most_m } = self;
        let [along, across] = half.to_array().map(|half_m| (2.0 * half_m / SPACING_M).ceil().max(1.0) as usize);
        let axes = pose.rotation();
        let mut highest_m = f64::NEG_INFINITY;
        let places = (along + 1) * (across + 1);
        for block in (0..places).step_by(LANES) {
            let at: [DVec3; LANES] = std::array::from_fn(|l| {
                let number = (block + l).min(places - 1);
                let (row, col) = (number / (along + 1), number % (along + 1));
                let place = half * (2.0 * DVec2::new(col as f64 / along as f64, row as f64 / across as f64) - 1.0);
                pose.position_m + axes.x_axis * place.x + axes.y_axis * place.y
            });
            let ground_m = scene.grounds_below_m(&at.map(|at| at.x), &at.map(|at| at.y));
            for (at, ground_m) in at.into_iter().zip(ground_m) {
                let above_m = rover_from_world.point(DVec3::new(at.x, at.y, ground_m)).z;
                // Written so that NaN touches.
                if above_m <= most_m {
                    highest_m = highest_m.max(above_m);
                } else {
                    return None;
                }
            }
        }
        Some(highest_m)
    }
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
