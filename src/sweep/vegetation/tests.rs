use super::*;
use crate::random::{Law, Purpose};
use crate::scene::Class;
use crate::sweep::fixtures::{flat_yard, streams};
use crate::sweep::params::Cast;

const EYE: DVec3 = DVec3::new(10.0, 10.0, 1.0);

fn bush(id: i32, centre_m: DVec3, semi_axes_m: DVec3, extinction_per_m: f64) -> Volume {
    Volume { id, class: Class::Bush, centre_m, semi_axes_m, extinction_per_m, untraversable: true, protrusion_m: 1.0 }
}

fn two_streams(seed: u64) -> [Stream; 2] {
    [streams(seed).open(Purpose::SweepPatch), streams(seed).open(Purpose::SweepVolume)]
}

/// Returns of many rays, block by block, that had solid hits at `solid`.
fn scattered(scene: &Scene, directions: &[DVec3], solid: TrueReturn, seed: u64) -> Vec<TrueReturn> {
    let caster = Caster::new(scene, &Cast::Exact);
    let mut vegetation = Vegetation::default();
    vegetation.reach(scene, EYE, 30.0);
    let mut returns = vec![solid; directions.len()];
    let streams = two_streams(seed);
    for (k, (directions, returns)) in directions.chunks(BLOCK).zip(returns.chunks_mut(BLOCK)).enumerate() {
        let rays = Rays { origin_m: EYE, directions, draws: Draws::From((k * BLOCK) as u64) };
        vegetation.scatter(&caster, &rays, &streams, returns);
    }
    returns
}

/// Greatest distance of the sorted values' distribution from a law (Kolmogorov-Smirnov).
fn ks_distance(mut values: Vec<f64>, law: impl Fn(f64) -> f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len() as f64;
    let gap = |(i, v): (usize, &f64)| (law(*v) - i as f64 / n).abs().max((law(*v) - (i + 1) as f64 / n).abs());
    values.iter().enumerate().map(gap).fold(0.0, f64::max)
}

#[test]
fn exact_crossings_of_a_ball_and_an_ellipsoid() {
    let ball = bush(0, EYE + DVec3::X * 5.0, DVec3::splat(2.0), 1.0);
    assert_eq!(crossing(&ball, EYE, DVec3::X), Some((3.0, 7.0)));
    assert_eq!(crossing(&ball, EYE, -DVec3::X), None);
    assert_eq!(crossing(&ball, EYE, DVec3::Z), None);
    // Chord at an angle: half-length sqrt(r^2 - (d sin a)^2).
    let (s, c) = math::sin_cos(0.3);
    let (entry_m, exit_m) = crossing(&ball, EYE, DVec3::new(c, s, 0.0)).unwrap();
    assert!((0.5 * (exit_m - entry_m) - (4.0 - 25.0 * s * s).sqrt()).abs() < 1e-14);
    let flat = bush(0, EYE + DVec3::X * 5.0, DVec3::new(1.0, 2.0, 0.5), 1.0);
    assert_eq!(crossing(&flat, EYE, DVec3::X), Some((4.0, 6.0)));
    assert_eq!(crossing(&flat, EYE + DVec3::X * 5.0, DVec3::Z), Some((0.0, 0.5)));
}

#[test]
fn dist_free_paths_follow_the_exponential_law_cut_at_the_far_side() {
    // A ball of 2 m across, extinction 1.5 per metre: 1 - exp(-3) of the rays return inside.
    let mut scene = flat_yard();
    scene.volumes.push(bush(0, EYE + DVec3::X * 4.0, DVec3::splat(1.0), 1.5));
    let rays = vec![DVec3::X; 20_000];
    let returns =
        scattered(&scene, &rays, TrueReturn { range_m: 9.0, object: 5, class: Some(Class::Rock), top: false }, 3);
    let inside: Vec<f64> = returns.iter().filter(|r| r.object == 0).map(|r| r.range_m - 3.0).collect();
    let share = inside.len() as f64 / 20_000.0;
    let expected = 1.0 - math::exp(-3.0);
    // Four binomial standard errors.
    assert!((share - expected).abs() < 4.0 * (expected * (1.0 - expected) / 20_000.0).sqrt(), "{share}");
    assert!(inside.iter().all(|depth| (0.0..2.0).contains(depth)));
    // KS critical value at 0.1 %: 1.95 / sqrt(n).
    let bound = 1.95 / (inside.len() as f64).sqrt();
    let distance = ks_distance(inside, |depth| (1.0 - math::exp(-1.5 * depth)) / expected);
    assert!(distance < bound, "{distance} against {bound}");
    assert!(returns.iter().all(|r| r.object == 0 || (r.range_m, r.object) == (9.0, 5)));
}

#[test]
fn exact_optical_depth_is_spent_over_gaps_and_overlaps() {
    let mut vegetation = Vegetation::default();
    for (k, extinction_per_m) in [1.0, 4.0, 2.0].into_iter().enumerate() {
        let volume = bush(k as i32, DVec3::ZERO, DVec3::ONE, extinction_per_m);
        vegetation.volumes.push(NearVolume { volume, toward: DVec3::X, cone: None });
    }
    // [1, 3] of 1 per metre overlaps [2, 4] of 4 per metre; then a gap; then [5, 6] of 2 per metre.
    vegetation.spans = vec![(1.0, 3.0, 0), (2.0, 4.0, 1), (5.0, 6.0, 2)];
    let mut at = |depth| vegetation.turning_point(depth);
    assert_eq!(at(0.5), Some((1.5, 0)));
    assert_eq!(at(1.0 + 2.5), Some((2.5, 1)));
    assert_eq!(at(1.0 + 5.0 + 2.0), Some((3.5, 1)));
    assert_eq!(at(1.0 + 5.0 + 4.0 + 1.0), Some((5.5, 2)));
    assert_eq!(at(1.0 + 5.0 + 4.0 + 2.1), None);
}

#[test]
fn equal_dismissing_blocks_by_their_cones_changes_no_return() {
    let stream = streams(9).open(Purpose::SweepTilt);
    let number = Law::Uniform([-1.0, 1.0]);
    let number = |i: u64| crate::random::Dist::Law(number.clone()).at(&stream, i);
    let mut scene = flat_yard();
    for k in 0..12u64 {
        let at = EYE + DVec3::new(8.0 * number(3 * k), 8.0 * number(3 * k + 1), number(3 * k + 2));
        scene.volumes.push(bush(k as i32, at, DVec3::new(0.3, 0.5, 0.9), 3.0));
    }
    let rays: Vec<DVec3> = (0..6400)
        .map(|i| {
            let (s, c) = math::sin_cos(f64::from(i) * 0.002);
            DVec3::new(c, s, 0.1 * math::sin(f64::from(i) * 0.01)).normalize()
        })
        .collect();
    let fast = scattered(&scene, &rays, TrueReturn::NOTHING, 4);
    // Every ray in a block of its own kind: no cone, all volumes.
    let mut vegetation = Vegetation::default();
    vegetation.reach(&scene, EYE, 30.0);
    vegetation.volumes.iter_mut().for_each(|near| near.cone = None);
    let mut slow = vec![TrueReturn::NOTHING; rays.len()];
    for (i, ret) in slow.iter_mut().enumerate() {
        let ray = Rays { origin_m: EYE, directions: &rays[i..=i], draws: Draws::From(i as u64) };
        vegetation.scatter_volumes(&ray, &two_streams(4)[1], std::slice::from_mut(ret));
    }
    assert_eq!(fast, slow);
    let inside = fast.iter().filter(|r| r.is_hit()).count();
    assert!((300..6000).contains(&inside), "{inside} of 6400 rays return from bushes");
}

/// Grass of 1.5 m around a place 2 m ahead of the eye.
fn grassy_yard(sigma_m: f64, height_law: HeightLaw) -> Scene {
    let mut scene = flat_yard();
    let centre_m = DVec2::new(12.0, 10.0);
    let class = Class::Grass;
    scene.patches.push(Patch { id: 0, class, centre_m, radius_m: 1.5, sigma_m, height_law, untraversable: false });
    scene
}

/// A ray to the ground 2.5 m ahead, and its return from there.
fn foot_ahead() -> (DVec3, TrueReturn) {
    let range_m = (2.5f64 * 2.5 + 1.0).sqrt();
    let solid = TrueReturn { range_m, object: Hit::GROUND, class: Some(Class::Ground), top: false };
    (DVec3::new(2.5, 0.0, -1.0).normalize(), solid)
}

#[test]
fn exact_where_patches_overlap_a_return_is_of_the_one_that_makes_the_label() {
    let patch = |id: i32, untraversable: bool| {
        let class = if untraversable { Class::Bush } else { Class::Grass };
        Patch { id, class, untraversable, ..grassy_yard(0.05, HeightLaw::HalfNormal).patches[0] }
    };
    let (direction, solid) = foot_ahead();
    for (patches, expected) in [
        (vec![patch(0, false), patch(1, true)], (1, Class::Bush)),
        (vec![patch(0, true), patch(1, false)], (0, Class::Bush)),
        (vec![patch(0, false), patch(1, false)], (0, Class::Grass)),
        (vec![patch(0, true), patch(1, true)], (0, Class::Bush)),
    ] {
        let scene = Scene { patches, ..flat_yard() };
        let returns = scattered(&scene, &[direction; 40], solid, 5);
        assert!(returns.iter().all(|ret| (ret.object, ret.class) == (expected.0, Some(expected.1))), "{returns:?}");
    }
}

#[test]
fn dist_grass_stands_above_the_ground_with_half_normal_heights() {
    let scene = grassy_yard(0.1, HeightLaw::HalfNormal);
    // The foot lies 2.5 m ahead, 2 m inside the patch: no height within reach of 7 sigma meets its edge.
    let (ray, solid) = foot_ahead();
    let returns = scattered(&scene, &vec![ray; 20_000], solid, 6);
    assert!(returns.iter().all(|r| (r.object, r.class) == (0, Some(Class::Grass))));
    let heights: Vec<f64> = returns.iter().map(|r| EYE.z + r.range_m * ray.z).collect();
    assert!(heights.iter().all(|h| (-1e-15..0.8).contains(h)));
    let distance = ks_distance(heights, |h| libm::erf(h.max(0.0) / (0.1 * 2.0f64.sqrt())));
    assert!(distance < 1.95 / 20_000.0f64.sqrt(), "{distance}");
}

#[test]
fn dist_grass_of_the_paper_scatters_about_the_ground_with_normal_heights() {
    let mut scene = grassy_yard(0.05, HeightLaw::Normal);
    // The foot lies 2.5 m ahead, a metre from the far edge: 0.4 m of height, 8 sigma, keep clear of it.
    let (ray, solid) = foot_ahead();
    let n = 20_000.0;
    for seed in 0..5 {
        let returns = scattered(&scene, &vec![ray; 20_000], solid, seed);
        let shares: Vec<f64> = returns.iter().map(|r| (EYE.z + r.range_m * ray.z) / 0.05).collect();
        let power = |share: &f64, k: usize| std::iter::repeat_n(*share, k).product::<f64>();
        let moment = |k: usize| shares.iter().map(|share| power(share, k)).sum::<f64>() / n;
        // Five standard errors of each moment of a standard normal: its variance is E x^2k less the square of E x^k.
        for (k, expected, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let bound = 5.0 * f64::sqrt(variance / n);
            assert!((moment(k) - expected).abs() < bound, "seed {seed}, moment {k}: {}", moment(k));
        }
        let distance = ks_distance(shares, |share| 0.5 + 0.5 * libm::erf(share / 2.0f64.sqrt()));
        assert!(distance < 1.95 / n.sqrt(), "{distance}");
    }
    // The same draws as above the ground: only the sign is new.
    let about = scattered(&scene, &vec![ray; 64], solid, 6);
    scene.patches[0].height_law = HeightLaw::HalfNormal;
    for (about, above) in about.iter().zip(scattered(&scene, &vec![ray; 64], solid, 6)) {
        let [about_m, above_m] = [about.range_m, above.range_m].map(|range_m| solid.range_m - range_m);
        assert!((about_m.abs() - above_m).abs() < 1e-12 && above_m >= 0.0, "{about_m} {above_m}");
    }
    // Heights of metres: every return stays between the edges of its patch, which a ray along x crosses at 0.5 and 3.5 m.
    scene.patches[0] = Patch { sigma_m: 50.0, height_law: HeightLaw::Normal, ..scene.patches[0] };
    let wild = scattered(&scene, &vec![ray; 64], solid, 2);
    let feet_m: Vec<f64> = wild.iter().map(|r| r.range_m * ray.x).collect();
    assert!(feet_m.iter().all(|foot_m| (0.5 - 1e-9..=3.5 + 1e-9).contains(foot_m)), "{feet_m:?}");
    assert!([0.5, 3.5].iter().all(|end_m| feet_m.iter().any(|foot_m| (foot_m - end_m).abs() < 1e-9)));
}

#[test]
fn law_grass_takes_each_return_of_a_fan_and_none_beside_the_patch() {
    let mut scene = flat_yard();
    let centre_m = DVec2::new(12.5, 10.0);
    scene.patches.push(Patch {
        id: 0,
        class: Class::Grass,
        centre_m,
        radius_m: 1.0,
        sigma_m: 0.1,
        height_law: HeightLaw::HalfNormal,
        untraversable: false,
    });
    // Feet all round the sensor, 2.5 m away: those within a metre of the point straight ahead are in the grass.
    let azimuths: Vec<f64> = (0..1000).map(|k| std::f64::consts::TAU * (f64::from(k) + 0.5) / 1000.0).collect();
    let level = |azimuth: &f64| 2.5 * DVec2::new(math::cos(*azimuth), math::sin(*azimuth));
    let rays: Vec<DVec3> = azimuths.iter().map(|azimuth| level(azimuth).extend(-1.0).normalize()).collect();
    let range_m = (2.5f64 * 2.5 + 1.0).sqrt();
    let solid = TrueReturn { range_m, object: Hit::GROUND, class: Some(Class::Ground), top: false };
    for (azimuth, ret) in azimuths.iter().zip(scattered(&scene, &rays, solid, 7)) {
        let in_grass = (EYE.truncate() + level(azimuth)).distance(centre_m) < 1.0;
        assert_eq!(ret.object, if in_grass { 0 } else { Hit::GROUND }, "{azimuth}");
        assert!(if in_grass { ret.range_m < range_m } else { ret == solid }, "{azimuth}: {ret:?}");
    }
}

#[test]
fn exact_grass_ends_at_the_near_edge_of_its_patch_and_keeps_to_the_slope() {
    let patch = |sigma_m| Patch {
        id: 0,
        class: Class::Grass,
        centre_m: DVec2::new(14.0, 10.0),
        radius_m: 1.0,
        sigma_m,
        height_law: HeightLaw::HalfNormal,
        untraversable: false,
    };
    let ends = |x_m, direction| ends_in_disc(&patch(1.0), DVec2::new(x_m, 10.0), direction);
    assert!(ends(10.0, DVec2::X).into_iter().zip([3.0, 5.0]).all(|(end_m, at_m)| (end_m - at_m).abs() < 1e-14));
    assert_eq!([14.5, 13.5].map(|x_m| ends(x_m, DVec2::X)), [[0.0, 0.5], [0.0, 1.5]]);
    assert_eq!(ends(14.5, DVec2::ZERO), [0.0, f64::INFINITY]);
    let ray = DVec3::new(4.5, 0.0, -1.0).normalize();
    let range_m = (4.5f64 * 4.5 + 1.0).sqrt();
    let solid = TrueReturn { range_m, object: Hit::GROUND, class: Some(Class::Ground), top: false };
    let mut scene = flat_yard();
    scene.patches.push(patch(50.0));
    // Heights of metres: every return comes off the near edge, 3 m ahead, or off a blade between.
    let edge_m = range_m * 3.0 / 4.5;
    let tall = scattered(&scene, &vec![ray; 64], solid, 2);
    assert!(tall.iter().all(|r| r.range_m >= edge_m - 1e-12 && r.range_m <= range_m));
    assert!(tall.iter().any(|r| (r.range_m - edge_m).abs() < 1e-12));
    scene.patches[0] = patch(0.0);
    let none = scattered(&scene, &vec![ray; 64], solid, 2);
    assert!(none.iter().all(|r| r.range_m == range_m && r.object == 0), "no height leaves every range as it was");
}

#[test]
fn extreme_endless_extinction_returns_at_the_surface_and_grazing_rays_stay_finite() {
    let mut scene = flat_yard();
    scene.volumes.push(bush(0, EYE + DVec3::X * 4.0, DVec3::splat(1.0), 1e12));
    let (s, c) = math::sin_cos(math::asin(0.25) - 1e-12);
    let rays = [DVec3::X, DVec3::new(c, s, 0.0), DVec3::new(c, -s, 0.0)];
    for ret in scattered(&scene, &rays, TrueReturn::NOTHING, 1) {
        assert!(ret.range_m.is_finite() && (3.0..4.0).contains(&ret.range_m), "{ret:?}");
    }
    // The sensor in the middle of the bush.
    scene.volumes[0].centre_m = EYE;
    let ret = scattered(&scene, &rays[..1], TrueReturn::NOTHING, 1)[0];
    assert!(ret.range_m >= 0.0 && ret.range_m < 1e-9 && ret.object == 0);
}
