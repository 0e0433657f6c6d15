//! The same seeds under dead reckoning, an EKF-SLAM oracle and the filter, and how far each is off.

use super::ekf::EkfSlam;
use super::world::{Drive, Scenario, drive};
use marsyard::drive::InstrumentNoise;
use marsyard::geometry::Pose;
use marsyard::math;
use marsyard::random::{Stage, Streams};
use marsyard::slam::matrix::{cholesky, half_solve, square};
use marsyard::slam::measurement::Mounting;
use marsyard::slam::motion::MotionNoise;
use marsyard::slam::{Estimate, FastslamParams, Slam, SlamParams};

pub fn seeds() -> std::ops::RangeInclusive<u64> {
    1..=std::env::var("MARSYARD_SEEDS").ok().and_then(|n| n.parse().ok()).unwrap_or(100)
}

/// One run of one method.
pub struct Run {
    pub ate_m: f64,
    /// Per step: error and covariance.
    pub errors: Errors,
    pub estimates: Vec<Estimate>,
    pub innovations: Vec<f64>,
    pub optimistic: bool,
    pub ancestors: usize,
}

pub fn error(estimate: &Pose, truth: &Pose) -> [f64; 6] {
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

pub fn ate_m(errors: &Errors) -> f64 {
    let sum: f64 = errors.iter().map(|(e, _)| e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).sum();
    (sum / errors.len() as f64).sqrt()
}

pub fn run(method: &SlamParams, drive: &Drive, noise: &InstrumentNoise, seed: u64) -> Run {
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
        slam.step(&drive.readings[k]).expect("upright");
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

pub fn fastslam(drive: &Drive, scenario: &Scenario, params: FastslamParams, seed: u64) -> Run {
    run(&SlamParams::Fastslam(params), drive, &scenario.noise(), seed)
}

fn oracle(seed: u64, scenario: &Scenario) -> Errors {
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

pub fn nees<const N: usize>((error, covariance): &([f64; 6], [[f64; 6]; 6]), first: usize) -> f64 {
    let block: [[f64; N]; N] = std::array::from_fn(|r| std::array::from_fn(|c| covariance[first + r][first + c]));
    let e: [f64; N] = std::array::from_fn(|i| error[first + i]);
    cholesky(&block).map_or(f64::NAN, |l| square(&half_solve(&l, &e)))
}

pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    sum / count as f64
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

pub type Errors = Vec<([f64; 6], [[f64; 6]; 6])>;

/// The same seeds under dead reckoning, the oracle and the filter.
pub struct Trial {
    reckoned_m: Vec<f64>,
    oracle_m: Vec<f64>,
    pub runs: Vec<Run>,
}

impl Trial {
    pub fn of(scenario: &Scenario, params: &FastslamParams) -> Trial {
        let mut trial = Trial { reckoned_m: Vec::new(), oracle_m: Vec::new(), runs: Vec::new() };
        for seed in seeds() {
            let drive = drive(seed, scenario);
            trial.reckoned_m.push(run(&SlamParams::DeadReckoning, &drive, &scenario.noise(), seed).ate_m);
            trial.oracle_m.push(ate_m(&oracle(seed, scenario)));
            trial.runs.push(fastslam(&drive, scenario, params.clone(), seed));
        }
        trial
    }

    pub fn ate_m(&self) -> f64 {
        mean(self.runs.iter().map(|r| r.ate_m))
    }

    pub fn over_reckoning(&self) -> f64 {
        self.ate_m() / mean(self.reckoned_m.iter().copied())
    }

    pub fn over_oracle(&self) -> f64 {
        self.ate_m() / mean(self.oracle_m.iter().copied())
    }

    pub fn better_share(&self) -> f64 {
        mean(self.runs.iter().zip(&self.reckoned_m).map(|(r, &dr)| f64::from(u8::from(r.ate_m < dr))))
    }

    pub fn mean_nees<const N: usize>(&self, step: usize, first: usize) -> f64 {
        mean(self.runs.iter().map(|r| nees::<N>(&r.errors[step], first)))
    }

    pub fn print(&self, name: &str) {
        println!(
            "{name}: ATE {:.3} m, dead reckoning {:.3}, oracle {:.3}; better in {:.0} %; ancestors {:.1}",
            self.ate_m(),
            mean(self.reckoned_m.iter().copied()),
            mean(self.oracle_m.iter().copied()),
            100.0 * self.better_share(),
            mean(self.runs.iter().map(|r| r.ancestors as f64)),
        );
    }
}
