//! The returns of one sweep that stand up from the ground -> a thinned surface with normals; and beside it the ground's planes, where they are asked for.
//!
//! In: points in levelled axes, metres. Out: [`Surface`]: points some [`THIN_M`] apart, each the mean of its neighbourhood, and the direction
//! in which that is thinnest (Hoppe et al. 1992). Points whose neighbourhood is too small to tell a normal are left out, and those on what lies
//! flat. Deviation: normals have no side, for nothing here asks which way a surface looks.

use super::columns::Columns;
use super::ground::GroundMap;
use crate::geometry::DVec3;
use crate::wide::{Work, in_fours};

/// Points of one cube of this side are taken for one, metres.
const THIN_M: f64 = 0.04;
/// How far a neighbourhood reaches, metres.
const NEIGHBOURHOOD_M: f64 = 0.1;
const LEAST_NEIGHBOURS: usize = 6;
/// The index spans the box around the points: none of them may be far from all others.
pub(super) const FARTHEST_M: f64 = 50.0;
/// Vertical part of the normal from which on a surface lies flat: tops and banks tell little of x, y and heading, and where they end depends on
/// how high the sensor stands.
const LEVEL: f64 = 0.85;
/// A neighbourhood is a line where the products of the axes' variances are less of the square of their sum.
const LEAST_WIDTH: f64 = 1e-6;
/// After so many, an axis that is a tenth less thin than the thinnest has a twentieth of its weight.
const SQUARINGS: usize = 5;

/// What a sweep is laid on another by.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surface {
    pub(super) columns: Columns,
    /// Of the columns' points, in their order; unit vectors.
    pub(super) normals: Vec<DVec3>,
    pub(super) ground: GroundMap,
}

impl Surface {
    /// Of points in any order; those that are not finite, or farther off than a rover's sensor sees, are left out.
    pub(crate) fn of(points_m: impl Iterator<Item = DVec3>) -> Surface {
        let (thinned, _) = Columns::of(&thinned(points_m));
        let (means_m, normals) = in_fours(Neighbourhoods(&thinned));
        let (columns, order) = Columns::of(&means_m);
        Surface { columns, normals: order.iter().map(|&k| normals[k as usize]).collect(), ground: GroundMap::default() }
    }

    /// With the ground around it, of which the means of small cells are given.
    pub(crate) fn with_ground(self, cells_m: impl Iterator<Item = DVec3>) -> Surface {
        Surface { ground: GroundMap::of(cells_m), ..self }
    }

    /// Whether it has points or ground enough to be laid on another.
    pub(crate) fn is_enough(&self) -> bool {
        self.len() >= super::pairs::LEAST_POINTS || self.ground.len() >= super::pairs::LEAST_PLANES
    }

    /// How many points it has that stand up, and how many planes of ground.
    pub(super) fn counts(&self) -> [usize; 2] {
        [self.len(), self.ground.len()]
    }

    /// How many points it has that stand up.
    pub(crate) fn len(&self) -> usize {
        self.normals.len()
    }
}

/// Means and normals of the points' neighbourhoods that tell one.
pub(super) struct Neighbourhoods<'a>(pub(super) &'a Columns);

impl Work for Neighbourhoods<'_> {
    type Out = (Vec<DVec3>, Vec<DVec3>);

    #[inline(always)]
    fn run(self) -> (Vec<DVec3>, Vec<DVec3>) {
        let (mut means_m, mut normals) = (Vec::new(), Vec::new());
        for &place_m in self.0.places_m() {
            let (mut count, mut sum_m) = (0, DVec3::ZERO);
            let (mut squares, mut products) = (DVec3::ZERO, DVec3::ZERO);
            // Relative to the place, so that a sweep far from its origin loses no digits.
            self.0.each_within(place_m, NEIGHBOURHOOD_M, |near_m| {
                let d = near_m - place_m;
                count += 1;
                sum_m += d;
                squares += d * d;
                products += DVec3::new(d.x * d.y, d.x * d.z, d.y * d.z);
            });
            if count < LEAST_NEIGHBOURS {
                continue;
            }
            let mean = sum_m / count as f64;
            let squares = squares / count as f64 - mean * mean;
            let products = products / count as f64 - DVec3::new(mean.x * mean.y, mean.x * mean.z, mean.y * mean.z);
            if let Some(normal) = thinnest(squares, products).filter(|normal| normal.z.abs() < LEVEL) {
                means_m.push(place_m + mean);
                normals.push(normal);
            }
        }
        (means_m, normals)
    }
}

/// The means of the points of each cube, cube by cube.
fn thinned(points_m: impl Iterator<Item = DVec3>) -> Vec<DVec3> {
    // A cube's number, south and west first; none lies farther than `FARTHEST_M` from the origin.
    let along = |t_m: f64| ((t_m / THIN_M).floor() + (1 << 15) as f64) as u64;
    let cube = |[x_m, y_m, z_m]: [f64; 3]| along(x_m) << 32 | along(y_m) << 16 | along(z_m);
    let mut by_cube: Vec<(u64, DVec3)> = points_m
        .filter(|point_m| point_m.is_finite() && point_m.abs().max_element() < FARTHEST_M)
        .map(|point_m| (cube(point_m.to_array()), point_m))
        .collect();
    // Stable: the points of a cube are added in the order of the sweep.
    by_cube.sort_by_key(|(cube, _)| *cube);
    let mean = |cube: &[(u64, DVec3)]| cube.iter().map(|(_, p)| *p).sum::<DVec3>() / cube.len() as f64;
    by_cube.chunk_by(|a, b| a.0 == b.0).map(mean).collect()
}

/// The eigenvector of the smallest eigenvalue of a covariance (`squares` its diagonal, `products` xy, xz, yz): the adjugate has the same
/// eigenvectors and, for that one, the largest eigenvalue, which squaring sets apart. `None` of a point or a line.
#[inline(always)]
fn thinnest(squares: DVec3, products: DVec3) -> Option<DVec3> {
    let scale = squares.element_sum().recip();
    let ([xx, yy, zz], [xy, xz, yz]) = ((squares * scale).to_array(), (products * scale).to_array());
    let mut diagonal = DVec3::new(yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
    let mut beside = DVec3::new(xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz);
    // The trace of the adjugate is the square of how wide the second axis is, over the first's.
    let is_wide = diagonal.element_sum() > LEAST_WIDTH;
    if !is_wide {
        return None;
    }
    for _ in 0..SQUARINGS {
        let scale = diagonal.element_sum().recip();
        let (d, [xy, xz, yz]) = (diagonal * scale, (beside * scale).to_array());
        diagonal =
            DVec3::new(d.x * d.x + xy * xy + xz * xz, xy * xy + d.y * d.y + yz * yz, xz * xz + yz * yz + d.z * d.z);
        beside =
            DVec3::new(d.x * xy + xy * d.y + xz * yz, d.x * xz + xy * yz + xz * d.z, xy * xz + d.y * yz + yz * d.z);
    }
    // Its longest column is along the vector.
    let column = if diagonal.x >= diagonal.y && diagonal.x >= diagonal.z {
        DVec3::new(diagonal.x, beside.x, beside.y)
    } else if diagonal.y >= diagonal.z {
        DVec3::new(beside.x, diagonal.y, beside.z)
    } else {
        DVec3::new(beside.y, beside.z, diagonal.z)
    };
    column.try_normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;

    #[test]
    fn equal_thinnest_direction_and_nalgebras_eigenvector() {
        let mut told = 0;
        for trial in 0..500 {
            let wave = |k: usize| math::sin((7 * trial + k) as f64 * (1.3 + k as f64));
            let a = nalgebra::Matrix3::from_fn(|r, c| wave(3 * r + c));
            let scale = [1e-12, 1e-4, 1.0, 1e6][trial % 4];
            let covariance = a * a.transpose() * scale;
            let eigen = nalgebra::SymmetricEigen::new(covariance);
            let least = eigen.eigenvalues.imin();
            // The second is wide enough apart for the order to be clear.
            let mut variances = eigen.eigenvalues.as_slice().to_vec();
            variances.sort_by(f64::total_cmp);
            if variances[0] > 0.3 * variances[1] || variances[1] < 1e-3 * variances[2] {
                continue;
            }
            told += 1;
            let got = thinnest(
                DVec3::new(covariance[(0, 0)], covariance[(1, 1)], covariance[(2, 2)]),
                DVec3::new(covariance[(0, 1)], covariance[(0, 2)], covariance[(1, 2)]),
            )
            .expect("a surface");
            let want = eigen.eigenvectors.column(least);
            let along = (got.x * want[0] + got.y * want[1] + got.z * want[2]).abs();
            assert!((along - 1.0).abs() < 1e-9 && (got.length() - 1.0).abs() < 1e-12, "{trial}: {along}");
        }
        assert!(told > 250, "{told}");
    }

    #[test]
    fn exact_a_plane_has_one_normal_and_thinned_points() {
        let across = DVec3::new(0.6, -0.8, 0.0);
        let points = (0..60).flat_map(|i| (0..40).map(move |k| (i as f64 * 0.01, k as f64 * 0.01)));
        let surface = Surface::of(points.map(|(u, v)| DVec3::new(0.8 * u, 0.6 * u, v) + 2.0 * across));
        assert!(surface.len() > 150 && surface.len() < 600, "{}", surface.len());
        for (normal, place_m) in surface.normals.iter().zip(surface.columns.places_m()) {
            assert!((normal.dot(across).abs() - 1.0).abs() < 1e-9, "{normal}");
            assert!((place_m.dot(across) - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn extreme_nothing_one_point_and_points_that_are_no_numbers() {
        assert_eq!(Surface::of(std::iter::empty()).len(), 0);
        assert_eq!(Surface::of([DVec3::ONE].into_iter()).len(), 0);
        for far in [DVec3::NAN, DVec3::INFINITY, DVec3::splat(1e300), DVec3::new(1e6, 0.0, 0.0)] {
            assert_eq!(Surface::of([far, DVec3::ONE].into_iter().cycle().take(50)).len(), 0, "{far}");
        }
        // All in one cube, and all on a line.
        assert_eq!(Surface::of([DVec3::ONE].into_iter().cycle().take(50)).len(), 0);
        assert_eq!(Surface::of((0..100).map(|k| DVec3::new(0.02 * k as f64, 0.0, 0.5))).len(), 0);
        assert_eq!(thinnest(DVec3::ZERO, DVec3::ZERO), None);
        assert_eq!(thinnest(DVec3::NAN, DVec3::ZERO), None);
    }
}
