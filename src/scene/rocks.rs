//! The `rocks` section of a config -> convex polyhedra lying in the ground.
//!
//! In: parameters, drawn count (or abundance), streams, the ground. Out: obstacles of class `Rock`.
//! Each is the hull of random points on a sphere, roughened by up to 15 % inwards, taken one by one until the hull has the
//! drawn number of faces; stretched so that its bounding box is that of the drawn ellipsoid; tilted about a random
//! horizontal axis and turned; and set into the ground with its centre `offset` vertical semi-axes above it (on average:
//! half buried). Source: Hewitt et al. 2017 (polyhedra, random in size and place, mean height zero); Golombek & Rapp 1997
//! (sizes). Not modelled: clustering; rocks may overlap.
//!
//! Draws: rock k stands at index k of every purpose, so that no rock's draws depend on another's.

use std::f64::consts::TAU;

use super::golombek::Golombek;
use super::hull::Hull;
use super::params::{GolombekParams, RocksParams};
use super::{Class, Convex, Scene, SceneError, Shape};
use crate::geometry::{DMat3, DVec3};
use crate::math;
use crate::random::{Drawn, Purpose, Stream, Streams};

/// More rocks than this are a config gone wrong.
const MAX_ROCKS: f64 = 1e6;
/// Points a rock may use; 40 faces need 22 of them on the hull.
const POINTS: usize = 96;
/// How deep a point may lie below the sphere.
const ROUGHNESS: f64 = 0.15;

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

pub(super) fn build(
    params: &RocksParams,
    drawn: &Drawn,
    streams: &Streams,
    scene: &mut Scene,
) -> Result<(), SceneError> {
    let diameters_m = diameters(params, scene.extent_m, drawn, streams)?;
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
    for (rock, diameter_m) in diameters_m.into_iter().enumerate() {
        let body = rock_at(params, rock as u64, diameter_m, &streams, scene);
        scene.add_obstacle(Class::Rock, Shape::Convex(body));
    }
    Ok(())
}

fn diameters(params: &RocksParams, extent_m: f64, drawn: &Drawn, streams: &Streams) -> Result<Vec<f64>, SceneError> {
    if let Some(golombek) = &params.golombek {
        return golombek_diameters(golombek, extent_m, drawn, streams);
    }
    let Some(diameter_m) = &params.diameter_m else { return Ok(Vec::new()) };
    let count = drawn.get(Purpose::RockCount).unwrap_or(0.0);
    let stream = streams.open(Purpose::RockDiameter);
    Ok((0..count as u64).map(|rock| diameter_m.at(&stream, rock)).collect())
}

/// A Poisson number of rocks, each of a size of its own.
fn golombek_diameters(
    params: &GolombekParams,
    extent_m: f64,
    drawn: &Drawn,
    streams: &Streams,
) -> Result<Vec<f64>, SceneError> {
    let (min_m, max_m) = (params.min_diameter_m, params.max_diameter_m);
    let law = Golombek::of(drawn[Purpose::RockAbundance]);
    let expected = extent_m * extent_m * (law.rocks_per_m2_above(min_m) - law.rocks_per_m2_above(max_m));
    if expected > MAX_ROCKS {
        return Err(SceneError::TooManyRocks { expected, limit: MAX_ROCKS, min_diameter_m: min_m });
    }
    // No rocks: a law that is below 1e-12 of one, or whose largest diameter is not above its smallest.
    let Ok(poisson) = rand_distr::Poisson::new(expected) else { return Ok(Vec::new()) };
    let mut generator = streams.open(Purpose::RockGolombekCount).generator_at(0);
    let count: f64 = rand_distr::Distribution::sample(&poisson, &mut generator);
    let stream = streams.open(Purpose::RockGolombekDiameter);
    Ok((0..count as u64).map(|rock| law.diameter_m(stream.uniform(rock), min_m, max_m)).collect())
}

fn rock_at(params: &RocksParams, rock: u64, diameter_m: f64, streams: &RockStreams, scene: &Scene) -> Convex {
    // The diameter is the geometric mean of the two horizontal axes.
    let stretch = params.elongation.at(&streams.elongation, rock).sqrt();
    let aspect = params.aspect.at(&streams.aspect, rock);
    let semi_axes_m = 0.5 * diameter_m * DVec3::new(stretch, 1.0 / stretch, aspect);
    let offset_m = params.offset.at(&streams.offset, rock) * semi_axes_m.z;
    let faces = params.faces.count_at(&streams.faces, rock) as usize;
    let tilt_rad = params.tilt_deg.at(&streams.tilt, rock).to_radians();
    let mut place = [0.0; 2];
    streams.place.fill_uniform(2 * rock, &mut place);
    let mut yaws = [0.0; 2];
    streams.yaw.fill_uniform(2 * rock, &mut yaws);

    let (x_m, y_m) = (place[0] * scene.extent_m, place[1] * scene.extent_m);
    let seat = DVec3::new(x_m, y_m, scene.ground_below_m(x_m, y_m));
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
    let mut hull = Hull::seed(points).expect("96 random points on a sphere span a volume");
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
    let protrusion_m = |body: &Convex| Shape::protrusion_of(&body.vertices_m, scene);
    let lacking_m = min_height_m - protrusion_m(&body);
    if lacking_m <= 0.0 {
        return body;
    }
    let lowest_m = body.vertices_m.iter().fold(f64::INFINITY, |low, v| low.min(v.z));
    let lift = DVec3::Z * lacking_m.min((seat.z - lowest_m).max(0.0));
    body = body.mapped(|v| v + lift);
    // Twice the height in one step at most: on a steep ground the rock grows into the hill, too.
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
