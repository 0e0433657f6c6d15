//! The `scene` section of a config, as written and as checked.

use std::sync::Arc;

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Raster;
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

/// Rocks: hulls of jittered points on ellipsoids.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct RocksParams {
    /// How many, drawn per scene. Either this with `diameter_m`, or `golombek`.
    #[garde(custom(within(0.0, 1e6)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<Dist>,
    /// Horizontal diameter, metres; drawn per rock.
    #[garde(custom(within(1e-3, 1e4)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diameter_m: Option<Dist>,
    /// Number and sizes by the size-frequency law of Golombek & Rapp (1997) instead.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub golombek: Option<GolombekParams>,
    /// Full height over horizontal diameter of the ellipsoid (half of it is buried on average); drawn per rock.
    #[garde(custom(within(0.05, 5.0)))]
    #[serde(default = "default_aspect")]
    pub aspect: Dist,
    /// Centre height above the ground, in vertical semi-axes; drawn per rock. 0 = half buried.
    #[garde(custom(within(-0.9, 1.0)))]
    #[serde(default = "default_offset")]
    pub offset: Dist,
    /// Longer over shorter horizontal axis of the ellipsoid; drawn per rock. The diameter is their geometric mean.
    #[garde(custom(within(1.0, 10.0)))]
    #[serde(default = "default_elongation")]
    pub elongation: Dist,
    /// Faces of the hull, drawn per rock (8 to 40; the hull of n points has at most 2 n - 4).
    #[garde(custom(within(8.0, 40.0)))]
    #[serde(default = "default_faces")]
    pub faces: Dist,
    /// Tilt of the rock's own axis, degrees; drawn per rock.
    #[garde(custom(within(0.0, 90.0)))]
    #[serde(default = "default_tilt_deg")]
    pub tilt_deg: Dist,
    /// Raise every rock until it stands at least this high above the ground, metres (the paper's rocks are all taller
    /// than a wheel); one that would have to leave the ground for it is enlarged instead.
    #[garde(custom(within(0.0, 100.0)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_height_m: Option<f64>,
}

fn default_aspect() -> Dist {
    Dist::Law(crate::random::Law::Uniform([0.6, 1.1]))
}
fn default_offset() -> Dist {
    Dist::Law(crate::random::Law::Uniform([-0.3, 0.3]))
}
fn default_elongation() -> Dist {
    Dist::Law(crate::random::Law::Uniform([1.0, 1.5]))
}
fn default_faces() -> Dist {
    Dist::Law(crate::random::Law::Uniform([8.0, 40.0]))
}
fn default_tilt_deg() -> Dist {
    Dist::Law(crate::random::Law::Uniform([0.0, 15.0]))
}

/// Cumulative fractional area F_k(D) = k exp(-q D), q = 1.79 + 0.152 / k.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct GolombekParams {
    /// k: the share of the ground that rocks cover (0.02 Phoenix, 0.05 Gusev, 0.19 Pathfinder); drawn per scene.
    #[garde(custom(within(1e-4, 0.6)))]
    pub abundance: Dist,
    /// Rocks smaller than this are not modelled, metres.
    #[garde(custom(within(0.01, 10.0)))]
    #[serde(default = "default_min_diameter_m")]
    pub min_diameter_m: f64,
    /// Rocks larger than this are not modelled, metres.
    #[garde(custom(within(0.01, 100.0)))]
    #[serde(default = "default_max_diameter_m")]
    pub max_diameter_m: f64,
}

fn default_min_diameter_m() -> f64 {
    0.05
}
fn default_max_diameter_m() -> f64 {
    3.0
}

/// Boxes: crates, buckets, walls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct BoxesParams {
    /// How many, drawn per scene.
    #[garde(custom(within(0.0, 1e5)))]
    pub count: Dist,
    /// Horizontal length, metres; drawn per box.
    #[garde(custom(within(1e-2, 1e3)))]
    pub length_m: Dist,
    /// Horizontal width, metres; drawn per box.
    #[garde(custom(within(1e-2, 1e3)))]
    pub width_m: Dist,
    /// Height above the ground, metres; drawn per box.
    #[garde(custom(within(1e-2, 1e3)))]
    pub height_m: Dist,
}

/// Trees: upright trunks, with crowns where asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct TreesParams {
    /// How many, drawn per scene.
    #[garde(custom(within(0.0, 1e5)))]
    pub count: Dist,
    /// Trunk diameter, metres; drawn per tree.
    #[garde(custom(within(0.01, 10.0)))]
    pub diameter_m: Dist,
    /// Trunk height above the ground, metres; drawn per tree.
    #[garde(custom(within(0.1, 100.0)))]
    pub height_m: Dist,
    /// A porous crown around the upper trunk.
    #[garde(dive)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crown: Option<CrownParams>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields)]
pub struct CrownParams {
    /// Crown diameter, metres; drawn per tree.
    #[garde(custom(within(0.1, 50.0)))]
    pub diameter_m: Dist,
    /// Extinction inside the crown, per metre; drawn per tree.
    #[garde(custom(within(0.01, 1000.0)))]
    pub extinction_per_m: Dist,
}

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
