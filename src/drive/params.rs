//! The `drive` section of a config, as written and as checked.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::limits::RoverLimits;
use super::{DriveError, Rover};
use crate::preset::Preset;
use crate::random::{Dist, Law, Purpose, within};

/// The rover and its way through the yard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct DriveParams {
    /// A shipped rover (kapvik, pioneer-3at, husky-a200), a path to one's own, or one written out.
    #[garde(dive)]
    pub rover: Preset<Rover>,
    #[garde(dive)]
    pub start: StartParams,
    #[garde(dive)]
    pub path: PathParams,
    /// Places at which the rover stands and sweeps, evenly spread from the start to the path's end; 1 = the end alone.
    #[garde(range(min = 1, max = 10_000))]
    pub stops: u32,
    /// Where stops are spread, a radian of a turn counts as so many metres of way: a rover that turns in place then sweeps on the way round,
    /// and what it sees can be laid on the sweep before. 0.5 to 1.5 do well; 0, the default = the way alone.
    #[garde(custom(within(0.0, 10.0)))]
    #[serde(skip_serializing_if = "is_zero")]
    pub turn_as_way_m_per_rad: f64,
    /// Which sweeps are written; all of them feed slam.
    #[garde(skip)]
    pub keep: Keep,
    /// Try the drive and its sweeps again, in the same scene, until a kept sweep holds both classes; 1 = take the first.
    #[garde(range(min = 1, max = 100))]
    pub attempts: u32,
    /// Speed while driving, metres per second, up to the rover's greatest (the default).
    #[garde(custom(within(1e-3, 50.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_mps: Option<Dist>,
    /// Length of a control step along the path, metres.
    #[garde(custom(within(1e-3, 1.0)))]
    pub step_m: f64,
    /// How the chassis is set on the ground.
    #[garde(skip)]
    pub contact: ContactSolver,
    /// How near the contact's solution must be, metres and radians; default: gauss_newton 1e-11, nelder_mead 1e-8. It does
    /// not concern plane_fit.
    #[garde(custom(within(1e-12, 1e-2)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact_tolerance_m: Option<f64>,
    /// The wheels roll over solid bodies as over the ground, so that the pose feels the stones it drives over, and the limits of the rover's
    /// file say what bars the way: bodies taller than its wheels climb or its belly clears, steps, gaps and slopes of the ground. Absent =
    /// bodies taller than a wheel bar it, and lower ones are as if they were not there.
    #[garde(skip)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub over_bodies: bool,
    /// Noise of the true motion (the paper's bumpy ground); absent = the rover does as it is told.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control_noise: Option<ControlNoise>,
    #[garde(dive)]
    pub instruments: InstrumentsParams,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Default for DriveParams {
    fn default() -> Self {
        DriveParams {
            rover: Preset::Name("kapvik".into()),
            start: StartParams::default(),
            path: PathParams::TowardObstacle(LengthParams { length_m: Dist::Constant(2.0) }),
            stops: 4,
            turn_as_way_m_per_rad: 0.0,
            keep: Keep::Last,
            attempts: 1,
            speed_mps: None,
            step_m: 0.05,
            contact: ContactSolver::GaussNewton,
            contact_tolerance_m: None,
            over_bodies: false,
            control_noise: None,
            instruments: InstrumentsParams::default(),
        }
    }
}

impl DriveParams {
    /// What bars the way of a rover that drives over bodies; `None` of one that does not.
    ///
    /// Fails where the rover's file has no limits: `config` refuses that earlier.
    pub(super) fn limits(&self) -> Result<Option<&RoverLimits>, DriveError> {
        if !self.over_bodies {
            return Ok(None);
        }
        let reason =
            || format!("drive.over_bodies asks for the limits of the rover '{}', which has none", self.rover.name);
        self.rover.limits.as_ref().map(Some).ok_or_else(|| DriveError::NoWay { reason: reason() })
    }

    /// The values drawn once per scene, of those that the config names.
    pub fn dists(&self) -> Vec<(Purpose, &Dist)> {
        let instruments = &self.instruments;
        let mut dists = vec![
            (Purpose::ImuSd, &instruments.imu_deg),
            (Purpose::OdometryDistanceSd, &instruments.odometry_m_per_sqrt_m),
            (Purpose::OdometryHeadingSd, &instruments.odometry_deg_per_sqrt_m),
        ];
        match &self.path {
            PathParams::Straight(p) => dists.push((Purpose::StraightLength, &p.length_m)),
            PathParams::Arc(p) => dists.extend([(Purpose::ArcLength, &p.length_m), (Purpose::ArcRadius, &p.radius_m)]),
            PathParams::Waypoints(_) => {}
            PathParams::RandomWalk(p) => dists.push((Purpose::WalkLength, &p.length_m)),
            PathParams::TowardObstacle(p) => dists.push((Purpose::TowardLength, &p.length_m)),
            PathParams::Planned(p) => dists.push((Purpose::PlannedGoal, &p.goal_m)),
        }
        if let Some(noise) = &self.control_noise {
            dists.extend([
                (Purpose::ControlSpeedSd, &noise.speed),
                (Purpose::ControlYawRateSd, &noise.yaw_rate),
                (Purpose::ControlHeadingSd, &noise.heading_deg_per_sqrt_m),
            ]);
        }
        let optional = [
            (Purpose::DriveSpeed, &self.speed_mps),
            (Purpose::StartNearObstacle, &self.start.near_obstacle_m),
            (Purpose::ImuBias, &instruments.imu_bias_deg),
            (Purpose::SunSd, &instruments.sun_deg),
            (Purpose::Slip, &instruments.slip),
        ];
        dists.extend(optional.into_iter().filter_map(|(purpose, dist)| Some((purpose, dist.as_ref()?))));
        dists
    }
}

/// Where the drive begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct StartParams {
    /// Distance from the start to the nearest untraversable obstacle's surface, seen from above, metres; absent = anywhere
    /// clear. Where the yard has no such place, the one found that comes nearest to it is taken.
    #[garde(custom(within(0.0, 1000.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_obstacle_m: Option<Dist>,
    /// Distance kept from the yard's edge, metres.
    #[garde(custom(within(0.0, 1000.0)))]
    pub margin_m: f64,
}

impl Default for StartParams {
    fn default() -> Self {
        StartParams { near_obstacle_m: None, margin_m: 1.0 }
    }
}

/// The way through the yard. Every path stops short of obstacles and of the yard's edge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum PathParams {
    /// Straight ahead, in a random direction.
    Straight(#[garde(dive)] LengthParams),
    /// A circular arc.
    Arc(#[garde(dive)] ArcParams),
    /// Through points given in the yard, turning in place between them.
    Waypoints(#[garde(dive)] WaypointsParams),
    /// Straight pieces with random turns in place.
    RandomWalk(#[garde(dive)] RandomWalkParams),
    /// Toward the nearest obstacle.
    TowardObstacle(#[garde(dive)] LengthParams),
    /// To a random goal, planned around obstacles (A*).
    Planned(#[garde(dive)] PlannedParams),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct LengthParams {
    /// Length of the way, metres; drawn per scene.
    #[garde(custom(within(0.0, 1e5)))]
    pub length_m: Dist,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct ArcParams {
    #[garde(custom(within(0.0, 1e5)))]
    pub length_m: Dist,
    /// Radius, metres; positive turns left, negative right. Less than 0.1 m counts as 0.1 m.
    #[garde(custom(within(-1e5, 1e5)))]
    pub radius_m: Dist,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct WaypointsParams {
    /// Points [x, y] in the yard, metres; the first is the start.
    #[garde(length(min = 2))]
    pub points_m: Vec<[f64; 2]>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RandomWalkParams {
    #[garde(custom(within(0.0, 1e5)))]
    pub length_m: Dist,
    /// Length of a straight piece, metres; drawn per piece.
    #[garde(custom(within(0.05, 1e4)))]
    pub leg_m: Dist,
    /// Turn between pieces, degrees; drawn per turn.
    #[garde(custom(within(-180.0, 180.0)))]
    pub turn_deg: Dist,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct PlannedParams {
    /// Distance of the goal from the start, metres; drawn per scene.
    #[garde(custom(within(0.1, 1e5)))]
    pub goal_m: Dist,
    /// Distance kept from obstacles beside the circle that the rover turns in, metres.
    #[garde(custom(within(0.0, 10.0)))]
    #[serde(default)]
    pub clearance_m: f64,
}

/// Which sweeps are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Keep {
    Last,
    All,
    /// Every n-th, counted so that the last is kept.
    Every(u32),
}

/// How the pose on the ground is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ContactSolver {
    /// Damped Gauss-Newton on the wheels' residuals.
    GaussNewton,
    /// The simplex search of MATLAB's fminsearch (the paper's).
    NelderMead,
    /// The plane through the ground under the wheels: fast and approximate.
    PlaneFit,
}

/// Thrun's velocity model: variances grow with the squares of speed and yaw rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct ControlNoise {
    /// Standard deviation of the speed as a share of it, and of the yaw rate as a share of it, per step.
    #[garde(custom(within(0.0, 1.0)))]
    pub speed: Dist,
    #[garde(custom(within(0.0, 1.0)))]
    pub yaw_rate: Dist,
    /// Random yaw, degrees per square root of a metre driven.
    #[garde(custom(within(0.0, 45.0)))]
    pub heading_deg_per_sqrt_m: Dist,
}

/// What the rover measures of itself, and how well; each drawn per scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct InstrumentsParams {
    /// IMU roll and pitch: standard deviation, degrees.
    #[garde(custom(within(0.0, 45.0)))]
    pub imu_deg: Dist,
    /// IMU roll and pitch: constant bias of the scene, degrees (its sign and axis are part of the draw).
    #[garde(custom(within(-45.0, 45.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub imu_bias_deg: Option<Dist>,
    /// Sun-sensor heading at stops: standard deviation, degrees; null = no sun sensor.
    #[garde(custom(within(0.0, 180.0)))]
    pub sun_deg: Option<Dist>,
    /// Odometry: noise of the distance, metres per square root of a metre.
    #[garde(custom(within(0.0, 1.0)))]
    pub odometry_m_per_sqrt_m: Dist,
    /// Odometry: noise of the heading, degrees per square root of a metre.
    #[garde(custom(within(0.0, 45.0)))]
    pub odometry_deg_per_sqrt_m: Dist,
    /// Slip: share of the odometry's distance that was not driven; absent = none.
    #[garde(custom(within(-0.9, 0.9)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slip: Option<Dist>,
}

impl Default for InstrumentsParams {
    fn default() -> Self {
        InstrumentsParams {
            imu_deg: Dist::Law(Law::Uniform([0.2, 1.0])),
            imu_bias_deg: None,
            sun_deg: Some(Dist::Law(Law::Uniform([0.5, 3.0]))),
            odometry_m_per_sqrt_m: Dist::Constant(0.05),
            odometry_deg_per_sqrt_m: Dist::Constant(2.0),
            slip: None,
        }
    }
}
