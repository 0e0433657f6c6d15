//! Yards of marsyard's own polyhedra, swept by the URG-04LX -> how well the extractor finds their rocks.

use std::sync::Arc;

use marsyard::geometry::{DVec2, DVec3, Pose, Transform};
use marsyard::math;
use marsyard::random::{Drawn, Stage, Streams};
use marsyard::scene::{Obstacle, Scene, SceneParams, Shape};
use marsyard::slam::features::Extractor;
use marsyard::sweep::{Caster, Pattern, Scratch, Sensor, Sweep, SweepParams, sweep};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use super::world::{Drive, RADIUS_M, Scenario, drive_on, on_slope};

pub const RANGE_M: f64 = 5.3;
/// Kapvik's.
const MAST_M: DVec3 = DVec3::new(0.3, 0.0, 0.4);

const YARD: &str = "
extent_m: 20
ground: {source: {random: {rms_height_m: {uniform: [0.05, 0.4]}, correlation_length_m: {uniform: [6, 10]}}}}
rocks: {count: 120, diameter_m: {log_uniform: [0.15, 0.8]}}
";
const SWEEP: &str = "
sensor: urg-04lx
effects: {range_noise: {}, gates: {}}
";

/// What a study needs once.
pub struct Study {
    sweep: SweepParams,
    pattern: Arc<Pattern>,
}

/// One feature and the rock that it is.
pub struct Finding {
    pub rock_diameter_m: f64,
    pub half_width_m: f64,
    /// Feature minus rock centre: along the line of sight, across it, and from the rock's top.
    pub along_m: f64,
    pub across_m: f64,
    pub top_m: f64,
}

#[derive(Default)]
pub struct Tally {
    pub findings: Vec<Finding>,
    pub spurious: usize,
    /// Per rock in view with eight points or more: diameter, and whether it was found.
    pub rocks: Vec<(f64, bool)>,
    pub scans: usize,
    pub extraction_s: f64,
}

impl Study {
    pub fn new() -> Study {
        let sensor: Sensor =
            serde_saphyr::from_str(include_str!("../../../configs/sensors/urg-04lx.yaml")).expect("a sensor");
        let mut sweep: SweepParams = serde_saphyr::from_str(SWEEP).expect("a section");
        sweep.sensor = marsyard::preset::Preset::Inline(Box::new(sensor.clone()));
        Study { sweep, pattern: Arc::new(Pattern::build(&sensor).expect("a pattern")) }
    }

    /// Some places in one yard, in clear ground, the attitude known to half a degree.
    pub fn yard(&self, seed: u64, places: usize, tally: &mut Tally) {
        let scene = yard(seed);
        let caster = Caster::new(&scene, &self.sweep.cast);
        let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 };
        let drawn = Drawn::draw(&streams, self.sweep.dists());
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut scratch = Scratch::default();
        let mount = Transform { translation_m: MAST_M, ..Transform::IDENTITY };
        let mut extractor = Extractor::new(RANGE_M, &mount);
        for step in 0..places {
            let Some(pose) = clear_place(&scene, &mut rng) else { continue };
            let world_from_sensor = pose.transform() * mount;
            let streams = streams.at_step(step as u32);
            let sweep = sweep(&self.sweep, &self.pattern, &caster, &world_from_sensor, &drawn, &streams, &mut scratch)
                .expect("clear");
            let mut off = || 0.5f64.to_radians() * Distribution::<f64>::sample(&StandardNormal, &mut rng);
            let (roll_rad, pitch_rad) = (pose.roll_rad + off(), pose.pitch_rad + off());
            let clock = std::time::Instant::now();
            let features = extractor.extract(&sweep.returns, roll_rad, pitch_rad).features;
            tally.extraction_s += clock.elapsed().as_secs_f64();
            tally.scans += 1;
            let features: Vec<_> =
                features.iter().map(|f| (world_from_sensor.point(cartesian(&f.polar)), f.half_width_m)).collect();
            tally.score(&scene, &sweep, world_from_sensor.translation_m, &features);
        }
    }
}

/// A yard of 60 rocks in 18 m squared with a free ring of 5 m radius around its centre, and a drive along it: scenario A
/// with real rocks.
pub struct RingDrive {
    pub drive: Drive,
    /// Per step: the sweep, at stops.
    pub sweeps: Vec<Option<Sweep>>,
}

impl Study {
    pub fn ring(&self, seed: u64, scenario: &Scenario) -> RingDrive {
        let full = yard(seed);
        let centre_m = DVec2::splat(10.0);
        let mut scene = Scene::bare(full.extent_m, full.ground.clone());
        for rock in &full.obstacles {
            let from_ring_m = (rock.body().centre_m.truncate().distance(centre_m) - RADIUS_M).abs();
            let inside = (rock.body().centre_m.truncate() - centre_m).abs().max_element() < 9.0;
            if scene.obstacles.len() < scenario.rocks && inside && from_ring_m > rock.body().radius_m + 0.5 {
                scene = scene.with_obstacle(rock.class, rock.body().shape.clone());
            }
        }
        // Oracle features: the middles and tops of the rocks, relative to the ring's centre.
        let origin_m = centre_m.extend(0.0);
        let rocks: Vec<DVec3> = scene
            .obstacles
            .iter()
            .map(|o| rock(&scene, o))
            .filter(|r| r.middle_m.is_finite())
            .map(|r| r.middle_m.extend(r.top_m))
            .collect();
        let scenario = Scenario { origin_m, ..scenario.clone() };
        let ground = |at: DVec2| {
            let at = at + centre_m;
            (scene.ground.height_m(at.x, at.y), scene.ground.gradient(at.x, at.y))
        };
        let drive = drive_on(seed, &scenario, ground, &rocks);
        let caster = Caster::new(&scene, &self.sweep.cast);
        let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 };
        let drawn = Drawn::draw(&streams, self.sweep.dists());
        let mut scratch = Scratch::default();
        let sweeps = drive
            .truth
            .iter()
            .zip(&drive.features)
            .zip(0..)
            .map(|((pose, stop), step)| {
                stop.as_ref()?;
                let world_from_sensor = pose.transform() * drive.rover_from_sensor;
                let streams = streams.at_step(step);
                sweep(&self.sweep, &self.pattern, &caster, &world_from_sensor, &drawn, &streams, &mut scratch).ok()
            })
            .collect();
        RingDrive { drive, sweeps }
    }
}

fn cartesian([range, bearing, elevation]: &[f64; 3]) -> DVec3 {
    let ((sb, cb), (se, ce)) = (math::sin_cos(*bearing), math::sin_cos(*elevation));
    *range * DVec3::new(ce * cb, ce * sb, se)
}

pub fn yard(seed: u64) -> Scene {
    let params: SceneParams = serde_saphyr::from_str(YARD).expect("a section");
    let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Scene, step: 0 };
    let drawn = Drawn::draw(&streams, params.dists());
    marsyard::scene::build(&params, &drawn, &streams).expect("a yard")
}

/// The pose on the ground's tangent plane, at least half a metre from every rock and 5 m from the edge.
fn clear_place(scene: &Scene, rng: &mut ChaCha8Rng) -> Option<Pose> {
    for _ in 0..200 {
        let at = DVec2::new(rng.random_range(5.0..15.0), rng.random_range(5.0..15.0));
        let yaw_rad: f64 = rng.random_range(-3.1..3.1);
        if scene.obstacles.iter().all(|o| o.body().centre_m.truncate().distance(at) > o.body().radius_m + 0.5) {
            return Some(on_slope(at, scene.ground.height_m(at.x, at.y), scene.ground.gradient(at.x, at.y), yaw_rad));
        }
    }
    None
}

/// Where a rock is: the middle, seen from above, of the part that stands out, and its top.
struct Rock {
    middle_m: DVec2,
    half_width_m: f64,
    top_m: f64,
}

fn rock(scene: &Scene, obstacle: &Obstacle) -> Rock {
    let Shape::Convex(body) = &obstacle.body().shape else { panic!("rocks are polyhedra") };
    // The outline above the ground: a fine grid over the bounding circle, which also does for rocks cut by the ground.
    let (mut sum, mut count, mut top_m) = (DVec2::ZERO, 0.0, f64::NEG_INFINITY);
    for i in -30..=30 {
        for j in -30..=30 {
            let at = obstacle.body().centre_m.truncate()
                + obstacle.body().radius_m / 30.0 * DVec2::new(f64::from(i), f64::from(j));
            let ground_m = scene.ground.height_m(at.x, at.y);
            if let Some(height_m) = roof_m(&body.planes, at).filter(|&h| h > ground_m) {
                sum += at;
                count += 1.0;
                top_m = top_m.max(height_m);
            }
        }
    }
    let cell_m = obstacle.body().radius_m / 30.0;
    Rock { middle_m: sum / count, half_width_m: (count * cell_m * cell_m / std::f64::consts::PI).sqrt(), top_m }
}

/// The highest point of a convex body above a place, by clipping the upright line.
fn roof_m(planes: &[marsyard::scene::Plane], at: DVec2) -> Option<f64> {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for plane in planes {
        let flat = plane.normal.truncate().dot(at) + plane.offset_m;
        let z = -flat / plane.normal.z;
        if plane.normal.z > 1e-12 {
            high = high.min(z);
        } else if plane.normal.z < -1e-12 {
            low = low.max(z);
        } else if flat > 0.0 {
            return None;
        }
    }
    (low <= high).then_some(high)
}

impl Tally {
    fn score(&mut self, scene: &Scene, sweep: &Sweep, sensor_m: DVec3, features: &[(DVec3, f64)]) {
        let mut points = vec![0usize; scene.obstacles.len()];
        for (truth, range_m) in sweep.truth.iter().zip(&sweep.returns.range_m) {
            if truth.object >= 0 && *range_m <= RANGE_M {
                points[truth.object as usize] += 1;
            }
        }
        let rocks: Vec<(usize, Rock)> = points
            .iter()
            .enumerate()
            .filter(|(_, n)| **n >= 8)
            .map(|(id, _)| (id, rock(scene, &scene.obstacles[id])))
            .filter(|(_, rock)| rock.middle_m.is_finite())
            .collect();
        let mut found = vec![false; rocks.len()];
        for (place_m, half_width_m) in features {
            let apart_m = |rock: &Rock| rock.middle_m.distance(place_m.truncate());
            let nearest = (0..rocks.len()).min_by(|&a, &b| apart_m(&rocks[a].1).total_cmp(&apart_m(&rocks[b].1)));
            let Some(k) = nearest.filter(|&k| apart_m(&rocks[k].1) < rocks[k].1.half_width_m + 0.1) else {
                self.spurious += 1;
                continue;
            };
            found[k] = true;
            let rock = &rocks[k].1;
            let away = (rock.middle_m - sensor_m.truncate()).normalize();
            let off = place_m.truncate() - rock.middle_m;
            self.findings.push(Finding {
                rock_diameter_m: 2.0 * rock.half_width_m,
                half_width_m: *half_width_m,
                along_m: off.dot(away),
                across_m: off.dot(away.perp()),
                top_m: place_m.z - rock.top_m,
            });
        }
        self.rocks.extend(rocks.iter().zip(found).map(|((_, rock), found)| (2.0 * rock.half_width_m, found)));
    }
}
