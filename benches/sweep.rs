//! Rays a second: casting alone at the peers' yards, and whole sweeps with one beam effect after another. One thread, CPU time.
//!
//! `cargo bench --bench sweep`

mod shared;

use marsyard::geometry::DVec3;
use marsyard::random::Stage;
use marsyard::sweep::params::{Cast, SpacingParams};
use marsyard::sweep::{self, Caster};
use shared::paper::{prepared, replays};
use shared::{rate, yards};

fn main() {
    for yard in &yards::YARDS {
        let scene = yard.scene();
        let origin_m = yard.origin_m(&scene);
        let raster = Cast::Raster(SpacingParams { spacing_m: yard.mesh_m });
        for (ground, cast) in [("polynomial", &Cast::Exact), ("raster", &raster)] {
            let caster = Caster::new(&scene, cast);
            for sweep in yards::sweeps() {
                let mut hits = Vec::new();
                rate(&format!("{}, {}, {ground}", yard.name, sweep.name), "rays", sweep.dirs.len() as f64, || {
                    caster.from(origin_m, sweep.reach_m).cast(&sweep.dirs, &mut hits);
                });
            }
        }
    }
    let effects = [
        ("none", "{}"),
        ("range_noise", "{range_noise: {}}"),
        ("range_noise, gates", "{range_noise: {}, gates: {}}"),
        ("dropout", "{dropout: {}}"),
        ("intensity", "{intensity: {}}"),
        ("mixed_pixels", "{mixed_pixels: {sub_rays: 7}}"),
    ];
    for (k, (name, effects)) in effects.into_iter().enumerate() {
        let prepared = prepared("paper.yaml", &[&format!("sweep.effects={effects}"), "drive.contact=gauss_newton"]);
        let replay = replays(&prepared, 1).remove(0);
        let (params, pattern) = (&prepared.plan.family_of(0).sweep, prepared.pattern(0));
        let caster = Caster::new(&replay.scene, &params.cast);
        let streams = prepared.plan.streams(0, replay.attempts - 1, Stage::Sweep);
        let last = replay.drive.truth.last().expect("a drive has a start");
        let world_from_sensor = last.transform() * replay.rover_from_sensor;
        let beams = pattern.directions.len() as f64;
        if k == 0 {
            let dirs: Vec<DVec3> = pattern.directions.iter().map(|d| world_from_sensor.direction(*d)).collect();
            let (origin_m, reach_m, mut hits) =
                (world_from_sensor.translation_m, params.sensor.max_range_m, Vec::new());
            rate("the paper's first sweep, casting alone", "rays", beams, || {
                caster.from(origin_m, reach_m).cast(&dirs, &mut hits);
            });
        }
        let mut scratch = sweep::Scratch::default();
        rate(&format!("whole sweep, effects: {name}"), "rays", beams, || {
            let swept =
                sweep::sweep(params, pattern, &caster, &world_from_sensor, &replay.drawn, &streams, &mut scratch);
            scratch.reuse(swept.expect("a place where a sensor can be"));
        });
    }
}
