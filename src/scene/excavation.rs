//! Trenches, holes and drop-offs -> heights added to a raster: places that a rover drives into.
//!
//! In: the `features` of a config, streams. Out: excavations with a height at any world point, metres, frame `world`. Profiles, with t
//! the horizontal distance outside the wall's middle (negative inside): the wall falls by the depth as a cubic ramp `rounding_m` wide,
//! half of it on either side of t = 0, so that the width is that at half the depth; beyond it lies a lip of what was dug out, `lip_m`
//! high, that falls to nothing half a width away. A trench is a rectangle, a hole a disc. A drop-off falls along its line and
//! climbs back over its width as one cubic ramp; its ends fade out over one width.
//! Own construction. Not modelled: overhanging or undercut walls, water, loose fill. Walls steeper than the raster's nodes can hold
//! are as steep as two of them: name `shape: {raw: {spacing_m: ...}}` for narrower ones.
//!
//! Draws: as landforms, at kinds of their own; depth, rounding and lip have purposes of their own.

use super::landforms::{Disc, Footprint, Seen, footprints, ramp};
use super::params::{ExcavationParams, FeatureParams};
use crate::geometry::DVec2;
use crate::random::{Purpose, Streams};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Trench,
    Hole,
    DropOff,
}

/// The numbers of the kinds go on after those of the landforms, whose purposes they share.
const FIRST_KIND: u64 = 4;

/// One excavation in the yard.
#[derive(Clone, Copy, Debug)]
pub(super) struct Excavation {
    kind: Kind,
    footprint: Footprint,
    depth_m: f64,
    rounding_m: f64,
    lip_m: f64,
}

/// All excavations of a config.
pub(super) fn place(features: &[FeatureParams], extent_m: f64, streams: &Streams) -> Vec<Excavation> {
    let mut excavations = Vec::new();
    let mut entries = [0_u64; 3];
    for feature in features {
        let (kind, params) = match feature {
            FeatureParams::Trench(params) => (Kind::Trench, params),
            FeatureParams::Hole(params) => (Kind::Hole, params),
            FeatureParams::DropOff(params) => (Kind::DropOff, params),
            _ => continue,
        };
        let entry = entries[kind as usize];
        entries[kind as usize] += 1;
        let first_index = ((FIRST_KIND + kind as u64) << 40) | (entry << 24);
        place_entry(kind, params, first_index, extent_m, streams, &mut excavations);
    }
    excavations
}

fn place_entry(
    kind: Kind,
    params: &ExcavationParams,
    first_index: u64,
    extent_m: f64,
    streams: &Streams,
    excavations: &mut Vec<Excavation>,
) {
    let depths = streams.open(Purpose::GroundFeatureDepth);
    let roundings = streams.open(Purpose::GroundFeatureRounding);
    let lips = streams.open(Purpose::GroundFeatureLip);
    let ExcavationParams { count, width_m, length_m, .. } = params;
    let footprints = footprints([count, width_m], length_m.as_ref(), first_index, extent_m, streams);
    excavations.extend(footprints.map(|(index, footprint)| Excavation {
        kind,
        footprint,
        depth_m: params.depth_m.at(&depths, index),
        rounding_m: params.rounding_m.at(&roundings, index),
        lip_m: params.lip_m.at(&lips, index),
    }));
}

impl Excavation {
    /// Where the excavation adds to the ground.
    pub(super) fn reach(&self) -> Disc {
        let (Footprint { width_m, .. }, half_rounding_m) = (self.footprint, 0.5 * self.rounding_m);
        // A lip ends half a width outside the wall's middle, the wall half its rounding.
        let beyond_wall_m = half_rounding_m.max(0.5 * width_m);
        match self.kind {
            Kind::Trench => self.footprint.disc(0.5 * width_m + beyond_wall_m),
            Kind::Hole => Disc::around(self.footprint.centre_m, 0.5 * width_m + beyond_wall_m),
            Kind::DropOff => self.footprint.disc(0.5 * width_m + width_m.max(half_rounding_m)),
        }
    }

    /// What the excavation adds to the ground at a world point.
    pub(super) fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let (Seen { from_centre, across_m, past_end_m }, width_m) =
            (self.footprint.see(x_m, y_m), self.footprint.width_m);
        match self.kind {
            Kind::Trench => self.wall(outside_rectangle(across_m.abs() - 0.5 * width_m, past_end_m)),
            Kind::Hole => self.wall(from_centre.length() - 0.5 * width_m),
            Kind::DropOff => {
                let share = ramp(-past_end_m / width_m);
                let fallen = ramp(across_m / self.rounding_m) * ramp(0.5 - across_m / width_m);
                let lip = ramp(-across_m / self.rounding_m) * ramp(0.5 + 2.0 * across_m / width_m);
                share * (self.lip_m * lip - self.depth_m * fallen)
            }
        }
    }

    /// At a signed distance outside the wall's middle.
    fn wall(&self, outside_m: f64) -> f64 {
        let steps = outside_m / self.rounding_m;
        let lip = ramp(steps) * ramp(0.5 - 2.0 * outside_m / self.footprint.width_m);
        self.lip_m * lip - self.depth_m * ramp(-steps)
    }
}

/// Signed distance to a rectangle from the distances beyond its sides.
fn outside_rectangle(across_m: f64, along_m: f64) -> f64 {
    let beyond = DVec2::new(across_m, along_m).max(DVec2::ZERO).length();
    beyond + across_m.max(along_m).min(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn excavation(kind: Kind) -> Excavation {
        let footprint = Footprint { centre_m: DVec2::splat(10.0), along: DVec2::Y, width_m: 1.0, half_length_m: 2.0 };
        Excavation { kind, footprint, depth_m: 0.5, rounding_m: 0.1, lip_m: 0.06 }
    }

    #[test]
    fn exact_profiles_at_their_marks() {
        for kind in [Kind::Trench, Kind::Hole] {
            let pit = excavation(kind);
            let at = |outside_m: f64| pit.height_m(10.5 + outside_m, 10.0);
            // The floor, to where the wall begins; its middle; the lip's crest (2 x 0.05 m of 1 m outside: the ramp at 0.4); plain ground.
            assert_eq!((pit.height_m(10.0, 10.0), at(-0.0501)), (-0.5, -0.5), "{kind:?}");
            assert!((at(0.0) - (0.5 * 0.06 - 0.5 * 0.5)).abs() < 1e-12, "{kind:?} {}", at(0.0));
            assert!((at(0.05) - 0.06 * 0.9 * 0.9 * (3.0 - 1.8)).abs() < 1e-12, "{kind:?} {}", at(0.05));
            assert_eq!((at(0.501), at(5.0)), (0.0, 0.0), "{kind:?}");
        }
        // The trench ends; beyond its corner the distance is that to the corner.
        let trench = excavation(Kind::Trench);
        assert_eq!((trench.height_m(10.0, 11.9), trench.height_m(10.0, 12.6)), (-0.5, 0.0));
        let (corner, side) = (trench.height_m(10.5 + 0.06, 12.08), trench.height_m(10.5 + 0.1, 10.0));
        assert!((corner - side).abs() < 1e-12);
        // Across grows to the left of the line, which runs north: west is low, and climbs back over a metre.
        let drop_off = excavation(Kind::DropOff);
        assert_eq!(drop_off.height_m(8.9, 10.0), 0.0);
        assert!((drop_off.height_m(9.5, 10.0) + 0.25).abs() < 1e-12);
        let just_below = 0.94 * 0.94 * (3.0 - 2.0 * 0.94);
        assert!((drop_off.height_m(9.94, 10.0) + 0.5 * just_below).abs() < 1e-12);
        assert_eq!((drop_off.height_m(10.6, 10.0), drop_off.height_m(9.5, 13.0)), (0.0, 0.0));
    }

    #[test]
    fn exact_beyond_its_reach_an_excavation_adds_nothing() {
        for kind in [Kind::Trench, Kind::Hole, Kind::DropOff] {
            for (rounding_m, lip_m) in [(0.1, 0.06), (0.4, 0.0), (3.0, 0.06)] {
                let form = Excavation { rounding_m, lip_m, ..excavation(kind) };
                let Disc { centre_m, radius_m } = form.reach();
                let adds = |&(x_m, y_m): &(f64, f64)| form.height_m(x_m, y_m) != 0.0;
                let grid = || (0..200).flat_map(|k| (0..200).map(move |l| (0.1 * f64::from(k), 0.1 * f64::from(l))));
                let farthest_m =
                    grid().filter(adds).map(|(x, y)| (DVec2::new(x, y) - centre_m).length()).fold(0.0, f64::max);
                // The disc is wider than what it holds, but no more than twice.
                assert!(farthest_m <= radius_m && farthest_m >= 0.5 * radius_m, "{kind:?}: {farthest_m} {radius_m}");
            }
        }
    }

    #[test]
    fn law_profiles_have_no_jumps() {
        for kind in [Kind::Trench, Kind::Hole, Kind::DropOff] {
            let form = excavation(kind);
            for k in 0..20_000 {
                let at = f64::from(k) * 1e-3;
                // A cubic ramp is 3/2 as steep as the straight one: 0.56 m over 0.1 m.
                for (x, y, dx, dy) in [(at, 11.7, 1e-3, 0.0), (10.2, at, 0.0, 1e-3)] {
                    let step = (form.height_m(x + dx, y + dy) - form.height_m(x, y)).abs();
                    assert!(step <= 9e-3, "{kind:?} at {x}, {y}: {step}");
                }
            }
        }
    }

    #[test]
    fn equal_excavations_of_one_kind_whatever_other_kinds_there_are() {
        let params = ExcavationParams {
            count: 3.0.into(),
            depth_m: crate::random::Dist::Law(crate::random::Law::Uniform([0.2, 0.8])),
            width_m: 0.7.into(),
            length_m: None,
            rounding_m: 0.05.into(),
            lip_m: 0.02.into(),
        };
        let streams = Streams { seed: 3, scene: 1, attempt: 0, stage: crate::random::Stage::Scene, step: 0 };
        let placed = |features: &[FeatureParams]| place(features, 20.0, &streams);
        let (trench, hole) = (FeatureParams::Trench(params.clone()), FeatureParams::Hole(params));
        let (alone, among) = (placed(std::slice::from_ref(&hole)), placed(&[trench.clone(), hole, trench]));
        assert_eq!((alone.len(), among.len()), (3, 9));
        for k in 0..3 {
            assert_eq!(format!("{:?}", alone[k]), format!("{:?}", among[3 + k]));
        }
        assert!(alone.iter().all(|hole| (0.2..=0.8).contains(&hole.depth_m)) && alone[0].depth_m != alone[1].depth_m);
    }
}
