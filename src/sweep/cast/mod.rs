//! First-hit ray casting: a yard and rays -> ranges and what was met.
//!
//! In: a [`Scene`] and rays in the `world` frame (unit directions), f64. Out: a [`Hit`] a ray. Sources: curvature-bounded
//! Newton on the polynomial (`series`), Haines 1991 for convex bodies (`convex`). [`Caster`] holds what is computed once a
//! scene, [`Origin`] what is computed once a sweep, because all beams of a sweep leave one point. Ground and bodies are
//! surfaces: a ray that starts below or inside meets them where it leaves. Outside the yard there is no ground.
//! Porous volumes and patches are not met here; the beam effects see to them.
//!
//! A body of one's own, given by its vertices:
//!
//! ```
//! use marsyard::geometry::DVec3;
//! use marsyard::scene::{Class, Convex, Ground, Polynomial, Scene, Shape};
//! use marsyard::sweep::params::Cast;
//! use marsyard::sweep::{Caster, Hit};
//!
//! // A pyramid: base of 2 m x 2 m on the ground, 1 m tall.
//! let base = [(4.0, 4.0), (6.0, 4.0), (6.0, 6.0), (4.0, 6.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
//! let points: Vec<DVec3> = base.into_iter().chain([DVec3::new(5.0, 5.0, 1.0)]).collect();
//! let pyramid = Convex::hull(&points).ok_or("the points span no volume")?;
//! let yard = Scene::bare(10.0, Ground::Polynomial(Polynomial::flat(10.0)));
//! let yard = yard.with_obstacle(Class::Rock, Shape::Convex(pyramid));
//!
//! let caster = Caster::new(&yard, &Cast::Exact);
//! // Level at half the height, along x: its side is met half a metre behind the base's edge.
//! let hit = caster.first_hit(DVec3::new(1.0, 5.0, 0.5), DVec3::X, 20.0);
//! assert_eq!(hit.object, 0);
//! assert!((hit.range_m - 3.5).abs() < 1e-12);
//! // Beside it the ground, or nothing.
//! assert_eq!(caster.first_hit(DVec3::new(1.0, 1.0, 0.5), -DVec3::Z, 20.0), Hit { range_m: 0.5, object: Hit::GROUND });
//! assert_eq!(caster.first_hit(DVec3::new(1.0, 1.0, 0.5), DVec3::X, 20.0), Hit::NONE);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cell;
mod convex;
mod diamond_angle;
mod march;
mod mesh;
mod newton;
mod obstacle_grid;
mod origin;
mod packets;
mod planes;
mod polynomial;
mod pyramid;
mod raster;
mod sectors;
mod series;
mod slope_bounds;
mod tree;

use std::borrow::Cow;
use std::sync::OnceLock;

pub use origin::Origin;
pub(super) use origin::SWEEP_RAYS;

use mesh::MeshCaster;
use obstacle_grid::ObstacleGrid;
use origin::GroundFrom;
use packets::Packets;
use polynomial::PolynomialCaster;
use raster::RasterCaster;
use tree::Tree;

use super::params::Cast;
use crate::geometry::DVec3;
use crate::scene::{Ground, Raster, Scene};

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, metres; infinite where nothing was met.
    pub range_m: f64,
    /// Id of the obstacle; [`Hit::GROUND`], or [`Hit::NOTHING`].
    pub object: i32,
}

impl Hit {
    pub const GROUND: i32 = -1;
    pub const NOTHING: i32 = -2;
    /// Nothing within reach.
    pub const NONE: Hit = Hit { range_m: f64::INFINITY, object: Hit::NOTHING };
}

/// Where a sensor must not be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inside {
    /// Below the ground, by this much.
    Ground {
        depth_m: f64,
    },
    Obstacle(i32),
}

/// A scene, ready to be cast at.
pub struct Caster<'a> {
    scene: &'a Scene,
    ground: GroundCaster<'a>,
    /// For rays of any origin; a sweep casts none.
    tree: OnceLock<Tree>,
    places: ObstacleGrid,
}

enum GroundCaster<'a> {
    Polynomial(PolynomialCaster<'a>),
    Raster(RasterCaster<'a>),
    /// Ground and obstacles together.
    Mesh(MeshCaster),
}

impl<'a> Caster<'a> {
    /// Prepares a scene: certified bounds of the ground.
    pub fn new(scene: &'a Scene, cast: &Cast) -> Caster<'a> {
        let extent_m = scene.extent_m;
        let ground = match (cast, &scene.ground) {
            (Cast::Exact, Ground::Polynomial(ground)) => {
                GroundCaster::Polynomial(PolynomialCaster::new(ground, extent_m))
            }
            (Cast::Exact, Ground::Raster(raster)) => {
                GroundCaster::Raster(RasterCaster::new(Cow::Borrowed(raster), extent_m))
            }
            (Cast::Raster(sampling), ground) => {
                let raster = Raster::sampled(extent_m, sampling.spacing_m, |x, y| ground.height_m(x, y));
                GroundCaster::Raster(RasterCaster::new(Cow::Owned(raster), extent_m))
            }
            (Cast::Mesh(sampling), _) => GroundCaster::Mesh(MeshCaster::new(scene, sampling.spacing_m)),
        };
        Caster { scene, ground, tree: OnceLock::new(), places: ObstacleGrid::new(extent_m) }
    }

    /// The scene that is cast at.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// What a ray of any origin meets within `max_m`.
    pub fn first_hit(&self, origin: DVec3, dir: DVec3, max_m: f64) -> Hit {
        if !is_ray(origin, dir) {
            return Hit::NONE;
        }
        let ground = match &self.ground {
            GroundCaster::Polynomial(ground) => ground.first_hit(origin, dir, 0.0, max_m),
            GroundCaster::Raster(ground) => ground.first_hit(origin, dir, max_m),
            GroundCaster::Mesh(mesh) => return mesh.first_hit(origin, dir, max_m),
        };
        let hit = ground.map_or(Hit::NONE, |range_m| Hit { range_m, object: Hit::GROUND });
        let tree = self.tree.get_or_init(|| Tree::new(&self.scene.obstacles));
        match tree.first_hit(&self.scene.obstacles, origin, dir, hit.range_m.min(max_m)) {
            Some((range_m, object)) if range_m < hit.range_m => Hit { range_m, object },
            _ => hit,
        }
    }

    /// Prepares a sensor position for rays up to `max_range_m`.
    pub fn from(&self, origin_m: DVec3, max_range_m: f64) -> Origin<'_> {
        let ground = match &self.ground {
            GroundCaster::Polynomial(ground) => match ground.near(origin_m, max_range_m) {
                Some(near) => GroundFrom::LocalSeries(Box::new(near), ground),
                None => GroundFrom::Polynomial(ground),
            },
            GroundCaster::Raster(ground) => GroundFrom::Raster(ground, OnceLock::new()),
            GroundCaster::Mesh(mesh) => GroundFrom::Mesh(mesh),
        };
        // A mesh holds the obstacles too.
        let packets = match &ground {
            GroundFrom::Mesh(_) => None,
            _ => Packets::new(&self.scene.obstacles, &self.places, origin_m, max_range_m),
        };
        Origin { ground, packets, origin_m, max_range_m }
    }

    /// Outward unit normal of what a ray met at a point; up for nothing.
    pub fn normal_at(&self, object: i32, point_m: DVec3) -> DVec3 {
        match object {
            Hit::GROUND => self.scene.ground.normal(point_m.x, point_m.y),
            Hit::NOTHING => DVec3::Z,
            id => self.scene.obstacles.get(id as usize).map_or(DVec3::Z, |o| convex::normal(&o.body().shape, point_m)),
        }
    }

    /// Whether a point lies below the ground or in an obstacle, where no sensor can be.
    pub fn inside(&self, point_m: DVec3) -> Option<Inside> {
        let ground = &self.scene.ground;
        let depth_m = ground.height_m(point_m.x, point_m.y) - point_m.z;
        if depth_m > 0.0 && ground.contains(point_m.x, point_m.y) {
            return Some(Inside::Ground { depth_m });
        }
        let mut first = None;
        self.places.near(&self.scene.obstacles, point_m.truncate(), 0.0, |index, _| {
            let obstacle = &self.scene.obstacles[index];
            let near = first.is_none_or(|first| index < first) && !obstacle.is_beyond(point_m.truncate(), 0.0);
            if near && convex::contains(&obstacle.body().shape, point_m) {
                first = Some(index);
            }
        });
        first.map(|index| Inside::Obstacle(self.scene.obstacles[index].id))
    }
}

/// Whether there is a ray at all: finite, and with a direction.
fn is_ray(origin: DVec3, dir: DVec3) -> bool {
    origin.is_finite() && dir.is_finite() && dir != DVec3::ZERO
}

#[cfg(test)]
mod tests;
