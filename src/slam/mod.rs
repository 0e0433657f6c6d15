//! Readings and sweeps -> estimated poses with covariance. Never the truth.
//!
//! In: [`SlamParams`], the start pose (known), [`Reading`]s, [`Returns`]s. Out: an [`Estimate`] per step, frame `map`.
//! Source: Montemerlo et al. 2003 (FastSLAM 2.0), in six degrees of freedom on terrain; deviation: what stands up in a sweep is also laid
//! on what stood up at the stop before (`registration`, `keyframe`). All of it runs relative to the start, so that coordinates of
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
//!         Feature { polar, points: 20, half_width_m: 0.1, known: None }
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
mod cloud;
pub mod features;
mod filter;
mod gating;
mod ground_slope;
mod kalman;
mod keyframe;
mod landmark;
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

pub use landmark::Landmark;
pub use observation::Feature;
pub use params::{FastslamParams, SlamParams, SurrogateParams};
pub use tum::tum;
pub use visibility::Visibility;

use crate::drive::{InstrumentNoise, Reading};
use crate::geometry::{DVec3, Pose, Transform};
use crate::math;
use crate::random::{Purpose, Streams};
use crate::sweep::Returns;
use features::Extractor;
use filter::Filter;
use measurement::Mounting;

/// What is believed of the pose. Order of the covariance: x, y, z, roll, pitch, yaw (metres, radians).
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    pub pose: Pose,
    pub covariance: [[f64; 6]; 6],
    /// Effective sample size; 1 for methods without particles.
    pub effective_samples: f64,
    /// Of the last sweep: features found, matched to landmarks, new; landmarks in the map.
    pub features: u32,
    pub matched: u32,
    pub new_landmarks: u32,
    pub landmarks: u32,
    /// Measurements left out so far: not finite, gated, ambiguous.
    pub skipped: u32,
    /// Fewer than 3 of the first particles have descendants left: the position sigmas are too small.
    pub sigma_optimistic: bool,
}

impl Estimate {
    /// Standard deviations of x, y, z, roll, pitch, yaw.
    pub fn sigmas(&self) -> [f64; 6] {
        std::array::from_fn(|i| self.covariance[i][i].max(0.0).sqrt())
    }

    /// Feeds every bit of the estimate, in the order of the fields.
    pub fn hash_into(&self, hasher: &mut blake3::Hasher) {
        let Pose { position_m, roll_rad, pitch_rad, yaw_rad } = self.pose;
        let pose = [position_m.x, position_m.y, position_m.z, roll_rad, pitch_rad, yaw_rad];
        for value in pose.iter().chain(self.covariance.iter().flatten()).chain([&self.effective_samples]) {
            hasher.update(&value.to_bits().to_le_bytes());
        }
        for count in [self.features, self.matched, self.new_landmarks, self.landmarks, self.skipped] {
            hasher.update(&count.to_le_bytes());
        }
        hasher.update(&[u8::from(self.sigma_optimistic)]);
    }
}

/// Measurements left out, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Controls, angles and features that make no sense: not finite, beyond reason, too near or too steep for a bearing.
    pub not_finite: u32,
    /// Angles, and places of sweeps on the one before, too far from what is believed.
    pub gated: u32,
    /// Features that may be of two landmarks, or of none.
    pub ambiguous: u32,
    /// Features without a number that stood within 0.3 m of one with more points, and those that were more than are taken in.
    pub passed_over: u32,
    /// Times at which no particle had any weight left, and all were made equal.
    pub weight_collapses: u32,
}

/// What carries the estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Features or surfaces.
    Slam,
    /// At the last three stops or more no feature was matched, and no surface found again.
    DeadReckoning,
}

/// Why slam gave up.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SlamError {
    #[error("the estimated pitch is {pitch_deg:.1} degrees: beyond 80 the angles have no meaning")]
    Upended { pitch_deg: f64 },
    #[error("slam.fastslam.particles is 0: give at least 1")]
    NoParticles,
    #[error("the start pose holds a value that is not finite: give finite numbers")]
    StartNotFinite,
    #[error("the sensor's place on the rover holds a value that is not finite: give finite numbers")]
    MountNotFinite,
    #[error("the filter is told of a slip of {slip}: give a share of 0 to {MOST_SLIP}")]
    Slip { slip: f64 },
    #[error("the method {method} reads no instruments: ask it for its estimate directly")]
    NoFilter { method: &'static str },
}

/// The running estimate of one drive.
#[derive(Clone, Debug)]
pub struct Slam {
    filter: Filter,
    /// `None` for dead reckoning.
    extractor: Option<Extractor>,
    /// Whether sweeps are laid on one another.
    registers: bool,
    start_m: DVec3,
}

/// Wheels that slip by more stand still.
pub(crate) const MOST_SLIP: f64 = 0.9;
/// The belief of a pose ends here: 80 degrees.
const MOST_PITCH_RAD: f64 = 80.0 / 180.0 * std::f64::consts::PI;

impl Slam {
    /// A filter that stands at the start. Fed with one reading a step, the one taken at the start first.
    pub fn new(
        params: &SlamParams,
        noise: &InstrumentNoise,
        start: &Pose,
        rover_from_sensor: &Transform,
    ) -> Result<Slam, SlamError> {
        let alone = FastslamParams { particles: 1, ..FastslamParams::default() };
        let (params, extractor) = match params {
            SlamParams::Fastslam(params) => (params, Some(Extractor::new(params.feature_range_m, rover_from_sensor))),
            SlamParams::DeadReckoning => (&alone, None),
            SlamParams::Surrogate(_) => return Err(SlamError::NoFilter { method: "surrogate" }),
            SlamParams::Truth => return Err(SlamError::NoFilter { method: "truth" }),
        };
        if params.particles == 0 {
            return Err(SlamError::NoParticles);
        }
        let attitude = [start.roll_rad, start.pitch_rad, start.yaw_rad];
        if !start.position_m.is_finite() || attitude.iter().any(|a| !a.is_finite()) {
            return Err(SlamError::StartNotFinite);
        }
        if !rover_from_sensor.translation_m.is_finite() || !rover_from_sensor.rotation.is_finite() {
            return Err(SlamError::MountNotFinite);
        }
        if !(0.0..=MOST_SLIP).contains(&noise.slip) {
            return Err(SlamError::Slip { slip: noise.slip });
        }
        upright(start.pitch_rad)?;
        let filter = Filter::new(params, noise, attitude, Mounting::new(rover_from_sensor));
        Ok(Slam { filter, extractor, registers: params.registration, start_m: start.position_m })
    }

    /// The noise of one's own features: range (metres), bearing, elevation (radians), before the inflation. Sweeps' features keep their own
    /// unless this is called.
    pub fn with_feature_sigmas(mut self, sigmas: &[f64; 3]) -> Slam {
        self.filter.set_feature_sigmas(sigmas);
        self
    }

    /// One step of the drive: odometry over it, angles after it. Nothing is drawn.
    pub fn step(&mut self, reading: &Reading) -> Result<(), SlamError> {
        self.filter.step(reading);
        upright(self.filter.cloud().angle(motion::PITCH).0)
    }

    /// The sweep made where the rover stands now; streams at the step.
    pub fn observe(&mut self, returns: &Returns, streams: &Streams) -> Result<Estimate, SlamError> {
        if let Some(extractor) = &mut self.extractor {
            let mean = self.filter.believed().mean;
            let sight = extractor.extract(returns, mean[motion::ROLL], mean[motion::PITCH]);
            let surface = self.registers.then(|| sight.surface());
            self.filter.observe(sight.features, surface, &sight.visibility, streams);
        }
        upright(self.filter.cloud().angle(motion::PITCH).0)?;
        Ok(self.estimate())
    }

    /// Features from elsewhere than a sweep, for tests and for one's own front end.
    pub fn observe_features(
        &mut self,
        features: &[Feature],
        visibility: &Visibility,
        streams: &Streams,
    ) -> Result<Estimate, SlamError> {
        self.filter.observe(features, None, visibility, streams);
        upright(self.filter.cloud().angle(motion::PITCH).0)?;
        Ok(self.estimate())
    }

    /// Mean and standard deviation of the share of the counted way that is driven: 1 and 0 where the filter is told of no slip.
    pub fn odometry_scale(&self) -> (f64, f64) {
        let (mean, variance) = self.filter.cloud().scale();
        (mean, variance.sqrt())
    }

    /// What is believed now.
    pub fn estimate(&self) -> Estimate {
        let mixture = self.filter.believed();
        let (scan, counters) = (self.filter.scan(), self.filter.counters());
        Estimate {
            pose: self.pose(&mixture.mean),
            covariance: mixture.covariance,
            effective_samples: mixture.effective_samples,
            features: scan.features,
            matched: scan.matched,
            new_landmarks: scan.new_landmarks,
            landmarks: scan.landmarks,
            skipped: counters.not_finite + counters.gated + counters.ambiguous,
            sigma_optimistic: self.filter.optimistic(),
        }
    }

    fn pose(&self, mean: &[f64; 6]) -> Pose {
        let [x, y, z, roll_rad, pitch_rad, yaw_rad] = *mean;
        Pose { position_m: self.start_m + DVec3::new(x, y, z), roll_rad, pitch_rad, yaw_rad }
    }

    /// What was left out so far.
    pub fn counters(&self) -> Counters {
        self.filter.counters()
    }

    pub fn mode(&self) -> Mode {
        if self.filter.lost() { Mode::DeadReckoning } else { Mode::Slam }
    }

    /// Whether the last stop corrected the pose: a feature was matched, or a surface found again.
    pub fn found_again(&self) -> bool {
        self.filter.found_again()
    }

    /// Mean normalised innovation squared of the last sweep's matches (3 when all is as modelled).
    pub fn mean_innovation(&self) -> Option<f64> {
        self.filter.mean_innovation()
    }

    /// How many of the first particles today's descend from.
    pub fn ancestors(&self) -> usize {
        self.filter.cloud().ancestors()
    }

    /// The likeliest particle's pose and landmarks; their positions are relative to the start's.
    pub fn best(&self) -> (Pose, &[Landmark]) {
        let (mean, landmarks) = self.filter.best();
        (self.pose(mean), landmarks)
    }
}

fn upright(pitch_rad: f64) -> Result<(), SlamError> {
    if pitch_rad.abs() <= MOST_PITCH_RAD {
        Ok(())
    } else {
        Err(SlamError::Upended { pitch_deg: pitch_rad.to_degrees() })
    }
}

/// The truth plus Gaussian noise of stated size: for corpora that need no filter. The streams stand at the step.
pub fn surrogate(params: &SurrogateParams, truth: &Pose, streams: &Streams) -> Estimate {
    let tilt_rad = params.tilt_deg.to_radians();
    let sigmas = [params.xy_m, params.xy_m, params.z_m, tilt_rad, tilt_rad, params.yaw_deg.to_radians()];
    let mut error = [0.0; 6];
    streams.open(Purpose::SlamSurrogate).fill_normal(0, &mut error);
    for (error, sigma) in error.iter_mut().zip(sigmas) {
        *error *= sigma;
    }
    let [x, y, z, roll, pitch, yaw] = error;
    let pose = Pose {
        position_m: truth.position_m + DVec3::new(x, y, z),
        roll_rad: math::wrap_angle(truth.roll_rad + roll),
        pitch_rad: truth.pitch_rad + pitch,
        yaw_rad: math::wrap_angle(truth.yaw_rad + yaw),
    };
    Estimate { covariance: matrix::diagonal(&sigmas.map(|s| s * s)), ..self::truth(&pose) }
}

/// The truth itself, sigmas 0.
pub fn truth(truth: &Pose) -> Estimate {
    Estimate {
        pose: *truth,
        covariance: [[0.0; 6]; 6],
        effective_samples: 1.0,
        features: 0,
        matched: 0,
        new_landmarks: 0,
        landmarks: 0,
        skipped: 0,
        sigma_optimistic: false,
    }
}

#[cfg(test)]
mod tests;
