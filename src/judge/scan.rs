//! A cloud and what is known of its sensor's pose -> a scan with a place in the map; and what a model said of it.

use std::sync::Arc;

use super::cost_map::{CostMap, Shown, cost_map};
use super::export::{self, LabelledPoint};
use super::options::{Frame, PoseSource, Setup};
use super::{JudgeError, JudgedCells, scale};
use crate::cells::level::{self, Levelled, RivalGround};
use crate::cells::{CellAssigner, Overhangs, ScanPose, WindowCloud};
use crate::cloud::{Cloud, CloudError};
use crate::geometry::{DVec3, Pose};

/// Poses lie no farther from the map's origin: the Earth's own coordinates do not, and so far out doubles still tell 0.02 um.
pub(super) const MOST_COORDINATE_M: f64 = 1e8;

/// One scan, ready to be binned.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedScan {
    /// For messages and titles.
    pub name: String,
    pub cloud: Cloud,
    /// Points at the sensor's own place, which are no returns and were left out.
    pub at_sensor: u64,
    /// Returns of the rover itself, which were left out where the options say so.
    pub on_rover: u64,
    pub pose: ScanPose,
    /// The ground that was found, where no pose came with the scan.
    pub levelled: Option<Levelled>,
    /// What may be the ground instead.
    pub rival: Option<RivalGround>,
    /// One a point, where labels are read: an obstacle's, not one's, or unknown.
    pub verdicts: Option<Vec<Option<bool>>>,
}

impl PlacedScan {
    /// `pose`: what the setup's source says. The verdicts are for who knows the labels' mapping.
    pub(super) fn of(
        name: &str,
        mut cloud: Cloud,
        pose: Option<&Pose>,
        setup: &Setup,
    ) -> Result<PlacedScan, JudgeError> {
        check_columns(name, &cloud)?;
        let at_sensor = if setup.frame == Frame::Map { 0 } else { cloud.drop_at(DVec3::ZERO) };
        if cloud.points_m.is_empty() {
            return Err(CloudError::NoPoints { file: name.into(), not_finite: cloud.not_finite }.into());
        }
        let (rover_from_sensor, sigmas) = (setup.mount.rover_from_sensor(), &setup.sigmas);
        let pose_given = || pose.ok_or_else(|| JudgeError::NoPose { scan: name.into() });
        let (mut levelled, mut rival) = (None, None);
        let pose = match setup.pose_source {
            PoseSource::Rover => ScanPose::of_rover(check_position(pose_given()?)?, &rover_from_sensor, sigmas),
            PoseSource::Sensor => ScanPose::of_sensor(check_position(pose_given()?)?, &rover_from_sensor, sigmas),
            PoseSource::Ground { sensor_height_m } => {
                let found = level::level(&cloud.points_m, sensor_height_m).map_err(|source| {
                    let question = scale::question(&cloud.points_m).map_or(String::new(), |asked| format!("; {asked}"));
                    JudgeError::NoGround { scan: name.into(), source, question }
                })?;
                levelled = Some(found);
                rival = level::rival(&cloud.points_m, sensor_height_m, &found);
                ScanPose::on_plane(&found, sigmas)
            }
        };
        let own = setup.own_body.map(|body| body.marks(&cloud.points_m, setup, &pose));
        let on_rover = own.map_or(0, |own| cloud.drop_marked(&own));
        Ok(PlacedScan { name: name.into(), cloud, at_sensor, on_rover, pose, levelled, rival, verdicts: None })
    }

    /// As the binning takes it; `intensity`: whether the model does.
    pub(super) fn as_cloud(&self, frame: Frame, intensity: bool) -> WindowCloud<'_> {
        WindowCloud {
            points_m: &self.cloud.points_m,
            in_map: frame == Frame::Map,
            intensity: self.cloud.intensity.as_deref().filter(|_| intensity),
            obstacle: self.verdicts.as_deref(),
            estimate: &self.pose.estimate,
            map_from_sensor: self.pose.map_from_sensor,
        }
    }
}

/// Files give one value a point; a cloud that was put together otherwise may not.
fn check_columns(name: &str, cloud: &Cloud) -> Result<(), JudgeError> {
    let points = cloud.points_m.len();
    let columns = [cloud.intensity.as_ref().map(Vec::len), cloud.labels.as_ref().map(Vec::len)];
    match columns.into_iter().flatten().find(|&values| values != points) {
        Some(values) => Err(JudgeError::UnevenColumns { scan: name.into(), points, values }),
        None => Ok(()),
    }
}

/// Refuses a pose that is no place in a map.
pub(super) fn check_position(pose: &Pose) -> Result<&Pose, JudgeError> {
    let position_m = pose.position_m;
    // A NaN compares as false, and is refused.
    let is_near = position_m.to_array().iter().all(|value| value.abs() <= MOST_COORDINATE_M);
    is_near.then_some(pose).ok_or(JudgeError::FarPose { position_m })
}

/// A scan and what the model said of the cells of its window.
#[derive(Clone, Debug)]
pub struct JudgedScan {
    /// Shared with the judge while the scan is in its window.
    pub scan: Arc<PlacedScan>,
    pub cells: JudgedCells,
    pub(super) setup: Setup,
}

impl JudgedScan {
    /// The points of the scan in the map, each with what was said of its cell, in the cloud's order.
    pub fn labelled_points(&self) -> Vec<LabelledPoint> {
        let Setup { max_range_m, frame, overhang_m, .. } = self.setup;
        let assigner = CellAssigner::of_sensor(self.cells.grid, max_range_m, self.scan.pose.map_from_sensor);
        let mut overhangs = Overhangs::default();
        let hanging = overhang_m.map_or(&[][..], |m| overhangs.of_cloud(m, &self.scan.as_cloud(frame, false)));
        export::labelled(&self.scan.cloud, hanging, &assigner, frame == Frame::Map, &self.cells)
    }

    /// These points as a PLY file.
    pub fn ply(&self, points: &[LabelledPoint]) -> Vec<u8> {
        export::ply(points, &self.scan.name)
    }

    /// These points as a PCD file.
    pub fn pcd(&self, points: &[LabelledPoint]) -> Vec<u8> {
        export::pcd(points, self.scan.pose.map_from_sensor.translation_m)
    }

    /// The mean heights of the cells as a PLY mesh.
    pub fn mesh(&self) -> Vec<u8> {
        export::mesh(&self.cells)
    }

    /// The cells as a map for ROS map servers. `image`: the name that the picture will have beside the YAML.
    pub fn cost_map(&self, image: &str, shown: Shown) -> Result<CostMap, JudgeError> {
        cost_map(&self.cells, image, shown)
    }
}
