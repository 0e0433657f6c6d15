//! A seed -> a drive over wavy ground among point landmarks, with the readings a rover would have.
//!
//! Simulated here, apart from the drive and sweep stages, with the noise that the filter assumes. Scenario A is an arc
//! of 12.6 m, scenario B two laps of 63 m, which come back to known landmarks.

use marsyard::drive::{InstrumentNoise, Reading};
use marsyard::geometry::{DMat3, DVec2, DVec3, Pose, Transform};
use marsyard::math;
use marsyard::slam::{Feature, Visibility};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

pub const RADIUS_M: f64 = 5.0;
pub const RANGE_M: f64 = 4.0;
const STEP_M: f64 = 0.1;
/// Sideways slip of the true path, and noise of a turn as a share of it.
const LATERAL_M_PER_SQRT_M: f64 = 0.02;
const TURN_SHARE: f64 = 0.05;
/// Relief under a wheel that pitch does not tell of: what the filter makes of slopes that change by some 8 degrees per square root of a metre.
const VERTICAL_M_PER_SQRT_M: f64 = 0.005;
const STEPS_A_STOP: usize = 5;
const HALF_VIEW_RAD: f64 = 120.0 / 180.0 * std::f64::consts::PI;

/// What a run is made of; the default is scenario A.
#[derive(Clone)]
pub struct Scenario {
    pub length_m: f64,
    pub rocks: usize,
    pub known: bool,
    /// Share of the odometry's distance that is slip.
    pub slip: f64,
    /// What a drive's share differs from that by, drawn from a normal law: its standard deviation, which the filter is told.
    pub slip_drawn: f64,
    pub sun: bool,
    /// Factor on all instrument noise of the simulation and of what the filter is told.
    pub odometry_factor: f64,
    pub imu_bias_rad: f64,
    pub origin_m: DVec3,
    pub first_yaw_rad: f64,
    /// +1 turns left, -1 right.
    pub side: f64,
    /// Sideways slip and relief between readings, as the filter assumes them; the reference scenarios have neither.
    pub bumps: bool,
    /// Features are lost between these distances.
    pub blind_m: std::ops::Range<f64>,
}

impl Scenario {
    pub fn a() -> Scenario {
        Scenario {
            length_m: 12.6,
            rocks: 60,
            known: false,
            slip: 0.0,
            slip_drawn: 0.0,
            sun: true,
            odometry_factor: 1.0,
            imu_bias_rad: 0.0,
            origin_m: DVec3::ZERO,
            first_yaw_rad: std::f64::consts::FRAC_PI_2,
            side: 1.0,
            bumps: false,
            blind_m: 0.0..0.0,
        }
    }

    /// Two laps.
    pub fn b() -> Scenario {
        Scenario { length_m: 63.0, ..Scenario::a() }
    }

    pub fn noise(&self) -> InstrumentNoise {
        InstrumentNoise {
            imu_rad: 0.5f64.to_radians(),
            imu_bias_rad: self.imu_bias_rad,
            sun_rad: 2f64.to_radians(),
            odometry_m_per_sqrt_m: 0.05 * self.odometry_factor,
            sideways_m_per_sqrt_m: if self.bumps { LATERAL_M_PER_SQRT_M } else { 0.0 },
            slip: self.slip_drawn,
            heading_rad_per_sqrt_m: 2f64.to_radians() * self.odometry_factor,
        }
    }
}

/// One simulated drive.
pub struct Drive {
    pub truth: Vec<Pose>,
    pub readings: Vec<Reading>,
    /// Per step: the features, at stops.
    pub features: Vec<Option<Vec<Feature>>>,
    pub rover_from_sensor: Transform,
    pub visibility: Visibility<'static>,
}

pub fn mast() -> Transform {
    Transform { rotation: DMat3::IDENTITY, translation_m: DVec3::new(0.1, 0.0, 0.6) }
}

/// Slopes up to some 20 degrees.
struct Waves {
    phases: [f64; 4],
}

impl Waves {
    const SHAPE: [[f64; 3]; 4] = [[0.22, 0.8, 0.1], [0.18, -0.2, 0.9], [0.06, 1.3, 0.9], [0.05, -1.1, 1.4]];

    fn height_m(&self, x: f64, y: f64) -> f64 {
        let wave = |([a, kx, ky], phase): ([f64; 3], f64)| a * math::sin(kx * x + ky * y + phase);
        Waves::SHAPE.into_iter().zip(self.phases).map(wave).sum()
    }

    fn gradient(&self, x: f64, y: f64) -> DVec2 {
        let mut sum = DVec2::ZERO;
        for ([a, kx, ky], phase) in Waves::SHAPE.into_iter().zip(self.phases) {
            let c = a * math::cos(kx * x + ky * y + phase);
            sum += c * DVec2::new(kx, ky);
        }
        sum
    }
}

/// The pose of a rover that stands on the tangent plane.
pub fn on_slope(at_m: DVec2, height_m: f64, gradient: DVec2, yaw_rad: f64) -> Pose {
    let up = DVec3::new(-gradient.x, -gradient.y, 1.0).normalize();
    let (s, c) = math::sin_cos(yaw_rad);
    let ahead = DVec3::new(c, s, gradient.x * c + gradient.y * s).normalize();
    let rotation = DMat3::from_cols(ahead, up.cross(ahead), up);
    Pose::from_transform(&Transform { rotation, translation_m: at_m.extend(height_m) })
}

pub fn drive(seed: u64, scenario: &Scenario) -> Drive {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(7919).wrapping_add(17));
    let waves = Waves { phases: std::array::from_fn(|_| rng.random_range(0.0..std::f64::consts::TAU)) };
    let rocks: Vec<DVec3> = (0..scenario.rocks)
        .map(|_| {
            let (x, y) = (rng.random_range(-9.0..9.0), rng.random_range(-9.0..9.0));
            DVec3::new(x, y, waves.height_m(x, y) + rng.random_range(0.08..0.3)) + scenario.origin_m
        })
        .collect();
    drive_on(seed, scenario, |at| (waves.height_m(at.x, at.y), waves.gradient(at.x, at.y)), &rocks)
}

/// The drive around the origin over any ground: its height and gradient at a place.
pub fn drive_on(seed: u64, scenario: &Scenario, ground: impl Fn(DVec2) -> (f64, DVec2), rocks: &[DVec3]) -> Drive {
    let mut normal = {
        let mut noise = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(104_729).wrapping_add(5));
        move || -> f64 { StandardNormal.sample(&mut noise) }
    };
    let noise = scenario.noise();
    // From a generator of its own, so that drives are the same but for it.
    let slip_draw: f64 =
        StandardNormal.sample(&mut ChaCha8Rng::seed_from_u64(seed.wrapping_mul(104_729).wrapping_add(7)));
    let slip = scenario.slip + scenario.slip_drawn * slip_draw;
    let steps = (scenario.length_m / STEP_M).round() as usize;
    let rover_from_sensor = mast();
    let turn = scenario.side * STEP_M / RADIUS_M;
    let mut drive = Drive {
        truth: Vec::new(),
        readings: Vec::new(),
        features: Vec::new(),
        rover_from_sensor,
        visibility: visibility(),
    };
    // The circle around the origin that is left (right) of the heading, and how far slip has carried the rover off it.
    let (s, c) = math::sin_cos(scenario.first_yaw_rad);
    let (mut x, mut y) = (scenario.side * RADIUS_M * s, -scenario.side * RADIUS_M * c);
    let (mut relief_m, mut on_slope_m) = (0.0, None);
    for k in 0..=steps {
        let yaw = math::wrap_angle(scenario.first_yaw_rad + turn * k as f64);
        let aside_m = if k == 0 || !scenario.bumps { 0.0 } else { LATERAL_M_PER_SQRT_M * STEP_M.sqrt() * normal() };
        if k > 0 {
            let (s, c) = math::sin_cos(yaw - 0.5 * turn);
            (x, y) = (x + STEP_M * c - aside_m * s, y + STEP_M * s + aside_m * c);
        }
        if k > 0 && scenario.bumps {
            relief_m += VERTICAL_M_PER_SQRT_M * STEP_M.sqrt() * normal();
        }
        let (height_m, gradient) = ground(DVec2::new(x, y));
        let mut pose = on_slope(DVec2::new(x, y), height_m, gradient, yaw);
        pose.position_m += scenario.origin_m;
        let stop = k % STEPS_A_STOP == 0;
        let moved_m = on_slope_m.map_or(0.0, |last: DVec3| last.distance(pose.position_m));
        on_slope_m = Some(pose.position_m);
        pose.position_m.z += relief_m;
        let driven_m = (moved_m * moved_m - aside_m * aside_m).max(0.0).sqrt();
        let slipped_m = driven_m / (1.0 - slip);
        let yaw_rate = if k == 0 { 0.0 } else { turn };
        let yaw_sigma = noise.heading_rad_per_sqrt_m * driven_m.sqrt() + TURN_SHARE * yaw_rate.abs();
        drive.readings.push(Reading {
            dt_s: if k == 0 { 0.0 } else { 1.0 },
            speed_mps: slipped_m + noise.odometry_m_per_sqrt_m * driven_m.sqrt() * normal(),
            yaw_rate_radps: yaw_rate + yaw_sigma * normal(),
            roll_rad: Some(pose.roll_rad + scenario.imu_bias_rad + noise.imu_rad * normal()),
            pitch_rad: Some(pose.pitch_rad + scenario.imu_bias_rad + noise.imu_rad * normal()),
            yaw_rad: (scenario.sun && stop).then(|| math::wrap_angle(pose.yaw_rad + noise.sun_rad * normal())),
        });
        drive.features.push(stop.then(|| {
            let blind = scenario.blind_m.contains(&(k as f64 * STEP_M));
            let found = seen(rocks, &(pose.transform() * rover_from_sensor), scenario.known, &mut normal);
            if blind { Vec::new() } else { found }
        }));
        drive.truth.push(pose);
    }
    drive
}

/// Point features with white noise: 3 cm, 1 degree, 1 degree.
fn seen(rocks: &[DVec3], world_from_sensor: &Transform, known: bool, normal: &mut impl FnMut() -> f64) -> Vec<Feature> {
    let sensor_from_world = world_from_sensor.inverse();
    let mut features = Vec::new();
    for (id, rock) in rocks.iter().enumerate() {
        let q = sensor_from_world.point(*rock);
        let (range, bearing) = (q.length(), math::atan2(q.y, q.x));
        if range > RANGE_M || bearing.abs() > HALF_VIEW_RAD {
            continue;
        }
        let elevation = math::atan2(q.z, math::hypot(q.x, q.y));
        let polar = [
            range + 0.03 * normal(),
            math::wrap_angle(bearing + 1f64.to_radians() * normal()),
            elevation + 1f64.to_radians() * normal(),
        ];
        features.push(Feature {
            polar,
            points: 20,
            half_width_m: 0.1,
            known: known.then_some(id as u32),
            sigmas: [None; 3],
        });
    }
    features
}

/// All directions within the field of view, no occlusion.
fn visibility() -> Visibility<'static> {
    let mut directions = Vec::new();
    for i in 0..240 {
        for j in -89..=89 {
            let (s, c) = math::sin_cos((f64::from(i) - 119.5).to_radians());
            let (se, ce) = math::sin_cos(f64::from(j).to_radians());
            directions.push(DVec3::new(c * ce, s * ce, se));
        }
    }
    Visibility::free(0.9 * RANGE_M, &directions)
}
