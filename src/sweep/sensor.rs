//! Sensors as data: pattern, gates, noise, beam. One YAML file a sensor (`configs/sensors/`).

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::within;

/// A LiDAR: how its beams point and how well it measures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    #[garde(length(min = 1))]
    pub name: String,
    /// Where the figures come from.
    #[garde(skip)]
    #[serde(default)]
    pub source: String,
    #[garde(dive)]
    pub pattern: PatternParams,
    /// Gates, metres.
    #[garde(custom(within(0.0, 1000.0)))]
    pub min_range_m: f64,
    #[garde(custom(within(0.05, 10_000.0)))]
    pub max_range_m: f64,
    /// Statistical error of a range: standard deviation, metres, and its growth per metre.
    #[garde(custom(within(0.0, 1.0)))]
    pub range_sigma_m: f64,
    #[garde(custom(within(0.0, 0.2)))]
    #[serde(default)]
    pub range_sigma_per_m: f64,
    /// Constant error of one sweep: standard deviation, metres.
    #[garde(custom(within(0.0, 1.0)))]
    #[serde(default)]
    pub range_bias_m: f64,
    /// Step of the reported range, metres.
    #[garde(custom(within(1e-6, 1.0)))]
    pub range_step_m: f64,
    /// Full divergence of the beam, milliradians, and its width at the exit, metres.
    #[garde(custom(within(0.0, 100.0)))]
    pub divergence_mrad: f64,
    #[garde(custom(within(0.0, 0.1)))]
    #[serde(default)]
    pub exit_diameter_m: f64,
    /// Range at which a 10 % target is still seen half the time, metres.
    #[garde(custom(within(0.05, 10_000.0)))]
    pub range_at_10_percent_m: f64,
    #[garde(dive)]
    pub ranging: Ranging,
}

/// How several echoes in one beam become one range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Ranging {
    /// Amplitude-modulated phase: the phase of the summed echoes, which may lie between or beyond the surfaces.
    Phase(#[garde(dive)] PhaseRanging),
    /// Pulses: echoes closer than half a pulse merge; of several, one is reported.
    Pulse(#[garde(dive)] PulseRanging),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct PhaseRanging {
    /// Modulation frequency, megahertz.
    #[garde(custom(within(0.1, 1000.0)))]
    pub modulation_mhz: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct PulseRanging {
    /// Length of the pulse, nanoseconds.
    #[garde(custom(within(0.01, 1000.0)))]
    pub pulse_ns: f64,
    #[garde(skip)]
    pub report: Echo,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Echo {
    First,
    Strongest,
    Last,
}

/// How the beams point. Azimuth from +x to the left, elevation up, degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum PatternParams {
    /// A 2-D scanner on a tilt unit: one fan a tilt step (figure 6 of the paper).
    Tilted(#[garde(dive)] TiltedParams),
    /// Rings that spin about the sensor's z axis.
    Spinning(#[garde(dive)] SpinningParams),
    /// Line by line, like a picture.
    Raster(#[garde(dive)] RasterParams),
    /// Two rotating prisms: a rosette that fills with time.
    Rosette(#[garde(dive)] RosetteParams),
    /// One's own: a CSV file of time_s, azimuth_deg, elevation_deg with a header.
    File(#[garde(dive)] PatternFile),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct TiltedParams {
    /// Beams of one fan, and the angle between them, degrees.
    #[garde(range(min = 1, max = 100_000))]
    pub beams: u32,
    #[garde(custom(within(1e-4, 90.0)))]
    pub beam_step_deg: f64,
    /// Azimuth of the first beam, degrees; default: centred.
    #[garde(custom(within(-360.0, 360.0)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_beam_deg: Option<f64>,
    /// Tilt of the first and last fan (negative looks down), and the step between fans, degrees.
    #[garde(custom(within(-180.0, 180.0)))]
    pub tilt_from_deg: f64,
    #[garde(custom(within(-180.0, 180.0)))]
    pub tilt_to_deg: f64,
    #[garde(custom(within(1e-4, 90.0)))]
    pub tilt_step_deg: f64,
    /// Time of one fan, seconds.
    #[garde(custom(within(1e-6, 1000.0)))]
    pub line_time_s: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct SpinningParams {
    /// Elevation of each ring, degrees; a ring is a line of the pattern.
    #[garde(length(min = 1, max = 4096), inner(custom(within(-90.0, 90.0))))]
    pub elevations_deg: Vec<f64>,
    /// Columns in one turn.
    #[garde(range(min = 1, max = 100_000))]
    pub columns: u32,
    /// Time of one turn, seconds.
    #[garde(custom(within(1e-6, 1000.0)))]
    pub turn_time_s: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RasterParams {
    /// Field of view, degrees, and samples, across and down; `centre_elevation_deg` tilts the whole field.
    #[garde(custom(within(0.1, 360.0)))]
    pub width_deg: f64,
    #[garde(custom(within(0.1, 180.0)))]
    pub height_deg: f64,
    #[garde(range(min = 1, max = 100_000))]
    pub columns: u32,
    #[garde(range(min = 1, max = 100_000))]
    pub rows: u32,
    #[garde(custom(within(-90.0, 90.0)))]
    #[serde(default)]
    pub centre_elevation_deg: f64,
    #[garde(custom(within(1e-6, 1000.0)))]
    pub frame_time_s: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RosetteParams {
    /// Full angle of the circular field, degrees; `centre_elevation_deg` tilts it.
    #[garde(custom(within(0.1, 178.0)))]
    pub field_deg: f64,
    #[garde(custom(within(-90.0, 90.0)))]
    #[serde(default)]
    pub centre_elevation_deg: f64,
    /// Turns per minute of the two prisms; opposite signs turn against each other.
    #[garde(custom(within(-100_000.0, 100_000.0)))]
    pub first_rpm: f64,
    #[garde(custom(within(-100_000.0, 100_000.0)))]
    pub second_rpm: f64,
    /// Beams per second, and beams in one sweep.
    #[garde(custom(within(1.0, 1e8)))]
    pub rate_hz: f64,
    #[garde(range(min = 1, max = 100_000_000))]
    pub beams: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct PatternFile {
    /// Path, relative to the file that names it.
    #[garde(length(min = 1))]
    pub path: String,
    /// The beams themselves, [time_s, azimuth_deg, elevation_deg]; filled in by the resolved plan.
    #[garde(skip)]
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beams: Vec<[f64; 3]>,
}
