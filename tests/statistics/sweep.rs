//! The sweep's effects against their laws, through the front door, sensor by sensor.
//!
//! Each test turns draws into numbers that are uniform in (0, 1) if the law holds, and asks Kolmogorov and Smirnov; the critical
//! distance is 1.95 / sqrt(n) (0.1 %). Seeds are fixed, so a test either holds or does not.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use marsyard::config;
use marsyard::geometry::{DVec2, DVec3, Pose, Transform};
use marsyard::math;
use marsyard::preset::Preset;
use marsyard::random::{Dist, Drawn, Law, Purpose, Stage, Streams};
use marsyard::scene::params::HeightLaw;
use marsyard::scene::{Class, Convex, Ground, Patch, Polynomial, Scene, Shape, Volume};
use marsyard::sweep::params::{Cast, Dropout, Effects, Intensity, MixedPixels, RangeNoise};
use marsyard::sweep::{Caster, Pattern, Scratch, Sensor, Status, Sweep, SweepParams, sweep};

const SENSORS: [&str; 8] = ["urg-04lx", "utm-30lx", "lms111", "lms291", "vlp-16", "os1-64", "raster", "rosette"];

fn shipped(name: &str) -> Sensor {
    let path = format!("{}/configs/sensors/{name}.yaml", env!("CARGO_MANIFEST_DIR"));
    serde_saphyr::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// A sloping yard with blocks round its middle.
fn yard() -> Scene {
    let ground = Ground::Polynomial(Polynomial::plane(20.0, 0.0, DVec2::new(0.1, -0.05)));
    let mut scene = Scene::bare(20.0, ground);
    for k in 0..12 {
        let (s, c) = math::sin_cos(f64::from(k) * 0.53);
        let at = DVec3::new(10.0 + (2.0 + 0.4 * f64::from(k)) * c, 10.0 + (2.0 + 0.4 * f64::from(k)) * s, 0.0);
        let foot_m = scene.ground.height_m(at.x, at.y);
        let block = Convex::cuboid(at + DVec3::Z * foot_m, DVec3::new(0.3, 0.2, 0.35), f64::from(k));
        scene = scene.with_obstacle(Class::Box, Shape::Convex(block));
    }
    scene
}

fn eye(scene: &Scene) -> Transform {
    let height_m = scene.ground.height_m(10.0, 10.0) + 0.9;
    Pose { position_m: DVec3::new(10.0, 10.0, height_m), pitch_rad: 0.15, yaw_rad: 0.4, roll_rad: 0.05 }.transform()
}

fn run(scene: &Scene, sensor: &Sensor, effects: Effects, seed: u64, step: u32) -> Sweep {
    run_at(scene, sensor, effects, seed, step, &eye(scene))
}

fn run_at(scene: &Scene, sensor: &Sensor, effects: Effects, seed: u64, step: u32, eye: &Transform) -> Sweep {
    let params = SweepParams { sensor: Preset::Inline(Box::new(sensor.clone())), effects, ..SweepParams::default() };
    let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 };
    let drawn = Drawn::draw(&streams, params.dists());
    let pattern = Arc::new(Pattern::build(sensor).unwrap());
    let caster = Caster::new(scene, &Cast::Exact);
    let streams = streams.at_step(step);
    sweep(&params, &pattern, &caster, eye, &drawn, &streams, &mut Scratch::default()).unwrap()
}

/// Kolmogorov's and Smirnov's distance of a sample from the uniform law in (0, 1), in units of its critical value at 0.1 %.
fn ks(mut sample: Vec<f64>) -> f64 {
    assert!(sample.len() > 1000, "a sample of {} tells little", sample.len());
    sample.sort_unstable_by(f64::total_cmp);
    let n = sample.len() as f64;
    let gap = |(i, u): (usize, &f64)| (u - i as f64 / n).abs().max(((i + 1) as f64 / n - u).abs());
    sample.iter().enumerate().map(gap).fold(0.0, f64::max) * n.sqrt() / 1.95
}

fn normal_law(x: f64) -> f64 {
    0.5 * libm::erfc(-x / 2.0f64.sqrt())
}

#[test]
fn dist_range_noise_is_normal_with_the_stated_sigma_for_every_sensor() {
    let scene = yard();
    for name in SENSORS {
        let sensor = shipped(name);
        let clean = run(&scene, &sensor, Effects::default(), 1, 0);
        let effects = Effects { range_noise: Some(RangeNoise::default()), ..Effects::default() };
        let noisy = run(&scene, &sensor, effects, 1, 0);
        assert_eq!(clean.truth, noisy.truth);
        // Away from the greatest range, where the gate cuts the law.
        let far_m = sensor.max_range_m - 10.0 * (sensor.range_sigma_m + sensor.range_sigma_per_m * sensor.max_range_m);
        let errors = (0..clean.returns.status.len()).filter(|&slot| clean.returns.range_m[slot] < far_m).map(|slot| {
            let range_m = clean.returns.range_m[slot];
            normal_law(
                (noisy.returns.range_m[slot] - range_m) / (sensor.range_sigma_m + sensor.range_sigma_per_m * range_m),
            )
        });
        let distance = ks(errors.collect());
        assert!(distance < 1.0, "{name}: {distance}");
    }
}

#[test]
fn dist_range_noise_of_paper_yaml_is_the_datasheets_accuracy() {
    let sensor = shipped("urg-04lx");
    let mut errors = Vec::new();
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/paper.yaml");
    for family in config::load(&paper, &[]).expect("a plan").families {
        let noise = family.sweep.effects.range_noise.clone();
        for seed in 1..4 {
            let clean = run(&yard(), &sensor, Effects::default(), seed, 0);
            let noisy = run(&yard(), &sensor, Effects { range_noise: noise.clone(), ..Effects::default() }, seed, 0);
            let slots = (0..clean.returns.status.len()).filter(|&slot| clean.returns.range_m[slot] < 5.0);
            errors.extend(slots.map(|slot| {
                let range_m = clean.returns.range_m[slot];
                // 10 mm below a metre, 1 % of the range beyond.
                normal_law((noisy.returns.range_m[slot] - range_m) / if range_m < 1.0 { 0.01 } else { 0.01 * range_m })
            }));
        }
    }
    assert!(errors.len() > 50_000, "{}", errors.len());
    let distance = ks(errors);
    assert!(distance < 1.0, "{distance}");
}

#[test]
fn dist_oblique_noise_grows_with_the_tangent_of_incidence_up_to_82_degrees() {
    let scene = yard();
    let sensor = shipped("lms111");
    let clean = run(&scene, &sensor, Effects::default(), 2, 0);
    let (sigma_m, sigma_per_m) = (Some(0.001.into()), Some(0.0.into()));
    let noise = RangeNoise { sigma_m, sigma_per_m, incidence: true, ..RangeNoise::default() };
    let noisy = run(&scene, &sensor, Effects { range_noise: Some(noise), ..Effects::default() }, 2, 0);
    let up = DVec3::new(-0.1, 0.05, 1.0).normalize();
    let eye = eye(&scene);
    let ground = (0..clean.returns.status.len())
        .filter(|&slot| clean.truth[slot].object == -1 && clean.returns.range_m[slot] < 15.0);
    let errors = ground.map(|slot| {
        let cos = -up.dot(eye.direction(clean.returns.pattern.directions[slot]));
        let alpha_rad = math::acos(cos).min(82.0f64.to_radians());
        let sigma_m = 0.001 + clean.returns.range_m[slot] * 0.015 * math::tan(alpha_rad) / 4.0;
        normal_law((noisy.returns.range_m[slot] - clean.returns.range_m[slot]) / sigma_m)
    });
    let distance = ks(errors.collect());
    assert!(distance < 1.0, "{distance}");
}

#[test]
fn dist_dropout_follows_the_logistic_law_of_received_power() {
    let scene = yard();
    let dropout =
        Dropout { rate: 0.05.into(), ground_reflectance: 0.2.into(), object_reflectance: 0.2.into(), softness: 0.5 };
    for name in ["urg-04lx", "lms111", "os1-64"] {
        // A short reach brings the threshold into the yard.
        let sensor = Sensor { range_at_10_percent_m: 4.0, ..shipped(name) };
        let intensity = Intensity { ground_reflectance: 1.0.into(), object_reflectance: 1.0.into(), noise: 0.0.into() };
        let lit = run(&scene, &sensor, Effects { intensity: Some(intensity), ..Effects::default() }, 3, 0);
        let gains = lit.returns.intensity.as_ref().unwrap();
        let dim = run(&scene, &sensor, Effects { dropout: Some(dropout.clone()), ..Effects::default() }, 3, 0);
        // Ten bins of equal chance of a return; chi-square with 10 degrees of freedom, 0.1 %: 29.6.
        let mut bins = [(0.0, 0.0, 0.0); 10];
        for slot in (0..lit.returns.status.len()).filter(|&slot| lit.returns.status[slot] == Status::Hit) {
            let power = 0.2 / 0.1 * f64::from(gains[slot]) * 16.0;
            let chance = 0.95 / (1.0 + math::exp(-math::ln(power) / 0.5));
            let bin = &mut bins[((chance * 10.0) as usize).min(9)];
            bin.0 += chance;
            bin.1 += chance * (1.0 - chance);
            bin.2 += f64::from(u8::from(dim.returns.status[slot] == Status::Hit));
        }
        let filled = bins.iter().filter(|b| b.1 > 5.0);
        assert!(filled.clone().count() >= 6, "{name}: {bins:?}");
        let chi2: f64 = filled.map(|(expected, variance, kept)| (kept - expected) * (kept - expected) / variance).sum();
        assert!(chi2 < 29.6, "{name}: {chi2} {bins:?}");
    }
}

#[test]
fn dist_depths_in_bushes_are_exponential_along_every_chord() {
    for (name, extinction_per_m) in [("urg-04lx", 1.0), ("os1-64", 4.0), ("rosette", 15.0)] {
        let mut scene = yard();
        let bush = Volume {
            id: scene.obstacles.len() as i32,
            class: Class::Bush,
            centre_m: DVec3::new(11.6, 10.7, 1.2),
            semi_axes_m: DVec3::new(0.8, 0.8, 0.5),
            extinction_per_m,
            untraversable: true,
            protrusion_m: 1.0,
        };
        scene.volumes.push(bush);
        let sensor = shipped(name);
        let bare = run(&Scene { volumes: vec![], ..scene.clone() }, &sensor, Effects::default(), 4, 0);
        let eye = eye(&scene);
        let (mut depths, mut inside, mut expected, mut variance) = (Vec::new(), 0.0, 0.0, 0.0);
        for step in 0..4 {
            let leafy = run(&scene, &sensor, Effects::default(), 4, step);
            for (slot, d) in leafy.returns.pattern.directions.iter().enumerate() {
                // The chord by its textbook quadratic, cut at the solid hit.
                let (o, d) =
                    ((eye.translation_m - bush.centre_m) / bush.semi_axes_m, eye.direction(*d) / bush.semi_axes_m);
                let (a, b, c) = (d.dot(d), 2.0 * o.dot(d), o.dot(o) - 1.0);
                let root = b * b - 4.0 * a * c;
                if root <= 1e-9 || b > 0.0 {
                    continue;
                }
                let entry_m = (-b - root.sqrt()) / (2.0 * a);
                let chord_m = ((-b + root.sqrt()) / (2.0 * a)).min(bare.truth[slot].range_m) - entry_m;
                if chord_m <= 1e-9 {
                    assert_eq!(leafy.truth[slot], bare.truth[slot]);
                    continue;
                }
                let stopped = -math::exp_m1(-extinction_per_m * chord_m);
                expected += stopped;
                variance += stopped * (1.0 - stopped);
                if leafy.truth[slot].object == bush.id {
                    inside += 1.0;
                    let depth_m = leafy.truth[slot].range_m - entry_m;
                    assert!(depth_m > -1e-9 && depth_m < chord_m + 1e-9);
                    depths.push(-math::exp_m1(-extinction_per_m * depth_m) / stopped);
                } else {
                    assert_eq!(leafy.truth[slot], bare.truth[slot]);
                }
            }
        }
        let share = (inside - expected) / f64::sqrt(variance);
        assert!(share.abs() < 4.0, "{name}: {inside} returns from inside against {expected}, {share} sd");
        let distance = ks(depths);
        assert!(distance < 1.0, "{name}: {distance}");
    }
}

#[test]
fn dist_grass_on_a_slope_stands_half_normal_above_the_slope() {
    let mut scene = yard();
    scene.obstacles.clear();
    let patch = Patch {
        id: 0,
        class: Class::Grass,
        centre_m: DVec2::new(11.2, 10.4),
        radius_m: 1.0,
        sigma_m: 0.03,
        height_law: HeightLaw::HalfNormal,
        untraversable: false,
    };
    scene.patches.push(patch);
    let sensor = shipped("urg-04lx");
    let bare = run(&Scene { patches: vec![], ..scene.clone() }, &sensor, Effects::default(), 5, 0);
    let eye = eye(&scene);
    let mut heights = Vec::new();
    for step in 0..4 {
        let grass = run(&scene, &sensor, Effects::default(), 5, step);
        for slot in 0..grass.returns.status.len() {
            let at = |range_m: f64| eye.point(grass.returns.pattern.directions[slot] * range_m);
            let foot = at(bare.truth[slot].range_m).truncate();
            let in_patch = bare.truth[slot].object == -1 && foot.distance(patch.centre_m) <= patch.radius_m;
            assert_eq!(grass.truth[slot].object == 0, in_patch);
            if in_patch {
                let tip = at(grass.truth[slot].range_m);
                let height_m = tip.z - scene.ground.height_m(tip.x, tip.y);
                // Half a metre from the centre at most, the near edge cuts heights above 0.5 m * tan(depression) alone:
                // more than 5 sigma.
                if foot.distance(patch.centre_m) < 0.5 {
                    heights.push(libm::erf(height_m.max(0.0) / (0.03 * 2.0f64.sqrt())));
                }
            }
        }
    }
    let distance = ks(heights);
    assert!(distance < 1.0, "{distance}");
}

#[test]
fn dist_a_cell_of_grass_has_the_variance_that_its_law_says() {
    let ground = Ground::Polynomial(Polynomial::plane(20.0, 0.0, DVec2::ZERO));
    let sensor = shipped("urg-04lx");
    let at = Pose { position_m: DVec3::new(10.0, 10.0, 0.9), pitch_rad: 0.5, ..Pose::default() }.transform();
    // Variance over sigma^2: the paper's, and a half normal's 1 - 2 / pi.
    for (height_law, expected) in [(HeightLaw::Normal, 1.0), (HeightLaw::HalfNormal, 0.3634)] {
        let mut scene = Scene::bare(20.0, ground.clone());
        let centre_m = DVec2::new(10.0, 10.0);
        let (class, sigma_m) = (Class::Grass, 0.05);
        scene.patches.push(Patch { id: 0, class, centre_m, radius_m: 6.0, sigma_m, height_law, untraversable: false });
        let (mut squares_m2, mut freedom) = (0.0, 0.0);
        for seed in 0..5 {
            let swept = run_at(&scene, &sensor, Effects::default(), seed, 0, &at);
            let mut cells: BTreeMap<[i64; 2], Vec<f64>> = BTreeMap::new();
            for slot in 0..swept.returns.status.len() {
                let point_m = at.point(swept.returns.pattern.directions[slot] * swept.returns.range_m[slot]);
                // Nearer than 2 m a height moves a return by no more than its cell's neighbours.
                if point_m.truncate().distance(centre_m) < 2.0 {
                    let cell = (point_m.truncate() * 10.0).floor();
                    cells.entry([cell.x as i64, cell.y as i64]).or_default().push(point_m.z);
                }
            }
            for heights_m in cells.values() {
                let n = heights_m.len() as f64;
                let mean_m = heights_m.iter().sum::<f64>() / n;
                squares_m2 += heights_m.iter().map(|height_m| (height_m - mean_m) * (height_m - mean_m)).sum::<f64>();
                freedom += n - 1.0;
            }
        }
        let share = squares_m2 / freedom / (sigma_m * sigma_m);
        // Feet lie the denser the nearer they are, so that a cell's heights are a little skewed: 5 %.
        assert!(freedom > 20_000.0 && (share / expected - 1.0).abs() < 0.05, "{height_law:?}: {share} of {freedom}");
    }
}

#[test]
fn dist_intensity_noise_is_normal_and_object_reflectances_follow_their_law() {
    let scene = yard();
    let sensor = shipped("os1-64");
    let of = |noise: f64| {
        let intensity = Intensity {
            ground_reflectance: 0.4.into(),
            object_reflectance: Dist::Law(Law::Uniform([0.2, 0.8])),
            noise: noise.into(),
        };
        run(&scene, &sensor, Effects { intensity: Some(intensity), ..Effects::default() }, 6, 0)
    };
    let (clean, noisy) = (of(0.0), of(0.1));
    let (clean_i, noisy_i) = (clean.returns.intensity.as_ref().unwrap(), noisy.returns.intensity.as_ref().unwrap());
    let hits: Vec<usize> =
        (0..clean.returns.status.len()).filter(|&slot| clean.returns.status[slot] == Status::Hit).collect();
    // f32 rounding is 6e-8 of a noise of 0.1.
    let ratio = |slot: &usize| normal_law((f64::from(noisy_i[*slot]) / f64::from(clean_i[*slot]) - 1.0) / 0.1);
    let distance = ks(hits.iter().map(ratio).collect());
    assert!(distance < 1.0, "{distance}");
    // One reflectance an object: the stream's own draw.
    let stream =
        Streams { seed: 6, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 }.open(Purpose::SweepObjectReflectance);
    let eye = eye(&scene);
    let caster = Caster::new(&scene, &Cast::Exact);
    let mut seen = [false; 12];
    for &slot in hits.iter().filter(|&&slot| clean.truth[slot].object >= 0) {
        let (id, range_m) = (clean.truth[slot].object, clean.truth[slot].range_m);
        let d = eye.direction(clean.returns.pattern.directions[slot]);
        let cos = caster.normal_at(id, eye.translation_m + d * range_m).dot(d).abs();
        let rho = 0.2 + 0.6 * stream.uniform(id as u64);
        assert!((f64::from(clean_i[slot]) / (rho * cos / (range_m * range_m)) - 1.0).abs() < 1e-6);
        seen[id as usize] = true;
    }
    assert!(seen.iter().filter(|s| **s).count() >= 6);
}

#[test]
fn law_mixed_pixels_stand_at_jumps_alone_and_say_their_share() {
    let scene = yard();
    for name in SENSORS {
        let sensor = shipped(name);
        let clean = run(&scene, &sensor, Effects::default(), 7, 0);
        let pixels = MixedPixels { sub_rays: 19, only_at_jumps_m: 0.05 };
        let mixed = run(&scene, &sensor, Effects { mixed_pixels: Some(pixels), ..Effects::default() }, 7, 0);
        let shares = mixed.mixed.as_ref().unwrap();
        let touched = (0..shares.len()).filter(|&slot| shares[slot] > 0.0).count();
        assert!(touched > 20, "{name}: {touched} mixed pixels");
        for (slot, share) in shares.iter().enumerate() {
            assert!(share.is_nan() == (mixed.returns.status[slot] == Status::None), "{name} {slot}");
            assert!(share.is_nan() || (0.0..=0.95).contains(share));
        }
        let same = (0..shares.len())
            .filter(|&s| mixed.returns.range_m[s].to_bits() == clean.returns.range_m[s].to_bits())
            .count();
        assert!(same * 10 > shares.len() * 6, "{name}: {same} of {} untouched", shares.len());
    }
}
