//! The returns of one sweep -> columns of beams, the gaps between neighbours in them, and what they know of a place.
//!
//! In: returns as offsets from the sensor with the axes of `map`, metres. A column holds the returns of one sector of azimuth, ordered by
//! elevation as seen from the sensor: a lidar's errors lie along its beams, so that the order holds where ranges are noisy. Between a
//! return and the next one above it a beam went by; where that lies farther off, the ground between them was passed over. Ranges are
//! horizontal, heights those above the rover's estimated z. Out: the long gaps, and `gap_` features of any place.
//!
//! The local plane before a gap is a least-squares line through the lowest return of each 5 cm of the last metre before it, in its column: the
//! ground, not the face of a thing that stands on it. A gap is long where it exceeds half as much again as that plane would leave between the
//! same two beams, and half a cell. So a thing's shadow on that plane is no long gap.
//! Own construction. The signs of a ditch are those of Matthies & Rankin 2003 ("Negative obstacle detection by thermal signature", its
//! geometry: a gap, and a far wall below the plane); the columns as in Larson & Trivedi 2011 ("Lidar based off-road negative obstacle
//! detection"). Not modelled: beams that never came back, which real clouds do not tell of: a gap without a return behind it is none.
//! Just behind a hole its wall tilts the plane, so that the beams' own spacing counts as short gaps there.

use std::f64::consts::{PI, TAU};

use super::columns::GAP_COLUMNS;
use super::sectors::{sort_by_sector, span};
use crate::geometry::{DVec2, DVec3};
use crate::math;

/// Gaps are taken to end there, metres: a stray return far beyond any rover's sensor takes no more work than one at that distance.
const FARTHEST_M: f64 = 1000.0;
/// The plane before a gap: how far back it is fitted, and of how many parts of that way the lowest return each.
const PLANE_M: f64 = 1.0;
const PLANE_BINS: usize = 20;
/// A fit over less than this says nothing of the slope.
const LEAST_BASE_M: f64 = 0.1;
const STEEPEST: f64 = 1.0;
/// How far before a gap the ground below a thing is looked for, and how far behind it a wall.
const RISE_M: f64 = 0.5;
const WALL_M: f64 = 0.3;
/// Lengths that have no end within sight are written as this, and longer ones are cut to it.
const LONGEST_M: f64 = 10.0;

/// One return.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct BeamReturn {
    /// Tangent of the elevation.
    elevation: f64,
    range_m: f64,
    height_m: f64,
}

/// Two returns that are neighbours in their column, with much ground between them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gap {
    near_m: f64,
    far_m: f64,
    near_height_m: f64,
    far_height_m: f64,
    /// The plane before it.
    ground: Line,
    excess_m: f64,
    rise_m: f64,
    wall_m: f64,
}

/// Columns of beams; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct BeamColumns {
    sector_rad: f64,
    sectors: usize,
    sensor_m: DVec2,
    sensor_height_m: f64,
    of_return: Vec<(u32, BeamReturn)>,
    returns: Vec<BeamReturn>,
    first_return: Vec<u32>,
    gaps: Vec<Gap>,
    first_gap: Vec<u32>,
}

/// The features of a place, in the order of the columns.
pub(super) type GapFeatures = [f64; GAP_COLUMNS.len()];

impl BeamColumns {
    /// Begins a sweep whose sensor is believed to be at `sensor_m` (map).
    pub(super) fn begin(&mut self, sector_deg: f64, sensor_m: DVec3, rover_z_m: f64) {
        self.sectors = (360.0 / sector_deg - 1e-9).ceil().max(1.0) as usize;
        self.sector_rad = TAU / self.sectors as f64;
        self.sensor_m = sensor_m.truncate();
        self.sensor_height_m = sensor_m.z - rover_z_m;
        self.of_return.clear();
    }

    /// Adds a return by its offset from the sensor.
    #[inline]
    pub(super) fn add(&mut self, offset_m: DVec3) {
        let range_m = math::hypot(offset_m.x, offset_m.y);
        let (elevation, height_m) = (offset_m.z / range_m, offset_m.z + self.sensor_height_m);
        if elevation.is_finite() && range_m.is_finite() {
            let sector = self.sector(math::atan2(offset_m.y, offset_m.x));
            self.of_return.push((sector as u32, BeamReturn { elevation, range_m, height_m }));
        }
    }

    /// Sorts the returns into their columns and finds the gaps. `size_m`: a cell's.
    pub(super) fn finish(&mut self, size_m: f64) {
        sort_by_sector(&self.of_return, self.sectors, &mut self.first_return, &mut self.returns);
        self.gaps.clear();
        self.first_gap.clear();
        for sector in 0..self.sectors {
            self.first_gap.push(self.gaps.len() as u32);
            let column = &mut self.returns[span(&self.first_return, sector)];
            column.sort_unstable_by(|a, b| a.elevation.total_cmp(&b.elevation).then(a.range_m.total_cmp(&b.range_m)));
            for near in 0..column.len().saturating_sub(1) {
                self.gaps.extend(gap_after(column, near, self.sensor_height_m, size_m));
            }
        }
        self.first_gap.push(self.gaps.len() as u32);
    }

    fn sector(&self, azimuth_rad: f64) -> usize {
        let sector = ((azimuth_rad + PI) / self.sector_rad).floor();
        (sector.rem_euclid(self.sectors as f64) as usize).min(self.sectors - 1)
    }

    fn column(&self, sector: usize) -> &[BeamReturn] {
        &self.returns[span(&self.first_return, sector)]
    }

    /// Range and azimuth of a place in the map.
    fn polar(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let away = DVec2::new(x_m, y_m) - self.sensor_m;
        (math::hypot(away.x, away.y), math::atan2(away.y, away.x))
    }

    /// Horizontal distance of a place from the sensor.
    pub(super) fn range_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.polar(x_m, y_m).0
    }

    /// The return before a place and the lowest one behind it, in its column; `None` where either is missing: beyond what was swept.
    fn around(&self, range_m: f64, azimuth_rad: f64) -> Option<(BeamReturn, BeamReturn)> {
        let column = self.column(self.sector(azimuth_rad));
        let behind = column.iter().position(|beam| beam.range_m > range_m)?;
        Some((*column.get(behind.checked_sub(1)?)?, column[behind]))
    }

    /// The height of the line from the return before a place to the one behind it.
    pub(super) fn chord_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let (range_m, azimuth_rad) = self.polar(x_m, y_m);
        let (before, behind) = self.around(range_m, azimuth_rad)?;
        let share = (range_m - before.range_m) / (behind.range_m - before.range_m);
        Some(before.height_m + share * (behind.height_m - before.height_m))
    }

    /// Calls `visit` for places (x, y) in the map that lie within `around_m` of a long gap and `most_m` of the sensor, at most `step_m` apart
    /// where the gap ends within [`FARTHEST_M`].
    pub(super) fn each_near_gap(&self, around_m: f64, step_m: f64, most_m: f64, mut visit: impl FnMut(f64, f64)) {
        for sector in 0..self.sectors {
            for gap in &self.gaps[span(&self.first_gap, sector)] {
                let (from_m, to_m) = ((gap.near_m - around_m).max(0.0), (gap.far_m + around_m).min(FARTHEST_M));
                let across = (to_m * self.sector_rad / step_m).ceil().max(1.0) as usize;
                let along = ((to_m - from_m) / step_m).ceil().max(1.0) as usize;
                for share in (0..across).map(|k| (k as f64 + 0.5) / across as f64) {
                    let (sin, cos) = math::sin_cos((sector as f64 + share) * self.sector_rad - PI);
                    for k in 0..=along {
                        let range_m = from_m + (to_m - from_m) * k as f64 / along as f64;
                        if range_m > most_m {
                            break;
                        }
                        visit(self.sensor_m.x + cos * range_m, self.sensor_m.y + sin * range_m);
                    }
                }
            }
        }
    }

    /// The long gap with the greatest excess that lies within `around_m` of a range, in the columns of some azimuths.
    fn longest(&self, range_m: f64, azimuths_rad: [f64; 2], around_m: f64) -> Option<Gap> {
        let [first, last] = azimuths_rad.map(|azimuth| self.sector(azimuth));
        let columns = (last + self.sectors - first) % self.sectors;
        let sectors = (0..=columns).map(|k| (first + k) % self.sectors);
        let gaps = sectors.flat_map(|sector| &self.gaps[span(&self.first_gap, sector)]);
        let near = gaps.filter(|gap| range_m >= gap.near_m - around_m && range_m <= gap.far_m + around_m);
        // Of equals the first.
        near.fold(None, |best: Option<Gap>, gap| match best {
            Some(best) if best.excess_m >= gap.excess_m => Some(best),
            _ => Some(*gap),
        })
    }

    /// What the beams know of a cell at (x, y) in the map whose mean height is `height_m`.
    pub(super) fn features(&self, x_m: f64, y_m: f64, height_m: f64, size_m: f64, around_m: f64) -> GapFeatures {
        let (range_m, azimuth_rad) = self.polar(x_m, y_m);
        let turn_rad = |cells: f64| (cells * size_m / range_m.max(size_m)).min(0.5);
        let sides = |cells: f64| azimuth_rad + turn_rad(cells);
        let column = self.column(self.sector(azimuth_rad));
        let beams = column.iter().filter(|beam| beam.range_m > range_m).count() as f64;
        let beside =
            |cells: f64| self.longest(range_m, [sides(cells); 2], around_m).map_or(0.0, |gap| gap.far_m - gap.near_m);
        let [left_m, right_m] = [beside(1.5), beside(-1.5)];
        let Some(gap) = self.longest(range_m, [azimuth_rad - turn_rad(0.5), sides(0.5)], around_m) else {
            let none = [0.0, 0.0, around_m, around_m, range_m, height_m, height_m];
            let mut features = GapFeatures::default();
            features[..none.len()].copy_from_slice(&none);
            features[GAP_COLUMNS.len() - 3..].copy_from_slice(&[beams, left_m, right_m]);
            return features;
        };
        let lowest = column.iter().find(|beam| beam.range_m > range_m);
        let below_m =
            lowest.map_or(0.0, |beam| gap.ground.at(range_m) - (self.sensor_height_m + beam.elevation * range_m));
        let fall_m = self.sensor_height_m - gap.near_height_m;
        let shadow_m = if fall_m > 0.0 { (gap.near_m * gap.rise_m / fall_m).min(LONGEST_M) } else { LONGEST_M };
        [
            gap.far_m - gap.near_m,
            gap.excess_m,
            range_m - gap.near_m,
            gap.far_m - range_m,
            gap.near_m,
            gap.near_height_m,
            gap.far_height_m,
            gap.ground.at(gap.far_m) - gap.far_height_m,
            below_m,
            gap.ground.slope,
            gap.rise_m,
            shadow_m,
            gap.wall_m,
            beams,
            left_m,
            right_m,
        ]
    }
}

/// The gap between a return of a column and the next one, where it is long.
fn gap_after(column: &[BeamReturn], near: usize, sensor_height_m: f64, size_m: f64) -> Option<Gap> {
    let (before, behind) = (column[near], column[near + 1]);
    let length_m = behind.range_m - before.range_m;
    if length_m <= 0.5 * size_m {
        return None;
    }
    let ground = ground_before(column, near);
    // Where the upper beam meets the plane.
    let meets_m = (ground.level_m - sensor_height_m) / (behind.elevation - ground.slope);
    let plane_m = (meets_m - before.range_m).max(0.0);
    let plane_m = if behind.elevation < ground.slope { plane_m.min(LONGEST_M) } else { LONGEST_M };
    if length_m <= 1.5 * plane_m + 0.5 * size_m {
        return None;
    }
    let earlier = column[..near].iter().rev().take_while(|beam| beam.range_m >= before.range_m - RISE_M);
    let lowest_m = earlier.fold(before.height_m, |low, beam| low.min(beam.height_m));
    let later = column[near + 1..].iter().take_while(|beam| beam.range_m <= behind.range_m + WALL_M);
    let highest_m = later.fold(behind.height_m, |high, beam| high.max(beam.height_m));
    Some(Gap {
        near_m: before.range_m,
        far_m: behind.range_m,
        near_height_m: before.height_m,
        far_height_m: behind.height_m,
        ground,
        excess_m: length_m - plane_m,
        rise_m: before.height_m - lowest_m,
        wall_m: highest_m - behind.height_m,
    })
}

/// A straight line: the ground along a column.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    level_m: f64,
    slope: f64,
}

impl Line {
    fn at(self, range_m: f64) -> f64 {
        self.level_m + self.slope * range_m
    }
}

/// The line through the lowest returns before a gap; level through the last return where they say nothing of a slope.
fn ground_before(column: &[BeamReturn], near: usize) -> Line {
    let last = column[near];
    let mut lowest = [None::<BeamReturn>; PLANE_BINS];
    for beam in column[..=near].iter().rev().take_while(|beam| beam.range_m >= last.range_m - PLANE_M) {
        let bin = ((last.range_m - beam.range_m) / PLANE_M * PLANE_BINS as f64) as usize;
        let low = &mut lowest[bin.min(PLANE_BINS - 1)];
        *low = Some(low.map_or(*beam, |low| if beam.height_m < low.height_m { *beam } else { low }));
    }
    let count = lowest.iter().flatten().count() as f64;
    let mean = |of: fn(&BeamReturn) -> f64| lowest.iter().flatten().map(of).sum::<f64>() / count;
    let (range_m, height_m) = (mean(|beam| beam.range_m), mean(|beam| beam.height_m));
    let (mut spread, mut rise) = (0.0, 0.0);
    for beam in lowest.iter().flatten() {
        spread += (beam.range_m - range_m) * (beam.range_m - range_m);
        rise += (beam.range_m - range_m) * (beam.height_m - height_m);
    }
    if spread < count * LEAST_BASE_M * LEAST_BASE_M / 12.0 {
        return Line { level_m: last.height_m, slope: 0.0 };
    }
    let slope = (rise / spread).clamp(-STEEPEST, STEEPEST);
    Line { level_m: height_m - slope * range_m, slope }
}

#[cfg(test)]
mod tests;
