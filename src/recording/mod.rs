//! A recorded drive -> where the rover was, and what stands around: the filter of corpora on one's own logs.
//!
//! In: odometry, features and truth as CSV ([`read`]), the noise of the instruments. Out: a [`Located`] drive: a pose and its covariance at
//! each time of either log, the map of the likeliest particle, and scores against a truth. A feature seen within an odometry step cuts the
//! step in two. Source: as for [`crate::slam`]. Deviation: none of the filter; features here come from the log, so that no free space
//! is known, and a landmark that is not seen again is kept. Frames: `map` is the truth's, `sensor` has x forward and y left; metres,
//! seconds, radians. Not modelled: delays between the logs, and biases.

mod locate;
pub mod read;
mod score;

pub use locate::{LocateParams, Located, Step, locate};
pub use score::{Score, score, truth_at};

use crate::drive::Reading;
use crate::slam::Feature;

/// What was recorded of one drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Ascending by time; a reading is of the step that ends at its time, and the first is taken at rest.
    pub readings: Vec<(f64, Reading)>,
    /// Ascending by time; all features of one time together.
    pub observations: Vec<(f64, Vec<Feature>)>,
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
