//! Points of one surface laid on another -> the normal equations of their distances across it.
//!
//! In: [`Pair`]s, metres, and the variance of a distance. Out: information and gradient by x, y, z and three turns; what the errors of the normals
//! add to the information; the gradient spot by spot. Weights: Geman and McClure's, which leave out what lies far off.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use std::collections::BTreeMap;

use super::LEAST_POINTS;
use crate::geometry::DVec3;
use crate::slam::matrix::{Matrix, Vector};

/// Variance inflation for points that err together, beyond what the spread of the spots finds; by the NEES of fixes on the shipped configs.
const CORRELATED_POINTS: f64 = 2.0;
/// Squared distance over variance at which Geman-McClure's weight falls to a quarter.
const OUTLYING: f64 = 9.0;
/// Weights lower the mean square of what is normally distributed by this factor.
const WEIGHTED_SHARE: f64 = 1.363;

/// A point of the newer surface and the one of the older that it is taken for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    /// The mean of both normals, and half of their difference as its error.
    pub normal: DVec3,
    pub normal_error: DVec3,
    /// From the rover to the newer point.
    pub arm_m: DVec3,
    /// From the newer point to the older surface.
    pub across_m: f64,
    pub spot: [i32; 2],
}

impl Pair {
    /// Geman and McClure's.
    fn weight(&self, variance_m2: f64) -> f64 {
        let bend = 1.0 + self.across_m * self.across_m / (variance_m2 * OUTLYING);
        1.0 / (bend * bend)
    }

    /// Its weight divided by its variance.
    fn information(&self, variance_m2: f64) -> f64 {
        self.weight(variance_m2) / (variance_m2 * CORRELATED_POINTS)
    }

    /// By x, y, z and the turns: of the distance across, for a normal or for what one errs.
    fn slopes(&self, normal: DVec3) -> Vector<6> {
        let turn = self.arm_m.cross(normal);
        [normal.x, normal.y, normal.z, turn.x, turn.y, turn.z]
    }
}

/// Normal equations of all pairs: x, y, z and the turns about the place.
pub(super) struct NormalEquations {
    pub information: Matrix<6, 6>,
    pub gradient: Vector<6>,
    matched: usize,
    /// Of all pairs together.
    pub weight: f64,
    weighted_m2: f64,
    variance_m2: f64,
}

impl NormalEquations {
    pub(super) fn of(pairs: &[Pair], variance_m2: f64) -> NormalEquations {
        let (mut information, mut gradient) = ([[0.0; 6]; 6], [0.0; 6]);
        let (mut total, mut weighted_m2) = (0.0, 0.0);
        for pair in pairs {
            let weight = pair.weight(variance_m2);
            total += weight;
            weighted_m2 += weight * pair.across_m * pair.across_m;
            let (by, slopes) = (pair.information(variance_m2), pair.slopes(pair.normal));
            for r in 0..6 {
                gradient[r] += by * slopes[r] * pair.across_m;
            }
            add_square(&mut information, by, &slopes);
        }
        NormalEquations { information, gradient, matched: pairs.len(), weight: total, weighted_m2, variance_m2 }
    }

    /// The variance that the distances across tell; `None` of too few pairs.
    pub(super) fn told_m2(&self) -> Option<f64> {
        (self.matched >= LEAST_POINTS).then(|| WEIGHTED_SHARE * self.weighted_m2 / self.weight)
    }

    /// What the errors of the normals add to the information.
    pub(super) fn by_normals(&self, pairs: &[Pair]) -> Matrix<6, 6> {
        let mut added = [[0.0; 6]; 6];
        for pair in pairs {
            let by = pair.information(self.variance_m2);
            add_square(&mut added, by, &pair.slopes(pair.normal_error));
        }
        added
    }

    /// The gradient's parts, spot by spot.
    pub(super) fn by_spot(&self, pairs: &[Pair]) -> BTreeMap<[i32; 2], Vector<6>> {
        let mut by_spot: BTreeMap<[i32; 2], Vector<6>> = BTreeMap::new();
        for pair in pairs {
            let by = pair.information(self.variance_m2);
            let (slopes, pulls) = (pair.slopes(pair.normal), by_spot.entry(pair.spot).or_default());
            for r in 0..6 {
                pulls[r] += by * slopes[r] * pair.across_m;
            }
        }
        by_spot
    }
}

/// Adds by v v'.
fn add_square(matrix: &mut Matrix<6, 6>, by: f64, v: &Vector<6>) {
    for r in 0..6 {
        for c in 0..6 {
            matrix[r][c] += by * v[r] * v[c];
        }
    }
}
