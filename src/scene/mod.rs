//! Drawn values -> a yard: ground, obstacles and vegetation.
//!
//! In: [`SceneParams`], the scene's drawn values and streams. Out: a [`Scene`] in the `world` frame, SI, f64.
//! Source: Hewitt et al. 2017, "3D terrain"; Garcia & Stoll 1984 (ground), Haines 1991 (convex bodies), Golombek & Rapp
//! 1997 (rock sizes). What the config does not name is not built and not paid for. Not modelled: overhangs, loose soil,
//! moving things. Outside the yard there is no ground.

pub mod params;

pub use params::SceneParams;

use crate::geometry::{DVec2, DVec3};

/// A yard. The square [0, extent] x [0, extent] in x and y.
#[derive(Clone, Debug)]
pub struct Scene {
    pub extent_m: f64,
    pub ground: Ground,
    /// Solid things, ordered by id; `obstacles[k].id == k`.
    pub obstacles: Vec<Obstacle>,
    /// Porous things (bushes, crowns); ids go on after the obstacles'.
    pub volumes: Vec<Volume>,
    /// Grass and bush patches in the paper's form; ids go on after the volumes'.
    pub patches: Vec<Patch>,
}

/// The ground as it is; how it is cast is another matter.
#[derive(Clone, Debug)]
pub enum Ground {
    Polynomial(Polynomial),
    Raster(Raster),
}

/// z = sum of c_ij P_i(u) P_j(v), i + j <= degree, in orthonormal Legendre polynomials on [-1, 1]^2.
#[derive(Clone, Debug)]
pub struct Polynomial {
    pub degree: usize,
    /// Centre of the fitted square, world.
    pub centre_m: DVec2,
    /// Half the side of the fitted square (1.2 times the yard): u = (x - centre) / half.
    pub half_m: f64,
    /// Coefficients ordered by i (power in x), then j: (0,0), (0,1), ... (0,n), (1,0), ...
    pub coefficients: Vec<f64>,
}

/// Heights at the nodes of a square grid, bilinear between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    pub spacing_m: f64,
    /// World position of node (row 0, col 0).
    pub origin_m: DVec2,
    pub rows: usize,
    pub cols: usize,
    /// Row-major: node (row, col) lies at origin + (col, row) * spacing.
    pub heights_m: Vec<f64>,
}

/// What a thing is; its number is the `truth_class` of points and cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i8)]
pub enum Class {
    Ground = 0,
    Rock = 1,
    /// A wall, crate or bucket.
    Box = 2,
    /// A tree's trunk.
    Trunk = 3,
    /// A return scattered by a grass patch.
    Grass = 4,
    /// A return from inside a bush (or scattered by a bush patch).
    Bush = 5,
    /// A return from inside a tree's crown.
    Crown = 6,
}

/// A solid thing that stands on (and in) the ground.
#[derive(Clone, Debug)]
pub struct Obstacle {
    pub id: i32,
    pub class: Class,
    pub shape: Shape,
    /// Bounding sphere, world.
    pub centre_m: DVec3,
    pub radius_m: f64,
    /// Greatest height of the body above the ground right below it: what "taller than a wheel" is judged by.
    pub protrusion_m: f64,
}

#[derive(Clone, Debug)]
pub enum Shape {
    Convex(Convex),
    Cylinder(Cylinder),
}

/// A convex polyhedron: the points with n . x + d <= 0 for every plane.
#[derive(Clone, Debug)]
pub struct Convex {
    /// Outward unit normals and offsets; coplanar faces merged.
    pub planes: Vec<Plane>,
    pub vertices_m: Vec<DVec3>,
    /// Per plane: its vertices, counter-clockwise seen from outside.
    pub faces: Vec<Vec<u32>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub normal: DVec3,
    pub offset_m: f64,
}

/// An upright capped cylinder.
#[derive(Clone, Copy, Debug)]
pub struct Cylinder {
    /// Centre of the bottom disc.
    pub base_m: DVec3,
    pub radius_m: f64,
    pub height_m: f64,
}

/// An upright ellipsoid of leaves and twigs: a ray that has entered travels an exponential length before it returns.
#[derive(Clone, Copy, Debug)]
pub struct Volume {
    pub id: i32,
    /// `Bush` or `Crown`.
    pub class: Class,
    pub centre_m: DVec3,
    pub semi_axes_m: DVec3,
    pub extinction_per_m: f64,
    pub untraversable: bool,
    /// Height of its top above the ground below its centre.
    pub protrusion_m: f64,
}

/// A disc of ground whose returns scatter in height (the paper's grass and bushes).
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    pub id: i32,
    /// `Grass` or `Bush`.
    pub class: Class,
    pub centre_m: DVec2,
    pub radius_m: f64,
    /// Standard deviation of the added height.
    pub sigma_m: f64,
    pub untraversable: bool,
}

/// Why a scene could not be built; a failed scene is listed with its replay command, never dropped.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    #[error("no ground under {limit_deg} degrees of slope in {tries} tries (the flattest had {best_deg:.1}); lower rms_height_m or raise correlation_length_m")]
    TooSteep { limit_deg: f64, best_deg: f64, tries: u32 },
    #[error("{path}: {reason}")]
    GroundFile { path: String, reason: String },
}
