//! The sweeps of a window -> cells: place, order by cell, sum up each cell, look at its neighbours.
//!
//! Source: Hewitt et al. 2017, "Cell inputs", eqs 3 and 4. Sums run in slot order, sweep after sweep. Heights are taken
//! from the rover's estimated z before anything is summed, and the variance in two passes, so that a map a thousand
//! kilometres up costs no more digits than its points have lost already.

use super::columns::{Offset, neighbour_offsets};
use super::group::Order;
use super::labels::{self, TruthSum, Verdict};
use super::local;
use super::place::{Placer, Unplaced};
use super::slope::GroundPlaces;
use super::{CellParams, CellRow, CellTruth, Cells};
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
    cells: Vec<CellIndex>,
    points: Vec<Point>,
    grounds: GroundPlaces,
    order: Order,
    verdicts: Vec<Verdict>,
    mean_heights_m: Vec<f64>,
    local: local::Scratch,
}

/// A point in a cell.
#[derive(Clone, Copy, Debug)]
struct Point {
    /// Above the kept sweep's rover.
    height_m: f64,
    distance_m: f64,
    /// Received intensity times squared range; NaN without intensity.
    intensity: f64,
    /// Its number among the places on the ground; `NOT_GROUND` for others.
    ground: u32,
    object: i32,
    top: bool,
}

const NOT_GROUND: u32 = u32::MAX;

/// The cells of the last sweep of `window`, from the points of all of it.
///
/// - `max_range_m`: the sensor's reach, used where `params` sets none
/// - `wheel_diameter_m`: of the rover, for labels
/// - `scene`: read for labels and `truth_` columns only
pub fn bin(
    params: &CellParams,
    window: &[WindowScan],
    rover_from_sensor: &Transform,
    wheel_diameter_m: f64,
    max_range_m: f64,
    scene: &Scene,
    scratch: &mut Scratch,
) -> Cells {
    let mut cells = Cells::default();
    let Some(kept) = window.last() else { return cells };
    let grid = GridSpec { size_m: params.size_m };
    let max_range_m = params.max_range_m.unwrap_or(max_range_m);
    scratch.cells.clear();
    scratch.points.clear();
    scratch.grounds.clear();
    for scan in window {
        let placer = Placer::new(grid, max_range_m, &scan.estimate.pose, rover_from_sensor);
        let rover_z_m = kept.estimate.pose.position_m.z;
        widest(Place { scan, placer: &placer, rover_z_m, scene, scratch, cells: &mut cells });
    }
    scratch.grounds.steepen(&scene.ground);
    cells.points_binned = scratch.cells.len() as u64;
    labels::verdicts(scene, params.labels.obstacle, wheel_diameter_m, &mut scratch.verdicts);
    scratch.order.sort(&scratch.cells);
    let label = |truth: &CellTruth| Some(labels::label(&params.labels, truth));
    summarise(params, kept.sweep.intensity.is_some(), kept.estimate, label, scratch, &mut cells);
    cells
}

/// The cells of the last cloud of `window`, from the points of all of it: features as [`bin`] makes them, bit for bit.
///
/// A cell's label is `None` unless its points carry verdicts; then it follows the same rule, from the points that have one.
/// Nothing else is known of the truth: class -1, object -2. With the cells comes, for each, the number of its points that carry a
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
    scratch.cells.clear();
    scratch.points.clear();
    for cloud in window {
        place_cloud(cloud, grid, max_range_m, kept.estimate.pose.position_m.z, scratch, &mut cells);
    }
    cells.points_binned = scratch.cells.len() as u64;
    scratch.verdicts.clear();
    scratch.verdicts.push(Verdict::OBSTACLE);
    scratch.order.sort(&scratch.cells);
    summarise(params, kept.intensity.is_some(), kept.estimate, |_| None, scratch, &mut cells);
    let Scratch { cells: of_point, points, order, .. } = scratch;
    let by_cell = order.by_cell.chunk_by(|&a, &b| of_point[a as usize] == of_point[b as usize]);
    let verdict = |(row, members): (&mut CellRow, &[u32])| {
        let known = members.iter().filter(|&&i| points[i as usize].object != UNKNOWN).count();
        row.label = (known > 0).then(|| labels::label(&params.labels, &row.truth));
        row.truth = CellTruth { class: -1, object: UNKNOWN, ..row.truth };
        known as i32
    };
    let known = cells.rows.iter_mut().zip(by_cell).map(verdict).collect();
    (cells, known)
}

/// Appends the points of one cloud that have a cell, and counts those that have none.
fn place_cloud(
    cloud: &WindowCloud,
    grid: GridSpec,
    max_range_m: f64,
    rover_z_m: f64,
    scratch: &mut Scratch,
    cells: &mut Cells,
) {
    let placer = Placer::of_sensor(grid, max_range_m, cloud.map_from_sensor);
    for (i, &point_m) in cloud.points_m.iter().enumerate() {
        cells.points_in += 1;
        let placed = if cloud.in_map { placer.place_in_map(point_m) } else { placer.place_point(point_m) };
        let Some(cell) = count_dropped(placed.cell, cells) else { continue };
        let range_m = if cloud.in_map { point_m - cloud.map_from_sensor.translation_m } else { point_m }.length();
        scratch.cells.push(cell);
        scratch.points.push(Point {
            height_m: placed.point_m.z - rover_z_m,
            distance_m: placed.distance_m,
            intensity: cloud.intensity.map_or(f64::NAN, |values| f64::from(values[i]) * range_m * range_m),
            ground: NOT_GROUND,
            object: match cloud.obstacle.and_then(|verdicts| verdicts[i]) {
                None => UNKNOWN,
                Some(false) => GROUND,
                Some(true) => 0,
            },
            top: false,
        });
    }
}

/// [`place`], in the machine's widest form.
struct Place<'a> {
    scan: &'a WindowScan<'a>,
    placer: &'a Placer,
    rover_z_m: f64,
    scene: &'a Scene,
    scratch: &'a mut Scratch,
    cells: &'a mut Cells,
}

impl Work for Place<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        place(self.scan, self.placer, self.rover_z_m, self.scene, self.scratch, self.cells);
    }
}

/// Appends the points of one sweep that have a cell, and counts those that have none.
#[inline(always)]
fn place(scan: &WindowScan, placer: &Placer, rover_z_m: f64, scene: &Scene, scratch: &mut Scratch, cells: &mut Cells) {
    let sweep = scan.sweep;
    for (slot, &direction) in sweep.pattern.directions.iter().enumerate() {
        if sweep.status[slot] != Status::Hit {
            continue;
        }
        cells.points_in += 1;
        let range_m = sweep.range_m[slot];
        let placed = placer.place(direction, range_m);
        let Some(cell) = count_dropped(placed.cell, cells) else { continue };
        let truth = &sweep.truth[slot];
        let ground = if truth.object == GROUND {
            let point_m: DVec3 = scan.world_from_sensor.point(direction * truth.range_m);
            scratch.grounds.push(point_m.x, point_m.y)
        } else {
            // Its verdict will be asked for.
            let obstacle = usize::try_from(truth.object).ok().and_then(|id| scene.obstacles.get(id));
            obstacle.inspect(|obstacle| _ = obstacle.protrusion_m);
            NOT_GROUND
        };
        scratch.cells.push(cell);
        scratch.points.push(Point {
            height_m: placed.point_m.z - rover_z_m,
            distance_m: placed.distance_m,
            intensity: sweep.intensity.as_ref().map_or(f64::NAN, |i| f64::from(i[slot]) * range_m * range_m),
            ground,
            object: truth.object,
            top: truth.top,
        });
    }
}

/// The cell of a point, or a count of why it has none.
#[inline(always)]
fn count_dropped(cell: Result<CellIndex, Unplaced>, cells: &mut Cells) -> Option<CellIndex> {
    match cell {
        Ok(cell) => return Some(cell),
        Err(Unplaced::BeyondRange) => cells.dropped_beyond_range += 1,
        Err(Unplaced::OffGrid) => cells.dropped_off_grid += 1,
    }
    None
}

/// The id that stands for ground in `TrueReturn::object`.
const GROUND: i32 = -1;

/// The id that stands for no verdict at all.
const UNKNOWN: i32 = -2;

/// Sums the points of each cell into its row and features.
fn summarise(
    params: &CellParams,
    intensity: bool,
    estimate: &Estimate,
    label: impl Fn(&CellTruth) -> Option<i8>,
    scratch: &mut Scratch,
    cells: &mut Cells,
) {
    let offsets = neighbour_offsets(params.neighbours);
    let width = super::feature_columns(params, intensity).len();
    let [sigma_x, sigma_y, sigma_z, sigma_roll, sigma_pitch, sigma_yaw] = estimate.sigmas();
    let Scratch { cells: of_point, points, grounds, order, verdicts, mean_heights_m, local } = scratch;
    mean_heights_m.clear();
    for members in order.by_cell.chunk_by(|&a, &b| of_point[a as usize] == of_point[b as usize]) {
        let of_cell = || members.iter().map(|&i| &points[i as usize]);
        let count = members.len() as f64;
        // Eq. (3)
        let mean_m = of_cell().map(|p| p.height_m).sum::<f64>() / count;
        let (mut squares, mut low, mut high) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
        let (mut distance_m, mut truth) = (0.0, TruthSum::new());
        for point in of_cell() {
            // Eq. (4)
            squares += (point.height_m - mean_m) * (point.height_m - mean_m);
            low = f64::min(low, point.height_m);
            high = f64::max(high, point.height_m);
            distance_m += point.distance_m;
            let slope_squared = grounds.slope_squared.get(point.ground as usize).copied().unwrap_or(0.0);
            truth.add(point.object, point.top, slope_squared, verdicts);
        }
        let truth = truth.finish();
        mean_heights_m.push(mean_m);
        cells.rows.push(CellRow {
            index: of_point[members[0] as usize],
            label: label(&truth),
            points: members.len() as i32,
            range_m: (distance_m / count) as f32,
            neighbour_mask: 0,
            truth,
        });
        let features = &mut cells.features;
        let own = [mean_m, squares / count, high - low, count, estimate.pose.pitch_rad, estimate.pose.roll_rad];
        features.extend(own.map(|f| f as f32));
        features.extend(std::iter::repeat_n(mean_m as f32, offsets.len()));
        // Written below, when all means are known.
        features.extend(params.local_height.iter().map(|_| 0.0));
        features.extend([sigma_z, sigma_roll, sigma_pitch, sigma_x, sigma_y, sigma_yaw].map(|f| f as f32));
        if intensity {
            let (mean, variance) = mean_and_variance(of_cell().map(|p| p.intensity));
            features.extend([mean as f32, variance as f32]);
        }
    }
    debug_assert_eq!(cells.features.len(), width * cells.rows.len());
    add_neighbours(&offsets, mean_heights_m, width, cells);
    if let Some(local_height) = &params.local_height {
        let Cells { rows, features, .. } = cells;
        let column = FIRST_NEIGHBOUR + offsets.len();
        local::heights(local_height, params.size_m, rows, mean_heights_m, local, |row, height_m| {
            features[row * width + column] = height_m as f32;
        });
    }
}

/// Mean and population variance in two passes.
fn mean_and_variance(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    (mean, values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / count)
}

/// Where the neighbours stand among the features.
const FIRST_NEIGHBOUR: usize = 6;

/// Writes the means of the neighbours that hold points, and the mask.
///
/// Rows are sorted, so each offset's neighbour moves forward only: one pointer an offset.
fn add_neighbours(offsets: &[Offset], mean_heights_m: &[f64], width: usize, cells: &mut Cells) {
    for (k, offset) in offsets.iter().enumerate() {
        let mut at = 0;
        for row in 0..cells.rows.len() {
            let CellIndex { row: r, col: c } = cells.rows[row].index;
            // Indices keep 16 cells clear of the i32 range: no overflow.
            let wanted = CellIndex { row: r + offset.rows, col: c + offset.cols };
            while at < cells.rows.len() && cells.rows[at].index < wanted {
                at += 1;
            }
            if at < cells.rows.len() && cells.rows[at].index == wanted {
                cells.rows[row].neighbour_mask |= 1 << k;
                cells.features[row * width + FIRST_NEIGHBOUR + k] = mean_heights_m[at] as f32;
            }
        }
    }
}
