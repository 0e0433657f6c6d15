//! The marsyard side of `scripts/poses.py`: drives of a config's scenes, located by its own filter, by registration alone, by dead reckoning, and by the filter
//! with one handicap after the other taken away.
//!
//! `poses CONFIG --scenes N [--set KEY=VALUE]` prints a line of JSON a scene: the way driven, and per variant the error and the covariance
//! of the estimate at the last stop. Features without handicap come from the truth: the centre of every body that returns eight beams or
//! more, with its number. The filter itself sees readings, sweeps and features only; truth makes the features of variants that say so,
//! and scores. Deviation from a build: which attempt at a drive is taken is decided by cells at the true pose.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Parser;
use marsyard::drive::InstrumentNoise;
use marsyard::episode::{Prepared, Replay, Scratch, Unobserved, replay_scene};
use marsyard::geometry::{DVec3, Pose, Transform};
use marsyard::plan::Family;
use marsyard::random::Stage;
use marsyard::scene::Scene;
use marsyard::slam::features::Extractor;
use marsyard::slam::{Estimate, FastslamParams, Feature, RegistrationParams, Slam, SlamParams};
use marsyard::sweep::{self, Caster, Pattern, Sweep};
use marsyard::{config, math};
use serde_json::{Value as Json, json};

type Fault = Box<dyn std::error::Error>;

/// Locate the drives of a config's scenes with and without each handicap; a line of JSON a scene.
#[derive(Debug, Parser)]
struct Arguments {
    /// A corpus config whose `slam` is `fastslam`.
    config: PathBuf,
    #[arg(long, default_value_t = 300)]
    scenes: u64,
    /// Override a key (repeatable).
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Dead reckoning, registration, the config's own filter and its ceiling, without one handicap after the other.
    #[arg(long)]
    without_handicaps: bool,
}

/// Beams that a body must return to be a feature: what the extractor asks of a cluster.
const LEAST_BEAMS: usize = 8;
/// A feature this far outside a body's bounding circle is not that body's.
const BESIDE_M: f64 = 0.15;
/// Takes the filter's feature noise to its floor of 1 cm and a quarter of a degree.
const EXACT: f64 = 0.01;

/// Of sweeps on the way that are thinned every so-manieth line and beam is left.
const EVERY: u32 = 2;

/// What a filter is given at a stop.
#[derive(Clone, Copy, PartialEq)]
enum Given {
    Nothing,
    /// The sweep, as in a build: to FastSLAM.
    Sweep,
    /// The same to the Kalman filter that lays sweeps on one another; thinned where it is not the last one.
    SweepToRegister {
        thinned: bool,
    },
    /// The extractor's features, each with the number of the body that it is; those of no body are left out.
    ExtractedKnown,
    /// Exact features of the bodies that the extractor found.
    FoundExact {
        known: bool,
    },
    /// Exact features of all bodies in view.
    AllExact {
        known: bool,
    },
}

/// A way to locate the drive.
struct Variant {
    name: &'static str,
    given: Given,
    params: FastslamParams,
}

/// A sweep and what is known of its bodies.
struct Stop {
    sweep: Sweep,
    thinned: Sweep,
    /// Exact features of the bodies in view.
    all: Vec<Feature>,
}

fn variants(own: &FastslamParams, without_handicaps: bool) -> Vec<Variant> {
    let own = || own.clone();
    let with = |particles, measurement_inflation| FastslamParams { particles, measurement_inflation, ..own() };
    let inflation = own().measurement_inflation;
    let variant = |name, given, params| Variant { name, given, params };
    let (known, unknown) = (true, false);
    let mut all = vec![
        variant("dead_reckoning", Given::Nothing, FastslamParams { particles: 1, ..FastslamParams::default() }),
        variant("registration", Given::SweepToRegister { thinned: false }, own()),
        variant("registration, every 2nd beam and line on the way", Given::SweepToRegister { thinned: true }, own()),
        variant("fastslam", Given::Sweep, own()),
        variant("fastslam, features alone", Given::Sweep, FastslamParams { registration: false, ..own() }),
        variant("ceiling", Given::AllExact { known }, with(100, EXACT)),
    ];
    if without_handicaps {
        return all;
    }
    all.extend([
        variant("ceiling, unknown association", Given::AllExact { known: unknown }, with(100, EXACT)),
        variant("ceiling, noise told as shipped", Given::AllExact { known }, with(100, inflation)),
        variant("ceiling, only what the extractor finds", Given::FoundExact { known }, with(100, EXACT)),
        variant("extracted, known association", Given::ExtractedKnown, with(100, inflation)),
        variant("fastslam, 300 particles", Given::Sweep, with(300, inflation)),
        variant("fastslam, inflation 1", Given::Sweep, with(100, 1.0)),
    ]);
    all
}

fn main() -> Result<(), Fault> {
    let arguments = Arguments::parse();
    let plan = config::load(&arguments.config, &arguments.sets)?;
    let truthful: Vec<String> = arguments.sets.iter().cloned().chain(["slam=truth".to_string()]).collect();
    let prepared = Prepared::new(config::load(&arguments.config, &truthful)?)?;
    let mut scratch = Scratch::default();
    for scene in 0..arguments.scenes {
        let Ok(replay) = replay_scene(&prepared, scene, &mut scratch, &mut Unobserved) else { continue };
        let family = &plan.families[replay.family];
        let SlamParams::Fastslam(own) = &family.slam else { return Err("the config's slam is no fastslam".into()) };
        let study = Study { prepared: &prepared, scene, replay: &replay, family };
        let mut variants = variants(own, arguments.without_handicaps);
        // Cells that read several sweeps are made of whole ones, which a build does not thin.
        variants.retain(|variant| {
            variant.given != Given::SweepToRegister { thinned: true } || family.cells.window_scans == 1
        });
        println!("{}", study.run(&variants)?);
    }
    Ok(())
}

struct Study<'a> {
    prepared: &'a Prepared,
    scene: u64,
    replay: &'a Replay,
    family: &'a Family,
}

impl Study<'_> {
    fn run(&self, variants: &[Variant]) -> Result<Json, Fault> {
        let (drive, drawn) = (&self.replay.drive, &self.replay.drawn);
        let mut stops = BTreeMap::new();
        for (k, &step) in drive.stops.iter().enumerate() {
            stops.insert(step, self.stop(step, k as u32)?);
        }
        let last = *drive.stops.last().ok_or("a drive has a stop")?;
        let mut of_variants = serde_json::Map::new();
        for variant in variants {
            let located = self.locate(variant, &stops, last)?;
            of_variants.insert(variant.name.into(), located);
        }
        let way_m: f64 = drive.truth.windows(2).map(|pair| pair[1].position_m.distance(pair[0].position_m)).sum();
        let noise = InstrumentNoise::of(&self.family.drive.instruments, drawn);
        let [start, end] = [0, last].map(|step| drive.truth[step].position_m.to_array());
        Ok(json!({
            "scene": self.scene,
            "family": self.family.name,
            "way_m": way_m,
            "start_m": start,
            "end_m": end,
            "imu_rad": noise.imu_rad,
            "sun_rad": noise.sun_rad,
            "odometry_m_per_sqrt_m": noise.odometry_m_per_sqrt_m,
            "bodies": mean(drive.stops.iter().map(|step| stops[step].all.len() as f64)),
            "variants": of_variants,
        }))
    }

    /// The sweep of a step, as a build makes it, and the bodies in it.
    fn stop(&self, step: usize, stop: u32) -> Result<Stop, Fault> {
        let Replay { scene, drive, drawn, rover_from_sensor, attempts, .. } = self.replay;
        let world_from_sensor = drive.truth[step].transform() * *rover_from_sensor;
        let params = &self.family.sweep;
        let whole = self.prepared.pattern(self.replay.family);
        let thinned = Arc::new(whole.thinned(EVERY));
        let streams = self.prepared.plan.streams(self.scene, attempts - 1, Stage::Sweep).at_step(stop);
        let caster = Caster::new(scene, &params.cast);
        let mut memory = sweep::Scratch::default();
        let mut made = |pattern: &Arc<Pattern>| {
            sweep::sweep(params, pattern, &caster, &world_from_sensor, drawn, &streams, &mut memory)
        };
        let (sweep, thinned) = (made(whole)?, made(&thinned)?);
        let all = exact_features(scene, &sweep, &world_from_sensor);
        Ok(Stop { sweep, thinned, all })
    }

    fn locate(&self, variant: &Variant, stops: &BTreeMap<usize, Stop>, last: usize) -> Result<Json, Fault> {
        let Replay { drive, drawn, rover_from_sensor, attempts, .. } = self.replay;
        let noise = InstrumentNoise::of(&self.family.drive.instruments, drawn);
        let params = match variant.given {
            Given::Nothing => SlamParams::DeadReckoning,
            Given::SweepToRegister { .. } => SlamParams::Registration(RegistrationParams {
                range_m: variant.params.feature_range_m,
                ..Default::default()
            }),
            _ => SlamParams::Fastslam(variant.params.clone()),
        };
        let mut slam = Slam::new(&params, &noise, &drive.truth[0], rover_from_sensor)?;
        let mut extractor = Extractor::new(variant.params.feature_range_m, rover_from_sensor);
        let (mut features, mut matched) = (Vec::new(), Vec::new());
        for (step, reading) in drive.readings[..=last].iter().enumerate() {
            let streams = self.prepared.plan.streams(self.scene, attempts - 1, Stage::Slam).at_step(step as u32);
            slam.step(reading)?;
            let Some(stop) = stops.get(&step) else { continue };
            let estimate = match variant.given {
                Given::Nothing => continue,
                Given::SweepToRegister { thinned: true } if step != last => {
                    slam.observe(&stop.thinned.returns, &streams)?
                }
                Given::Sweep | Given::SweepToRegister { .. } => slam.observe(&stop.sweep.returns, &streams)?,
                given => {
                    let believed = slam.estimate().pose;
                    let sight = extractor.extract(&stop.sweep.returns, believed.roll_rad, believed.pitch_rad);
                    let world_from_sensor = drive.truth[step].transform() * *rover_from_sensor;
                    let owned = owned(&self.replay.scene, sight.features, &world_from_sensor, &stop.all);
                    slam.observe_features(&seen(given, stop, &owned), &sight.visibility, &streams)?
                }
            };
            features.push(f64::from(estimate.features));
            matched.push(f64::from(estimate.matched));
        }
        let estimate = slam.estimate();
        Ok(json!({
            "error": error(&estimate, &drive.truth[last]),
            "covariance": triangle(&estimate.covariance),
            "features": mean(features),
            "matched": mean(matched),
            "optimistic": estimate.sigma_optimistic,
        }))
    }
}

/// The features of a variant; `owned` are the extractor's that are of a body.
fn seen(given: Given, stop: &Stop, owned: &[Feature]) -> Vec<Feature> {
    let anonymous =
        |known: bool| move |feature: &Feature| Feature { known: feature.known.filter(|_| known), ..*feature };
    match given {
        Given::Nothing | Given::Sweep | Given::SweepToRegister { .. } => Vec::new(),
        Given::ExtractedKnown => owned.to_vec(),
        Given::AllExact { known } => stop.all.iter().map(anonymous(known)).collect(),
        Given::FoundExact { known } => {
            let is_found = |feature: &&Feature| owned.iter().any(|own| own.known == feature.known);
            stop.all.iter().filter(is_found).map(anonymous(known)).collect()
        }
    }
}

/// Exact features of the bodies that return enough beams, by the bodies' centres.
fn exact_features(scene: &Scene, sweep: &Sweep, world_from_sensor: &Transform) -> Vec<Feature> {
    let mut beams = vec![0u32; scene.obstacles.len()];
    for truth in &sweep.truth {
        if let Some(count) = usize::try_from(truth.object).ok().and_then(|id| beams.get_mut(id)) {
            *count += 1;
        }
    }
    let sensor_from_world = world_from_sensor.inverse();
    let of_body = |(id, &points): (usize, &u32)| {
        let place = sensor_from_world.point(scene.obstacles[id].body().centre_m);
        let polar =
            [place.length(), math::atan2(place.y, place.x), math::atan2(place.z, math::hypot(place.x, place.y))];
        Feature {
            polar,
            points,
            half_width_m: scene.obstacles[id].body().radius_m,
            known: Some(id as u32),
            sigmas: [None; 3],
        }
    };
    beams.iter().enumerate().filter(|&(_, &count)| count as usize >= LEAST_BEAMS).map(of_body).collect()
}

/// The extractor's features that are of a body in view, with its number; of two on one body the one of more points.
fn owned(scene: &Scene, found: &[Feature], world_from_sensor: &Transform, all: &[Feature]) -> Vec<Feature> {
    let mut by_body: BTreeMap<u32, Feature> = BTreeMap::new();
    for feature in found {
        let place_m = world_from_sensor.point(cartesian(&feature.polar));
        let beside_m = |id: u32| {
            let body = scene.obstacles[id as usize].body();
            place_m.truncate().distance(body.centre_m.truncate()) - body.radius_m
        };
        let bodies = all.iter().filter_map(|body| body.known);
        let Some(id) =
            bodies.min_by(|&a, &b| beside_m(a).total_cmp(&beside_m(b))).filter(|&id| beside_m(id) < BESIDE_M)
        else {
            continue;
        };
        let own = Feature { known: Some(id), ..*feature };
        let kept = by_body.entry(id).or_insert(own);
        if own.points > kept.points {
            *kept = own;
        }
    }
    by_body.into_values().collect()
}

fn cartesian(&[range_m, bearing_rad, elevation_rad]: &[f64; 3]) -> DVec3 {
    let ((sb, cb), (se, ce)) = (math::sin_cos(bearing_rad), math::sin_cos(elevation_rad));
    range_m * DVec3::new(ce * cb, ce * sb, se)
}

fn error(estimate: &Estimate, truth: &Pose) -> [f64; 6] {
    let apart_m = estimate.pose.position_m - truth.position_m;
    let Pose { roll_rad, pitch_rad, yaw_rad, .. } = estimate.pose;
    let angles = [(roll_rad, truth.roll_rad), (pitch_rad, truth.pitch_rad), (yaw_rad, truth.yaw_rad)];
    let [roll, pitch, yaw] = angles.map(|(believed, true_rad)| math::wrap_angle(believed - true_rad));
    [apart_m.x, apart_m.y, apart_m.z, roll, pitch, yaw]
}

/// The upper triangle, row by row.
fn triangle(covariance: &[[f64; 6]; 6]) -> Vec<f64> {
    (0..6).flat_map(|r| covariance[r][r..].to_vec()).collect()
}

fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.into_iter().fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}
