//! What stands and grows in a yard: solid obstacles, porous volumes, scattering patches.
//!
//! In: bodies in the `world` frame and the ground they stand on. Out: what casting hits, what labels ask for: class, id, and
//! the protrusion, the greatest height above the ground right below, which "taller than a wheel" is judged by.

use super::{Convex, Scene};
use crate::geometry::{DVec2, DVec3};

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

/// A solid thing that stands on (and in) the ground.
#[derive(Clone, Debug)]
pub struct Obstacle {
    pub id: i32,
    pub class: Class,
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
    /// Standard deviation of the added height.
    pub sigma_m: f64,
    pub untraversable: bool,
}

/// One thing of a scene, by its id.
#[derive(Clone, Copy, Debug)]
pub enum Object<'a> {
    Obstacle(&'a Obstacle),
    Volume(&'a Volume),
    Patch(&'a Patch),
}

impl Obstacle {
    /// A solid thing on a scene's ground, with its bounding sphere and protrusion worked out.
    pub fn new(id: i32, class: Class, shape: Shape, scene: &Scene) -> Obstacle {
        let (centre_m, radius_m) = shape.bounding_sphere();
        let protrusion_m = shape.protrusion_m(scene);
        Obstacle { id, class, shape, centre_m, radius_m, protrusion_m }
    }
}

impl Shape {
    /// Centre and radius of a sphere around the body.
    pub fn bounding_sphere(&self) -> (DVec3, f64) {
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
