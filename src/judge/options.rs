//! What a user may choose, and a model -> what holds for all scans that it judges.
//!
//! Whatever is not chosen is as in the model's training: its mount, range and window, and of the pose's standard deviations the
//! median of what the model saw. Units: metres, radians.

use super::{JudgeError, OwnBody};
use crate::cells::frame::Sigmas;
use crate::cells::{CellFrame, CellRow};
use crate::cloud::LabelMap;
use crate::drive::rover::Mount;
use crate::train::{About, OperatingPoint};

/// The frame that the points of the clouds are in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// x forward, y left, z up, origin at the sensor. Points at the origin are beams without a return, and are left out.
    #[default]
    Sensor,
    /// The frame of the poses.
    Map,
}

/// How it is known where a scan was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PoseSource {
    /// A pose comes with each scan: the rover's, origin on the wheels' contact plane.
    #[default]
    Rover,
    /// A pose comes with each scan: the sensor's, as LiDAR odometry gives it.
    Sensor,
    /// No pose comes: the ground is fitted at this height below the sensor and taken for level. Each scan has a map frame of its own.
    Ground { sensor_height_m: f64 },
}

/// What a user may choose.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    pub frame: Frame,
    pub pose_source: PoseSource,
    /// Where the sensor sits on the rover.
    pub mount: Option<Mount>,
    /// Standard deviations of the poses.
    pub sigma_xy_m: Option<f64>,
    pub sigma_z_m: Option<f64>,
    pub sigma_tilt_rad: Option<f64>,
    pub sigma_yaw_rad: Option<f64>,
    /// Points farther than this from the sensor, horizontally, are left out.
    pub max_range_m: Option<f64>,
    /// Scans whose points are put together, the judged one the last of them.
    pub window: Option<u32>,
    /// Points that hang over more free height than this are in no cell, metres.
    pub overhang_m: Option<f64>,
    /// Returns of the rover itself, within this box, are left out.
    pub own_body: Option<OwnBody>,
    /// Cells of fewer points are not judged.
    pub min_points: u32,
    /// Where the model's outputs are told apart.
    pub point: OperatingPoint,
    /// What the clouds' labels mean; with it, the judge keeps score.
    pub labels: Option<LabelMap>,
}

impl PoseSource {
    /// The frame that cells come to lie in.
    pub(crate) fn cell_frame(self) -> CellFrame {
        match self {
            PoseSource::Rover | PoseSource::Sensor => CellFrame::EstimatedPose,
            PoseSource::Ground { .. } => CellFrame::FittedPlane,
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Options {
            frame: Frame::default(),
            pose_source: PoseSource::default(),
            mount: None,
            sigma_xy_m: None,
            sigma_z_m: None,
            sigma_tilt_rad: None,
            sigma_yaw_rad: None,
            max_range_m: None,
            window: None,
            overhang_m: None,
            own_body: None,
            min_points: 1,
            point: OperatingPoint::Model,
            labels: None,
        }
    }
}

/// What holds for all scans: the options, with what they leave open taken from the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setup {
    pub frame: Frame,
    pub pose_source: PoseSource,
    pub mount: Mount,
    pub sigmas: Sigmas,
    pub max_range_m: f64,
    pub window: usize,
    /// The user's or the model's.
    pub overhang_m: Option<f64>,
    pub own_body: Option<OwnBody>,
    pub min_points: u32,
}

impl Setup {
    /// A cell without points is there because beams passed over it.
    pub(super) fn has_points_enough(&self, row: &CellRow) -> bool {
        row.points == 0 || i64::from(row.points) >= i64::from(self.min_points)
    }

    pub(super) fn of(options: &Options, about: &About) -> Result<Setup, JudgeError> {
        let max_range_m = options.max_range_m.unwrap_or_else(|| about.reaches_m());
        if !(max_range_m > 0.0 && max_range_m.is_finite()) {
            return Err(JudgeError::MaxRange { max_range_m });
        }
        let [x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg] = about.mount;
        let window = window(options, about)?;
        if options.frame == Frame::Map && matches!(options.pose_source, PoseSource::Ground { .. }) {
            return Err(JudgeError::MapWithoutPoses);
        }
        Ok(Setup {
            frame: options.frame,
            pose_source: options.pose_source,
            mount: options.mount.unwrap_or(Mount { x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg }),
            sigmas: sigmas(options, about)?,
            max_range_m,
            window,
            overhang_m: overhang_m(options, about)?,
            own_body: options.own_body.map(checked).transpose()?,
            min_points: options.min_points,
        })
    }
}

fn overhang_m(options: &Options, about: &About) -> Result<Option<f64>, JudgeError> {
    match options.overhang_m.or(about.cells.above_m()) {
        Some(above_m) if !(above_m > 0.0 && above_m.is_finite()) => Err(JudgeError::Overhang { above_m }),
        above_m => Ok(above_m),
    }
}

fn checked(body: OwnBody) -> Result<OwnBody, JudgeError> {
    let OwnBody { length_m, width_m, height_m } = body;
    let is_size = |value: f64| value > 0.0 && value.is_finite();
    let all = [length_m, width_m, height_m].into_iter().all(is_size);
    if all { Ok(body) } else { Err(JudgeError::OwnBody { length_m, width_m, height_m }) }
}

fn window(options: &Options, about: &About) -> Result<usize, JudgeError> {
    match (options.pose_source, options.window) {
        (_, Some(0)) => Err(JudgeError::NoWindow),
        (PoseSource::Ground { .. }, Some(2..)) => Err(JudgeError::WindowWithoutPoses),
        (PoseSource::Ground { .. }, _) => Ok(1),
        (_, window) => Ok(window.unwrap_or(about.cells.window_scans) as usize),
    }
}

fn sigmas(options: &Options, about: &About) -> Result<Sigmas, JudgeError> {
    // A model that takes no such feature does not mind.
    let median = |name: &str| {
        let input = about.features.iter().position(|feature| feature == name);
        input.map_or(0.0, |input| about.quantiles[input][3])
    };
    let sigmas = Sigmas {
        xy_m: options.sigma_xy_m.unwrap_or_else(|| median("sigma_x_m")),
        z_m: options.sigma_z_m.unwrap_or_else(|| median("sigma_z_m")),
        tilt_rad: options.sigma_tilt_rad.unwrap_or_else(|| median("sigma_pitch_rad")),
        yaw_rad: options.sigma_yaw_rad.unwrap_or_else(|| median("sigma_yaw_rad")),
    };
    let all = [
        ("xy", sigmas.xy_m, "m"),
        ("z", sigmas.z_m, "m"),
        ("tilt", sigmas.tilt_rad.to_degrees(), "degrees"),
        ("yaw", sigmas.yaw_rad.to_degrees(), "degrees"),
    ];
    match all.into_iter().find(|(_, sigma, _)| !(0.0..1e6).contains(sigma)) {
        Some((name, value, unit)) => Err(JudgeError::Sigma { name, value, unit }),
        None => Ok(sigmas),
    }
}
