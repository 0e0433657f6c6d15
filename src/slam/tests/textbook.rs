//! What the textbooks print, without guards, to be measured beside the filter: a planar EKF among known landmarks (Thrun, Burgard &
//! Fox 2005, chapter 7), linear weights and low-variance resampling (table 4.4), nearest-neighbour association.
//!
//! Metres, radians; x, y, yaw. No angle is wrapped, nothing is gated, S is inverted as it is.

#![allow(clippy::needless_range_loop)] // Lanes and rows of small arrays, by number.

use crate::math;

/// Mean and covariance of x, y and yaw.
#[derive(Clone, Debug, Default)]
pub(super) struct Planar {
    pub mean: [f64; 3],
    pub covariance: [[f64; 3]; 3],
}

impl Planar {
    /// A step; `variances` are added to x, y and yaw, whatever the distance.
    pub(super) fn drive(&mut self, distance_m: f64, turn_rad: f64, variances: [f64; 3]) {
        let (s, c) = math::sin_cos(self.mean[2]);
        self.mean = [self.mean[0] + distance_m * c, self.mean[1] + distance_m * s, self.mean[2] + turn_rad];
        let f = [[1.0, 0.0, -distance_m * s], [0.0, 1.0, distance_m * c], [0.0, 0.0, 1.0]];
        let fp = product(&f, &self.covariance);
        let transposed = std::array::from_fn(|r| std::array::from_fn(|k| f[k][r]));
        self.covariance = product(&fp, &transposed);
        (0..3).for_each(|i| self.covariance[i][i] += variances[i]);
    }

    /// A heading.
    pub(super) fn read_heading(&mut self, yaw_rad: f64, variance: f64) {
        let p = self.covariance;
        let innovation = yaw_rad - self.mean[2];
        let gain: [f64; 3] = std::array::from_fn(|i| p[i][2] / (p[2][2] + variance));
        for r in 0..3 {
            self.mean[r] += gain[r] * innovation;
            for c in 0..3 {
                self.covariance[r][c] = p[r][c] - gain[r] * p[2][c];
            }
        }
    }

    /// Range and bearing of a landmark whose place is known.
    pub(super) fn observe(&mut self, polar: [f64; 2], landmark_m: [f64; 2], variances: [f64; 2]) {
        let (dx, dy) = (landmark_m[0] - self.mean[0], landmark_m[1] - self.mean[1]);
        let q = dx * dx + dy * dy;
        let r = q.sqrt();
        let h = [[-dx / r, -dy / r, 0.0], [dy / q, -dx / q, -1.0]];
        let p = self.covariance;
        let ph: [[f64; 2]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| p[i][k] * h[j][k]).sum()));
        let s: [[f64; 2]; 2] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                (0..3).map(|k| h[i][k] * ph[k][j]).sum::<f64>() + if i == j { variances[i] } else { 0.0 }
            })
        });
        let det = s[0][0] * s[1][1] - s[0][1] * s[1][0];
        let inverse = [[s[1][1] / det, -s[0][1] / det], [-s[1][0] / det, s[0][0] / det]];
        let gain: [[f64; 2]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| ph[i][0] * inverse[0][j] + ph[i][1] * inverse[1][j]));
        let innovation = [polar[0] - r, polar[1] - (math::atan2(dy, dx) - self.mean[2])];
        for i in 0..3 {
            self.mean[i] += gain[i][0] * innovation[0] + gain[i][1] * innovation[1];
            for j in 0..3 {
                self.covariance[i][j] = p[i][j] - gain[i][0] * ph[j][0] - gain[i][1] * ph[j][1];
            }
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.mean.iter().chain(self.covariance.iter().flatten()).all(|v| v.is_finite())
    }
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..3).map(|k| a[r][k] * b[k][c]).sum()))
}

/// Likelihoods -> weights that sum to 1.
pub(super) fn linear_weights(likelihoods: &[f64]) -> Vec<f64> {
    let total: f64 = likelihoods.iter().sum();
    likelihoods.iter().map(|l| l / total).collect()
}

/// Table 4.4 as printed, U > c; `None` for an index past the last particle.
pub(super) fn low_variance(weights: &[f64], start: f64) -> Vec<Option<usize>> {
    let count = weights.len() as f64;
    let (mut k, mut sum) = (0, weights[0]);
    (0..weights.len())
        .map(|m| {
            let mark = (start + m as f64) / count;
            while mark > sum {
                k += 1;
                sum += weights.get(k)?;
            }
            Some(k)
        })
        .collect()
}

/// Number of landmarks after sweeps of points, each matched to the nearest landmark of the map before the sweep, or new beyond
/// `gate_m`.
pub(super) fn nearest_neighbour_map(sweeps: &[Vec<[f64; 3]>], gate_m: f64) -> usize {
    let mut map: Vec<[f64; 3]> = Vec::new();
    for sweep in sweeps {
        let known = map.len();
        for point in sweep {
            let near =
                |l: &[f64; 3]| (0..3).map(|i| (l[i] - point[i]) * (l[i] - point[i])).sum::<f64>() < gate_m * gate_m;
            if !map[..known].iter().any(near) {
                map.push(*point);
            }
        }
    }
    map.len()
}
