//! The whole flow: a plan and a scene number -> that scene's rows.
//!
//! [`run_scene`] is pure: equal plan and scene give equal output on any thread, after any other scene. Clocks and hashes
//! belong to the [`Watch`] that its caller brings. `truth` and `surrogate` poses are made here from the drive's log, so
//! that the slam stage never holds a true pose.

pub mod clock;
pub mod generate;
mod localise;
mod watch;

use std::collections::VecDeque;
use std::sync::Arc;

use crate::cells::{self, WindowScan};
use crate::config::{Family, Plan};
use crate::corpus::{PoseRow, ScanOutput, ScanPoints, SceneCounts, SceneOutput};
use crate::drive::params::Keep;
use crate::drive::rover::Mount;
use crate::drive::{self, DriveLog};
use crate::geometry::{GridSpec, Transform};
use crate::random::{Drawn, Stage};
use crate::scene::{self, Scene};
use crate::slam::Estimate;
use crate::sweep::{self, Caster, Pattern, Sweep};

use localise::Localiser;
pub use watch::{Hashes, NoWatch, Record, StageTimes, Watch};

/// A plan with what is worked out once for all its scenes.
pub struct Prepared {
    pub plan: Plan,
    /// Per family: the beams of its sensor.
    patterns: Vec<Arc<Pattern>>,
    /// The points table is written, so sweeps are kept.
    keep_points: bool,
}

/// Working memory of one thread; holds nothing that a later scene can see.
#[derive(Default)]
pub struct Scratch {
    sweep: sweep::Scratch,
    cells: cells::Scratch,
}

/// Why a scene has no rows.
#[derive(Debug, thiserror::Error)]
pub enum SceneFailure {
    #[error("scene: {0}")]
    Scene(#[from] scene::SceneError),
    #[error("drive: {0}")]
    Drive(#[from] drive::DriveError),
    #[error("sweep: {0}")]
    Sweep(#[from] sweep::SweepError),
    #[error("slam: {0}")]
    Slam(#[from] crate::slam::SlamError),
}

/// A scene that could not be made: why, and what was drawn and tried until then.
#[derive(Debug, thiserror::Error)]
#[error("{reason}")]
pub struct FailedScene {
    pub reason: SceneFailure,
    pub drawn: Drawn,
    pub attempts: u32,
}

/// What the stages of one scene made, for pictures and explanations.
pub struct Replay {
    pub family: usize,
    pub drawn: Drawn,
    pub scene: Scene,
    pub drive: DriveLog,
    pub rover_from_sensor: Transform,
    pub poses: Vec<PoseRow>,
    pub scans: Vec<ScanOutput>,
    pub attempts: u32,
}

impl Prepared {
    /// Lays out each family's beams.
    pub fn new(plan: Plan) -> Result<Prepared, sweep::PatternError> {
        let patterns =
            plan.families.iter().map(|f| Pattern::build(&f.sweep.sensor).map(Arc::new)).collect::<Result<_, _>>()?;
        let keep_points = plan.tables.contains(&crate::corpus::Table::Points);
        Ok(Prepared { plan, patterns, keep_points })
    }

    /// The beams of a family's sensor.
    pub fn pattern(&self, family: usize) -> &Arc<Pattern> {
        &self.patterns[family]
    }

    /// The same plan, every kept sweep held in memory: for pictures and explanations.
    pub fn keeping_points(mut self) -> Prepared {
        self.keep_points = true;
        self
    }
}

/// One scene, from its address to its rows. A scene that cannot be made is a row with its reason.
pub fn run_scene(prepared: &Prepared, scene_id: u64, scratch: &mut Scratch, watch: &mut impl Watch) -> SceneOutput {
    let family = prepared.plan.family_of(scene_id);
    match replay_scene(prepared, scene_id, scratch, watch) {
        Ok(replay) => replay.into_output(scene_id, &family.name),
        Err(failed) => {
            let FailedScene { reason, drawn, attempts } = *failed;
            SceneOutput::failed(scene_id, &family.name, attempts, drawn, reason.to_string())
        }
    }
}

/// As [`run_scene`], keeping what the stages made.
pub fn replay_scene(
    prepared: &Prepared,
    scene_id: u64,
    scratch: &mut Scratch,
    watch: &mut impl Watch,
) -> Result<Replay, Box<FailedScene>> {
    let plan = &prepared.plan;
    let family_index = plan.family_index_of(scene_id);
    let family = &plan.families[family_index];
    let streams = plan.streams(scene_id, 0, Stage::Scene);

    watch.begin();
    let scene_drawn = Drawn::draw(&streams, family.scene.dists());
    let scene = scene::build(&family.scene, &scene_drawn, &streams)
        .map_err(|e| Box::new(FailedScene { reason: e.into(), drawn: scene_drawn.clone(), attempts: 0 }))?;
    watch.end(Stage::Scene, |hasher| scene.hash_into(hasher));

    // The last attempt that came to an end is written, also where a later one failed.
    let mut finished: Option<Run> = None;
    let mut failed: Option<Box<FailedScene>> = None;
    let mut attempts = 0;
    while attempts < family.drive.attempts
        && !finished.as_ref().is_some_and(|run| run.scans.iter().any(has_both_classes))
    {
        let drawn = draw_attempt(plan, family, scene_id, attempts, &scene_drawn);
        match run_attempt(prepared, family_index, scene_id, attempts, &scene, &drawn, scratch, watch) {
            Ok(run) => finished = Some(run),
            Err(reason) => failed = Some(Box::new(FailedScene { reason, drawn, attempts: attempts + 1 })),
        }
        attempts += 1;
    }
    match (finished, failed) {
        (Some(run), _) => Ok(Replay {
            family: family_index,
            drawn: run.drawn,
            scene,
            drive: run.drive,
            rover_from_sensor: run.rover_from_sensor,
            poses: run.poses,
            scans: run.scans,
            attempts,
        }),
        (None, Some(failed)) => Err(failed),
        (None, None) => unreachable!("config asks for at least one attempt"),
    }
}

/// The scene's values and those of one attempt's drive and sweeps.
fn draw_attempt(plan: &Plan, family: &Family, scene_id: u64, attempt: u32, scene_drawn: &Drawn) -> Drawn {
    let mut drawn = scene_drawn.clone();
    drawn.extend(Drawn::draw(&plan.streams(scene_id, attempt, Stage::Drive), family.drive.dists()));
    drawn.extend(Drawn::draw(&plan.streams(scene_id, attempt, Stage::Sweep), family.sweep.dists()));
    drawn
}

/// A sweep that a later cell may still need.
struct Visit {
    sweep: Sweep,
    estimate: Estimate,
    world_from_sensor: Transform,
}

impl Visit {
    fn as_scan(&self) -> WindowScan<'_> {
        WindowScan { sweep: &self.sweep, estimate: &self.estimate, world_from_sensor: self.world_from_sensor }
    }
}

/// One drive and its sweeps.
struct Run {
    drawn: Drawn,
    drive: DriveLog,
    rover_from_sensor: Transform,
    poses: Vec<PoseRow>,
    scans: Vec<ScanOutput>,
}

#[allow(clippy::too_many_arguments)] // The address (scene, attempt), its inputs, and the caller's memory and clock.
fn run_attempt(
    prepared: &Prepared,
    family_index: usize,
    scene_id: u64,
    attempt: u32,
    scene: &Scene,
    drawn: &Drawn,
    scratch: &mut Scratch,
    watch: &mut impl Watch,
) -> Result<Run, SceneFailure> {
    let plan = &prepared.plan;
    let family = &plan.families[family_index];
    let pattern = &prepared.patterns[family_index];
    let address = |stage| plan.streams(scene_id, attempt, stage);
    let (drive_streams, sweep_streams, slam_streams) =
        (address(Stage::Drive), address(Stage::Sweep), address(Stage::Slam));

    watch.begin();
    let drive = drive::drive(&family.drive, scene, drawn, &drive_streams)?;
    watch.end(Stage::Drive, |hasher| drive.hash_into(hasher));

    let rover_from_sensor = mount(family, drawn);
    let caster = Caster::new(scene, &family.sweep.cast);
    watch.end(Stage::Sweep, |_| ());
    let noise = drive::InstrumentNoise::of(&family.drive.instruments, drawn);
    let mut localiser = Localiser::new(&family.slam, &noise, &drive.truth[0], &rover_from_sensor)?;
    let kept_stops = kept_stops(family.drive.keep, drive.stops.len());
    let window_scans = family.cells.window_scans as usize;
    let max_range_m = family.cells.max_range_m.unwrap_or(family.sweep.sensor.max_range_m);

    let mut poses = Vec::with_capacity(drive.truth.len());
    let mut scans = Vec::new();
    let mut window: VecDeque<Visit> = VecDeque::new();
    let mut time_s = 0.0;
    let mut stop = 0;
    for (step, (truth, reading)) in drive.truth.iter().zip(&drive.readings).enumerate() {
        let at_step = slam_streams.at_step(step as u32);
        time_s += reading.dt_s;
        let mut estimate = localiser.step(reading, truth, &at_step)?;
        let mut scan_id = None;
        let stops_here = drive.stops.get(stop) == Some(&step);
        if stops_here && (localiser.needs_sweeps() || in_a_window(&kept_stops, stop, window_scans)) {
            watch.end(Stage::Slam, |_| ());
            let world_from_sensor = truth.transform() * rover_from_sensor;
            // The sweep that leaves the window makes room for this one.
            if window.len() == window_scans
                && let Some(left) = window.pop_front()
            {
                scratch.sweep.reuse(left.sweep);
            }
            let sweep = sweep::sweep(
                &family.sweep,
                pattern,
                &caster,
                &world_from_sensor,
                drawn,
                &sweep_streams.at_step(stop as u32),
                &mut scratch.sweep,
            )?;
            watch.end(Stage::Sweep, |hasher| sweep.hash_into(hasher));
            watch.count_rays(pattern.directions.len() as u64);
            estimate = localiser.observe(&sweep.returns, estimate, &at_step)?;
            watch.end(Stage::Slam, |hasher| estimate.hash_into(hasher));
            window.push_back(Visit { sweep, estimate: estimate.clone(), world_from_sensor });
            if kept_stops.contains(&stop) {
                let scans_of_window: Vec<WindowScan> = window.iter().map(Visit::as_scan).collect();
                let cells = cells::bin(
                    &family.cells,
                    &scans_of_window,
                    &rover_from_sensor,
                    family.drive.rover.wheel_diameter_m,
                    max_range_m,
                    scene,
                    &mut scratch.cells,
                );
                watch.end(Stage::Cells, |hasher| cells.hash_into(hasher));
                let points = prepared.keep_points.then(|| ScanPoints {
                    sweep: window.back().expect("pushed above").sweep.clone(),
                    map_from_sensor: estimate.pose.transform() * rover_from_sensor,
                    grid: GridSpec { size_m: family.cells.size_m },
                    max_range_m,
                    obstacles: cells::obstacles(&family.cells.labels, family.drive.rover.wheel_diameter_m, scene),
                });
                scan_id = Some(stop as u32);
                scans.push(ScanOutput { scan_id: stop as u32, cells, points });
            }
        }
        poses.push(PoseRow { step: step as u32, time_s, stop: stops_here, scan_id, truth: *truth, estimate });
        stop += usize::from(stops_here);
    }
    watch.end(Stage::Slam, |_| ());
    window.into_iter().for_each(|left| scratch.sweep.reuse(left.sweep));
    Ok(Run { drawn: drawn.clone(), drive, rover_from_sensor, poses, scans })
}

/// The sensor's place: the rover's own mast, with what `sweep.mount` overrides.
fn mount(family: &Family, drawn: &Drawn) -> Transform {
    let rover = family.drive.rover.mount;
    family
        .sweep
        .mount
        .as_ref()
        .map_or(rover, |over| {
            let [x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg] =
                over.apply(drawn, [rover.x_m, rover.y_m, rover.z_m, rover.yaw_deg, rover.pitch_deg, rover.roll_deg]);
            Mount { x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg }
        })
        .rover_from_sensor()
}

/// The stops whose sweeps are written.
fn kept_stops(keep: Keep, stops: usize) -> Vec<usize> {
    match keep {
        Keep::Last => vec![stops - 1],
        Keep::All => (0..stops).collect(),
        Keep::Every(n) => (0..stops).filter(|s| (stops - 1 - s).is_multiple_of(n.max(1) as usize)).collect(),
    }
}

/// Whether the points of this stop's sweep reach a kept sweep's window.
fn in_a_window(kept: &[usize], stop: usize, window_scans: usize) -> bool {
    kept.iter().any(|&k| stop <= k && k - stop < window_scans)
}

/// What an attempt is repeated for.
fn has_both_classes(scan: &ScanOutput) -> bool {
    let holds = |label| scan.cells.rows.iter().any(|row| row.label == Some(label));
    holds(0) && holds(1)
}

impl Replay {
    /// The rows, without what only pictures need.
    fn into_output(self, scene_id: u64, family: &str) -> SceneOutput {
        let count = |class| self.scene.obstacles.iter().filter(|o| o.class == class).count() as u32;
        SceneOutput {
            scene_id,
            family: family.into(),
            attempts: self.attempts,
            error: None,
            drawn: self.drawn,
            counts: SceneCounts {
                rocks: count(scene::Class::Rock),
                boxes: count(scene::Class::Box),
                trees: count(scene::Class::Trunk),
                volumes: self.scene.volumes.len() as u32,
                patches: self.scene.patches.len() as u32,
                stops: self.drive.stops.len() as u32,
            },
            scans: self.scans,
            poses: self.poses,
        }
    }
}
