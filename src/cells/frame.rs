//! What is known of where a scan was taken -> the rover's and the sensor's place in the map, and the sigmas believed of it.
//!
//! In: a pose of rover or sensor with its sigmas, or the scan's own points, by which `level` finds the ground. Out: [`ScanPose`], by
//! which points become cells: metres, radians. A scan levelled by its points lies in a map of its own: origin on the plane below the
//! sensor, z its normal, x under the sensor's x axis; the rover is taken to stand level on it, and nothing is believed of its errors. So
//! real scans come to `classify --sensor-height`, and those of a corpus with `cells.frame: fitted_plane` come by the same calls, told
//! the height of their mount. Own construction. Not modelled: which way is up; the plane of ground that slopes as a whole is level here.

use super::level::{Levelled, NoGround, level};
use super::params::CellFrame;
use crate::geometry::{DVec3, Pose, Transform};
use crate::slam::Estimate;
use crate::sweep::Returns;

/// Where one scan was taken, as its cells take it.
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

    /// Nothing is known but the ground that was found: the rover stands level on it, at the map's origin.
    pub(crate) fn on_plane(found: &Levelled, sigmas: &Sigmas) -> ScanPose {
        ScanPose { estimate: estimate(&Pose::default(), sigmas), map_from_sensor: found.map_from_sensor }
    }

    /// Of a sweep that no plane levels: no place at all.
    pub(crate) fn nowhere() -> ScanPose {
        let map_from_sensor = Transform { translation_m: DVec3::NAN, ..Transform::IDENTITY };
        ScanPose { estimate: crate::slam::truth(&Pose::default()), map_from_sensor }
    }

    /// Where the cells of a corpus take a sweep to have been made, whose rover is believed to stand where `estimate` says.
    pub(crate) fn of_sweep(
        frame: CellFrame,
        returns: &Returns,
        estimate: &Estimate,
        rover_from_sensor: &Transform,
    ) -> Result<ScanPose, NoGround> {
        match frame {
            CellFrame::EstimatedPose => Ok(ScanPose {
                estimate: estimate.clone(),
                map_from_sensor: estimate.pose.transform() * *rover_from_sensor,
            }),
            CellFrame::FittedPlane => {
                let points_m: Vec<DVec3> =
                    (0..returns.status.len()).filter_map(|slot| returns.point_sensor(slot)).collect();
                // The rover's origin lies on its wheels' contact plane.
                let found = level(&points_m, rover_from_sensor.translation_m.z)?;
                Ok(ScanPose::on_plane(&found, &Sigmas::default()))
            }
        }
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

    #[test]
    fn exact_a_levelled_rover_stands_on_the_plane_and_nothing_is_believed_of_its_errors() {
        let found = Levelled {
            map_from_sensor: Transform { translation_m: DVec3::new(0.0, 0.0, 0.4), ..Transform::IDENTITY },
            height_m: 0.4,
            tilt_rad: 0.0,
            near_share: 1.0,
            rms_m: 0.0,
        };
        let placed = ScanPose::on_plane(&found, &Sigmas::default());
        assert_eq!((placed.estimate.pose, placed.estimate.sigmas()), (Pose::default(), [0.0; 6]));
        assert_eq!(placed.map_from_sensor, found.map_from_sensor);
        assert!(!ScanPose::nowhere().map_from_sensor.point(DVec3::X).is_finite());
    }

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
