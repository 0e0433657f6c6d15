//! What is known of where a scan was taken -> the rover's and the sensor's place in the map, and the sigmas believed of it.

use crate::geometry::{Pose, Transform};
use crate::slam::Estimate;

/// Poses lie no farther from the map's origin: the Earth's own coordinates do not, and so far out doubles still tell 0.02 um.
pub(super) const MOST_COORDINATE_M: f64 = 1e8;

/// Where one scan was taken.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanPose {
    pub estimate: Estimate,
    pub map_from_sensor: Transform,
}

/// What is believed of the errors of a pose: one standard deviation each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sigmas {
    pub xy_m: f64,
    pub z_m: f64,
    pub tilt_rad: f64,
    pub yaw_rad: f64,
}

impl ScanPose {
    /// The rover's pose is known; the sensor sits where its mount says.
    pub(crate) fn of_rover(pose: &Pose, rover_from_sensor: &Transform, sigmas: &Sigmas) -> ScanPose {
        let map_from_sensor = pose.transform() * *rover_from_sensor;
        ScanPose { estimate: estimate(pose, sigmas), map_from_sensor }
    }

    /// The sensor's pose is known (LiDAR odometry); the rover is where its mount puts it.
    pub(crate) fn of_sensor(pose: &Pose, rover_from_sensor: &Transform, sigmas: &Sigmas) -> ScanPose {
        let map_from_sensor = pose.transform();
        let rover = Pose::from_transform(&(map_from_sensor * rover_from_sensor.inverse()));
        ScanPose { estimate: estimate(&rover, sigmas), map_from_sensor }
    }
}

fn estimate(pose: &Pose, sigmas: &Sigmas) -> Estimate {
    let Sigmas { xy_m, z_m, tilt_rad, yaw_rad } = *sigmas;
    let mut estimate = crate::slam::truth(pose);
    for (i, sigma) in [xy_m, xy_m, z_m, tilt_rad, tilt_rad, yaw_rad].into_iter().enumerate() {
        estimate.covariance[i][i] = sigma * sigma;
    }
    estimate
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DVec3;

    #[test]
    fn equal_the_sensors_pose_gives_back_the_rovers() {
        let rover = Pose { position_m: DVec3::new(3.0, -1.0, 0.2), roll_rad: 0.1, pitch_rad: -0.2, yaw_rad: 2.0 };
        let mount = Pose { position_m: DVec3::new(0.3, 0.0, 0.5), pitch_rad: 0.4, ..Pose::default() }.transform();
        let by_rover = ScanPose::of_rover(&rover, &mount, &Sigmas::default());
        let sensor = Pose::from_transform(&by_rover.map_from_sensor);
        let back = ScanPose::of_sensor(&sensor, &mount, &Sigmas::default()).estimate.pose;
        assert!((back.position_m - rover.position_m).length() < 1e-12);
        assert!((back.pitch_rad - rover.pitch_rad).abs() < 1e-12 && (back.yaw_rad - rover.yaw_rad).abs() < 1e-12);
    }
}
