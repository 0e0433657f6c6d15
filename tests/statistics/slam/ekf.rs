//! EKF-SLAM with known landmarks: one joint Gaussian over pose and map, no particles. The oracle.
//!
//! Same models as the filter's (they are the question's data), other algebra: dense joint covariance, stacked updates. Deviation: the slope of its
//! ground walks as usual, where the filter reads off roll and pitch how far.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use std::collections::BTreeMap;

use marsyard::drive::Reading;
use marsyard::math;
use marsyard::slam::Feature;
use marsyard::slam::measurement::{Mounting, SensorView, innovation};
use marsyard::slam::motion::{Control, GaussianPose, MotionNoise};

pub struct EkfSlam {
    pub mean: Vec<f64>,
    /// Row-major, square.
    pub covariance: Vec<Vec<f64>>,
    slots: BTreeMap<u32, usize>,
    started: bool,
}

const FEATURE_VARIANCES: [f64; 3] = {
    let angle = std::f64::consts::PI / 180.0;
    [0.03 * 0.03, angle * angle, angle * angle]
};

impl EkfSlam {
    pub fn new() -> EkfSlam {
        EkfSlam { mean: vec![0.0; 6], covariance: vec![vec![0.0; 6]; 6], slots: BTreeMap::new(), started: false }
    }

    pub fn step(&mut self, reading: &Reading, noise: &MotionNoise, imu_rad: f64, sun_rad: f64) {
        let control = Control::of(reading).expect("finite readings");
        // The pose block moves as a lone belief does; its Jacobian carries the cross-covariances along.
        let pose: [f64; 6] = std::array::from_fn(|i| self.mean[i]);
        let jacobian = motion_jacobian(&pose, control);
        let n = self.mean.len();
        for c in 6..n {
            let column: [f64; 6] = std::array::from_fn(|r| self.covariance[r][c]);
            for r in 0..6 {
                let moved = (0..6).map(|k| jacobian[r][k] * column[k]).sum();
                self.covariance[r][c] = moved;
                self.covariance[c][r] = moved;
            }
        }
        let covariance = std::array::from_fn(|r| std::array::from_fn(|c| self.covariance[r][c]));
        let mut belief = GaussianPose { mean: pose, covariance, ..Default::default() };
        belief.drive(control, noise);
        for r in 0..6 {
            self.mean[r] = belief.mean[r];
            for c in 0..6 {
                self.covariance[r][c] = belief.covariance[r][c];
            }
        }
        for (i, reading, sigma) in
            [(3, reading.roll_rad, imu_rad), (4, reading.pitch_rad, imu_rad), (5, reading.yaw_rad, sun_rad)]
        {
            let Some(value) = reading else { continue };
            if self.started {
                let mut row = vec![0.0; n];
                row[i] = 1.0;
                self.update(&[row], &[math::wrap_angle(value - self.mean[i])], &[sigma * sigma]);
            } else {
                self.mean[i] = value;
                self.covariance[i][i] = sigma * sigma;
            }
        }
        self.started = true;
    }

    pub fn observe(&mut self, features: &[Feature], mounting: &Mounting) {
        let pose: [f64; 6] = std::array::from_fn(|i| self.mean[i]);
        let view = SensorView::new(&pose, mounting);
        let n = self.mean.len();
        let (mut rows, mut residuals, mut variances) = (Vec::new(), Vec::new(), Vec::new());
        let mut fresh = Vec::new();
        for feature in features {
            let id = feature.known.expect("known landmarks");
            let Some(&slot) = self.slots.get(&id) else {
                fresh.push((id, feature));
                continue;
            };
            let prediction =
                view.predict(&[self.mean[slot], self.mean[slot + 1], self.mean[slot + 2]]).expect("in view");
            let nu = innovation(&feature.polar, &prediction.polar);
            for r in 0..3 {
                let mut row = vec![0.0; n];
                row[..6].copy_from_slice(&prediction.by_pose[r]);
                row[slot..slot + 3].copy_from_slice(&prediction.by_landmark[r]);
                rows.push(row);
                residuals.push(nu[r]);
                variances.push(FEATURE_VARIANCES[r]);
            }
        }
        if !rows.is_empty() {
            self.update(&rows, &residuals, &variances);
        }
        for (id, feature) in fresh {
            self.add(id, feature, mounting);
        }
    }

    fn add(&mut self, id: u32, feature: &Feature, mounting: &Mounting) {
        let pose: [f64; 6] = std::array::from_fn(|i| self.mean[i]);
        let view = SensorView::new(&pose, mounting);
        let (place, own) = view.locate(&feature.polar, &FEATURE_VARIANCES);
        // The landmark's derivative by the pose, from h(x, m(x)) = z: -Hm^-1 Hs, here by differences.
        let step = 1e-6;
        let by_pose: Vec<[f64; 3]> = (0..6)
            .map(|i| {
                let moved = |by: f64| {
                    let mut pose = pose;
                    pose[i] += by;
                    SensorView::new(&pose, mounting).locate(&feature.polar, &FEATURE_VARIANCES).0
                };
                let (plus, minus) = (moved(step), moved(-step));
                std::array::from_fn(|r| (plus[r] - minus[r]) / (2.0 * step))
            })
            .collect();
        let n = self.mean.len();
        let cross: Vec<Vec<f64>> = (0..3)
            .map(|r| (0..n).map(|c| (0..6).map(|k| by_pose[k][r] * self.covariance[k][c]).sum()).collect())
            .collect();
        self.mean.extend(place);
        for r in 0..n {
            let new: Vec<f64> = (0..3).map(|k| cross[k][r]).collect();
            self.covariance[r].extend(new);
        }
        for r in 0..3 {
            let mut row = cross[r].clone();
            row.extend((0..3).map(|c| own[r][c] + (0..6).map(|k| cross[r][k] * by_pose[k][c]).sum::<f64>()));
            self.covariance.push(row);
        }
        self.slots.insert(id, n);
    }

    /// Stacked Kalman update.
    fn update(&mut self, rows: &[Vec<f64>], residuals: &[f64], variances: &[f64]) {
        let (n, m) = (self.mean.len(), rows.len());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        // P H', then S = H P H' + R, inverted by elimination.
        let ph: Vec<Vec<f64>> = (0..n).map(|r| rows.iter().map(|h| dot(&self.covariance[r], h)).collect()).collect();
        let mut s: Vec<Vec<f64>> = (0..m)
            .map(|i| {
                (0..m)
                    .map(|j| {
                        (0..n).map(|k| rows[i][k] * ph[k][j]).sum::<f64>() + if i == j { variances[i] } else { 0.0 }
                    })
                    .collect()
            })
            .collect();
        let mut inverse: Vec<Vec<f64>> =
            (0..m).map(|i| (0..m).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        for pivot in 0..m {
            let scale = 1.0 / s[pivot][pivot];
            for c in 0..m {
                s[pivot][c] *= scale;
                inverse[pivot][c] *= scale;
            }
            for r in 0..m {
                let factor = s[r][pivot];
                if r == pivot || factor == 0.0 {
                    continue;
                }
                for c in 0..m {
                    s[r][c] -= factor * s[pivot][c];
                    inverse[r][c] -= factor * inverse[pivot][c];
                }
            }
        }
        let gain: Vec<Vec<f64>> =
            (0..n).map(|r| (0..m).map(|j| (0..m).map(|k| ph[r][k] * inverse[k][j]).sum()).collect()).collect();
        for r in 0..n {
            self.mean[r] += dot(&gain[r], residuals);
            for c in 0..n {
                self.covariance[r][c] -= dot(&gain[r], &ph[c]);
            }
        }
        for r in 0..n {
            for c in 0..r {
                let mean = 0.5 * (self.covariance[r][c] + self.covariance[c][r]);
                self.covariance[r][c] = mean;
                self.covariance[c][r] = mean;
            }
        }
        for i in [3, 5] {
            self.mean[i] = math::wrap_angle(self.mean[i]);
        }
    }
}

fn motion_jacobian(pose: &[f64; 6], control: Control) -> [[f64; 6]; 6] {
    let moved = |i: usize, by: f64| {
        let mut belief = GaussianPose { mean: *pose, covariance: [[0.0; 6]; 6], ..Default::default() };
        belief.mean[i] += by;
        let quiet = MotionNoise {
            distance_m_per_sqrt_m: 0.0,
            sideways_m_per_sqrt_m: 0.0,
            heading_rad_per_sqrt_m: 0.0,
            slope_rad_per_sqrt_m: 0.0,
            climb_m_per_sqrt_m: 0.0,
            inflation: 0.0,
        };
        belief.drive(control, &quiet);
        belief.mean
    };
    let step = 1e-6;
    let mut jacobian = [[0.0; 6]; 6];
    for c in 0..6 {
        let (plus, minus) = (moved(c, step), moved(c, -step));
        for r in 0..6 {
            let d = plus[r] - minus[r];
            jacobian[r][c] = if r == 3 || r == 5 { math::wrap_angle(d) } else { d } / (2.0 * step);
        }
    }
    jacobian
}
