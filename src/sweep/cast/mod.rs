//! First-hit ray casting: a yard and rays -> ranges and what was met.
//!
//! In: a [`Scene`] and rays in the `world` frame (unit directions), f64. Out: a [`Hit`] a ray. Sources: curvature-bounded
//! Newton on the polynomial (`series`), Haines 1991 for convex bodies (`convex`). [`Caster`] holds what is computed once a
//! scene, [`Origin`] what is computed once a sweep, because all beams of a sweep leave one point. Ground and bodies are
//! surfaces: a ray that starts below or inside meets them where it leaves. Outside the yard there is no ground.
//! Porous volumes and patches are not met here; the beam effects see to them.

mod convex;
mod polynomial;
mod series;
mod tree;

use polynomial::PolynomialCaster;
use tree::Tree;

use super::params::Cast;
use crate::geometry::DVec3;
use crate::scene::{Ground, Scene};

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
    tree: Tree,
}

enum GroundCaster<'a> {
    Polynomial(PolynomialCaster<'a>),
}

impl<'a> Caster<'a> {
    /// Prepares a scene: certified bounds of the ground, the tree of the obstacles.
    pub fn new(scene: &'a Scene, _cast: &Cast) -> Caster<'a> {
        let ground = match &scene.ground {
            Ground::Polynomial(ground) => GroundCaster::Polynomial(PolynomialCaster::new(ground, scene.extent_m)),
            Ground::Raster(_) => unimplemented!("raster grounds follow in the next commit"),
        };
        Caster { scene, ground, tree: Tree::new(&scene.obstacles) }
    }

    /// What a ray of any origin meets within `max_m`.
    pub fn first_hit(&self, origin: DVec3, dir: DVec3, max_m: f64) -> Hit {
        let GroundCaster::Polynomial(ground) = &self.ground;
        let hit = match ground.first_hit(origin, dir, 0.0, max_m) {
            Some(range_m) => Hit { range_m, object: Hit::GROUND },
            None => Hit::NONE,
        };
        match self.tree.first_hit(&self.scene.obstacles, origin, dir, hit.range_m.min(max_m)) {
            Some((range_m, object)) => Hit { range_m, object },
            None => hit,
        }
    }

    /// Prepares a sensor position for rays up to `max_range_m`.
    pub fn from(&self, origin_m: DVec3, max_range_m: f64) -> Origin<'_> {
        Origin { caster: self, origin_m, max_range_m }
    }

    /// Outward unit normal of what a ray met at a point; up for nothing.
    pub fn normal_at(&self, object: i32, point_m: DVec3) -> DVec3 {
        let GroundCaster::Polynomial(ground) = &self.ground;
        match object {
            Hit::GROUND => {
                let slope = |dx, dy| series::along(ground.ground, point_m.x, point_m.y, dx, dy)[1];
                DVec3::new(-slope(1.0, 0.0), -slope(0.0, 1.0), 1.0).normalize()
            }
            Hit::NOTHING => DVec3::Z,
            id => self.scene.obstacles.get(id as usize).map_or(DVec3::Z, |o| convex::normal(&o.shape, point_m)),
        }
    }

    /// Whether a point lies below the ground or in an obstacle, where no sensor can be.
    pub fn inside(&self, point_m: DVec3) -> Option<Inside> {
        let GroundCaster::Polynomial(ground) = &self.ground;
        let yard = 0.0..=self.scene.extent_m;
        let clearance = ground.clearance(point_m, DVec3::Z, 0.0)[0];
        if yard.contains(&point_m.x) && yard.contains(&point_m.y) && clearance < 0.0 {
            return Some(Inside::Ground { depth_m: -clearance });
        }
        self.tree.holds(&self.scene.obstacles, point_m).map(Inside::Obstacle)
    }
}

/// A sensor position in a scene, ready to be cast from.

pub struct Origin<'a> {
    caster: &'a Caster<'a>,
    origin_m: DVec3,
    max_range_m: f64,
}

impl Origin<'_> {
    /// Casts rays in world unit directions; `hits` is overwritten, one entry a ray.
    pub fn cast(&self, dirs: &[DVec3], hits: &mut Vec<Hit>) {
        hits.clear();
        hits.extend(dirs.iter().map(|&dir| self.caster.first_hit(self.origin_m, dir, self.max_range_m)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DVec2;
    use crate::scene::{Class, Convex, Cylinder, Obstacle, Plane, Polynomial, Shape};

    fn plane_yard(obstacles: Vec<Obstacle>) -> Scene {
        let ground = Polynomial { degree: 2, centre_m: DVec2::splat(10.0), half_m: 12.0, coefficients: vec![0.0; 6] };
        Scene { extent_m: 20.0, ground: Ground::Polynomial(ground), obstacles, volumes: vec![], patches: vec![] }
    }

    fn cube(id: i32, centre_m: DVec3, half_m: f64) -> Obstacle {
        let planes = [DVec3::X, DVec3::Y, DVec3::Z]
            .iter()
            .flat_map(|&n| [n, -n])
            .map(|normal| Plane { normal, offset_m: -normal.dot(centre_m) - half_m })
            .collect();
        let shape = Shape::Convex(Convex { planes, vertices_m: vec![], faces: vec![] });
        Obstacle { id, class: Class::Box, shape, centre_m, radius_m: 1.8 * half_m, protrusion_m: half_m }
    }

    #[test]
    fn exact_ranges_on_a_plane_a_cube_and_a_cylinder() {
        let trunk = Cylinder { base_m: DVec3::new(10.0, 14.0, -1.0), radius_m: 0.5, height_m: 3.0 };
        let trunk = Obstacle {
            id: 1,
            class: Class::Trunk,
            shape: Shape::Cylinder(trunk),
            centre_m: DVec3::new(10.0, 14.0, 0.5),
            radius_m: 2.0,
            protrusion_m: 2.0,
        };
        let scene = plane_yard(vec![cube(0, DVec3::new(13.0, 10.0, 0.0), 0.5), trunk]);
        let caster = Caster::new(&scene, &Cast::Exact);
        let origin = DVec3::new(10.0, 10.0, 0.4);
        let down = DVec3::new(0.0, -0.8, -0.6);
        let mut hits = Vec::new();
        caster.from(origin, 30.0).cast(&[DVec3::X, DVec3::Y, -DVec3::Y, down, DVec3::Z, -DVec3::Z], &mut hits);
        let expected = [(2.5, 0), (3.5, 1), (f64::INFINITY, -2), (0.4 / 0.6, -1), (f64::INFINITY, -2), (0.4, -1)];
        for (hit, (range, object)) in hits.iter().zip(expected) {
            assert!((hit.range_m - range).abs() < 1e-12 || hit.range_m == range, "{hit:?} {range}");
            assert_eq!(hit.object, object);
        }
        assert_eq!(caster.inside(DVec3::new(13.0, 10.0, 0.2)), Some(Inside::Obstacle(0)));
        assert_eq!(caster.inside(DVec3::new(1.0, 1.0, -0.25)), Some(Inside::Ground { depth_m: 0.25 }));
        assert_eq!(caster.normal_at(0, DVec3::new(12.5, 10.1, 0.2)), -DVec3::X);
    }
}
