//! A scene -> what a rover must not drive into, seen from above.
//!
//! In: obstacles taller than a wheel, and bushes and patches that are untraversable. Out: convex outlines in the plane with
//! exact distances between them. A rover drives over lower obstacles as if they were not there, and under crowns that hang
//! above its mast. Frame: world, metres. Deviation: an outline is the whole body's, its buried part included. The outline of
//! an obstacle is made when something comes near it; all are, where a start or a path asks for the nearest.

use std::cell::OnceCell;

use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::scene::{Obstacle, Scene, Shape};

use super::Rover;

/// Corners of the polygon around an elliptic bush.
const ELLIPSE_CORNERS: usize = 32;
/// Room above the sensor's head under which a crown counts as in the way, metres.
const HEADROOM_M: f64 = 0.2;

/// A convex outline, counter-clockwise, grown by a radius: a disc has one corner.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outline {
    pub corners_m: Vec<DVec2>,
    pub radius_m: f64,
}

/// The square yard and what stands in it.
pub(super) struct Yard<'a> {
    pub extent_m: f64,
    things: Vec<Thing<'a>>,
    wheel_diameter_m: f64,
    /// Square buckets, row by row: where the things whose middle lies in each begin in `listed`; and one entry at the end.
    starts: Vec<u32>,
    listed: Vec<u32>,
    bucket_m: f64,
    side: usize,
    /// No thing reaches farther from its middle.
    within_m: f64,
}

/// Something that may bar the way.
struct Thing<'a> {
    /// A disc that holds its outline.
    middle_m: DVec2,
    within_m: f64,
    /// What the outline is made of, if it is not known from the start.
    obstacle: Option<&'a Obstacle>,
    /// `None` where it bars no rover.
    outline: OnceCell<Option<Outline>>,
}

impl<'a> Thing<'a> {
    fn unmade(obstacle: &'a Obstacle) -> Thing<'a> {
        let Obstacle { middle_m, within_m, .. } = *obstacle;
        Thing { middle_m, within_m, obstacle: Some(obstacle), outline: OnceCell::new() }
    }

    fn of(outline: Outline) -> Thing<'a> {
        let (low, high) = bounds(&outline.corners_m, outline.radius_m);
        let (middle_m, within_m) = (0.5 * (low + high), 0.5 * (high - low).length());
        Thing { middle_m, within_m, obstacle: None, outline: OnceCell::from(Some(outline)) }
    }
}

impl<'a> Yard<'a> {
    pub fn new(scene: &'a Scene, rover: &Rover) -> Yard<'a> {
        let mast_m = rover.mount.z_m + HEADROOM_M;
        let porous = scene.volumes.iter().filter(|v| v.untraversable).filter(|v| {
            let below_m = scene.ground_below_m(v.centre_m.x, v.centre_m.y);
            v.centre_m.z - v.semi_axes_m.z < below_m + mast_m
        });
        let porous = porous.map(|v| ellipse(v.centre_m, v.semi_axes_m));
        let patches = scene.patches.iter().filter(|p| p.untraversable).map(|p| disc(p.centre_m, p.radius_m));
        let soft = porous.chain(patches).map(Thing::of);
        Yard::of(
            scene.extent_m,
            rover.wheel_diameter_m,
            scene.obstacles.iter().map(Thing::unmade).chain(soft).collect(),
        )
    }

    fn of(extent_m: f64, wheel_diameter_m: f64, things: Vec<Thing<'a>>) -> Yard<'a> {
        let bucket_m = (extent_m / 64.0).max(1.0);
        let side = (extent_m / bucket_m).ceil() as usize;
        let within_m = things.iter().fold(0.0_f64, |most, thing| most.max(thing.within_m));
        let (starts, listed) = (vec![0; side * side + 1], vec![0; things.len()]);
        let mut yard = Yard { extent_m, things, wheel_diameter_m, starts, listed, bucket_m, side, within_m };
        yard.sort_into_buckets();
        yard
    }

    /// By counting: how many things lie in each bucket, where each bucket ends, then each thing from its bucket's end down.
    fn sort_into_buckets(&mut self) {
        let bucket_of = |yard: &Yard, k: usize| {
            let DVec2 { x, y } = yard.things[k].middle_m;
            yard.bucket_along(y) * yard.side + yard.bucket_along(x)
        };
        for k in 0..self.things.len() {
            let bucket = bucket_of(self, k);
            self.starts[bucket] += 1;
        }
        self.starts.iter_mut().fold(0, |sum, start| {
            *start += sum;
            *start
        });
        for k in (0..self.things.len()).rev() {
            let bucket = bucket_of(self, k);
            self.starts[bucket] -= 1;
            self.listed[self.starts[bucket] as usize] = k as u32;
        }
    }

    /// The outline of a thing, unless it bars no rover.
    fn outline(&self, k: usize) -> Option<&Outline> {
        let thing = &self.things[k];
        let made = || {
            let taller = thing.obstacle.filter(|o| o.protrusion_m > self.wheel_diameter_m)?;
            let outline = match &taller.shape {
                Shape::Convex(body) => Outline { corners_m: hull(&body.vertices_m), radius_m: 0.0 },
                Shape::Cylinder(body) => disc(DVec2::new(body.base_m.x, body.base_m.y), body.radius_m),
            };
            Some(outline).filter(|outline| !outline.corners_m.is_empty())
        };
        thing.outline.get_or_init(made).as_ref()
    }

    /// All outlines, in the order of the scene; makes them.
    pub fn outlines(&self) -> impl Iterator<Item = &Outline> {
        (0..self.things.len()).filter_map(|k| self.outline(k))
    }

    /// Whether a convex shape (a point, a line or a polygon) lies in the yard and keeps more than `distance_m` from every outline.
    pub fn clear(&self, shape: &[DVec2], distance_m: f64) -> bool {
        let (low, high) = bounds(shape, 0.0);
        let inside = low.min_element() >= 0.0 && high.max_element() <= self.extent_m;
        let grown = DVec2::splat(distance_m + self.within_m);
        inside
            && self.reached(low - grown, high + grown).all(|bucket| {
                let listed = &self.listed[self.starts[bucket] as usize..self.starts[bucket + 1] as usize];
                listed.iter().all(|&k| {
                    let thing = &self.things[k as usize];
                    let away = thing.middle_m - thing.middle_m.clamp(low, high);
                    let reach_m = (thing.within_m + distance_m) * (1.0 + 1e-9) + 1e-12 * self.extent_m;
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
    pub fn inside(&self, point: DVec2, margin_m: f64) -> bool {
        point.min_element() >= margin_m && point.max_element() <= self.extent_m - margin_m
    }

    /// Whether a circle lies in the yard and clear of every outline.
    pub fn clear_circle(&self, centre: DVec2, radius_m: f64) -> bool {
        self.inside(centre, radius_m) && self.clear(&[centre], radius_m)
    }

    /// The nearest outline to a point: its surface's distance (0 inside), and its nearest point.
    pub fn nearest(&self, point: DVec2) -> Option<(f64, DVec2)> {
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

impl Outline {
    /// The point of the curve at a distance outside the outline, a share `along` in [0, 1) of the way around it.
    pub fn around(&self, distance_m: f64, along: f64) -> DVec2 {
        let offset_m = self.radius_m + distance_m;
        let n = self.corners_m.len();
        let corner = |k: usize| self.corners_m[k % n];
        let perimeter: f64 = if n < 2 { 0.0 } else { (0..n).map(|k| (corner(k + 1) - corner(k)).length()).sum() };
        let mut left = along * (perimeter + std::f64::consts::TAU * offset_m);
        if n >= 2 {
            for k in 0..n {
                let edge = corner(k + 1) - corner(k);
                let length = edge.length();
                let outward = -edge.perp() / length;
                if left < length {
                    return corner(k) + edge * (left / length) + outward * offset_m;
                }
                left -= length;
                let next = corner(k + 2) - corner(k + 1);
                let turn = math::atan2(edge.perp_dot(next), edge.dot(next)).rem_euclid(std::f64::consts::TAU);
                if left < turn * offset_m {
                    return corner(k + 1) + outward.rotate(unit(left / offset_m)) * offset_m;
                }
                left -= turn * offset_m;
            }
            left = 0.0;
        }
        corner(0) + unit(if offset_m > 0.0 { left / offset_m } else { 0.0 }) * offset_m
    }
}

/// The rover's body at a place, seen from above: counter-clockwise corners.
pub(super) fn body(rover: &Rover, at_m: DVec2, yaw_rad: f64) -> [DVec2; 4] {
    let ahead = unit(yaw_rad);
    let (a, b) = (ahead * (0.5 * rover.length_m), ahead.perp() * (0.5 * rover.width_m));
    [at_m + a + b, at_m - a + b, at_m - a - b, at_m + a - b]
}

/// The unit vector at an angle.
pub(super) fn unit(angle_rad: f64) -> DVec2 {
    let (sin, cos) = math::sin_cos(angle_rad);
    DVec2::new(cos, sin)
}

/// Distance between two convex shapes (points, lines or counter-clockwise polygons); 0 where they overlap.
pub(super) fn distance(a: &[DVec2], b: &[DVec2]) -> f64 {
    if !separated(a, b) && !separated(b, a) {
        return 0.0;
    }
    let reach = |from: &[DVec2], to: &[DVec2]| {
        from.iter().map(|&p| (nearest_on_border(to, p) - p).length()).fold(f64::INFINITY, f64::min)
    };
    reach(a, b).min(reach(b, a))
}

/// Whether an edge of `a` (either side of a line; any direction for a point) has all of `b` beyond it.
fn separated(a: &[DVec2], b: &[DVec2]) -> bool {
    let n = a.len();
    if n == 1 {
        // A point lies outside a polygon where one of the polygon's edges separates; two points, where they differ.
        return b.len() == 1 && a[0] != b[0];
    }
    let beyond = |from: DVec2, to: DVec2| {
        let normal = -(to - from).perp();
        b.iter().all(|&p| (p - from).dot(normal) > 0.0)
    };
    let past_end = |from: DVec2, to: DVec2| b.iter().all(|&p| (p - to).dot(to - from) > 0.0);
    (0..n).any(|k| beyond(a[k], a[(k + 1) % n])) || (n == 2 && (past_end(a[0], a[1]) || past_end(a[1], a[0])))
}

/// The point of a convex shape that is nearest to `point`: the point itself where it lies inside.
fn nearest_point(shape: &[DVec2], point: DVec2) -> DVec2 {
    let n = shape.len();
    let inside = n >= 3 && (0..n).all(|k| (shape[(k + 1) % n] - shape[k]).perp_dot(point - shape[k]) >= 0.0);
    if inside { point } else { nearest_on_border(shape, point) }
}

fn nearest_on_border(shape: &[DVec2], point: DVec2) -> DVec2 {
    let n = shape.len();
    let mut best = shape[0];
    for k in 0..n {
        let (from, edge) = (shape[k], shape[(k + 1) % n] - shape[k]);
        let length2 = edge.length_squared();
        let along = if length2 > 0.0 { ((point - from).dot(edge) / length2).clamp(0.0, 1.0) } else { 0.0 };
        let candidate = from + edge * along;
        if (candidate - point).length_squared() < (best - point).length_squared() {
            best = candidate;
        }
    }
    best
}

fn bounds(shape: &[DVec2], grown_m: f64) -> (DVec2, DVec2) {
    let all = |pick: fn(DVec2, DVec2) -> DVec2| shape.iter().copied().reduce(pick).unwrap_or(DVec2::ZERO);
    (all(DVec2::min) - DVec2::splat(grown_m), all(DVec2::max) + DVec2::splat(grown_m))
}

fn disc(centre_m: DVec2, radius_m: f64) -> Outline {
    Outline { corners_m: vec![centre_m], radius_m }
}

fn ellipse(centre_m: DVec3, semi_axes_m: DVec3) -> Outline {
    let centre = DVec2::new(centre_m.x, centre_m.y);
    let (a, b) = (semi_axes_m.x, semi_axes_m.y);
    if (a - b).abs() <= 1e-9 * a {
        return disc(centre, a);
    }
    // Circumscribed: corners at 1 / cos(half the step) of the ellipse.
    let step = std::f64::consts::TAU / ELLIPSE_CORNERS as f64;
    let grow = 1.0 / math::cos(0.5 * step);
    let corner = |k: usize| centre + unit(k as f64 * step) * DVec2::new(a, b) * grow;
    Outline { corners_m: (0..ELLIPSE_CORNERS).map(corner).collect(), radius_m: 0.0 }
}

/// The convex outline of points seen from above, counter-clockwise (Andrew's monotone chain).
fn hull(points_m: &[DVec3]) -> Vec<DVec2> {
    let mut points: Vec<DVec2> = points_m.iter().map(|p| DVec2::new(p.x, p.y)).collect();
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b - a).perp_dot(p - b) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut outline = chain(&mut points.iter().copied());
    outline.extend(chain(&mut points.iter().rev().copied()));
    outline
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{kapvik, plane, posts, streams};
    use super::*;
    use crate::geometry::DVec3;
    use crate::random::Purpose;
    use crate::scene::{Class, Convex, Patch, Volume};

    /// A convex polygon of up to 12 corners around a random place, by the hull of random points.
    fn shape(draws: &crate::random::Stream, k: u64) -> Vec<DVec2> {
        let u = |i: u64| draws.uniform(100 * k + i);
        let (x, y, size) = (10.0 * u(0), 10.0 * u(1), 0.2 + 2.0 * u(2));
        let count = 1 + (12.0 * u(3)) as u64;
        let points: Vec<DVec3> = (0..count)
            .map(|i| DVec3::new(x + size * (u(10 + 2 * i) - 0.5), y + size * (u(11 + 2 * i) - 0.5), 0.0))
            .collect();
        hull(&points)
    }

    /// Points of a shape's border, close together.
    fn sampled(shape: &[DVec2]) -> Vec<DVec2> {
        let n = shape.len();
        let between = |k: usize| (0..200).map(move |i| shape[k].lerp(shape[(k + 1) % n], f64::from(i) / 200.0));
        (0..n).flat_map(between).collect()
    }

    #[test]
    fn equal_distances_and_sampled_borders() {
        let draws = streams(5).open(Purpose::StartPlace);
        for k in 0..300 {
            let (a, b) = (shape(&draws, 2 * k), shape(&draws, 2 * k + 1));
            let got = distance(&a, &b);
            let (many_a, many_b) = (sampled(&a), sampled(&b));
            let inside = |shape: &[DVec2], p: DVec2| shape.len() >= 3 && nearest_point(shape, p) == p;
            let overlap = many_a.iter().any(|&p| inside(&b, p)) || many_b.iter().any(|&p| inside(&a, p));
            let near = many_a
                .iter()
                .map(|&p| many_b.iter().map(|&q| (p - q).length()).fold(9e9, f64::min))
                .fold(9e9, f64::min);
            // Samples lie at most 2 sqrt(2) / 200 apart on each border.
            assert!(
                if overlap { got == 0.0 } else { got <= near + 1e-12 && got >= near - 0.015 },
                "{k}: {got} {near} {overlap}"
            );
            assert_eq!(got, distance(&b, &a));
        }
    }

    #[test]
    fn exact_distances_of_simple_shapes() {
        let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        assert_eq!(distance(&[DVec2::new(0.5, 0.5)], &square), 0.0);
        assert_eq!(distance(&[DVec2::new(4.0, 5.0)], &square), 5.0);
        assert_eq!(distance(&[DVec2::new(-1.0, 0.5), DVec2::new(2.0, 0.5)], &square), 0.0);
        assert_eq!(distance(&[DVec2::new(2.0, -5.0), DVec2::new(2.0, 5.0)], &square), 1.0);
        assert_eq!(distance(&[DVec2::ZERO, DVec2::X], &[DVec2::new(3.0, 0.0), DVec2::new(5.0, 0.0)]), 2.0);
        assert_eq!(distance(&[DVec2::ONE], &[DVec2::ONE]), 0.0);
    }

    #[test]
    fn law_an_outline_from_above_is_convex_and_holds_every_vertex() {
        let draws = streams(6).open(Purpose::StartPlace);
        for k in 0..50 {
            let points: Vec<DVec3> = (0..30)
                .map(|i| DVec3::new(draws.normal(90 * k + 3 * i), draws.normal(90 * k + 3 * i + 1), 0.0))
                .collect();
            let outline = hull(&points);
            let n = outline.len();
            for i in 0..n {
                let edge = outline[(i + 1) % n] - outline[i];
                assert!(edge.perp_dot(outline[(i + 2) % n] - outline[i]) > 0.0);
                assert!(points.iter().all(|p| edge.perp_dot(DVec2::new(p.x, p.y) - outline[i]) > -1e-12));
            }
        }
    }

    #[test]
    fn exact_the_curve_around_an_outline_keeps_its_distance() {
        let draws = streams(7).open(Purpose::StartPlace);
        for k in 0..100 {
            let outline = Outline { corners_m: shape(&draws, k), radius_m: if k % 2 == 0 { 0.0 } else { 0.3 } };
            for i in 0..50 {
                let point = outline.around(0.7, f64::from(i) / 50.0);
                let off = distance(&[point], &outline.corners_m) - outline.radius_m - 0.7;
                assert!(off.abs() < 1e-12, "{outline:?} {i}: {off}");
            }
        }
    }

    #[test]
    fn dist_the_curve_around_a_wall_is_walked_evenly() {
        // A 4 m x 1 m wall at distance 1: 10 m of sides, 2 pi of corners.
        let corners_m = vec![DVec2::ZERO, DVec2::new(4.0, 0.0), DVec2::new(4.0, 1.0), DVec2::Y];
        let outline = Outline { corners_m, radius_m: 0.0 };
        let below = (0..10_000).filter(|&i| {
            let p = outline.around(1.0, f64::from(i) / 10_000.0);
            (p.y + 1.0).abs() < 1e-9 && (0.0..=4.0).contains(&p.x)
        });
        let share = below.count() as f64 / 10_000.0;
        assert!((share - 4.0 / (10.0 + std::f64::consts::TAU)).abs() < 2e-4, "{share}");
    }

    #[test]
    fn equal_clear_by_buckets_and_by_all_outlines() {
        let draws = streams(8).open(Purpose::StartPlace);
        let outlines: Vec<Outline> = (0..200)
            .map(|k| Outline { corners_m: shape(&draws, k).iter().map(|p| *p * 20.0).collect(), radius_m: 0.2 })
            .collect();
        let yard = Yard::of(200.0, 0.1, outlines.iter().cloned().map(Thing::of).collect());
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
            untraversable: class == Class::Bush,
        };
        scene.patches = vec![patch(1.0, Class::Bush), patch(3.0, Class::Grass)];
        let yard = Yard::new(&scene, &kapvik());
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
