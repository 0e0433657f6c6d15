//! The `vegetation` section of a config -> porous bushes, and patches of grass and brush.
//!
//! In: parameters, drawn counts, streams, the ground. Out: [`Volume`]s of class `Bush`: upright ellipsoids of the drawn
//! height above the ground, a quarter of them below it; [`Patch`]es of class `Grass` (traversable) and `Bush`
//! (untraversable: brush), in the paper's form: discs whose returns scatter in height. Not modelled: wind, single stems.
//! Draws: thing k stands at index k of every purpose of its kind.

use super::params::{BushesParams, PatchParams, VegetationParams};
use super::{Class, Patch, Scene, Volume};
use crate::geometry::DVec3;
use crate::random::{Drawn, Purpose, Streams};

/// Share of a bush's ellipsoid, measured along its axis, that is below the ground: its foot is not a point.
const BURIED: f64 = 0.25;

pub(super) fn build(params: &VegetationParams, drawn: &Drawn, streams: &Streams, scene: &mut Scene) {
    if let Some(bushes) = &params.bushes {
        grow_bushes(bushes, drawn, streams, scene);
    }
    if let Some(grass) = &params.grass {
        let purposes = [Purpose::GrassCount, Purpose::GrassPlace, Purpose::GrassRadius, Purpose::GrassSigma];
        grow_patches(grass, Class::Grass, purposes, drawn, streams, scene);
    }
    if let Some(brush) = &params.brush {
        let purposes = [Purpose::BrushCount, Purpose::BrushPlace, Purpose::BrushRadius, Purpose::BrushSigma];
        grow_patches(brush, Class::Bush, purposes, drawn, streams, scene);
    }
}

fn grow_bushes(params: &BushesParams, drawn: &Drawn, streams: &Streams, scene: &mut Scene) {
    let [places, diameters, heights, extinctions] =
        [Purpose::BushPlace, Purpose::BushDiameter, Purpose::BushHeight, Purpose::BushExtinction]
            .map(|purpose| streams.open(purpose));
    for index in 0..drawn[Purpose::BushCount] as u64 {
        let foot_m = super::place_in_yard(&places, index, scene.extent_m);
        let half_m = 0.5 * params.diameter_m.at(&diameters, index);
        let height_m = params.height_m.at(&heights, index);
        let half_height_m = 0.5 * height_m / (1.0 - BURIED);
        let top_m = scene.ground_below_m(foot_m.x, foot_m.y) + height_m;
        scene.volumes.push(Volume {
            id: 0,
            class: Class::Bush,
            centre_m: foot_m.extend(top_m - half_height_m),
            semi_axes_m: DVec3::new(half_m, half_m, half_height_m),
            extinction_per_m: params.extinction_per_m.at(&extinctions, index),
            untraversable: !params.traversable,
            protrusion_m: height_m,
        });
    }
}

fn grow_patches(
    params: &PatchParams,
    class: Class,
    [count, place, radius, sigma]: [Purpose; 4],
    drawn: &Drawn,
    streams: &Streams,
    scene: &mut Scene,
) {
    let [places, radii, sigmas] = [place, radius, sigma].map(|purpose| streams.open(purpose));
    for index in 0..drawn[count] as u64 {
        scene.patches.push(Patch {
            id: 0,
            class,
            centre_m: super::place_in_yard(&places, index, scene.extent_m),
            radius_m: params.radius_m.at(&radii, index),
            sigma_m: params.sigma_m.at(&sigmas, index),
            height_law: params.height_law,
            untraversable: class == Class::Bush,
        });
    }
}
