//! First hits on a triangle mesh of the whole scene: the fast approximation whose error is the mesh's own.
//!
//! In: a [`Scene`] and the spacing of the ground's nodes. Out: ranges in f32 accuracy. Tree: obvhs BVH2 (f32), coordinates
//! about the yard's centre, so that f32 keeps its digits. The ground is split along one diagonal; cylinders become prisms
//! of [`SIDES`] sides. Not watertight to the last bit: a ray aimed exactly at a vertex may slip through.

use std::time::Duration;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;

use super::Hit;
use crate::geometry::DVec3;
use crate::math;
use crate::scene::{Raster, Scene, Shape};

/// Sides of the prism that stands for a cylinder.
const SIDES: usize = 48;

/// A scene as triangles in a tree.
pub(super) struct MeshCaster {
    bvh: Bvh2,
    /// In the order of the tree's leaves.
    triangles: Vec<Triangle>,
    objects: Vec<i32>,
    centre_m: DVec3,
}

impl MeshCaster {
    pub(super) fn new(scene: &Scene, spacing_m: f64) -> MeshCaster {
        let ground = Raster::sampled(scene.extent_m, spacing_m, |x, y| scene.ground.height_m(x, y));
        let middle = 0.5 * scene.extent_m;
        let centre_m = DVec3::new(middle, middle, scene.ground.height_m(middle, middle));
        let mut soup = TriangleSoup { centre_m, triangles: Vec::new(), objects: Vec::new() };
        soup.ground(&ground);
        for obstacle in &scene.obstacles {
            soup.object(&obstacle.body().shape, obstacle.id);
        }
        let bvh = build_bvh2_from_tris(&soup.triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        let in_tree_order = bvh.primitive_indices.iter().map(|&k| k as usize);
        let triangles = in_tree_order.clone().map(|k| soup.triangles[k]).collect();
        let objects = in_tree_order.map(|k| soup.objects[k]).collect();
        MeshCaster { bvh, triangles, objects, centre_m }
    }

    /// What a ray meets in [0, to].
    pub(super) fn first_hit(&self, origin: DVec3, dir: DVec3, to: f64) -> Hit {
        let from = origin - self.centre_m;
        let single = |v: DVec3| Vec3A::new(v.x as f32, v.y as f32, v.z as f32);
        if !single(from).is_finite() {
            return Hit::NONE;
        }
        let mut hit = RayHit::none();
        // The tree wants finite numbers.
        let reach = to.min(1e30) as f32;
        let met = self.bvh.ray_traverse(Ray::new(single(from), single(dir), 0.0, reach), &mut hit, |ray, id| {
            self.triangles[id].intersect(ray)
        });
        if !met || hit.primitive_id == u32::MAX {
            return Hit::NONE;
        }
        Hit { range_m: f64::from(hit.t), object: self.objects[hit.primitive_id as usize] }
    }
}

/// Triangles under collection.
struct TriangleSoup {
    centre_m: DVec3,
    triangles: Vec<Triangle>,
    objects: Vec<i32>,
}

impl TriangleSoup {
    fn add(&mut self, corners: [DVec3; 3], object: i32) {
        let [v0, v1, v2] = corners.map(|p| {
            let p = p - self.centre_m;
            Vec3A::new(p.x as f32, p.y as f32, p.z as f32)
        });
        self.triangles.push(Triangle { v0, v1, v2 });
        self.objects.push(object);
    }

    fn ground(&mut self, raster: &Raster) {
        let node = |row: usize, col: usize| {
            let (x, y) = (col as f64 * raster.spacing_m, row as f64 * raster.spacing_m);
            DVec3::new(raster.origin_m.x + x, raster.origin_m.y + y, raster.heights_m[row * raster.cols + col])
        };
        for row in 0..raster.rows - 1 {
            for col in 0..raster.cols - 1 {
                let [sw, se] = [node(row, col), node(row, col + 1)];
                let [nw, ne] = [node(row + 1, col), node(row + 1, col + 1)];
                self.add([sw, se, ne], Hit::GROUND);
                self.add([sw, ne, nw], Hit::GROUND);
            }
        }
    }

    fn object(&mut self, shape: &Shape, object: i32) {
        match shape {
            Shape::Convex(convex) => {
                for face in &convex.faces {
                    let at = |k: usize| convex.vertices_m[face[k] as usize];
                    for k in 1..face.len().saturating_sub(1) {
                        self.add([at(0), at(k), at(k + 1)], object);
                    }
                }
            }
            Shape::Cylinder(cylinder) => {
                let rim = |k: usize, up: f64| {
                    let (sin, cos) = math::sin_cos(std::f64::consts::TAU * (k % SIDES) as f64 / SIDES as f64);
                    cylinder.base_m + DVec3::new(cylinder.radius_m * cos, cylinder.radius_m * sin, up)
                };
                let top = cylinder.height_m;
                let (bottom_centre, top_centre) = (cylinder.base_m, cylinder.base_m + DVec3::Z * top);
                for k in 0..SIDES {
                    self.add([rim(k, 0.0), rim(k + 1, 0.0), rim(k + 1, top)], object);
                    self.add([rim(k, 0.0), rim(k + 1, top), rim(k, top)], object);
                    self.add([top_centre, rim(k, top), rim(k + 1, top)], object);
                    self.add([bottom_centre, rim(k + 1, 0.0), rim(k, 0.0)], object);
                }
            }
        }
    }
}
