//! A yard and a rover -> a drive: true poses, contacts, and what the instruments read.
//!
//! In: [`DriveParams`], a [`Scene`], drawn values, streams. Out: a [`DriveLog`]; truth and readings stand apart, since slam
//! sees readings only. Source: Hewitt et al. 2017, "Rover model"; Thrun et al. 2005 (velocity motion); Tarokh & McDermott
//! 2005 (contact). Frames: `rover` has its origin at the chassis centre projected onto the wheel-contact plane, so that
//! `z_r` of eq. 3 is the pose's z. Not modelled: dynamics, sinkage, wheel slip in the true path other than its noise, and, unless
//! the drive is over bodies, obstacles no taller than a wheel, which the rover drives over as if they were not there.
//!
//! ```
//! use marsyard::drive::rover::{Chassis, Mount, RigidChassis};
//! use marsyard::drive::params::{LengthParams, PathParams};
//! use marsyard::drive::{DriveParams, Rover, drive};
//! use marsyard::geometry::DVec2;
//! use marsyard::preset::Preset;
//! use marsyard::random::{Dist, Drawn, Stage, Streams};
//! use marsyard::scene::{Ground, Polynomial, Scene};
//!
//! let rover = Rover {
//!     name: "cart".into(),
//!     source: String::new(),
//!     chassis: Chassis::Rigid(RigidChassis { wheelbase_m: 0.5, track_m: 0.4 }),
//!     wheel_diameter_m: 0.2,
//!     length_m: 0.7,
//!     width_m: 0.6,
//!     height_m: None,
//!     max_speed_mps: 0.5,
//!     max_yaw_rate_degps: 30.0,
//!     mount: Mount { x_m: 0.2, y_m: 0.0, z_m: 0.6, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 },
//!     limits: None,
//! };
//! let params = DriveParams {
//!     rover: Preset::Inline(Box::new(rover)),
//!     path: PathParams::Straight(LengthParams { length_m: Dist::Constant(2.0) }),
//!     stops: 3,
//!     ..DriveParams::default()
//! };
//! // A plane of slope 0.1 along x.
//! let ground = Polynomial::plane(20.0, 0.0, DVec2::new(0.1, 0.0));
//! let yard = Scene::bare(20.0, Ground::Polynomial(ground));
//! let streams = Streams { seed: 1, scene: 0, attempt: 0, stage: Stage::Drive, step: 0 };
//! let log = drive(&params, &yard, &Drawn::draw(&streams, params.dists()), &streams)?;
//!
//! // The rover advances along its nose: 2 m on the plane, and less as seen from above.
//! let way = log.truth[log.truth.len() - 1].position_m - log.truth[0].position_m;
//! assert!(!log.cut_short && (way.length() - 2.0).abs() < 1e-6 && way.truncate().length() < 2.0);
//! // A rover on a plane stands along it: what its heading climbs is the plane's slope that way.
//! for pose in &log.truth {
//!     let forward = pose.rotation().x_axis;
//!     assert!((forward.z - 0.1 * forward.x).abs() < 1e-6);
//! }
//! assert_eq!((log.stops.len(), log.stops[2]), (3, log.truth.len() - 1));
//! # Ok::<(), marsyard::drive::DriveError>(())
//! ```

mod barriers;
mod belly;
mod contact;
#[cfg(test)]
mod fixtures;
mod follow;
mod footing;
mod guide;
mod instruments;
pub mod limits;
mod linkage;
mod motion;
mod outline;
#[cfg(test)]
mod over_bodies_tests;
pub mod params;
mod path;
mod rolled;
mod route;
pub mod rover;
mod start;
#[cfg(test)]
mod stops_tests;
mod surface;
#[cfg(test)]
mod tests;
mod yard;

#[cfg(test)]
pub(crate) use belly::clearance_m;
pub(crate) use belly::plate_clearance_m;
pub use contact::{ContactPose, GroundContact};
pub(crate) use linkage::WheelShare;
pub use params::DriveParams;
pub use rover::Rover;

use crate::geometry::Pose;
use crate::random::{Drawn, Streams};
use crate::scene::Scene;
use footing::Footing;
use yard::Yard;

/// Drives the rover through a scene.
///
/// Fails where there is no place to start or no way to the goal; a path that meets an obstacle, the yard's edge or ground
/// the rover cannot stand on just ends there.
pub fn drive(params: &DriveParams, scene: &Scene, drawn: &Drawn, streams: &Streams) -> Result<DriveLog, DriveError> {
    let limits = params.limits()?;
    let yard = Yard::new(scene, &params.rover, limits);
    let footing = Footing::new(params, scene, limits);
    let (start, guide) = path::begin(params, &yard, &footing, drawn, streams)?;
    let bumps = motion::MotionNoise::new(params, drawn, streams);
    let travel = follow::follow(&params.rover, &yard, &footing, start, guide, &bumps)?;
    let stops = travel.stops(params.stops, params.turn_as_way_m_per_rad);
    let readings = instruments::Instruments::new(params, drawn, streams).read(&travel, &stops);
    Ok(DriveLog {
        truth: travel.stances.iter().map(|stance| stance.pose).collect(),
        contacts: travel.stances.iter().map(|stance| stance.contact).collect(),
        readings,
        stops,
        cut_short: travel.cut_short,
    })
}

/// A finished drive. Step 0 is the start, at rest.
#[derive(Clone, Debug)]
pub struct DriveLog {
    /// True pose after each step, world; `truth[0]` is the start.
    pub truth: Vec<Pose>,
    /// How the rover stood after each step.
    pub contacts: Vec<Contact>,
    /// What the instruments read over each step; as long as `truth`; `readings[0]` is taken at rest at the start.
    pub readings: Vec<Reading>,
    /// Steps at which the rover stands and sweeps, ascending; the last step is one of them, and of two or more the start.
    pub stops: Vec<usize>,
    /// Whether an obstacle, the yard's edge or the ground ended the path before its length or its goal.
    pub cut_short: bool,
}

impl DriveLog {
    /// The log's bits, in order: the stage hash.
    pub fn hash_into(&self, hasher: &mut blake3::Hasher) {
        let mut count = |n: usize| {
            hasher.update(&(n as u64).to_le_bytes());
        };
        count(self.truth.len());
        count(self.stops.len());
        count(usize::from(self.cut_short));
        self.stops.iter().for_each(|&stop| count(stop));
        let mut number = |value: f64| {
            hasher.update(&value.to_bits().to_le_bytes());
        };
        for pose in &self.truth {
            let Pose { position_m, roll_rad, pitch_rad, yaw_rad } = *pose;
            [position_m.x, position_m.y, position_m.z, roll_rad, pitch_rad, yaw_rad].into_iter().for_each(&mut number);
        }
        for contact in &self.contacts {
            let Contact { rocker_rad, bogie_left_rad, bogie_right_rad, residual_m, iterations } = *contact;
            [rocker_rad, bogie_left_rad, bogie_right_rad, residual_m, f64::from(iterations)]
                .into_iter()
                .for_each(&mut number);
        }
        for reading in &self.readings {
            let Reading { dt_s, speed_mps, yaw_rate_radps, roll_rad, pitch_rad, yaw_rad } = *reading;
            [dt_s, speed_mps, yaw_rate_radps].into_iter().for_each(&mut number);
            for value in [roll_rad, pitch_rad, yaw_rad] {
                // A pair, so that no reading and a reading of 0 differ.
                [f64::from(u8::from(value.is_some())), value.unwrap_or(0.0)].into_iter().for_each(&mut number);
            }
        }
    }
}

/// How the chassis stands on the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Rocker-bogie, nose down positive, radians: the left rocker against the chassis (beta; the right one's is -beta), and
    /// the left and right bogie against their rockers (rho); 0 for a rigid chassis.
    pub rocker_rad: f64,
    pub bogie_left_rad: f64,
    pub bogie_right_rad: f64,
    /// Largest distance of a wheel from touching, metres.
    pub residual_m: f64,
    /// Linearisations (Gauss-Newton) or evaluations (Nelder-Mead) that it took.
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
    /// Of roll and pitch, from reading to reading.
    pub imu_rad: f64,
    /// Of the constant bias of roll and of pitch.
    pub imu_bias_rad: f64,
    /// Of the sun sensor's heading; 0 where the rover has none (and no reading then holds one).
    pub sun_rad: f64,
    /// Of driven distance, metres per square root of a metre driven.
    pub odometry_m_per_sqrt_m: f64,
    /// Of the way aside that wheels slip, metres per square root of a metre driven. No reading tells of it, and no simulated wheel does it.
    pub sideways_m_per_sqrt_m: f64,
    /// Of the share of the counted way that is not driven, the same over the whole drive; its mean is taken for 0 (negative: more is driven than
    /// counted). 0 to 0.9; where a config draws the share, the root mean square of what is uniform between the law's bounds.
    pub slip: f64,
    /// Of heading, radians per square root of a metre driven by the outer wheels (way + |turn| * track / 2).
    pub heading_rad_per_sqrt_m: f64,
}

/// Why a drive could not be made.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    #[error(
        "no place to start: {tries} places were tried, each on an obstacle, too near the yard's edge or too steep; \
             lower drive.start.margin_m or the number of obstacles"
    )]
    NoStart { tries: u32 },
    #[error("no way along drive.path: {reason}")]
    NoWay { reason: String },
    #[error("the rover cannot stand at ({x_m:.2}, {y_m:.2}): {reason}")]
    NoContact { x_m: f64, y_m: f64, reason: String },
}
