//! Scenes of a shipped config, prepared for the benches of single stages.

use std::path::Path;

use marsyard::config;
use marsyard::episode::{Prepared, Replay, Scratch, Unobserved, replay_scene};

/// A config of `configs/`, with overrides.
pub fn prepared(name: &str, sets: &[&str]) -> Prepared {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    let plan = config::load(&path, &sets).unwrap_or_else(|error| panic!("{error}"));
    Prepared::new(plan).unwrap_or_else(|error| panic!("{error}"))
}

/// The first scenes that can be made.
pub fn replays(prepared: &Prepared, count: usize) -> Vec<Replay> {
    let mut scratch = Scratch::default();
    (0..).filter_map(|scene| replay_scene(prepared, scene, &mut scratch, &mut Unobserved).ok()).take(count).collect()
}
