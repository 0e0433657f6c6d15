//! The overhang rule in yards of the shipped mixture: cells under crowns lose their leaves, what stands on the ground stays.
//!
//! Expected: from the same sweeps binned without the rule, and from the true height of each point above the true ground.

use std::path::Path;

use marsyard::cells::Label;
use marsyard::config;
use marsyard::episode::{Prepared, Scratch, Unobserved, replay_scene};
use marsyard::scene::Class;

/// Needed by the Husky below its mast of 0.6 m.
const RULE: &str = "cells.overhang={}";
const NO_RULE: &str = "cells.overhang=null";
const MAST: &str = "sweep.mount.z_m=0.6";
const ABOVE_M: f64 = 0.8;

/// Of the untraversable cells of some classes: how many became passable, lost their row, and stayed.
#[derive(Clone, Copy, Debug, Default)]
struct Fates {
    passable: u64,
    gone: u64,
    stayed: u64,
    /// Cells that may be crossed with the rule and without, and those that only without it may.
    passable_as_before: u64,
    newly_barred: u64,
    /// Points higher than the rule's height, those of them that left, and those that left and are lower.
    high: u64,
    high_left: u64,
    low_left: u64,
}

/// One family of mixed.yaml, its first scenes with the rule and without.
fn fates(family: &str, scenes: u64, classes: &[Class]) -> Fates {
    let load = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
        let mut plan = config::load(Path::new("configs/mixed.yaml"), &sets).expect("a good config");
        plan.families.retain(|one| one.name == family);
        Prepared::new(plan).expect("patterns").keeping_points()
    };
    let (plain, ruled) = (load(&[MAST, NO_RULE]), load(&[MAST, RULE]));
    let mut scratch = Scratch::default();
    let mut fates = Fates::default();
    for scene in 0..scenes {
        let mut replayed = |prepared: &Prepared| replay_scene(prepared, scene, &mut scratch, &mut Unobserved);
        let (Ok(without), Ok(with)) = (replayed(&plain), replayed(&ruled)) else { continue };
        for (before, after) in without.scans.iter().zip(&with.scans) {
            for row in &before.cells.rows {
                let later =
                    after.cells.rows.iter().find(|later| later.index == row.index).and_then(|later| later.label);
                let was_barred = row.label == Some(Label::Untraversable);
                match later {
                    _ if was_barred && !row.truth.class.is_some_and(|class| classes.contains(&class)) => {}
                    Some(Label::Traversable) if was_barred => fates.passable += 1,
                    Some(Label::Untraversable) if was_barred => fates.stayed += 1,
                    None if was_barred => fates.gone += 1,
                    Some(Label::Traversable) => fates.passable_as_before += 1,
                    _ => fates.newly_barred += 1,
                }
            }
            let points = after.points.as_ref().expect("kept points");
            let pose = with.poses.iter().find(|pose| pose.scan_id == Some(after.scan_id)).expect("its pose");
            let world_from_sensor = pose.truth.transform() * with.rover_from_sensor;
            for (slot, truth) in points.sweep.truth.iter().enumerate() {
                let Some(place_m) = points.sweep.returns.point_sensor(slot) else { continue };
                if truth.class.is_some_and(|class| classes.contains(&class)) {
                    let world_m = world_from_sensor.point(place_m);
                    let is_high = world_m.z - with.scene.ground_below_m(world_m.x, world_m.y) > ABOVE_M;
                    fates.high += u64::from(is_high);
                    fates.high_left += u64::from(is_high && points.hanging[slot]);
                    fates.low_left += u64::from(!is_high && points.hanging[slot]);
                }
            }
        }
    }
    println!("{family}: {fates:?}");
    fates
}

#[test]
fn law_most_cells_under_crowns_of_an_orchard_are_free_and_none_that_was_free_is_barred() {
    let crowns = fates("orchard", 40, &[Class::Crown]);
    let barred = crowns.passable + crowns.gone + crowns.stayed;
    assert!(barred > 5000 && crowns.passable > 300, "{crowns:?}");
    assert!(crowns.stayed * 4 < barred, "more than a quarter of the crowns' cells stayed: {crowns:?}");
    assert!(crowns.high_left * 4 > crowns.high * 3 && crowns.low_left * 1000 < crowns.high_left, "{crowns:?}");
    assert!(crowns.newly_barred == 0 && crowns.passable_as_before > 10_000, "{crowns:?}");
}

#[test]
fn law_trunks_walls_crates_and_rocks_keep_their_feet() {
    // A trunk whose foot is hidden is met above the rule's height alone, and its cell keeps what else lies in it: hardly a point of
    // any trunk's foot leaves.
    for (family, classes, most_lost, most_passable) in [
        ("orchard", &[Class::Trunk][..], 0.15, 0.02),
        ("builders_yard", &[Class::Box, Class::Rock], 0.03, 0.005),
        ("embankments", &[Class::Box, Class::Rock], 0.03, 0.005),
        ("scrub", &[Class::Bush, Class::Rock], 0.03, 0.005),
    ] {
        let solid = fates(family, 25, classes);
        let (lost, barred) = (solid.passable + solid.gone, solid.passable + solid.gone + solid.stayed);
        assert!(barred > 300 && lost as f64 <= most_lost * barred as f64, "{family}: {solid:?}");
        assert!(solid.passable as f64 <= most_passable * barred as f64 + 2.0, "{family}: {solid:?}");
        assert!(solid.newly_barred == 0, "{family}: {solid:?}");
        assert!(family != "orchard" || solid.low_left * 500 <= solid.high_left, "{solid:?}");
    }
}
