//! FastSLAM over many seeds: against dead reckoning, against an EKF-SLAM oracle, and against its own sigmas.
//!
//! Ratios bind; metres are printed. `MARSYARD_SEEDS` sets how many seeds each law takes (default 10; 100 for the record).

mod ekf;
mod world;

use ekf::EkfSlam;
use marsyard::drive::InstrumentNoise;
use marsyard::geometry::Pose;
use marsyard::math;
use marsyard::random::{Stage, Streams};
use marsyard::slam::matrix::{cholesky, half_solve, square};
use marsyard::slam::measurement::Mounting;
use marsyard::slam::motion::MotionNoise;
use marsyard::slam::{Estimate, FastslamParams, Slam, SlamParams};
use world::{Drive, Scenario, drive};

fn seeds() -> std::ops::RangeInclusive<u64> {
    1..=std::env::var("MARSYARD_SEEDS").ok().and_then(|n| n.parse().ok()).unwrap_or(10)
}

fn params(particles: u32) -> FastslamParams {
    FastslamParams { particles, ..FastslamParams::default() }
}

/// One run of one method.
struct Run {
    ate_m: f64,
    /// Per step: error and covariance.
    errors: Vec<([f64; 6], [[f64; 6]; 6])>,
    estimates: Vec<Estimate>,
    innovations: Vec<f64>,
    optimistic: bool,
    ancestors: usize,
}

fn error(estimate: &Pose, truth: &Pose) -> [f64; 6] {
    let d = estimate.position_m - truth.position_m;
    [
        d.x,
        d.y,
        d.z,
        math::wrap_angle(estimate.roll_rad - truth.roll_rad),
        estimate.pitch_rad - truth.pitch_rad,
        math::wrap_angle(estimate.yaw_rad - truth.yaw_rad),
    ]
}

fn ate_m(errors: &[([f64; 6], [[f64; 6]; 6])]) -> f64 {
    let sum: f64 = errors.iter().map(|(e, _)| e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).sum();
    (sum / errors.len() as f64).sqrt()
}

fn run(method: &SlamParams, drive: &Drive, noise: &InstrumentNoise, seed: u64) -> Run {
    let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Slam, step: 0 };
    let mut slam = Slam::new(method, noise, &drive.truth[0], &drive.rover_from_sensor).expect("a filter");
    let mut run = Run {
        ate_m: 0.0,
        errors: Vec::new(),
        estimates: Vec::new(),
        innovations: Vec::new(),
        optimistic: false,
        ancestors: 0,
    };
    let reckons = matches!(method, SlamParams::DeadReckoning);
    for (k, truth) in drive.truth.iter().enumerate() {
        let streams = streams.at_step(k as u32);
        slam.step(&drive.readings[k], &streams).expect("upright");
        if let (Some(features), false) = (&drive.features[k], reckons) {
            slam.observe_features(features, &drive.visibility, &streams).expect("upright");
            run.innovations.extend(slam.mean_innovation());
        }
        let estimate = slam.estimate();
        run.errors.push((error(&estimate.pose, truth), estimate.covariance));
        run.optimistic |= estimate.sigma_optimistic;
        run.estimates.push(estimate);
    }
    run.ate_m = ate_m(&run.errors);
    run.ancestors = slam.ancestors();
    run
}

fn fastslam(drive: &Drive, scenario: &Scenario, params: FastslamParams, seed: u64) -> Run {
    run(&SlamParams::Fastslam(params), drive, &scenario.noise(), seed)
}

fn oracle(seed: u64, scenario: &Scenario) -> Vec<([f64; 6], [[f64; 6]; 6])> {
    let drive = drive(seed, &Scenario { known: true, ..scenario.clone() });
    let noise = scenario.noise();
    let motion = MotionNoise::new(&noise, 1.0);
    let mounting = Mounting::new(&drive.rover_from_sensor);
    let start = drive.truth[0].position_m;
    let mut ekf = EkfSlam::new();
    let mut errors = Vec::new();
    for (k, truth) in drive.truth.iter().enumerate() {
        ekf.step(&drive.readings[k], &motion, noise.imu_rad, noise.sun_rad);
        if let Some(features) = &drive.features[k] {
            ekf.observe(features, &mounting);
        }
        let m = &ekf.mean;
        let position_m = start + marsyard::geometry::DVec3::new(m[0], m[1], m[2]);
        let pose = Pose { position_m, roll_rad: m[3], pitch_rad: m[4], yaw_rad: m[5] };
        let covariance = std::array::from_fn(|r| std::array::from_fn(|c| ekf.covariance[r][c]));
        errors.push((error(&pose, truth), covariance));
    }
    errors
}

fn nees<const N: usize>((error, covariance): &([f64; 6], [[f64; 6]; 6]), first: usize) -> f64 {
    let block: [[f64; N]; N] = std::array::from_fn(|r| std::array::from_fn(|c| covariance[first + r][first + c]));
    let e: [f64; N] = std::array::from_fn(|i| error[first + i]);
    cholesky(&block).map_or(f64::NAN, |l| square(&half_solve(&l, &e)))
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    sum / count as f64
}

#[test]
#[ignore = "exploration table"]
fn table() {
    for (name, scenario) in [("A", Scenario::a()), ("B", Scenario::b())] {
        let seeds: Vec<u64> = seeds().collect();
        let dr = mean(
            seeds.iter().map(|&s| run(&SlamParams::DeadReckoning, &drive(s, &scenario), &scenario.noise(), s).ate_m),
        );
        let ekf: Vec<_> = seeds.iter().map(|&s| oracle(s, &scenario)).collect();
        println!("{name} DR {dr:.3} EKF {:.3}", mean(ekf.iter().map(|e| ate_m(e))));
        let report = |label: &str, runs: &[Vec<([f64; 6], [[f64; 6]; 6])>]| {
            for at in [50, 100, 125, 625] {
                if at < runs[0].len() {
                    println!(
                        "   {label} step {at}: nees6 {:.2} pos {:.2} att {:.2}",
                        mean(runs.iter().map(|r| nees::<6>(&r[at], 0))),
                        mean(runs.iter().map(|r| nees::<3>(&r[at], 0))),
                        mean(runs.iter().map(|r| nees::<3>(&r[at], 3)))
                    );
                }
            }
        };
        report("ekf", &ekf);
        for (label, known, n, inflation) in [
            ("known N=1 R1", true, 1, 1.0),
            ("known N=100 R1", true, 100, 1.0),
            ("N=30 R4", false, 30, 4.0),
            ("N=100 R4", false, 100, 4.0),
            ("N=300 R4", false, 300, 4.0),
        ] {
            let scenario = Scenario { known, ..scenario.clone() };
            let clock = std::time::Instant::now();
            let runs: Vec<Run> = seeds
                .iter()
                .map(|&s| {
                    let p = FastslamParams { measurement_inflation: inflation, ..params(n) };
                    fastslam(&drive(s, &scenario), &scenario, p, s)
                })
                .collect();
            let stops = runs[0].estimates.len() / 5;
            println!(
                "{name} {label}: ATE {:.3} nis {:.2} anc {:.1} optimistic {} of {}, last: feat {:.1} matched {:.1} lm {:.1} skipped {:.1}; {:.2} ms/scan",
                mean(runs.iter().map(|r| r.ate_m)),
                mean(runs.iter().map(|r| mean(r.innovations.iter().copied()))),
                mean(runs.iter().map(|r| r.ancestors as f64)),
                runs.iter().filter(|r| r.optimistic).count(),
                runs.len(),
                mean(runs.iter().flat_map(|r| r.estimates.iter().step_by(5).map(|e| f64::from(e.features)))),
                mean(runs.iter().flat_map(|r| r.estimates.iter().step_by(5).map(|e| f64::from(e.matched)))),
                mean(runs.iter().map(|r| f64::from(r.estimates.last().expect("steps").landmarks))),
                mean(runs.iter().map(|r| f64::from(r.estimates.last().expect("steps").skipped))),
                clock.elapsed().as_secs_f64() * 1e3 / (stops * runs.len()) as f64
            );
            report(label, &runs.iter().map(|r| r.errors.clone()).collect::<Vec<_>>());
        }
    }
}

#[test]
#[ignore = "exploration"]
fn spread() {
    for (name, scenario) in [("A", Scenario::a()), ("B", Scenario::b())] {
        let mut rows = Vec::new();
        for seed in seeds() {
            let d = drive(seed, &scenario);
            let dr = run(&SlamParams::DeadReckoning, &d, &scenario.noise(), seed).ate_m;
            let ekf = ate_m(&oracle(seed, &scenario));
            let fs = fastslam(&d, &scenario, params(100), seed).ate_m;
            rows.push((dr, ekf, fs));
            if fs > dr || fs > 0.2 {
                println!("{name} seed {seed}: DR {dr:.3} EKF {ekf:.3} fast {fs:.3}");
            }
        }
        let n = rows.len() as f64;
        println!(
            "{name}: DR {:.3} EKF {:.3} fast {:.3}; better in {} of {n}",
            rows.iter().map(|r| r.0).sum::<f64>() / n,
            rows.iter().map(|r| r.1).sum::<f64>() / n,
            rows.iter().map(|r| r.2).sum::<f64>() / n,
            rows.iter().filter(|r| r.2 < r.0).count()
        );
    }
}

#[test]
#[ignore = "exploration"]
fn variants() {
    for (name, scenario) in [("A", Scenario::a())] {
        println!(
            "A EKF {:.3} nees {:.2}",
            mean(seeds().map(|s| ate_m(&oracle(s, &scenario)))),
            mean(seeds().map(|s| nees::<6>(&oracle(s, &scenario)[125], 0)))
        );
        for (label, known, infl, n) in
            [("known R1 100", true, 1.0, 100), ("known R1 1000", true, 1.0, 1000), ("known R1 10000", true, 1.0, 10000)]
        {
            let scenario = Scenario { known, ..scenario.clone() };
            let mut rows = Vec::new();
            for seed in seeds() {
                let d = drive(seed, &scenario);
                let dr = run(&SlamParams::DeadReckoning, &d, &scenario.noise(), seed).ate_m;
                let p = FastslamParams { measurement_inflation: infl, ..params(n) };
                let r = fastslam(&d, &scenario, p, seed);
                rows.push((dr, r.ate_m, nees::<6>(&r.errors[125], 0)));
                if [31, 51, 59, 43, 90].contains(&seed) {
                    print!("{seed}: {:.3} ", r.ate_m);
                }
            }
            let m = rows.len() as f64;
            println!(
                "{name} {label}: DR {:.3} fast {:.3} better {} of {m} nees {:.2}",
                rows.iter().map(|r| r.0).sum::<f64>() / m,
                rows.iter().map(|r| r.1).sum::<f64>() / m,
                rows.iter().filter(|r| r.1 < r.0).count(),
                rows.iter().map(|r| r.2).sum::<f64>() / m
            );
        }
    }
}

#[test]
#[ignore = "exploration"]
fn trace() {
    let scenario = Scenario { known: true, ..Scenario::a() };
    let d = drive(3, &scenario);
    let p = FastslamParams { measurement_inflation: 1.0, ..params(10000) };
    let r = fastslam(&d, &scenario, p, 3);
    let e = oracle(3, &scenario);
    let dr = run(&SlamParams::DeadReckoning, &d, &scenario.noise(), 3);
    for k in (0..=125).step_by(5) {
        let f = |x: &([f64; 6], [[f64; 6]; 6])| {
            (0..6).map(|i| format!("{:7.4}/{:6.4}", x.0[i], x.1[i][i].sqrt())).collect::<Vec<_>>().join(" ")
        };
        println!(
            "{k:3} fast {} ess {:.0} m {} f {}\n    ekf  {}\n    dr   {}",
            f(&r.errors[k]),
            r.estimates[k].effective_samples,
            r.estimates[k].matched,
            r.estimates[k].features,
            f(&e[k]),
            f(&dr.errors[k])
        );
    }
}
