//! A yard and a sensor pose -> one sweep: a range, a status and the truth of every beam slot.
//!
//! In: [`SweepParams`], a [`Scene`], `world_from_sensor`, streams, scratch. Out: a [`Sweep`] in the `sensor` frame.
//! Source: Hewitt et al. 2017, "LiDAR model"; beam effects from `Not modelled` is said per module. The rover stands while
//! it sweeps (no motion during a sweep); all beams of a sweep leave one point (the tilt head's own lever arm is not modelled).

pub mod cast;
pub mod params;
pub mod sensor;

pub use cast::{Caster, Hit, Inside, Origin};
pub use params::SweepParams;
pub use sensor::Sensor;

use std::sync::Arc;

use crate::geometry::DVec3;

/// The beam directions of a sensor: `lines` rows of `beams` slots each, in firing order.
#[derive(Clone, Debug)]
pub struct Pattern {
    pub lines: u32,
    pub beams: u32,
    /// Unit directions in the sensor frame (x forward, y left, z up); slot = line * beams + beam.
    pub directions: Vec<DVec3>,
    /// Time of each slot from the sweep's start, seconds (one pose a sweep all the same).
    pub times_s: Vec<f64>,
}

/// What became of a beam.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub enum Status {
    /// A range was measured.
    Hit = 0,
    /// Nothing within the sensor's reach.
    None = 1,
    /// Something was there, but too little light came back (or a random drop).
    Dropped = 2,
    /// A range was measured outside the sensor's gates.
    OutOfRange = 3,
}

/// One sweep, slot by slot; every vector has one entry a slot, misses included.
#[derive(Clone, Debug)]
pub struct Sweep {
    pub pattern: Arc<Pattern>,
    /// Measured range, metres; NaN unless the status is `Hit`.
    pub range_m: Vec<f64>,
    pub status: Vec<Status>,
    /// Received intensity, where the effect is on.
    pub intensity: Option<Vec<f32>>,
    /// Share of the return's energy that came off other surfaces than the labelled one, where sub-rays are cast.
    pub mixed: Option<Vec<f32>>,
    /// Truth, for labels and scoring only: never read by slam or by features.
    pub truth: Vec<TrueReturn>,
}

/// What a beam truly met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueReturn {
    /// True first-hit range along the measured beam's axis, metres; infinite where nothing was met.
    pub range_m: f64,
    /// Id of the obstacle, volume or patch; -1 ground, -2 nothing.
    pub object: i32,
    /// A `scene::Class` as its number; -1 where nothing was met.
    pub class: i8,
    /// The hit lies on an upward face (normal within 30 degrees of up) and off the rim: a rock's top.
    pub top: bool,
}

/// Why a sweep could not be made.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    #[error("the sensor is below the ground at ({x_m:.2}, {y_m:.2}): by {depth_m:.3} m")]
    Buried { x_m: f64, y_m: f64, depth_m: f64 },
    #[error("the sensor is inside obstacle {object}")]
    Inside { object: i32 },
}
