//! Rovers, yards and draws for this stage's tests.

use super::params::{DriveParams, LengthParams, PathParams, WaypointsParams};
use super::{DriveLog, Rover, drive};
use crate::geometry::{DVec2, DVec3};
use crate::preset::Preset;
use crate::random::{Drawn, Stage, Streams};
use crate::scene::polynomial::term_count;
use crate::scene::{Class, Cylinder, Ground, Polynomial, Raster, Scene, Shape};

pub(super) const ROVERS: [&str; 3] = [
    include_str!("../../configs/rovers/kapvik.yaml"),
    include_str!("../../configs/rovers/pioneer-3at.yaml"),
    include_str!("../../configs/rovers/husky-a200.yaml"),
];

pub(super) fn rover(yaml: &str) -> Rover {
    serde_saphyr::from_str(yaml).expect("a shipped rover parses")
}

pub(super) fn kapvik() -> Rover {
    rover(ROVERS[0])
}

pub(super) fn pioneer() -> Rover {
    rover(ROVERS[1])
}

pub(super) fn streams(seed: u64) -> Streams {
    Streams { seed, scene: 0, attempt: 0, stage: Stage::Drive, step: 0 }
}

pub(super) fn straight(length_m: f64) -> PathParams {
    PathParams::Straight(LengthParams { length_m: length_m.into() })
}

pub(super) fn waypoints(points_m: &[[f64; 2]]) -> PathParams {
    PathParams::Waypoints(WaypointsParams { points_m: points_m.to_vec() })
}

/// A yard on the plane z = corner + slope . (x, y).
pub(super) fn plane(extent_m: f64, corner_m: f64, slope: DVec2) -> Scene {
    Scene::bare(extent_m, Ground::Polynomial(Polynomial::plane(extent_m, corner_m, slope)))
}

/// A hilly yard, 20 m wide: a degree-5 polynomial with random coefficients; slopes reach some 20 degrees.
pub(super) fn hills(seed: u64) -> Scene {
    let draws = streams(seed).open(crate::random::Purpose::GroundNoise);
    let coefficients = (0..term_count(5)).map(|k| 0.12 * draws.normal(k as u64)).collect();
    Scene::bare(20.0, Ground::Polynomial(Polynomial::new(20.0, 5, coefficients)))
}

/// A yard whose heights at nodes `spacing_m` apart are `height_m(x, y)`, bilinear between.
pub(super) fn raster(extent_m: f64, spacing_m: f64, height_m: impl Fn(f64, f64) -> f64) -> Scene {
    Scene::bare(extent_m, Ground::Raster(Raster::sampled(extent_m, spacing_m, height_m)))
}

/// Smooth waves with white roughness of `rough_m` on every node, 5 cm apart; 10 m wide.
pub(super) fn rubble(seed: u64, rough_m: f64) -> Scene {
    let draws = streams(seed).open(crate::random::Purpose::GroundNoise);
    raster(10.0, 0.05, |x, y| {
        let node = (x * 20.0).round() * 1000.0 + (y * 20.0).round();
        0.2 * crate::math::sin(0.9 * x) * crate::math::cos(0.7 * y) + rough_m * draws.normal(node as u64)
    })
}

/// The yard with a round post of 1 m height at each place.
pub(super) fn posts(scene: Scene, places: &[(f64, f64, f64)]) -> Scene {
    places.iter().fold(scene, |scene, &(x, y, radius_m)| {
        let base_m = DVec3::new(x, y, scene.ground_below_m(x, y) - 0.1);
        scene.with_obstacle(Class::Trunk, Shape::Cylinder(Cylinder { base_m, radius_m, height_m: 1.1 }))
    })
}

pub(super) fn params(rover: Rover, path: PathParams) -> DriveParams {
    DriveParams { rover: Preset::Inline(Box::new(rover)), path, ..DriveParams::default() }
}

pub(super) fn driven(params: &DriveParams, scene: &Scene, seed: u64) -> DriveLog {
    let streams = streams(seed);
    drive(params, scene, &Drawn::draw(&streams, params.dists()), &streams).expect("the drive is possible")
}
