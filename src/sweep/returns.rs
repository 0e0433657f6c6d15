//! What a ray met: a surface or foliage at a range, and how it lies.
//!
//! In: hits of the [`Caster`]. Out: [`TrueReturn`]s, with incidence and the `top` mark on demand. Frames: world.

use super::TrueReturn;
use super::cast::{Caster, Hit};
use crate::geometry::DVec3;
use crate::scene::{Class, Obstacle, Plane, Shape};

/// Mean |cos| of the incidence on leaves that face all ways alike.
const LEAF_COS_INCIDENCE: f64 = 0.5;

/// A face within 30 degrees of up counts as upward: cos 30.
const UPWARD_COS: f64 = 0.866_025_403_784_438_6;

/// Points nearer than this to a face that is not upward lie on the rim, metres: about half a footprint of the short-range
/// scanners.
const RIM_M: f64 = 0.02;

/// The body that the last point lay on and the plane of its side there: most likely the next one's too.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LastFace(Option<(i32, usize)>);

impl TrueReturn {
    pub(super) const NOTHING: TrueReturn =
        TrueReturn { range_m: f64::INFINITY, object: Hit::NOTHING, class: None, top: false };

    /// A hit of the caster, with its class; whether it is a top is not asked yet.
    #[inline]
    pub(super) fn of(hit: Hit, obstacles: &[Obstacle]) -> TrueReturn {
        let class = match hit.object {
            Hit::GROUND => Class::Ground,
            id if id >= 0 => obstacles[id as usize].class,
            _ => return TrueReturn::NOTHING,
        };
        TrueReturn { range_m: hit.range_m, object: hit.object, class: Some(class), top: false }
    }

    pub(super) fn is_hit(&self) -> bool {
        self.object != Hit::NOTHING
    }

    /// Whether leaves sent the light back, not a surface.
    fn is_foliage(&self) -> bool {
        self.class.is_some_and(|class| class >= Class::Grass)
    }

    /// Cosine of the angle between the ray and the surface's normal, in [0, 1]; 0 where nothing was met.
    pub(super) fn cos_incidence(&self, caster: &Caster, origin_m: DVec3, direction: DVec3) -> f64 {
        if self.is_foliage() {
            LEAF_COS_INCIDENCE
        } else if self.is_hit() {
            let normal = caster.normal_at(self.object, origin_m + direction * self.range_m);
            normal.dot(direction).abs().min(1.0)
        } else {
            0.0
        }
    }

    /// Marks a hit that lies on the upward part of an obstacle and off its rim. `last` is what the hits before told.
    ///
    /// The question is asked of every hit and answered for those on bodies: it stands in the loop, the answer apart.
    #[inline(always)]
    pub(super) fn mark_top(&mut self, caster: &Caster, origin_m: DVec3, direction: DVec3, last: &mut LastFace) {
        if self.object >= 0 && !self.is_foliage() {
            self.top = self.is_top(caster, origin_m + direction * self.range_m, last);
        }
    }

    #[inline(never)]
    fn is_top(&self, caster: &Caster, point_m: DVec3, last: &mut LastFace) -> bool {
        let upward = || caster.normal_at(self.object, point_m).z >= UPWARD_COS;
        let body = match &caster.scene().obstacles[self.object as usize].body().shape {
            Shape::Convex(body) => body,
            Shape::Cylinder(c) => return (point_m - c.base_m).truncate().length() < c.radius_m - RIM_M && upward(),
        };
        let near = |plane: &Plane| plane.normal.dot(point_m) + plane.offset_m >= -RIM_M;
        // Most hits lie on a side, and on that of the hit before.
        if last.0.is_some_and(|(object, plane)| object == self.object && near(&body.planes[plane])) {
            return false;
        }
        let mut near_top = false;
        for (k, plane) in body.planes.iter().enumerate().filter(|(_, plane)| near(plane)) {
            if plane.normal.z < UPWARD_COS {
                *last = LastFace(Some((self.object, k)));
                return false;
            }
            near_top = true;
        }
        // Of the planes, those that lie nearer than the rim hold the point's own.
        near_top || upward()
    }
}
