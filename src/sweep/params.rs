//! The `sweep` section of a config, as written and as checked.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Sensor;
use crate::preset::Preset;
use crate::random::{Bounded, Dist, Drawn, Purpose, within};

/// The sensor, how exactly its beams are cast, and what its light suffers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct SweepParams {
    /// A shipped sensor (urg-04lx, utm-30lx, lms111, lms291, vlp-16, os1-64, raster, rosette), a path, or one written out.
    #[garde(dive)]
    pub sensor: Preset<Sensor>,
    /// Where the sensor sits, instead of the rover's own mast; each value drawn per scene.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mount: Option<MountParams>,
    /// How well the ground is cast.
    #[garde(dive)]
    pub cast: Cast,
    /// Each effect is absent unless it is named.
    #[garde(dive)]
    pub effects: Effects,
}

impl Default for SweepParams {
    fn default() -> Self {
        SweepParams {
            sensor: Preset::Name("urg-04lx".into()),
            mount: None,
            cast: Cast::Exact,
            effects: Effects::default(),
        }
    }
}

impl SweepParams {
    /// The values drawn once a scene: those that the config names, by dotted key.
    pub fn dists(&self) -> Vec<(Purpose, &Dist)> {
        let mut dists = Vec::new();
        let mut add = |purpose, dist| {
            if let Some(dist) = dist {
                dists.push((purpose, dist));
            }
        };
        if let Some(mount) = &self.mount {
            for (purpose, dist) in mount.values() {
                add(purpose, dist);
            }
        }
        let effects = &self.effects;
        if let Some(noise) = &effects.range_noise {
            add(Purpose::SweepRangeSigma, noise.sigma_m.as_ref());
            add(Purpose::SweepRangeSigmaPerM, noise.sigma_per_m.as_ref());
            add(Purpose::SweepRangeSigmaLeast, noise.min_sigma_m.as_ref());
        }
        add(Purpose::SweepBiasSigma, effects.range_bias_m.as_ref());
        if let Some(dropout) = &effects.dropout {
            add(Purpose::SweepDropoutRate, Some(&dropout.rate));
            add(Purpose::SweepDropoutGround, Some(&dropout.ground_reflectance));
        }
        add(Purpose::SweepTiltSigma, effects.tilt_jitter_deg.as_ref());
        if let Some(intensity) = &effects.intensity {
            add(Purpose::SweepIntensityGround, Some(&intensity.ground_reflectance));
            add(Purpose::SweepIntensitySigma, Some(&intensity.noise));
        }
        dists
    }
}

/// Overrides of the rover's mount; what is absent stays the rover's.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct MountParams {
    #[garde(custom(within(-10.0, 10.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x_m: Option<Dist>,
    #[garde(custom(within(-10.0, 10.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_m: Option<Dist>,
    #[garde(custom(within(0.02, 20.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z_m: Option<Dist>,
    #[garde(custom(within(-180.0, 180.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yaw_deg: Option<Dist>,
    #[garde(custom(within(-90.0, 90.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pitch_deg: Option<Dist>,
    #[garde(custom(within(-180.0, 180.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roll_deg: Option<Dist>,
}

impl MountParams {
    fn values(&self) -> [(Purpose, Option<&Dist>); 6] {
        [
            (Purpose::SweepMountX, self.x_m.as_ref()),
            (Purpose::SweepMountY, self.y_m.as_ref()),
            (Purpose::SweepMountZ, self.z_m.as_ref()),
            (Purpose::SweepMountYaw, self.yaw_deg.as_ref()),
            (Purpose::SweepMountPitch, self.pitch_deg.as_ref()),
            (Purpose::SweepMountRoll, self.roll_deg.as_ref()),
        ]
    }

    /// The mount where nothing is drawn: the middle of each law's range.
    pub fn middle(&self, rover: [f64; 6]) -> [f64; 6] {
        let values = self.values();
        std::array::from_fn(|i| match values[i].1.map(Bounded::extent) {
            Some(Ok(Some((low, high)))) => 0.5 * (low + high),
            _ => rover[i],
        })
    }

    /// The rover's own mount (x, y, z in metres, then yaw, pitch, roll in degrees) with this scene's overrides.
    pub fn apply(&self, drawn: &Drawn, rover: [f64; 6]) -> [f64; 6] {
        let values = self.values();
        std::array::from_fn(|i| if values[i].1.is_some() { drawn[values[i].0] } else { rover[i] })
    }
}

/// How the ground is cast: what the yard is stays the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Cast {
    /// The first root of the ground as it is, in f64.
    Exact,
    /// The ground sampled on a grid, bilinear between nodes.
    Raster(#[garde(dive)] SpacingParams),
    /// Ground and obstacles as triangles in a tree of boxes, f32 (obvhs).
    Mesh(#[garde(dive)] SpacingParams),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct SpacingParams {
    #[garde(custom(within(0.005, 10.0)))]
    pub spacing_m: f64,
}

/// What the light and the clockwork do to a range; each effect has its own draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct Effects {
    /// Gaussian noise of the range.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_noise: Option<RangeNoise>,
    /// One constant range error per sweep, metres: its standard deviation.
    #[garde(custom(within(0.0, 1.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_bias_m: Option<Dist>,
    /// Round the range to the sensor's step (or to this one), metres.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantisation: Option<Quantisation>,
    /// Ranges outside the sensor's gates are reported as such; absent = only the greatest range counts.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gates: Option<Gates>,
    /// Beams that return too little light.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dropout: Option<Dropout>,
    /// Beams as cones: sub-rays and mixed pixels.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mixed_pixels: Option<MixedPixels>,
    /// Error of the tilt encoder, degrees: its standard deviation. Each line turns about the sensor's y axis by a draw of
    /// its own that nobody is told.
    #[garde(custom(within(0.0, 5.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tilt_jitter_deg: Option<Dist>,
    /// Received intensity as a column and as features.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intensity: Option<Intensity>,
}

/// sigma = absolute + relative * range, plus what an oblique footprint adds; no less than a floor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct RangeNoise {
    /// Default: the sensor's own figure, metres.
    #[garde(custom(within(0.0, 1.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_m: Option<Dist>,
    /// Default: the sensor's own figure, per metre of range.
    #[garde(custom(within(0.0, 0.2)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_per_m: Option<Dist>,
    /// The standard deviation is never below this, metres; absent = no floor. With `sigma_m: 0` it makes the form of datasheets, so many
    /// millimetres near by and a share of the range beyond: `{sigma_m: 0, sigma_per_m: 0.01, min_sigma_m: 0.01}`.
    #[garde(custom(within(0.0, 1.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_sigma_m: Option<Dist>,
    /// Add range * divergence * tan(incidence) / 4, incidence capped at 82 degrees.
    #[garde(skip)]
    pub incidence: bool,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct Quantisation {
    #[garde(custom(within(1e-6, 1.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_m: Option<f64>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct Gates {
    #[garde(custom(within(0.0, 1000.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_m: Option<f64>,
    #[garde(custom(within(0.01, 10_000.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_m: Option<f64>,
}

/// A return is lost with a probability that grows as its power falls below the sensor's threshold, plus a flat rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct Dropout {
    /// Share of beams lost whatever they meet.
    #[garde(custom(within(0.0, 1.0)))]
    pub rate: Dist,
    /// Diffuse reflectance of the ground (drawn per scene) and of things on it (drawn per object; `intensity` draws the
    /// same number, so that equal laws give equal reflectances).
    #[garde(custom(within(0.01, 1.0)))]
    pub ground_reflectance: Dist,
    #[garde(custom(within(0.01, 1.0)))]
    pub object_reflectance: Dist,
    /// Width of the threshold in the logarithm of power.
    #[garde(custom(within(1e-3, 10.0)))]
    pub softness: f64,
}

impl Default for Dropout {
    fn default() -> Self {
        Dropout {
            rate: Dist::Constant(0.0),
            ground_reflectance: Dist::Constant(0.3),
            object_reflectance: Dist::Constant(0.3),
            softness: 0.3,
        }
    }
}

/// The footprint of a beam as rings of sub-rays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct MixedPixels {
    /// Sub-rays a beam: 1, 7 or 19 (0, 1 or 2 rings round the centre).
    #[garde(custom(one_seven_or_nineteen))]
    pub sub_rays: u32,
    /// Cast them only where the centre ray's neighbours differ in object, or its range departs from the straight line
    /// through theirs by more than this, metres; 0 = everywhere.
    #[garde(custom(within(0.0, 100.0)))]
    pub only_at_jumps_m: f64,
}

impl Default for MixedPixels {
    fn default() -> Self {
        MixedPixels { sub_rays: 7, only_at_jumps_m: 0.05 }
    }
}

fn one_seven_or_nineteen(value: &u32, _: &()) -> garde::Result {
    if [1, 7, 19].contains(value) { Ok(()) } else { Err(garde::Error::new(format!("must be 1, 7 or 19, got {value}"))) }
}

/// I = reflectance * cos(incidence) / range^2, normalised to 1 at 1 m, 100 % and square incidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct Intensity {
    #[garde(custom(within(0.01, 1.0)))]
    pub ground_reflectance: Dist,
    #[garde(custom(within(0.01, 1.0)))]
    pub object_reflectance: Dist,
    /// Standard deviation of the intensity as a share of it.
    #[garde(custom(within(0.0, 1.0)))]
    pub noise: Dist,
}

impl Default for Intensity {
    fn default() -> Self {
        Intensity {
            ground_reflectance: Dist::Constant(0.3),
            object_reflectance: Dist::Constant(0.3),
            noise: Dist::Constant(0.05),
        }
    }
}
