//! The whole flow: a plan and a scene number -> what that scene leaves.
//!
//! A yard is built once; the rover is driven through it, with other draws, until a kept scan has cells of both classes or the attempts
//! are used up (`attempt`). [`run_scene`] is pure: equal plan and scene give equal output on any thread, after any other scene.
//! Clocks and hashes belong to the [`StageObserver`] that its caller brings. `truth` and `surrogate` poses are made here from the
//! drive's log, so that the slam stage never holds a true pose.

mod attempt;
mod localise;
mod observer;
mod output;
mod window;

use std::sync::Arc;

use crate::cells::{self, Label};
use crate::drive::{self, DriveLog};
use crate::geometry::Transform;
use crate::plan::{Family, Plan, Table};
use crate::random::{Drawn, Stage};
use crate::scene::{self, Scene};
use crate::slam::{self, RegistrationParams, SlamParams};
use crate::sweep::{self, Pattern, Sensor};

use attempt::{Attempt, Drive};
pub use observer::{StageHashes, StageObserver, StageRecord, StageTimes, Unobserved};
pub use output::{PoseRow, ScanOutput, ScanPoints, SceneCounts, SceneOutput};

/// A plan with what is worked out once for all its scenes.
pub struct Prepared {
    pub plan: Plan,
    /// Per family: the beams of its sensor.
    patterns: Vec<Arc<Pattern>>,
    /// Those of sweeps that no cell reads.
    on_the_way: Vec<Arc<Pattern>>,
    /// The points table is written, so sweeps are kept.
    keep_points: bool,
}

/// Working memory of one thread; holds nothing that a later scene can see.
#[derive(Default)]
pub struct Scratch {
    sweep: sweep::Scratch,
    cells: cells::Scratch,
    crossing: cells::CrossingScratch,
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
    Slam(#[from] slam::SlamError),
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
    /// Drives tried.
    pub attempts: u32,
    /// The one of them that this is, from 0: the last that came to an end.
    pub attempt: u32,
}

impl Prepared {
    /// Lays out each family's beams.
    pub fn new(plan: Plan) -> Result<Prepared, sweep::PatternError> {
        Prepared::with_beams(plan, |_, _| None)
    }

    /// Another plan; the beams of families that keep their sensor are shared.
    pub fn with_plan(&self, plan: Plan) -> Result<Prepared, sweep::PatternError> {
        Prepared::with_beams(plan, |family, sensor| {
            let here = self.plan.families.get(family).filter(|here| *here.sweep.sensor == *sensor);
            here.map(|_| Arc::clone(&self.patterns[family]))
        })
    }

    /// `known`: the beams of a family's sensor, where they are laid out already.
    fn with_beams(
        plan: Plan,
        known: impl Fn(usize, &Sensor) -> Option<Arc<Pattern>>,
    ) -> Result<Prepared, sweep::PatternError> {
        let beams = |(family, sensor): (usize, &Sensor)| match known(family, sensor) {
            Some(pattern) => Ok(pattern),
            None => Pattern::build(sensor).map(Arc::new),
        };
        let sensors = plan.families.iter().map(|family| &*family.sweep.sensor);
        let patterns: Vec<Arc<Pattern>> = sensors.enumerate().map(beams).collect::<Result<_, _>>()?;
        let thinned = |(family, pattern): (&Family, &Arc<Pattern>)| match family.slam {
            SlamParams::Registration(RegistrationParams { every, .. }) if every > 1 => Arc::new(pattern.thinned(every)),
            _ => Arc::clone(pattern),
        };
        let on_the_way = plan.families.iter().zip(&patterns).map(thinned).collect();
        let keep_points = plan.tables.contains(&Table::Points);
        Ok(Prepared { plan, patterns, on_the_way, keep_points })
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
///
/// ```
/// # #[cfg(feature = "corpus")] {
/// use std::path::Path;
///
/// use marsyard::episode::{Prepared, Scratch, StageTimes, run_scene};
/// use marsyard::{config, plan::Plan};
///
/// let plan: Plan = config::load(Path::new("configs/quickstart.yaml"), &["cells.size_m=0.2".into()])?;
/// let prepared = Prepared::new(plan)?;
/// let (mut scratch, mut times) = (Scratch::default(), StageTimes::new());
/// let first = run_scene(&prepared, 5, &mut scratch, &mut times);
/// assert_eq!(first.error, None);
/// // Every stop is a sweep of all the sensor's beams.
/// assert_eq!(times.rays(), u64::from(first.counts.stops) * prepared.pattern(0).directions.len() as u64);
/// // What the scratch space held before cannot be seen.
/// run_scene(&prepared, 6, &mut scratch, &mut times);
/// let again = run_scene(&prepared, 5, &mut scratch, &mut times);
/// assert_eq!(again.scans[0].cells.features, first.scans[0].cells.features);
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run_scene(
    prepared: &Prepared,
    scene_id: u64,
    scratch: &mut Scratch,
    observer: &mut impl StageObserver,
) -> SceneOutput {
    let family = prepared.plan.family_of(scene_id);
    match replay_scene(prepared, scene_id, scratch, observer) {
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
    observer: &mut impl StageObserver,
) -> Result<Replay, Box<FailedScene>> {
    let plan = &prepared.plan;
    let family_index = plan.family_index_of(scene_id);
    let family = &plan.families[family_index];
    let streams = plan.streams(scene_id, 0, Stage::Scene);

    observer.begin();
    let scene_drawn = Drawn::draw(&streams, family.scene.dists());
    let scene = scene::build(&family.scene, &scene_drawn, &streams)
        .map_err(|e| Box::new(FailedScene { reason: e.into(), drawn: scene_drawn.clone(), attempts: 0 }))?;
    observer.end(Stage::Scene, |hasher| scene.hash_into(hasher));

    // The last attempt that came to an end is written, also where a later one failed.
    let mut finished: Option<(u32, Drawn, Drive)> = None;
    let mut failed: Option<Box<FailedScene>> = None;
    let mut attempts = 0;
    while attempts < family.drive.attempts
        && !finished.as_ref().is_some_and(|(_, _, run)| run.scans.iter().any(has_both_classes))
    {
        let drawn = draw_attempt(plan, family, scene_id, attempts, &scene_drawn);
        let address = (scene_id, attempts);
        let attempt = Attempt { prepared, family_index, address, scene: &scene, drawn: &drawn, scratch, observer };
        match attempt.run() {
            Ok(run) => finished = Some((attempts, drawn, run)),
            Err(reason) => failed = Some(Box::new(FailedScene { reason, drawn, attempts: attempts + 1 })),
        }
        attempts += 1;
    }
    match (finished, failed) {
        (Some((attempt, drawn, run)), _) => Ok(Replay {
            family: family_index,
            drawn,
            scene,
            drive: run.log,
            rover_from_sensor: run.rover_from_sensor,
            poses: run.poses,
            scans: run.scans,
            attempts,
            attempt,
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

/// What an attempt is repeated for.
fn has_both_classes(scan: &ScanOutput) -> bool {
    let holds = |label| scan.cells.rows.iter().any(|row| row.label == Some(label));
    Label::ALL.into_iter().all(holds)
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
                cut_short: self.drive.cut_short,
            },
            scans: self.scans,
            poses: self.poses,
        }
    }
}
