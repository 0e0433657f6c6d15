//! The `boxes` section of a config -> crates, buckets and walls.
//!
//! In: parameters, drawn count, streams, the ground. Out: obstacles of class `Box`: upright cuboids with level tops, the
//! drawn height above the ground at their centre, reaching down to the lowest ground below their footprint.
//! Draws: box k stands at index k of every purpose.

use std::f64::consts::TAU;

use super::params::BoxesParams;
use super::{Class, Convex, Scene, Shape};
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::random::{Drawn, Purpose, Streams};

/// Points along each side of a footprint where the ground is looked up.
const PROBES: i32 = 8;

pub(super) fn build(params: &BoxesParams, drawn: &Drawn, streams: &Streams, scene: &mut Scene) {
    let [lengths, widths, heights] =
        [Purpose::BoxLength, Purpose::BoxWidth, Purpose::BoxHeight].map(|purpose| streams.open(purpose));
    let (places, yaws) = (streams.open(Purpose::BoxPlace), streams.open(Purpose::BoxYaw));
    for index in 0..drawn[Purpose::BoxCount] as u64 {
        let centre_m = super::place_in_yard(&places, index, scene.extent_m);
        let half_m = 0.5 * DVec2::new(params.length_m.at(&lengths, index), params.width_m.at(&widths, index));
        let height_m = params.height_m.at(&heights, index);
        let body = standing(scene, centre_m, half_m, height_m, TAU * yaws.uniform(index));
        scene.add_obstacle(Class::Box, Shape::Convex(body));
    }
}

/// A cuboid on the ground, down to its lowest point below the footprint.
pub(super) fn standing(scene: &Scene, centre_m: DVec2, half_m: DVec2, height_m: f64, yaw_rad: f64) -> Convex {
    let (sin, cos) = math::sin_cos(yaw_rad);
    let (along, across) = (DVec2::new(cos, sin) * half_m.x, DVec2::new(-sin, cos) * half_m.y);
    let share = |k: i32| f64::from(2 * k - PROBES) / f64::from(PROBES);
    let footprint = (0..=PROBES).flat_map(|a| (0..=PROBES).map(move |b| (a, b)));
    let lowest_m = footprint
        .map(|(a, b)| centre_m + along * share(a) + across * share(b))
        .fold(f64::INFINITY, |low, p| low.min(scene.ground_below_m(p.x, p.y)));
    let top_m = scene.ground_below_m(centre_m.x, centre_m.y) + height_m;
    let half_height_m = 0.5 * (top_m - lowest_m);
    Convex::cuboid(centre_m.extend(top_m - half_height_m), DVec3::new(half_m.x, half_m.y, half_height_m), yaw_rad)
}
