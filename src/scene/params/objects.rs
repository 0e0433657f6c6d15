//! `scene.rocks`, `scene.boxes` and `scene.trees` of a config.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::{Dist, within};

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
