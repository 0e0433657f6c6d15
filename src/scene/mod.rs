//! Drawn values -> a yard: ground, obstacles and vegetation.
//!
//! In: [`SceneParams`], the scene's drawn values and streams. Out: a [`Scene`] in the `world` frame, SI, f64.
//! Source: Hewitt et al. 2017, "3D terrain"; Garcia & Stoll 1984 (ground), Haines 1991 (convex bodies), Golombek & Rapp
//! 1997 (rock sizes). What the config does not name is not built and not paid for. Not modelled: overhangs, loose soil,
//! moving things. Outside the yard there is no ground.
//!
//! A yard put together by hand: what "taller than a wheel" is judged by is the height above the ground right below.
//!
//! ```
//! use marsyard::geometry::{DVec2, DVec3};
//! use marsyard::scene::{Class, Convex, Ground, Polynomial, Scene, Shape};
//!
//! // A plane that rises by a fifth along x, and a crate of 0.4 m that stands level in it.
//! let ground = Ground::Polynomial(Polynomial::plane(10.0, 0.0, DVec2::new(0.2, 0.0)));
//! let crate_m = Convex::cuboid(DVec3::new(5.0, 5.0, 1.0), DVec3::splat(0.2), 0.0);
//! let yard = Scene::bare(10.0, ground).with_obstacle(Class::Box, Shape::Convex(crate_m));
//! // Its top is at 1.2 m; the ground is lowest below its edge at x = 4.8 m.
//! let protrusion_m = yard.obstacles[0].body().protrusion_m;
//! assert!((protrusion_m - (1.2 - 0.2 * 4.8)).abs() < 1e-12);
//! // The normal of the plane.
//! let normal = yard.ground.normal(2.0, 8.0);
//! assert!((normal - DVec3::new(-0.2, 0.0, 1.0).normalize()).length() < 1e-12);
//! ```

mod boxes;
mod digest;
mod excavation;
#[cfg(test)]
mod extremes;
mod field;
mod fit;
mod golombek;
mod ground;
mod hull;
mod landforms;
mod legendre;
mod objects;
pub mod params;
pub mod polynomial;
mod raster;
mod rocks;
mod slope;
mod trees;
mod vegetation;

pub use field::RandomField;
pub use hull::{Convex, Plane};
pub(crate) use legendre::MAX_DEGREE;
pub use objects::{Body, Class, Cylinder, Object, Obstacle, Patch, Shape, Volume};
pub use params::SceneParams;
pub use polynomial::Polynomial;
pub use raster::Raster;

use crate::geometry::{DVec2, DVec3};
use crate::random::{Drawn, Stream, Streams};

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

impl Ground {
    /// Height at a world point.
    #[inline]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        match self {
            Ground::Polynomial(ground) => ground.height_m(x_m, y_m),
            Ground::Raster(ground) => ground.height_m(x_m, y_m),
        }
    }

    /// Slope along x and y at a world point.
    #[inline]
    pub fn gradient(&self, x_m: f64, y_m: f64) -> DVec2 {
        self.height_and_gradient(x_m, y_m).1
    }

    /// Height and gradient together, for little more than the price of one.
    #[inline]
    pub fn height_and_gradient(&self, x_m: f64, y_m: f64) -> (f64, DVec2) {
        match self {
            Ground::Polynomial(ground) => ground.height_and_gradient(x_m, y_m),
            Ground::Raster(ground) => ground.height_and_gradient(x_m, y_m),
        }
    }

    /// Upward unit normal at a world point.
    pub fn normal(&self, x_m: f64, y_m: f64) -> DVec3 {
        let slope = self.gradient(x_m, y_m);
        DVec3::new(-slope.x, -slope.y, 1.0).normalize()
    }

    /// Whether there is ground: outside the yard there is none.
    pub fn contains(&self, x_m: f64, y_m: f64) -> bool {
        match self {
            Ground::Polynomial(ground) => ground.contains(x_m, y_m),
            Ground::Raster(ground) => ground.contains(x_m, y_m),
        }
    }
}

impl Scene {
    /// A yard of ground alone: obstacles are added with [`Scene::with_obstacle`].
    pub fn bare(extent_m: f64, ground: Ground) -> Scene {
        Scene { extent_m, ground, obstacles: Vec::new(), volumes: Vec::new(), patches: Vec::new() }
    }

    /// The yard with one more solid thing; its id is its place in the row. Before any volume or patch.
    pub fn with_obstacle(mut self, class: Class, shape: Shape) -> Scene {
        self.add_obstacle(class, shape);
        self
    }

    /// Adds a solid thing; its id is its place in the row.
    fn add_obstacle(&mut self, class: Class, shape: Shape) {
        let id = self.obstacles.len() as i32;
        self.obstacles.push(Obstacle::new(id, class, Body::new(shape, self)));
    }

    /// Numbers the volumes after the obstacles and the patches after the volumes.
    fn number_on(&mut self) {
        let ids = self.obstacles.len() as i32..;
        let later = self.volumes.iter_mut().map(|v| &mut v.id).chain(self.patches.iter_mut().map(|p| &mut p.id));
        later.zip(ids).for_each(|(place, id)| *place = id);
    }

    /// Ground height below a point of a body, which may hang over the yard's edge: there the edge's height holds.
    pub fn ground_below_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.ground.height_m(x_m.clamp(0.0, self.extent_m), y_m.clamp(0.0, self.extent_m))
    }

    /// [`Scene::ground_below_m`] at several points, bit for bit.
    ///
    /// Inlined, so that it takes on the instruction set of its caller (see [`crate::wide`]).
    #[inline(always)]
    pub(crate) fn grounds_below_m<const N: usize>(&self, x_m: &[f64; N], y_m: &[f64; N]) -> [f64; N] {
        let [x_m, y_m] = [x_m, y_m].map(|values_m| values_m.map(|value_m| value_m.clamp(0.0, self.extent_m)));
        match &self.ground {
            Ground::Polynomial(ground) => ground.heights_m(&x_m, &y_m),
            Ground::Raster(ground) => std::array::from_fn(|l| ground.height_m(x_m[l], y_m[l])),
        }
    }

    /// Whether there is ground at the point.
    pub fn contains(&self, x_m: f64, y_m: f64) -> bool {
        (0.0..=self.extent_m).contains(&x_m) && (0.0..=self.extent_m).contains(&y_m)
    }

    /// What the id of a return belongs to.
    pub fn object(&self, id: i32) -> Option<Object<'_>> {
        let mut k = usize::try_from(id).ok()?;
        if let Some(obstacle) = self.obstacles.get(k) {
            return Some(Object::Obstacle(obstacle));
        }
        k -= self.obstacles.len();
        if let Some(volume) = self.volumes.get(k) {
            return Some(Object::Volume(volume));
        }
        self.patches.get(k - self.volumes.len()).map(Object::Patch)
    }
}

/// The place of thing `index`, anywhere in the yard.
fn place_in_yard(stream: &Stream, index: u64, extent_m: f64) -> DVec2 {
    let mut place = [0.0; 2];
    stream.fill_uniform(2 * index, &mut place);
    DVec2::from_array(place) * extent_m
}

/// Builds the yard of one scene.
///
/// Ids: rocks, boxes, trunks; then crowns, bushes; then grass, brush. Each kind has its own streams: adding one moves no
/// draw of another, only the ids after it.
pub fn build(params: &SceneParams, drawn: &Drawn, streams: &Streams) -> Result<Scene, SceneError> {
    let ground = ground::build(&params.ground, params.extent_m, drawn, streams)?;
    let mut scene = Scene::bare(params.extent_m, ground);
    if let Some(rocks) = &params.rocks {
        rocks::build(rocks, drawn, streams, &mut scene)?;
    }
    if let Some(boxes) = &params.boxes {
        boxes::build(boxes, drawn, streams, &mut scene);
    }
    if let Some(trees) = &params.trees {
        trees::build(trees, drawn, streams, &mut scene);
    }
    if let Some(vegetation) = &params.vegetation {
        vegetation::build(vegetation, drawn, streams, &mut scene);
    }
    scene.number_on();
    Ok(scene)
}

/// Why a scene could not be built; a failed scene is listed with its replay command, never dropped.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    #[error(
        "no ground under {limit_deg} degrees of slope in {tries} tries (the flattest had {best_deg:.1}); lower rms_height_m or raise correlation_length_m"
    )]
    TooSteep { limit_deg: f64, best_deg: f64, tries: u32 },
    #[error(
        "a ground of {cells} x {cells} nodes at {spacing_m} m is above the limit of {limit} x {limit}; raise spacing_m to {coarsest_m:.3} or lower extent_m"
    )]
    TooFine { spacing_m: f64, cells: usize, limit: usize, coarsest_m: f64 },
    #[error(
        "{expected:.0} rocks to expect, above the limit of {limit:.0}; raise golombek.min_diameter_m (now {min_diameter_m}) or lower abundance"
    )]
    TooManyRocks { expected: f64, limit: f64, min_diameter_m: f64 },
    #[error("{path}: {reason}")]
    GroundFile { path: String, reason: String },
}

#[cfg(test)]
mod tests;
