//! What a rover can cross: the limits of its file, by which labels judge ground and bodies.
//!
//! In: the `limits` of a rover's YAML file. Out: plain figures, metres and degrees; what a file leaves out follows from the rover's
//! geometry where it can. Not modelled: speed, load, wear, and soils other than a firm and a loose one.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rover::{Chassis, Rover};
use crate::random::within;

/// What the rover can cross.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RoverLimits {
    /// Greatest slope under the rover's length and width together, degrees.
    #[garde(custom(within(0.1, 60.0)))]
    pub max_tilt_deg: f64,
    /// Height of the belly above the plane that the wheels stand on, metres; default: the rocker's pivot, or the axles of a rigid
    /// chassis.
    #[garde(custom(within(0.001, 10.0)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub belly_clearance_m: Option<f64>,
    /// Highest step that a wheel climbs or drops, metres.
    #[garde(custom(within(0.001, 10.0)))]
    pub max_step_m: f64,
    /// Widest gap that a wheel bridges, metres.
    #[garde(custom(within(0.001, 10.0)))]
    pub max_gap_m: f64,
    /// Greatest slope across the heading on which the rover does not slide sideways, by soil.
    #[garde(dive)]
    pub max_side_slip_deg: SideSlip,
}

/// A slope for each soil, degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct SideSlip {
    #[garde(custom(within(0.1, 60.0)))]
    pub firm: f64,
    #[garde(custom(within(0.1, 60.0)))]
    pub loose: f64,
}

/// What the wheels stand on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Soil {
    /// Rock, packed earth, turf.
    #[default]
    Firm,
    /// Dry sand, gravel.
    Loose,
}

impl Soil {
    pub fn name(self) -> &'static str {
        match self {
            Soil::Firm => "firm",
            Soil::Loose => "loose",
        }
    }
}

impl SideSlip {
    pub fn on(&self, soil: Soil) -> f64 {
        match soil {
            Soil::Firm => self.firm,
            Soil::Loose => self.loose,
        }
    }
}

impl Rover {
    /// Height of the belly above the plane that the wheels stand on: as the limits say, else by the chassis.
    pub fn belly_clearance_m(&self) -> f64 {
        let by_chassis = || match &self.chassis {
            Chassis::Rigid(_) => self.wheel_radius_m(),
            Chassis::RockerBogie(chassis) => chassis.rocker_pivot_z_m,
        };
        self.limits.as_ref().and_then(|limits| limits.belly_clearance_m).unwrap_or_else(by_chassis)
    }

    /// Distance between the foremost and the hindmost axle.
    pub fn wheelbase_m(&self) -> f64 {
        match &self.chassis {
            Chassis::Rigid(chassis) => chassis.wheelbase_m,
            Chassis::RockerBogie(chassis) => {
                let axles_m = [chassis.rocker_wheel_x_m, chassis.bogie_front_x_m, chassis.bogie_rear_x_m];
                let end = |by: fn(f64, f64) -> f64| axles_m.into_iter().fold(axles_m[0], by);
                end(f64::max) - end(f64::min)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{ROVERS, kapvik, rover};
    use super::*;

    #[test]
    fn exact_what_a_file_leaves_out_follows_from_the_chassis() {
        let mut kapvik = kapvik();
        assert!((kapvik.wheelbase_m() - 0.6).abs() < 1e-12);
        kapvik.limits = None;
        assert_eq!(kapvik.belly_clearance_m(), 0.2);
        let mut husky = rover(ROVERS[2]);
        assert_eq!((husky.wheelbase_m(), husky.belly_clearance_m()), (0.512, 0.13));
        husky.limits = None;
        assert_eq!(husky.belly_clearance_m(), 0.1651);
    }

    #[test]
    fn law_shipped_rovers_slide_no_later_on_loose_soil_than_on_firm() {
        for yaml in ROVERS {
            let limits = rover(yaml).limits.expect("a shipped rover has limits");
            let slip = limits.max_side_slip_deg;
            assert!(slip.on(Soil::Loose) < slip.on(Soil::Firm) && slip.on(Soil::Firm) <= limits.max_tilt_deg);
        }
    }
}
