//! Convex shapes in the plane: what a body covers seen from above, and exact distances between them.
//!
//! In: corners, world, metres. Out: [`Outline`]s (a convex polygon, counter-clockwise, or a line or a point, grown by a radius), the
//! distance between two shapes, the nearest point of one, and the curve that keeps a distance from it.

use crate::geometry::{DVec2, DVec3};
use crate::math;

/// Corners of the polygon around an elliptic bush.
const ELLIPSE_CORNERS: usize = 32;

/// A convex outline, counter-clockwise, grown by a radius: a disc has one corner.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outline {
    pub corners_m: Vec<DVec2>,
    pub radius_m: f64,
}

impl Outline {
    /// The point of the curve at a distance outside the outline, a share `along` in [0, 1) of the way around it.
    pub(super) fn around(&self, distance_m: f64, along: f64) -> DVec2 {
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
pub(super) fn nearest_point(shape: &[DVec2], point: DVec2) -> DVec2 {
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

pub(super) fn bounds(shape: &[DVec2], grown_m: f64) -> (DVec2, DVec2) {
    let all = |pick: fn(DVec2, DVec2) -> DVec2| shape.iter().copied().reduce(pick).unwrap_or(DVec2::ZERO);
    (all(DVec2::min) - DVec2::splat(grown_m), all(DVec2::max) + DVec2::splat(grown_m))
}

pub(super) fn disc(centre_m: DVec2, radius_m: f64) -> Outline {
    Outline { corners_m: vec![centre_m], radius_m }
}

pub(super) fn ellipse(centre_m: DVec3, semi_axes_m: DVec3) -> Outline {
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
pub(super) fn hull(points_m: &[DVec3]) -> Vec<DVec2> {
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
pub(super) mod tests {
    use super::super::fixtures::streams;
    use super::*;
    use crate::random::Purpose;

    /// A convex polygon of up to 12 corners around a random place, by the hull of random points.
    pub(crate) fn shape(draws: &crate::random::Stream, k: u64) -> Vec<DVec2> {
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
    fn law_equal_shares_of_the_curve_are_equally_long() {
        let draws = streams(8).open(Purpose::StartPlace);
        let drawn = (0..40).map(|k| shape(&draws, k));
        let triangle = vec![DVec2::ZERO, DVec2::new(3.0, 0.0), DVec2::new(0.0, 2.0)];
        for corners_m in drawn.chain([triangle, vec![DVec2::ZERO, DVec2::new(2.0, 1.0)], vec![DVec2::ONE]]) {
            let outline = Outline { corners_m, radius_m: 0.3 };
            let (corners, offset_m, parts) = (&outline.corners_m, 1.7, 4000);
            let sides_m: f64 =
                (0..corners.len()).map(|k| (corners[(k + 1) % corners.len()] - corners[k]).length()).sum();
            let step_m = (sides_m + std::f64::consts::TAU * offset_m) / f64::from(parts);
            let at = |i: i32| outline.around(1.4, f64::from(i) / f64::from(parts));
            for i in 0..parts - 1 {
                // A chord is shorter than its arc by a share of at most (step / radius)^2 / 24.
                let gone_m = (at(i + 1) - at(i)).length();
                let least_m = step_m * (1.0 - (step_m * step_m) / (offset_m * offset_m) / 24.0);
                assert!(gone_m > least_m - 1e-12 && gone_m < step_m + 1e-12, "{corners:?} {i}: {gone_m} {step_m}");
            }
        }
    }
}
