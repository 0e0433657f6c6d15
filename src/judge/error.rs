//! Why scans cannot be judged; each message names the scan or the option (as `classify` calls it), the rule and the cure.

use crate::cells::level::NoGround;
use crate::cloud::CloudError;
use crate::corpus::CorpusError;
use crate::geometry::DVec3;
use crate::train::ModelError;

use super::scan::MOST_COORDINATE_M;

/// Why a judge cannot be made, or a scan not be judged.
#[derive(Debug, thiserror::Error)]
pub enum JudgeError {
    #[error(transparent)]
    Cloud(#[from] CloudError),
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The cells' table could not be written.
    #[error(transparent)]
    Table(#[from] CorpusError),
    #[error("--max-range {max_range_m}: must be a number above 0; leave it out for that of the model")]
    MaxRange { max_range_m: f64 },
    #[error(
        "--overhang {above_m}: the free height that the rover needs is a number of metres above 0; leave it out for that of the model"
    )]
    Overhang { above_m: f64 },
    #[error(
        "--self-filter={length_m},{width_m},{height_m}: length, width and height of the rover are metres above 0; leave them out for those of the model's"
    )]
    OwnBody { length_m: f64, width_m: f64, height_m: f64 },
    #[error("--window 0: at least 1")]
    NoWindow,
    #[error("--window needs poses: with --sensor-height each scan has a frame of its own; give --trajectory or --pose")]
    WindowWithoutPoses,
    #[error(
        "points in the map's frame need poses: the ground is looked for below the sensor; give poses, or points in the sensor's frame"
    )]
    MapWithoutPoses,
    #[error("--sigma-{name} {value} {unit}: a standard deviation is 0 or more, and less than 1e6")]
    Sigma { name: &'static str, value: f64, unit: &'static str },
    #[error(
        "a pose at {position_m}: positions lie within {MOST_COORDINATE_M:e} m of the map's origin; subtract the origin, or mend the unit"
    )]
    FarPose { position_m: DVec3 },
    #[error("{scan}: there is no pose for it")]
    NoPose { scan: String },
    /// `question`: one to ask of the coordinates, after a semicolon.
    #[error("{scan}: {source}{question}; give the pose with --pose instead")]
    NoGround { scan: String, source: NoGround, question: String },
    #[error("{scan}: {points} points, and {values} intensities or labels: give one a point, or none")]
    UnevenColumns { scan: String, points: usize, values: usize },
    #[error(
        "{scan}: the model takes {}, and the cloud has no intensities; export them with the cloud, or use a model without them",
        features.join(", ")
    )]
    NoIntensities { scan: String, features: Vec<String> },
    #[error(
        "{scan}: there are no labels in it to judge the model by; name their column with --label-field, put a .label file beside \
         a KITTI scan, or leave out --labels"
    )]
    NoLabels { scan: String },
    #[error(
        "{scan}: the cells span {columns} by {rows}, which is more than the {limit} pixels that a cost map may have; shorten \
         --max-range"
    )]
    MapTooLarge { scan: String, columns: u64, rows: u64, limit: u64 },
}
