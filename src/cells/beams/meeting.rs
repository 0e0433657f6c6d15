//! The returns of a sweep, eight side by side, and a cell -> what the beams did that meet it.
//!
//! In: [`Block`]s and the spans of returns that may meet the cell, which is told as the sensor sees it; heights above the cell's plane.
//! Out: its [`Passage`]. Every lane keeps counts and nearest returns of its own, and these are joined at the end: counts and minima
//! are the same in any order.

use std::ops::Range;

use super::{Counts, HIGH_M, LOW_M, Passage, nearer};
use crate::geometry::DVec2;
use crate::wide::{LANES, Work};

/// Returns, seen from the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Block {
    /// Directions of length 1.
    pub x: [f64; LANES],
    pub y: [f64; LANES],
    pub range_m: [f64; LANES],
    /// Rise of the beam over its way, seen from above.
    pub slope: [f64; LANES],
}

/// A cell, and the returns whose beams may meet it.
pub(super) struct Meeting<'b> {
    pub blocks: &'b [Block],
    /// Numbers of returns, block after block.
    pub spans: [Range<usize>; 2],
    /// The cell's centre from the sensor.
    pub away_m: DVec2,
    /// A beam that passes the centre no farther than this meets the cell, where its foot lies no nearer than the least.
    pub half_m: f64,
    pub least_foot_m: f64,
    pub ends_within_m: f64,
    /// Heights above the cell's plane.
    pub sensor_m: f64,
    pub top_m: f64,
}

/// What one lane has met.
struct Lanes {
    /// As [`Counts`].
    ended: [u64; LANES],
    below_top: [u64; LANES],
    low: [u64; LANES],
    high: [u64; LANES],
    lowest_m: [f64; LANES],
    /// Distance and height.
    behind: [[f64; LANES]; 2],
    before: [[f64; LANES]; 2],
}

impl Work for Meeting<'_> {
    type Out = Passage;

    #[inline(always)]
    fn run(self) -> Passage {
        let mut lanes = Lanes::new();
        for span in &self.spans {
            for number in span.start / LANES..span.end.div_ceil(LANES) {
                lanes.take(&self, &self.blocks[number], number * LANES, span);
            }
        }
        lanes.joined()
    }
}

impl Lanes {
    #[inline(always)]
    fn new() -> Lanes {
        let Passage { lowest_m, behind, before, .. } = Passage::default();
        let each = |(distance_m, height_m): (f64, f64)| [[distance_m; LANES], [height_m; LANES]];
        Lanes {
            ended: [0; LANES],
            below_top: [0; LANES],
            low: [0; LANES],
            high: [0; LANES],
            lowest_m: [lowest_m; LANES],
            behind: each(behind),
            before: each(before),
        }
    }

    /// Takes the returns of a block, numbered from `first` on, that lie in the span.
    #[inline(always)]
    fn take(&mut self, cell: &Meeting, block: &Block, first: usize, span: &Range<usize>) {
        let (away_m, sensor_m) = (cell.away_m, cell.sensor_m);
        for l in 0..LANES {
            let (x, y, range_m, slope) = (block.x[l], block.y[l], block.range_m[l], block.slope[l]);
            let foot_m = away_m.x * x + away_m.y * y;
            let aside_m = (away_m.x * y - away_m.y * x).abs();
            let number = first + l;
            let is_in_span = (number >= span.start) & (number < span.end);
            let meets = is_in_span & (aside_m <= cell.half_m) & (foot_m >= cell.least_foot_m);
            let behind_m = range_m - foot_m;
            let goes_on = meets & (behind_m > cell.ends_within_m);
            let is_before = meets & (behind_m < -cell.ends_within_m);
            let ends = meets & (behind_m.abs() <= cell.ends_within_m);
            let (foot_height_m, height_m) = (sensor_m + slope * foot_m, sensor_m + slope * range_m);
            self.ended[l] += u64::from(ends);
            self.below_top[l] += u64::from(goes_on & (foot_height_m < cell.top_m));
            self.low[l] += u64::from(goes_on & (foot_height_m < LOW_M));
            self.high[l] += u64::from(goes_on & (foot_height_m < HIGH_M));
            let is_lowest = goes_on & (foot_height_m < self.lowest_m[l]);
            self.lowest_m[l] = if is_lowest { foot_height_m } else { self.lowest_m[l] };
            keep_nearer(&mut self.behind, l, goes_on, behind_m, height_m);
            keep_nearer(&mut self.before, l, is_before, -behind_m, height_m);
        }
    }

    #[inline(always)]
    fn joined(self) -> Passage {
        let sum = |lanes: [u64; LANES]| lanes.iter().sum::<u64>() as u32;
        let counts =
            Counts { ended: sum(self.ended), below_top: sum(self.below_top), low: sum(self.low), high: sum(self.high) };
        let nearest = |[distances_m, heights_m]: [[f64; LANES]; 2]| {
            let pairs = distances_m.into_iter().zip(heights_m);
            pairs.reduce(nearer).expect("there are lanes")
        };
        let lowest_m = self.lowest_m.into_iter().fold(f64::INFINITY, f64::min);
        Passage { counts, lowest_m, behind: nearest(self.behind), before: nearest(self.before) }
    }
}

/// As [`nearer`], in one lane and where `is_met`.
#[inline(always)]
fn keep_nearer(nearest: &mut [[f64; LANES]; 2], l: usize, is_met: bool, distance_m: f64, height_m: f64) {
    let [distances_m, heights_m] = nearest;
    let (old_m, old_height_m) = (distances_m[l], heights_m[l]);
    let is_nearer = is_met & ((distance_m < old_m) | ((distance_m == old_m) & (height_m < old_height_m)));
    distances_m[l] = if is_nearer { distance_m } else { old_m };
    heights_m[l] = if is_nearer { height_m } else { old_height_m };
}
