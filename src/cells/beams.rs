//! The returns of one sweep -> what their beams tell of each cell: which ended there, which went through or over it, and what lies before and behind.
//!
//! In: returns as offsets from the sensor with the axes of `map`, metres; all of the sweep, those that lie in no cell among them. A beam
//! meets a cell where its line, seen from above, passes the cell's centre within half a cell. It ended there where its return lies within
//! 0.6 cells of the foot of the centre on the line; of a beam that went on, the height at that foot is that of the straight line to its
//! return. Heights are above the plane around the cell (`plane_height_m`), which is also what returns before and behind are told above.
//! Out: the features of [`NAMES`], and for each square around the cell those of [`NAMES_OF_SQUARES`].
//!
//! The share of beams that go through is what tells grass and bushes from stones of the same shape: "permeability" of Ahtiainen et al. 2017
//! ("Normal distributions transform traversability maps", whose cells are cubes; here a layer of each cell, below its own highest point or below
//! a fixed height), after the density of Macedo et al. 2000 and Lalonde et al. 2006. Own construction otherwise. Not modelled: beams that
//! never came back, which real clouds do not tell of; the width of a beam; earlier sweeps of a window.

mod meeting;

use self::meeting::{Block, Meeting};
use super::params::BeamParams;
use super::sectors::sort_by_sector;
use super::squares::Squares;
use crate::geometry::{CellIndex, DVec2, DVec3};
use crate::math;
use crate::wide::{LANES, widest};

/// Of the features of a cell itself: what their columns are called, unit and meaning.
pub(super) const NAMES: [(&str, &str, &str); 7] = [
    ("through", "1", "share that went on, of the beams that ended in the cell or went on lower than its highest point"),
    (
        "through_high",
        "1",
        "share that went on, of the beams that ended in the cell or went on lower than 0.5 m above the plane",
    ),
    ("lowest", "m", "height above the plane of the lowest beam that went on, 1 m at most"),
    ("behind", "m", "distance of the nearest return behind the cell along its beams, 5 m at most"),
    ("behind_height", "m", "height of that return above the cell's plane, 0 where none is so near"),
    ("before", "m", "distance of the nearest return before the cell along its beams, 2 m at most"),
    ("before_height", "m", "height of that return above the cell's plane, 0 where none is so near"),
];

/// Of the features of a square, over the beams of all cells in it that hold points.
pub(super) const NAMES_OF_SQUARES: [(&str, &str, &str); 3] = [
    ("through", "1", "share that went on, of the beams that ended in a cell or went on lower than its highest point"),
    (
        "through_low",
        "1",
        "share that went on, of the beams that ended in a cell or went on lower than 0.1 m above its plane",
    ),
    (
        "through_high",
        "1",
        "share that went on, of the beams that ended in a cell or went on lower than 0.5 m above its plane",
    ),
];

/// Heights above the plane of a cell below which beams are counted, metres.
const LOW_M: f64 = 0.1;
const HIGH_M: f64 = 0.5;
/// A beam that went on higher than this is written as this.
const LOWEST_MOST_M: f64 = 1.0;
const BEHIND_MOST_M: f64 = 5.0;
const BEFORE_MOST_M: f64 = 2.0;
/// A return that lies farther from the foot of the centre, in cells, ended before or behind the cell.
const ENDS_WITHIN: f64 = 0.6;
/// Sectors around the sensor in which returns are kept; they only make the search short.
const SECTORS: usize = 2048;

/// One return, seen from the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct BeamReturn {
    /// Of length 1.
    towards: DVec2,
    range_m: f64,
    /// Rise of the beam over its way, seen from above.
    slope: f64,
}

/// The returns of a sweep, sector by sector; reused memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Beams {
    sensor_m: DVec2,
    sensor_height_m: f64,
    of_sweep: Vec<(u32, BeamReturn)>,
    returns: Vec<BeamReturn>,
    /// The same side by side; what is behind the last return is of no sector.
    blocks: Vec<Block>,
    first: Vec<u32>,
}

/// What the beams that meet a cell did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Passage {
    counts: Counts,
    lowest_m: f64,
    behind: (f64, f64),
    before: (f64, f64),
}

/// Beams that ended in a cell, and that went on lower than its highest point, than [`LOW_M`] and than [`HIGH_M`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    ended: u32,
    below_top: u32,
    low: u32,
    high: u32,
}

impl Beams {
    /// Begins a sweep whose sensor is believed to be at `sensor_m` (map).
    pub(super) fn begin(&mut self, sensor_m: DVec3, rover_z_m: f64) {
        (self.sensor_m, self.sensor_height_m) = (sensor_m.truncate(), sensor_m.z - rover_z_m);
        self.of_sweep.clear();
    }

    /// Adds a return by its offset from the sensor.
    #[inline]
    pub(super) fn add(&mut self, offset_m: DVec3) {
        let range_m = math::hypot(offset_m.x, offset_m.y);
        let towards = offset_m.truncate() / range_m;
        if towards.is_finite() && range_m.is_finite() && offset_m.z.is_finite() {
            let beam = BeamReturn { towards, range_m, slope: offset_m.z / range_m };
            self.of_sweep.push((sector(turn(towards)) as u32, beam));
        }
    }

    /// Sorts the returns into their sectors.
    pub(super) fn finish(&mut self) {
        sort_by_sector(&self.of_sweep, SECTORS, &mut self.first, &mut self.returns);
        self.blocks.clear();
        self.blocks.extend(self.returns.chunks(LANES).map(block));
    }

    /// What the beams did that meet a cell of this size at (x, y) in the map, whose plane and highest point have these heights.
    pub(super) fn passage(&self, centre_m: DVec2, size_m: f64, plane_m: f64, top_m: f64) -> Passage {
        let away_m = centre_m - self.sensor_m;
        let half_m = 0.5 * size_m;
        // A sensor over the cell has beams in all directions; over any other place those that look away from it do not meet it.
        let least_foot_m = if away_m.length_squared() > half_m * half_m { 0.0 } else { -half_m };
        let spans = self.sectors(away_m, half_m).map(|sectors| {
            let [from, to] = [sectors.start, sectors.end].map(|sector| self.first[sector] as usize);
            from..to
        });
        widest(Meeting {
            blocks: &self.blocks,
            spans,
            away_m,
            half_m,
            least_foot_m,
            ends_within_m: ENDS_WITHIN * size_m,
            sensor_m: self.sensor_height_m - plane_m,
            top_m: top_m - plane_m,
        })
    }

    /// Sectors that hold every beam that passes within `half_m` of a place, and some others.
    fn sectors(&self, away_m: DVec2, half_m: f64) -> [std::ops::Range<usize>; 2] {
        let range_m = math::hypot(away_m.x, away_m.y);
        if range_m.is_nan() || range_m <= 4.0 * half_m {
            return [0..SECTORS, 0..0];
        }
        // An angle is at most 1.05 times its sine up to 30 degrees. By an angle a turn grows by it over (|x| + |y|)^2 of its direction, and
        // |x| + |y| falls by no more than the angle.
        let (angle, towards) = (1.05 * half_m / range_m, away_m / range_m);
        let least_sum = towards.x.abs() + towards.y.abs() - angle;
        let (middle, reach) = (turn(towards), angle / (least_sum * least_sum));
        let (first, last) = (sector(wrapped(middle - reach)), sector(wrapped(middle + reach)));
        if first <= last { [first..last + 1, 0..0] } else { [first..SECTORS, 0..last + 1] }
    }
}

/// How far a direction is turned from x, from 0 to 4: a quarter turn is 1, and between them it grows with the angle, without its price.
fn turn(towards: DVec2) -> f64 {
    let share = towards.y / (towards.x.abs() + towards.y.abs());
    if towards.x < 0.0 { 2.0 - share } else { wrapped(share) }
}

fn wrapped(turn: f64) -> f64 {
    if turn < 0.0 {
        turn + 4.0
    } else if turn >= 4.0 {
        turn - 4.0
    } else {
        turn
    }
}

fn sector(turn: f64) -> usize {
    ((turn * (SECTORS as f64 / 4.0)) as usize).min(SECTORS - 1)
}

/// Up to [`LANES`] returns side by side.
fn block(returns: &[BeamReturn]) -> Block {
    let mut block = Block::default();
    for (l, beam) in returns.iter().enumerate() {
        (block.x[l], block.y[l]) = (beam.towards.x, beam.towards.y);
        (block.range_m[l], block.slope[l]) = (beam.range_m, beam.slope);
    }
    block
}

/// The nearer of two returns (distance, height); of two as near the lower one, whichever came first.
fn nearer(one: (f64, f64), other: (f64, f64)) -> (f64, f64) {
    if other < one { other } else { one }
}

impl Default for Passage {
    /// Of a cell that no beam meets.
    fn default() -> Passage {
        Passage {
            counts: Counts::default(),
            lowest_m: LOWEST_MOST_M,
            behind: (BEHIND_MOST_M, 0.0),
            before: (BEFORE_MOST_M, 0.0),
        }
    }
}

impl Passage {
    /// In the order of [`NAMES`].
    fn features(&self) -> [f64; NAMES.len()] {
        let Passage { counts, lowest_m, behind, before } = *self;
        let through = |gone_on: u32| share(gone_on.into(), counts.ended.into());
        [through(counts.below_top), through(counts.high), lowest_m, behind.0, behind.1, before.0, before.1]
    }
}

/// Of beams that went on and that ended, the share that went on; 0 of none.
fn share(gone_on: u64, ended: u64) -> f64 {
    gone_on as f64 / (gone_on + ended).max(1) as f64
}

/// What the beams did at each cell of a scan, and the counts of all cells before each of them, and of all: squares are made of these.
#[derive(Clone, Debug, Default)]
pub(super) struct Passages {
    of_cells: Vec<Passage>,
    before: Vec<[u64; 4]>,
}

impl Passages {
    /// Takes the cells of a scan, in their order.
    pub(super) fn take(&mut self, of_cells: impl Iterator<Item = Passage>) {
        self.of_cells.clear();
        self.of_cells.extend(of_cells);
        let mut sum = [0; 4];
        self.before.clear();
        self.before.push(sum);
        for Passage { counts: Counts { ended, below_top, low, high }, .. } in &self.of_cells {
            sum.iter_mut().zip([ended, below_top, low, high]).for_each(|(sum, own)| *sum += u64::from(*own));
            self.before.push(sum);
        }
    }

    pub(super) fn of_cells(&self) -> &[Passage] {
        &self.of_cells
    }

    /// All features of a place: its own, and those of the squares around it, one after the other.
    pub(super) fn of(
        &self,
        params: &BeamParams,
        size_m: f64,
        squares: &Squares,
        index: CellIndex,
        own: &Passage,
    ) -> impl Iterator<Item = f32> {
        let around = params
            .radii_m
            .iter()
            .flat_map(move |radius_m| self.square(squares, index, (radius_m / size_m).round() as i64));
        own.features().into_iter().chain(around).map(|value| value as f32)
    }

    /// In the order of [`NAMES_OF_SQUARES`].
    fn square(&self, squares: &Squares, index: CellIndex, reach: i64) -> [f64; NAMES_OF_SQUARES.len()] {
        let mut sum = [0; 4];
        squares.each_line(index, reach, |cells| {
            let (from, to) = (&self.before[cells.start], &self.before[cells.end]);
            sum.iter_mut().zip(from.iter().zip(to)).for_each(|(sum, (from, to))| *sum += to - from);
        });
        let [ended, below_top, low, high] = sum;
        [below_top, low, high].map(|gone_on| share(gone_on, ended))
    }
}

#[cfg(test)]
mod tests;
