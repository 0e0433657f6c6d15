//! A trajectory -> text in the TUM format, which `evo` and most SLAM tools read.
//!
//! In: times and poses. Out: one line a pose, `t tx ty tz qx qy qz qw`, seconds and metres; shortest decimals that read
//! back to the same f64.

use std::fmt::Write;

use crate::geometry::Pose;
use crate::math;

/// The TUM text of a trajectory.
pub fn tum<'a>(trajectory: impl IntoIterator<Item = (f64, &'a Pose)>) -> String {
    let mut text = String::new();
    for (time_s, pose) in trajectory {
        let [qx, qy, qz, qw] = quaternion(pose);
        let p = pose.position_m;
        writeln!(text, "{time_s} {} {} {} {qx} {qy} {qz} {qw}", p.x, p.y, p.z)
            .expect("writing to a string cannot fail");
    }
    text
}

/// (x, y, z, w) of Rz(yaw) Ry(pitch) Rx(roll).
fn quaternion(pose: &Pose) -> [f64; 4] {
    let (sr, cr) = math::sin_cos(0.5 * pose.roll_rad);
    let (sp, cp) = math::sin_cos(0.5 * pose.pitch_rad);
    let (sy, cy) = math::sin_cos(0.5 * pose.yaw_rad);
    [sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DVec3;

    #[test]
    fn equal_quaternion_and_rotation_matrix() {
        let pose = Pose { position_m: DVec3::new(1.0, 2.0, 3.0), roll_rad: 0.3, pitch_rad: -0.4, yaw_rad: 2.5 };
        let [x, y, z, w] = quaternion(&pose);
        let r = pose.rotation();
        // The matrix of a unit quaternion, from the definition q v q*.
        assert!((r.x_axis.x - (1.0 - 2.0 * (y * y + z * z))).abs() < 1e-15);
        assert!((r.x_axis.y - 2.0 * (x * y + w * z)).abs() < 1e-15);
        assert!((r.y_axis.z - 2.0 * (y * z + w * x)).abs() < 1e-15);
        assert!((r.z_axis.x - 2.0 * (x * z + w * y)).abs() < 1e-15);
    }

    #[test]
    fn exact_lines_read_back_to_the_same_bits() {
        let pose = Pose { position_m: DVec3::new(1.0 / 3.0, -1e6 / 7.0, 1e-9), yaw_rad: 1.0, ..Pose::default() };
        let text = tum([(0.1, &pose)]);
        let values: Vec<f64> = text.split_whitespace().map(|v| v.parse().expect("a number")).collect();
        assert_eq!(values.len(), 8);
        assert_eq!([values[1], values[2], values[3]], pose.position_m.to_array());
    }
}
