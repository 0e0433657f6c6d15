//! Readings and sweeps -> estimated poses with covariance. Never the truth.
//!
//! In: [`SlamParams`], the start pose (known), [`Reading`](crate::drive::Reading)s, [`Returns`](crate::sweep::Returns)s. Out: an [`Estimate`] per step, frame `map`.
//! Source: Montemerlo et al. 2003 (FastSLAM 2.0), in six degrees of freedom on terrain; deviation: each sweep is also laid
//! on that of the stop before (`registration`, `keyframe`). All of it runs relative to the start, so that coordinates of
//! any size lose no digits. Of the start only the position is believed: the attitude comes from the first readings, where the rover
//! has the instruments.
//!
//! The filter on features of one's own front end: wheels that slip say 1.2 m where the rover drove 1 m; six landmarks know better.
//!
//! ```
//! use marsyard::drive::{InstrumentNoise, Reading};
//! use marsyard::geometry::{DVec3, Pose, Transform};
//! use marsyard::random::{Stage, Streams};
//! use marsyard::slam::{FastslamParams, Feature, Slam, SlamParams, Visibility};
//!
//! let noise = InstrumentNoise {
//!     imu_rad: 0.01,
//!     imu_bias_rad: 0.0,
//!     sun_rad: 0.03,
//!     odometry_m_per_sqrt_m: 0.02,
//!     sideways_m_per_sqrt_m: 0.0,
//!     slip: 0.2,
//!     heading_rad_per_sqrt_m: 0.03,
//! };
//! let landmarks = [(3.0, 1.0), (2.5, -1.5), (4.0, 0.2), (1.5, 2.0), (3.5, 2.2), (4.2, -2.0)];
//! // Range, bearing and elevation of each from a level sensor at (x, 0), half a metre above the ground.
//! let seen_from = |x_m: f64| {
//!     landmarks.map(|(x, y)| {
//!         let d = DVec3::new(x - x_m, y, -0.3);
//!         let polar = [d.length(), d.y.atan2(d.x), (d.z / d.length()).asin()];
//!         Feature { polar, points: 20, half_width_m: 0.1, known: None, sigmas: [None; 3] }
//!     })
//! };
//! let reading = |dt_s: f64, speed_mps: f64| Reading {
//!     dt_s,
//!     speed_mps,
//!     yaw_rate_radps: 0.0,
//!     roll_rad: Some(0.0),
//!     pitch_rad: Some(0.0),
//!     yaw_rad: Some(0.0),
//! };
//! let rover_from_sensor = Transform { translation_m: DVec3::new(0.0, 0.0, 0.5), ..Transform::IDENTITY };
//! let params = SlamParams::Fastslam(FastslamParams::default());
//! let streams = |step| Streams { seed: 4, scene: 0, attempt: 0, stage: Stage::Slam, step };
//! let blind = Visibility::blind(10.0);
//!
//! let mut slam = Slam::new(&params, &noise, &Pose::default(), &rover_from_sensor)?;
//! slam.step(&reading(0.0, 0.0))?;
//! let first = slam.observe_features(&seen_from(0.0), &blind, &streams(0))?;
//! assert_eq!((first.matched, first.new_landmarks), (0, 6));
//! slam.step(&reading(4.0, 0.3))?;
//! let off_before_m = (slam.estimate().pose.position_m.x - 1.0).abs();
//! let after = slam.observe_features(&seen_from(1.0), &blind, &streams(1))?;
//! let off_after_m = (after.pose.position_m.x - 1.0).abs();
//! assert_eq!(after.matched, 6);
//! assert!((off_before_m - 0.2).abs() < 0.02 && off_after_m < 0.05, "{off_before_m} {off_after_m}");
//! // And how much of what the wheels count is driven.
//! let (scale, sigma) = slam.odometry_scale();
//! assert!((scale - 1.0 / 1.2).abs() < 3.0 * sigma && sigma < 0.05, "{scale} {sigma}");
//! # Ok::<(), marsyard::slam::SlamError>(())
//! ```

mod associate;
pub mod cloned;
mod cloud;
mod estimate;
pub mod features;
mod filter;
mod gating;
mod ground_slope;
mod kalman;
mod keyframe;
mod landmark;
mod localiser;
pub mod matrix;
pub mod measurement;
pub mod motion;
mod observation;
pub mod params;
mod particle;
mod per_particle;
mod registration;
pub mod scale;
mod tum;
mod visibility;
mod weights;

pub use estimate::{Estimate, surrogate, truth};
pub use landmark::Landmark;
pub(crate) use localiser::MOST_SLIP;
pub use localiser::{Counters, Mode, Slam, SlamError};
pub use observation::Feature;
pub use params::{FastslamParams, RegistrationParams, SlamParams, SurrogateParams};
pub use tum::tum;
pub use visibility::Visibility;

#[cfg(test)]
mod tests;
