//! Whole sweeps against paper answers and against each other.

use super::*;
use crate::geometry::{DVec2, Pose};
use crate::preset::Preset;
use crate::random::Dist;
use crate::scene::params::HeightLaw;
use crate::scene::{Class, Convex, Patch, Shape, Volume};
use crate::sweep::Sensor;
use crate::sweep::fixtures::{flat_yard, shipped, streams};
use crate::sweep::footprint;
use crate::sweep::params::{
    Cast, Dropout, Effects, Gates, Intensity, MixedPixels, MountParams, Quantisation, RangeNoise,
};
use crate::sweep::sensor::{PatternFile, PatternParams, PhaseRanging, Ranging};

const EYE: DVec3 = DVec3::new(10.0, 10.0, 0.8);

fn params(sensor: Sensor, effects: Effects) -> SweepParams {
    SweepParams { sensor: Preset::Inline(Box::new(sensor)), effects, ..SweepParams::default() }
}

/// A sensor with beams of one's own (azimuth, elevation in degrees), all on one line.
fn listed(beams: &[(f64, f64)]) -> Sensor {
    let beams = beams.iter().map(|(azimuth, elevation)| [0.0, *azimuth, *elevation]).collect();
    Sensor { pattern: PatternParams::File(PatternFile { path: "beams.csv".into(), beams }), ..shipped("urg-04lx") }
}

fn run_at(scene: &Scene, params: &SweepParams, streams: &Streams, pose: &Transform) -> Result<Sweep, SweepError> {
    let pattern = Arc::new(Pattern::build(&params.sensor).unwrap());
    let caster = Caster::new(scene, &Cast::Exact);
    let drawn = Drawn::draw(&Streams { step: 0, ..*streams }, params.dists());
    sweep(params, &pattern, &caster, pose, &drawn, streams, &mut Scratch::default())
}

fn run(scene: &Scene, sensor: &Sensor, effects: Effects) -> Sweep {
    let pose = Transform { translation_m: EYE, ..Transform::IDENTITY };
    run_at(scene, &params(sensor.clone(), effects), &streams(7), &pose).unwrap()
}

fn block(centre_m: DVec3, half_m: DVec3) -> Shape {
    Shape::Convex(Convex::cuboid(centre_m, half_m, 0.0))
}

/// A yard with something of everything round the sensor.
fn full_yard() -> Scene {
    let mut scene = flat_yard()
        .with_obstacle(Class::Box, block(DVec3::new(11.5, 10.2, 0.2), DVec3::new(0.2, 0.3, 0.4)))
        .with_obstacle(Class::Box, block(DVec3::new(12.0, 9.0, 0.3), DVec3::new(0.1, 0.2, 0.6)));
    scene.volumes.push(Volume {
        id: 2,
        class: Class::Bush,
        centre_m: DVec3::new(11.5, 11.5, 0.4),
        semi_axes_m: DVec3::splat(0.5),
        extinction_per_m: 3.0,
        untraversable: true,
        protrusion_m: 0.9,
    });
    scene.patches.push(Patch {
        id: 3,
        class: Class::Grass,
        centre_m: DVec2::new(11.5, 9.0),
        radius_m: 0.8,
        sigma_m: 0.05,
        height_law: HeightLaw::HalfNormal,
        untraversable: false,
    });
    scene
}

fn noise() -> Option<RangeNoise> {
    Some(RangeNoise { incidence: true, ..RangeNoise::default() })
}

#[test]
fn exact_flat_ground_lies_at_height_over_sine_of_depression() {
    let sensor = shipped("urg-04lx");
    let sweep = run(&flat_yard(), &sensor, Effects::default());
    assert_eq!(sweep.returns.range_m.len(), 68_200);
    let mut hits = 0;
    for (slot, d) in sweep.returns.pattern.directions.iter().enumerate() {
        let range_m = if d.z < 0.0 { EYE.z / -d.z } else { f64::INFINITY };
        if range_m <= 5.6 {
            hits += 1;
            assert_eq!(
                (sweep.returns.status[slot], sweep.truth[slot].object, sweep.truth[slot].class),
                (Status::Hit, -1, Some(Class::Ground))
            );
            assert!((sweep.returns.range_m[slot] - range_m).abs() < 1e-9, "{slot}: {}", sweep.returns.range_m[slot]);
            assert!((sweep.returns.point_sensor(slot).unwrap().z + EYE.z).abs() < 1e-9);
            assert!(!sweep.truth[slot].top);
        } else if range_m > 5.600_001 {
            assert_eq!(
                (sweep.returns.status[slot], sweep.truth[slot].object, sweep.truth[slot].class),
                (Status::None, -2, None)
            );
            assert!(sweep.returns.range_m[slot].is_nan() && sweep.truth[slot].range_m == f64::INFINITY);
            assert!(sweep.returns.point_sensor(slot).is_none());
        }
    }
    assert!(hits > 25_000, "{hits}");
    assert!(sweep.returns.intensity.is_none() && sweep.mixed.is_none());
}

#[test]
fn exact_a_pitched_and_turned_sensor_meets_the_ground_where_its_beam_points() {
    let pose = Pose { position_m: EYE, pitch_rad: 0.3, yaw_rad: 2.0, roll_rad: 0.1 }.transform();
    let sweep = run_at(&flat_yard(), &params(shipped("vlp-16"), Effects::default()), &streams(1), &pose).unwrap();
    for (slot, d) in
        sweep.returns.pattern.directions.iter().enumerate().filter(|(slot, _)| sweep.truth[*slot].object == -1)
    {
        let down = -(pose.direction(*d)).z;
        assert!((sweep.returns.range_m[slot] * down - EYE.z).abs() < 1e-9);
    }
    assert!(sweep.returns.status.iter().filter(|s| **s == Status::Hit).count() > 1000);
}

#[test]
fn equal_effects_of_size_zero_reproduce_the_clean_sweep() {
    let sensor = Sensor { divergence_mrad: 0.0, exit_diameter_m: 0.0, ..shipped("urg-04lx") };
    let zero = || Some(Dist::Constant(0.0));
    let nothing = Effects {
        range_noise: Some(RangeNoise {
            sigma_m: zero(),
            sigma_per_m: zero(),
            incidence: true,
            ..RangeNoise::default()
        }),
        range_bias_m: zero(),
        gates: Some(Gates { min_m: Some(0.0), max_m: None }),
        dropout: Some(Dropout {
            ground_reflectance: 1.0.into(),
            object_reflectance: 1.0.into(),
            softness: 1e-3,
            ..Dropout::default()
        }),
        mixed_pixels: Some(MixedPixels { sub_rays: 19, only_at_jumps_m: 0.0 }),
        tilt_jitter_deg: zero(),
        intensity: Some(Intensity { noise: 0.0.into(), ..Intensity::default() }),
        quantisation: None,
    };
    let bright = Sensor { range_at_10_percent_m: 10_000.0, ..sensor.clone() };
    // Bushes and grass would draw anew for each sub-ray: solid things only.
    let scene = Scene { volumes: vec![], patches: vec![], ..full_yard() };
    let clean = run(&scene, &sensor, Effects::default());
    let same = run(&scene, &bright, nothing);
    assert_eq!(clean.returns.status, same.returns.status);
    assert_eq!(clean.truth, same.truth);
    assert!(clean.returns.range_m.iter().zip(&same.returns.range_m).all(|(a, b)| a.to_bits() == b.to_bits()));
    assert!(same.mixed.unwrap().iter().all(|share| *share == 0.0 || share.is_nan()));
}

#[test]
fn law_switching_an_effect_moves_no_other_draw() {
    let sensor = Sensor { range_at_10_percent_m: 1000.0, ..shipped("urg-04lx") };
    let scene = full_yard();
    let all = Effects {
        range_noise: noise(),
        range_bias_m: Some(0.02.into()),
        quantisation: None,
        gates: None,
        dropout: Some(Dropout { rate: 0.2.into(), softness: 0.01, ..Dropout::default() }),
        mixed_pixels: Some(MixedPixels { sub_rays: 1, only_at_jumps_m: 0.0 }),
        tilt_jitter_deg: Some(0.05.into()),
        intensity: Some(Intensity { noise: 0.1.into(), ..Intensity::default() }),
    };
    let full = run(&scene, &sensor, all.clone());
    let off: [(&str, Effects); 6] = [
        ("noise", Effects { range_noise: None, ..all.clone() }),
        ("bias", Effects { range_bias_m: None, ..all.clone() }),
        ("gates", Effects { gates: Some(Gates::default()), ..all.clone() }),
        ("dropout", Effects { dropout: None, ..all.clone() }),
        ("mixed", Effects { mixed_pixels: None, ..all.clone() }),
        ("intensity", Effects { intensity: None, ..all.clone() }),
    ];
    for (name, effects) in off {
        let less = run(&scene, &sensor, effects);
        // Jitter, grass and bushes: the truth tells their draws.
        assert_eq!(full.truth, less.truth, "{name}");
        let both =
            |slot: &usize| full.returns.status[*slot] == Status::Hit && less.returns.status[*slot] == Status::Hit;
        let shared: Vec<usize> = (0..full.returns.status.len()).filter(both).collect();
        assert!(shared.len() > 20_000);
        if name != "dropout" {
            let dropped = |s: &Sweep| s.returns.status.iter().map(|s| *s == Status::Dropped).collect::<Vec<_>>();
            assert_eq!(dropped(&full), dropped(&less), "{name}");
        }
        if let (Some(a), Some(b)) = (&full.returns.intensity, &less.returns.intensity) {
            assert!(shared.iter().all(|&slot| a[slot].to_bits() == b[slot].to_bits()), "{name}");
        }
        let differs_m = |slot: usize| full.returns.range_m[slot] - less.returns.range_m[slot];
        match name {
            "noise" => {}
            "bias" => {
                let bias_m = differs_m(shared[0]);
                assert!(bias_m != 0.0 && shared.iter().all(|&slot| (differs_m(slot) - bias_m).abs() < 1e-14));
            }
            _ => assert!(shared.iter().all(|&slot| differs_m(slot) == 0.0), "{name}"),
        }
    }
    // Without jitter the light goes elsewhere, but dropout, noise and intensity draw as before.
    let steady = run(&scene, &sensor, Effects { tilt_jitter_deg: None, ..all.clone() });
    let jitter_alone = Effects { tilt_jitter_deg: Some(0.0.into()), ..all };
    let still = run(&scene, &sensor, jitter_alone);
    assert_eq!(steady.returns.status, still.returns.status);
    assert!(steady.returns.range_m.iter().zip(&still.returns.range_m).all(|(a, b)| a.to_bits() == b.to_bits()));
}

#[test]
fn law_vegetation_and_sub_rays_move_no_draw_of_the_beams_beside_them() {
    let sensor = shipped("urg-04lx");
    let effects = Effects { range_noise: noise(), ..Effects::default() };
    let scene = full_yard();
    let with = run(&scene, &sensor, effects.clone());
    let without = run(&Scene { volumes: vec![], patches: vec![], ..scene.clone() }, &sensor, effects.clone());
    let green = |t: &TrueReturn| t.class >= Some(Class::Grass);
    assert!(with.truth.iter().filter(|t| green(t)).count() > 500);
    for slot in (0..with.truth.len()).filter(|&slot| !green(&with.truth[slot])) {
        assert_eq!(with.truth[slot], without.truth[slot]);
        assert_eq!(with.returns.range_m[slot].to_bits(), without.returns.range_m[slot].to_bits());
    }
    let pixels = Some(MixedPixels { sub_rays: 7, only_at_jumps_m: 0.05 });
    let mixed = run(&scene, &sensor, Effects { mixed_pixels: pixels, ..effects });
    let alike = (0..with.truth.len())
        .filter(|&slot| mixed.returns.range_m[slot].to_bits() == with.returns.range_m[slot].to_bits())
        .count();
    assert!(alike > 55_000 && alike < 68_200, "{alike} of 68,200 slots lie away from jumps");
}

#[test]
fn dist_range_noise_has_its_moments_and_the_bias_is_one_number_a_sweep() {
    let sensor = shipped("lms111");
    let clean = run(&flat_yard(), &sensor, Effects::default());
    let noisy = run(&flat_yard(), &sensor, Effects { range_noise: Some(RangeNoise::default()), ..Effects::default() });
    let errors: Vec<f64> = (0..clean.returns.status.len())
        .filter(|&slot| noisy.returns.status[slot] == Status::Hit && clean.returns.range_m[slot] < 19.0)
        .map(|slot| (noisy.returns.range_m[slot] - clean.returns.range_m[slot]) / 0.012)
        .collect();
    let n = errors.len() as f64;
    assert!(n > 10_000.0);
    let moment = |k: i32| errors.iter().map(|e| (0..k).fold(1.0, |p, _| p * e)).sum::<f64>() / n;
    // Standard errors of mean, variance and fourth moment of n normal draws, times 4.
    assert!(moment(1).abs() < 4.0 / n.sqrt());
    assert!((moment(2) - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
    assert!((moment(4) - 3.0).abs() < 4.0 * (96.0 / n).sqrt());

    let biased = |step| {
        let effects = Effects { range_bias_m: Some(0.05.into()), ..Effects::default() };
        let pose = Transform { translation_m: EYE, ..Transform::IDENTITY };
        let at = streams(7).at_step(step);
        let sweep = run_at(&flat_yard(), &params(listed(&[(0.0, -30.0), (5.0, -60.0)]), effects), &at, &pose).unwrap();
        [0, 1].map(|slot| sweep.returns.range_m[slot] - sweep.truth[slot].range_m)
    };
    let (first, second) = (biased(0), biased(1));
    assert!((first[0] - first[1]).abs() < 1e-15 && first[0] != second[0]);
    let biases: Vec<f64> = (0..500).map(|step| biased(step)[0] / 0.05).collect();
    let variance = biases.iter().map(|b| b * b).sum::<f64>() / 500.0;
    assert!((variance - 1.0).abs() < 4.0 * (2.0 / 500.0f64).sqrt(), "{variance}");
}

#[test]
fn dist_dropout_follows_the_flat_rate_and_the_power_law() {
    // A flat share, with light to spare.
    let bright = Sensor { range_at_10_percent_m: 1000.0, ..shipped("urg-04lx") };
    let flat = Dropout { rate: 0.15.into(), softness: 0.01, ..Dropout::default() };
    let sweep = run(&flat_yard(), &bright, Effects { dropout: Some(flat), ..Effects::default() });
    let met = sweep.truth.iter().filter(|t| t.object == -1).count() as f64;
    let dropped = sweep.returns.status.iter().filter(|s| **s == Status::Dropped).count() as f64;
    assert!((dropped / met - 0.15).abs() < 4.0 * (0.15 * 0.85 / met).sqrt(), "{}", dropped / met);
    // Many beams at one range and incidence: the logistic law. cos = h / R; P = (0.3 / 0.1) (h / R) (R10 / R)^2.
    let elevation = -0.8f64 / 4.0;
    let beams = vec![(0.0, math::asin(elevation).to_degrees()); 20_000];
    let sensor = listed(&beams);
    let sweep = run(&flat_yard(), &sensor, Effects { dropout: Some(Dropout::default()), ..Effects::default() });
    let power: f64 = 3.0 * 0.2 * (sensor.range_at_10_percent_m / 4.0) * (sensor.range_at_10_percent_m / 4.0);
    let seen = 1.0 / (1.0 + math::exp(-math::ln(power) / 0.3));
    let kept = sweep.returns.status.iter().filter(|s| **s == Status::Hit).count() as f64 / 20_000.0;
    assert!((kept - seen).abs() < 4.0 * (seen * (1.0 - seen) / 20_000.0).sqrt(), "{kept} against {seen}");
    assert!(sweep.returns.range_m.iter().zip(&sweep.returns.status).all(|(r, s)| r.is_nan() == (*s != Status::Hit)));
}

#[test]
fn exact_intensity_is_reflectance_times_cosine_over_range_squared() {
    let intensity = Intensity { ground_reflectance: 0.5.into(), object_reflectance: 0.8.into(), noise: 0.0.into() };
    let scene = flat_yard().with_obstacle(Class::Box, block(DVec3::new(12.5, 10.0, 0.5), DVec3::new(0.5, 2.0, 1.0)));
    let sweep = run(
        &scene,
        &listed(&[(180.0, -30.0), (0.0, 0.0), (0.0, 80.0)]),
        Effects { intensity: Some(intensity), ..Effects::default() },
    );
    let values = sweep.returns.intensity.unwrap();
    // Ground: R = 0.8 / sin 30 = 1.6, cos = 0.5. Wall: 2 m, met squarely. Sky.
    assert!((f64::from(values[0]) - 0.5 * 0.5 / 2.56).abs() < 1e-7);
    assert!((f64::from(values[1]) - 0.8 / 4.0).abs() < 1e-7);
    assert!(values[2].is_nan());
}

#[test]
fn equal_a_beam_on_an_edge_gives_the_phase_of_its_nineteen_sub_rays() {
    // A wall 1 m ahead for y > 10, and one 1.6 m ahead behind it; both are met at incidence acos(d.x).
    let scene = flat_yard()
        .with_obstacle(Class::Box, block(DVec3::new(11.1, 12.0, 0.8), DVec3::new(0.1, 2.0, 1.5)))
        .with_obstacle(Class::Box, block(DVec3::new(12.6, 10.0, 0.8), DVec3::new(1.0, 3.0, 1.5)));
    let sensor = Sensor { divergence_mrad: 40.0, ..listed(&[(0.1, 0.0), (-0.4, 0.0)]) };
    let pixels = MixedPixels { sub_rays: 19, only_at_jumps_m: 0.05 };
    let sweep = run(&scene, &sensor, Effects { mixed_pixels: Some(pixels), ..Effects::default() });
    let Ranging::Phase(PhaseRanging { modulation_mhz }) = sensor.ranging else { panic!("phase ranging") };
    let k = 4.0 * std::f64::consts::PI * modulation_mhz * 1e6 / 299_792_458.0;
    for slot in 0..2 {
        let axis = sweep.returns.pattern.directions[slot];
        let rays = footprint::sub_rays(19);
        let mut directions = vec![axis];
        footprint::spread(axis, 0.020, &rays, &mut directions);
        let (mut re, mut im, mut near) = (0.0, 0.0, 0.0);
        let mut total = 0.0;
        for (ray, d) in rays.iter().zip(&directions) {
            let range_m = if d.y > 0.0 { 1.0 / d.x } else { 1.6 / d.x };
            let power = ray.weight * d.x / (range_m * range_m);
            re += power * math::cos(k * (range_m - 1.0));
            im += power * math::sin(k * (range_m - 1.0));
            total += power;
            near += if d.y > 0.0 { power } else { 0.0 };
        }
        let expected_m = 1.0 + math::atan2(im, re) / k;
        assert!(
            (sweep.returns.range_m[slot] - expected_m).abs() < 1e-9,
            "{} against {expected_m}",
            sweep.returns.range_m[slot]
        );
        assert!(sweep.returns.range_m[slot] > 1.02 && sweep.returns.range_m[slot] < 1.58, "between the walls");
        let (object, share) = if near > 0.5 * total { (0, 1.0 - near / total) } else { (1, near / total) };
        assert_eq!(sweep.truth[slot].object, object);
        assert!((f64::from(sweep.mixed.as_ref().unwrap()[slot]) - share).abs() < 1e-6);
    }
}

#[test]
fn exact_tilt_jitter_moves_the_true_beam_and_not_the_reported_one() {
    let sensor = shipped("urg-04lx");
    let effects = Effects { tilt_jitter_deg: Some(0.5.into()), ..Effects::default() };
    let sweep = run(&flat_yard(), &sensor, effects);
    let sigma_rad = 0.5f64.to_radians();
    let stream = streams(7).open(Purpose::SweepTilt);
    for line in 0..60usize {
        let slot = line * 682 + 340;
        let tilt_rad = (-45.0 + 0.5 * line as f64).to_radians() + sigma_rad * stream.normal(line as u64);
        let range_m = EYE.z / -math::sin(tilt_rad);
        assert!((sweep.returns.range_m[slot] - range_m).abs() < 1e-9, "line {line}");
    }
    assert_eq!(sweep.returns.pattern.directions, Pattern::build(&sensor).unwrap().directions);
}

#[test]
fn exact_tops_are_upward_faces_off_the_rim() {
    // A table 0.4 m high from x = 11 to 12, seen from 0.8 m: its front, its rim, its top, its end.
    let scene = flat_yard().with_obstacle(Class::Box, block(DVec3::new(11.5, 10.0, 0.2), DVec3::new(0.5, 0.5, 0.2)));
    let toward = |x_m: f64, z_m: f64| (0.0, math::atan2(z_m - EYE.z, x_m - EYE.x).to_degrees());
    let sensor = listed(&[toward(11.0, 0.2), toward(11.01, 0.4), toward(11.5, 0.4), toward(11.99, 0.4)]);
    let sweep = run(&scene, &sensor, Effects::default());
    assert_eq!(sweep.truth.iter().map(|t| t.object).collect::<Vec<_>>(), [0; 4]);
    assert_eq!(sweep.truth.iter().map(|t| t.top).collect::<Vec<_>>(), [false, false, true, false]);
}

#[test]
fn equal_a_used_scratch_gives_the_sweep_of_a_new_one() {
    let scene = full_yard();
    let effects = Effects {
        range_noise: noise(),
        dropout: Some(Dropout::default()),
        mixed_pixels: Some(MixedPixels::default()),
        intensity: Some(Intensity::default()),
        quantisation: Some(Quantisation::default()),
        ..Effects::default()
    };
    let caster = Caster::new(&scene, &Cast::Exact);
    let pose = Transform { translation_m: EYE, ..Transform::IDENTITY };
    let mut scratch = Scratch::default();
    let hash_of = |name: &str, scratch: &mut Scratch| {
        let params = params(shipped(name), effects.clone());
        let pattern = Arc::new(Pattern::build(&params.sensor).unwrap());
        let drawn = Drawn::draw(&streams(3), params.dists());
        let sweep = sweep(&params, &pattern, &caster, &pose, &drawn, &streams(3), scratch).unwrap();
        let mut hasher = blake3::Hasher::new();
        sweep.hash_into(&mut hasher);
        hasher.finalize()
    };
    let used: Vec<_> = ["lms111", "vlp-16", "urg-04lx"].map(|name| hash_of(name, &mut scratch)).to_vec();
    let new: Vec<_> = ["lms111", "vlp-16", "urg-04lx"].map(|name| hash_of(name, &mut Scratch::default())).to_vec();
    assert_eq!(used, new);
    assert_ne!(used[0], used[1]);
}

#[test]
fn extreme_places_where_no_sensor_can_be_are_refused() {
    let scene = flat_yard().with_obstacle(Class::Box, block(DVec3::new(5.0, 5.0, 0.5), DVec3::splat(0.5)));
    let at = |x_m, y_m, z_m| {
        let pose = Transform { translation_m: DVec3::new(x_m, y_m, z_m), ..Transform::IDENTITY };
        run_at(&scene, &params(listed(&[(0.0, 0.0)]), Effects::default()), &streams(0), &pose)
    };
    assert!(matches!(at(3.0, 3.0, -0.25), Err(SweepError::Buried { depth_m, .. }) if (depth_m - 0.25).abs() < 1e-12));
    assert_eq!(at(5.0, 5.0, 0.5).unwrap_err(), SweepError::Inside { object: 0 });
    assert!(matches!(at(f64::NAN, 3.0, 1.0), Err(SweepError::NoPose { .. })));
    assert!(matches!(at(3.0, 3.0, f64::INFINITY), Err(SweepError::NoPose { .. })));
    // Outside the yard there is no ground, and nothing wrong.
    assert_eq!(at(-50.0, 3.0, -1.0).unwrap().returns.status, [Status::None]);
}

#[test]
fn exact_mount_overrides_replace_what_they_name() {
    let mount = MountParams { z_m: Some(1.2.into()), pitch_deg: Some(15.0.into()), ..MountParams::default() };
    let params = SweepParams { mount: Some(mount.clone()), ..SweepParams::default() };
    let drawn = Drawn::draw(&streams(0), params.dists());
    assert_eq!(mount.apply(&drawn, [0.3, 0.0, 0.4, 5.0, 0.0, 1.0]), [0.3, 0.0, 1.2, 5.0, 15.0, 1.0]);
    assert_eq!(drawn.iter().map(|(p, _)| p.key()).collect::<Vec<_>>(), ["sweep.mount.z_m", "sweep.mount.pitch_deg"]);
}

#[test]
fn extreme_sensors_on_the_ground_and_with_kilometres_of_reach_give_finite_ranges() {
    let everything = Effects {
        range_noise: noise(),
        range_bias_m: Some(1.0.into()),
        quantisation: Some(Quantisation { step_m: Some(1e-6) }),
        gates: Some(Gates::default()),
        dropout: Some(Dropout { softness: 1e-3, ..Dropout::default() }),
        mixed_pixels: Some(MixedPixels { sub_rays: 19, only_at_jumps_m: 0.0 }),
        tilt_jitter_deg: Some(5.0.into()),
        intensity: Some(Intensity::default()),
    };
    for name in ["urg-04lx", "lms111"] {
        for (height_m, reach_m, divergence_mrad) in [(1e-9, 5.6, 100.0), (0.8, 10_000.0, 0.0), (15.0, 0.05, 100.0)] {
            let PatternParams::Tilted(tilted) = shipped(name).pattern else { panic!("a tilted fan") };
            let tilted =
                crate::sweep::sensor::TiltedParams { beams: 60, beam_step_deg: 4.0, first_beam_deg: None, ..tilted };
            let pattern = PatternParams::Tilted(tilted);
            let sensor = Sensor { pattern, max_range_m: reach_m, divergence_mrad, ..shipped(name) };
            let pose = Transform { translation_m: DVec3::new(10.0, 10.0, height_m), ..Transform::IDENTITY };
            let sweep = run_at(&full_yard(), &params(sensor, everything.clone()), &streams(2), &pose).unwrap();
            for slot in 0..sweep.returns.status.len() {
                let hit = sweep.returns.status[slot] == Status::Hit;
                assert_eq!(sweep.returns.range_m[slot].is_finite(), hit);
                assert!(!hit || sweep.returns.range_m[slot] > 0.0 && sweep.returns.range_m[slot] <= reach_m);
                assert_eq!(sweep.returns.intensity.as_ref().unwrap()[slot].is_finite(), hit);
                assert!(!sweep.truth[slot].range_m.is_nan());
            }
        }
    }
}
