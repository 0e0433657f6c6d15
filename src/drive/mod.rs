//! A yard and a rover -> a drive: true poses, contacts, and what the instruments read.
//!
//! In: [`DriveParams`], a [`Scene`], drawn values, streams. Out: a [`DriveLog`]; truth and readings stand apart, since slam
//! sees readings only. Source: Hewitt et al. 2017, "Rover model"; Thrun et al. 2005 (velocity motion); Tarokh & McDermott
//! 2005 (contact). Frames: `rover` has its origin at the chassis centre projected onto the wheel-contact plane, so that
//! `z_r` of eq. 3 is the pose's z. Not modelled: dynamics, sinkage, wheel slip in the true path other than its noise.

pub mod params;
pub mod rover;

pub use params::DriveParams;
pub use rover::Rover;

use crate::geometry::Pose;

/// A finished drive. Step 0 is the start, at rest.
#[derive(Clone, Debug)]
pub struct DriveLog {
    /// True pose after each step, world; `truth[0]` is the start.
    pub truth: Vec<Pose>,
    /// How the rover stood after each step.
    pub contacts: Vec<Contact>,
    /// What the instruments read over each step; as long as `truth`; `readings[0]` is taken at rest at the start.
    pub readings: Vec<Reading>,
    /// Steps at which the rover stands and sweeps, ascending; the last step is one of them.
    pub stops: Vec<usize>,
}

/// How the chassis stands on the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Rocker-bogie: rocker difference (beta) and left and right bogie angles (rho), radians; 0 for a rigid chassis.
    pub rocker_rad: f64,
    pub bogie_left_rad: f64,
    pub bogie_right_rad: f64,
    /// Largest distance of a wheel from touching, metres.
    pub residual_m: f64,
    pub iterations: u32,
}

/// What the instruments say of one step; the only thing of a drive that slam may see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Length of the step, seconds; 0 for the start.
    pub dt_s: f64,
    /// Odometry: forward speed and yaw rate over the step.
    pub speed_mps: f64,
    pub yaw_rate_radps: f64,
    /// IMU after the step; `None` where the rover has none.
    pub roll_rad: Option<f64>,
    pub pitch_rad: Option<f64>,
    /// Sun sensor after the step; `None` between its readings.
    pub yaw_rad: Option<f64>,
}

/// Standard deviations that the instruments of this scene have (drawn per scene), as slam is told them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstrumentNoise {
    /// Of roll and pitch.
    pub imu_rad: f64,
    pub sun_rad: f64,
    /// Of driven distance, metres per square root of a metre driven.
    pub odometry_m_per_sqrt_m: f64,
    /// Of heading, radians per square root of a metre driven.
    pub heading_rad_per_sqrt_m: f64,
}

/// Why a drive could not be made.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    #[error("no place to start: {tries} places were tried, each on an obstacle or too near the yard's edge")]
    NoStart { tries: u32 },
    #[error("no way along the path: {reason}")]
    NoWay { reason: String },
    #[error("the rover cannot stand at ({x_m:.2}, {y_m:.2}): {reason}")]
    NoContact { x_m: f64, y_m: f64, reason: String },
}
