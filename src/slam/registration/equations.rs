//! Points of one surface laid on another -> the normal equations of their distances across it.
//!
//! In: [`Pair`]s of one kind, metres, the variance of a distance, and how many of them count for one. Out: information and gradient by x, y, z and three
//! turns; what the errors of the normals add to the information; the gradient spot by spot. Weights: Geman and McClure's, which leave out what lies far off.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use std::collections::BTreeMap;

use super::pairs::{Kind, LEAST_POINTS, SPOT_M};
use crate::geometry::DVec3;
use crate::slam::matrix::{Matrix, Vector};

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
    /// Of a point of the newer surface, `arm_m` from the rover and so at `here_m`, and one of the older; their normals look the same way.
    #[inline(always)]
    pub(super) fn of(arm_m: DVec3, here_m: DVec3, own: DVec3, other_m: DVec3, other: DVec3) -> Option<Pair> {
        let normal = (other + own).try_normalize()?;
        let spot = [other_m.x, other_m.y].map(|t_m| (t_m / SPOT_M).floor() as i32);
        let across_m = normal.dot(other_m - here_m);
        // The mean of two normals errs by half of what they are apart.
        Some(Pair { normal, normal_error: 0.5 * (other - own), arm_m, across_m, spot })
    }

    /// Geman and McClure's.
    fn weight(&self, variance_m2: f64) -> f64 {
        let bend = 1.0 + self.across_m * self.across_m / (variance_m2 * OUTLYING);
        1.0 / (bend * bend)
    }

    /// By x, y, z and the turns: of the distance across, for a normal or for what one errs.
    fn slopes(&self, normal: DVec3) -> Vector<6> {
        let turn = self.arm_m.cross(normal);
        [normal.x, normal.y, normal.z, turn.x, turn.y, turn.z]
    }
}

/// Pairs and their normal equations: x, y, z and the turns about the place.
pub(super) struct NormalEquations {
    pub information: Matrix<6, 6>,
    pub gradient: Vector<6>,
    pub pairs: Vec<Pair>,
    /// Of all pairs together.
    pub weight: f64,
    weighted_m2: f64,
    variance_m2: f64,
    /// The variance that a pair counts with: that times how many err as one.
    counted_m2: f64,
}

impl NormalEquations {
    pub(super) fn of(pairs: Vec<Pair>, variance_m2: f64, kind: &Kind) -> NormalEquations {
        let (mut information, mut gradient) = ([[0.0; 6]; 6], [0.0; 6]);
        let (mut total, mut weighted_m2) = (0.0, 0.0);
        let counted_m2 = variance_m2 * kind.correlated;
        for pair in &pairs {
            let weight = pair.weight(variance_m2);
            total += weight;
            weighted_m2 += weight * pair.across_m * pair.across_m;
            let (by, slopes) = (weight / counted_m2, pair.slopes(pair.normal));
            for r in 0..6 {
                gradient[r] += by * slopes[r] * pair.across_m;
            }
            add_square(&mut information, by, &slopes);
        }
        NormalEquations { information, gradient, pairs, weight: total, weighted_m2, variance_m2, counted_m2 }
    }

    /// The variance that the distances across tell; `None` of too few pairs.
    pub(super) fn told_m2(&self) -> Option<f64> {
        (self.pairs.len() >= LEAST_POINTS).then(|| WEIGHTED_SHARE * self.weighted_m2 / self.weight)
    }

    /// A pair's weight divided by its variance.
    fn information(&self, pair: &Pair) -> f64 {
        pair.weight(self.variance_m2) / self.counted_m2
    }

    /// What the errors of the normals add to the information.
    pub(super) fn by_normals(&self) -> Matrix<6, 6> {
        let mut added = [[0.0; 6]; 6];
        for pair in &self.pairs {
            let by = self.information(pair);
            add_square(&mut added, by, &pair.slopes(pair.normal_error));
        }
        added
    }

    /// The gradient's parts, spot by spot.
    pub(super) fn by_spot(&self) -> BTreeMap<[i32; 2], Vector<6>> {
        let mut by_spot: BTreeMap<[i32; 2], Vector<6>> = BTreeMap::new();
        for pair in &self.pairs {
            let by = self.information(pair);
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
