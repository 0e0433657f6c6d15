//! The measuring side of `scripts/complexity.py`: what one unit of work costs when one size grows and all others stay.
//!
//! Reads lines `SIZE VALUE` from stdin and answers each with the CPU seconds of one call, the median of some (see `measure`).

use std::io::{BufRead, Write};

use marsyard::cells::{self, WindowScan};
use marsyard::drive::{InstrumentNoise, Reading};
use marsyard::geometry::{DVec3, Pose, Transform};
use marsyard::math;
use marsyard::random::{Stage, Streams};
use marsyard::scene::polynomial::term_count;
use marsyard::scene::{Ground, Polynomial, Scene};
use marsyard::slam::{FastslamParams, Feature, Slam, SlamParams, Visibility};
use marsyard::sweep::Caster;
use marsyard::sweep::params::Cast;

#[path = "../shared/mod.rs"]
mod shared;

use shared::paper::{prepared, replays};
use shared::yards::{self, Yard, tilted};

const RAYS: [usize; 2] = [361, 100];

fn main() {
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let Some((size, value)) = line.split_once(' ').and_then(|(size, value)| Some((size, value.parse().ok()?)))
        else {
            break;
        };
        let Some(seconds) = measure(size, value) else { break };
        println!("{seconds:.9}");
        std::io::stdout().flush().expect("somebody listens");
    }
}

fn measure(size: &str, value: f64) -> Option<f64> {
    let [beams, tilts] = RAYS;
    Some(match size {
        // Rays of one sweep, 4 m, among the rocks of S2.
        "rays" => cast_s(&yards::YARDS[1].scene(), &tilted("", (value / tilts as f64) as usize, 180.0, tilts, 4.0)),
        // Rocks on 100 x 100 m; a sweep of 30 m.
        "rocks" => {
            let yard = Yard { rocks: value as usize, ..yards::YARDS[2] };
            cast_s(&yard.scene(), &tilted("", beams, 180.0, tilts, 30.0))
        }
        // Rocks on 100 x 100 m: time to make them ready to be cast at.
        "rocks_setup" => {
            let scene = Yard { rocks: value as usize, ..yards::YARDS[2] }.scene();
            shared::seconds(|| {
                std::hint::black_box(Caster::new(&scene, &Cast::Exact).scene());
            })
        }
        // Reach of a sweep over 400 x 400 m with a rock every five square metres in the middle.
        "range" => {
            let yard = Yard { extent_m: 400.0, rocks: 30_000, ..yards::YARDS[2] };
            cast_s(&yard.scene(), &tilted("", beams, 180.0, tilts, value))
        }
        // Degree of the ground without rocks; 4 m.
        "degree" => {
            let degree = value as usize;
            let coefficients =
                (0..term_count(degree)).map(|k| 0.3 * math::sin(1.0 + 2.0 * k as f64) / (1 + k) as f64).collect();
            let ground = Polynomial::new(20.0, degree, coefficients);
            cast_s(&Scene::bare(20.0, Ground::Polynomial(ground)), &tilted("", beams, 180.0, tilts, 4.0))
        }
        // Particles at 8 features a scan, and features at 100 particles.
        "particles" => slam_s(value as u32, 8),
        "features" => slam_s(100, value as u32),
        // Cells of one kept sweep: the same points on a finer grid.
        "cells" => cells_s(value)?,
        _ => return None,
    })
}

fn cast_s(scene: &Scene, sweep: &yards::Sweep) -> f64 {
    let caster = Caster::new(scene, &Cast::Exact);
    let middle_m = 0.5 * scene.extent_m;
    let origin_m = DVec3::new(middle_m, middle_m, scene.ground.height_m(middle_m, middle_m) + 0.4);
    let mut hits = Vec::new();
    shared::seconds(|| caster.from(origin_m, sweep.reach_m).cast(&sweep.dirs, &mut hits))
}

/// One scan of a rover that stands among landmarks it knows.
fn slam_s(particles: u32, features: u32) -> f64 {
    let noise = InstrumentNoise {
        imu_rad: 0.01,
        imu_bias_rad: 0.0,
        sun_rad: 0.02,
        odometry_m_per_sqrt_m: 0.05,
        sideways_m_per_sqrt_m: 0.0,
        slip: 0.0,
        heading_rad_per_sqrt_m: 0.03,
    };
    let params =
        SlamParams::Fastslam(FastslamParams { particles, max_features: features, ..FastslamParams::default() });
    let mast = Transform { translation_m: DVec3::new(0.2, 0.0, 0.5), ..Transform::IDENTITY };
    // On a ring of rows, each feature well apart from the others.
    let seen: Vec<Feature> = (0..features)
        .map(|k| {
            let turn = 2.0 * f64::from(k) / f64::from(features) - 1.0;
            Feature {
                polar: [1.5 + f64::from(k % 4), 2.0 * turn, -0.2],
                points: 100,
                half_width_m: 0.15,
                known: None,
                sigmas: [None; 3],
            }
        })
        .collect();
    let ahead: Vec<DVec3> = (0..4000)
        .map(|k| {
            let ((sb, cb), (se, ce)) =
                (math::sin_cos(f64::from(k % 200) * 0.03 - 3.0), math::sin_cos(f64::from(k / 200) * 0.06 - 0.8));
            DVec3::new(ce * cb, ce * sb, se)
        })
        .collect();
    let view = Visibility::free(6.0, &ahead);
    let reading = Reading {
        dt_s: 1.0,
        speed_mps: 0.0,
        yaw_rate_radps: 0.0,
        roll_rad: Some(0.0),
        pitch_rad: Some(0.0),
        yaw_rad: Some(0.0),
    };
    let mut slam = Slam::new(&params, &noise, &Pose::default(), &mast).expect("a filter");
    let mut step = 0;
    shared::seconds(|| {
        let streams = Streams { seed: 1, scene: 0, attempt: 0, stage: Stage::Slam, step };
        slam.step(&reading).expect("upright");
        slam.observe_features(&seen, &view, &streams).expect("upright");
        step += 1;
    })
}

/// Binning of one sweep into about so many cells.
fn cells_s(wanted: f64) -> Option<f64> {
    let prepared = prepared("paper.yaml", &["drive.contact=gauss_newton"]).keeping_points();
    let replay = replays(&prepared, 1).remove(0);
    let family = prepared.plan.family_of(0);
    let points = replay.scans.first()?.points.as_ref()?;
    let pose = replay.poses.iter().rfind(|pose| pose.scan_id.is_some())?;
    let scan = WindowScan {
        sweep: &points.sweep,
        estimate: &pose.estimate,
        map_from_sensor: points.map_from_sensor,
        world_from_sensor: pose.truth.transform() * replay.rover_from_sensor,
    };
    let mut params = family.cells.clone();
    let mut scratch = cells::Scratch::default();
    let mut bin = |size_m: f64| {
        params.size_m = size_m;
        let wheel_m = family.drive.rover.wheel_diameter_m;
        cells::bin(&params, &[scan], wheel_m, points.max_range_m, &replay.scene, &mut scratch)
    };
    // The number of cells falls with their size.
    let (mut fine_m, mut coarse_m) = (0.005, 2.0f64);
    while coarse_m / fine_m > 1.01 {
        let middle_m = (fine_m * coarse_m).sqrt();
        if bin(middle_m).rows.len() as f64 > wanted { fine_m = middle_m } else { coarse_m = middle_m }
    }
    Some(shared::seconds(|| {
        bin(coarse_m);
    }))
}
