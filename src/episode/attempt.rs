//! One attempt at a scene: drive -> at each step a pose, at each stop a sweep, of each kept sweep the cells.
//!
//! In: a yard, the attempt's drawn values and the address of its random streams. Out: the drive's log, a pose a step and the kept scans.
//! A sweep is cast only where the pose estimate or a kept scan's window reads it.

use super::localise::Localiser;
use super::window::SweepWindow;
use super::{PoseRow, Prepared, ScanOutput, ScanPoints, SceneFailure, Scratch, StageObserver};
use crate::cells::{self, CellFrame, Cells, CrossingAsked, Overhangs, ScanPose, WindowScan};
use crate::drive::params::Keep;
use crate::drive::rover::Mount;
use crate::drive::{self, DriveLog, InstrumentNoise};
use crate::geometry::{GridSpec, Transform};
use crate::plan::Family;
use crate::random::{Drawn, Stage, Streams};
use crate::scene::Scene;
use crate::sweep::{self, Caster, Sweep};

pub(super) struct Attempt<'a, O> {
    pub prepared: &'a Prepared,
    pub family_index: usize,
    /// Scene and attempt: where the random streams begin.
    pub address: (u64, u32),
    pub scene: &'a Scene,
    pub drawn: &'a Drawn,
    pub scratch: &'a mut Scratch,
    pub observer: &'a mut O,
}

/// What an attempt that came to its end made.
pub(super) struct Drive {
    pub log: DriveLog,
    pub rover_from_sensor: Transform,
    pub poses: Vec<PoseRow>,
    pub scans: Vec<ScanOutput>,
}

impl<'a, O: StageObserver> Attempt<'a, O> {
    /// The flow of an episode, a step a line.
    pub(super) fn run(mut self) -> Result<Drive, SceneFailure> {
        let family = self.family();
        let log = self.drive()?;
        let rover_from_sensor = mount(family, self.drawn);
        let caster = self.caster();
        let noise = InstrumentNoise::of(&family.drive.instruments, self.drawn);
        let mut localiser = Localiser::new(&family.slam, &noise, &log.truth[0], &rover_from_sensor)?;
        let kept = KeptStops::new(family, log.stops.len());
        let mut window = SweepWindow::new(family.cells.window_scans as usize);
        let mut poses = Vec::with_capacity(log.truth.len());
        let mut scans = Vec::new();
        let mut time_s = 0.0;
        for (step, (truth, reading)) in log.truth.iter().zip(&log.readings).enumerate() {
            let slam_streams = self.streams(Stage::Slam).at_step(step as u32);
            time_s += reading.dt_s;
            let mut estimate = localiser.step(reading, truth, &slam_streams)?;
            let mut scan_id = None;
            let stop = log.stops.binary_search(&step).ok();
            if let Some(stop) = stop.filter(|&stop| localiser.needs_sweeps() || kept.reads_sweep_of(stop)) {
                self.observer.end(Stage::Slam, |_| ());
                let world_from_sensor = truth.transform() * rover_from_sensor;
                window.make_room(&mut self.scratch.sweep);
                let sweep = self.sweep(&caster, &world_from_sensor, stop, kept.reads_sweep_of(stop))?;
                estimate = localiser.observe(&sweep.returns, estimate, &slam_streams)?;
                self.observer.end(Stage::Slam, |hasher| estimate.hash_into(hasher));
                window.push(sweep, estimate.clone(), &rover_from_sensor, world_from_sensor);
                if kept.contains(stop) {
                    scan_id = Some(stop as u32);
                    scans.extend(self.scan(stop as u32, &window, &rover_from_sensor));
                }
            }
            poses.push(PoseRow { step: step as u32, time_s, stop: stop.is_some(), scan_id, truth: *truth, estimate });
        }
        self.observer.end(Stage::Slam, |_| ());
        window.clear(&mut self.scratch.sweep);
        Ok(Drive { log, rover_from_sensor, poses, scans })
    }

    fn family(&self) -> &'a Family {
        &self.prepared.plan.families[self.family_index]
    }

    fn streams(&self, stage: Stage) -> Streams {
        let (scene_id, attempt) = self.address;
        self.prepared.plan.streams(scene_id, attempt, stage)
    }

    fn drive(&mut self) -> Result<DriveLog, SceneFailure> {
        self.observer.begin();
        let log = drive::drive(&self.family().drive, self.scene, self.drawn, &self.streams(Stage::Drive))?;
        self.observer.end(Stage::Drive, |hasher| log.hash_into(hasher));
        Ok(log)
    }

    fn caster(&mut self) -> Caster<'a> {
        let caster = Caster::new(self.scene, &self.family().sweep.cast);
        self.observer.end(Stage::Sweep, |_| ());
        caster
    }

    fn sweep(
        &mut self,
        caster: &Caster,
        world_from_sensor: &Transform,
        stop: usize,
        is_read: bool,
    ) -> Result<Sweep, SceneFailure> {
        let params = &self.family().sweep;
        let patterns = if is_read { &self.prepared.patterns } else { &self.prepared.on_the_way };
        let pattern = &patterns[self.family_index];
        let streams = self.streams(Stage::Sweep).at_step(stop as u32);
        let memory = &mut self.scratch.sweep;
        let sweep = sweep::sweep(params, pattern, caster, world_from_sensor, self.drawn, &streams, memory)?;
        self.observer.end(Stage::Sweep, |hasher| sweep.hash_into(hasher));
        self.observer.count_rays(pattern.directions.len() as u64);
        Ok(sweep)
    }

    /// The cells of the window's sweeps, and the points of the newest where they are kept; `None` of an empty window.
    fn scan(&mut self, scan_id: u32, window: &SweepWindow, rover_from_sensor: &Transform) -> Option<ScanOutput> {
        let family = self.family();
        let mut scans = window.scans();
        let newest = scans.last_mut()?;
        let levelled =
            ScanPose::of_sweep(family.cells.frame, &newest.sweep.returns, newest.estimate, rover_from_sensor);
        let (cells, pose) = match levelled {
            Ok(pose) => {
                (newest.estimate, newest.map_from_sensor) = (&pose.estimate, pose.map_from_sensor);
                (self.cells(&scans, &pose), pose)
            }
            Err(_) => (Cells::without_ground(&newest.sweep.returns), ScanPose::nowhere()),
        };
        self.observer.end(Stage::Cells, |hasher| cells.hash_into(hasher));
        let points = window.newest().filter(|_| self.prepared.keep_points).map(|sweep| ScanPoints {
            sweep: sweep.clone(),
            map_from_sensor: pose.map_from_sensor,
            rover_z_m: pose.estimate.pose.position_m.z,
            grid: GridSpec { size_m: family.cells.size_m },
            max_range_m: self.max_range_m(),
            hanging: self.hanging(sweep, &pose),
            obstacles: cells::obstacles(&family.cells.labels, family.drive.rover.wheel_diameter_m, self.scene),
        });
        Some(ScanOutput { scan_id, cells, points })
    }

    /// Which returns of a kept sweep its cells leave out as overhanging.
    fn hanging(&self, sweep: &Sweep, pose: &ScanPose) -> Vec<bool> {
        let above_m = self.family().cells.above_m();
        let of_sweep = |above_m| Overhangs::default().of_sweep(above_m, &sweep.returns, &pose.map_from_sensor).to_vec();
        above_m.map_or(Vec::new(), of_sweep)
    }

    fn max_range_m(&self) -> f64 {
        let family = self.family();
        family.cells.max_range_m.unwrap_or(family.sweep.sensor.max_range_m)
    }

    /// The cells of a window whose newest sweep was made at `pose`.
    fn cells(&mut self, scans: &[WindowScan], pose: &ScanPose) -> Cells {
        let (params, rover, scene) = (&self.family().cells, &*self.family().drive.rover, self.scene);
        let max_range_m = self.max_range_m();
        let mut cells = cells::bin(params, scans, rover.wheel_diameter_m, max_range_m, scene, &mut self.scratch.cells);
        if let (Some(rule), Some(newest)) = (&params.labels.rover, scans.last()) {
            let (world_from_sensor, map_from_sensor) = (&newest.world_from_sensor, &pose.map_from_sensor);
            let asked = CrossingAsked { rule, rover, size_m: params.size_m, scene, world_from_sensor, map_from_sensor };
            let judge = match params.frame {
                CellFrame::EstimatedPose => cells::judge_crossing,
                CellFrame::FittedPlane => cells::judge_crossing_of_plane,
            };
            judge(&asked, &mut cells, &mut self.scratch.crossing);
        }
        cells
    }
}

/// The sensor's place: the rover's own mast, with what `sweep.mount` overrides.
fn mount(family: &Family, drawn: &Drawn) -> Transform {
    let rover = family.drive.rover.mount;
    let overridden = family.sweep.mount.as_ref().map(|over| {
        let [x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg] =
            over.apply(drawn, [rover.x_m, rover.y_m, rover.z_m, rover.yaw_deg, rover.pitch_deg, rover.roll_deg]);
        Mount { x_m, y_m, z_m, yaw_deg, pitch_deg, roll_deg }
    });
    overridden.unwrap_or(rover).rover_from_sensor()
}

/// The stops whose sweeps are written, and as many before each as its window holds.
struct KeptStops {
    kept: Vec<usize>,
    window_scans: usize,
}

impl KeptStops {
    fn new(family: &Family, stops: usize) -> KeptStops {
        let kept = match family.drive.keep {
            Keep::Last => vec![stops - 1],
            Keep::All => (0..stops).collect(),
            Keep::Every(n) => (0..stops).filter(|stop| (stops - 1 - stop).is_multiple_of(n.max(1) as usize)).collect(),
        };
        KeptStops { kept, window_scans: family.cells.window_scans as usize }
    }

    fn contains(&self, stop: usize) -> bool {
        self.kept.binary_search(&stop).is_ok()
    }

    /// Whether a kept scan's cells read the points of this stop's sweep.
    fn reads_sweep_of(&self, stop: usize) -> bool {
        self.kept.iter().any(|&kept| stop <= kept && kept - stop < self.window_scans)
    }
}
