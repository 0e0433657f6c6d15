//! The `trees` section of a config -> trunks and crowns.
//!
//! In: parameters, drawn count, streams, the ground. Out: upright cylinders of class `Trunk`, which reach down to the lowest
//! ground below their foot, and, where the config names crowns, ellipsoids of class `Crown` around the trunks' tops: as high
//! as they are wide, but never down to the lower half of the trunk. Crowns count as untraversable, as the tree does.
//! Not modelled: branches, roots, leaning trunks. Draws: tree k stands at index k of every purpose.

use super::objects::disc;
use super::params::TreesParams;
use super::{Class, Cylinder, Scene, Shape, Volume};
use crate::geometry::DVec3;
use crate::random::{Drawn, Purpose, Streams};

pub(super) fn build(params: &TreesParams, drawn: &Drawn, streams: &Streams, scene: &mut Scene) {
    let [diameters, heights, places, crowns, extinctions] = [
        Purpose::TreeDiameter,
        Purpose::TreeHeight,
        Purpose::TreePlace,
        Purpose::CrownDiameter,
        Purpose::CrownExtinction,
    ]
    .map(|purpose| streams.open(purpose));
    for index in 0..drawn[Purpose::TreeCount] as u64 {
        let foot_m = super::place_in_yard(&places, index, scene.extent_m);
        let ground_m = scene.ground_below_m(foot_m.x, foot_m.y);
        let (radius_m, height_m) = (0.5 * params.diameter_m.at(&diameters, index), params.height_m.at(&heights, index));
        let lowest_m = disc(radius_m)
            .map(|rim| scene.ground_below_m(foot_m.x + rim.x, foot_m.y + rim.y))
            .fold(f64::INFINITY, f64::min);
        let trunk = Cylinder { base_m: foot_m.extend(lowest_m), radius_m, height_m: ground_m + height_m - lowest_m };
        scene.add_obstacle(Class::Trunk, Shape::Cylinder(trunk));
        if let Some(crown) = &params.crown {
            let half_m = 0.5 * crown.diameter_m.at(&crowns, index);
            let half_height_m = half_m.min(0.5 * height_m);
            scene.volumes.push(Volume {
                id: 0,
                class: Class::Crown,
                centre_m: foot_m.extend(ground_m + height_m),
                semi_axes_m: DVec3::new(half_m, half_m, half_height_m),
                extinction_per_m: crown.extinction_per_m.at(&extinctions, index),
                untraversable: true,
                protrusion_m: height_m + half_height_m,
            });
        }
    }
}
