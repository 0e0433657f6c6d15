//! The sweeps of a window -> cells: place the points, number their cells, sum up each cell, look at its neighbours.
//!
//! Source: Hewitt et al. 2017, "Neural network input types", eqs 3 and 4. Sums run in slot order, sweep after sweep. Heights are taken
//! from the rover's estimated z before anything is summed, and the variance in two passes, so that a map a thousand
//! kilometres up costs no more digits than its points have lost already.

use super::assign::CellAssigner;
use super::beams::{Beams, Passages};
use super::columns::{Offset, neighbour_offsets};
use super::curvature;
use super::gaps::BeamColumns;
use super::group::Numbers;
use super::labels::{self, TruthSum, Verdict};
use super::local;
use super::overhang::Overhangs;
use super::params::{BeamParams, LocalHeightParams};
use super::place::PlaceTruth;
use super::plane::GroundPlanes;
use super::points::{Points, Scan, UNKNOWN};
use super::squares::Squares;
use super::surroundings::{NAMES, Surroundings};
use super::{CellParams, CellRow, CellTruth, Cells, Label, unseen};
use crate::geometry::{CellIndex, DVec3, GridSpec, Transform};
use crate::scene::Scene;
use crate::slam::Estimate;
use crate::sweep::{Status, Sweep};
use crate::wide::{Work, widest};

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
    points: Points,
    numbers: Numbers,
    sums: Vec<CellSum>,
    verdicts: Vec<Verdict>,
    mean_heights_m: Vec<f64>,
    intensities: Vec<(f64, f64)>,
    local: local::Scratch,
    pub(super) planes: GroundPlanes,
    curvature: curvature::Scratch,
    pub(super) squares: Squares,
    pub(super) beams: Beams,
    pub(super) passages: Passages,
    pub(super) columns: BeamColumns,
    overhangs: Overhangs,
    status: Vec<Status>,
}

/// What the points of a cell add up to.
#[derive(Clone, Copy, Debug)]
struct CellSum {
    points: u32,
    height_m: f64,
    /// Of the heights from their mean.
    squares_m2: f64,
    low_m: f64,
    high_m: f64,
    distance_m: f64,
    truth: TruthSum,
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
    summarise(params, intensity, kept.estimate, label, scratch, &mut cells);
    if let Some(of_unseen) = &params.unseen {
        unseen::add(params, of_unseen, scratch, max_range_m, &mut cells);
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
    summarise(params, intensity, kept.estimate, |_| None, scratch, &mut cells);
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
        unseen::add(params, of_unseen, scratch, max_range_m, &mut cells);
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

/// Sums the points of each cell into its row and features.
fn summarise(
    params: &CellParams,
    intensity: bool,
    estimate: &Estimate,
    label: impl Fn(&CellTruth) -> Option<Label>,
    scratch: &mut Scratch,
    cells: &mut Cells,
) {
    let offsets = neighbour_offsets(params.neighbours);
    // Those of gaps come later.
    let width = super::feature_columns(&CellParams { unseen: None, ..params.clone() }, intensity).len();
    let local_columns = params.local_height.as_ref().map_or(0, LocalHeightParams::columns);
    let curvature_columns = params.curvature.as_ref().map_or(0, |curvature| 2 * curvature.radii_m.len());
    let around_columns = params.surroundings.as_ref().map_or(0, |around| NAMES.len() * around.radii_m.len());
    let [sigma_x, sigma_y, sigma_z, sigma_roll, sigma_pitch, sigma_yaw] = estimate.sigmas();
    // The same for all rows.
    let [pitch, roll] = [estimate.pose.pitch_rad, estimate.pose.roll_rad].map(|f| f as f32);
    let sigmas = [sigma_z, sigma_roll, sigma_pitch, sigma_x, sigma_y, sigma_yaw].map(|f| f as f32);
    let beam_columns = params.beams.as_ref().map_or(0, BeamParams::columns);
    let written_later = local_columns + curvature_columns + around_columns + beam_columns;
    let Scratch { points, numbers, sums, verdicts, mean_heights_m, intensities, local, planes, curvature, .. } =
        &mut *scratch;
    cells.points_binned = points.cells.len() as u64;
    widest(CellAccumulator { points, numbers, verdicts, mean_heights_m, sums });
    if intensity {
        means_and_variances(numbers, &points.intensities, sums, intensities);
    }
    cells.rows.reserve(numbers.cells.len());
    cells.features.reserve(numbers.cells.len() * width);
    for (k, (&index, sum)) in numbers.cells.iter().zip(&*sums).enumerate() {
        let (count, mean_m) = (f64::from(sum.points), mean_heights_m[k]);
        let truth = sum.truth.finish();
        cells.rows.push(CellRow {
            index,
            label: label(&truth),
            points: sum.points as i32,
            range_m: (sum.distance_m / count) as f32,
            neighbour_mask: 0,
            truth,
        });
        let features = &mut cells.features;
        let height_m = sum.high_m - sum.low_m;
        let [mean, variance, height, points] =
            [mean_m, sum.squares_m2 / count, height_m, count].map(|value| value as f32);
        features.extend_from_slice(&[mean, variance, height, points, pitch, roll]);
        features.extend(std::iter::repeat_n(mean, offsets.len()));
        // Written below, when all means are known.
        if written_later > 0 {
            features.resize(features.len() + written_later, 0.0);
        }
        features.extend_from_slice(&sigmas);
        if intensity {
            let (mean, variance) = intensities[k];
            features.extend([mean as f32, variance as f32]);
        }
    }
    debug_assert_eq!(cells.features.len(), width * cells.rows.len());
    add_neighbours(&offsets, &numbers.cells, mean_heights_m, width, cells);
    if let Some(local_height) = &params.local_height {
        let Cells { rows, features, .. } = cells;
        let column = FIRST_NEIGHBOUR + offsets.len();
        local::heights(local_height, params.size_m, rows, mean_heights_m, local, |row, height_m| {
            features[row * width + column] = height_m as f32;
        });
        if local_height.plane {
            planes.fit(local_height, params.size_m, rows, mean_heights_m);
            for (k, (row, &height_m)) in rows.iter().zip(&*mean_heights_m).enumerate() {
                let of_plane = planes.features(row.index, height_m).map(|value| value as f32);
                features[k * width + column + 1..][..2].copy_from_slice(&of_plane);
            }
        }
    }
    if let Some(of_curvature) = &params.curvature {
        let Cells { rows, features, .. } = cells;
        let column = FIRST_NEIGHBOUR + offsets.len() + local_columns;
        curvature::bends(of_curvature, params.size_m, rows, mean_heights_m, curvature, |row, distance, bend_m| {
            let of_distance = bend_m.map(|value| value as f32);
            features[row * width + column + 2 * distance..][..2].copy_from_slice(&of_distance);
        });
    }
    let Scratch { sums, mean_heights_m, squares, beams, passages, .. } = scratch;
    let Cells { rows, features, .. } = cells;
    let plane_height = FIRST_NEIGHBOUR + offsets.len() + 1;
    let column = FIRST_NEIGHBOUR + offsets.len() + local_columns + curvature_columns;
    if params.surroundings.is_some() || params.beams.is_some() {
        squares.take(rows);
    }
    if let Some(of_squares) = &params.surroundings {
        let around = Surroundings::new(squares, features, width, plane_height);
        let all = rows.iter().zip(features.chunks_exact(width));
        let values: Vec<f32> =
            all.flat_map(|(row, own)| around.of(of_squares, params.size_m, row.index, own[plane_height])).collect();
        for (own, values) in features.chunks_exact_mut(width).zip(values.chunks_exact(around_columns)) {
            own[column..][..around_columns].copy_from_slice(values);
        }
    }
    if let Some(of_beams) = &params.beams {
        let grid = GridSpec { size_m: params.size_m };
        let of_cells = rows.iter().zip(features.chunks_exact(width)).zip(mean_heights_m.iter().zip(&*sums));
        passages.take(of_cells.map(|((row, own), (mean_m, sum))| {
            let plane_m = mean_m - f64::from(own[plane_height]);
            beams.passage(grid.centre_m(row.index).into(), params.size_m, plane_m, sum.high_m)
        }));
        let of_cells = rows.iter().zip(features.chunks_exact_mut(width)).zip(passages.of_cells());
        for ((row, own), passage) in of_cells {
            let values = passages.of(of_beams, params.size_m, squares, row.index, passage);
            own[column + around_columns..].iter_mut().zip(values).for_each(|(own, value)| *own = value);
        }
    }
}

/// Sums over the points of each cell, and the means of their heights; in the machine's widest form, which compares floats in fewer steps.
struct CellAccumulator<'a> {
    points: &'a Points,
    numbers: &'a Numbers,
    verdicts: &'a [Verdict],
    mean_heights_m: &'a mut Vec<f64>,
    sums: &'a mut Vec<CellSum>,
}

impl Work for CellAccumulator<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let CellAccumulator { points, numbers, verdicts, mean_heights_m, sums } = self;
        sums.clear();
        sums.resize(numbers.cells.len(), CellSum::NONE);
        let slope_squared = &points.grounds.slope_squared;
        for ((&cell, &height_m), point) in numbers.of_point.iter().zip(&points.heights_m).zip(&points.returns) {
            let sum = &mut sums[cell as usize];
            sum.points += 1;
            sum.height_m += height_m;
            sum.low_m = f64::min(sum.low_m, height_m);
            sum.high_m = f64::max(sum.high_m, height_m);
            sum.distance_m += point.distance_m;
            let slope_squared = slope_squared.get(point.ground as usize).copied().unwrap_or(0.0);
            sum.truth.add(point.object, point.top, slope_squared, verdicts);
        }
        mean_heights_m.clear();
        // Eq. (3)
        mean_heights_m.extend(sums.iter().map(|sum| sum.height_m / f64::from(sum.points)));
        for (&cell, &height_m) in numbers.of_point.iter().zip(&points.heights_m) {
            // Eq. (4)
            let off_m = height_m - mean_heights_m[cell as usize];
            sums[cell as usize].squares_m2 += off_m * off_m;
        }
    }
}

impl CellSum {
    /// Of no point. Heights begin as sums of floats do: at the zero that changes no first term.
    const NONE: CellSum = CellSum {
        points: 0,
        height_m: -0.0,
        squares_m2: 0.0,
        low_m: f64::INFINITY,
        high_m: f64::NEG_INFINITY,
        distance_m: 0.0,
        truth: TruthSum::NONE,
    };
}

/// Mean and population variance of each cell's values, in two passes.
fn means_and_variances(numbers: &Numbers, values: &[f64], sums: &[CellSum], out: &mut Vec<(f64, f64)>) {
    out.clear();
    out.resize(sums.len(), (-0.0, 0.0));
    for (&cell, value) in numbers.of_point.iter().zip(values) {
        out[cell as usize].0 += value;
    }
    out.iter_mut().zip(sums).for_each(|((mean, _), sum)| *mean /= f64::from(sum.points));
    for (&cell, value) in numbers.of_point.iter().zip(values) {
        let (mean, squares) = &mut out[cell as usize];
        *squares += (value - *mean) * (value - *mean);
    }
    out.iter_mut().zip(sums).for_each(|((_, squares), sum)| *squares /= f64::from(sum.points));
}

/// Where the neighbours stand among the features.
pub(super) const FIRST_NEIGHBOUR: usize = 6;

/// Writes the means of the neighbours that hold points, and the mask.
///
/// `indices` are sorted, so each offset's neighbour moves forward only: one pointer an offset.
fn add_neighbours(offsets: &[Offset], indices: &[CellIndex], mean_heights_m: &[f64], width: usize, cells: &mut Cells) {
    // One number for (row, col), in the same order.
    let key = |row: i32, col: i32| (i64::from(row) << 32) + i64::from(col);
    let keys: Vec<i64> = indices.iter().map(|index| key(index.row, index.col)).collect();
    for (k, offset) in offsets.iter().enumerate() {
        let away = key(offset.rows, offset.cols);
        let mut at = 0;
        for (row, &own) in keys.iter().enumerate() {
            while at < keys.len() && keys[at] < own + away {
                at += 1;
            }
            if at < keys.len() && keys[at] == own + away {
                cells.rows[row].neighbour_mask |= 1 << k;
                cells.features[row * width + FIRST_NEIGHBOUR + k] = mean_heights_m[at] as f32;
            }
        }
    }
}
