//! Mean heights of the cells of one scan -> how the ground bends at each cell, over several distances.
//!
//! Definition: around a cell with mean height h stand eight pairs of opposite places, every 22.5 degrees from
//! east and west on, each `radius_m` away, rounded to cells. The height of a place is the mean of the mean heights of those of its cell and that cell's four
//! neighbours by side that hold points; a pair counts where both its places have one. The bend of a pair is the sum of its two heights
//! less 2 h; least and most over the pairs that count are the features of that distance, both 0 where none does.
//! In: cells sorted by (row, col) and their mean heights, metres. Out: two features a distance, metres.
//!
//! Source: central second differences along lines through a place, as geomorphometry takes its least and its greatest curvature (Evans 1972;
//! Wood 1996); not divided by the squared distance, so that they stay heights. A plane, however steep, bends nowhere: what stands
//! on a slope is told from the slope itself, where heights and their spread within a cell are not. The four neighbours close the gaps
//! between the lines of a scan.
//! Not modelled: the inside of the cells; pairs of which one place holds no point.

use super::CellRow;
use super::extent::Extent;
use super::params::CurvatureParams;
use crate::geometry::CellIndex;

/// Sines of 22.5, 45 and 67.5 degrees.
const LOW: f64 = 0.382_683_432_365_089_8;
const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
const HIGH: f64 = 0.923_879_532_511_286_7;
/// One place of each pair, as shares of the distance to the east and to the north.
const DIRECTIONS: [[f64; 2]; 8] = [
    [1.0, 0.0],
    [HIGH, LOW],
    [DIAGONAL, DIAGONAL],
    [LOW, HIGH],
    [0.0, 1.0],
    [-LOW, HIGH],
    [-DIAGONAL, DIAGONAL],
    [-HIGH, LOW],
];
/// A place's cell and its neighbours by side, columns to the east and rows to the north.
const AROUND: [[i64; 2]; 5] = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]];

/// Reused memory; has no meaning between calls.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    /// Of each place of the extent, what it holds.
    places: Vec<Place>,
}

/// The heights of a place's cells.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    sum_m: f64,
    cells: u32,
}

/// The bends of a cell's pairs so far.
#[derive(Clone, Copy, Debug)]
struct Bend {
    least_m: f64,
    most_m: f64,
}

/// Calls `write(cell, which distance, [least, most])` for each cell and each distance; `rows` are sorted by (row, col), one height each.
pub(super) fn bends(
    params: &CurvatureParams,
    size_m: f64,
    rows: &[CellRow],
    mean_heights_m: &[f64],
    scratch: &mut Scratch,
    mut write: impl FnMut(usize, usize, [f64; 2]),
) {
    // A place lies up to a cell beside those that hold points.
    let Some(extent) = Extent::of(rows, 1) else {
        let find = |index| rows.binary_search_by_key(&index, |row| row.index).ok().map(|at| mean_heights_m[at]);
        for (distance, &radius_m) in params.radii_m.iter().enumerate() {
            for (cell, (row, &height_m)) in rows.iter().zip(mean_heights_m).enumerate() {
                write(cell, distance, bend_at(radius_m, size_m, row.index, height_m, find));
            }
        }
        return;
    };
    let place_of = |row: &CellRow, [east, north]: [i64; 2]| {
        extent.place(i64::from(row.index.row) + north, i64::from(row.index.col) + east)
    };
    let Scratch { places } = scratch;
    places.clear();
    places.resize(extent.places(), Place::default());
    // Each place takes its own cell first, then the neighbours in their order.
    for [east, north] in AROUND {
        for (row, &height_m) in rows.iter().zip(mean_heights_m) {
            places[place_of(row, [-east, -north]).expect("within the margin")].add(height_m);
        }
    }
    for (distance, &radius_m) in params.radii_m.iter().enumerate() {
        let offsets = offsets(radius_m, size_m);
        for (cell, (row, &height_m)) in rows.iter().zip(mean_heights_m).enumerate() {
            let mut bend = Bend::NONE;
            for [east, north] in offsets {
                let pair = [1, -1].map(|side| place_of(row, [side * east, side * north]).map(|at| &places[at]));
                if let [Some(one), Some(other)] = pair {
                    bend.take([one, other], height_m);
                }
            }
            write(cell, distance, bend.features());
        }
    }
}

/// The same of one place and one distance, whether or not its cell holds points; `height_at` tells the mean height of a cell.
pub(super) fn bend_at(
    radius_m: f64,
    size_m: f64,
    index: CellIndex,
    height_m: f64,
    height_at: impl Fn(CellIndex) -> Option<f64>,
) -> [f64; 2] {
    let mut bend = Bend::NONE;
    for [east, north] in offsets(radius_m, size_m) {
        let places = [1, -1].map(|side| {
            let mut place = Place::default();
            for [e, n] in AROUND {
                let [row, col] = [(index.row, side * north + n), (index.col, side * east + e)]
                    .map(|(own, away)| i32::try_from(i64::from(own) + away).ok());
                let found = row.zip(col).and_then(|(row, col)| height_at(CellIndex { row, col }));
                found.into_iter().for_each(|height_m| place.add(height_m));
            }
            place
        });
        bend.take([&places[0], &places[1]], height_m);
    }
    bend.features()
}

/// Columns to the east and rows to the north of one place of each pair.
fn offsets(radius_m: f64, size_m: f64) -> [[i64; 2]; 8] {
    DIRECTIONS.map(|shares| shares.map(|share| (share * radius_m / size_m).round() as i64))
}

impl Place {
    fn add(&mut self, height_m: f64) {
        self.sum_m += height_m;
        self.cells += 1;
    }
}

impl Bend {
    const NONE: Bend = Bend { least_m: f64::INFINITY, most_m: f64::NEG_INFINITY };

    /// Counts a pair in, where both its places hold a height.
    fn take(&mut self, pair: [&Place; 2], height_m: f64) {
        if pair.iter().all(|place| place.cells > 0) {
            let [one_m, other_m] = pair.map(|place| place.sum_m / f64::from(place.cells) - height_m);
            let bend_m = one_m + other_m;
            *self = Bend { least_m: self.least_m.min(bend_m), most_m: self.most_m.max(bend_m) };
        }
    }

    /// Least and most, metres.
    fn features(&self) -> [f64; 2] {
        if self.least_m <= self.most_m { [self.least_m, self.most_m] } else { [0.0; 2] }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;
    use crate::cells::fixtures::{rows_and_heights, square};

    type Heights = [(i32, i32, f64)];

    /// Of cells (row, col, mean height), sorted by row and column: for each, least and most of each distance.
    fn computed(radii_m: &[f64], size_m: f64, cells: &Heights) -> Vec<Vec<[f64; 2]>> {
        let (rows, heights_m) = rows_and_heights(cells);
        let mut out = vec![vec![[f64::NAN; 2]; radii_m.len()]; cells.len()];
        let params = CurvatureParams { radii_m: radii_m.to_vec() };
        bends(&params, size_m, &rows, &heights_m, &mut Scratch::default(), |cell, k, bend_m| out[cell][k] = bend_m);
        out
    }

    /// The definition, place by place.
    fn plainly(radius_m: f64, size_m: f64, cells: &Heights, (row, col, height_m): (i32, i32, f64)) -> [f64; 2] {
        let heights: BTreeMap<(i32, i32), f64> = cells.iter().map(|&(r, c, h)| ((r, c), h)).collect();
        let place = |north: f64, east: f64| {
            let (r, c) =
                (row + (radius_m * north / size_m).round() as i32, col + (radius_m * east / size_m).round() as i32);
            let own = [(r, c), (r, c + 1), (r, c - 1), (r + 1, c), (r - 1, c)];
            let found: Vec<f64> = own.iter().filter_map(|cell| heights.get(cell)).copied().collect();
            (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
        };
        let bends: Vec<f64> = (0..8)
            .filter_map(|k| {
                let (sin, cos) = crate::math::sin_cos(f64::from(k) * std::f64::consts::PI / 8.0);
                Some(place(sin, cos)? + place(-sin, -cos)? - 2.0 * height_m)
            })
            .collect();
        let least_m = bends.iter().copied().reduce(f64::min);
        let most_m = bends.iter().copied().reduce(f64::max);
        [least_m.unwrap_or(0.0), most_m.unwrap_or(0.0)]
    }

    proptest! {
        #[test]
        fn exact_bends_are_those_of_the_definition_place_by_place_and_alike_for_one_cell_alone(
            cells in prop::collection::btree_map((-20i32..20, -25i32..25), -2.0..2.0f64, 0..700),
            size_m in prop::sample::select(vec![0.1, 0.07, 0.25]),
        ) {
            let cells: Vec<_> = cells.into_iter().map(|((r, c), h)| (r, c, h)).collect();
            let radii_m = [size_m, 2.0 * size_m, 0.4, 0.8];
            let heights: BTreeMap<_, f64> = cells.iter().map(|&(row, col, h)| (CellIndex { row, col }, h)).collect();
            for (&cell, out) in cells.iter().zip(computed(&radii_m, size_m, &cells)).step_by(5) {
                let index = CellIndex { row: cell.0, col: cell.1 };
                for (radius_m, out) in radii_m.into_iter().zip(out) {
                    let expected = plainly(radius_m, size_m, &cells, cell);
                    prop_assert!((0..2).all(|k| (out[k] - expected[k]).abs() < 1e-12), "{out:?} {expected:?}");
                    let alone = bend_at(radius_m, size_m, index, cell.2, |index| heights.get(&index).copied());
                    prop_assert_eq!(out, alone);
                }
            }
        }
    }

    #[test]
    fn exact_a_plane_bends_nowhere_however_steep_and_a_ridge_by_twice_its_fall() {
        let slope = square(12, |r, c| 0.3 * f64::from(r) - 0.2 * f64::from(c) + 1e3);
        let inside = |r: i32, c: i32| r.abs().max(c.abs()) < 3;
        let radii_m = [0.1, 0.2, 0.4, 0.8];
        for (&(r, c, _), out) in slope.iter().zip(computed(&radii_m, 0.1, &slope)) {
            assert!(!inside(r, c) || out.iter().flatten().all(|bend_m| bend_m.abs() < 1e-9), "{r} {c} {out:?}");
        }
        // A roof along the rows of column 0: across it both sides lie lower; along it nothing does.
        let roof = square(12, |_, c| -0.05 * f64::from(c.abs()));
        let of_ridge =
            computed(&[0.4], 0.1, &roof)[roof.iter().position(|cell| (cell.0, cell.1) == (0, 0)).unwrap()][0];
        assert!((of_ridge[0] + 2.0 * 0.05 * 4.0).abs() < 1e-12, "{of_ridge:?}");
        // The places along it are a third or so of cells beside it.
        assert!((of_ridge[1] + 2.0 * 0.05 * 2.0 / 5.0).abs() < 1e-12, "{of_ridge:?}");
    }

    #[test]
    fn law_yards_turned_by_a_quarter_bend_alike() {
        let height_m = |r: i32, c: i32| f64::from((r * 7 + c * 13 + r * c).rem_euclid(11)) * 0.0625;
        let yard = square(10, height_m);
        let turned = square(10, |r, c| height_m(-c, r));
        let value = |cells: &Heights, r: i32, c: i32| {
            computed(&[0.2, 0.4], 0.1, cells)[cells.iter().position(|cell| (cell.0, cell.1) == (r, c)).unwrap()].clone()
        };
        for (r, c) in [(0, 0), (3, -2), (-10, 9), (5, 5)] {
            let (here, there) = (value(&yard, r, c), value(&turned, c, -r));
            let off = here.iter().flatten().zip(there.iter().flatten()).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-12, "{here:?} {there:?}");
        }
    }

    #[test]
    fn extreme_lone_cells_ends_of_the_grid_and_huge_heights() {
        assert!(computed(&[0.2], 0.1, &[]).is_empty());
        assert_eq!(computed(&[0.2], 0.1, &[(-7, 3, 123.4)]), [[[0.0; 2]]]);
        let far = i32::MAX - 17;
        let ends = [(-far, -far, 1.0), (-far, far, 2.0), (0, 0, 3.0), (far, -far, 4.0), (far, far, 5.0)];
        assert!(computed(&[0.1, 10.0], 0.1, &ends).iter().flatten().all(|out| *out == [0.0; 2]));
        let high = square(6, |r, c| 1e6 + 0.125 * f64::from(r * c));
        let low = square(6, |r, c| 0.125 * f64::from(r * c));
        for (a, b) in computed(&[0.2], 0.1, &high).iter().flatten().zip(computed(&[0.2], 0.1, &low).iter().flatten()) {
            assert!((a[0] - b[0]).abs() < 1e-8 && (a[1] - b[1]).abs() < 1e-8);
        }
    }
}
