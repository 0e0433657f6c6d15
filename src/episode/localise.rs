//! The config's choice of pose estimate, behind one face.
//!
//! The slam stage gets readings and sweeps; `truth` and `surrogate` are made here, from the drive's true poses.

use crate::drive::{InstrumentNoise, Reading};
use crate::geometry::{Pose, Transform};
use crate::random::Streams;
use crate::slam::{self, Estimate, Slam, SlamError, SlamParams};
use crate::sweep::Returns;

pub(super) enum Localiser<'p> {
    /// FastSLAM, registration or dead reckoning.
    Slam {
        filter: Box<Slam>,
        /// Dead reckoning reads none.
        reads_sweeps: bool,
    },
    Surrogate(&'p slam::params::SurrogateParams),
    Truth,
}

impl<'p> Localiser<'p> {
    pub(super) fn new(
        params: &'p SlamParams,
        noise: &InstrumentNoise,
        start: &Pose,
        rover_from_sensor: &Transform,
    ) -> Result<Self, SlamError> {
        Ok(match params {
            SlamParams::Truth => Localiser::Truth,
            SlamParams::Surrogate(surrogate) => Localiser::Surrogate(surrogate),
            SlamParams::Fastslam(_) | SlamParams::Registration(_) | SlamParams::DeadReckoning => {
                let filter = Box::new(Slam::new(params, noise, start, rover_from_sensor)?);
                Localiser::Slam { filter, reads_sweeps: params.reads_sweeps() }
            }
        })
    }

    /// The filter reads sweeps, so every stop must be swept.
    pub(super) fn needs_sweeps(&self) -> bool {
        matches!(self, Localiser::Slam { reads_sweeps: true, .. })
    }

    /// The estimate after one control step.
    pub(super) fn step(&mut self, reading: &Reading, truth: &Pose, streams: &Streams) -> Result<Estimate, SlamError> {
        Ok(match self {
            Localiser::Slam { filter, .. } => {
                filter.step(reading)?;
                filter.estimate()
            }
            Localiser::Surrogate(params) => slam::surrogate(params, truth, streams),
            Localiser::Truth => slam::truth(truth),
        })
    }

    /// The estimate after a sweep at the same place.
    pub(super) fn observe(
        &mut self,
        returns: &Returns,
        before: Estimate,
        streams: &Streams,
    ) -> Result<Estimate, SlamError> {
        match self {
            Localiser::Slam { filter, reads_sweeps: true } => filter.observe(returns, streams),
            Localiser::Slam { .. } | Localiser::Surrogate(_) | Localiser::Truth => Ok(before),
        }
    }
}
