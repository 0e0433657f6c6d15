//! `cells.labels.rover`: the limits by which a rover judges cells, as written and as checked.
//!
//! In: what a config overrides, and the rover with the limits of its file. Out: the rule with every limit written out, and [`Limits`] as
//! the kernels read them. Metres and degrees.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::drive::Rover;
use crate::drive::limits::Soil;
use crate::math;
use crate::random::within;

/// The rover says which cells it can cross, by the ground and the solid bodies as they are; `rover: {}` takes all limits from its file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct RoverRule {
    /// What the wheels stand on: says which side slip of the rover's file holds.
    #[garde(skip)]
    pub soil: Soil,
    /// Greatest slope under the rover's length and width together, degrees; default: the rover's.
    #[garde(custom(within(0.1, 60.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_tilt_deg: Option<f64>,
    /// Height of the belly above the plane that the wheels stand on, metres; default: the rover's.
    #[garde(custom(within(0.001, 10.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub belly_clearance_m: Option<f64>,
    /// Highest step that a wheel climbs or drops, metres; default: the rover's.
    #[garde(custom(within(0.001, 10.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_step_m: Option<f64>,
    /// Widest gap that a wheel bridges, metres; default: the rover's.
    #[garde(custom(within(0.001, 10.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_gap_m: Option<f64>,
    /// Greatest slope across the heading, degrees; default: the rover's, on the soil.
    #[garde(custom(within(0.1, 60.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_side_slip_deg: Option<f64>,
    /// The truth of the pose too: the rover driven through each cell's middle along eight headings; adds the columns `truth_headings`,
    /// `truth_cost`, `truth_tilt_rad` and `truth_clearance_m`.
    #[garde(skip)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub pose: bool,
}

/// The rule and the rover's geometry as numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    /// Rise over run.
    pub tilt: f64,
    pub side_slip: f64,
    pub belly_m: f64,
    pub step_m: f64,
    pub gap_m: f64,
    pub wheel_radius_m: f64,
    pub wheelbase_m: f64,
    pub track_m: f64,
    /// Lips farther apart than this make no gap.
    pub length_m: f64,
}

impl RoverRule {
    /// The same, with what it leaves open taken from the rover's file.
    pub fn resolved(&self, rover: &Rover) -> RoverRule {
        let limits = rover.limits.as_ref();
        RoverRule {
            soil: self.soil,
            max_tilt_deg: self.max_tilt_deg.or(limits.map(|limits| limits.max_tilt_deg)),
            belly_clearance_m: self.belly_clearance_m.or_else(|| Some(rover.belly_clearance_m())),
            max_step_m: self.max_step_m.or(limits.map(|limits| limits.max_step_m)),
            max_gap_m: self.max_gap_m.or(limits.map(|limits| limits.max_gap_m)),
            max_side_slip_deg: self.max_side_slip_deg.or(limits.map(|limits| limits.max_side_slip_deg.on(self.soil))),
            pose: self.pose,
        }
    }

    /// The limits that neither the rule nor the rover's file gives.
    pub fn missing(&self) -> Vec<&'static str> {
        let RoverRule { max_tilt_deg, belly_clearance_m, max_step_m, max_gap_m, max_side_slip_deg, .. } = self;
        let named = [
            ("max_tilt_deg", max_tilt_deg),
            ("belly_clearance_m", belly_clearance_m),
            ("max_step_m", max_step_m),
            ("max_gap_m", max_gap_m),
            ("max_side_slip_deg", max_side_slip_deg),
        ];
        named.into_iter().filter(|(_, value)| value.is_none()).map(|(name, _)| name).collect()
    }

    /// For a rover; `None` where a limit is missing.
    pub(super) fn limits(&self, rover: &Rover) -> Option<Limits> {
        let whole = self.resolved(rover);
        let rise = |slope_deg: f64| math::tan(slope_deg.to_radians());
        Some(Limits {
            tilt: rise(whole.max_tilt_deg?),
            side_slip: rise(whole.max_side_slip_deg?),
            belly_m: whole.belly_clearance_m?,
            step_m: whole.max_step_m?,
            gap_m: whole.max_gap_m?,
            wheel_radius_m: rover.wheel_radius_m(),
            wheelbase_m: rover.wheelbase_m(),
            track_m: rover.track_m(),
            length_m: rover.length_m,
        })
    }

    /// For people: `max_step_m 0.1, ..., on firm soil`.
    pub fn words(&self) -> String {
        let number = |value: Option<f64>| value.map_or("absent".into(), |value| value.to_string());
        format!(
            "a step of {} m, a gap of {} m, {} m under its belly, {} degrees of tilt, {} degrees of side slope on {} soil",
            number(self.max_step_m),
            number(self.max_gap_m),
            number(self.belly_clearance_m),
            number(self.max_tilt_deg),
            number(self.max_side_slip_deg),
            self.soil.name()
        )
    }
}
