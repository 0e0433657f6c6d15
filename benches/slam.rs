//! Domain rates of FastSLAM: what a sweep and a control step cost, by particles and by features. CPU time of one thread.
//!
//! `cargo bench --bench slam`: drives an arc of radius 5 m among 120 rocks with a stop every half metre (scenario A of the tests
//! of consistency, on flat ground), features with noise and without names. Medians of interleaved rounds. Before that, what it costs
//! to find the features of a sweep of paper.yaml. For information: no test asserts a time.

mod shared;

use marsyard::drive::{InstrumentNoise, Reading};
use marsyard::geometry::{DVec3, Pose, Transform};
use marsyard::math;
use marsyard::measure::clock::thread_cpu_s;
use marsyard::random::{Purpose, Stage, Stream, Streams};
use marsyard::slam::features::Extractor;
use marsyard::slam::{FastslamParams, Feature, Slam, SlamParams, Visibility};
use shared::paper::{prepared, replays};
use shared::rate;

const ROUNDS: usize = 7;
const PARTICLES: [u32; 4] = [10, 30, 100, 300];
const FEATURES: [u32; 3] = [4, 8, 12];
const STEPS: u32 = 125;
const STEPS_PER_STOP: u32 = 5;
const RANGE_M: f64 = 4.0;

fn main() {
    find_features();
    let drive = Drive::new();
    println!("particles  features  found  landmarks     ms/scan  of it steps    scans/s");
    let cases: Vec<(u32, u32)> = PARTICLES.iter().flat_map(|&n| FEATURES.map(|k| (n, k))).collect();
    let mut rounds: Vec<Vec<Cost>> = vec![Vec::new(); cases.len()];
    for _ in 0..ROUNDS {
        for (case, costs) in cases.iter().zip(&mut rounds) {
            costs.push(drive.cost(case.0, case.1));
        }
    }
    for ((particles, features), costs) in cases.into_iter().zip(rounds) {
        let median = |of: fn(&Cost) -> f64| {
            let mut values: Vec<f64> = costs.iter().map(of).collect();
            values.sort_unstable_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let (scan_ms, steps_ms) = (median(|c| c.scan_ms), median(|c| c.steps_ms));
        let (found, landmarks) = (median(|c| c.features), median(|c| c.landmarks));
        let whole_ms = scan_ms + steps_ms;
        println!(
            "{particles:>9}  {features:>8}  {found:>5.1}  {landmarks:>9.1}  {whole_ms:>10.3}  {steps_ms:>11.3}  {:>9.0}",
            1e3 / whole_ms
        );
    }
}

/// Rays a second, from a kept sweep to its features.
fn find_features() {
    let prepared = prepared("paper.yaml", &["drive.contact=gauss_newton"]).keeping_points();
    let replay = replays(&prepared, 1).remove(0);
    let sweep = &replay.scans[0].points.as_ref().expect("points are kept").sweep;
    let pose = replay.poses.iter().rfind(|pose| pose.scan_id.is_some()).expect("a sweep is kept").estimate.pose;
    let mut extractor = Extractor::new(FastslamParams::default().feature_range_m, &replay.rover_from_sensor);
    rate("features of a sweep", "rays", sweep.returns.range_m.len() as f64, || {
        extractor.extract(&sweep.returns, pose.roll_rad, pose.pitch_rad);
    });
}

/// Of one drive, per stop: CPU time of the sweep's features and of the control steps before it; features, landmarks at the end.
#[derive(Clone)]
struct Cost {
    scan_ms: f64,
    steps_ms: f64,
    features: f64,
    landmarks: f64,
}

/// Readings, one a step, and the features of each stop.
struct Drive {
    start: Pose,
    readings: Vec<Reading>,
    stops: Vec<Vec<Feature>>,
    view: Visibility<'static>,
}

const NOISE: InstrumentNoise = InstrumentNoise {
    imu_rad: 0.0087,
    imu_bias_rad: 0.0,
    sun_rad: 0.035,
    odometry_m_per_sqrt_m: 0.05,
    sideways_m_per_sqrt_m: 0.0,
    slip: 0.0,
    heading_rad_per_sqrt_m: 0.035,
};

fn mast() -> Transform {
    Transform { translation_m: DVec3::new(0.2, 0.0, 0.5), ..Transform::IDENTITY }
}

fn streams(stage: Stage, step: u32) -> Streams {
    Streams { seed: 7, scene: 0, attempt: 0, stage, step }
}

fn normals(stream: &mut Stream, count: usize) -> Vec<f64> {
    let mut values = vec![0.0; count];
    stream.fill_normal(0, &mut values);
    values
}

impl Drive {
    fn new() -> Drive {
        let mut places = vec![0.0; 3 * 120];
        streams(Stage::Scene, 0).open(Purpose::SlamSample).fill_uniform(0, &mut places);
        let rocks: Vec<DVec3> = places
            .as_chunks::<3>()
            .0
            .iter()
            .map(|[x, y, z]| DVec3::new(18.0 * x - 9.0, 18.0 * y - 9.0, 0.1 + 0.2 * z))
            .collect();
        let start =
            Pose { position_m: DVec3::new(5.0, 0.0, 0.0), yaw_rad: 0.5 * std::f64::consts::PI, ..Pose::default() };
        let turn_rad = 0.1 / 5.0;
        let (mut readings, mut stops) = (Vec::new(), Vec::new());
        for step in 0..=STEPS {
            let angle_rad = f64::from(step) * turn_rad;
            let (s, c) = math::sin_cos(angle_rad);
            let yaw_rad = math::wrap_angle(start.yaw_rad + angle_rad);
            let pose = Pose { position_m: DVec3::new(5.0 * c, 5.0 * s, 0.0), yaw_rad, ..Pose::default() };
            let n = normals(&mut streams(Stage::Drive, step).open(Purpose::SlamSample), 5);
            let moving = f64::from(u8::from(step > 0));
            readings.push(Reading {
                dt_s: 1.0,
                speed_mps: moving * (0.1 + 0.05 * 0.1f64.sqrt() * n[0]),
                yaw_rate_radps: moving * (turn_rad + 0.035 * 0.1f64.sqrt() * n[1]),
                roll_rad: Some(NOISE.imu_rad * n[2]),
                pitch_rad: Some(NOISE.imu_rad * n[3]),
                yaw_rad: (step % STEPS_PER_STOP == 0).then(|| math::wrap_angle(yaw_rad + NOISE.sun_rad * n[4])),
            });
            if step % STEPS_PER_STOP == 0 {
                stops.push(seen(&rocks, &pose, step));
            }
        }
        Drive { start, readings, stops, view: view() }
    }

    fn cost(&self, particles: u32, max_features: u32) -> Cost {
        let params = SlamParams::Fastslam(FastslamParams { particles, max_features, ..FastslamParams::default() });
        let mut slam = Slam::new(&params, &NOISE, &self.start, &mast()).expect("a filter");
        let (mut scan_s, mut steps_s, mut features, mut landmarks) = (0.0, 0.0, 0, 0);
        for (reading, step) in self.readings.iter().zip(0..) {
            let before = thread_cpu_s();
            slam.step(reading).expect("upright");
            steps_s += thread_cpu_s() - before;
            if step % STEPS_PER_STOP == 0 {
                let found = &self.stops[(step / STEPS_PER_STOP) as usize];
                let before = thread_cpu_s();
                let estimate = slam.observe_features(found, &self.view, &streams(Stage::Slam, step)).expect("upright");
                scan_s += thread_cpu_s() - before;
                features += estimate.features;
                landmarks = slam.best().1.len();
            }
        }
        let stops = self.stops.len() as f64;
        let ms = |seconds: f64| 1e3 * seconds / stops;
        Cost {
            scan_ms: ms(scan_s),
            steps_ms: ms(steps_s),
            features: f64::from(features) / stops,
            landmarks: landmarks as f64,
        }
    }
}

/// What the sensor measures of rocks in range and within 120 degrees of ahead: 3 cm and 1 degree of noise.
fn seen(rocks: &[DVec3], pose: &Pose, step: u32) -> Vec<Feature> {
    let sensor_from_world = (pose.transform() * mast()).inverse();
    let n = normals(&mut streams(Stage::Sweep, step).open(Purpose::SlamSample), 3 * rocks.len());
    let degree = 1f64.to_radians();
    let mut features = Vec::new();
    for (rock, n) in rocks.iter().zip(n.as_chunks::<3>().0) {
        let q = sensor_from_world.point(*rock);
        let (range, bearing) = (q.length(), math::atan2(q.y, q.x));
        if range < RANGE_M && bearing.abs() < 120.0 * degree {
            let elevation = math::atan2(q.z, math::hypot(q.x, q.y));
            let polar = [range + 0.03 * n[0], bearing + degree * n[1], elevation + degree * n[2]];
            features.push(Feature { polar, points: 20, half_width_m: 0.1, known: None, sigmas: [None; 3] });
        }
    }
    features
}

/// Free sight in all directions.
fn view() -> Visibility<'static> {
    let directions: Vec<DVec3> = (0..40_000u32)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 40_000.0;
            let (s, c) = math::sin_cos(f64::from(i) * 2.399_963_229_728_653);
            DVec3::new(c * (1.0 - z * z).sqrt(), s * (1.0 - z * z).sqrt(), z)
        })
        .collect();
    Visibility::free(RANGE_M, &directions)
}
