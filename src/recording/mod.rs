//! A recorded drive -> where the rover was, and what stands around: the filter of corpora on one's own logs.
//!
//! In: odometry, features or a list of sweeps, and truth as CSV ([`read`]), the noise of the instruments. Out: a [`Located`] drive: a pose and
//! its covariance at each time of either log, the map of the likeliest particle, and scores against a truth. What is seen within an
//! odometry step cuts the step in two. Source: as for [`crate::slam`]. Deviation: none of the filter; of features that come from a log no
//! free space is known, and a landmark that is not seen again is kept; of points ([`returns_of_points`]) it is known where they lie, not
//! where a beam met nothing. Frames: `map` is the truth's, `sensor` has x forward, y left and z up; metres, seconds, radians. Not
//! modelled: delays between the logs, biases, and the rover's own motion within a sweep.

mod locate;
pub mod read;
mod score;
mod sweep;

pub use locate::{LocateParams, Located, Step, locate};
pub use score::{Score, score, truth_at};
pub use sweep::{SweepPoints, returns_of_points};

use crate::drive::Reading;
use crate::slam::Feature;

/// What was recorded of one drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Ascending by time; a reading is of the step that ends at its time, and the first is taken at rest.
    pub readings: Vec<(f64, Reading)>,
    /// Ascending by time; all features of one time together.
    pub observations: Vec<(f64, Observation)>,
}

/// What was seen at a time.
#[derive(Clone, Debug, PartialEq)]
pub enum Observation {
    Features(Vec<Feature>),
    /// The file of a sweep's points, and the line of the log that names it: sweeps are large, and read when their time has come.
    Sweep {
        file: String,
        line: u64,
    },
}

/// A log of what was seen: the name that errors call it by, and its text.
#[derive(Clone, Copy, Debug)]
pub enum SightLog<'a> {
    Features { file: &'a str, text: &'a str },
    Sweeps { file: &'a str, text: &'a str },
}

/// A log that makes no sense: where, what, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}{}: {what}; {cure}", line.map(|line| format!(":{line}")).unwrap_or_default())]
pub struct RecordingError {
    pub file: String,
    pub line: Option<u64>,
    pub what: String,
    pub cure: String,
}
