//! A rover's pose -> a camera behind and above it: pixels to rays, points to pixels.
//!
//! A pinhole of 54 degrees of horizontal field of view; x to the right and y down in pixels, metres and unit vectors in the world.

use super::super::View;
use super::super::canvas::Spot;
use crate::geometry::DVec3;
use crate::math;
use crate::sweep::Caster;

/// Tangent of half the horizontal field of view.
const HALF_FIELD: f64 = 0.51;

pub(super) struct Camera {
    /// Pixels.
    pub width: usize,
    pub height: usize,
    pub eye_m: DVec3,
    /// Unit vectors: to its right, up, and ahead.
    right: DVec3,
    up: DVec3,
    pub ahead: DVec3,
}

impl Camera {
    /// Behind the rover and to its left, looking past it at what its sensor sees.
    pub(super) fn behind(view: &View, caster: &Caster, (width, height): (usize, usize)) -> Camera {
        let pose = view.true_pose();
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
        Camera { width, height, eye_m, right, up: right.cross(ahead), ahead }
    }

    /// The unit vector through a place of the picture.
    pub(super) fn direction(&self, x: f64, y: f64) -> DVec3 {
        let scale = HALF_FIELD / (self.width as f64 / 2.0);
        let (across, above) = ((x - self.width as f64 / 2.0) * scale, (self.height as f64 / 2.0 - y) * scale);
        (self.ahead + self.right * across + self.up * above).normalize()
    }

    /// Pixels that a metre takes at a depth of a metre.
    pub(super) fn pixels_a_metre(&self) -> f64 {
        self.width as f64 / 2.0 / HALF_FIELD
    }

    /// How far a point lies ahead.
    pub(super) fn depth_m(&self, point_m: DVec3) -> f64 {
        (point_m - self.eye_m).dot(self.ahead)
    }

    /// Where a point appears, with its distance; `None` behind the camera.
    pub(super) fn project(&self, point_m: DVec3) -> Option<(Spot, f64)> {
        let off = point_m - self.eye_m;
        let depth_m = self.depth_m(point_m);
        let scale = self.pixels_a_metre() / depth_m;
        let spot = (
            self.width as f64 / 2.0 + off.dot(self.right) * scale,
            self.height as f64 / 2.0 - off.dot(self.up) * scale,
        );
        (depth_m > 0.05).then(|| (spot, off.length()))
    }
}
