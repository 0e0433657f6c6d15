//! Rovers as data: chassis, wheels, mast. One YAML file a rover (`configs/rovers/`).

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::limits::RoverLimits;
use crate::geometry::{DVec3, Pose, Transform};
use crate::random::within;

/// A rover: where its wheels are, and where it carries the sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct Rover {
    #[garde(length(min = 1))]
    pub name: String,
    /// Where the figures come from.
    #[garde(skip)]
    #[serde(default)]
    pub source: String,
    #[garde(dive)]
    pub chassis: Chassis,
    /// What an obstacle must be taller than to be untraversable, metres.
    #[garde(custom(within(0.01, 10.0)))]
    pub wheel_diameter_m: f64,
    /// Outline, for collision: length along x, width along y.
    #[garde(custom(within(0.05, 20.0)))]
    pub length_m: f64,
    #[garde(custom(within(0.05, 20.0)))]
    pub width_m: f64,
    /// Height of its body above the plane that the wheels stand on, metres, mast and sensor apart; read by `cells.overhang`, whose height
    /// the resolved plan has there. Absent: nothing is higher than the sensor.
    #[garde(custom(within(0.02, 20.0)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// Greatest speed, metres per second, and yaw rate, degrees per second.
    #[garde(custom(within(1e-3, 50.0)))]
    pub max_speed_mps: f64,
    #[garde(custom(within(0.1, 720.0)))]
    pub max_yaw_rate_degps: f64,
    /// Where the sensor's head sits, rover frame.
    #[garde(dive)]
    pub mount: Mount,
    /// What it can cross, for `cells.labels.rover`; the resolved plan has it there.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<RoverLimits>,
}

impl Rover {
    pub fn wheel_radius_m(&self) -> f64 {
        0.5 * self.wheel_diameter_m
    }

    /// Radius of the circle that the outline sweeps when the rover turns in place.
    pub fn turning_radius_m(&self) -> f64 {
        0.5 * (self.length_m * self.length_m + self.width_m * self.width_m).sqrt()
    }

    /// Distance between left and right wheels.
    pub fn track_m(&self) -> f64 {
        match &self.chassis {
            Chassis::Rigid(chassis) => chassis.track_m,
            Chassis::RockerBogie(chassis) => chassis.track_m,
        }
    }
}

/// Where a sensor sits on its rover: position in the rover frame, then yaw, pitch (nose-down positive) and roll.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct Mount {
    #[garde(custom(within(-10.0, 10.0)))]
    pub x_m: f64,
    #[garde(custom(within(-10.0, 10.0)))]
    #[serde(default)]
    pub y_m: f64,
    #[garde(custom(within(0.02, 20.0)))]
    pub z_m: f64,
    #[garde(custom(within(-180.0, 180.0)))]
    #[serde(default)]
    pub yaw_deg: f64,
    #[garde(custom(within(-90.0, 90.0)))]
    #[serde(default)]
    pub pitch_deg: f64,
    #[garde(custom(within(-180.0, 180.0)))]
    #[serde(default)]
    pub roll_deg: f64,
}

impl Mount {
    /// The sensor's frame in the rover's.
    pub fn rover_from_sensor(&self) -> Transform {
        let pose = Pose {
            position_m: DVec3::new(self.x_m, self.y_m, self.z_m),
            roll_rad: self.roll_deg.to_radians(),
            pitch_rad: self.pitch_deg.to_radians(),
            yaw_rad: self.yaw_deg.to_radians(),
        };
        pose.transform()
    }
}

/// How the wheels hang together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Chassis {
    /// Four wheels on a rigid frame: a least-squares stand.
    Rigid(#[garde(dive)] RigidChassis),
    /// Six wheels, two rockers joined by a differential, two bogies: every wheel touches.
    RockerBogie(#[garde(dive)] RockerBogieChassis),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RigidChassis {
    /// Distance between front and rear axles, and between left and right wheels, metres.
    #[garde(custom(within(0.05, 20.0)))]
    pub wheelbase_m: f64,
    #[garde(custom(within(0.05, 20.0)))]
    pub track_m: f64,
}

/// All x forward of the chassis centre, all z above the wheel-contact plane on flat ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RockerBogieChassis {
    #[garde(custom(within(0.05, 20.0)))]
    pub track_m: f64,
    /// Wheel axles along x: the rocker's own wheel, and the bogie's two.
    #[garde(custom(within(-10.0, 10.0)))]
    pub rocker_wheel_x_m: f64,
    #[garde(custom(within(-10.0, 10.0)))]
    pub bogie_front_x_m: f64,
    #[garde(custom(within(-10.0, 10.0)))]
    pub bogie_rear_x_m: f64,
    /// Pivots: rocker to chassis, and bogie to rocker.
    #[garde(custom(within(-10.0, 10.0)))]
    pub rocker_pivot_x_m: f64,
    #[garde(custom(within(0.0, 10.0)))]
    pub rocker_pivot_z_m: f64,
    #[garde(custom(within(-10.0, 10.0)))]
    pub bogie_pivot_x_m: f64,
    #[garde(custom(within(0.0, 10.0)))]
    pub bogie_pivot_z_m: f64,
}
