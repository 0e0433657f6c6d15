//! What a ray met: a surface or foliage at a range, and how it lies.
//!
//! In: hits of the [`Caster`]. Out: [`TrueReturn`]s, with incidence and the `top` mark on demand. Frames: world.

use super::TrueReturn;
use super::cast::{Caster, Hit};
use crate::geometry::DVec3;
use crate::scene::{Class, Ground, Obstacle, Plane, Polynomial, Shape};
use crate::wide::{LANES, Work, widest};

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

    /// Whether the ground sent the light back, and no foliage on it.
    fn is_on_ground(&self) -> bool {
        self.object == Hit::GROUND && !self.is_foliage()
    }

    /// Cosine of the angle between the ray and the surface's normal, in [0, 1]; 0 where nothing was met.
    pub(super) fn cos_incidence(&self, caster: &Caster, origin_m: DVec3, direction: DVec3) -> f64 {
        if self.is_foliage() {
            LEAF_COS_INCIDENCE
        } else if self.is_hit() {
            cos_between(caster.normal_at(self.object, origin_m + direction * self.range_m), direction)
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

/// Adds the cosines of incidence of returns along directions from one origin. On a polynomial ground the slopes of several are worked out at once.
pub(super) fn add_cosines(
    caster: &Caster,
    origin_m: DVec3,
    directions: &[DVec3],
    returns: &[TrueReturn],
    cosines: &mut Vec<f64>,
) {
    let first = cosines.len();
    let Ground::Polynomial(ground) = &caster.scene().ground else {
        let seen = returns.iter().zip(directions);
        cosines.extend(seen.map(|(ret, &direction)| ret.cos_incidence(caster, origin_m, direction)));
        return;
    };
    let beside_ground = |(ret, &direction): (&TrueReturn, &DVec3)| {
        if ret.is_on_ground() { 0.0 } else { ret.cos_incidence(caster, origin_m, direction) }
    };
    cosines.extend(returns.iter().zip(directions).map(beside_ground));
    widest(OnPolynomial { ground, origin_m, directions, returns, cosines: &mut cosines[first..] });
}

/// Cosines of the returns on the ground; others stay.
struct OnPolynomial<'a> {
    ground: &'a Polynomial,
    origin_m: DVec3,
    directions: &'a [DVec3],
    returns: &'a [TrueReturn],
    cosines: &'a mut [f64],
}

impl Work for OnPolynomial<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let OnPolynomial { ground, origin_m, directions, returns, cosines } = self;
        let (mut places, mut count) = ([0; LANES], 0);
        let [mut x_m, mut y_m] = [[0.0; LANES]; 2];
        for (place, (ret, &direction)) in returns.iter().zip(directions).enumerate() {
            if ret.is_on_ground() {
                let point_m = origin_m + direction * ret.range_m;
                (places[count], x_m[count], y_m[count]) = (place, point_m.x, point_m.y);
                count += 1;
            }
            if count == LANES || place + 1 == returns.len() {
                let [_, along_x, along_y] = ground.heights_and_gradients(&x_m, &y_m);
                for lane in 0..count {
                    let normal = DVec3::new(-along_x[lane], -along_y[lane], 1.0).normalize();
                    cosines[places[lane]] = cos_between(normal, directions[places[lane]]);
                }
                count = 0;
            }
        }
    }
}

#[inline(always)]
fn cos_between(normal: DVec3, direction: DVec3) -> f64 {
    normal.dot(direction).abs().min(1.0)
}
