//! Yards a second: drawn and built, and made ready to be cast at. One thread, CPU time.
//!
//! `cargo bench --bench scene`

mod shared;

use marsyard::random::{Drawn, Stage};
use marsyard::scene::{self, Ground, Raster, Scene};
use marsyard::sweep::Caster;
use marsyard::sweep::params::Cast;
use shared::paper::prepared;
use shared::{rate, yards::YARDS};

fn main() {
    for config in ["quickstart.yaml", "paper.yaml", "mars.yaml"] {
        let prepared = prepared(config, &[]);
        let mut scene_id = 0;
        rate(&format!("build, {config}"), "yards", 1.0, || {
            let params = &prepared.plan.family_of(scene_id).scene;
            let streams = prepared.plan.streams(scene_id, 0, Stage::Scene);
            let drawn = Drawn::draw(&streams, params.dists());
            std::hint::black_box(scene::build(params, &drawn, &streams).is_ok());
            scene_id = (scene_id + 1) % prepared.plan.scenes;
        });
    }
    for yard in &YARDS {
        let scene = yard.scene();
        rate(&format!("ready to cast, {} polynomial", yard.name), "yards", 1.0, || {
            std::hint::black_box(Caster::new(&scene, &Cast::Exact).scene());
        });
        let raster = Raster::sampled(yard.extent_m, yard.mesh_m, |x, y| scene.ground.height_m(x, y));
        let raw = Scene { ground: Ground::Raster(raster), ..scene };
        rate(&format!("ready to cast, {} raster at {} m", yard.name, yard.mesh_m), "yards", 1.0, || {
            std::hint::black_box(Caster::new(&raw, &Cast::Exact).scene());
        });
    }
}
