//! `scene.vegetation` of a config: patches of grass and brush, and bushes.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::{Dist, within};

/// Grass and bushes: patches that scatter returns (the paper's form), and porous bushes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct VegetationParams {
    /// Traversable patches of grass.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grass: Option<PatchParams>,
    /// Untraversable patches of brush, in the paper's form.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brush: Option<PatchParams>,
    /// Porous bushes.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bushes: Option<BushesParams>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct PatchParams {
    /// How many, drawn per scene.
    #[garde(custom(within(0.0, 1e5)))]
    pub count: Dist,
    /// Radius of a patch, metres; drawn per patch.
    #[garde(custom(within(0.05, 1e3)))]
    pub radius_m: Dist,
    /// Scale of the added height, metres; drawn per patch. What it is the standard deviation of, `height_law` says.
    #[garde(custom(within(0.0, 2.0)))]
    pub sigma_m: Dist,
    /// The law of the heights that returns get, cut off where a return would leave its patch. `half_normal`, the default: |N(0, sigma_m)|,
    /// never below the ground, of mean 0.80 sigma_m and standard deviation 0.60 sigma_m. `normal`, the paper's: N(0, sigma_m), of mean 0 and
    /// variance sigma_m^2, half of it below the ground.
    #[garde(skip)]
    #[serde(default, skip_serializing_if = "HeightLaw::is_half_normal")]
    pub height_law: HeightLaw,
}

/// How high above the ground the returns of a patch stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HeightLaw {
    /// |N(0, sigma_m)|: blades on ground that light does not enter.
    #[default]
    HalfNormal,
    /// N(0, sigma_m), as the paper adds variance to measurements.
    Normal,
}

impl HeightLaw {
    fn is_half_normal(&self) -> bool {
        *self == HeightLaw::HalfNormal
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct BushesParams {
    /// How many, drawn per scene.
    #[garde(custom(within(0.0, 1e5)))]
    pub count: Dist,
    /// Horizontal diameter, metres; drawn per bush.
    #[garde(custom(within(0.05, 50.0)))]
    pub diameter_m: Dist,
    /// Height above the ground, metres; drawn per bush.
    #[garde(custom(within(0.05, 20.0)))]
    pub height_m: Dist,
    /// Extinction per metre: the mean depth of a return is one over it; drawn per bush.
    #[garde(custom(within(0.01, 1000.0)))]
    pub extinction_per_m: Dist,
    /// Whether the rover can push through.
    #[garde(skip)]
    #[serde(default)]
    pub traversable: bool,
}
