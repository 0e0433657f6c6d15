//! `scene.ground` of a config: where heights come from, their shape, its roughness, landforms and excavations.

use std::sync::Arc;

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::{Dist, within};
use crate::scene::Raster;

/// The ground: where its heights come from, and the shape that is made of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct GroundParams {
    #[garde(dive)]
    pub source: GroundSource,
    #[garde(dive)]
    pub shape: GroundShape,
    /// Random shapes steeper than this anywhere in the yard are drawn again (up to 100 times), degrees. Roughness and
    /// features, which are steep on purpose, and files do not count.
    #[garde(custom(within(0.1, 60.0)))]
    pub max_slope_deg: f64,
    /// Small-scale roughness on top of the shape; makes the ground a raster.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<RoughnessParams>,
    /// Ridges, steps, ditches, craters, trenches, holes and drop-offs on top of the shape; makes the ground a raster (of 0.05 m, unless
    /// the shape or the roughness says otherwise).
    #[garde(dive)]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<FeatureParams>,
}

impl Default for GroundParams {
    fn default() -> Self {
        GroundParams {
            source: GroundSource::Random(RandomGround::default()),
            shape: GroundShape::Polynomial(PolynomialShape { degree: 5 }),
            max_slope_deg: 25.0,
            roughness: None,
            features: Vec::new(),
        }
    }
}

/// Where the heights come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GroundSource {
    /// White noise filtered by a Gaussian (Garcia & Stoll 1984).
    Random(#[garde(dive)] RandomGround),
    /// A height map: NPY (2-D, metres) or a 16-bit grey PNG (with `height_m`).
    File(#[garde(dive)] FileGround),
    /// Height 0 everywhere.
    Flat,
}

/// A random rough surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct RandomGround {
    /// Root mean square height of the field, metres.
    #[garde(custom(within(0.0, 100.0)))]
    pub rms_height_m: Dist,
    /// Distance over which the autocovariance falls to 1/e, metres.
    #[garde(custom(within(1e-3, 1e6)))]
    pub correlation_length_m: Dist,
}

impl Default for RandomGround {
    fn default() -> Self {
        RandomGround {
            rms_height_m: Dist::Law(crate::random::Law::Uniform([0.05, 0.6])),
            correlation_length_m: Dist::Law(crate::random::Law::Uniform([6.0, 10.0])),
        }
    }
}

/// A height map from a file. It is stretched over the yard; row 0 is the south edge (y = 0) of an NPY file, the north edge of a PNG.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct FileGround {
    /// Path, relative to the config file.
    #[garde(length(min = 1))]
    pub path: String,
    /// PNG only: the height of white above black, metres.
    #[garde(custom(within(0.0, 1e4)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// Hash of the file's bytes (BLAKE3); filled in by the resolved plan and checked on every build.
    #[garde(skip)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blake3: Option<String>,
    /// The heights, read by `config`; never part of the document.
    #[garde(skip)]
    #[serde(skip)]
    #[schemars(skip)]
    pub raster: Option<Arc<Raster>>,
}

/// The shape that is made of the heights: what the yard is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GroundShape {
    /// The least-squares polynomial of the heights on 1.2 times the yard (the paper's ground).
    Polynomial(#[garde(dive)] PolynomialShape),
    /// The heights themselves, bilinear between nodes.
    Raw(#[garde(dive)] RawShape),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct PolynomialShape {
    /// Total degree.
    #[garde(range(min = 2, max = 12))]
    pub degree: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RawShape {
    /// Distance between nodes, metres.
    #[garde(custom(within(0.005, 10.0)))]
    pub spacing_m: f64,
}

/// Unfitted roughness: a Gaussian field of its own, finer than the shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RoughnessParams {
    #[garde(custom(within(0.0, 1.0)))]
    pub rms_height_m: Dist,
    #[garde(custom(within(0.02, 100.0)))]
    pub correlation_length_m: Dist,
    /// Distance between the nodes of the raster that results, metres.
    #[garde(custom(within(0.005, 1.0)))]
    #[serde(default = "default_spacing_m")]
    pub spacing_m: f64,
}

fn default_spacing_m() -> f64 {
    0.05
}

/// One kind of landform, placed at random `count` times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FeatureParams {
    /// A bank: a straight ridge of Gaussian profile.
    Ridge(#[garde(dive)] LandformParams),
    /// A drop between two levels along a line.
    Step(#[garde(dive)] LandformParams),
    /// A straight ditch of Gaussian profile.
    Ditch(#[garde(dive)] LandformParams),
    /// A bowl with a raised rim.
    Crater(#[garde(dive)] LandformParams),
    /// A straight trench with steep walls and a flat floor.
    Trench(#[garde(dive)] ExcavationParams),
    /// A round hole with steep walls and a flat floor.
    Hole(#[garde(dive)] ExcavationParams),
    /// A steep fall along a line; the low ground climbs back over the width.
    DropOff(#[garde(dive)] ExcavationParams),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct LandformParams {
    /// How many, drawn per scene.
    #[garde(custom(within(0.0, 1000.0)))]
    pub count: Dist,
    /// Height (ridge, step) or depth (ditch, crater), metres; drawn per landform.
    #[garde(custom(within(0.0, 20.0)))]
    pub height_m: Dist,
    /// Width of the profile (the diameter of a crater), metres; drawn per landform.
    #[garde(custom(within(0.05, 1000.0)))]
    pub width_m: Dist,
    /// Length along the line, metres (no meaning for a crater); drawn per landform; default: across the whole yard.
    #[garde(custom(within(0.1, 10_000.0)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_m: Option<Dist>,
}

/// A place that a rover drives into, placed at random `count` times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct ExcavationParams {
    /// How many, drawn per scene.
    #[garde(custom(within(0.0, 1000.0)))]
    pub count: Dist,
    /// From the ground around to the floor, metres; drawn per excavation.
    #[garde(custom(within(0.0, 20.0)))]
    pub depth_m: Dist,
    /// Width at half the depth (the diameter of a hole; over which the ground below a drop-off climbs back), metres; drawn per excavation.
    #[garde(custom(within(0.05, 1000.0)))]
    pub width_m: Dist,
    /// Length along the line, metres (no meaning for a hole); drawn per excavation; default: across the whole yard.
    #[garde(custom(within(0.1, 10_000.0)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_m: Option<Dist>,
    /// Horizontal width of the wall, metres; drawn per excavation. Walls narrower than two nodes of the raster are as wide as those.
    #[garde(custom(within(0.01, 100.0)))]
    #[serde(default = "default_rounding_m")]
    pub rounding_m: Dist,
    /// Height of the lip of what was dug out, which falls to nothing half a width away, metres; drawn per excavation.
    #[garde(custom(within(0.0, 5.0)))]
    #[serde(default = "default_lip_m")]
    pub lip_m: Dist,
}

fn default_rounding_m() -> Dist {
    0.05.into()
}

fn default_lip_m() -> Dist {
    0.0.into()
}
