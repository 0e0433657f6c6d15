//! The sweeps or clouds of a window -> cells: place the points, number their cells, sum up each cell (`summary`), look at what stands around
//! it (`around`), find the cells without points (`unseen`).
//!
//! Source: Hewitt et al. 2017, "Neural network input types". Points come in slot order, sweep after sweep. Heights are taken from the
//! rover's estimated z before anything is summed, so that a map a thousand kilometres up costs no more digits than its points have lost already.

use super::assign::CellAssigner;
use super::beams::{Beams, Passages};
use super::curvature;
use super::gaps::BeamColumns;
use super::group::Numbers;
use super::labels::{self, Verdict};
use super::layout::Layout;
use super::local;
use super::overhang::Overhangs;
use super::place::PlaceTruth;
use super::plane::GroundPlanes;
use super::points::{Points, Scan, UNKNOWN};
use super::squares::Squares;
use super::summary::{CellSum, summarise};
use super::{CellParams, CellRow, CellTruth, Cells, around, unseen};
use crate::geometry::{DVec3, GridSpec, Transform};
use crate::scene::Scene;
use crate::slam::Estimate;
use crate::sweep::{Status, Sweep};

/// One sweep of a window.
#[derive(Clone, Copy, Debug)]
pub struct WindowScan<'a> {
    pub sweep: &'a Sweep,
    /// What was believed when it was taken.
    pub estimate: &'a Estimate,
    /// Where the sensor is believed to have been.
    pub map_from_sensor: Transform,
    /// Where the sensor truly was: for the true slope of the ground only.
    pub world_from_sensor: Transform,
}

/// One real cloud of a window.
#[derive(Clone, Copy, Debug)]
pub struct WindowCloud<'a> {
    pub points_m: &'a [DVec3],
    /// The points are in the frame `map`; else in `sensor`.
    pub in_map: bool,
    /// Received intensities, one a point.
    pub intensity: Option<&'a [f32]>,
    /// What somebody said of each point: an obstacle's, not one's, or nothing.
    pub obstacle: Option<&'a [Option<bool>]>,
    /// What was believed when it was taken.
    pub estimate: &'a Estimate,
    /// Where the sensor is believed to have been.
    pub map_from_sensor: Transform,
}

/// Reused memory; has no meaning between calls.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    pub(super) points: Points,
    pub(super) numbers: Numbers,
    pub(super) sums: Vec<CellSum>,
    pub(super) verdicts: Vec<Verdict>,
    pub(super) mean_heights_m: Vec<f64>,
    /// Means and variances.
    pub(super) intensities: Vec<(f64, f64)>,
    pub(super) local: local::Scratch,
    pub(super) planes: GroundPlanes,
    pub(super) curvature: curvature::Scratch,
    pub(super) squares: Squares,
    pub(super) beams: Beams,
    pub(super) passages: Passages,
    pub(super) columns: BeamColumns,
    overhangs: Overhangs,
    status: Vec<Status>,
}

/// The cells of the last sweep of `window`, from the points of all of it.
///
/// - `max_range_m`: the sensor's reach, used where `params` sets none
/// - `wheel_diameter_m`: of the rover, for labels
/// - `scene`: read for labels and `truth_` columns only
pub fn bin(
    params: &CellParams,
    window: &[WindowScan],
    wheel_diameter_m: f64,
    max_range_m: f64,
    scene: &Scene,
    scratch: &mut Scratch,
) -> Cells {
    let mut cells = Cells::default();
    let Some(kept) = window.last() else { return cells };
    let grid = GridSpec { size_m: params.size_m };
    let max_range_m = params.max_range_m.unwrap_or(max_range_m);
    let above_m = params.above_m();
    let Scratch { points, numbers, verdicts, overhangs, status, .. } = scratch;
    let intensity = kept.sweep.returns.intensity.is_some();
    points.clear();
    points.seen_obstacles.resize(scene.obstacles.len(), false);
    for scan in window {
        let assigner = CellAssigner::of_sensor(grid, max_range_m, scan.map_from_sensor);
        let rover_z_m = kept.estimate.pose.position_m.z;
        let returns = &scan.sweep.returns;
        let status: &[Status] = match above_m {
            None => &returns.status,
            Some(above_m) => {
                let hanging = overhangs.of_sweep(above_m, returns, &scan.map_from_sensor);
                cells.leave_out_hanging(hanging);
                status.clear();
                let left = |(&status, &hangs): (&Status, &bool)| if hangs { Status::Dropped } else { status };
                status.extend(returns.status.iter().zip(hanging).map(left));
                status
            }
        };
        points.add_sweep(Scan { scan, status, assigner: &assigner, rover_z_m, intensity }, &mut cells);
    }
    points.grounds.steepen(&scene.ground);
    let is_seen = |index: usize| points.seen_obstacles[index];
    labels::verdicts(scene, params.labels.obstacle.taller_than(wheel_diameter_m), is_seen, verdicts);
    numbers.number(&points.cells);
    let rule = params.labels.of_counted();
    let label = |truth: &CellTruth| Some(rule.label(truth));
    let map_from_sensor = kept.map_from_sensor;
    let Sweep { returns, .. } = kept.sweep;
    let hits = returns.status.iter().zip(&returns.range_m).zip(&returns.pattern.directions);
    let hits = hits.filter(|((status, _), _)| **status == Status::Hit);
    let offsets_m = hits.map(|((_, &range_m), &direction)| map_from_sensor.direction(direction * range_m));
    scratch.take_beams(params, map_from_sensor.translation_m, kept.estimate, offsets_m);
    let layout = Layout::of(params, intensity);
    summarise(&layout, kept.estimate, label, scratch, &mut cells);
    around::add(params, &layout, scratch, &mut cells);
    if let Some(of_unseen) = &params.unseen {
        unseen::add(params, of_unseen, &layout, scratch, max_range_m, &mut cells);
    }
    if params.unseen.is_some() || params.labels.max_drop_m.is_some() {
        let taller_than = params.labels.obstacle.taller_than(wheel_diameter_m);
        let world_from_map = kept.world_from_sensor * map_from_sensor.inverse();
        let rover_z_m = kept.estimate.pose.position_m.z;
        let place_m = |row: &CellRow, height_m: f32| {
            let (x_m, y_m) = grid.centre_m(row.index);
            world_from_map.point(DVec3::new(x_m, y_m, rover_z_m + f64::from(height_m)))
        };
        PlaceTruth::new(scene, taller_than).complete(&params.labels, place_m, &mut cells);
    }
    cells
}

/// The cells of the last cloud of `window`, from the points of all of it: features as [`bin`] makes them, bit for bit.
///
/// A cell's label is `None` unless its points carry verdicts; then it follows the same rule, from the points that have one.
/// Nothing else is known of the truth: no class, object -2. With the cells comes, for each, the number of its points that carry a
/// verdict.
pub fn bin_clouds(
    params: &CellParams,
    window: &[WindowCloud],
    max_range_m: f64,
    scratch: &mut Scratch,
) -> (Cells, Vec<i32>) {
    let mut cells = Cells::default();
    let Some(kept) = window.last() else { return (cells, Vec::new()) };
    let grid = GridSpec { size_m: params.size_m };
    let above_m = params.above_m();
    let Scratch { points, numbers, verdicts, overhangs, .. } = scratch;
    let intensity = kept.intensity.is_some();
    points.clear();
    for cloud in window {
        let assigner = CellAssigner::of_sensor(grid, max_range_m, cloud.map_from_sensor);
        let hanging = above_m.map_or(&[][..], |above_m| overhangs.of_cloud(above_m, cloud));
        cells.leave_out_hanging(hanging);
        points.add_cloud(cloud, hanging, &assigner, kept.estimate.pose.position_m.z, intensity, &mut cells);
    }
    verdicts.clear();
    verdicts.push(Verdict::OBSTACLE);
    numbers.number(&points.cells);
    let origin_m = kept.map_from_sensor.translation_m;
    let offset_m =
        |point_m: DVec3| if kept.in_map { point_m - origin_m } else { kept.map_from_sensor.direction(point_m) };
    scratch.take_beams(params, origin_m, kept.estimate, kept.points_m.iter().map(|&point_m| offset_m(point_m)));
    let layout = Layout::of(params, intensity);
    summarise(&layout, kept.estimate, |_| None, scratch, &mut cells);
    around::add(params, &layout, scratch, &mut cells);
    let mut known = vec![0; cells.rows.len()];
    for (&cell, point) in scratch.numbers.of_point.iter().zip(&scratch.points.returns) {
        known[cell as usize] += i32::from(point.object != UNKNOWN);
    }
    let rule = params.labels.of_counted();
    for (row, &known) in cells.rows.iter_mut().zip(&known) {
        row.label = (known > 0).then(|| rule.label(&row.truth));
        row.truth = CellTruth { class: None, object: UNKNOWN, ..row.truth };
    }
    if let Some(of_unseen) = &params.unseen {
        unseen::add(params, of_unseen, &layout, scratch, max_range_m, &mut cells);
        let mut seen = known.into_iter();
        known = cells.rows.iter().map(|row| if row.points > 0 { seen.next().unwrap_or(0) } else { 0 }).collect();
    }
    (cells, known)
}

impl Scratch {
    /// Takes the returns of the kept sweep, as offsets from a sensor that is believed to be at `origin_m`, for those features that ask for beams.
    fn take_beams(
        &mut self,
        params: &CellParams,
        origin_m: DVec3,
        estimate: &Estimate,
        offsets_m: impl Iterator<Item = DVec3> + Clone,
    ) {
        let rover_z_m = estimate.pose.position_m.z;
        if params.beams.is_some() {
            self.beams.begin(origin_m, rover_z_m);
            offsets_m.clone().for_each(|offset_m| self.beams.add(offset_m));
            self.beams.finish();
        }
        if let Some(of_unseen) = &params.unseen {
            self.columns.begin(of_unseen.sector_deg, origin_m, rover_z_m);
            offsets_m.for_each(|offset_m| self.columns.add(offset_m));
            self.columns.finish(params.size_m);
        }
    }
}
