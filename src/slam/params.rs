//! The `slam` section of a config, as written and as checked.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::within;

/// How the pose is estimated, from the paper's filter to the truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SlamParams {
    /// FastSLAM 2.0 on features and surfaces of the sweeps, IMU, sun sensor and odometry.
    Fastslam(#[garde(dive)] FastslamParams),
    /// A Kalman filter of IMU, sun sensor and odometry that lays each sweep on the one before, by what stands up and by the ground. No landmarks and
    /// no particles: on the shipped configs as near to the truth as FastSLAM, for as much CPU, and over tens of metres nearer and honest about its errors.
    Registration(#[garde(dive)] RegistrationParams),
    /// IMU, sun sensor and odometry alone.
    DeadReckoning,
    /// The true pose plus Gaussian noise of stated size.
    Surrogate(#[garde(dive)] SurrogateParams),
    /// The true pose, sigmas 0.
    Truth,
}

impl SlamParams {
    /// Whether the estimate is made of sweeps, so that every stop must be swept.
    pub fn reads_sweeps(&self) -> bool {
        matches!(self, SlamParams::Fastslam(_) | SlamParams::Registration(_))
    }
}

impl Default for SlamParams {
    fn default() -> Self {
        SlamParams::Fastslam(FastslamParams::default())
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct FastslamParams {
    #[garde(range(min = 1, max = 100_000))]
    pub particles: u32,
    /// Resample when the effective sample size falls below this share of the particles.
    #[garde(custom(within(0.0, 1.0)))]
    pub resample_below: f64,
    /// Features a sweep, at most (the ones with most points).
    #[garde(range(min = 1, max = 1000))]
    pub max_features: u32,
    /// Features, and what sweeps are laid on one another by, are taken up to this distance from the sensor, metres.
    #[garde(custom(within(0.5, 20.0)))]
    pub feature_range_m: f64,
    /// Lay each sweep on that of the stop before, by what stands up and by the ground: tells the way between the two to a centimetre where
    /// rocks are seen twice. Without it the features alone correct the odometry, as in the paper.
    #[garde(skip)]
    pub registration: bool,
    /// Factor on the features' measurement covariance; guards against optimism.
    #[garde(custom(within(0.01, 1000.0)))]
    pub measurement_inflation: f64,
    /// Factor on the variances of what wheels tell (way, sideways slip, heading), not of slope and climb. A slip that is
    /// the same all the way (`drive.instruments.slip`) needs none: the filter learns it.
    #[garde(custom(within(0.01, 1000.0)))]
    pub motion_inflation: f64,
}

impl Default for FastslamParams {
    fn default() -> Self {
        FastslamParams {
            particles: 100,
            resample_below: 0.5,
            max_features: 12,
            // 95 % of what the URG-04LX reports: four to five features a sweep where 3.75 m brings two.
            feature_range_m: 5.3,
            registration: true,
            measurement_inflation: 4.0,
            motion_inflation: 1.0,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct RegistrationParams {
    /// Sweeps are laid on one another by what lies up to this distance from the sensor, metres.
    #[garde(custom(within(0.5, 20.0)))]
    pub range_m: f64,
    /// Of sweeps on the way, whose points no cell reads, every so-manieth line and beam is cast, as long as 32 of either are left: 2 takes about half of
    /// what the estimate costs beside dead reckoning, and leaves a tenth more of its error.
    #[garde(range(min = 1, max = 8))]
    pub every: u32,
}

impl Default for RegistrationParams {
    fn default() -> Self {
        RegistrationParams { range_m: FastslamParams::default().feature_range_m, every: 1 }
    }
}

/// Standard deviations of the surrogate's errors. `marsyard tradeoff` tells those of a config's own estimates (the setting `surrogate`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct SurrogateParams {
    #[garde(custom(within(0.0, 10.0)))]
    pub xy_m: f64,
    #[garde(custom(within(0.0, 10.0)))]
    pub z_m: f64,
    /// Of roll and pitch, degrees.
    #[garde(custom(within(0.0, 45.0)))]
    pub tilt_deg: f64,
    #[garde(custom(within(0.0, 180.0)))]
    pub yaw_deg: f64,
}

impl Default for SurrogateParams {
    fn default() -> Self {
        SurrogateParams { xy_m: 0.03, z_m: 0.02, tilt_deg: 0.3, yaw_deg: 0.7 }
    }
}
