//! The sweeps and clouds of a window -> its points, each with what a cell sums up.
//!
//! In: a sweep (or cloud), and what places its points in the map. Out: one entry a point that has a cell, in slot order, sweep after
//! sweep; the others are counted by cause. Slots without a range are passed by in chunks, and the others worked out in blocks, side by
//! side.

use super::assign::{CellAssigner, Unplaced};
use super::slope::GroundPlaces;
use super::{Cells, WindowCloud, WindowScan};
use crate::geometry::{CellIndex, DVec3};
use crate::sweep::{Hit, Status};
use crate::wide::{LANES, Work, widest};

/// The id that stands for no verdict at all.
pub(super) const UNKNOWN: i32 = Hit::NOTHING;

/// Slots whose status is looked at together.
const CHUNK: usize = 256;

/// Reused memory, one entry a point in each list.
#[derive(Clone, Debug, Default)]
pub(super) struct Points {
    pub cells: Vec<CellIndex>,
    /// Above the kept sweep's rover.
    pub heights_m: Vec<f64>,
    /// Received intensity times squared range; NaN where a sweep has none, no entries where the kept one has none.
    pub intensities: Vec<f64>,
    pub returns: Vec<Return>,
    pub grounds: GroundPlaces,
    /// By index of a scene's obstacles: whether a point was returned by it.
    pub seen_obstacles: Vec<bool>,
}

/// What else is known of a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Return {
    pub distance_m: f64,
    /// Its number among the places on the ground; `NOT_GROUND` for others.
    pub ground: u32,
    pub object: i32,
    pub top: bool,
}

const NOT_GROUND: u32 = u32::MAX;

/// One sweep to add.
pub(super) struct Scan<'a> {
    pub scan: &'a WindowScan<'a>,
    /// Of its slots: those that are no hit any more are left out.
    pub status: &'a [Status],
    pub assigner: &'a CellAssigner,
    /// The kept sweep's rover.
    pub rover_z_m: f64,
    /// Whether the kept sweep has intensities.
    pub intensity: bool,
}

impl Points {
    pub(super) fn clear(&mut self) {
        let Points { cells, heights_m, intensities, returns, grounds, seen_obstacles } = self;
        cells.clear();
        heights_m.clear();
        intensities.clear();
        returns.clear();
        grounds.clear();
        seen_obstacles.clear();
    }

    /// Appends the points of one sweep that have a cell, and counts those that have none.
    pub(super) fn add_sweep(&mut self, scan: Scan, counts: &mut Cells) {
        widest(AddSweep { points: self, scan, counts });
    }

    /// The same for one cloud, but for the points that hang, where any are marked; `intensity`: whether the kept cloud has intensities.
    pub(super) fn add_cloud(
        &mut self,
        cloud: &WindowCloud,
        hanging: &[bool],
        assigner: &CellAssigner,
        rover_z_m: f64,
        intensity: bool,
        counts: &mut Cells,
    ) {
        for (i, &point_m) in cloud.points_m.iter().enumerate() {
            if hanging.get(i) == Some(&true) {
                continue;
            }
            counts.points_in += 1;
            let placed = if cloud.in_map { assigner.place_in_map(point_m) } else { assigner.place_point(point_m) };
            let Some(cell) = count_dropped(placed.cell, counts) else { continue };
            self.cells.push(cell);
            self.heights_m.push(placed.point_m.z - rover_z_m);
            if intensity {
                let place_m = if cloud.in_map { point_m - cloud.map_from_sensor.translation_m } else { point_m };
                let range_m = place_m.length();
                let received = cloud.intensity.map_or(f64::NAN, |values| f64::from(values[i]));
                self.intensities.push(received * range_m * range_m);
            }
            let object = match cloud.obstacle.and_then(|verdicts| verdicts[i]) {
                None => UNKNOWN,
                Some(false) => Hit::GROUND,
                Some(true) => 0,
            };
            self.returns.push(Return { distance_m: placed.distance_m, ground: NOT_GROUND, object, top: false });
        }
    }

    /// Appends the points of up to `LANES` slots with a range.
    #[inline(always)]
    fn add_block(&mut self, slots: &[u32], scan: &Scan, counts: &mut Cells) {
        let Scan { scan: WindowScan { sweep, world_from_sensor, .. }, assigner, .. } = *scan;
        let slot = |lane: usize| slots[lane.min(slots.len() - 1)] as usize;
        let (mut measured, mut true_m) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for lane in 0..LANES {
            let slot = slot(lane);
            let direction = sweep.returns.pattern.directions[slot];
            let points = [direction * sweep.returns.range_m[slot], direction * sweep.truth[slot].range_m];
            for axis in 0..3 {
                measured[axis][lane] = points[0][axis];
                true_m[axis][lane] = points[1][axis];
            }
        }
        let [mut z_m, mut distances_m, mut ground_x_m, mut ground_y_m] = [[0.0; LANES]; 4];
        let ([mut rows, mut cols], mut on_grid) = ([[0; LANES]; 2], [false; LANES]);
        for lane in 0..LANES {
            let located = assigner.locate(DVec3::new(measured[0][lane], measured[1][lane], measured[2][lane]));
            (z_m[lane], distances_m[lane]) = (located.point_m.z, located.distance_m);
            (rows[lane], cols[lane]) = (located.index.row, located.index.col);
            on_grid[lane] = located.on_grid;
            let truly_m = world_from_sensor.point(DVec3::new(true_m[0][lane], true_m[1][lane], true_m[2][lane]));
            (ground_x_m[lane], ground_y_m[lane]) = (truly_m.x, truly_m.y);
        }
        counts.points_in += slots.len() as u64;
        let cell = |lane: usize| {
            assigner.cell(distances_m[lane], CellIndex { row: rows[lane], col: cols[lane] }, on_grid[lane])
        };
        let of_ground = |&slot: &u32| sweep.truth[slot as usize].object == Hit::GROUND;
        if slots.len() == LANES
            && slots.iter().all(of_ground)
            && (0..LANES).all(|lane| cell(lane).is_ok())
            && !scan.intensity
        {
            // Most blocks: appended at once, as they would be one by one.
            let first = self.grounds.extend(ground_x_m, ground_y_m);
            self.cells.extend((0..LANES).map(|lane| CellIndex { row: rows[lane], col: cols[lane] }));
            self.heights_m.extend(z_m.map(|z_m| z_m - scan.rover_z_m));
            self.returns.extend((0..LANES).map(|lane| Return {
                distance_m: distances_m[lane],
                ground: first + lane as u32,
                object: Hit::GROUND,
                top: sweep.truth[slot(lane)].top,
            }));
            return;
        }
        for (lane, &slot) in slots.iter().enumerate() {
            let Some(cell) = count_dropped(cell(lane), counts) else { continue };
            let truth = &sweep.truth[slot as usize];
            let ground = if truth.object == Hit::GROUND {
                self.grounds.push(ground_x_m[lane], ground_y_m[lane])
            } else {
                let index = usize::try_from(truth.object).ok();
                if let Some(seen) = index.and_then(|index| self.seen_obstacles.get_mut(index)) {
                    *seen = true;
                }
                NOT_GROUND
            };
            self.cells.push(cell);
            self.heights_m.push(z_m[lane] - scan.rover_z_m);
            if scan.intensity {
                let range_m = sweep.returns.range_m[slot as usize];
                let received = sweep.returns.intensity.as_ref().map_or(f64::NAN, |i| f64::from(i[slot as usize]));
                self.intensities.push(received * range_m * range_m);
            }
            self.returns.push(Return { distance_m: distances_m[lane], ground, object: truth.object, top: truth.top });
        }
    }
}

/// [`Points::add_sweep`], in the machine's widest form.
struct AddSweep<'a> {
    points: &'a mut Points,
    scan: Scan<'a>,
    counts: &'a mut Cells,
}

impl Work for AddSweep<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let AddSweep { points, scan, counts } = self;
        for (first, statuses) in (0..).step_by(CHUNK).zip(scan.status.chunks(CHUNK)) {
            if statuses.iter().filter(|&&status| status == Status::Hit).count() == 0 {
                continue;
            }
            let (mut slots, mut hits) = ([0; CHUNK], 0);
            for (slot, &status) in (first..).zip(statuses) {
                slots[hits] = slot;
                hits += usize::from(status == Status::Hit);
            }
            for slots in slots[..hits].chunks(LANES) {
                points.add_block(slots, &scan, counts);
            }
        }
    }
}

/// The cell of a point, or a count of why it has none.
#[inline(always)]
fn count_dropped(cell: Result<CellIndex, Unplaced>, counts: &mut Cells) -> Option<CellIndex> {
    match cell {
        Ok(cell) => return Some(cell),
        Err(Unplaced::BeyondRange) => counts.dropped_beyond_range += 1,
        Err(Unplaced::OffGrid) => counts.dropped_off_grid += 1,
    }
    None
}
