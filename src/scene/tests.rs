//! These tests build whole yards and ask what holds of every yard: draws that no other kind moves, ids, heights, and a hash that sees every part.

use super::*;
use crate::random::Stage;

const YARD: &str = r"
extent_m: 20
ground: {source: {random: {rms_height_m: {uniform: [0.05, 0.3]}, correlation_length_m: {uniform: [6, 10]}}}}
rocks: {count: {uniform: [5, 40]}, diameter_m: {log_uniform: [0.1, 0.8]}}
boxes: {count: {uniform: [1, 5]}, length_m: {uniform: [0.2, 4]}, width_m: 0.3, height_m: {uniform: [0.2, 1]}}
trees:
  count: {uniform: [1, 5]}
  diameter_m: {uniform: [0.1, 0.5]}
  height_m: {uniform: [2, 5]}
  crown: {diameter_m: {uniform: [1, 3]}, extinction_per_m: {uniform: [1, 15]}}
vegetation:
  grass: {count: {uniform: [1, 5]}, radius_m: {uniform: [0.5, 3]}, sigma_m: {uniform: [0.02, 0.1]}}
  brush: {count: {uniform: [1, 5]}, radius_m: {uniform: [0.5, 3]}, sigma_m: {uniform: [0.02, 0.1]}}
  bushes: {count: {uniform: [1, 5]}, diameter_m: {uniform: [0.5, 2]}, height_m: 0.8, extinction_per_m: 4}
";

fn streams(scene: u64) -> Streams {
    Streams { seed: 21, scene, attempt: 0, stage: Stage::Scene, step: 0 }
}

fn yard(params: &SceneParams, scene: u64) -> Scene {
    let drawn = Drawn::draw(&streams(scene), params.dists());
    build(params, &drawn, &streams(scene)).unwrap()
}

/// What is there of one kind, without the ids, which may shift.
fn kind(scene: &Scene, class: Class) -> Vec<String> {
    let obstacles = scene.obstacles.iter().filter(|o| o.class == class);
    let volumes = scene.volumes.iter().filter(|v| v.class == class);
    let patches = scene.patches.iter().filter(|p| p.class == class);
    obstacles
        .map(|o| format!("{:?}", Obstacle { id: 0, ..o.clone() }))
        .chain(volumes.map(|v| format!("{:?}", Volume { id: 0, ..*v })))
        .chain(patches.map(|p| format!("{:?}", Patch { id: 0, ..*p })))
        .collect()
}

#[test]
fn equal_draws_of_a_kind_whichever_others_are_on() {
    let full: SceneParams = serde_saphyr::from_str(YARD).unwrap();
    let classes = [Class::Rock, Class::Box, Class::Trunk, Class::Crown, Class::Grass, Class::Bush];
    for scene in 0..8 {
        let all = yard(&full, scene);
        assert!(classes.iter().all(|class| !kind(&all, *class).is_empty()));
        // Every set of the four families, and each part of the vegetation alone.
        for set in 0..16_u32 {
            let on = |bit: u32| set & (1 << bit) != 0;
            let mut some = full.clone();
            some.rocks = some.rocks.filter(|_| on(0));
            some.boxes = some.boxes.filter(|_| on(1));
            some.trees = some.trees.filter(|_| on(2));
            some.vegetation = some.vegetation.filter(|_| on(3));
            let part = yard(&some, scene);
            for (class, on) in classes.into_iter().zip([on(0), on(1), on(2), on(2), on(3), on(3)]) {
                let expected = if on { kind(&all, class) } else { Vec::new() };
                assert_eq!(kind(&part, class), expected, "{class:?} with families {set:04b}");
            }
            assert_eq!(part.ground.height_m(3.3, 4.4).to_bits(), all.ground.height_m(3.3, 4.4).to_bits());
        }
        let mut grassless = full.clone();
        grassless.vegetation.as_mut().unwrap().grass = None;
        assert_eq!(kind(&yard(&grassless, scene), Class::Bush), kind(&all, Class::Bush));
        let mut crownless = full.clone();
        crownless.trees.as_mut().unwrap().crown = None;
        assert_eq!(kind(&yard(&crownless, scene), Class::Trunk), kind(&all, Class::Trunk));
    }
}

#[test]
fn law_ids_run_through_obstacles_volumes_and_patches() {
    let scene = yard(&serde_saphyr::from_str(YARD).unwrap(), 0);
    let total = scene.obstacles.len() + scene.volumes.len() + scene.patches.len();
    for id in 0..total as i32 {
        let found = match scene.object(id).unwrap() {
            Object::Obstacle(obstacle) => obstacle.id,
            Object::Volume(volume) => volume.id,
            Object::Patch(patch) => patch.id,
        };
        assert_eq!(found, id);
    }
    assert!(scene.object(total as i32).is_none() && scene.object(-1).is_none());
}

#[test]
fn law_things_stand_in_the_ground_at_their_height() {
    let params: SceneParams = serde_saphyr::from_str(YARD).unwrap();
    for scene in 0..8 {
        let yard = yard(&params, scene);
        for obstacle in &yard.obstacles {
            assert!((0.0..=20.0).contains(&obstacle.body().centre_m.x) || obstacle.class == Class::Rock);
            match &obstacle.body().shape {
                Shape::Convex(body) if obstacle.class == Class::Box => {
                    assert_eq!((body.planes.len(), body.vertices_m.len()), (6, 8));
                    let low = body.vertices_m.iter().fold(f64::MAX, |low, v| low.min(v.z));
                    let bottom = body.vertices_m.iter().filter(|v| v.z < low + 1e-9);
                    assert!(bottom.clone().count() == 4);
                    bottom.for_each(|v| assert!(v.z <= yard.ground_below_m(v.x, v.y) + 1e-12));
                    assert!(obstacle.body().protrusion_m >= 0.2 - 1e-9);
                }
                Shape::Cylinder(trunk) => {
                    let ground = yard.ground_below_m(trunk.base_m.x, trunk.base_m.y);
                    let height = trunk.base_m.z + trunk.height_m - ground;
                    assert!(trunk.base_m.z <= ground && (2.0..=5.0 + 1e-9).contains(&height));
                    assert!(obstacle.body().protrusion_m >= height - 1e-12);
                }
                Shape::Convex(_) => {}
            }
        }
        for volume in &yard.volumes {
            let ground = yard.ground_below_m(volume.centre_m.x, volume.centre_m.y);
            assert!((volume.centre_m.z + volume.semi_axes_m.z - ground - volume.protrusion_m).abs() < 1e-12);
            assert!(volume.untraversable);
        }
        assert!(yard.patches.iter().all(|patch| patch.untraversable == (patch.class == Class::Bush)));
    }
}

#[test]
fn law_the_stage_hash_sees_every_part() {
    let digest = |scene: &Scene| {
        let mut hasher = blake3::Hasher::new();
        scene.hash_into(&mut hasher);
        hasher.finalize()
    };
    let scene = yard(&serde_saphyr::from_str(YARD).unwrap(), 0);
    assert_eq!(digest(&scene), digest(&yard(&serde_saphyr::from_str(YARD).unwrap(), 0)));
    let changes: [fn(&mut Scene); 5] = [
        |s| {
            let Obstacle { id, class, .. } = s.obstacles[1];
            let protrusion_m = s.obstacles[1].body().protrusion_m + 1e-16;
            s.obstacles[1] = Obstacle::new(id, class, Body { protrusion_m, ..s.obstacles[1].body().clone() });
        },
        |s| s.volumes[0].extinction_per_m += 1e-15,
        |s| s.patches[0].untraversable = !s.patches[0].untraversable,
        |s| _ = s.obstacles.pop(),
        |s| s.extent_m = 21.0,
    ];
    for change in changes {
        let mut other = scene.clone();
        change(&mut other);
        assert_ne!(digest(&scene), digest(&other));
    }
}

#[test]
fn golden_stage_hash() {
    let mut hasher = blake3::Hasher::new();
    yard(&serde_saphyr::from_str(YARD).unwrap(), 0).hash_into(&mut hasher);
    insta::assert_snapshot!(hasher.finalize().to_hex().to_string());
}
