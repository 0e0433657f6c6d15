//! Points and cells a second, from a kept sweep to its rows. One thread, CPU time.
//!
//! `cargo bench --bench cells`

mod shared;

use marsyard::cells::{self, WindowScan};
use shared::paper::{prepared, replays};
use shared::rate;

fn main() {
    for (what, sets) in [
        ("8 neighbours", &[][..]),
        ("24 neighbours", &["cells.neighbours=24"][..]),
        ("8 neighbours and the local height", &["cells.local_height={}"][..]),
        ("cells of 0.05 m", &["cells.size_m=0.05"][..]),
    ] {
        let sets: Vec<&str> = sets.iter().copied().chain(["drive.contact=gauss_newton"]).collect();
        let prepared = prepared("paper.yaml", &sets).keeping_points();
        let replay = replays(&prepared, 1).remove(0);
        let family = prepared.plan.family_of(0);
        let points = replay.scans[0].points.as_ref().expect("points are kept");
        let pose = replay.poses.iter().rfind(|pose| pose.scan_id.is_some()).expect("a sweep is kept");
        let scan = WindowScan {
            sweep: &points.sweep,
            estimate: &pose.estimate,
            map_from_sensor: points.map_from_sensor,
            world_from_sensor: pose.truth.transform() * replay.rover_from_sensor,
        };
        let mut scratch = cells::Scratch::default();
        let mut bin = || {
            cells::bin(
                &family.cells,
                &[scan],
                family.drive.rover.wheel_diameter_m,
                points.max_range_m,
                &replay.scene,
                &mut scratch,
            )
        };
        let made = bin();
        rate(&format!("{what}, by points"), "points", made.points_in as f64, || {
            bin();
        });
        rate(&format!("{what}, by cells"), "cells", made.rows.len() as f64, || {
            bin();
        });
    }
}
