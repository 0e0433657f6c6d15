//! `poses`: one row per step of a drive, truth beside estimate.

use super::{Definition, define};
use crate::corpus::schema::Role::{Info, Key, Truth};
use crate::episode::PoseRow;

/// A step and where it belongs.
pub(crate) struct Row<'a> {
    scene_id: i64,
    pose: &'a PoseRow,
    /// Standard deviations of x, y, z, roll, pitch, yaw.
    sigmas: [f64; 6],
}

impl<'a> Row<'a> {
    pub(crate) fn of(scene_id: u64, pose: &'a PoseRow) -> Row<'a> {
        Row { scene_id: scene_id as i64, pose, sigmas: pose.estimate.sigmas() }
    }
}

type Extract<'a> = super::Extract<Row<'a>>;

/// The upper triangle of the covariance, row by row: row, column, name, unit, meaning.
macro_rules! covariances {
    ($($row:literal $column:literal $name:literal $unit:literal $of:literal;)*) => {
        [$(($row, $column, $name, $unit, concat!("Covariance of the errors of the estimated ", $of, "."))),*]
    };
}
const COVARIANCES: [(usize, usize, &str, &str, &str); 21] = covariances! {
    0 0 "covariance_x_x_m2" "m2" "x and x";
    0 1 "covariance_x_y_m2" "m2" "x and y";
    0 2 "covariance_x_z_m2" "m2" "x and z";
    0 3 "covariance_x_roll_m_rad" "m rad" "x and roll";
    0 4 "covariance_x_pitch_m_rad" "m rad" "x and pitch";
    0 5 "covariance_x_yaw_m_rad" "m rad" "x and yaw";
    1 1 "covariance_y_y_m2" "m2" "y and y";
    1 2 "covariance_y_z_m2" "m2" "y and z";
    1 3 "covariance_y_roll_m_rad" "m rad" "y and roll";
    1 4 "covariance_y_pitch_m_rad" "m rad" "y and pitch";
    1 5 "covariance_y_yaw_m_rad" "m rad" "y and yaw";
    2 2 "covariance_z_z_m2" "m2" "z and z";
    2 3 "covariance_z_roll_m_rad" "m rad" "z and roll";
    2 4 "covariance_z_pitch_m_rad" "m rad" "z and pitch";
    2 5 "covariance_z_yaw_m_rad" "m rad" "z and yaw";
    3 3 "covariance_roll_roll_rad2" "rad2" "roll and roll";
    3 4 "covariance_roll_pitch_rad2" "rad2" "roll and pitch";
    3 5 "covariance_roll_yaw_rad2" "rad2" "roll and yaw";
    4 4 "covariance_pitch_pitch_rad2" "rad2" "pitch and pitch";
    4 5 "covariance_pitch_yaw_rad2" "rad2" "pitch and yaw";
    5 5 "covariance_yaw_yaw_rad2" "rad2" "yaw and yaw";
};

/// `covariance`: all of it, behind the columns that every corpus has.
pub(crate) fn definitions<'a>(covariance: bool) -> Vec<Definition<Row<'a>>> {
    let mut definitions = fixed();
    if covariance {
        definitions.extend(COVARIANCES.map(|(row, column, name, unit, meaning)| {
            let value = move |r: &Row<'a>| r.pose.estimate.covariance[row][column];
            define(name, unit, Info, meaning, Extract::number(value))
        }));
    }
    definitions
}

#[rustfmt::skip]
fn fixed<'a>() -> Vec<Definition<Row<'a>>> {
    vec![
        define("scene_id", "1", Key, "Number of the scene in the corpus.", Extract::number(|r| r.scene_id)),
        define("step", "1", Key, "Control step, 0 is the start at rest.", Extract::number(|r| r.pose.step as i32)),
        define("stop", "1", Info, "The rover stands and sweeps here.", Extract::flag(|r| r.pose.stop)),
        define("scan_id", "1", Info, "The kept scan made here: scan_id of cells and points; null where none is kept.", Extract::number_or_null(|r| r.pose.scan_id.map(|id| id as i32))),
        define("time_s", "s", Info, "Time from the start.", Extract::number(|r| r.pose.time_s)),
        define("truth_x_m", "m", Truth, "True position of the rover, frame world.", Extract::number(|r| r.pose.truth.position_m.x)),
        define("truth_y_m", "m", Truth, "True position of the rover, frame world.", Extract::number(|r| r.pose.truth.position_m.y)),
        define("truth_z_m", "m", Truth, "True height of the wheel-contact plane at the chassis centre, frame world.", Extract::number(|r| r.pose.truth.position_m.z)),
        define("truth_roll_rad", "rad", Truth, "True roll, right side down positive.", Extract::number(|r| r.pose.truth.roll_rad)),
        define("truth_pitch_rad", "rad", Truth, "True pitch, nose down positive.", Extract::number(|r| r.pose.truth.pitch_rad)),
        define("truth_yaw_rad", "rad", Truth, "True yaw, counter-clockwise from +x, in (-pi, pi].", Extract::number(|r| r.pose.truth.yaw_rad)),
        define("x_m", "m", Info, "Estimated position of the rover, frame map.", Extract::number(|r| r.pose.estimate.pose.position_m.x)),
        define("y_m", "m", Info, "Estimated position of the rover, frame map.", Extract::number(|r| r.pose.estimate.pose.position_m.y)),
        define("z_m", "m", Info, "Estimated height of the wheel-contact plane at the chassis centre, frame map.", Extract::number(|r| r.pose.estimate.pose.position_m.z)),
        define("roll_rad", "rad", Info, "Estimated roll, right side down positive.", Extract::number(|r| r.pose.estimate.pose.roll_rad)),
        define("pitch_rad", "rad", Info, "Estimated pitch, nose down positive.", Extract::number(|r| r.pose.estimate.pose.pitch_rad)),
        define("yaw_rad", "rad", Info, "Estimated yaw, counter-clockwise from +x, in (-pi, pi].", Extract::number(|r| r.pose.estimate.pose.yaw_rad)),
        define("sigma_x_m", "m", Info, "Standard deviation of the estimated x.", Extract::number(|r| r.sigmas[0])),
        define("sigma_y_m", "m", Info, "Standard deviation of the estimated y.", Extract::number(|r| r.sigmas[1])),
        define("sigma_z_m", "m", Info, "Standard deviation of the estimated z.", Extract::number(|r| r.sigmas[2])),
        define("sigma_roll_rad", "rad", Info, "Standard deviation of the estimated roll.", Extract::number(|r| r.sigmas[3])),
        define("sigma_pitch_rad", "rad", Info, "Standard deviation of the estimated pitch.", Extract::number(|r| r.sigmas[4])),
        define("sigma_yaw_rad", "rad", Info, "Standard deviation of the estimated yaw.", Extract::number(|r| r.sigmas[5])),
        define("effective_samples", "1", Info, "Effective sample size of the particles; 1 for methods without particles.", Extract::number(|r| r.pose.estimate.effective_samples)),
        define("features", "1", Info, "Features found in the last sweep.", Extract::number(|r| r.pose.estimate.features as i32)),
        define("matched", "1", Info, "Of them, matched to landmarks.", Extract::number(|r| r.pose.estimate.matched as i32)),
        define("new_landmarks", "1", Info, "Of them, taken as new landmarks.", Extract::number(|r| r.pose.estimate.new_landmarks as i32)),
        define("landmarks", "1", Info, "Landmarks in the map.", Extract::number(|r| r.pose.estimate.landmarks as i32)),
        define("skipped", "1", Info, "Measurements left out so far: not finite, gated or ambiguous.", Extract::number(|r| r.pose.estimate.skipped as i32)),
        define("sigma_optimistic", "1", Info, "The particles have few distinct ancestors: the position sigmas are too small.", Extract::flag(|r| r.pose.estimate.sigma_optimistic)),
    ]
}
