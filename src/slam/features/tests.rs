//! Sweeps of yards whose rocks are known, and sweeps of nothing sensible.

use super::*;
use crate::geometry::DVec2;
use crate::scene::{Class, Cylinder, Ground, Polynomial, Scene, Shape};
use crate::sweep::params::Cast;
use crate::sweep::sensor::{PatternParams, RosetteParams, SpinningParams, TiltedParams};
use crate::sweep::{Caster, Hit, Sensor};

const SENSOR: &str = include_str!("../../../configs/sensors/urg-04lx.yaml");

fn pattern_of(pattern: PatternParams) -> Arc<Pattern> {
    let urg: Sensor = serde_saphyr::from_str(SENSOR).expect("a sensor");
    Arc::new(Pattern::build(&Sensor { pattern, ..urg }).expect("a pattern"))
}

/// The URG's view at half its density: enough for rocks of a few decimetres, and quick in debug builds.
pub(in crate::slam) fn tilted() -> Arc<Pattern> {
    pattern_of(PatternParams::Tilted(TiltedParams {
        beams: 341,
        beam_step_deg: 0.703,
        first_beam_deg: None,
        tilt_from_deg: -45.0,
        tilt_to_deg: 4.5,
        tilt_step_deg: 0.75,
        line_time_s: 0.1,
    }))
}

pub(in crate::slam) fn mount() -> Transform {
    Transform { translation_m: DVec3::new(0.3, 0.0, 0.6), ..Transform::IDENTITY }
}

/// A noise-free sweep up to 5.6 m.
pub(in crate::slam) fn scan(scene: &Scene, pattern: &Arc<Pattern>, pose: &Pose) -> Returns {
    let caster = Caster::new(scene, &Cast::Exact);
    let world_from_sensor = pose.transform() * mount();
    let hits: Vec<Hit> = pattern
        .directions
        .iter()
        .map(|d| caster.first_hit(world_from_sensor.translation_m, world_from_sensor.direction(*d), 5.6))
        .collect();
    let status = |h: &Hit| if h.range_m.is_finite() { Status::Hit } else { Status::None };
    Returns {
        pattern: pattern.clone(),
        status: hits.iter().map(status).collect(),
        range_m: hits.iter().map(|h| if h.range_m.is_finite() { h.range_m } else { f64::NAN }).collect(),
        intensity: None,
    }
}

/// A plane with upright posts: place, radius, top above the ground.
pub(in crate::slam) fn yard(slope: DVec2, posts: &[(DVec2, f64, f64)]) -> Scene {
    let ground = Polynomial::plane(20.0, 0.0, slope);
    let height_m = |at: DVec2| slope.dot(at);
    let scene = Scene::bare(20.0, Ground::Polynomial(ground));
    posts.iter().fold(scene, |scene, &(at, radius_m, top_m)| {
        let base_m = at.extend(height_m(at) - 0.3);
        scene.with_obstacle(Class::Trunk, Shape::Cylinder(Cylinder { base_m, radius_m, height_m: 0.3 + top_m }))
    })
}

/// Standing level at (10, 10), heading `yaw_rad`.
fn pose(yaw_rad: f64) -> Pose {
    Pose { position_m: DVec3::new(10.0, 10.0, 0.0), yaw_rad, ..Pose::default() }
}

/// The features of a sweep, in the world.
fn found(returns: &Returns, pose: &Pose, believed: &Pose) -> Vec<DVec3> {
    let mut extractor = Extractor::new(3.75, &mount());
    let features = extractor.extract(returns, believed.roll_rad, believed.pitch_rad).features;
    let world_from_sensor = pose.transform() * mount();
    features
        .iter()
        .map(|f| {
            let ((sb, cb), (se, ce)) = (math::sin_cos(f.polar[1]), math::sin_cos(f.polar[2]));
            world_from_sensor.point(f.polar[0] * DVec3::new(ce * cb, ce * sb, se))
        })
        .collect()
}

#[test]
fn exact_posts_are_found_where_they_stand_from_every_side() {
    let posts = [
        (DVec2::new(12.5, 10.3), 0.1, 0.25),
        (DVec2::new(11.8, 11.5), 0.15, 0.25),
        (DVec2::new(11.6, 8.6), 0.12, 0.25),
    ];
    let scene = yard(DVec2::ZERO, &posts);
    let pattern = tilted();
    for yaw_rad in [-0.2, 0.0, 0.2] {
        let pose = pose(yaw_rad);
        let found = found(&scan(&scene, &pattern, &pose), &pose, &pose);
        assert_eq!(found.len(), 3, "{found:?}");
        for (at, radius_m, top_m) in posts {
            let nearest = found.iter().min_by(|a, b| a.truncate().distance(at).total_cmp(&b.truncate().distance(at)));
            let off = nearest.expect("three").truncate() - at;
            // The push is fitted on polyhedra; a cylinder's own share, 2 / pi, is within it by a tenth of a radius.
            assert!(off.length() < 0.15 * radius_m + 0.015, "{off}");
            assert!((nearest.expect("three").z - top_m).abs() < 0.03);
        }
    }
}

#[test]
fn law_bare_slopes_have_no_features() {
    for slope in [DVec2::ZERO, DVec2::new(0.25, -0.15)] {
        let scene = yard(slope, &[]);
        let mut pose = pose(0.7);
        let (s, c) = math::sin_cos(pose.yaw_rad);
        pose.position_m.z = slope.dot(DVec2::new(10.0, 10.0));
        pose.pitch_rad = -math::atan(slope.dot(DVec2::new(c, s)));
        pose.roll_rad = math::atan(slope.dot(DVec2::new(-s, c)));
        let found = found(&scan(&scene, &tilted(), &pose), &pose, &pose);
        assert!(found.is_empty(), "{found:?}");
    }
}

#[test]
fn law_a_tilted_rover_that_knows_its_tilt_finds_the_same_posts() {
    let posts = [(DVec2::new(12.3, 10.3), 0.12, 0.25), (DVec2::new(11.3, 11.6), 0.15, 0.25)];
    let scene = yard(DVec2::ZERO, &posts);
    let tilted_pose = Pose { roll_rad: 0.08, pitch_rad: 0.06, ..pose(0.4) };
    let found = found(&scan(&scene, &tilted(), &tilted_pose), &tilted_pose, &tilted_pose);
    assert_eq!(found.len(), 2, "{found:?}");
    for (at, ..) in posts {
        assert!(found.iter().any(|f| f.truncate().distance(at) < 0.04), "{found:?}");
    }
}

#[test]
fn law_a_post_half_hidden_by_a_nearer_one_is_no_feature() {
    // Seen from the sensor at (10.3, 10) the far post peeps out beside the near one.
    let (near, far) = ((DVec2::new(11.6, 10.0), 0.12, 0.8), (DVec2::new(13.2, 10.2), 0.25, 0.4));
    let pattern = tilted();
    let count = |posts: &[(DVec2, f64, f64)]| {
        let pose = pose(0.0);
        found(&scan(&yard(DVec2::ZERO, posts), &pattern, &pose), &pose, &pose).len()
    };
    assert_eq!(count(&[near]), 1);
    assert_eq!(count(&[far]), 1);
    assert_eq!(count(&[near, far]), 1);
}

#[test]
fn extreme_sweeps_of_nothing_and_of_nonsense() {
    let pattern = tilted();
    let n = pattern.directions.len();
    let mut extractor = Extractor::new(3.75, &mount());
    for (range_m, status) in [
        (f64::NAN, Status::None),
        (f64::NAN, Status::Hit),
        (f64::INFINITY, Status::Hit),
        (0.0, Status::Hit),
        (-1.0, Status::Hit),
        (1e300, Status::Hit),
        (1.0, Status::Hit),
        (1.0, Status::Dropped),
        (2.0, Status::OutOfRange),
    ] {
        let sweep =
            Returns { pattern: pattern.clone(), range_m: vec![range_m; n], status: vec![status; n], intensity: None };
        let features = extractor.extract(&sweep, 0.1, -0.1).features;
        assert!(features.iter().all(|f| f.polar.iter().all(|v| v.is_finite())), "{range_m} {status:?}");
        // A bowl of a metre all round is the only one of them that holds points.
        assert!(features.is_empty() || (range_m, status) == (1.0, Status::Hit), "{range_m} {status:?}");
    }
}

#[test]
fn extreme_other_patterns_give_features_or_none_but_no_panic() {
    let spinning = SpinningParams {
        elevations_deg: (0..16).map(|i| -15.0 + 2.0 * f64::from(i)).collect(),
        columns: 600,
        turn_time_s: 0.1,
    };
    let rosette = RosetteParams {
        field_deg: 70.0,
        centre_elevation_deg: -20.0,
        first_rpm: 7294.0,
        second_rpm: -4664.0,
        rate_hz: 100_000.0,
        beams: 12_000,
    };
    let scene = yard(DVec2::ZERO, &[(DVec2::new(12.5, 10.0), 0.2, 0.25), (DVec2::new(8.0, 11.0), 0.2, 0.25)]);
    let mut counts = Vec::new();
    for pattern in [PatternParams::Spinning(spinning), PatternParams::Rosette(rosette)] {
        let (pattern, pose) = (pattern_of(pattern), pose(0.0));
        let found = found(&scan(&scene, &pattern, &pose), &pose, &pose);
        for place in &found {
            assert!(
                scene.obstacles.iter().any(|o| o.body().centre_m.truncate().distance(place.truncate()) < 0.3),
                "{place}"
            );
        }
        counts.push(found.len());
    }
    assert!(counts[1] >= 1, "the rosette looks straight at a post: {counts:?}");
}

/// What the extractor takes of a slot, by the definition: its cell.
fn cell_of(grid: &GroundGrid, returns: &Returns, level: &DMat3, slot: usize, limit_m: f64) -> u32 {
    let (range_m, beams) = (returns.range_m[slot], returns.pattern.beams as usize);
    let beam = slot % beams;
    let jumps = |other: usize| returns.range_m.get(other).is_some_and(|&r| (range_m - r).abs() > JUMP_M);
    let alone = beam > 0 && beam + 1 < beams && jumps(slot - 1) && jumps(slot + 1);
    let mut cells = [grid.nowhere()];
    if returns.status[slot] == Status::Hit && range_m > 0.0 && range_m <= limit_m && !alone {
        let place_m = *level * (returns.pattern.directions[slot] * range_m);
        grid.place(&[place_m.x], &[place_m.y], &[true], &mut cells);
    }
    cells[0]
}

#[test]
fn equal_points_are_taken_slot_by_slot_and_by_blocks() {
    let level = Pose { roll_rad: 0.1, pitch_rad: -0.05, ..Pose::default() }.rotation();
    for (lines, beams) in [(1, 1), (3, 5), (7, 63), (4, 64), (5, 65), (2, 682), (130, 1), (1, 700)] {
        let slots = (lines * beams) as usize;
        let number = |slot: usize, step: f64| (step * (slot + 1) as f64).fract();
        let directions = (0..slots).map(|slot| {
            let (s, c) = math::sin_cos(6.0 * number(slot, 0.618_034));
            DVec3::new(c, s, -0.3 * number(slot, 0.414_214)).normalize()
        });
        let pattern = Pattern { lines, beams, directions: directions.collect(), times_s: Vec::new() };
        let mut returns = Returns {
            pattern: Arc::new(pattern),
            // Few steps, so that neighbours jump and do not.
            range_m: (0..slots).map(|slot| 2.0 + 0.25 * (7.0 * number(slot, 0.732_051)).floor()).collect(),
            status: vec![Status::Hit; slots],
            intensity: None,
        };
        for slot in 0..slots {
            match slot % 23 {
                3 => returns.range_m[slot] = f64::NAN,
                5 => returns.status[slot] = Status::None,
                8 => returns.status[slot] = Status::Dropped,
                13 => returns.status[slot] = Status::OutOfRange,
                17 => returns.range_m[slot] = -1.0,
                19 => returns.range_m[slot] = f64::INFINITY,
                _ => {}
            }
        }
        let mut extractor = Extractor::new(2.5, &mount());
        extractor.gather(&returns, &level);
        let limit_m = 2.5 + MARGIN_M;
        let expected = (0..slots).map(|slot| cell_of(&extractor.grid, &returns, &level, slot, limit_m));
        let taken: Vec<u32> = extractor.cells.iter().flatten().copied().collect();
        assert!(taken[slots..].iter().all(|&cell| cell == extractor.grid.nowhere()));
        assert!(slots < 3 || taken.iter().any(|&cell| cell != extractor.grid.nowhere()));
        assert!(expected.eq(taken[..slots].iter().copied()), "{lines} lines of {beams}");
    }
}
