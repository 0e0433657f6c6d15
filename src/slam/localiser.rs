//! This module holds the running estimate of one drive: it leads the filter and the extractor, and refuses what neither can work with.
//!
//! The start pose and the sensor's place on the rover go in first, then one [`Reading`] a step and the [`Returns`] of each sweep, or features of
//! one's own front end. An [`Estimate`] comes out, and beside it what was left out ([`Counters`]) and what carries the estimate ([`Mode`]), or
//! why there is none ([`SlamError`]).

use super::features::Extractor;
use super::filter::Filter;
use super::measurement::Mounting;
use super::{Estimate, FastslamParams, Feature, Landmark, SlamParams, Visibility, motion};
use crate::drive::{InstrumentNoise, Reading};
use crate::geometry::{DVec3, Pose, Transform};
use crate::random::Streams;
use crate::sweep::Returns;

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
    pub(super) filter: Filter,
    /// `None` for dead reckoning.
    extractor: Option<Extractor>,
    /// Whether features of sweeps are landmarks.
    maps: bool,
    start_m: DVec3,
}

/// Largest slip that is taken for one, as a share of the way that the wheels counted.
pub(crate) const MOST_SLIP: f64 = 0.9;
/// Largest pitch of an estimate, 80 degrees: roll and heading are one turn at 90.
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
        let sees = |range_m| Extractor::new(range_m, rover_from_sensor);
        let (params, extractor, maps) = match params {
            SlamParams::Fastslam(params) => {
                let sees = sees(params.feature_range_m);
                (params, Some(if params.registration { sees.with_ground() } else { sees }), true)
            }
            SlamParams::Registration(params) => (&alone, Some(sees(params.range_m).with_ground()), false),
            SlamParams::DeadReckoning => (&alone, None, false),
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
        Ok(Slam { filter, extractor, maps, start_m: start.position_m })
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
            let features = if self.maps { sight.features } else { &[] };
            self.filter.observe(features, sight.surface(), &sight.visibility, streams);
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
