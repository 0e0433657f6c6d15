use super::*;
use crate::geometry::DVec2;
use crate::random::{Dist, Law, Stage};
use crate::scene::{Ground, Polynomial, SceneParams};

fn streams(scene: u64) -> Streams {
    Streams { seed: 8, scene, attempt: 0, stage: Stage::Scene, step: 0 }
}

fn params(count: f64, diameter_m: f64) -> RocksParams {
    let yaml = format!("{{count: {count}, diameter_m: {diameter_m}}}");
    serde_saphyr::from_str(&yaml).unwrap()
}

fn on_slope(params: &RocksParams, slope: f64, scene: u64) -> Scene {
    let ground = Ground::Polynomial(Polynomial::plane(20.0, 1.0, DVec2::new(slope, 0.0)));
    let mut yard = Scene::bare(20.0, ground);
    let config = SceneParams {
        extent_m: 20.0,
        ground: Default::default(),
        rocks: Some(params.clone()),
        boxes: None,
        trees: None,
        vegetation: None,
    };
    let drawn = Drawn::draw(&streams(scene), config.dists());
    build(params, &drawn, &streams(scene), &mut yard).unwrap();
    yard
}

fn body(scene: &Scene, k: usize) -> &Convex {
    let Shape::Convex(body) = &scene.obstacles[k].body().shape else { panic!("a rock is a polyhedron") };
    body
}

#[test]
fn law_rocks_are_closed_convex_bodies_of_8_to_40_faces_and_the_drawn_size() {
    let mut params = params(300.0, 0.5);
    params.tilt_deg = 0.0.into();
    params.elongation = 1.0.into();
    params.aspect = 0.8.into();
    let scene = on_slope(&params, 0.1, 0);
    assert_eq!(scene.obstacles.len(), 300);
    let mut seen = [false; 41];
    for k in 0..300 {
        let (rock, obstacle) = (body(&scene, k), &scene.obstacles[k]);
        assert!((8..=40).contains(&rock.planes.len()), "{} faces", rock.planes.len());
        seen[rock.planes.len()] = true;
        // Untilted: the full height is that of the ellipsoid, 0.8 x 0.5 m.
        let (low, high) = rock.vertices_m.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v.z), h.max(v.z)));
        assert!((high - low - 0.4).abs() < 1e-12);
        assert!(rock.volume_m3() > 0.1 * 0.4 * 0.25 && rock.volume_m3() < 0.4 * 0.25);
        for v in &rock.vertices_m {
            assert!(rock.depth_m(*v) < 1e-9 && v.distance(obstacle.body().centre_m) <= obstacle.body().radius_m);
        }
        assert!(rock.contains(rock.vertices_m.iter().sum::<DVec3>() / rock.vertices_m.len() as f64));
    }
    assert!(seen[8] && seen[40], "no rock of 8 or none of 40 faces among 300");
}

#[test]
fn dist_rocks_are_half_buried_on_average() {
    let scene = on_slope(&params(2000.0, 0.4), 0.0, 1);
    let above: f64 = (0..2000)
        .map(|k| {
            let (low, high) =
                body(&scene, k).vertices_m.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v.z), h.max(v.z)));
            (high - 1.0) / (high - low)
        })
        .sum();
    // The offset is uniform in +-0.3 semi-axes: the share above has mean 1/2 and sd 0.09; 4 standard errors.
    assert!((above / 2000.0 - 0.5).abs() < 0.008, "{}", above / 2000.0);
}

#[test]
fn law_rocks_rise_to_the_least_height_and_stay_in_the_ground() {
    for (diameter_m, slope) in [(0.05, 0.0), (0.15, 0.3), (0.3, 0.45), (1.0, 0.0)] {
        let mut params = params(100.0, diameter_m);
        params.min_height_m = Some(0.12);
        let scene = on_slope(&params, slope, 2);
        for (k, obstacle) in scene.obstacles.iter().enumerate() {
            assert!(obstacle.body().protrusion_m >= 0.12, "{}", obstacle.body().protrusion_m);
            let vertices_m = &body(&scene, k).vertices_m;
            let depth = vertices_m.iter().map(|v| v.z - scene.ground_below_m(v.x, v.y)).fold(f64::MAX, f64::min);
            assert!(depth < 0.0, "the rock hovers {depth} m above the ground");
        }
    }
}

#[test]
fn law_no_rock_leaves_the_disc_that_is_known_before_it_is_made() {
    let mut wild = params(200.0, 0.3);
    wild.diameter_m = Some(Dist::Law(Law::LogUniform([0.01, 3.0])));
    wild.tilt_deg = Dist::Law(Law::Uniform([0.0, 90.0]));
    wild.aspect = Dist::Law(Law::Choice(vec![0.05, 5.0]));
    wild.elongation = Dist::Law(Law::Uniform([1.0, 10.0]));
    let mut widest = 0.0_f64;
    for (params, scene) in [(&params(200.0, 0.5), 6), (&wild, 7)] {
        let scene = on_slope(params, 0.3, scene);
        assert!(scene.obstacles.iter().all(|rock| !rock.has_body()), "made before anything asked");
        for (k, rock) in scene.obstacles.iter().enumerate() {
            for v in &body(&scene, k).vertices_m {
                let off_m = v.truncate().distance(rock.middle_m);
                assert!(off_m <= rock.within_m, "rock {k}: {off_m} m of {}", rock.within_m);
                widest = widest.max(off_m / rock.within_m);
                assert!(!rock.is_beyond(v.truncate(), 0.0));
            }
        }
    }
    assert!(widest > 0.5, "the disc is needlessly wide: rocks fill {widest} of it");
}

#[test]
fn equal_rocks_whatever_comes_after_them() {
    let (few, many) = (on_slope(&params(7.0, 0.4), 0.1, 3), on_slope(&params(30.0, 0.4), 0.1, 3));
    for k in 0..7 {
        assert_eq!(body(&few, k), body(&many, k));
    }
}

#[test]
fn dist_golombek_yards_hold_the_expected_rocks() {
    let mut params = params(0.0, 1.0);
    (params.count, params.diameter_m) = (None, None);
    let law = GolombekParams { abundance: 0.1.into(), min_diameter_m: 0.2, max_diameter_m: 3.0 };
    params.golombek = Some(law);
    let (mut total, mut large) = (0, 0);
    for scene in 0..50 {
        let drawn = Drawn::draw(&streams(scene), [(Purpose::RockAbundance, &Dist::from(0.1))]);
        let (count, sizes) = sizes(&params, 20.0, &drawn, &streams(scene)).unwrap();
        let diameters_m: Vec<f64> = (0..count as u64).map(|rock| sizes.diameter_m(rock)).collect();
        assert!(diameters_m.iter().all(|d| (0.2..=3.0).contains(d)));
        total += diameters_m.len();
        large += diameters_m.iter().filter(|d| **d >= 0.5).count();
    }
    // 50 yards of 400 m^2: 200 x (52.61, 4.993) rocks per 100 m^2; Poisson, 4 standard deviations.
    assert!((total as f64 - 10_522.0).abs() < 4.0 * 102.6, "{total}");
    assert!((large as f64 - 998.7).abs() < 4.0 * 31.6, "{large}");
}

#[test]
fn extreme_rocks_small_large_many_and_none() {
    assert!(on_slope(&params(0.0, 1.0), 0.0, 4).obstacles.is_empty());
    for diameter_m in [1e-3, 1e4] {
        let scene = on_slope(&params(20.0, diameter_m), 0.1, 4);
        for k in 0..20 {
            assert!(body(&scene, k).planes.len() >= 8 && scene.obstacles[k].body().protrusion_m.is_finite());
        }
    }
    let mut wild = params(50.0, 0.3);
    wild.tilt_deg = Dist::Law(Law::Uniform([0.0, 90.0]));
    wild.aspect = Dist::Law(Law::Choice(vec![0.05, 5.0]));
    wild.elongation = 10.0.into();
    let scene = on_slope(&wild, 0.4, 5);
    for k in 0..50 {
        let rock = body(&scene, k);
        assert!((8..=40).contains(&rock.planes.len()));
        assert!(rock.vertices_m.iter().all(|v| rock.depth_m(*v) < 1e-9));
    }
    let mut crowded = params(0.0, 1.0);
    crowded.golombek = Some(GolombekParams { abundance: 0.6.into(), min_diameter_m: 0.01, max_diameter_m: 3.0 });
    let drawn = Drawn::draw(&streams(0), [(Purpose::RockAbundance, &Dist::from(0.6))]);
    let refused = sizes(&crowded, 1000.0, &drawn, &streams(0));
    assert!(matches!(refused, Err(SceneError::TooManyRocks { .. })));
}
