//! A pose and a landmark -> range, bearing and elevation in the sensor frame, with derivatives; and back.
//!
//! In: pose mean, landmark position (both relative to the start), the mount. Out: the predicted measurement and its
//! Jacobians by the landmark and by the pose. Frames: `map` and `sensor`; metres, radians. Source: the range-bearing model
//! of Thrun et al. 2005, chapter 6, with an elevation. Not modelled: the tilt head's own lever arm.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::matrix::{Matrix, Vector, apply, product, square, transpose};
use crate::geometry::Transform;
use crate::math;

/// Nearer than this a bearing means nothing.
pub(crate) const LEAST_RANGE_M: f64 = 0.2;
/// Steeper than this a bearing means nothing: 85 degrees.
pub(crate) const MOST_ELEVATION_RAD: f64 = 85.0 / 180.0 * std::f64::consts::PI;

/// Range, bearing, elevation.
pub type Polar = Vector<3>;

/// Where the sensor sits on the rover.
#[derive(Clone, Copy, Debug)]
pub struct Mounting {
    /// sensor_from_rover rotation.
    rotation: Matrix<3, 3>,
    /// The sensor's origin, sensor axes, from the rover's origin.
    offset_m: Vector<3>,
}

impl Mounting {
    pub fn new(rover_from_sensor: &Transform) -> Mounting {
        let columns = rover_from_sensor.rotation.to_cols_array_2d();
        let offset = rover_from_sensor.rotation.transpose() * rover_from_sensor.translation_m;
        // glam stores columns: the rows of the transpose.
        Mounting { rotation: columns, offset_m: offset.to_array() }
    }
}

/// A landmark from where the sensor stands.
pub struct Sight {
    /// From the rover, map axes.
    w: Vector<3>,
    /// In the sensor frame.
    q: Vector<3>,
    level2: f64,
    range2: f64,
    level: f64,
    pub range: f64,
}

impl Sight {
    /// What would be measured.
    #[inline(always)]
    pub fn polar(&self) -> Polar {
        let Sight { q, level, range, .. } = *self;
        [range, math::atan2(q[1], q[0]), math::atan2(q[2], level)]
    }

    /// Derivatives of the measurement by the point in the sensor frame.
    #[inline(always)]
    fn slopes(&self) -> Matrix<3, 3> {
        let Sight { q, level2, range2, level, range, .. } = *self;
        [
            [q[0] / range, q[1] / range, q[2] / range],
            [-q[1] / level2, q[0] / level2, 0.0],
            [-q[0] * q[2] / (range2 * level), -q[1] * q[2] / (range2 * level), level / range2],
        ]
    }
}

/// A pose as the sensor needs it: rotations and their derivatives, computed once for many landmarks.
#[derive(Clone, Debug)]
pub struct SensorView {
    position_m: Vector<3>,
    offset_m: Vector<3>,
    /// sensor_from_map.
    rotation: Matrix<3, 3>,
    /// Derivatives of the same by roll, pitch and yaw.
    by_angle: [Matrix<3, 3>; 3],
}

/// The point of a measurement in the sensor frame.
pub(crate) fn point_m(polar: &Polar) -> Vector<3> {
    let [range, bearing, elevation] = *polar;
    let (sb, cb) = math::sin_cos(bearing);
    let (se, ce) = math::sin_cos(elevation);
    [range * ce * cb, range * ce * sb, range * se]
}

/// A predicted measurement.
#[derive(Clone, Debug)]
pub struct Prediction {
    pub polar: Polar,
    pub by_landmark: Matrix<3, 3>,
    pub by_pose: Matrix<3, 6>,
}

impl SensorView {
    #[inline(always)]
    pub fn new(pose: &Vector<6>, mounting: &Mounting) -> SensorView {
        // Roll and pitch are small as a rule.
        let [[sr, sp], [cr, cp]] = math::sin_cos_lanes(&[pose[3], pose[4]]);
        let (sy, cy) = math::sin_cos(pose[5]);
        // rover_from_map = (Rz Ry Rx)': its rows are the columns of map_from_rover.
        let rover = [
            [cy * cp, sy * cp, -sp],
            [cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr],
            [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr],
        ];
        let by_roll = [[0.0; 3], rover[2], [-rover[1][0], -rover[1][1], -rover[1][2]]];
        let by_pitch =
            [[-cy * sp, -sy * sp, -cp], [cy * cp * sr, sy * cp * sr, -sp * sr], [cy * cp * cr, sy * cp * cr, -sp * cr]];
        let mut by_yaw = [[0.0; 3]; 3];
        for r in 0..3 {
            by_yaw[r] = [-rover[r][1], rover[r][0], 0.0];
        }
        let mount = &mounting.rotation;
        SensorView {
            position_m: [pose[0], pose[1], pose[2]],
            offset_m: mounting.offset_m,
            rotation: product(mount, &rover),
            by_angle: [product(mount, &by_roll), product(mount, &by_pitch), product(mount, &by_yaw)],
        }
    }

    /// A map point in the sensor frame.
    #[inline(always)]
    pub fn in_sensor(&self, point_m: &Vector<3>) -> Vector<3> {
        self.turned(&self.place_from_rover(point_m))
    }

    /// A map point from the rover, map axes.
    #[inline(always)]
    fn place_from_rover(&self, point_m: &Vector<3>) -> Vector<3> {
        let mut w = *point_m;
        for i in 0..3 {
            w[i] -= self.position_m[i];
        }
        w
    }

    #[inline(always)]
    fn turned(&self, w: &Vector<3>) -> Vector<3> {
        let mut q = apply(&self.rotation, w);
        for i in 0..3 {
            q[i] -= self.offset_m[i];
        }
        q
    }

    /// A landmark from the sensor; `None` where the bearing means nothing.
    #[inline(always)]
    pub fn sight(&self, landmark_m: &Vector<3>) -> Option<Sight> {
        let w = self.place_from_rover(landmark_m);
        let q = self.turned(&w);
        let level2 = q[0] * q[0] + q[1] * q[1];
        let range2 = level2 + q[2] * q[2];
        let (level, range) = (level2.sqrt(), range2.sqrt());
        (level > 1e-6 && range < f64::INFINITY).then_some(Sight { w, q, level2, range2, level, range })
    }

    /// Derivatives of a measurement by the landmark and by the pose.
    #[inline(always)]
    pub fn slopes(&self, sight: &Sight) -> (Matrix<3, 3>, Matrix<3, 6>) {
        let by_sensor_point = sight.slopes();
        let by_landmark = product(&by_sensor_point, &self.rotation);
        let mut by_pose = [[0.0; 6]; 3];
        for angle in 0..3 {
            let turned = apply(&by_sensor_point, &apply(&self.by_angle[angle], &sight.w));
            for r in 0..3 {
                by_pose[r][3 + angle] = turned[r];
            }
        }
        for r in 0..3 {
            for i in 0..3 {
                by_pose[r][i] = -by_landmark[r][i];
            }
        }
        (by_landmark, by_pose)
    }

    /// What would be measured of a landmark; `None` where the bearing means nothing.
    #[inline(always)]
    pub fn predict(&self, landmark_m: &Vector<3>) -> Option<Prediction> {
        let sight = self.sight(landmark_m)?;
        let (by_landmark, by_pose) = self.slopes(&sight);
        Some(Prediction { polar: sight.polar(), by_landmark, by_pose })
    }

    /// The sensor's place in the map.
    #[inline(always)]
    pub fn sensor_m(&self) -> Vector<3> {
        self.in_map(&[0.0; 3])
    }

    /// How far the sensor sits from the rover's origin, metres.
    #[inline(always)]
    pub(crate) fn lever_m(&self) -> f64 {
        square(&self.offset_m).sqrt()
    }

    /// The map point of a point in the sensor frame.
    #[inline(always)]
    pub fn in_map(&self, point_m: &Vector<3>) -> Vector<3> {
        let mut from_rover = *point_m;
        for i in 0..3 {
            from_rover[i] += self.offset_m[i];
        }
        let mut place = apply(&transpose(&self.rotation), &from_rover);
        for i in 0..3 {
            place[i] += self.position_m[i];
        }
        place
    }

    /// The map point of a measurement, and its covariance for diagonal measurement variances (the pose taken as exact).
    #[inline(always)]
    pub fn locate(&self, polar: &Polar, variances: &Vector<3>) -> (Vector<3>, Matrix<3, 3>) {
        let [range, bearing, elevation] = *polar;
        let (sb, cb) = math::sin_cos(bearing);
        let (se, ce) = math::sin_cos(elevation);
        // Columns: derivatives of q by range, bearing, elevation.
        let by_polar = [
            [ce * cb, -range * ce * sb, -range * se * cb],
            [ce * sb, range * ce * cb, -range * se * sb],
            [se, 0.0, range * ce],
        ];
        let j = product(&transpose(&self.rotation), &by_polar);
        let covariance = std::array::from_fn(|r| {
            std::array::from_fn(|c| (0..3).map(|k| j[r][k] * variances[k] * j[c][k]).sum::<f64>())
        });
        (self.in_map(&[range * ce * cb, range * ce * sb, range * se]), covariance)
    }
}

/// Measured minus predicted, angles wrapped.
#[inline]
pub fn innovation(measured: &Polar, predicted: &Polar) -> Vector<3> {
    [
        measured[0] - predicted[0],
        math::wrap_angle(measured[1] - predicted[1]),
        math::wrap_angle(measured[2] - predicted[2]),
    ]
}

/// Whether a measurement can be used at all; decided once, for all particles alike.
pub(crate) fn is_usable(polar: &Polar) -> bool {
    polar.iter().all(|v| v.is_finite()) && polar[0] >= LEAST_RANGE_M && polar[2].abs() <= MOST_ELEVATION_RAD
}

#[cfg(test)]
mod tests;
