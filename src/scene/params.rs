//! The `scene` section of a config, as written and as checked.

mod ground;
mod objects;
mod vegetation;

pub use ground::{
    ExcavationParams, FeatureParams, FileGround, GroundParams, GroundShape, GroundSource, LandformParams,
    PolynomialShape, RandomGround, RawShape, RoughnessParams,
};
pub use objects::{BoxesParams, CrownParams, GolombekParams, RocksParams, TreesParams};
pub use vegetation::{BushesParams, HeightLaw, PatchParams, VegetationParams};

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::{Dist, Purpose, within};

/// The yard: its ground, and what stands and grows on it. A part that is not named is not modelled and costs nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct SceneParams {
    /// Side of the square yard, metres.
    #[garde(custom(within(1.0, 10_000.0)))]
    #[serde(default = "default_extent_m")]
    pub extent_m: f64,
    #[garde(dive)]
    #[serde(default)]
    pub ground: GroundParams,
    /// Convex polyhedra lying on the ground.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rocks: Option<RocksParams>,
    /// Walls, crates and buckets: boxes standing on the ground.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boxes: Option<BoxesParams>,
    /// Trunks as cylinders, with porous crowns where asked.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trees: Option<TreesParams>,
    /// Grass and bushes.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vegetation: Option<VegetationParams>,
}

fn default_extent_m() -> f64 {
    20.0
}

impl SceneParams {
    /// The values drawn once a scene: those that the config names, no others.
    pub fn dists(&self) -> Vec<(Purpose, &Dist)> {
        let mut dists = Vec::new();
        if let GroundSource::Random(random) = &self.ground.source {
            dists.push((Purpose::GroundRmsHeight, &random.rms_height_m));
            dists.push((Purpose::GroundCorrelationLength, &random.correlation_length_m));
        }
        if let Some(roughness) = &self.ground.roughness {
            dists.push((Purpose::RoughnessRmsHeight, &roughness.rms_height_m));
            dists.push((Purpose::RoughnessCorrelationLength, &roughness.correlation_length_m));
        }
        if let Some(rocks) = &self.rocks {
            dists.extend(rocks.count.iter().map(|count| (Purpose::RockCount, count)));
            dists.extend(rocks.golombek.iter().map(|law| (Purpose::RockAbundance, &law.abundance)));
        }
        let vegetation = self.vegetation.as_ref();
        let counts = [
            (Purpose::BoxCount, self.boxes.as_ref().map(|p| &p.count)),
            (Purpose::TreeCount, self.trees.as_ref().map(|p| &p.count)),
            (Purpose::GrassCount, vegetation.and_then(|p| p.grass.as_ref()).map(|p| &p.count)),
            (Purpose::BrushCount, vegetation.and_then(|p| p.brush.as_ref()).map(|p| &p.count)),
            (Purpose::BushCount, vegetation.and_then(|p| p.bushes.as_ref()).map(|p| &p.count)),
        ];
        dists.extend(counts.into_iter().filter_map(|(purpose, count)| Some((purpose, count?))));
        dists
    }
}
