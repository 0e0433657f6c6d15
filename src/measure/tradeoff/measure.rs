//! Scenes and plans -> what each plan makes of each scene, and what it costs.
//!
//! A thread takes a scene and makes it at every setting before it takes the next, interleaved: the order
//! is rotated by one from scene to scene. Each thread warms up on a scene that is not counted.
//! Memory: the cells that classifiers learn of every scene at every setting, some 80 bytes a cell; for `configs/paper.yaml` 3 MB a scene.

use std::sync::atomic::{AtomicBool, Ordering};

use super::compare::{Change, SceneCells, compare};
use super::ranges::{RangeErrors, range_errors};
use super::{Event, TradeoffError, caught};
use crate::cells::{Label, feature_columns};
use crate::episode::{Prepared, Replay, Scratch, Unobserved, replay_scene};
use crate::geometry::{Pose, Transform};
use crate::math;
use crate::measure::clock::Costs;
use crate::measure::interleave::rotated;
use crate::parallel;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::slam::{Estimate, matrix};
use crate::sweep::params::Cast;
use crate::train::feature_choice::taken;
use crate::train::params::FeatureSet;

/// How far an estimate is from the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PoseError {
    pub position_m: f64,
    pub heading_rad: f64,
    /// Normalised estimation error squared, over six unknowns; `None` where no covariance is claimed.
    pub nees: Option<f64>,
}

/// How far the truth itself moved from where the reference's rover stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DriveShift {
    pub position_m: f64,
    /// Angle between the chassis.
    pub turn_rad: f64,
}

/// One scene at one setting.
#[derive(Clone, Debug)]
pub(super) struct SceneMeasurement {
    pub costs: Costs,
    pub scans: usize,
    pub poses: Vec<PoseError>,
    /// `None` where the kept scans are another attempt's: nothing can be matched.
    pub against: Option<Comparison>,
    pub ranges: Option<RangeErrors>,
    pub counts: Counts,
    pub cells: SceneCells,
}

/// A scene that could not be made at a setting; the time for it is spent all the same.
#[derive(Clone, Copy, Debug)]
pub(super) struct Failed {
    pub cpu_s: f64,
}

/// Cells by label.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub traversable: u64,
    pub untraversable: u64,
    pub unknown: u64,
}

impl Counts {
    fn of(cells: &SceneCells) -> Counts {
        let count = |wanted: Option<Label>| cells.labels.iter().filter(|label| **label == wanted).count() as u64;
        Counts {
            traversable: count(Some(Label::Traversable)),
            untraversable: count(Some(Label::Untraversable)),
            unknown: count(None),
        }
    }
}

/// What differs from the reference.
#[derive(Clone, Debug)]
pub(super) struct Comparison {
    pub cells: Change,
    pub drive: Vec<DriveShift>,
}

/// All scenes, each at all settings; a setting at which a scene failed has what was spent on it.
pub(super) struct Measured {
    /// The features that the classifier sees.
    pub features: Vec<String>,
    pub scenes: Vec<AtAll>,
}

/// One scene at all settings.
pub(super) type AtAll = Vec<Result<SceneMeasurement, Failed>>;

/// Seconds of CPU that a scene took at a setting, whether it could be made or not.
pub(super) fn cpu_s(made: &Result<SceneMeasurement, Failed>) -> f64 {
    made.as_ref().map_or_else(|failed| failed.cpu_s, |made| made.costs.whole.cpu)
}

/// A scene just made.
struct Rerun {
    costs: Costs,
    attempt: u32,
    cells: SceneCells,
    /// Truth and estimate at each kept scan.
    poses: Vec<(Pose, Estimate)>,
    /// Kept of the reference alone.
    scene: Option<Scene>,
    family: usize,
    rover_from_sensor: Transform,
}

/// Makes every scene at every setting; the first setting is the reference. `None` where `stop` was raised.
pub(super) fn measure(
    prepared: &[Prepared],
    scenes: &[u64],
    threads: usize,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Measured>, TradeoffError> {
    let (features, columns) = inputs(&prepared[0].plan);
    let numbered: Vec<(usize, u64)> = scenes.iter().copied().enumerate().collect();
    let one_scene = |(k, scene): (usize, u64), (scratch, is_warm): &mut (Scratch, bool)| {
        if !std::mem::replace(is_warm, true) {
            // Whether it can be made is of no account here.
            let _ = replay_scene(&prepared[0], scene, scratch, &mut Unobserved);
        }
        caught(|| scene_everywhere(prepared, scene, k, &columns, scratch))
    };
    let of = scenes.len();
    let made = parallel::map(threads, numbered, stop, one_scene, |done| tell(Event::Scene { done, of }))?;
    Ok(made.map(|scenes| Measured { features, scenes }))
}

/// Makes scenes of the reference until one comes to its end, so that a config of which none does is refused before all settings are tried on all of
/// them. Nothing is found where `stop` was raised.
pub(super) fn refuse_if_none_can_be_made(
    reference: &Plan,
    scenes: &[u64],
    stop: &AtomicBool,
) -> Result<(), TradeoffError> {
    let prepared = Prepared::new(reference.clone())?;
    let mut scratch = Scratch::default();
    let mut first = None;
    for &scene in scenes {
        if stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        match caught(|| replay_scene(&prepared, scene, &mut scratch, &mut Unobserved).map(drop))? {
            Ok(()) => return Ok(()),
            Err(failed) => first = first.or_else(|| Some(failed.to_string())),
        }
    }
    first.map_or(Ok(()), |reason| Err(TradeoffError::NoScene { scenes: scenes.len(), reason }))
}

/// The inputs of a classifier that is trained by default: names, and positions among the feature columns.
pub(crate) fn inputs(plan: &Plan) -> (Vec<String>, Vec<usize>) {
    let family = &plan.families[0];
    let columns = feature_columns(&family.cells, family.sweep.effects.intensity.is_some());
    let taken = taken(&FeatureSet::Full, columns.iter().map(|column| column.name.as_str()));
    let kept = columns.iter().enumerate().filter(|(_, column)| taken(&column.name));
    kept.map(|(k, column)| (column.name.clone(), k)).unzip()
}

/// One scene at every setting; its number in the list is the number of the repeat.
fn scene_everywhere(
    prepared: &[Prepared],
    scene_id: u64,
    repeat: usize,
    columns: &[usize],
    scratch: &mut Scratch,
) -> AtAll {
    let mut reruns: Vec<Result<Rerun, Failed>> = rotated(prepared.len(), repeat, |k| {
        let mut costs = Costs::start();
        let replay = replay_scene(&prepared[k], scene_id, scratch, &mut costs);
        let costs = costs.finish();
        let failed = Failed { cpu_s: costs.whole.cpu };
        replay.map(|replay| Rerun::of(replay, costs, columns, k == 0)).map_err(|_| failed)
    });
    let (reference, others) = reruns.split_first_mut().expect("there is a reference");
    let mut all = vec![reference.as_mut().map_err(|failed| *failed).map(|it| {
        let cells = std::mem::take(&mut it.cells);
        let against = it.against_itself(&cells);
        it.made(cells, Some(against), None)
    })];
    for (other, plan) in others.iter_mut().zip(&prepared[1..]) {
        let at_reference = all[0].as_ref().ok().zip(reference.as_ref().ok());
        all.push(other.as_mut().map_err(|failed| *failed).map(|it| {
            let cells = std::mem::take(&mut it.cells);
            let same_attempt = at_reference.filter(|(_, reference)| it.attempt == reference.attempt);
            let against = same_attempt.map(|(made, reference)| it.against(reference, &made.cells, &cells));
            let ranges = at_reference.and_then(|(_, reference)| reference.range_errors(&prepared[0], plan));
            it.made(cells, against, ranges)
        }));
    }
    all
}

impl Rerun {
    fn of(replay: Replay, costs: Costs, columns: &[usize], is_reference: bool) -> Rerun {
        let kept = replay.poses.iter().filter(|pose| pose.scan_id.is_some());
        Rerun {
            costs,
            attempt: replay.attempt,
            cells: SceneCells::of(&replay.scans, columns),
            poses: kept.map(|pose| (pose.truth, pose.estimate.clone())).collect(),
            family: replay.family,
            rover_from_sensor: replay.rover_from_sensor,
            scene: is_reference.then_some(replay.scene),
        }
    }

    fn made(&self, cells: SceneCells, against: Option<Comparison>, ranges: Option<RangeErrors>) -> SceneMeasurement {
        let poses: Vec<PoseError> = self.poses.iter().map(|(truth, estimate)| pose_error(truth, estimate)).collect();
        let counts = Counts::of(&cells);
        SceneMeasurement { costs: self.costs, scans: poses.len(), poses, against, ranges, counts, cells }
    }

    fn against_itself(&self, cells: &SceneCells) -> Comparison {
        self.against(self, cells, cells)
    }

    fn against(&self, reference: &Rerun, old: &SceneCells, new: &SceneCells) -> Comparison {
        let pairs = reference.poses.iter().zip(&self.poses);
        let drive = pairs.map(|((old, _), (new, _))| drive_shift(old, new)).collect();
        Comparison { cells: compare(old, new), drive }
    }

    /// The reference's last kept beams, cast as another plan casts; `None` where it casts them alike, or has another yard.
    fn range_errors(&self, own: &Prepared, other: &Prepared) -> Option<RangeErrors> {
        let (own_family, family) = (&own.plan.families[self.family], &other.plan.families[self.family]);
        let (scene, (truth, _)) = (self.scene.as_ref()?, self.poses.last()?);
        if family.sweep.cast == Cast::Exact || family.scene != own_family.scene {
            return None;
        }
        let world_from_sensor = truth.transform() * self.rover_from_sensor;
        let max_range_m = own_family.sweep.sensor.max_range_m;
        Some(range_errors(scene, &family.sweep.cast, own.pattern(self.family), &world_from_sensor, max_range_m))
    }
}

/// What an estimate errs: x, y, z, metres, and roll, pitch, heading, radians.
pub(super) fn axis_errors(truth: &Pose, estimate: &Estimate) -> [f64; 6] {
    let pose = &estimate.pose;
    let off_m = pose.position_m - truth.position_m;
    let turned = |a: f64, b: f64| math::wrap_angle(a - b);
    [
        off_m.x,
        off_m.y,
        off_m.z,
        turned(pose.roll_rad, truth.roll_rad),
        turned(pose.pitch_rad, truth.pitch_rad),
        turned(pose.yaw_rad, truth.yaw_rad),
    ]
}

fn pose_error(truth: &Pose, estimate: &Estimate) -> PoseError {
    let error = axis_errors(truth, estimate);
    let claimed = estimate.covariance.iter().enumerate().all(|(i, row)| row[i] > 0.0);
    let factor = claimed.then(|| matrix::cholesky(&estimate.covariance)).flatten();
    let nees = factor.map(|l| matrix::square(&matrix::half_solve(&l, &error)));
    let position_m = (estimate.pose.position_m - truth.position_m).length();
    PoseError { position_m, heading_rad: error[5].abs(), nees }
}

fn drive_shift(old: &Pose, new: &Pose) -> DriveShift {
    let between = old.rotation().transpose() * new.rotation();
    let trace = between.x_axis.x + between.y_axis.y + between.z_axis.z;
    // From the sine too: the cosine alone hides angles below 1e-8.
    let twice_sine =
        [between.y_axis.z - between.z_axis.y, between.z_axis.x - between.x_axis.z, between.x_axis.y - between.y_axis.x];
    let sine = 0.5 * twice_sine.iter().map(|s| s * s).sum::<f64>().sqrt();
    DriveShift {
        position_m: (new.position_m - old.position_m).length(),
        turn_rad: math::atan2(sine, 0.5 * (trace - 1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DVec3;

    #[test]
    fn exact_nees_of_a_diagonal_covariance_is_the_sum_of_squared_scores() {
        let truth = Pose { position_m: DVec3::new(1.0, 2.0, 3.0), roll_rad: 0.1, pitch_rad: -0.2, yaw_rad: 3.1 };
        let mut estimate = crate::slam::truth(&truth);
        assert_eq!(pose_error(&truth, &estimate), PoseError { position_m: 0.0, heading_rad: 0.0, nees: None });
        estimate.pose.position_m += DVec3::new(0.3, 0.0, -0.4);
        // Across the seam at pi.
        estimate.pose.yaw_rad = math::wrap_angle(3.1 + 0.1);
        estimate.covariance = matrix::diagonal(&[0.09, 1.0, 0.04, 1.0, 1.0, 0.01]);
        let error = pose_error(&truth, &estimate);
        assert!((error.position_m - 0.5).abs() < 1e-15 && (error.heading_rad - 0.1).abs() < 1e-14);
        assert!((error.nees.unwrap() - (1.0 + 4.0 + 1.0)).abs() < 1e-12, "{error:?}");
    }

    #[test]
    fn exact_the_drives_shift_is_distance_and_angle_between_chassis() {
        let old = Pose { position_m: DVec3::ZERO, roll_rad: 0.3, pitch_rad: 0.2, yaw_rad: -1.0 };
        for angle in [1e-11, 1e-3, 1.0, 3.0] {
            let new = Pose { position_m: DVec3::new(0.0, 3e-9, 4e-9), yaw_rad: math::wrap_angle(-1.0 + angle), ..old };
            let shift = drive_shift(&old, &new);
            assert!((shift.position_m - 5e-9).abs() < 1e-22);
            assert!((shift.turn_rad / angle - 1.0).abs() < 1e-5, "{angle}: {shift:?}");
        }
    }
}
