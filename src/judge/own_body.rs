//! The rover's own outline and a scan's place -> which points are returns of the rover itself: `--self-filter` of `classify` and `localise`.
//!
//! In: points as the cloud has them, where they were taken, the rover's length, width and height. Out: a mark a point. The box stands on the
//! wheels' contact plane around the rover's origin, [`MARGIN_M`] wider on every side, in the rover's frame: that of the pose, or, where the ground
//! was fitted, the levelled frame below the sensor with the rover as far behind it as the mount says. Own construction. Corpora need no such
//! filter: their beams pass through the rover that carries the sensor, which is not modelled.

use super::options::{Frame, PoseSource, Setup};
use crate::cells::ScanPose;
use crate::geometry::{DVec3, Pose, Transform};
use crate::train::About;

/// Room for noise of ranges and errors of the mount.
const MARGIN_M: f64 = 0.1;

/// A rover's outline as a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnBody {
    pub length_m: f64,
    pub width_m: f64,
    /// Of the highest that its sensor may meet.
    pub height_m: f64,
}

impl OwnBody {
    /// Of the model's rover, as high as its sensor sits.
    pub(crate) fn of_model(about: &About) -> OwnBody {
        OwnBody { length_m: about.rover.length_m, width_m: about.rover.width_m, height_m: about.mount[2] }
    }

    /// A mark for each point within the box.
    pub(super) fn marks(&self, points_m: &[DVec3], setup: &Setup, pose: &ScanPose) -> Vec<bool> {
        let rover_from_point = rover_from_map(setup, pose)
            * if setup.frame == Frame::Map { Transform::IDENTITY } else { pose.map_from_sensor };
        points_m.iter().map(|&point_m| self.holds(rover_from_point.point(point_m))).collect()
    }

    /// Whether a point of the rover's frame is a return of the rover itself.
    pub(crate) fn holds(&self, at_m: DVec3) -> bool {
        at_m.x.abs() <= 0.5 * self.length_m + MARGIN_M
            && at_m.y.abs() <= 0.5 * self.width_m + MARGIN_M
            && (-MARGIN_M..=self.height_m + MARGIN_M).contains(&at_m.z)
    }
}

fn rover_from_map(setup: &Setup, pose: &ScanPose) -> Transform {
    match setup.pose_source {
        PoseSource::Rover | PoseSource::Sensor => pose.estimate.pose.transform().inverse(),
        // The map's origin lies below the sensor, its x axis under the sensor's.
        PoseSource::Ground { .. } => {
            let mount = setup.mount;
            let foot_m = DVec3::new(mount.x_m, mount.y_m, 0.0);
            Pose { position_m: foot_m, yaw_rad: mount.yaw_deg.to_radians(), ..Pose::default() }.transform()
        }
    }
}
