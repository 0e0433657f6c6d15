//! A place in the yard -> how far the ground falls there: what `cells.labels.max_drop_m` is held against.
//!
//! In: the scene, and a place (x, y) in `world`, metres. Out: [`Fall`], metres. Own construction.
//!
//! A fall has two parts, both sampled on rays in 16 directions. The *lip*: how far the ground falls from the place within [`WALL_M`]. The
//! *pit*: how deep the place lies between walls on two opposite sides, each within [`PIT_M`]; a side is as high as its highest point above
//! the place that the ground climbs to within [`WALL_M`]: min(z(q) - z(p), z(q) - least z of the last `WALL_M` before q), the greatest over
//! q. The lower of two sides counts, and of eight axes the greatest. So the foot of a bank, which has a wall on one side, is no pit, nor is
//! a valley, whose sides climb slowly. Clefts narrower than 5 cm may be missed.
//!
//! The samples of a ray are worked out together, with the bits of one by one. An axis whose one side is no higher than the pit
//! found already cannot deepen it: its other side is not looked at beyond what the lip needs. The lower side is tried first.

use std::f64::consts::TAU;

use crate::geometry::DVec2;
use crate::math;
use crate::scene::Scene;
use crate::wide::{Work, widest};

/// From how near a lip the ground falls away; a wall is ground that rises or falls within as much.
const WALL_M: f64 = 0.3;
/// How far off the walls of a pit may be.
const PIT_M: f64 = 2.0;
const AXES: usize = 8;
const DIRECTIONS: usize = 2 * AXES;
/// Samples of a ray: 5 cm apart as far as the lip reaches, then 10 cm.
const LIP: usize = 6;
const SAMPLES: usize = LIP + ((PIT_M - WALL_M) / 0.1 + 0.5) as usize;
/// The first samples of a ray, which are looked at in every direction, and the others: as many as registers hold.
const NEAR: usize = 8;
const FAR: usize = 16;

/// Distance of a sample from the place.
fn sample_m(k: usize) -> f64 {
    if k < LIP { 0.05 * (k + 1) as f64 } else { WALL_M + 0.1 * (k + 1 - LIP) as f64 }
}

/// How the ground falls at a place, metres, at least 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fall {
    pub lip_m: f64,
    pub pit_m: f64,
}

impl Fall {
    /// What `max_drop_m` is held against.
    pub(super) fn drop_m(self) -> f64 {
        self.lip_m.max(self.pit_m)
    }
}

/// Where samples lie from the place: x and y of each.
#[derive(Clone, Copy, Debug)]
struct Away<const N: usize>([[f64; N]; 2]);

impl<const N: usize> Away<N> {
    /// Samples of a ray from number `first`; beyond its end the last one again.
    fn on_ray(direction: DVec2, first: usize) -> Away<N> {
        let at_m = |l: usize| sample_m((first + l).min(SAMPLES - 1)) * direction;
        Away([std::array::from_fn(|l| at_m(l).x), std::array::from_fn(|l| at_m(l).y)])
    }

    /// The ground's heights there.
    #[inline(always)]
    fn heights_m(&self, scene: &Scene, here: DVec2) -> [f64; N] {
        let Away([x_m, y_m]) = self;
        scene.grounds_below_m(&x_m.map(|x_m| here.x + x_m), &y_m.map(|y_m| here.y + y_m))
    }
}

/// Asks a scene.
#[derive(Clone, Debug)]
pub(super) struct Falls<'s> {
    scene: &'s Scene,
    near: [Away<NEAR>; DIRECTIONS],
    far: [Away<FAR>; DIRECTIONS],
}

impl<'s> Falls<'s> {
    pub(super) fn new(scene: &'s Scene) -> Falls<'s> {
        let directions: [DVec2; DIRECTIONS] = std::array::from_fn(|k| {
            let (sin, cos) = math::sin_cos(TAU * k as f64 / DIRECTIONS as f64);
            DVec2::new(cos, sin)
        });
        let near = directions.map(|direction| Away::on_ray(direction, 0));
        Falls { scene, near, far: directions.map(|direction| Away::on_ray(direction, NEAR)) }
    }

    pub(super) fn at(&self, x_m: f64, y_m: f64) -> Fall {
        widest(FallAt { falls: self, here: DVec2::new(x_m, y_m) })
    }
}

/// The fall at one place.
struct FallAt<'a> {
    falls: &'a Falls<'a>,
    here: DVec2,
}

impl Work for FallAt<'_> {
    type Out = Fall;

    #[inline(always)]
    fn run(self) -> Fall {
        let FallAt { falls: Falls { scene, near, far }, here } = self;
        let here_m = scene.ground_below_m(here.x, here.y);
        let (mut lowest_m, mut near_m) = (here_m, [[0.0; NEAR]; DIRECTIONS]);
        for (heights_m, away) in near_m.iter_mut().zip(near) {
            *heights_m = away.heights_m(scene, here);
            lowest_m = heights_m[..LIP].iter().fold(lowest_m, |low, &height_m| low.min(height_m));
        }
        let mut pit_m = 0.0_f64;
        for axis in 0..AXES {
            let (mut low, mut high) = (axis, axis + AXES);
            if near_m[high][NEAR - 1] < near_m[low][NEAR - 1] {
                (low, high) = (high, low);
            }
            let side_m = side_m(here_m, &near_m[low], &far[low].heights_m(scene, here));
            if side_m > pit_m {
                pit_m = pit_m.max(side_m.min(self::side_m(here_m, &near_m[high], &far[high].heights_m(scene, here))));
            }
        }
        Fall { lip_m: here_m - lowest_m, pit_m }
    }
}

/// How high a side is, from the heights along its ray.
#[inline(always)]
fn side_m(here_m: f64, near_m: &[f64; NEAR], far_m: &[f64; FAR]) -> f64 {
    let mut heights_m = [0.0; NEAR + FAR];
    heights_m[..NEAR].copy_from_slice(near_m);
    heights_m[NEAR..].copy_from_slice(far_m);
    // The least of the last 0.3 m: from the place itself, and later from the sample that lies so far before.
    let mut before_m = [0.0; NEAR + FAR];
    let mut low_m = here_m;
    for k in 0..LIP {
        low_m = low_m.min(heights_m[k]);
        before_m[k] = low_m;
    }
    let least_m = |heights_m: &[f64]| heights_m.iter().fold(f64::INFINITY, |low, &height_m| low.min(height_m));
    (before_m[6], before_m[7]) = (least_m(&heights_m[1..=6]), least_m(&heights_m[3..=7]));
    for k in NEAR..SAMPLES {
        before_m[k] = heights_m[k - 3].min(heights_m[k - 2]).min(heights_m[k - 1]).min(heights_m[k]);
    }
    let climbs_m = heights_m.iter().zip(&before_m).take(SAMPLES);
    climbs_m.fold(0.0, |side_m: f64, (height_m, before_m)| side_m.max((height_m - here_m).min(height_m - before_m)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Drawn, Purpose, Stage, Streams};
    use crate::scene::{Ground, Polynomial, Raster, SceneParams};
    use crate::wide::every_form;

    #[test]
    fn exact_lips_interiors_and_feet_of_steps_have_their_falls() {
        // A trench 1.5 m wide and 0.4 m deep from x = 4 m, a step up of 0.5 m at x = 8 m; walls one node wide.
        let height = |x: f64, _: f64| {
            if x > 8.0 {
                0.5
            } else if (4.0..5.5).contains(&x) {
                -0.4
            } else {
                0.0
            }
        };
        let scene = Scene::bare(10.0, Ground::Raster(Raster::sampled(10.0, 0.01, height)));
        let falls = Falls::new(&scene);
        for (x_m, lip_m, pit_m) in [
            (3.5, 0.0, 0.0),
            (3.72, 0.4, 0.0), // 0.28 m before the lip
            (4.05, 0.0, 0.4), // on the floor, below either wall
            (4.75, 0.0, 0.4),
            (5.45, 0.0, 0.4),
            (5.72, 0.4, 0.0),
            (6.5, 0.0, 0.0),
            (7.9, 0.0, 0.0), // the foot of a step
            (8.1, 0.5, 0.0), // above it
            (8.4, 0.0, 0.0),
        ] {
            let fall = falls.at(x_m, 5.0);
            assert!((fall.lip_m - lip_m).abs() < 1e-9 && (fall.pit_m - pit_m).abs() < 1e-9, "{x_m}: {fall:?}");
        }
        let slope = Scene::bare(10.0, Ground::Polynomial(Polynomial::plane(10.0, 0.0, DVec2::new(0.2, 0.0))));
        let fall = Falls::new(&slope).at(5.0, 5.0);
        assert!((fall.lip_m - 0.2 * 0.3).abs() < 1e-12 && fall.pit_m == 0.0, "{fall:?}");
        // A valley whose sides climb by a fifth is as deep as they climb within the wall's reach, however high they are.
        let valley = |x: f64, _: f64| 0.2 * (x - 5.0).abs();
        let valley = Scene::bare(10.0, Ground::Raster(Raster::sampled(10.0, 0.1, valley)));
        let fall = Falls::new(&valley).at(5.0, 5.0);
        assert!((fall.pit_m - 0.2 * 0.3).abs() < 1e-9, "{fall:?}");
        assert!((sample_m(5) - WALL_M).abs() < 1e-12 && (sample_m(SAMPLES - 1) - PIT_M).abs() < 1e-12);
    }

    /// The definition, sample by sample, with every side looked at.
    fn plain(scene: &Scene, here: DVec2) -> Fall {
        let here_m = scene.ground_below_m(here.x, here.y);
        let mut lowest_m = here_m;
        let sides: [f64; DIRECTIONS] = std::array::from_fn(|direction| {
            let (sin, cos) = math::sin_cos(TAU * direction as f64 / DIRECTIONS as f64);
            let (mut heights_m, mut side_m) = (vec![here_m], 0.0_f64);
            for k in 0..SAMPLES {
                let away = sample_m(k) * DVec2::new(cos, sin);
                let height_m = scene.ground_below_m(here.x + away.x, here.y + away.y);
                heights_m.push(height_m);
                let last = (0..=k).filter(|&other| sample_m(other) > sample_m(k) - WALL_M - 1e-9);
                let mut before_m = last.fold(f64::INFINITY, |low, other| low.min(heights_m[other + 1]));
                if k < LIP {
                    before_m = before_m.min(here_m);
                    lowest_m = lowest_m.min(height_m);
                }
                side_m = side_m.max((height_m - here_m).min(height_m - before_m));
            }
            side_m
        });
        let axes = (0..AXES).map(|k| sides[k].min(sides[k + AXES]));
        Fall { lip_m: here_m - lowest_m, pit_m: axes.fold(0.0, f64::max) }
    }

    #[test]
    fn equal_falls_and_their_plain_form_on_random_yards_in_every_form() {
        let random =
            "source: { random: { rms_height_m: { uniform: [0.05, 0.6] }, correlation_length_m: { uniform: [3, 8] } } }";
        let forms = "count: 3, depth_m: { uniform: [0.05, 1.5] }, width_m: { log_uniform: [0.15, 2] }, rounding_m: { log_uniform: [0.03, 0.4] }";
        let features = format!(
            "features: [{{ trench: {{ {forms} }} }}, {{ hole: {{ {forms} }} }}, {{ drop_off: {{ {forms} }} }}]"
        );
        let rough = "roughness: { rms_height_m: 0.01, correlation_length_m: 0.2, spacing_m: 0.05 }";
        let grounds = [
            format!("{random}, shape: {{ polynomial: {{ degree: 5 }} }}"),
            format!("{random}, shape: {{ polynomial: {{ degree: 9 }} }}"),
            format!("{random}, shape: {{ polynomial: {{ degree: 5 }} }}, {features}"),
            format!("{random}, shape: {{ polynomial: {{ degree: 5 }} }}, {rough}, {features}"),
            format!("source: flat, {features}"),
        ];
        let (mut deep, mut places) = (0, 0);
        for (kind, ground) in grounds.iter().enumerate() {
            let params: SceneParams =
                serde_saphyr::from_str(&format!("extent_m: 10\nground: {{ {ground}, max_slope_deg: 60 }}")).unwrap();
            for seed in 0..3 {
                let streams = Streams { seed, scene: kind as u64, attempt: 0, stage: Stage::Scene, step: 0 };
                let drawn = Drawn::draw(&streams, params.dists());
                let scene = crate::scene::build(&params, &drawn, &streams).unwrap();
                let falls = Falls::new(&scene);
                let mut at = [0.0; 2 * 300];
                streams.open(Purpose::GroundNoise).fill_uniform(0, &mut at);
                for place in at.chunks_exact(2) {
                    // Some lie beyond the yard's edge.
                    let here = DVec2::new(place[0], place[1]) * 10.4 - 0.2;
                    let expected = plain(&scene, here);
                    for fall in every_form(|| FallAt { falls: &falls, here }) {
                        let bits = |fall: Fall| [fall.lip_m, fall.pit_m].map(f64::to_bits);
                        assert_eq!(bits(fall), bits(expected), "{ground}, seed {seed}: {fall:?} {expected:?}");
                    }
                    deep += usize::from(expected.pit_m > 0.15);
                    places += 1;
                }
            }
        }
        assert!(deep > places / 50, "{deep} pits at {places} places");
    }
}
