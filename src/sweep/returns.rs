//! What a ray met: a surface or foliage at a range, and how it lies.
//!
//! In: hits of the [`Caster`]. Out: [`Return`]s, with incidence and the `top` mark on demand. Frames: world.

use super::cast::{Caster, Hit};
use crate::geometry::DVec3;
use crate::scene::{Class, Obstacle, Shape};

/// Mean |cos| of the incidence on leaves that face all ways alike.
const LEAF_COS_INCIDENCE: f64 = 0.5;

/// A face within 30 degrees of up counts as upward: cos 30.
const UPWARD_COS: f64 = 0.866_025_403_784_438_6;

/// Points nearer than this to a face that is not upward lie on the rim, metres: about half a footprint of the short-range
/// scanners.
const RIM_M: f64 = 0.02;

/// What a ray met first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Return {
    /// Infinite where nothing was met.
    pub range_m: f64,
    pub object: i32,
    pub class: i8,
}

impl Return {
    pub const NOTHING: Return = Return { range_m: f64::INFINITY, object: Hit::NOTHING, class: -1 };

    /// A hit of the caster, with its class.
    pub fn of(hit: Hit, obstacles: &[Obstacle]) -> Return {
        match hit.object {
            Hit::GROUND => Return { range_m: hit.range_m, object: Hit::GROUND, class: Class::Ground as i8 },
            id if id >= 0 => Return { range_m: hit.range_m, object: id, class: obstacles[id as usize].class as i8 },
            _ => Return::NOTHING,
        }
    }

    pub fn is_hit(&self) -> bool {
        self.object != Hit::NOTHING
    }

    /// Whether leaves sent the light back, not a surface.
    fn is_foliage(&self) -> bool {
        self.class >= Class::Grass as i8
    }

    /// Cosine of the angle between the ray and the surface's normal, in [0, 1]; 0 where nothing was met.
    pub fn cos_incidence(&self, caster: &Caster, origin_m: DVec3, direction: DVec3) -> f64 {
        if self.is_foliage() {
            LEAF_COS_INCIDENCE
        } else if self.is_hit() {
            let normal = caster.normal_at(self.object, origin_m + direction * self.range_m);
            normal.dot(direction).abs().min(1.0)
        } else {
            0.0
        }
    }

    /// Whether the point lies on the upward part of an obstacle and off its rim.
    pub fn is_top(&self, obstacles: &[Obstacle], caster: &Caster, point_m: DVec3) -> bool {
        if self.object < 0 || self.is_foliage() {
            return false;
        }
        let off_the_rim = match &obstacles[self.object as usize].shape {
            Shape::Convex(body) => body
                .planes
                .iter()
                .filter(|plane| plane.normal.z < UPWARD_COS)
                .all(|plane| plane.normal.dot(point_m) + plane.offset_m < -RIM_M),
            Shape::Cylinder(c) => (point_m - c.base_m).truncate().length() < c.radius_m - RIM_M,
        };
        // The rim first: most hits lie on a side, whose own plane settles it.
        off_the_rim && caster.normal_at(self.object, point_m).z >= UPWARD_COS
    }
}
