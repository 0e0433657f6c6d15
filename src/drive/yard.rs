//! A scene -> what a rover must not drive into, seen from above.
//!
//! In: obstacles taller than a wheel, and bushes and patches that are untraversable. Out: convex outlines in the plane with
//! exact distances between them. A rover drives over lower obstacles as if they were not there, and under crowns that hang
//! above its mast. By the limits of the rover's file (`drive.over_bodies`) it is obstacles taller than its wheels climb or its belly clears that
//! bar the way, and the ground that it cannot cross (`barriers`). Frame: world, metres. Deviation: an outline is the whole body's, its buried part included. The outline of
//! an obstacle is made when something comes near it; all are, where a start or a path asks for the nearest.

use std::cell::OnceCell;

use super::limits::RoverLimits;
use super::outline::{Outline, bounds, disc, distance, ellipse, hull, nearest_point, unit};
use super::{Rover, barriers};
use crate::geometry::DVec2;
use crate::scene::{Obstacle, Scene, Shape};

/// Room above the sensor's head under which a crown counts as in the way, metres.
const HEADROOM_M: f64 = 0.2;

/// The square yard and what stands in it.
pub(super) struct Yard<'a> {
    pub extent_m: f64,
    obstacles: Vec<ObstacleBound<'a>>,
    /// Obstacles no taller than this bar no way.
    passable_m: f64,
    /// Square buckets, row by row: where the obstacles whose middle lies in each begin in `listed`; and one entry at the end.
    starts: Vec<u32>,
    listed: Vec<u32>,
    bucket_m: f64,
    side: usize,
    /// No obstacle reaches farther from its middle.
    within_m: f64,
}

/// Something that may bar the way.
struct ObstacleBound<'a> {
    /// A disc that holds its outline.
    middle_m: DVec2,
    within_m: f64,
    /// What the outline is made of, if it is not known from the start.
    obstacle: Option<&'a Obstacle>,
    /// `None` where it bars no rover.
    outline: OnceCell<Option<Outline>>,
}

impl<'a> ObstacleBound<'a> {
    fn unmade(obstacle: &'a Obstacle) -> ObstacleBound<'a> {
        let Obstacle { middle_m, within_m, .. } = *obstacle;
        ObstacleBound { middle_m, within_m, obstacle: Some(obstacle), outline: OnceCell::new() }
    }

    fn of(outline: Outline) -> ObstacleBound<'a> {
        let (low, high) = bounds(&outline.corners_m, outline.radius_m);
        let (middle_m, within_m) = (0.5 * (low + high), 0.5 * (high - low).length());
        ObstacleBound { middle_m, within_m, obstacle: None, outline: OnceCell::from(Some(outline)) }
    }
}

impl<'a> Yard<'a> {
    /// By the rover's wheels, or by these limits.
    pub(super) fn new(scene: &'a Scene, rover: &Rover, limits: Option<&RoverLimits>) -> Yard<'a> {
        let mast_m = rover.mount.z_m + HEADROOM_M;
        let porous = scene.volumes.iter().filter(|v| v.untraversable).filter(|v| {
            let below_m = scene.ground_below_m(v.centre_m.x, v.centre_m.y);
            v.centre_m.z - v.semi_axes_m.z < below_m + mast_m
        });
        let porous = porous.map(|v| ellipse(v.centre_m, v.semi_axes_m));
        let patches = scene.patches.iter().filter(|p| p.untraversable).map(|p| disc(p.centre_m, p.radius_m));
        let barriers = limits.map(|limits| barriers::of_ground(scene, rover, limits)).into_iter().flatten();
        let soft = porous.chain(patches).chain(barriers).map(ObstacleBound::of);
        let passable_m =
            limits.map_or(rover.wheel_diameter_m, |limits| limits.max_step_m.min(rover.belly_clearance_m()));
        Yard::of(scene.extent_m, passable_m, scene.obstacles.iter().map(ObstacleBound::unmade).chain(soft).collect())
    }

    fn of(extent_m: f64, passable_m: f64, obstacles: Vec<ObstacleBound<'a>>) -> Yard<'a> {
        let bucket_m = (extent_m / 64.0).max(1.0);
        let side = (extent_m / bucket_m).ceil() as usize;
        let within_m = obstacles.iter().fold(0.0_f64, |most, obstacle| most.max(obstacle.within_m));
        let (starts, listed) = (vec![0; side * side + 1], vec![0; obstacles.len()]);
        let mut yard = Yard { extent_m, obstacles, passable_m, starts, listed, bucket_m, side, within_m };
        yard.sort_into_buckets();
        yard
    }

    /// By counting: how many obstacles lie in each bucket, where each bucket ends, then each obstacle from its bucket's end down.
    fn sort_into_buckets(&mut self) {
        let bucket_of = |yard: &Yard, k: usize| {
            let DVec2 { x, y } = yard.obstacles[k].middle_m;
            yard.bucket_along(y) * yard.side + yard.bucket_along(x)
        };
        for k in 0..self.obstacles.len() {
            let bucket = bucket_of(self, k);
            self.starts[bucket] += 1;
        }
        self.starts.iter_mut().fold(0, |sum, start| {
            *start += sum;
            *start
        });
        for k in (0..self.obstacles.len()).rev() {
            let bucket = bucket_of(self, k);
            self.starts[bucket] -= 1;
            self.listed[self.starts[bucket] as usize] = k as u32;
        }
    }

    /// The outline of an obstacle, unless it bars no rover.
    fn outline(&self, k: usize) -> Option<&Outline> {
        let obstacle = &self.obstacles[k];
        let made = || {
            let taller = obstacle.obstacle.filter(|o| o.body().protrusion_m > self.passable_m)?;
            let outline = match &taller.body().shape {
                Shape::Convex(body) => Outline { corners_m: hull(&body.vertices_m), radius_m: 0.0 },
                Shape::Cylinder(body) => disc(DVec2::new(body.base_m.x, body.base_m.y), body.radius_m),
            };
            Some(outline).filter(|outline| !outline.corners_m.is_empty())
        };
        obstacle.outline.get_or_init(made).as_ref()
    }

    /// All outlines, in the order of the scene; makes them.
    pub(super) fn outlines(&self) -> impl Iterator<Item = &Outline> {
        (0..self.obstacles.len()).filter_map(|k| self.outline(k))
    }

    /// Whether a convex shape (a point, a line or a polygon) lies in the yard and keeps more than `distance_m` from every outline.
    pub(super) fn clear(&self, shape: &[DVec2], distance_m: f64) -> bool {
        let (low, high) = bounds(shape, 0.0);
        let inside = low.min_element() >= 0.0 && high.max_element() <= self.extent_m;
        let grown = DVec2::splat(distance_m + self.within_m);
        inside
            && self.reached(low - grown, high + grown).all(|bucket| {
                let listed = &self.listed[self.starts[bucket] as usize..self.starts[bucket + 1] as usize];
                listed.iter().all(|&k| {
                    let obstacle = &self.obstacles[k as usize];
                    let away = obstacle.middle_m - obstacle.middle_m.clamp(low, high);
                    let reach_m = (obstacle.within_m + distance_m) * (1.0 + 1e-9) + 1e-12 * self.extent_m;
                    if away.length_squared() > reach_m * reach_m {
                        return true;
                    }
                    let Some(outline) = self.outline(k as usize) else { return true };
                    let (other_low, other_high) = bounds(&outline.corners_m, outline.radius_m + distance_m);
                    let apart = other_low.cmpgt(high).any() || other_high.cmplt(low).any();
                    apart || distance(shape, &outline.corners_m) > outline.radius_m + distance_m
                })
            })
    }

    /// Whether a point lies in the yard, at least `margin_m` from its edge.
    pub(super) fn inside(&self, point: DVec2, margin_m: f64) -> bool {
        point.min_element() >= margin_m && point.max_element() <= self.extent_m - margin_m
    }

    /// Whether a circle lies in the yard and clear of every outline.
    pub(super) fn clear_circle(&self, centre: DVec2, radius_m: f64) -> bool {
        self.inside(centre, radius_m) && self.clear(&[centre], radius_m)
    }

    /// The nearest outline to a point: its surface's distance (0 inside), and its nearest point.
    pub(super) fn nearest(&self, point: DVec2) -> Option<(f64, DVec2)> {
        let mut best: Option<(f64, DVec2)> = None;
        for outline in self.outlines() {
            let (low, high) = bounds(&outline.corners_m, outline.radius_m);
            let at_least = (point - point.clamp(low, high)).length();
            if best.is_some_and(|(distance_m, _)| at_least >= distance_m) {
                continue;
            }
            let core = nearest_point(&outline.corners_m, point);
            let apart = (core - point).length();
            let distance_m = (apart - outline.radius_m).max(0.0);
            if best.is_none_or(|(least, _)| distance_m < least) {
                let surface =
                    if apart > 0.0 { core + (point - core) * (outline.radius_m.min(apart) / apart) } else { point };
                best = Some((distance_m, surface));
            }
        }
        best
    }

    /// The row or column of a coordinate; what lies beyond the yard's edge is kept in the buckets at the edge.
    fn bucket_along(&self, place_m: f64) -> usize {
        // Float-to-integer casts saturate at 0.
        ((place_m / self.bucket_m) as usize).min(self.side - 1)
    }

    /// The buckets that a rectangle touches.
    fn reached(&self, low: DVec2, high: DVec2) -> impl Iterator<Item = usize> + use<> {
        let side = self.side;
        let (west, east) = (self.bucket_along(low.x), self.bucket_along(high.x));
        let (south, north) = (self.bucket_along(low.y), self.bucket_along(high.y));
        (south..=north).flat_map(move |row| (west..=east).map(move |col| row * side + col))
    }
}

/// The rover's body at a place, seen from above: counter-clockwise corners.
pub(super) fn body(rover: &Rover, at_m: DVec2, yaw_rad: f64) -> [DVec2; 4] {
    let ahead = unit(yaw_rad);
    let (a, b) = (ahead * (0.5 * rover.length_m), ahead.perp() * (0.5 * rover.width_m));
    [at_m + a + b, at_m - a + b, at_m - a - b, at_m + a - b]
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{kapvik, plane, posts, streams};
    use super::super::outline::tests::shape;
    use super::*;
    use crate::geometry::DVec3;
    use crate::random::Purpose;
    use crate::scene::params::HeightLaw;
    use crate::scene::{Class, Convex, Patch, Volume};

    #[test]
    fn equal_clear_by_buckets_and_by_all_outlines() {
        let draws = streams(8).open(Purpose::StartPlace);
        let outlines: Vec<Outline> = (0..200)
            .map(|k| Outline { corners_m: shape(&draws, k).iter().map(|p| *p * 20.0).collect(), radius_m: 0.2 })
            .collect();
        let yard = Yard::of(200.0, 0.1, outlines.iter().cloned().map(ObstacleBound::of).collect());
        for k in 0..500 {
            let probe = shape(&draws, 1000 + k).iter().map(|p| *p * 20.0).collect::<Vec<_>>();
            let wanted_m = 3.0 * draws.uniform(99_000 + k);
            let inside = probe.iter().all(|p| yard.inside(*p, 0.0));
            let brute = inside && outlines.iter().all(|o| distance(&probe, &o.corners_m) > o.radius_m + wanted_m);
            assert_eq!(yard.clear(&probe, wanted_m), brute, "{k}");
        }
    }

    #[test]
    fn exact_what_bars_a_rover() {
        let mut scene = posts(plane(10.0, 0.0, DVec2::ZERO), &[(2.0, 2.0, 0.1)]);
        // A stone lower than Kapvik's wheel, and a crate.
        let stone = Convex::cuboid(DVec3::new(4.0, 4.0, 0.0), DVec3::new(0.2, 0.2, 0.09), 0.3);
        let crate_ = Convex::cuboid(DVec3::new(6.0, 6.0, 0.2), DVec3::new(0.3, 0.2, 0.2), 0.3);
        scene = scene.with_obstacle(Class::Rock, Shape::Convex(stone)).with_obstacle(Class::Box, Shape::Convex(crate_));
        let volume = |x: f64, z: f64, untraversable: bool| Volume {
            id: 0,
            class: Class::Bush,
            centre_m: DVec3::new(x, 8.0, z),
            semi_axes_m: DVec3::new(0.4, 0.4, 0.5),
            extinction_per_m: 5.0,
            untraversable,
            protrusion_m: 1.0,
        };
        scene.volumes = vec![volume(2.0, 0.5, true), volume(4.0, 0.5, false), volume(6.0, 3.0, true)];
        let patch = |x: f64, class: Class| Patch {
            id: 0,
            class,
            centre_m: DVec2::new(x, 9.5),
            radius_m: 0.3,
            sigma_m: 0.1,
            height_law: HeightLaw::HalfNormal,
            untraversable: class == Class::Bush,
        };
        scene.patches = vec![patch(1.0, Class::Bush), patch(3.0, Class::Grass)];
        let yard = Yard::new(&scene, &kapvik(), None);
        // Post, crate, bush on the ground and brush; not the stone, the soft bush, the high crown and the grass.
        assert_eq!(yard.outlines().count(), 4);
        for (x, y, free) in [
            (2.0, 2.0, false),
            (4.0, 4.0, true),
            (6.0, 6.0, false),
            (2.0, 8.0, false),
            (4.0, 8.0, true),
            (6.0, 8.0, true),
            (1.0, 9.5, false),
            (3.0, 9.5, true),
        ] {
            assert_eq!(yard.clear(&[DVec2::new(x, y)], 0.0), free, "({x}, {y})");
        }
    }
}
