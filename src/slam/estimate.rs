//! This module holds the [`Estimate`] of a pose, and the two ways of making one that need no filter.
//!
//! The true pose goes in (metres, radians), and for the surrogate its sigmas and the streams of the step. An [`Estimate`] comes out; that of a
//! running filter is made in `localiser`.

use super::{SurrogateParams, matrix};
use crate::geometry::{DVec3, Pose};
use crate::math;
use crate::random::{Purpose, Streams};

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
