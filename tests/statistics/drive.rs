//! Laws of drives over many seeds. Bands are five standard errors wide unless a line says otherwise.

use marsyard::drive::params::{
    ContactSolver, ControlNoise, DriveParams, InstrumentsParams, LengthParams, PathParams, StartParams,
};
use marsyard::drive::{DriveLog, GroundContact, Rover, drive};
use marsyard::geometry::DVec2;
use marsyard::math;
use marsyard::preset::Preset;
use marsyard::random::{Dist, Drawn, Purpose, Stage, Streams};
use marsyard::scene::polynomial::{Polynomial, term_count};
use marsyard::scene::{Ground, Raster, Scene};

fn rover(name: &str) -> Rover {
    let path = format!("{}/configs/rovers/{name}.yaml", env!("CARGO_MANIFEST_DIR"));
    serde_saphyr::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn streams(seed: u64) -> Streams {
    Streams { seed, scene: 0, attempt: 0, stage: Stage::Drive, step: 0 }
}

fn plane(extent_m: f64) -> Scene {
    Scene::bare(extent_m, Ground::Polynomial(Polynomial::plane(extent_m, 0.0, DVec2::new(0.1, -0.2))))
}

fn straight(length_m: f64, instruments: InstrumentsParams, control_noise: Option<ControlNoise>) -> DriveParams {
    DriveParams {
        rover: Preset::Inline(Box::new(rover("pioneer-3at"))),
        start: StartParams { near_obstacle_m: None, margin_m: 8.0 },
        path: PathParams::Straight(LengthParams { length_m: length_m.into() }),
        instruments,
        control_noise,
        ..DriveParams::default()
    }
}

fn instruments(imu_deg: f64, sun_deg: f64, metres: f64, degrees: f64) -> InstrumentsParams {
    InstrumentsParams {
        imu_deg: imu_deg.into(),
        imu_bias_deg: None,
        sun_deg: Some(Dist::Constant(sun_deg)),
        odometry_m_per_sqrt_m: metres.into(),
        odometry_deg_per_sqrt_m: degrees.into(),
        slip: None,
    }
}

fn driven(params: &DriveParams, scene: &Scene, seed: u64) -> DriveLog {
    let streams = streams(seed);
    drive(params, scene, &Drawn::draw(&streams, params.dists()), &streams).unwrap()
}

/// Mean and standard deviation about it.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0)).sqrt())
}

/// Whether normal values have mean 0 and this standard deviation.
fn centred(values: &[f64], sd: f64) -> bool {
    let n = values.len() as f64;
    let (mean, got) = moments(values);
    mean.abs() < 5.0 * sd / n.sqrt() && (got / sd - 1.0).abs() < 5.0 / (2.0 * n).sqrt()
}

#[test]
fn dist_control_noise_has_the_variances_of_its_keys() {
    let scene = plane(30.0);
    let noise = |speed: f64, heading: f64| {
        Some(ControlNoise { speed: speed.into(), yaw_rate: 0.0.into(), heading_deg_per_sqrt_m: heading.into() })
    };
    let quiet = || instruments(0.0, 0.0, 0.0, 0.0);
    let way = |log: &DriveLog| {
        log.truth.windows(2).map(|pair| (pair[1].position_m - pair[0].position_m).length()).sum::<f64>()
    };
    let ways: Vec<f64> =
        (0..2000).map(|seed| way(&driven(&straight(4.0, quiet(), noise(0.2, 0.0)), &scene, seed)) - 4.0).collect();
    // 80 steps of 5 cm, each off by a fifth.
    assert!(centred(&ways, 0.2 * 0.05 * 80.0_f64.sqrt()), "{:?}", moments(&ways));
    let turns: Vec<f64> = (0..2000)
        .map(|seed| driven(&straight(4.0, quiet(), noise(0.0, 3.0)), &scene, seed))
        .map(|log| math::wrap_angle(log.truth.last().unwrap().yaw_rad - log.truth[0].yaw_rad).to_degrees())
        .collect();
    // The way that counts is the commanded one of the outer wheel: 4 m, since no turn is commanded.
    assert!(centred(&turns, 3.0 * 4.0_f64.sqrt()), "{:?}", moments(&turns));
}

#[test]
fn dist_instruments_have_the_deviations_of_their_keys() {
    let scene = plane(30.0);
    let params = straight(4.0, instruments(0.5, 2.0, 0.05, 2.0), None);
    let logs: Vec<DriveLog> = (0..1000).map(|seed| driven(&params, &scene, seed)).collect();
    let (mut roll, mut pitch, mut sun) = (Vec::new(), Vec::new(), Vec::new());
    for log in &logs {
        for (pose, reading) in log.truth.iter().zip(&log.readings) {
            roll.push((reading.roll_rad.unwrap() - pose.roll_rad).to_degrees());
            pitch.push((reading.pitch_rad.unwrap() - pose.pitch_rad).to_degrees());
            sun.extend(reading.yaw_rad.map(|yaw| math::wrap_angle(yaw - pose.yaw_rad).to_degrees()));
        }
    }
    assert_eq!(sun.len(), 4 * logs.len(), "four stops, of which the start is one");
    assert!(centred(&roll, 0.5) && centred(&pitch, 0.5) && centred(&sun, 2.0));
    let product: f64 = roll.iter().zip(&pitch).map(|(a, b)| a * b).sum::<f64>() / roll.len() as f64;
    assert!(product.abs() < 5.0 * 0.25 / (roll.len() as f64).sqrt(), "roll and pitch are drawn apart: {product}");
    let ways: Vec<f64> =
        logs.iter().map(|log| log.readings.iter().map(|r| r.speed_mps * r.dt_s).sum::<f64>() - 4.0).collect();
    let turns: Vec<f64> =
        logs.iter().map(|log| log.readings.iter().map(|r| (r.yaw_rate_radps * r.dt_s).to_degrees()).sum()).collect();
    assert!(centred(&ways, 0.05 * 2.0) && centred(&turns, 2.0 * 2.0), "{:?} {:?}", moments(&ways), moments(&turns));
}

#[test]
fn dist_the_bias_of_the_imu_has_its_size_and_any_direction() {
    let scene = plane(30.0);
    let biased = InstrumentsParams { imu_bias_deg: Some(1.5.into()), ..instruments(0.0, 0.0, 0.0, 0.0) };
    let params = straight(0.1, biased, None);
    let mut quadrants = [0u32; 4];
    for seed in 0..2000 {
        let log = driven(&params, &scene, seed);
        let off = |k: usize| {
            let (pose, reading) = (log.truth[k], log.readings[k]);
            (reading.roll_rad.unwrap() - pose.roll_rad, reading.pitch_rad.unwrap() - pose.pitch_rad)
        };
        let (roll, pitch) = off(0);
        assert!((math::hypot(roll, pitch).to_degrees() - 1.5).abs() < 1e-9);
        assert!((off(2).0 - roll).abs() < 1e-15, "constant over the drive");
        quadrants[usize::from(roll > 0.0) + 2 * usize::from(pitch > 0.0)] += 1;
    }
    // Binomial sd 19.4.
    assert!(quadrants.iter().all(|&c| c.abs_diff(500) < 97), "{quadrants:?}");
}

#[test]
fn dist_starts_are_uniform_in_the_yard_and_look_anywhere() {
    let scene = plane(26.0);
    let params = straight(0.0, instruments(0.0, 0.0, 0.0, 0.0), None);
    let (mut cells, mut headings) = (vec![0.0; 100], vec![0.0; 20]);
    for seed in 0..20_000 {
        let pose = driven(&params, &scene, seed).truth[0];
        let bin = |v: f64| (v - 8.0).floor() as usize;
        cells[10 * bin(pose.position_m.y) + bin(pose.position_m.x)] += 1.0;
        headings[((pose.yaw_rad / std::f64::consts::PI + 1.0) * 10.0) as usize] += 1.0;
    }
    let chi2 = |counts: &[f64]| {
        let expected = 20_000.0 / counts.len() as f64;
        counts.iter().map(|c| (c - expected) * (c - expected) / expected).sum::<f64>()
    };
    // Chi-square quantiles at 1 - 1e-5: 168 with 99 degrees of freedom, 57.6 with 19.
    assert!(chi2(&cells) < 168.0 && chi2(&headings) < 57.6, "{} {}", chi2(&cells), chi2(&headings));
}

/// A polynomial yard of 20 m with slopes to some 20 degrees.
fn hills(seed: u64) -> Scene {
    let draws = streams(seed).open(Purpose::GroundNoise);
    let coefficients = (0..term_count(5)).map(|k| 0.12 * draws.normal(k as u64)).collect();
    Scene::bare(20.0, Ground::Polynomial(Polynomial::new(20.0, 5, coefficients)))
}

/// White roughness of 1 cm on nodes 5 cm apart.
fn rubble(seed: u64) -> Scene {
    let draws = streams(seed).open(Purpose::GroundNoise);
    let ground = Raster::sampled(20.0, 0.05, |x, y| {
        let node = (x * 20.0).round() * 1000.0 + (y * 20.0).round();
        0.3 * math::sin(0.6 * x) * math::cos(0.5 * y) + 0.01 * draws.normal(node as u64)
    });
    Scene::bare(20.0, Ground::Raster(ground))
}

fn places(seed: u64, count: u64) -> impl Iterator<Item = (f64, f64, f64)> {
    let draws = streams(seed).open(Purpose::StartPlace);
    (0..count).map(move |k| {
        let along = |k| 1.0 + 18.0 * draws.uniform(k);
        (along(3 * k), along(3 * k + 1), 6.2 * draws.uniform(3 * k + 2) - 3.1)
    })
}

#[test]
fn law_a_rocker_bogie_touches_everywhere() {
    let rover = rover("kapvik");
    let mut stood = 0;
    for seed in 0..40 {
        for scene in [hills(seed), rubble(seed)] {
            let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
            for (x, y, yaw) in places(seed, 2000) {
                // A failure to touch within 1e-6 m is an error; tipping over is not on these slopes.
                let stance = contact.stand(x, y, yaw, None).unwrap();
                assert!(stance.contact.residual_m < 1e-6, "{seed}: {stance:?}");
                stood += 1;
            }
        }
    }
    assert_eq!(stood, 160_000);
}

#[test]
fn equal_gauss_newton_and_nelder_mead_on_many_hills() {
    for name in ["kapvik", "pioneer-3at", "husky-a200"] {
        let rover = rover(name);
        for seed in 0..50 {
            let scene = hills(1000 + seed);
            let newton = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
            let simplex = GroundContact::new(&rover, &scene, ContactSolver::NelderMead);
            for (x, y, yaw) in places(seed, 20) {
                let (a, b) = (newton.stand(x, y, yaw, None).unwrap(), simplex.stand(x, y, yaw, None).unwrap());
                let off = [
                    a.pose.position_m.z - b.pose.position_m.z,
                    a.pose.pitch_rad - b.pose.pitch_rad,
                    a.pose.roll_rad - b.pose.roll_rad,
                    a.contact.rocker_rad - b.contact.rocker_rad,
                    a.contact.bogie_left_rad - b.contact.bogie_left_rad,
                    a.contact.bogie_right_rad - b.contact.bogie_right_rad,
                ];
                assert!(off.iter().all(|d| d.abs() < 1e-6), "{name} {seed} ({x}, {y}, {yaw}): {off:?}\n{a:?}\n{b:?}");
            }
        }
    }
}
