//! The `cells` section of a config, as written and as checked.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::within;

/// The grid, its features and its labels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct CellParams {
    /// Side of a cell, metres; about one wheel diameter.
    #[garde(custom(within(0.005, 100.0)))]
    pub size_m: f64,
    /// Points farther than this from the sensor (horizontally) are left out, metres; default: the sensor's own reach.
    #[garde(custom(within(0.1, 10_000.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_range_m: Option<f64>,
    /// Neighbours whose mean heights are features: 4, 8 or 24.
    #[garde(custom(four_eight_or_twenty_four))]
    pub neighbours: u32,
    /// Sweeps (up to this many, the kept one the last) whose points are put together.
    #[garde(range(min = 1, max = 1000))]
    pub window_scans: u32,
    #[garde(dive)]
    pub labels: LabelParams,
}

impl Default for CellParams {
    fn default() -> Self {
        CellParams { size_m: 0.1, max_range_m: None, neighbours: 8, window_scans: 1, labels: LabelParams::default() }
    }
}

fn four_eight_or_twenty_four(value: &u32, _: &()) -> garde::Result {
    if [4, 8, 24].contains(value) { Ok(()) } else { Err(garde::Error::new(format!("must be 4, 8 or 24, got {value}"))) }
}

/// When a cell is untraversable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct LabelParams {
    /// Which objects are obstacles.
    #[garde(dive)]
    pub obstacle: ObstacleRule,
    /// Points of an obstacle that a cell must hold.
    #[garde(range(min = 1, max = 1_000_000))]
    pub min_obstacle_points: u32,
    /// Ground steeper than this is untraversable too, degrees; absent = ground never is.
    #[garde(custom(within(0.1, 90.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_ground_slope_deg: Option<f64>,
}

impl Default for LabelParams {
    fn default() -> Self {
        LabelParams { obstacle: ObstacleRule::TallerThanWheel, min_obstacle_points: 1, max_ground_slope_deg: None }
    }
}

/// Which solid objects (and porous ones that are marked untraversable) count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ObstacleRule {
    /// Objects that stand taller than the rover's wheel diameter.
    TallerThanWheel,
    /// All (the paper's).
    All,
    /// Objects that stand taller than this, metres.
    TallerThanM(#[garde(custom(within(0.0, 100.0)))] f64),
}
