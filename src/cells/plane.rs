//! Mean heights of the cells of one scan -> the plane of the ground around each cell.
//!
//! Definition: the grid is cut into blocks whose side is half of `radius_m`. The lowest cell of each block that holds points is its sample:
//! the cell's centre and mean height. The plane of a block is fitted to the samples of the five by five blocks around it, so that half of
//! the squared residuals' weight, 0.9 below the plane against 0.1 above it, lies on either side (the 0.1-expectile), with a prior that
//! holds the plane level where too few samples say otherwise. In: cells sorted by (row, col) and their mean heights, metres.
//! Out: each cell's height above the plane of its block at its own centre, metres, and the plane's slope, rise over run.
//!
//! Source: Newey & Powell 1987, "Asymmetric least squares estimation and testing", by reweighting. Where a percentile of the heights around
//! calls a steep bank high above its own foot, a plane follows it, and says how steep it is.
//! Deviation: a fixed number of reweightings instead of convergence, so that the work of a cell is bounded.
//! Not modelled: curvature within the blocks around; the true ground.

use super::CellRow;
use super::params::LocalHeightParams;
use crate::geometry::CellIndex;

/// Blocks to either side of a block whose samples its plane is fitted to.
const REACH_BLOCKS: i64 = 2;
/// Weights of a sample above the plane, and of one on or below it.
const ABOVE: f64 = 0.1;
const BELOW: f64 = 0.9;
/// Fits with new weights after the first, which has equal ones.
const REWEIGHTINGS: usize = 5;
/// Holds the slopes at nought, square metres: some samples half a metre away outweigh it.
const LEVEL_PRIOR_M2: f64 = 0.05;

/// The planes of one scan; reused memory between scans.
#[derive(Clone, Debug, Default)]
pub(super) struct GroundPlanes {
    size_m: f64,
    /// Side of a block, cells.
    side: i64,
    /// One for each block that holds points, sorted by block.
    samples: Vec<Sample>,
    /// Of the samples' blocks.
    planes: Vec<Plane>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Block {
    row: i64,
    col: i64,
}

/// The lowest cell of a block.
#[derive(Clone, Copy, Debug)]
struct Sample {
    block: Block,
    index: CellIndex,
    height_m: f64,
}

/// Heights above a block's centre are `level_m` + `east` x + `north` y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Plane {
    level_m: f64,
    east: f64,
    north: f64,
}

impl GroundPlanes {
    /// Fits the planes of a scan's cells; `rows` are sorted by (row, col), one height each.
    pub(super) fn fit(&mut self, params: &LocalHeightParams, size_m: f64, rows: &[CellRow], mean_heights_m: &[f64]) {
        self.size_m = size_m;
        self.side = ((0.5 * params.radius_m / size_m).round() as i64).max(1);
        let mut samples = std::mem::take(&mut self.samples);
        samples.clear();
        let sample =
            |(row, &height_m): (&CellRow, &f64)| Sample { block: self.block(row.index), index: row.index, height_m };
        samples.extend(rows.iter().zip(mean_heights_m).map(sample));
        // Of equal heights the first in the order of the cells.
        let order = |a: &Sample, b: &Sample| {
            a.block.cmp(&b.block).then(a.height_m.total_cmp(&b.height_m)).then(a.index.cmp(&b.index))
        };
        samples.sort_unstable_by(order);
        samples.dedup_by_key(|sample| sample.block);
        self.samples = samples;
        let mut planes = std::mem::take(&mut self.planes);
        planes.clear();
        planes.extend(self.samples.iter().map(|sample| self.plane(sample.block)));
        self.planes = planes;
    }

    /// Height above the plane at a cell's centre, metres, and the plane's slope; both 0 where no cell is near.
    pub(super) fn features(&self, index: CellIndex, height_m: f64) -> [f64; 2] {
        let block = self.block(index);
        let plane = match self.samples.binary_search_by_key(&block, |sample| sample.block) {
            Ok(at) => self.planes[at],
            Err(_) if self.around(block).next().is_none() => return [0.0; 2],
            Err(_) => self.plane(block),
        };
        let (east_m, north_m) = self.centre_to_cell_m(block, index);
        let above_m = height_m - plane.level_m - plane.east * east_m - plane.north * north_m;
        [above_m, (plane.east * plane.east + plane.north * plane.north).sqrt()]
    }

    fn block(&self, index: CellIndex) -> Block {
        Block { row: i64::from(index.row).div_euclid(self.side), col: i64::from(index.col).div_euclid(self.side) }
    }

    /// Where a cell's centre lies from that of a block, east and north.
    fn centre_to_cell_m(&self, block: Block, index: CellIndex) -> (f64, f64) {
        let half = 0.5 * (self.side - 1) as f64;
        let away_m = |cell: i32, block: i64| ((i64::from(cell) - block * self.side) as f64 - half) * self.size_m;
        (away_m(index.col, block.col), away_m(index.row, block.row))
    }

    /// The samples of the blocks around, row by row.
    fn around(&self, block: Block) -> impl Iterator<Item = &Sample> {
        (block.row - REACH_BLOCKS..=block.row + REACH_BLOCKS).flat_map(move |row| {
            let first = Block { row, col: block.col - REACH_BLOCKS };
            let last = Block { row, col: block.col + REACH_BLOCKS };
            let from = self.samples.partition_point(|sample| sample.block < first);
            self.samples[from..].iter().take_while(move |sample| sample.block <= last)
        })
    }

    /// The 0.1-expectile plane of the samples around a block; there is one at least.
    fn plane(&self, block: Block) -> Plane {
        let mut near = [(0.0, 0.0, 0.0); ((2 * REACH_BLOCKS + 1) * (2 * REACH_BLOCKS + 1)) as usize];
        let mut count = 0;
        for (near, sample) in near.iter_mut().zip(self.around(block)) {
            let (east_m, north_m) = self.centre_to_cell_m(block, sample.index);
            *near = (east_m, north_m, sample.height_m);
            count += 1;
        }
        let near = &mut near[..count];
        // Heights from one of them: a yard far above the datum costs no digits.
        let datum_m = near[0].2;
        near.iter_mut().for_each(|sample| sample.2 -= datum_m);
        let mut plane = weighted_plane(near, |_| 1.0);
        for _ in 0..REWEIGHTINGS {
            let Plane { level_m, east, north } = plane;
            let is_above = |(x_m, y_m, height_m): (f64, f64, f64)| height_m > level_m + east * x_m + north * y_m;
            plane = weighted_plane(near, |sample| if is_above(sample) { ABOVE } else { BELOW });
        }
        Plane { level_m: plane.level_m + datum_m, ..plane }
    }
}

/// Least squares by the normal equations about the weighted mean, the slopes held by the prior.
fn weighted_plane(samples: &[(f64, f64, f64)], weight: impl Fn((f64, f64, f64)) -> f64) -> Plane {
    let (mut total, mut x_sum, mut y_sum, mut height_sum) = (0.0, 0.0, 0.0, 0.0);
    for &sample in samples {
        let w = weight(sample);
        total += w;
        x_sum += w * sample.0;
        y_sum += w * sample.1;
        height_sum += w * sample.2;
    }
    let (x_mean_m, y_mean_m, height_mean_m) = (x_sum / total, y_sum / total, height_sum / total);
    let (mut xx, mut xy, mut yy, mut xh, mut yh) = (LEVEL_PRIOR_M2, 0.0, LEVEL_PRIOR_M2, 0.0, 0.0);
    for &sample in samples {
        let w = weight(sample);
        let (x_m, y_m, height_m) = (sample.0 - x_mean_m, sample.1 - y_mean_m, sample.2 - height_mean_m);
        xx += w * x_m * x_m;
        xy += w * x_m * y_m;
        yy += w * y_m * y_m;
        xh += w * x_m * height_m;
        yh += w * y_m * height_m;
    }
    // Positive: the prior stands on the diagonal.
    let determinant = xx * yy - xy * xy;
    let east = (yy * xh - xy * yh) / determinant;
    let north = (xx * yh - xy * xh) / determinant;
    Plane { level_m: height_mean_m - east * x_mean_m - north * y_mean_m, east, north }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::cells::fixtures::{rows_and_heights, square};

    const METRE: LocalHeightParams = LocalHeightParams { radius_m: 1.0, percentile: 10.0, plane: true };

    /// Of cells (row, col, mean height), sorted by row and column.
    fn computed(params: &LocalHeightParams, size_m: f64, cells: &[(i32, i32, f64)]) -> Vec<[f64; 2]> {
        let (rows, heights_m) = rows_and_heights(cells);
        let mut planes = GroundPlanes::default();
        planes.fit(params, size_m, &rows, &heights_m);
        cells.iter().map(|&(row, col, height_m)| planes.features(CellIndex { row, col }, height_m)).collect()
    }

    /// The definition, cell by cell: three normal equations by elimination with pivots, about the grid's origin.
    fn plainly(size_m: f64, side: i32, cells: &[(i32, i32, f64)], (row, col, height_m): (i32, i32, f64)) -> [f64; 2] {
        let (block_row, block_col) = (row.div_euclid(side), col.div_euclid(side));
        let mut samples = Vec::new();
        for r in block_row - 2..=block_row + 2 {
            for c in block_col - 2..=block_col + 2 {
                let inside = |cell: &&(i32, i32, f64)| (cell.0.div_euclid(side), cell.1.div_euclid(side)) == (r, c);
                let lowest =
                    cells.iter().filter(inside).min_by(|a, b| a.2.total_cmp(&b.2).then((a.0, a.1).cmp(&(b.0, b.1))));
                samples
                    .extend(lowest.map(|s| [1.0, f64::from(s.1 - col) * size_m, f64::from(s.0 - row) * size_m, s.2]));
            }
        }
        let mut plane = [0.0; 3];
        for round in 0..=5 {
            let mut sums = [[0.0, 0.0, 0.0, 0.0], [0.0, 0.05, 0.0, 0.0], [0.0, 0.0, 0.05, 0.0]];
            for s in &samples {
                let above = s[3] > plane[0] + plane[1] * s[1] + plane[2] * s[2];
                let w = if round == 0 {
                    1.0
                } else if above {
                    0.1
                } else {
                    0.9
                };
                for i in 0..3 {
                    (0..4).for_each(|j| sums[i][j] += w * s[i] * s[j]);
                }
            }
            for i in 0..3 {
                let pivot = (i..3).max_by(|&a, &b| sums[a][i].abs().total_cmp(&sums[b][i].abs())).unwrap();
                sums.swap(i, pivot);
                for k in (0..3).filter(|&k| k != i) {
                    let factor = sums[k][i] / sums[i][i];
                    (0..4).for_each(|j| sums[k][j] -= factor * sums[i][j]);
                }
            }
            plane = [0, 1, 2].map(|i| sums[i][3] / sums[i][i]);
        }
        [height_m - plane[0], (plane[1] * plane[1] + plane[2] * plane[2]).sqrt()]
    }

    proptest! {
        #[test]
        fn exact_planes_are_those_of_the_definition(
            cells in prop::collection::btree_map((-30i32..30, -40i32..40), -2.0..2.0f64, 1..300),
            radius_m in prop::sample::select(vec![0.1, 0.4, 1.0, 2.2]),
        ) {
            let cells: Vec<_> = cells.into_iter().map(|((r, c), h)| (r, c, h)).collect();
            let params = LocalHeightParams { radius_m, ..METRE };
            let side = ((0.5 * radius_m / 0.1).round() as i32).max(1);
            for (&cell, out) in cells.iter().zip(computed(&params, 0.1, &cells)).step_by(7) {
                let expected = plainly(0.1, side, &cells, cell);
                prop_assert!((out[0] - expected[0]).abs() < 1e-9 && (out[1] - expected[1]).abs() < 1e-9, "{out:?} {expected:?}");
            }
        }
    }

    #[test]
    fn exact_level_ground_and_one_cell_alone_give_0() {
        assert!(computed(&METRE, 0.1, &square(15, |_, _| 0.7)).iter().all(|out| *out == [0.0; 2]));
        assert_eq!(computed(&METRE, 0.1, &[(-7, 3, 123.4)]), [[0.0; 2]]);
        assert!(computed(&METRE, 0.1, &[]).is_empty());
        assert_eq!(
            GroundPlanes { side: 1, ..GroundPlanes::default() }.features(CellIndex { row: 3, col: 4 }, 5.0),
            [0.0; 2]
        );
    }

    #[test]
    fn law_a_step_on_a_steep_plane_stands_out_by_its_height_and_the_plane_by_its_slope() {
        // A slope of 0.5 to the north-east, and on it a block of 3 x 3 cells that is 0.4 m tall.
        let block = |r: i32, c: i32| r.abs() <= 1 && c.abs() <= 1;
        let rise = 0.05 * std::f64::consts::FRAC_1_SQRT_2;
        let cells = square(30, |r, c| rise * f64::from(r + c) + if block(r, c) { 0.4 } else { 0.0 });
        for (&(r, c, _), out) in
            cells.iter().zip(computed(&METRE, 0.1, &cells)).filter(|((r, c, _), _)| r.abs().max(c.abs()) < 15)
        {
            let own_m = out[0] - if block(r, c) { 0.4 } else { 0.0 };
            assert!(own_m.abs() < 0.03, "{r} {c} {own_m}");
            assert!((out[1] - 0.5).abs() < 0.02, "{r} {c} {}", out[1]);
        }
    }

    #[test]
    fn law_what_stands_on_a_third_of_the_ground_does_not_lift_the_plane() {
        // A wall of 1 m over all columns of every third block.
        let cells = square(30, |_, c| if c.div_euclid(5).rem_euclid(3) == 0 { 1.0 } else { 0.0 });
        let inside = |cell: &(i32, i32, f64)| cell.0.abs().max(cell.1.abs()) < 15;
        for (cell, out) in cells.iter().zip(computed(&METRE, 0.1, &cells)).filter(|(cell, _)| inside(cell)) {
            assert!((out[0] - cell.2).abs() < 0.3, "{cell:?} {out:?}");
        }
    }

    #[test]
    fn extreme_cells_at_the_ends_of_the_grid_and_heights_far_from_the_datum() {
        let far = i32::MAX - 17;
        let cells = [(-far, -far, 1.0), (-far, far, 2.0), (0, 0, 3.0), (far, -far, 4.0), (far, far, 5.0)];
        assert_eq!(computed(&METRE, 0.01, &cells), [[0.0; 2]; 5]);
        let slope = |level_m: f64| square(12, move |r, _| level_m + 0.03125 * f64::from(r));
        for (near, high) in computed(&METRE, 0.1, &slope(0.0)).into_iter().zip(computed(&METRE, 0.1, &slope(1e6))) {
            assert!((near[0] - high[0]).abs() < 1e-8 && (near[1] - high[1]).abs() < 1e-8);
        }
    }
}
