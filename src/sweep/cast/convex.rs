//! First hits on convex polyhedra and upright capped cylinders, for arbitrary rays, and whether a point is inside.
//!
//! In: shapes of the scene, world frame, f64. Out: the range at which the ray meets the surface. Source: Haines 1991 for
//! polyhedra (the last entry and the first exit over all planes). A ray that starts inside meets the surface where it
//! leaves.

use crate::geometry::DVec3;
use crate::scene::{Convex, Cylinder, Shape};

/// Range of the first meeting with the shape's surface in [0, to].
pub(super) fn first_hit(shape: &Shape, origin: DVec3, dir: DVec3, to: f64) -> Option<f64> {
    match shape {
        Shape::Convex(convex) => meeting(convex_span(convex, origin, dir)?, to, || contains(shape, origin)),
        Shape::Cylinder(cylinder) => cylinder_first_hit(cylinder, origin, dir, to),
    }
}

/// As [`first_hit`], for a cylinder.
pub(super) fn cylinder_first_hit(cylinder: &Cylinder, origin: DVec3, dir: DVec3, to: f64) -> Option<f64> {
    meeting(cylinder_span(cylinder, origin, dir)?, to, || cylinder_contains(cylinder, origin))
}

/// The end of a span that a ray meets: its entry, or its exit for a ray that starts inside. A ray that leaves a surface it
/// starts on meets nothing.
fn meeting((enter, exit): (f64, f64), to: f64, inside: impl Fn() -> bool) -> Option<f64> {
    let range = if enter >= 0.0 {
        enter
    } else if inside() {
        exit
    } else {
        return None;
    };
    (range <= to).then_some(range)
}

/// Entry and exit of the line; `None` where it misses.
fn convex_span(convex: &Convex, origin: DVec3, dir: DVec3) -> Option<(f64, f64)> {
    let (mut enter, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
    for plane in &convex.planes {
        let height = plane.normal.dot(origin) + plane.offset_m;
        let rate = plane.normal.dot(dir);
        if rate == 0.0 {
            if height > 0.0 {
                return None;
            }
        } else if rate < 0.0 {
            enter = enter.max(-height / rate);
        } else {
            exit = exit.min(-height / rate);
        }
    }
    (enter <= exit && exit >= 0.0).then_some((enter, exit))
}

/// Entry and exit of the line; `None` where it misses.
fn cylinder_span(cylinder: &Cylinder, origin: DVec3, dir: DVec3) -> Option<(f64, f64)> {
    let from = origin - cylinder.base_m;
    let (mut enter, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
    let level2 = dir.x * dir.x + dir.y * dir.y;
    // (distance from the axis - radius)(distance + radius) keeps the digits that x^2 + y^2 - r^2 would lose.
    let distance = (from.x * from.x + from.y * from.y).sqrt();
    let outside = (distance - cylinder.radius_m) * (distance + cylinder.radius_m);
    if level2 > 0.0 {
        let cross = from.x * dir.y - from.y * dir.x;
        let room = level2 * cylinder.radius_m * cylinder.radius_m - cross * cross;
        if room < 0.0 {
            return None;
        }
        let along = from.x * dir.x + from.y * dir.y;
        let root = room.sqrt();
        // Both roots of level2 t^2 + 2 along t + outside = 0, without cancellation.
        let far = if along > 0.0 { -along - root } else { root - along };
        let (a, b) = (far / level2, if far == 0.0 { 0.0 } else { outside / far });
        (enter, exit) = (a.min(b), a.max(b));
    } else if outside > 0.0 {
        return None;
    }
    if dir.z != 0.0 {
        let (a, b) = (-from.z / dir.z, (cylinder.height_m - from.z) / dir.z);
        (enter, exit) = (enter.max(a.min(b)), exit.min(a.max(b)));
    } else if from.z < 0.0 || from.z > cylinder.height_m {
        return None;
    }
    (enter <= exit && exit >= 0.0).then_some((enter, exit))
}

/// Whether the point lies inside the body (its surface is outside).
pub(super) fn contains(shape: &Shape, point: DVec3) -> bool {
    match shape {
        Shape::Convex(convex) => {
            !convex.planes.is_empty() && convex.planes.iter().all(|p| p.normal.dot(point) + p.offset_m < 0.0)
        }
        Shape::Cylinder(cylinder) => cylinder_contains(cylinder, point),
    }
}

fn cylinder_contains(cylinder: &Cylinder, point: DVec3) -> bool {
    let from = point - cylinder.base_m;
    let within = from.x * from.x + from.y * from.y < cylinder.radius_m * cylinder.radius_m;
    within && from.z > 0.0 && from.z < cylinder.height_m
}

/// Outward normal of the surface nearest to a point on it.
pub(super) fn normal(shape: &Shape, point: DVec3) -> DVec3 {
    match shape {
        Shape::Convex(convex) => {
            convex
                .planes
                .iter()
                .map(|p| (p.normal.dot(point) + p.offset_m, p.normal))
                .fold((f64::NEG_INFINITY, DVec3::Z), |best, next| if next.0 > best.0 { next } else { best })
                .1
        }
        Shape::Cylinder(cylinder) => {
            let from = point - cylinder.base_m;
            let distance = (from.x * from.x + from.y * from.y).sqrt();
            let side = distance - cylinder.radius_m;
            if from.z - cylinder.height_m >= side && from.z - cylinder.height_m >= -from.z {
                DVec3::Z
            } else if -from.z >= side {
                -DVec3::Z
            } else {
                DVec3::new(from.x, from.y, 0.0) / distance
            }
        }
    }
}

/// A sphere that holds the shape: centre and radius.
pub(super) fn bounding_sphere(shape: &Shape, centre_m: DVec3, radius_m: f64) -> (DVec3, f64) {
    let (low, high) = bounding_box(shape, centre_m, radius_m);
    let centre = 0.5 * (low + high);
    let radius = match shape {
        Shape::Convex(convex) if !convex.vertices_m.is_empty() => {
            convex.vertices_m.iter().fold(0.0f64, |r, v| r.max((*v - centre).length()))
        }
        _ => (0.5 * (high - low)).length(),
    };
    (centre, radius * (1.0 + 1e-12))
}

/// A box that holds the shape: lowest and highest corner. The obstacle's own sphere serves where a shape lists no vertices.
pub(super) fn bounding_box(shape: &Shape, centre_m: DVec3, radius_m: f64) -> (DVec3, DVec3) {
    match shape {
        Shape::Convex(convex) if convex.vertices_m.is_empty() => {
            (centre_m - DVec3::splat(radius_m), centre_m + DVec3::splat(radius_m))
        }
        Shape::Convex(convex) => convex
            .vertices_m
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v))),
        Shape::Cylinder(cylinder) => {
            let out = DVec3::new(cylinder.radius_m, cylinder.radius_m, 0.0);
            let up = DVec3::new(0.0, 0.0, cylinder.height_m);
            (cylinder.base_m - out, cylinder.base_m + out + up)
        }
    }
}
