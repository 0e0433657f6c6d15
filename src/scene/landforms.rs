//! Ridges, steps, ditches and craters -> heights added to a raster.
//!
//! In: the `features` of a config (`excavation` makes those that are dug), streams. Out: landforms with a height at any world point, and
//! the footprints that both draw. Profiles: a bank or ditch is a
//! Gaussian four standard deviations wide, with rounded ends; a step is a cubic ramp between two levels, which fades out
//! over one width at its ends; a crater is a parabolic bowl with a rim of 0.18 of its depth that falls off as r^-3 (Pike
//! 1977 for fresh simple craters; McGetchin et al. 1973 for the ejecta). Not modelled: overhangs, talus, degradation.
//!
//! Draws: landform k of the n-th entry of a kind stands at one index of each purpose, so that entries of other kinds, and
//! later ones of the same kind, move none of its draws. The number of landforms is drawn per entry.

use std::f64::consts::TAU;

use super::params::{FeatureParams, LandformParams};
use crate::geometry::DVec2;
use crate::math;
use crate::random::{Dist, Purpose, Streams};

/// Height of a crater's rim above the plain, as a share of the depth from rim to floor; the floor lies below the plain by the rest of it.
const CRATER_RIM: f64 = 0.18;
/// Beyond 2.1 widths a Gaussian four standard deviations wide has fallen to exp(-35).
const GAUSSIAN_REACH: f64 = 2.1;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Ridge,
    Step,
    Ditch,
    Crater,
}

/// One landform in the yard.
#[derive(Clone, Copy, Debug)]
pub(super) struct Landform {
    kind: Kind,
    footprint: Footprint,
    height_m: f64,
}

/// Where a landform or an excavation lies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Footprint {
    pub centre_m: DVec2,
    /// Unit direction of the line.
    pub along: DVec2,
    pub width_m: f64,
    pub half_length_m: f64,
}

/// The disc outside which a form adds nothing: exactly zero, +0 or -0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub centre_m: DVec2,
    pub radius_m: f64,
}

impl Disc {
    pub(super) fn around(centre_m: DVec2, radius_m: f64) -> Disc {
        // No node is left out for the last digit of its distance.
        Disc { centre_m, radius_m: radius_m * (1.0 + 1e-9) }
    }
}

/// A world point as a footprint sees it.
pub(super) struct Seen {
    pub from_centre: DVec2,
    /// To the left of the line.
    pub across_m: f64,
    /// Beyond the line's end, negative before it.
    pub past_end_m: f64,
}

impl Footprint {
    pub(super) fn see(&self, x_m: f64, y_m: f64) -> Seen {
        let from_centre = DVec2::new(x_m, y_m) - self.centre_m;
        let across_m = self.along.perp_dot(from_centre);
        let past_end_m = self.along.dot(from_centre).abs() - self.half_length_m;
        Seen { from_centre, across_m, past_end_m }
    }

    /// The disc that holds all that lies no farther than so much from the line.
    pub(super) fn disc(&self, from_line_m: f64) -> Disc {
        Disc::around(self.centre_m, self.half_length_m + from_line_m)
    }
}

/// All landforms of a config.
pub(super) fn place(features: &[FeatureParams], extent_m: f64, streams: &Streams) -> Vec<Landform> {
    let mut landforms = Vec::new();
    let mut entries = [0_u64; 4];
    for feature in features {
        let (kind, params) = match feature {
            FeatureParams::Ridge(params) => (Kind::Ridge, params),
            FeatureParams::Step(params) => (Kind::Step, params),
            FeatureParams::Ditch(params) => (Kind::Ditch, params),
            FeatureParams::Crater(params) => (Kind::Crater, params),
            FeatureParams::Trench(_) | FeatureParams::Hole(_) | FeatureParams::DropOff(_) => continue,
        };
        let entry = entries[kind as usize];
        entries[kind as usize] += 1;
        place_entry(kind, params, ((kind as u64) << 40) | (entry << 24), extent_m, streams, &mut landforms);
    }
    landforms
}

fn place_entry(
    kind: Kind,
    params: &LandformParams,
    first_index: u64,
    extent_m: f64,
    streams: &Streams,
    landforms: &mut Vec<Landform>,
) {
    let heights = streams.open(Purpose::GroundFeatureHeight);
    let LandformParams { count, width_m, length_m, .. } = params;
    let footprints = footprints([count, width_m], length_m.as_ref(), first_index, extent_m, streams);
    landforms.extend(footprints.map(|(index, footprint)| Landform {
        kind,
        footprint,
        height_m: params.height_m.at(&heights, index),
    }));
}

/// The footprints of one entry, each with its index: where landforms and excavations lie is drawn alike.
pub(super) fn footprints<'a>(
    [count, width_m]: [&'a Dist; 2],
    length_m: Option<&'a Dist>,
    first_index: u64,
    extent_m: f64,
    streams: &Streams,
) -> impl Iterator<Item = (u64, Footprint)> + use<'a> {
    let widths = streams.open(Purpose::GroundFeatureWidth);
    let lengths = streams.open(Purpose::GroundFeatureLength);
    let places = streams.open(Purpose::GroundFeaturePlace);
    let count = count.count_at(&streams.open(Purpose::GroundFeatureCount), first_index);
    (first_index..).take(count as usize).map(move |index| {
        let mut place = [0.0; 3];
        places.fill_uniform(3 * index, &mut place);
        let (sin, cos) = math::sin_cos(TAU * place[2]);
        let footprint = Footprint {
            centre_m: DVec2::new(place[0], place[1]) * extent_m,
            along: DVec2::new(cos, sin),
            width_m: width_m.at(&widths, index),
            half_length_m: 0.5 * length_m.map_or(f64::INFINITY, |length| length.at(&lengths, index)),
        };
        (index, footprint)
    })
}

impl Landform {
    /// Where the landform adds to the ground.
    pub(super) fn reach(&self) -> Disc {
        self.footprint.disc(match self.kind {
            Kind::Ridge | Kind::Ditch => GAUSSIAN_REACH * self.footprint.width_m,
            // The level beyond a step goes on for ever, and so does what a crater threw out.
            Kind::Step | Kind::Crater => f64::INFINITY,
        })
    }

    /// What the landform adds to the ground at a world point.
    pub(super) fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let (Seen { from_centre, across_m, past_end_m }, width_m) =
            (self.footprint.see(x_m, y_m), self.footprint.width_m);
        match self.kind {
            Kind::Ridge => self.height_m * gaussian(across_m, past_end_m, width_m),
            Kind::Ditch => -self.height_m * gaussian(across_m, past_end_m, width_m),
            Kind::Step => self.height_m * ramp(across_m / width_m) * ramp(-past_end_m / width_m),
            Kind::Crater => {
                let r = from_centre.length() / (0.5 * width_m);
                let share = if r < 1.0 { r * r - (1.0 - CRATER_RIM) } else { CRATER_RIM / (r * r * r) };
                self.height_m * share
            }
        }
    }
}

fn gaussian(across_m: f64, past_end_m: f64, width_m: f64) -> f64 {
    let past_end_m = past_end_m.max(0.0);
    let widths2 = (across_m * across_m + past_end_m * past_end_m) / (width_m * width_m);
    if widths2 > GAUSSIAN_REACH * GAUSSIAN_REACH { 0.0 } else { math::exp(-8.0 * widths2) }
}

/// 0 below -1/2, 1 above 1/2, a cubic between.
pub(super) fn ramp(t: f64) -> f64 {
    let t = (t + 0.5).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn landform(kind: Kind, half_length_m: f64) -> Landform {
        let footprint = Footprint { centre_m: DVec2::splat(10.0), along: DVec2::Y, width_m: 2.0, half_length_m };
        Landform { kind, footprint, height_m: 0.5 }
    }

    #[test]
    fn exact_profiles_at_their_marks() {
        let ridge = landform(Kind::Ridge, f64::INFINITY);
        assert_eq!(ridge.height_m(10.0, -50.0), 0.5);
        // Two standard deviations at half the width.
        assert!((ridge.height_m(11.0, 3.0) - 0.5 * math::exp(-2.0)).abs() < 1e-15);
        assert_eq!(landform(Kind::Ditch, 3.0).height_m(10.0, 12.0), -0.5);
        let step = landform(Kind::Step, f64::INFINITY);
        // Across grows to the left of the line, which runs north: west is up.
        assert_eq!((step.height_m(8.9, 0.0), step.height_m(10.0, 0.0), step.height_m(11.1, 0.0)), (0.5, 0.25, 0.0));
        let crater = landform(Kind::Crater, 0.0);
        assert!((crater.height_m(10.0, 11.0) - crater.height_m(10.0, 10.0) - 0.5).abs() < 1e-15);
        assert!((crater.height_m(10.0, 12.0) - 0.5 * CRATER_RIM / 8.0).abs() < 1e-15);
    }

    #[test]
    fn exact_beyond_its_reach_a_landform_adds_nothing() {
        for kind in [Kind::Ridge, Kind::Ditch] {
            let form = landform(kind, 3.0);
            // A circle around it at all bearings, on which the farthest that it adds to lies: beyond the line's end.
            let on_circle = |radius_m: f64| {
                (0..360).map(move |deg| math::sin_cos(f64::from(deg).to_radians())).map(move |(sin, cos)| {
                    let at = DVec2::splat(10.0) + DVec2::new(cos, sin) * radius_m;
                    form.height_m(at.x, at.y)
                })
            };
            let Disc { centre_m, radius_m } = form.reach();
            assert_eq!(centre_m, DVec2::splat(10.0));
            assert!(
                on_circle(radius_m).all(|height| height == 0.0)
                    && on_circle(0.99 * radius_m).any(|height| height != 0.0)
            );
        }
        assert!([Kind::Step, Kind::Crater].iter().all(|&kind| landform(kind, 3.0).reach().radius_m == f64::INFINITY));
    }

    #[test]
    fn law_profiles_have_no_jumps() {
        for kind in [Kind::Ridge, Kind::Step, Kind::Ditch, Kind::Crater] {
            let form = landform(kind, 3.0);
            for k in 0..20_000 {
                let x = f64::from(k) * 1e-3;
                // The steepest of them (the crater's rim) rises 2 h / R = 1.
                let step = (form.height_m(x + 1e-3, 12.9) - form.height_m(x, 12.9)).abs();
                assert!(step <= 1.1e-3, "{kind:?} at {x}: {step}");
            }
        }
    }
}
