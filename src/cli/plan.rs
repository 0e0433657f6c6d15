//! Checks a config and says what it models and what it costs, measured on a few of its own scenes.

use std::time::{Duration, Instant};

use clap::Args;
use serde_json::json;

use super::generate::spec_of;
use super::output::outln;
use super::progress::{human, si};
use super::{ConfigArgs, Failure};
use crate::config::{Family, Plan};
use crate::corpus::{CorpusSpec, SceneOutput, ShardWriter, Split};
use crate::pipeline::{Prepared, Scratch, StageTimes, run_scene};
use crate::random::{Dist, Law};
use crate::scene::params::{GroundShape, GroundSource};
use crate::slam::SlamParams;
use crate::sweep::params::Cast;

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Scenes to build (and throw away) for the estimate of cost; 0 = check only.
    #[arg(long, default_value_t = 8)]
    sample: u64,
    /// Threads that the build will have.
    #[arg(long, default_value_t = super::generate::default_threads(), value_parser = super::generate::parse_threads)]
    threads: usize,
    /// One JSON object on stdout instead of text.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &PlanArgs) -> Result<(), Failure> {
    let plan = args.config.load()?;
    let cost = if args.sample == 0 { None } else { Some(calibrate(plan.clone(), args.sample)?) };
    if args.json {
        outln!("{:#}", as_json(&plan, cost.as_ref(), args.threads));
    } else {
        tell(&plan, cost.as_ref(), args.threads);
    }
    Ok(())
}

/// What a few of the plan's own scenes cost.
struct Cost {
    scenes: u64,
    failed: u64,
    wall: Duration,
    times: StageTimes,
    writing: Duration,
    rows: u64,
    bytes: u64,
    fixed_bytes: u64,
}

impl Cost {
    fn per_scene(&self, total: f64) -> f64 {
        total / self.scenes as f64
    }

    fn cpu_s_per_scene(&self) -> f64 {
        self.per_scene(self.wall.as_secs_f64() + self.writing.as_secs_f64())
    }

    fn build_s(&self, plan: &Plan, threads: usize) -> f64 {
        self.cpu_s_per_scene() * plan.scenes as f64 / threads as f64
    }

    fn total_rows(&self, plan: &Plan) -> f64 {
        self.per_scene(self.rows as f64) * plan.scenes as f64
    }

    /// Parquet's own bytes come once a file, the rows' bytes once a scene.
    fn total_bytes(&self, plan: &Plan) -> f64 {
        let rows = self.per_scene(self.bytes.saturating_sub(self.fixed_bytes) as f64) * plan.scenes as f64;
        rows + self.fixed_bytes as f64 * plan.shards() as f64
    }
}

/// Builds scenes spread evenly over the plan, one thread, and writes them to a folder that goes away.
fn calibrate(plan: Plan, sample: u64) -> Result<Cost, Failure> {
    let count = sample.min(plan.scenes);
    let chosen: Vec<u64> = (0..count).map(|k| k * plan.scenes / count).collect();
    let prepared = Prepared::new(plan).map_err(Failure::failed)?;
    let mut scratch = Scratch::default();
    // The first scene warms caches and is not counted.
    run_scene(&prepared, chosen[0], &mut scratch, &mut StageTimes::new());
    let (mut times, started) = (StageTimes::new(), Instant::now());
    let outputs: Vec<SceneOutput> =
        chosen.iter().map(|&scene| run_scene(&prepared, scene, &mut scratch, &mut times)).collect();
    let wall = started.elapsed();
    let failed = outputs.iter().filter(|o| o.error.is_some()).count() as u64;
    let rows = outputs.iter().flat_map(|o| &o.scans).map(|s| s.cells.rows.len() as u64).sum();

    let (one_bytes, _) = encode(&prepared.plan, &outputs[..1])?;
    let (bytes, writing) = encode(&prepared.plan, &outputs)?;
    // Two points make a line: bytes = fixed + scenes * slope.
    let fixed_bytes = if count > 1 { (one_bytes * count).saturating_sub(bytes) / (count - 1) } else { 0 };
    Ok(Cost { scenes: count, failed, wall, times, writing, rows, bytes, fixed_bytes: fixed_bytes.min(one_bytes) })
}

/// Bytes of a shard of these scenes, and the time its encoding takes.
pub(super) fn encode(plan: &Plan, outputs: &[SceneOutput]) -> Result<(u64, Duration), Failure> {
    let count = outputs.len() as u32;
    let spec = CorpusSpec { scenes: u64::from(count), scenes_per_shard: count, ..spec_of(plan) };
    let started = Instant::now();
    let mut writer = ShardWriter::new(&spec, 0).map_err(Failure::failed)?;
    for (scene_id, output) in outputs.iter().enumerate() {
        let renumbered = SceneOutput { scene_id: scene_id as u64, ..output.clone() };
        writer.push(&renumbered).map_err(Failure::failed)?;
    }
    let shard = writer.finish().map_err(Failure::failed)?;
    let bytes = shard.files.iter().map(|(_, bytes)| bytes.len() as u64).sum();
    Ok((bytes, started.elapsed()))
}

fn tell(plan: &Plan, cost: Option<&Cost>, threads: usize) {
    outln!(
        "{}: {} scenes in {} shards of {}, seed {}",
        plan.name,
        plan.scenes,
        plan.shards(),
        plan.scenes_per_shard,
        plan.seed
    );
    let of = |split| (0..plan.shards()).filter(|&s| Split::of_shard(s) == split).count();
    outln!("shards: {} train, {} validation, {} test", of(Split::Train), of(Split::Validation), of(Split::Test));
    if plan.shards() < 7 {
        outln!("warning: fewer than 7 shards leave a split empty; raise scenes or lower scenes_per_shard");
    }
    if let Some(fidelity) = plan.fidelity {
        let sets: Vec<String> = fidelity.settings().iter().map(|(key, value)| format!("{key}: {value}")).collect();
        outln!("fidelity {}: {}; what the config names itself wins", fidelity.name(), sets.join(", "));
    }
    let total: f64 = plan.families.iter().map(|f| f.weight).sum();
    for family in &plan.families {
        let held = if family.hold_out { ", held out for the test split" } else { "" };
        outln!("\nfamily {} ({:.0} %{held})", family.name, 100.0 * family.weight / total);
        for (part, detail) in parts(family) {
            outln!("  {part:<12} {detail}");
        }
    }
    outln!("\nnot named in the config, so not modelled and not paid for: {}", absent(plan).join(", "));
    if let Some(cost) = cost {
        outln!("\ncost, measured on {} of its scenes, one thread:", cost.scenes);
        for (stage, time) in cost.times.spent() {
            outln!("  {stage:<12} {:>9.2} ms a scene", 1e3 * cost.per_scene(time.as_secs_f64()));
        }
        outln!("  {:<12} {:>9.2} ms a scene", "writing", 1e3 * cost.per_scene(cost.writing.as_secs_f64()));
        if cost.failed > 0 {
            outln!("  {} of {} scenes failed: `marsyard generate` would list them", cost.failed, cost.scenes);
        }
        outln!(
            "\nwhole build: {} rows of cells, {}B on disk, {} on {threads} threads",
            si(cost.total_rows(plan)),
            si(cost.total_bytes(plan)),
            human(Duration::from_secs_f64(cost.build_s(plan, threads)))
        );
    }
}

fn as_json(plan: &Plan, cost: Option<&Cost>, threads: usize) -> serde_json::Value {
    let families: Vec<_> = plan
        .families
        .iter()
        .map(|f| {
            let parts: serde_json::Map<_, _> = parts(f).into_iter().map(|(k, v)| (k.into(), v.into())).collect();
            json!({"name": f.name, "weight": f.weight, "hold_out": f.hold_out, "parts": parts})
        })
        .collect();
    let cost = cost.map(|cost| {
        let stages: serde_json::Map<_, _> =
            cost.times.spent().map(|(k, t)| (k.into(), cost.per_scene(t.as_secs_f64()).into())).collect();
        json!({
            "scenes_measured": cost.scenes, "scenes_failed": cost.failed, "seconds_per_scene": cost.cpu_s_per_scene(),
            "stage_seconds_per_scene": stages, "rows": cost.total_rows(plan).round(), "bytes": cost.total_bytes(plan).round(),
            "threads": threads, "hours": cost.build_s(plan, threads) / 3600.0,
        })
    });
    json!({
        "name": plan.name, "seed": plan.seed, "scenes": plan.scenes, "shards": plan.shards(),
        "scene_plan_hash": plan.scene_plan_hash(), "fidelity": plan.fidelity, "families": families, "estimate": cost,
    })
}

/// The parts a family switches on, in the order of the flow.
fn parts(family: &Family) -> Vec<(&'static str, String)> {
    let mut parts = Vec::new();
    let scene = &family.scene;
    let source = match &scene.ground.source {
        GroundSource::Random(r) => {
            format!("random, rms {} m, correlation length {} m", say(&r.rms_height_m), say(&r.correlation_length_m))
        }
        GroundSource::File(f) => format!("from {}", f.path),
        GroundSource::Flat => "flat".into(),
    };
    let shape = match &scene.ground.shape {
        GroundShape::Polynomial(p) => format!("polynomial of degree {}", p.degree),
        GroundShape::Raw(r) => format!("raw at {} m", r.spacing_m),
    };
    parts.push(("ground", format!("{} m square, {source}; {shape}", scene.extent_m)));
    if let Some(r) = &scene.ground.roughness {
        parts.push(("roughness", format!("rms {} m at {} m", say(&r.rms_height_m), say(&r.correlation_length_m))));
    }
    if !scene.ground.features.is_empty() {
        parts.push(("landforms", format!("{} kinds", scene.ground.features.len())));
    }
    if let Some(rocks) = &scene.rocks {
        let detail = match (&rocks.golombek, &rocks.count, &rocks.diameter_m) {
            (Some(g), _, _) => format!("Golombek abundance {} from {} m up", say(&g.abundance), g.min_diameter_m),
            (None, Some(n), Some(d)) => format!("{} of {} m", say(n), say(d)),
            _ => String::new(),
        };
        parts.push(("rocks", detail));
    }
    if let Some(boxes) = &scene.boxes {
        parts.push(("boxes", say(&boxes.count)));
    }
    if let Some(trees) = &scene.trees {
        parts.push((
            "trees",
            format!("{}{}", say(&trees.count), if trees.crown.is_some() { ", with crowns" } else { "" }),
        ));
    }
    if let Some(v) = &scene.vegetation {
        let kinds = [("grass", v.grass.is_some()), ("brush", v.brush.is_some()), ("bushes", v.bushes.is_some())];
        let on: Vec<_> = kinds.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
        parts.push(("vegetation", on.join(", ")));
    }
    let drive = &family.drive;
    parts.push((
        "rover",
        format!(
            "{}, {} stops, keep {:?}, up to {} attempts",
            drive.rover.name, drive.stops, drive.keep, drive.attempts
        ),
    ));
    let cast = match &family.sweep.cast {
        Cast::Exact => "cast exactly".to_string(),
        Cast::Raster(s) => format!("cast on a raster of {} m", s.spacing_m),
        Cast::Mesh(s) => format!("cast on a mesh of {} m", s.spacing_m),
    };
    let sensor = &family.sweep.sensor;
    parts.push(("sensor", format!("{}, {} to {} m, {cast}", sensor.name, sensor.min_range_m, sensor.max_range_m)));
    let on = effects(family).into_iter().filter(|(_, on)| *on).map(|(name, _)| name).collect::<Vec<_>>();
    parts.push(("effects", if on.is_empty() { "none".into() } else { on.join(", ") }));
    let slam = match &family.slam {
        SlamParams::Fastslam(f) => format!("FastSLAM 2.0, {} particles", f.particles),
        SlamParams::DeadReckoning => "dead reckoning".into(),
        SlamParams::Surrogate(_) => "surrogate: truth plus noise".into(),
        SlamParams::Truth => "truth".into(),
    };
    parts.push(("slam", slam));
    let cells = &family.cells;
    let local = cells.local_height.as_ref().map_or(String::new(), |local| format!(", height above {}", local.words()));
    parts.push((
        "cells",
        format!("{} m, {} neighbours, {} scans a window{local}", cells.size_m, cells.neighbours, cells.window_scans),
    ));
    parts
}

fn effects(family: &Family) -> [(&'static str, bool); 8] {
    let e = &family.sweep.effects;
    [
        ("range_noise", e.range_noise.is_some()),
        ("range_bias", e.range_bias_m.is_some()),
        ("quantisation", e.quantisation.is_some()),
        ("gates", e.gates.is_some()),
        ("dropout", e.dropout.is_some()),
        ("mixed_pixels", e.mixed_pixels.is_some()),
        ("tilt_jitter", e.tilt_jitter_deg.is_some()),
        ("intensity", e.intensity.is_some()),
    ]
}

/// Parts that no family names.
fn absent(plan: &Plan) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = Vec::new();
    let mut missing = |name, on: &dyn Fn(&Family) -> bool| {
        if !plan.families.iter().any(on) {
            names.push(name);
        }
    };
    missing("roughness", &|f| f.scene.ground.roughness.is_some());
    missing("landforms", &|f| !f.scene.ground.features.is_empty());
    missing("rocks", &|f| f.scene.rocks.is_some());
    missing("boxes", &|f| f.scene.boxes.is_some());
    missing("trees", &|f| f.scene.trees.is_some());
    missing("vegetation", &|f| f.scene.vegetation.is_some());
    missing("control_noise", &|f| f.drive.control_noise.is_some());
    for (k, (name, _)) in plan.families.first().map(effects).into_iter().flatten().enumerate() {
        missing(name, &move |f| effects(f)[k].1);
    }
    if !plan.tables.contains(&crate::corpus::Table::Points) {
        names.push("points table");
    }
    names
}

/// A constant or a law in a few words.
fn say(dist: &Dist) -> String {
    match dist {
        Dist::Constant(value) => format!("{value}"),
        Dist::Law(Law::Choice(values)) => format!("one of {values:?}"),
        law => {
            let (low, high) = law.bounds();
            format!("{low} to {high}")
        }
    }
}
