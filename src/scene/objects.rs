//! What stands and grows in a yard: solid obstacles, porous volumes, scattering patches.
//!
//! In: bodies in the `world` frame and the ground they stand on. Out: what casting hits, what labels ask for: class, id, and
//! the protrusion, the greatest height above the ground right below, which "taller than a wheel" is judged by.

use std::fmt;
use std::sync::{Arc, OnceLock};

use super::params::HeightLaw;
use super::rocks::LazyRocks;
use super::{Convex, Scene};
use crate::geometry::{DVec2, DVec3};
use crate::math;

/// What a thing is; its number is the `truth_class` of points and cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i8)]
pub enum Class {
    Ground = 0,
    Rock = 1,
    /// A wall, crate or bucket.
    Box = 2,
    /// A tree's trunk.
    Trunk = 3,
    /// A return scattered by a grass patch.
    Grass = 4,
    /// A return from inside a bush (or scattered by a bush patch).
    Bush = 5,
    /// A return from inside a tree's crown.
    Crown = 6,
}

impl Class {
    /// By number.
    pub const ALL: [Class; 7] =
        [Class::Ground, Class::Rock, Class::Box, Class::Trunk, Class::Grass, Class::Bush, Class::Crown];

    pub fn number(self) -> i8 {
        self as i8
    }

    /// The class with this number; `None` where no class has it.
    pub fn of_number(number: i8) -> Option<Class> {
        usize::try_from(number).ok().and_then(|number| Class::ALL.get(number).copied())
    }

    /// What stands on disk for a class: its number, -1 where there is none.
    pub fn number_or_none(class: Option<Class>) -> i8 {
        class.map_or(-1, Class::number)
    }

    pub fn name(self) -> &'static str {
        match self {
            Class::Ground => "ground",
            Class::Rock => "rock",
            Class::Box => "box",
            Class::Trunk => "trunk",
            Class::Grass => "grass",
            Class::Bush => "bush",
            Class::Crown => "crown",
        }
    }

    /// Whether it is one body with a surface, which the label's rule judges by its height; plants are marked one by one.
    pub fn is_solid(self) -> bool {
        matches!(self, Class::Rock | Class::Box | Class::Trunk)
    }
}

/// A solid thing that stands on (and in) the ground.
///
/// What it is made of, its [`Body`], is worked out when it is first asked for: a rock that nothing comes near is never hulled.
#[derive(Clone)]
pub struct Obstacle {
    pub id: i32,
    pub class: Class,
    /// A disc, seen from above, that the body does not leave; known before the body is.
    pub middle_m: DVec2,
    pub within_m: f64,
    pub(super) body: OnceLock<Box<Body>>,
    /// Where the body comes from, and its number there.
    pub(super) source: Option<Arc<LazyRocks>>,
    pub(super) number: u32,
}

/// A shape and what follows from it.
#[derive(Clone, Debug)]
pub struct Body {
    pub shape: Shape,
    /// Bounding sphere, world.
    pub centre_m: DVec3,
    pub radius_m: f64,
    /// Greatest height of the body above the ground right below it: what "taller than a wheel" is judged by.
    pub protrusion_m: f64,
}

#[derive(Clone, Debug)]
pub enum Shape {
    Convex(Convex),
    Cylinder(Cylinder),
}

/// An upright capped cylinder.
#[derive(Clone, Copy, Debug)]
pub struct Cylinder {
    /// Centre of the bottom disc.
    pub base_m: DVec3,
    pub radius_m: f64,
    pub height_m: f64,
}

/// An upright ellipsoid of leaves and twigs: a ray that has entered travels an exponential length before it returns.
#[derive(Clone, Copy, Debug)]
pub struct Volume {
    pub id: i32,
    /// `Bush` or `Crown`.
    pub class: Class,
    pub centre_m: DVec3,
    pub semi_axes_m: DVec3,
    pub extinction_per_m: f64,
    pub untraversable: bool,
    /// Height of its top above the ground below its centre.
    pub protrusion_m: f64,
}

/// A disc of ground whose returns scatter in height (the paper's grass and bushes).
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    pub id: i32,
    /// `Grass` or `Bush`.
    pub class: Class,
    pub centre_m: DVec2,
    pub radius_m: f64,
    /// Scale of the added height, by its law.
    pub sigma_m: f64,
    pub height_law: HeightLaw,
    pub untraversable: bool,
}

/// One thing of a scene, by its id.
#[derive(Clone, Copy, Debug)]
pub enum Object<'a> {
    Obstacle(&'a Obstacle),
    Volume(&'a Volume),
    Patch(&'a Patch),
}

/// Corners of the polygon that stands for a cylinder's rim.
const RIM: usize = 16;

impl Cylinder {
    /// Corners of its top, counter-clockwise.
    pub(crate) fn rim_m(&self) -> [DVec3; RIM] {
        let Cylinder { base_m, radius_m, height_m } = *self;
        std::array::from_fn(|k| {
            let (sin, cos) = math::sin_cos(std::f64::consts::TAU * k as f64 / RIM as f64);
            base_m + DVec3::new(cos * radius_m, sin * radius_m, height_m)
        })
    }
}

impl Body {
    /// A shape on a scene's ground, with its bounding sphere and protrusion worked out.
    pub fn new(shape: Shape, scene: &Scene) -> Body {
        let (centre_m, radius_m) = shape.bounding_sphere();
        let protrusion_m = shape.protrusion_m(scene);
        Body { shape, centre_m, radius_m, protrusion_m }
    }
}

impl Obstacle {
    /// A thing whose body is known.
    pub fn new(id: i32, class: Class, body: Body) -> Obstacle {
        let (middle_m, within_m) = (body.centre_m.truncate(), body.radius_m);
        Obstacle { id, class, middle_m, within_m, body: Box::new(body).into(), source: None, number: 0 }
    }

    /// The body: worked out at the first call, kept for later ones.
    #[inline]
    pub fn body(&self) -> &Body {
        let made = || {
            let source = self.source.as_ref().expect("an obstacle without a body has a source of bodies");
            Box::new(source.body(self.number, self.middle_m))
        };
        self.body.get_or_init(made)
    }

    /// Whether anything has asked for the body yet.
    #[cfg(test)]
    pub(super) fn has_body(&self) -> bool {
        self.body.get().is_some()
    }

    /// Whether all of it is farther than `reach_m` from a point, seen from above; without asking for the body.
    #[inline]
    pub(crate) fn is_beyond(&self, point_m: DVec2, reach_m: f64) -> bool {
        // A hair of slack, so that rounding never hides a thing that is just in reach.
        let limit_m = (reach_m + self.within_m) * (1.0 + 1e-9) + 1e-12 * point_m.abs().max_element();
        (self.middle_m - point_m).length_squared() > limit_m * limit_m
    }
}

impl fmt::Debug for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Obstacle").field("id", &self.id).field("class", &self.class).field("body", self.body()).finish()
    }
}

impl Shape {
    /// Centre and radius of a sphere around the body.
    pub(crate) fn bounding_sphere(&self) -> (DVec3, f64) {
        match self {
            Shape::Convex(convex) => convex.bounding_sphere(),
            Shape::Cylinder(cylinder) => {
                let half = DVec3::new(cylinder.radius_m, 0.0, 0.5 * cylinder.height_m);
                (cylinder.base_m + DVec3::Z * half.z, half.length() * (1.0 + 4.0 * f64::EPSILON))
            }
        }
    }

    /// Greatest height above the ground right below: at the vertices of a polyhedron, on the axis and eight rim points of a
    /// cylinder's top.
    pub fn protrusion_m(&self, scene: &Scene) -> f64 {
        match self {
            Shape::Convex(convex) => Shape::protrusion_of(&convex.vertices_m, scene),
            Shape::Cylinder(cylinder) => {
                let top = cylinder.base_m + DVec3::Z * cylinder.height_m;
                let rim: Vec<DVec3> = disc(cylinder.radius_m).map(|rim| top + rim.extend(0.0)).collect();
                Shape::protrusion_of(&rim, scene)
            }
        }
    }

    pub(super) fn protrusion_of(points_m: &[DVec3], scene: &Scene) -> f64 {
        points_m.iter().fold(f64::NEG_INFINITY, |most, p| most.max(p.z - scene.ground_below_m(p.x, p.y)))
    }
}

/// The centre of a disc and eight points of its rim.
pub(super) fn disc(radius_m: f64) -> impl Iterator<Item = DVec2> {
    let rim = (0..8).map(move |k| {
        let (sin, cos) = crate::math::sin_cos(f64::from(k) * std::f64::consts::FRAC_PI_4);
        DVec2::new(cos, sin) * radius_m
    });
    std::iter::once(DVec2::ZERO).chain(rim)
}
