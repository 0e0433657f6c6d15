//! What the tests of this stage share: shipped sensors, flat yards, addresses.

use crate::random::{Stage, Streams};
use crate::scene::{Ground, Polynomial, Scene};
use crate::sweep::Sensor;

pub(super) const SHIPPED: [(&str, &str); 8] = [
    ("urg-04lx", include_str!("../../configs/sensors/urg-04lx.yaml")),
    ("utm-30lx", include_str!("../../configs/sensors/utm-30lx.yaml")),
    ("lms111", include_str!("../../configs/sensors/lms111.yaml")),
    ("lms291", include_str!("../../configs/sensors/lms291.yaml")),
    ("vlp-16", include_str!("../../configs/sensors/vlp-16.yaml")),
    ("os1-64", include_str!("../../configs/sensors/os1-64.yaml")),
    ("raster", include_str!("../../configs/sensors/raster.yaml")),
    ("rosette", include_str!("../../configs/sensors/rosette.yaml")),
];

/// A shipped sensor by name.
pub(super) fn shipped(name: &str) -> Sensor {
    let (_, text) = SHIPPED.iter().find(|(shipped, _)| *shipped == name).expect("a shipped sensor");
    serde_saphyr::from_str(text).expect("a sensor")
}

pub(super) fn streams(seed: u64) -> Streams {
    Streams { seed, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 }
}

/// 20 m of ground at height 0.
pub(super) fn flat_yard() -> Scene {
    Scene::bare(20.0, Ground::Polynomial(Polynomial::flat(20.0)))
}
