//! What is typed behind `marsyard classify`.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};

use crate::cli::operating_point::PointArgs;
use crate::cli::options::{parse_six, parse_three};

/// Where each scan was taken must be known: --pose, --trajectory or --sensor-height.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("place").required(true))]
pub(in crate::cli) struct ClassifyArgs {
    /// A trained model: the model.safetensors of a run folder, or the folder, or a URL of either.
    pub(super) model: PathBuf,
    /// Scans: PLY, PCD, LAS, CSV / XYZ (with or without a header) or KITTI .bin, in the order they were taken; files or URLs.
    /// With --labels, a KITTI scan's labels are read from the .label file beside it, or from labels/ beside its folder.
    #[arg(required = true)]
    pub(super) clouds: Vec<PathBuf>,
    /// Folder for what is written.
    #[arg(long, default_value = "classified")]
    pub(super) out: PathBuf,

    /// Pose in the map: x, y, z in metres, roll, pitch (nose down positive), yaw in degrees; z is that of the wheels' contact plane.
    /// Once for all clouds, or once for each.
    #[arg(long, value_name = "X,Y,Z,ROLL,PITCH,YAW", value_parser = parse_six, allow_hyphen_values = true, group = "place")]
    pub(super) pose: Vec<[f64; 6]>,
    /// Poses from a TUM file: matched by time where the clouds are named by their times (seconds, or whole nanoseconds), else in order, as are numbers of
    /// frames such as 000010.bin.
    #[arg(long, value_name = "FILE", group = "place")]
    pub(super) trajectory: Option<PathBuf>,
    /// No pose: the sensor's height above the ground, metres; the ground is fitted and taken for level.
    #[arg(long, value_name = "M", group = "place", conflicts_with = "frame")]
    pub(super) sensor_height: Option<f64>,
    /// Whose pose --pose and --trajectory tell.
    #[arg(long, value_enum, default_value_t = PoseOf::Rover)]
    pub(super) pose_of: PoseOf,
    /// A cloud's name and its pose's time may differ by this, seconds.
    #[arg(long, value_name = "S", default_value_t = 0.05)]
    pub(super) time_tolerance: f64,
    /// The frame that the clouds' points are in.
    #[arg(long, value_enum, default_value = "sensor")]
    pub(super) frame: Frame,
    /// Where the sensor sits on the rover: x, y, z in metres, yaw, pitch, roll in degrees. Default: as in the model's training.
    #[arg(long, value_name = "X,Y,Z,YAW,PITCH,ROLL", value_parser = parse_six, allow_hyphen_values = true)]
    pub(super) mount: Option<[f64; 6]>,

    /// Standard deviation of the pose's x and y, metres. Only models that take such columns (`features: all`, or named) mind it. Default of all
    /// four: what the model saw in training (median), or 0.
    #[arg(long, value_name = "M")]
    pub(super) sigma_xy: Option<f64>,
    /// Standard deviation of the pose's z, metres.
    #[arg(long, value_name = "M")]
    pub(super) sigma_z: Option<f64>,
    /// Standard deviation of roll and pitch, degrees.
    #[arg(long, value_name = "DEG")]
    pub(super) sigma_tilt: Option<f64>,
    /// Standard deviation of yaw, degrees.
    #[arg(long, value_name = "DEG")]
    pub(super) sigma_yaw: Option<f64>,

    /// Points farther than this from the sensor (horizontally) are left out, metres. Default: as in training,
    /// of the family that reaches farthest.
    #[arg(long, value_name = "M")]
    pub(super) max_range: Option<f64>,
    /// Scans (up to this many, each cloud the last of its window) whose points are put together. Default: as in training.
    #[arg(long, value_name = "N")]
    pub(super) window: Option<u32>,
    /// Points that hang over more free height than this (crowns, branches, gates) are in no cell, metres. Default: as in training.
    #[arg(long, value_name = "M")]
    pub(super) overhang: Option<f64>,
    /// Returns of the rover itself are left out: points within its outline and 0.1 m around, on the wheels' contact plane and up to the
    /// sensor. Length, width and height in metres; default: of the model's rover, as high as its sensor.
    #[arg(long, value_name = "L,W,H", value_parser = parse_three, num_args = 0..=1, require_equals = true)]
    pub(super) self_filter: Option<Option<[f64; 3]>>,
    /// Cells of fewer points are not judged: they are unknown in all that is written.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) min_points: u32,
    #[command(flatten)]
    pub(super) point: PointArgs,

    /// A mapping from the clouds' label ids to traversable, untraversable or ignore (YAML): judges the model by them.
    #[arg(long, value_name = "FILE")]
    pub(super) labels: Option<PathBuf>,
    /// The column of the clouds that holds the label ids. Default: label, class, classification or semantic.
    #[arg(long, value_name = "NAME")]
    pub(super) label_field: Option<String>,
    /// Write no PNG: they take most of the time of a scan.
    #[arg(long)]
    pub(super) no_pictures: bool,
    /// Print JSON, one object a line, instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum PoseOf {
    /// The rover's frame: x forward, z up, origin on the wheels' contact plane.
    Rover,
    /// The sensor's own frame, as LiDAR odometry gives it.
    Sensor,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Frame {
    /// x forward, y left, z up, origin at the sensor.
    Sensor,
    /// The frame of the poses.
    Map,
}
