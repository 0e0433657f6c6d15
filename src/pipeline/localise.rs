//! The config's choice of pose estimate, behind one face.
//!
//! The slam stage gets readings and sweeps; `truth` and `surrogate` are made here, from the drive's true poses.

use crate::drive::{InstrumentNoise, Reading};
use crate::geometry::{Pose, Transform};
use crate::random::Streams;
use crate::slam::{self, Estimate, Slam, SlamError, SlamParams};
use crate::sweep::Sweep;

pub(super) enum Localiser<'p> {
    /// FastSLAM or dead reckoning.
    Slam(Box<Slam>),
    Surrogate(&'p slam::params::SurrogateParams),
    Truth,
}

impl<'p> Localiser<'p> {
    pub(super) fn new(
        params: &'p SlamParams,
        noise: &InstrumentNoise,
        start: &Pose,
        rover_from_sensor: &Transform,
    ) -> Self {
        match params {
            SlamParams::Truth => Localiser::Truth,
            SlamParams::Surrogate(surrogate) => Localiser::Surrogate(surrogate),
            SlamParams::Fastslam(_) | SlamParams::DeadReckoning => {
                Localiser::Slam(Box::new(Slam::new(params, noise, start, rover_from_sensor)))
            }
        }
    }

    /// The filter reads sweeps, so every stop must be swept.
    pub(super) fn needs_sweeps(&self) -> bool {
        matches!(self, Localiser::Slam(slam) if slam.uses_sweeps())
    }

    /// The estimate after one control step.
    pub(super) fn step(&mut self, reading: &Reading, truth: &Pose, streams: &Streams) -> Result<Estimate, SlamError> {
        Ok(match self {
            Localiser::Slam(slam) => {
                slam.step(reading, streams)?;
                slam.estimate()
            }
            Localiser::Surrogate(params) => slam::surrogate(params, truth, streams),
            Localiser::Truth => slam::truth(truth),
        })
    }

    /// The estimate after a sweep at the same place.
    pub(super) fn observe(&mut self, sweep: &Sweep, before: Estimate, streams: &Streams) -> Result<Estimate, SlamError> {
        match self {
            Localiser::Slam(slam) => slam.observe(sweep, streams),
            Localiser::Surrogate(_) | Localiser::Truth => Ok(before),
        }
    }
}
