//! The `rocks` section of a config -> convex polyhedra lying in the ground.
//!
//! In: parameters, drawn count (or abundance), streams, the ground. Out: obstacles of class `Rock`.
//! Each is the hull of random points on a sphere, roughened by up to 15 % inwards, taken one by one until the hull has the
//! drawn number of faces; stretched so that its bounding box is that of the drawn ellipsoid; tilted about a random
//! horizontal axis and turned; and set into the ground with its centre `offset` vertical semi-axes above it (on average:
//! half buried). Source: Hewitt et al. 2017 (polyhedra, random in size and place, mean height zero); Golombek & Rapp 1997
//! (sizes). Not modelled: clustering; rocks may overlap.
//!
//! Draws: rock k stands at index k of every purpose, so that no rock's draws depend on another's: its body is made when
//! something comes near, from the same draws in any order. One that a config raises may grow without bound, and is made at once.

use std::f64::consts::TAU;

use std::sync::{Arc, OnceLock};

use super::golombek::Golombek;
use super::hull::Hull;
use super::params::{GolombekParams, RocksParams};
use super::{Body, Class, Convex, Obstacle, Scene, SceneError, Shape};
use crate::geometry::{DMat3, DVec2, DVec3};
use crate::math;
use crate::random::{self, Dist, Drawn, Purpose, Stream, Streams};

/// More rocks than this are a config gone wrong.
const MAX_ROCKS: f64 = 1e6;
/// Points a rock may use; 40 faces need 22 of them on the hull.
const POINTS: usize = 64;
/// How deep a point may lie below the sphere.
const ROUGHNESS: f64 = 0.15;
/// Share of a rock's depth in the ground that it may be lifted by: the rest keeps it in.
const MAX_LIFT: f64 = 0.8;

/// The streams of everything that is drawn per rock.
struct RockStreams {
    aspect: Stream,
    elongation: Stream,
    offset: Stream,
    faces: Stream,
    tilt: Stream,
    place: Stream,
    yaw: Stream,
    shape: Stream,
}

/// All that a scene's rocks are made from.
pub(super) struct LazyRocks {
    params: RocksParams,
    sizes: Sizes,
    streams: RockStreams,
    /// The ground alone.
    yard: Scene,
}

/// Where diameters come from.
enum Sizes {
    Drawn { diameter_m: Dist, stream: Stream },
    Golombek { law: Golombek, min_m: f64, max_m: f64, stream: Stream },
}

impl Sizes {
    fn diameter_m(&self, rock: u64) -> f64 {
        match self {
            Sizes::Drawn { diameter_m, stream } => diameter_m.at(stream, rock),
            Sizes::Golombek { law, min_m, max_m, stream } => law.diameter_m(stream.uniform(rock), *min_m, *max_m),
        }
    }

    fn most_m(&self) -> f64 {
        match self {
            Sizes::Drawn { diameter_m, .. } => diameter_m.bounds().1,
            Sizes::Golombek { max_m, min_m, .. } => max_m.max(*min_m),
        }
    }
}

impl LazyRocks {
    /// The body of a rock whose seat lies at a place.
    pub(super) fn body(&self, rock: u32, seat_m: DVec2) -> Body {
        let diameter_m = self.sizes.diameter_m(rock.into());
        let hull = rock_at(&self.params, rock.into(), seat_m, diameter_m, &self.streams, &self.yard);
        Body::new(Shape::Convex(hull), &self.yard)
    }

    /// No point of an unraised rock is farther from its seat's axis: half the diagonal of the largest bounding box.
    fn within_m(&self) -> f64 {
        let (elongation, aspect) = (self.params.elongation.bounds().1, self.params.aspect.bounds().1);
        let diagonal = (elongation + 1.0 / elongation + aspect * aspect).sqrt();
        0.5 * self.sizes.most_m() * diagonal * (1.0 + 1e-6)
    }
}

pub(super) fn build(
    params: &RocksParams,
    drawn: &Drawn,
    streams: &Streams,
    scene: &mut Scene,
) -> Result<(), SceneError> {
    let (count, sizes) = sizes(params, scene.extent_m, drawn, streams)?;
    if count == 0 {
        return Ok(());
    }
    let open = |purpose| streams.open(purpose);
    let streams = RockStreams {
        aspect: open(Purpose::RockAspect),
        elongation: open(Purpose::RockElongation),
        offset: open(Purpose::RockOffset),
        faces: open(Purpose::RockFaces),
        tilt: open(Purpose::RockTilt),
        place: open(Purpose::RockPlace),
        yaw: open(Purpose::RockYaw),
        shape: open(Purpose::RockShape),
    };
    let mut places = vec![0.0; 2 * count];
    streams.place.fill_uniform(0, &mut places);
    let yard = Scene::bare(scene.extent_m, scene.ground.clone());
    let source = Arc::new(LazyRocks { params: params.clone(), sizes, streams, yard });
    let within_m = source.within_m();
    let first_id = scene.obstacles.len() as i32;
    scene.obstacles.extend((0..).zip(places.chunks_exact(2)).map(|(number, place)| {
        let middle_m = DVec2::from_slice(place) * scene.extent_m;
        let (id, class) = (first_id + number as i32, Class::Rock);
        if params.min_height_m.is_some() {
            return Obstacle::new(id, class, source.body(number, middle_m));
        }
        let source = Some(Arc::clone(&source));
        Obstacle { id, class, middle_m, within_m, body: OnceLock::new(), source, number }
    }));
    Ok(())
}

/// How many rocks, and how large each is.
fn sizes(params: &RocksParams, extent_m: f64, drawn: &Drawn, streams: &Streams) -> Result<(usize, Sizes), SceneError> {
    if let Some(golombek) = &params.golombek {
        return golombek_sizes(golombek, extent_m, drawn, streams);
    }
    let stream = streams.open(Purpose::RockDiameter);
    let none = Dist::Constant(0.0);
    let count = params.diameter_m.as_ref().and_then(|_| drawn.get(Purpose::RockCount)).unwrap_or(0.0);
    let diameter_m = params.diameter_m.clone().unwrap_or(none);
    Ok((count as usize, Sizes::Drawn { diameter_m, stream }))
}

/// A Poisson number of rocks, each of a size of its own.
fn golombek_sizes(
    params: &GolombekParams,
    extent_m: f64,
    drawn: &Drawn,
    streams: &Streams,
) -> Result<(usize, Sizes), SceneError> {
    let (min_m, max_m) = (params.min_diameter_m, params.max_diameter_m);
    let law = Golombek::of(drawn[Purpose::RockAbundance]);
    let expected = extent_m * extent_m * (law.rocks_per_m2_above(min_m) - law.rocks_per_m2_above(max_m));
    if expected > MAX_ROCKS {
        return Err(SceneError::TooManyRocks { expected, limit: MAX_ROCKS, min_diameter_m: min_m });
    }
    let stream = streams.open(Purpose::RockGolombekDiameter);
    let sizes = Sizes::Golombek { law, min_m, max_m, stream };
    // None where the largest diameter is not above the smallest.
    let count = random::poisson(expected, &mut streams.open(Purpose::RockGolombekCount).generator_at(0));
    Ok((count as usize, sizes))
}

fn rock_at(
    params: &RocksParams,
    rock: u64,
    seat_m: DVec2,
    diameter_m: f64,
    streams: &RockStreams,
    scene: &Scene,
) -> Convex {
    // The diameter is the geometric mean of the two horizontal axes.
    let stretch = params.elongation.at(&streams.elongation, rock).sqrt();
    let aspect = params.aspect.at(&streams.aspect, rock);
    let semi_axes_m = 0.5 * diameter_m * DVec3::new(stretch, 1.0 / stretch, aspect);
    let offset_m = params.offset.at(&streams.offset, rock) * semi_axes_m.z;
    let faces = params.faces.count_at(&streams.faces, rock) as usize;
    let tilt_rad = params.tilt_deg.at(&streams.tilt, rock).to_radians();
    let mut yaws = [0.0; 2];
    streams.yaw.fill_uniform(2 * rock, &mut yaws);

    let seat = seat_m.extend(scene.ground_below_m(seat_m.x, seat_m.y));
    // Turned first, so that it tilts about any of its own horizontal axes.
    let world_from_rock =
        DMat3::from_cols_array(&turn(yaws[0])) * tilt(tilt_rad) * DMat3::from_cols_array(&turn(yaws[1]));
    let hull = angular_sphere(faces, rock, &streams.shape);
    let (low, high) = hull.bounds();
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let centre = seat + DVec3::Z * offset_m;
    let body = hull.finish(|p| centre + world_from_rock * ((p - middle) / half * semi_axes_m));
    match params.min_height_m {
        Some(min_height_m) => risen(body, seat, min_height_m, scene),
        None => body,
    }
}

/// Rotation about the vertical by a share of a turn.
fn turn(share: f64) -> [f64; 9] {
    let (sin, cos) = math::sin_cos(TAU * share);
    [cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0]
}

/// Rotation about the x axis.
fn tilt(angle_rad: f64) -> DMat3 {
    let (sin, cos) = math::sin_cos(angle_rad);
    DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, cos, sin, 0.0, -sin, cos])
}

/// The hull of so many points near the unit sphere that it has at least the wanted number of triangles (one more at most,
/// their number being even).
fn angular_sphere(faces: usize, rock: u64, shape: &Stream) -> Hull {
    let mut draws = [0.0; 3 * POINTS];
    shape.fill_uniform(rock * draws.len() as u64, &mut draws);
    let point = |u: &[f64]| {
        let z = 2.0 * u[0] - 1.0;
        let (sin, cos) = math::sin_cos(TAU * u[1]);
        let level = (1.0 - z * z).sqrt();
        DVec3::new(level * cos, level * sin, z) * (1.0 - ROUGHNESS * u[2])
    };
    let points = draws.chunks_exact(3).map(point).collect();
    let mut hull = Hull::seed(points).expect("64 random points on a sphere span a volume");
    let mut next = 0;
    while hull.triangle_count() < faces && next < POINTS as u32 {
        hull.insert(next);
        next += 1;
    }
    hull
}

/// The rock lifted until it stands high enough, but not out of the ground; then grown about its seat, where that is not
/// enough.
fn risen(mut body: Convex, seat: DVec3, min_height_m: f64, scene: &Scene) -> Convex {
    let above_m = |v: &DVec3| v.z - scene.ground_below_m(v.x, v.y);
    let protrusion_m = |body: &Convex| body.vertices_m.iter().map(above_m).fold(f64::NEG_INFINITY, f64::max);
    let lacking_m = min_height_m - protrusion_m(&body);
    if lacking_m <= 0.0 {
        return body;
    }
    let depth_m = -body.vertices_m.iter().map(above_m).fold(f64::INFINITY, f64::min);
    let lift = DVec3::Z * lacking_m.min((MAX_LIFT * depth_m).max(0.0));
    body = body.mapped(|v| v + lift);
    // Doubled in one step at most: on uneven ground the rock grows into the hill, too.
    for _ in 0..64 {
        let height_m = protrusion_m(&body);
        if height_m >= min_height_m {
            break;
        }
        let growth = if height_m > 0.0 { (min_height_m / height_m * (1.0 + 1e-12)).min(2.0) } else { 2.0 };
        body = body.mapped(|v| seat + (v - seat) * growth);
    }
    body
}

#[cfg(test)]
mod tests;
