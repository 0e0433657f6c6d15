//! Where a particle's landmarks are -> those that may be a feature's.
//!
//! In: a map, a belief of the pose, a feature. Out: the landmarks worth judging, in their order. Leaves out what lies outside a ball
//! about the feature's place, then what the range alone puts too far: a square and a root each, where a judgement takes products of
//! covariances and two arc tangents. Of what is left out, a judgement would say no more than that it is too far.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::associate::NEW_BEYOND;
use super::landmark::Landmark;
use super::matrix::{Vector, square};
use crate::wide::LANES;

/// Covers the rounding of the bounds and of what they bound.
const SLACK: f64 = 1.001;

/// A particle's landmarks by coordinate.
#[derive(Default)]
pub(super) struct LandmarkIndex {
    blocks: Vec<[[f64; LANES]; 3]>,
    near: Vec<u32>,
    most_variance_m2: f64,
}

impl LandmarkIndex {
    /// Takes in a map; the last one's memory serves again.
    #[inline(always)]
    pub(super) fn fill(&mut self, landmarks: &[Landmark]) {
        self.blocks.clear();
        self.most_variance_m2 = landmarks.iter().map(variance_m2).fold(0.0, f64::max);
        for landmarks in landmarks.chunks(LANES) {
            // Padding entries are NaN, so that no comparison selects them.
            let mut block = [[f64::NAN; LANES]; 3];
            for (lane, landmark) in landmarks.iter().enumerate() {
                for i in 0..3 {
                    block[i][lane] = landmark.mean_m[i];
                }
            }
            self.blocks.push(block);
        }
        self.near.resize(LANES * self.blocks.len(), 0);
    }

    /// The greatest trace of a landmark's covariance.
    pub(super) fn most_variance_m2(&self) -> f64 {
        self.most_variance_m2
    }

    /// Those within `reach_m` of a place, by number.
    #[inline(always)]
    pub(super) fn within(&mut self, reach_m: f64, place: &Vector<3>) -> &[u32] {
        let reach_m2 = reach_m * reach_m;
        let mut count = 0;
        for (block, first) in self.blocks.iter().zip((0..).step_by(LANES)) {
            let mut apart_m2 = [-0.0; LANES];
            for i in 0..3 {
                for lane in 0..LANES {
                    let apart_m = block[i][lane] - place[i];
                    apart_m2[lane] += apart_m * apart_m;
                }
            }
            for lane in 0..LANES {
                self.near[count] = first + lane as u32;
                count += usize::from(apart_m2[lane] <= reach_m2);
            }
        }
        &self.near[..count]
    }
}

/// The trace of a landmark's covariance.
#[inline(always)]
fn variance_m2(landmark: &Landmark) -> f64 {
    let c = &landmark.covariance_m2;
    c[0][0] + c[1][1] + c[2][2]
}

/// What a range says of landmarks, from one belief of the pose.
pub(super) struct RangeGate {
    pub range_m: f64,
    /// Variance of the range.
    pub variance_m2: f64,
    /// The sensor's place in the map, and how far it sits from the rover's origin.
    pub sensor_m: Vector<3>,
    pub lever_m: f64,
    /// Roots of the traces of the position's and of the angles' covariance.
    pub moved_m: f64,
    pub turned_rad: f64,
}

impl RangeGate {
    /// How far from a feature's place, metres, to look for landmarks that are within [`NEW_BEYOND`] of it. `angles_variance_rad2`: of the feature's
    /// two angles, their sum. `landmark_variance_m2`: the greatest trace of a landmark's covariance.
    ///
    /// An innovation within the gate is at most sqrt(NEW_BEYOND tr S), taken in metres across the line of sight: range times angle. With r the
    /// landmark's range, tr S is at most (m + r t)^2 + r^2 n^2 + v: the position and the lever move the line of sight by m, the angles turn it by t,
    /// those of the feature err by n, its range and the landmark have the variance v. That is no more than
    /// (sqrt(m^2 + v) + r sqrt(t^2 + n^2))^2, and r no more than the feature's range and the reach itself. To first order in the distance over the
    /// range: a landmark far nearer than the feature may be left out at the end of the gate, where it would have made the feature unclear. What
    /// lies within the gate of a match is found.
    #[inline(always)]
    pub(super) fn reach_m(&self, angles_variance_rad2: f64, landmark_variance_m2: f64) -> f64 {
        // The axes of roll and yaw are not at right angles where the rover pitches.
        let turned_rad = std::f64::consts::SQRT_2 * self.turned_rad;
        let moved_m = self.moved_m + self.lever_m * turned_rad;
        let sigmas = (SLACK * NEW_BEYOND).sqrt();
        let by_place_m = sigmas * (moved_m * moved_m + self.variance_m2 + landmark_variance_m2).sqrt();
        let by_angle_rad = sigmas * (turned_rad * turned_rad + angles_variance_rad2).sqrt();
        let shrunk = 1.0 - by_angle_rad;
        if shrunk > 0.0 { (by_place_m + by_angle_rad * self.range_m) / shrunk } else { f64::INFINITY }
    }

    /// Whether the innovation of the range alone puts a landmark beyond [`NEW_BEYOND`].
    ///
    /// Its variance is h P h' + u C u' + R. Here u is a unit vector, so that u C u' is at most the trace of C; h is -u by the
    /// position, and by an angle at most lever (1 + lever / range): the range is from the rover's origin but for the lever.
    #[inline(always)]
    pub(super) fn rules_out(&self, landmark: &Landmark) -> bool {
        let mut apart_m = landmark.mean_m;
        for i in 0..3 {
            apart_m[i] -= self.sensor_m[i];
        }
        let range_m = square(&apart_m).sqrt();
        let by_angle_m = self.lever_m * (1.0 + self.lever_m / range_m);
        let pose_m = self.moved_m + 3f64.sqrt() * by_angle_m * self.turned_rad;
        let variance_m2 = pose_m * pose_m + variance_m2(landmark) + self.variance_m2;
        let innovation_m = self.range_m - range_m;
        innovation_m * innovation_m > SLACK * NEW_BEYOND * variance_m2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;

    #[test]
    fn equal_landmarks_within_a_ball_and_a_plain_scan() {
        let mut places = LandmarkIndex::default();
        for count in [0, 1, 7, 8, 9, 40] {
            let mut landmarks: Vec<Landmark> = (0..count)
                .map(|i| Landmark {
                    mean_m: [1.0, 2.0, 3.0].map(|k| 3.0 * math::sin(k * f64::from(i * i))),
                    covariance_m2: [[0.0; 3]; 3],
                    existence: 1.0,
                    known: None,
                })
                .collect();
            if let Some(broken) = landmarks.get_mut(3) {
                broken.mean_m[1] = f64::NAN;
            }
            places.fill(&landmarks);
            let place = [0.5, -0.5, 0.2];
            for reach_m in [0.0, 1.0, 2.5, f64::INFINITY] {
                let inside = |l: &Landmark| {
                    let apart: Vector<3> = std::array::from_fn(|i| l.mean_m[i] - place[i]);
                    square(&apart) <= reach_m * reach_m
                };
                let want: Vec<u32> = (0..).zip(&landmarks).filter(|(_, l)| inside(l)).map(|(i, _)| i).collect();
                assert_eq!(places.within(reach_m, &place), want, "{count} {reach_m}");
            }
        }
    }
}
