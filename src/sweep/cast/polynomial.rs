//! First hits on a polynomial ground, for arbitrary rays.
//!
//! In: a [`Polynomial`] over the yard [0, extent]^2, rays in the world frame, f64. Out: the range of the first crossing of
//! the surface. The ray is clipped to the yard's square and to a certified slab of heights, cut into pieces short
//! against the fitted square, and each piece is solved by [`series::first_crossing`] about its own centre. Beyond the
//! yard there is no ground, although the fit goes on. A ray that starts below the surface meets it from below.

use super::newton::LocalSeries;
use super::series::{self, Series};
use crate::geometry::DVec3;
use crate::scene::Polynomial;

/// Longest horizontal piece, as a share of half the fitted square: what keeps the monomials of a piece small.
const PIECE: f64 = 0.5;
/// Tiles along a side of the yard for the bounds of the height.
const TILES: usize = 16;

/// A polynomial ground, ready to be cast at.
#[derive(Debug)]
pub(super) struct PolynomialCaster<'a> {
    pub ground: &'a Polynomial,
    pub extent_m: f64,
    /// Certified lowest and highest ground of each tile, row by row.
    tiles: Vec<(f64, f64)>,
    /// Certified lowest and highest ground of the yard.
    pub lowest_m: f64,
    pub highest_m: f64,
}

impl<'a> PolynomialCaster<'a> {
    pub(super) fn new(ground: &'a Polynomial, extent_m: f64) -> PolynomialCaster<'a> {
        let half_m = 0.5 * extent_m / TILES as f64;
        let mut tiles = Vec::with_capacity(TILES * TILES);
        for row in 0..TILES {
            for col in 0..TILES {
                let (x, y) = ((2 * col + 1) as f64 * half_m, (2 * row + 1) as f64 * half_m);
                tiles.push(tile_bounds(ground, x, y, half_m));
            }
        }
        let lowest_m = tiles.iter().fold(f64::INFINITY, |a, t| a.min(t.0));
        let highest_m = tiles.iter().fold(f64::NEG_INFINITY, |a, t| a.max(t.1));
        PolynomialCaster { ground, extent_m, tiles, lowest_m, highest_m }
    }

    /// Certified lowest and highest ground within a horizontal distance of a point; the yard's own where none is near.
    pub(super) fn height_bounds(&self, x_m: f64, y_m: f64, radius_m: f64) -> (f64, f64) {
        let side = self.extent_m / TILES as f64;
        let mut bounds = (f64::INFINITY, f64::NEG_INFINITY);
        for row in 0..TILES {
            let dy = outside(y_m, row as f64 * side, (row + 1) as f64 * side);
            for col in 0..TILES {
                let dx = outside(x_m, col as f64 * side, (col + 1) as f64 * side);
                if dx * dx + dy * dy <= radius_m * radius_m * (1.0 + 1e-12) {
                    let tile = self.tiles[row * TILES + col];
                    bounds = (bounds.0.min(tile.0), bounds.1.max(tile.1));
                }
            }
        }
        if bounds.0 > bounds.1 { (self.lowest_m, self.highest_m) } else { bounds }
    }

    /// Height above the ground as a series in the distance from `origin + at * dir`.
    pub(super) fn clearance(&self, origin: DVec3, dir: DVec3, at: f64) -> Series {
        let point = origin + dir * at;
        let height = series::along(self.ground, point.x, point.y, dir.x, dir.y);
        let mut g = height.map(|h| -h);
        g[0] += point.z;
        g[1] += dir.z;
        g
    }

    /// Range of the first crossing in [from, to].
    pub(super) fn first_hit(&self, origin: DVec3, dir: DVec3, from: f64, to: f64) -> Option<f64> {
        let (from, to) = clip_to_square(origin, dir, self.extent_m, from, to)?;
        // Margin: the bounds are certified but for rounding.
        let margin = 1e-9 * (1.0 + self.highest_m.abs().max(self.lowest_m.abs()));
        let (from, to) = clip_axis(origin.z, dir.z, self.lowest_m - margin, self.highest_m + margin, from, to)?;
        let level = (dir.x * dir.x + dir.y * dir.y).sqrt();
        let pieces = ((to - from) * level / (PIECE * self.ground.half_m)).ceil().max(1.0);
        let length = (to - from) / pieces;
        // The ray itself is of degree 1.
        let n = self.ground.degree.max(1);
        let mut below = None;
        for piece in 0..pieces as u64 {
            let start = from + piece as f64 * length;
            let middle = start + 0.5 * length;
            let mut g = self.clearance(origin, dir, middle);
            // The side of the ground on which the ray begins is settled once, at its beginning.
            let sign = *below.get_or_insert_with(|| if value(&g, n, -0.5 * length) < 0.0 { -1.0 } else { 1.0 });
            g = g.map(|c| sign * c);
            if let Some(s) = series::first_crossing(&g, n, -0.5 * length, 0.5 * length) {
                return Some((middle + s).clamp(from, to));
            }
        }
        None
    }

    /// What rays from one point share, or `None` where they must be cast one by one: from off the yard or from below.
    pub(super) fn near(&self, origin: DVec3, max_m: f64) -> Option<LocalSeries> {
        let yard = 0.0..=self.extent_m;
        if !yard.contains(&origin.x) || !yard.contains(&origin.y) || !origin.z.is_finite() {
            return None;
        }
        let table = series::taylor(self.ground, origin.x, origin.y);
        if origin.z < table[0][0] {
            return None;
        }
        // Farther out the terms outgrow their sum, and their rounding with them.
        let mut reach_m = self.ground.half_m;
        while rounding(&table, reach_m) > 1e-13 && reach_m > 0.05 * self.ground.half_m {
            reach_m *= 0.8;
        }
        let (lowest_m, highest_m) = self.height_bounds(origin.x, origin.y, max_m);
        let margin = 1e-9 * (1.0 + highest_m.abs().max(lowest_m.abs()));
        // A sensor on the east or north border has ground straight below it: a way of 0 over a rate of 0 must not end that ray.
        let beyond = |to_border_m: f64| if to_border_m == 0.0 { f64::EPSILON * self.extent_m } else { to_border_m };
        let square_m = [-origin.x, beyond(self.extent_m - origin.x), -origin.y, beyond(self.extent_m - origin.y)];
        let to_border = square_m.iter().fold(f64::INFINITY, |least, side| least.min(side.abs()));
        Some(LocalSeries {
            degree: self.ground.degree.max(1),
            table,
            z_m: origin.z,
            reach_m,
            lowest_m: lowest_m - margin,
            highest_m: highest_m + margin,
            square_m,
            within_yard: reach_m.min(max_m) * (1.0 + 1e-12) < to_border,
            arrival_m: series::ARRIVAL_M + 4.0 * f64::EPSILON * origin.z.abs(),
        })
    }
}

/// Rounding of the expansion's sum at a distance.
fn rounding(table: &[Series], distance_m: f64) -> f64 {
    let (mut size, mut power) = (0.0, 1.0);
    for row in table {
        size += power * row.iter().map(|c| c.abs()).sum::<f64>();
        power *= distance_m;
    }
    f64::EPSILON * size
}

/// Certified bounds of the ground on a square tile: the centre's value, more or less the sum of the other terms' sizes.
fn tile_bounds(ground: &Polynomial, x_m: f64, y_m: f64, half_m: f64) -> (f64, f64) {
    let table = series::taylor(ground, x_m, y_m);
    let mut spread = 0.0;
    let mut power = half_m;
    for (k, row) in table.iter().enumerate().take(ground.degree + 1).skip(1) {
        spread += power * row[..=k].iter().map(|c| c.abs()).sum::<f64>();
        power *= half_m;
    }
    spread += 1e-12 * (spread + table[0][0].abs());
    (table[0][0] - spread, table[0][0] + spread)
}

fn value(series: &Series, degree: usize, s: f64) -> f64 {
    (0..=degree).rev().fold(0.0, |sum, k| series[k] + s * sum)
}

/// Distance from a coordinate to an interval.
fn outside(x: f64, low: f64, high: f64) -> f64 {
    (low - x).max(x - high).max(0.0)
}

/// The part of [from, to] in which a coordinate of the ray lies in [low, high].
pub(super) fn clip_axis(origin: f64, dir: f64, low: f64, high: f64, from: f64, to: f64) -> Option<(f64, f64)> {
    if dir == 0.0 {
        return (origin >= low && origin <= high).then_some((from, to));
    }
    let (a, b) = ((low - origin) / dir, (high - origin) / dir);
    let (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
    (from <= to).then_some((from, to))
}

/// The part of [from, to] in which the ray is over the yard [0, extent]^2.
pub(super) fn clip_to_square(origin: DVec3, dir: DVec3, extent_m: f64, from: f64, to: f64) -> Option<(f64, f64)> {
    let (from, to) = clip_axis(origin.x, dir.x, 0.0, extent_m, from, to)?;
    clip_axis(origin.y, dir.y, 0.0, extent_m, from, to)
}
