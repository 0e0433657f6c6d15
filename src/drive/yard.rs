//! A scene -> what a rover must not drive into, seen from above.
//!
//! In: obstacles taller than a wheel, and bushes and patches that are untraversable. Out: convex outlines in the plane with
//! exact distances between them. A rover drives over lower obstacles as if they were not there, and under crowns that hang
//! above its mast. Frame: world, metres. Deviation: an outline is the whole body's, its buried part included.

use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::scene::{Scene, Shape};

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

/// The square yard and the outlines in it.
#[derive(Clone, Debug)]
pub(super) struct Yard {
    pub extent_m: f64,
    pub outlines: Vec<Outline>,
    /// Square buckets, row by row: which outlines reach into each.
    buckets: Vec<Vec<u32>>,
    bucket_m: f64,
    side: usize,
}

impl Yard {
    pub fn new(scene: &Scene, rover: &Rover) -> Yard {
        let solid =
            scene.obstacles.iter().filter(|o| o.protrusion_m > rover.wheel_diameter_m).map(|o| match &o.shape {
                Shape::Convex(body) => Outline { corners_m: hull(&body.vertices_m), radius_m: 0.0 },
                Shape::Cylinder(body) => disc(DVec2::new(body.base_m.x, body.base_m.y), body.radius_m),
            });
        let mast_m = rover.mount.z_m + HEADROOM_M;
        let porous = scene.volumes.iter().filter(|v| v.untraversable).filter(|v| {
            let below_m = scene.ground_below_m(v.centre_m.x, v.centre_m.y);
            v.centre_m.z - v.semi_axes_m.z < below_m + mast_m
        });
        let porous = porous.map(|v| ellipse(v.centre_m, v.semi_axes_m));
        let patches = scene.patches.iter().filter(|p| p.untraversable).map(|p| disc(p.centre_m, p.radius_m));
        let outlines = solid.chain(porous).chain(patches).filter(|o| !o.corners_m.is_empty()).collect();
        Yard::of(scene.extent_m, outlines)
    }

    fn of(extent_m: f64, outlines: Vec<Outline>) -> Yard {
        let bucket_m = (extent_m / 64.0).max(1.0);
        let side = (extent_m / bucket_m).ceil() as usize;
        let mut yard = Yard { extent_m, outlines, buckets: vec![Vec::new(); side * side], bucket_m, side };
        for k in 0..yard.outlines.len() {
            let (low, high) = bounds(&yard.outlines[k].corners_m, yard.outlines[k].radius_m);
            for bucket in yard.reached(low, high) {
                yard.buckets[bucket].push(k as u32);
            }
        }
        yard
    }

    /// Whether a convex shape (a point, a line or a polygon) lies in the yard and keeps more than `distance_m` from every outline.
    pub fn clear(&self, shape: &[DVec2], distance_m: f64) -> bool {
        let (low, high) = bounds(shape, 0.0);
        let inside = low.min_element() >= 0.0 && high.max_element() <= self.extent_m;
        inside
            && self.reached(low - DVec2::splat(distance_m), high + DVec2::splat(distance_m)).all(|bucket| {
                self.buckets[bucket].iter().all(|&k| {
                    let outline = &self.outlines[k as usize];
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

    /// The nearest outline to a point: its surface's distance (0 inside), and its nearest point.
    pub fn nearest(&self, point: DVec2) -> Option<(f64, DVec2)> {
        let mut best: Option<(f64, DVec2)> = None;
        for outline in &self.outlines {
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

    /// The buckets that a rectangle touches; things beyond the yard's edge are kept in the buckets at the edge.
    fn reached(&self, low: DVec2, high: DVec2) -> impl Iterator<Item = usize> + use<> {
        let side = self.side;
        // Float-to-integer casts saturate at 0.
        let index = |v: f64| ((v / self.bucket_m) as usize).min(side - 1);
        let (west, east) = (index(low.x), index(high.x));
        let (south, north) = (index(low.y), index(high.y));
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
