//! A tree of boxes over the obstacles, for arbitrary rays.
//!
//! The tree is built by obvhs (PLOC, f32 boxes rounded outwards about the scene's centre); it is walked here in f64, so that
//! no far origin and no tiny rock is lost to f32, and each leaf is solved exactly.

use std::time::Duration;

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

use super::convex;
use crate::geometry::DVec3;
use crate::scene::Obstacle;

/// The obstacles' tree.
pub(super) struct Tree {
    bvh: Option<Bvh2>,
    /// Box coordinates are relative to this point.
    centre_m: DVec3,
}

struct Leaf(Aabb);

impl Boundable for Leaf {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Tree {
    pub(super) fn new(obstacles: &[Obstacle]) -> Tree {
        if obstacles.is_empty() {
            return Tree { bvh: None, centre_m: DVec3::ZERO };
        }
        let boxes: Vec<_> = obstacles
            .iter()
            .map(|o| convex::bounding_box(&o.body().shape, o.body().centre_m, o.body().radius_m))
            .collect();
        let low = boxes.iter().fold(DVec3::INFINITY, |a, b| a.min(b.0));
        let high = boxes.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(b.1));
        let centre_m = 0.5 * (low + high);
        let leaves: Vec<Leaf> = boxes
            .iter()
            .map(|(low, high)| {
                let (low, high) = (*low - centre_m, *high - centre_m);
                let down = |x: f64| (x as f32).next_down();
                let up = |x: f64| (x as f32).next_up();
                Leaf(Aabb::new(
                    Vec3A::new(down(low.x), down(low.y), down(low.z)),
                    Vec3A::new(up(high.x), up(high.y), up(high.z)),
                ))
            })
            .collect();
        let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        Tree { bvh: Some(build_bvh2(&leaves, params, &mut Duration::default())), centre_m }
    }

    /// Range and id of the first obstacle met in [0, to].
    pub(super) fn first_hit(&self, obstacles: &[Obstacle], origin: DVec3, dir: DVec3, to: f64) -> Option<(f64, i32)> {
        let bvh = self.bvh.as_ref()?;
        let from = origin - self.centre_m;
        let mut best = None;
        let mut limit = to;
        let mut stack = vec![0usize];
        while let Some(index) = stack.pop() {
            let node = &bvh.nodes[index];
            if entry(node.aabb(), from, dir, limit).is_none() {
                continue;
            }
            let first = node.first_index as usize;
            if !node.is_leaf() {
                // Nearer child last, so that it is taken first.
                let near = |k: usize| entry(bvh.nodes[k].aabb(), from, dir, limit).unwrap_or(f64::INFINITY);
                let (a, b) = if near(first) <= near(first + 1) { (first + 1, first) } else { (first, first + 1) };
                stack.extend([a, b]);
                continue;
            }
            for &primitive in &bvh.primitive_indices[first..first + node.prim_count as usize] {
                let obstacle = &obstacles[primitive as usize];
                if let Some(range) = convex::first_hit(&obstacle.body().shape, origin, dir, limit) {
                    // Of two at the same range the smaller id is met: the order of the tree must not matter.
                    if best.is_none_or(|(r, id)| range < r || (range == r && obstacle.id < id)) {
                        best = Some((range, obstacle.id));
                        limit = range;
                    }
                }
            }
        }
        best
    }
}

/// Where the ray enters a box within [0, to]; `None` where it does not.
fn entry(aabb: &Aabb, origin: DVec3, dir: DVec3, to: f64) -> Option<f64> {
    let (low, high) = (aabb.min.as_dvec3(), aabb.max.as_dvec3());
    let (mut enter, mut exit) = (0.0f64, to);
    for axis in 0..3 {
        if dir[axis] == 0.0 {
            if origin[axis] < low[axis] || origin[axis] > high[axis] {
                return None;
            }
            continue;
        }
        let (a, b) = ((low[axis] - origin[axis]) / dir[axis], (high[axis] - origin[axis]) / dir[axis]);
        enter = enter.max(a.min(b));
        exit = exit.min(a.max(b));
    }
    // The margin covers the rounding of the divisions.
    (enter <= exit * (1.0 + 1e-14) + 1e-14).then_some(enter)
}
