//! Position and attitude -> rigid transform, and back.

use glam::{DMat3, DVec3};

use crate::math;

/// Position and attitude of a frame in its parent. R = Rz(yaw) Ry(pitch) Rx(roll).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Position, parent frame.
    pub position_m: DVec3,
    pub roll_rad: f64,
    /// Positive nose down.
    pub pitch_rad: f64,
    /// Counter-clockwise from +x, in (-pi, pi].
    pub yaw_rad: f64,
}

impl Pose {
    /// Rotation matrix parent_from_self.
    pub fn rotation(&self) -> DMat3 {
        let (sr, cr) = math::sin_cos(self.roll_rad);
        let (sp, cp) = math::sin_cos(self.pitch_rad);
        let (sy, cy) = math::sin_cos(self.yaw_rad);
        DMat3::from_cols(
            DVec3::new(cy * cp, sy * cp, -sp),
            DVec3::new(cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
            DVec3::new(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
        )
    }

    /// The transform parent_from_self.
    pub fn transform(&self) -> Transform {
        Transform { rotation: self.rotation(), translation_m: self.position_m }
    }

    /// The pose of a transform; roll is 0 where pitch is within 1e-12 of straight up or down.
    pub fn from_transform(transform: &Transform) -> Pose {
        let r = &transform.rotation;
        let sin_pitch = (-r.x_axis.z).clamp(-1.0, 1.0);
        let level = math::hypot(r.x_axis.x, r.x_axis.y);
        let (roll_rad, yaw_rad) = if level > 1e-12 {
            (math::atan2(r.y_axis.z, r.z_axis.z), math::atan2(r.x_axis.y, r.x_axis.x))
        } else {
            (0.0, math::atan2(-r.y_axis.x, r.y_axis.y))
        };
        Pose {
            position_m: transform.translation_m,
            roll_rad,
            pitch_rad: math::atan2(sin_pitch, level),
            yaw_rad: math::wrap_angle(yaw_rad),
        }
    }
}

/// A rigid transform `a_from_b`: takes coordinates in b to coordinates in a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    pub rotation: DMat3,
    pub translation_m: DVec3,
}

impl Transform {
    pub const IDENTITY: Transform = Transform { rotation: DMat3::IDENTITY, translation_m: DVec3::ZERO };

    /// A point's coordinates in a.
    #[inline]
    pub fn point(&self, point_b: DVec3) -> DVec3 {
        self.rotation * point_b + self.translation_m
    }

    /// A direction's components in a.
    #[inline]
    pub fn direction(&self, direction_b: DVec3) -> DVec3 {
        self.rotation * direction_b
    }

    /// `b_from_a`.
    pub fn inverse(&self) -> Transform {
        let rotation = self.rotation.transpose();
        Transform { rotation, translation_m: -(rotation * self.translation_m) }
    }
}

impl std::ops::Mul for Transform {
    type Output = Transform;

    /// `a_from_b * b_from_c = a_from_c`.
    fn mul(self, b_from_c: Transform) -> Transform {
        Transform {
            rotation: self.rotation * b_from_c.rotation,
            translation_m: self.rotation * b_from_c.translation_m + self.translation_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_nose_down_pitch_points_the_nose_down() {
        let pose = Pose { pitch_rad: 0.3, ..Pose::default() };
        assert!(pose.rotation().x_axis.z < 0.0);
    }

    #[test]
    fn equal_pose_and_transform_round_trip() {
        for i in 0..200 {
            let a = f64::from(i);
            let pose = Pose {
                position_m: DVec3::new(a, -a, 0.5),
                roll_rad: 1.4 * math::sin(a),
                pitch_rad: 1.5 * math::sin(2.0 * a),
                yaw_rad: 3.1 * math::sin(3.0 * a),
            };
            let back = Pose::from_transform(&pose.transform());
            assert!((back.roll_rad - pose.roll_rad).abs() < 1e-12, "{pose:?} {back:?}");
            assert!((back.pitch_rad - pose.pitch_rad).abs() < 1e-12);
            assert!((back.yaw_rad - pose.yaw_rad).abs() < 1e-12);
            let there = pose.transform() * pose.transform().inverse();
            assert!((there.rotation.x_axis - DVec3::X).length() < 1e-14);
        }
    }
}
