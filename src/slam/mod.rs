//! Readings and sweeps -> estimated poses with covariance. Never the truth.
//!
//! In: [`SlamParams`], the start pose (known), [`Reading`](crate::drive::Reading)s, [`Sweep`](crate::sweep::Sweep)s.
//! Out: an [`Estimate`] per step, frame `map`. Source: Montemerlo et al. 2003 (FastSLAM 2.0), in six degrees of freedom.

pub mod params;

pub use params::SlamParams;

use crate::geometry::Pose;

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
    /// Distinct ancestors at a lag of 20 stops fell below 3: the position sigmas are too small.
    pub sigma_optimistic: bool,
}

impl Estimate {
    /// Standard deviations of x, y, z, roll, pitch, yaw.
    pub fn sigmas(&self) -> [f64; 6] {
        std::array::from_fn(|i| self.covariance[i][i].max(0.0).sqrt())
    }
}

/// Why slam gave up.
#[derive(Debug, thiserror::Error)]
pub enum SlamError {
    #[error("the estimated pitch is {pitch_deg:.1} degrees: beyond 80 the angles have no meaning")]
    Upended { pitch_deg: f64 },
}
