//! Points -> those near a place.
//!
//! In: places, metres. Out: an index over square columns of [`COLUMN_M`], each with its points one after the other, and the nearest point
//! within a reach, or all within a radius. The columns span the box around the points; nothing is asked of their order.

use std::ops::{Range, RangeInclusive};

use crate::geometry::DVec3;

/// Side of a column, metres.
const COLUMN_M: f64 = 0.06;

/// Points by column.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    west_m: f64,
    south_m: f64,
    width: usize,
    rows: usize,
    /// Where each column's points begin, and where the last one's end.
    starts: Vec<u32>,
    places_m: Vec<DVec3>,
}

impl Columns {
    /// Sorts finite places into columns. Out with the index: for each of its points, which of the given it was.
    pub(super) fn of(given_m: &[DVec3]) -> (Columns, Vec<u32>) {
        let (mut low_m, mut high_m) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &place_m in given_m {
            (low_m, high_m) = (low_m.min(place_m), high_m.max(place_m));
        }
        if given_m.is_empty() {
            return (Columns::default(), Vec::new());
        }
        let across = |low_m: f64, high_m: f64| ((high_m - low_m) / COLUMN_M) as usize + 1;
        let (width, rows) = (across(low_m.x, high_m.x), across(low_m.y, high_m.y));
        let mut columns =
            Columns { west_m: low_m.x, south_m: low_m.y, width, rows, starts: Vec::new(), places_m: Vec::new() };
        let column_of: Vec<usize> = given_m
            .iter()
            .map(|place_m| {
                let col = ((place_m.x - low_m.x) / COLUMN_M) as usize;
                let row = ((place_m.y - low_m.y) / COLUMN_M) as usize;
                row * width + col
            })
            .collect();
        columns.starts = vec![0; width * rows + 1];
        for &column in &column_of {
            columns.starts[column + 1] += 1;
        }
        for column in 0..width * rows {
            columns.starts[column + 1] += columns.starts[column];
        }
        let (mut next, mut order) = (columns.starts.clone(), vec![0; given_m.len()]);
        columns.places_m = vec![DVec3::ZERO; given_m.len()];
        for ((&place_m, &column), given) in given_m.iter().zip(&column_of).zip(0..) {
            let at = next[column] as usize;
            next[column] += 1;
            (columns.places_m[at], order[at]) = (place_m, given);
        }
        (columns, order)
    }

    /// The points, column by column.
    pub(super) fn places_m(&self) -> &[DVec3] {
        &self.places_m
    }

    /// The point nearest to a place, and its square distance, if that is less than `reach_m`.
    #[inline(always)]
    pub(super) fn nearest(&self, place_m: DVec3, reach_m: f64) -> Option<(usize, f64)> {
        let (col, row) = self.column_of(place_m)?;
        let (mut best, mut found) = (reach_m * reach_m, None);
        let mut look = |slots: Range<usize>, best: &mut f64| {
            for at in slots {
                let apart = self.places_m[at].distance_squared(place_m);
                if apart < *best {
                    (*best, found) = (apart, Some(at));
                }
            }
        };
        // Its own column first: a close point there shrinks the radius that is searched.
        look(self.slots(row, col, col), &mut best);
        for row in self.rows_within(place_m, best) {
            look(self.slots_within(row, place_m, best), &mut best);
        }
        found.map(|at| (at, best))
    }

    /// Hands over every point that is at most `radius_m` from a place.
    #[inline(always)]
    pub(super) fn each_within(&self, place_m: DVec3, radius_m: f64, mut take: impl FnMut(DVec3)) {
        if self.column_of(place_m).is_none() {
            return;
        }
        let radius_m2 = radius_m * radius_m;
        for row in self.rows_within(place_m, radius_m2) {
            for at in self.slots_within(row, place_m, radius_m2) {
                if self.places_m[at].distance_squared(place_m) <= radius_m2 {
                    take(self.places_m[at]);
                }
            }
        }
    }

    /// The rows that a circle around a place touches.
    #[inline(always)]
    fn rows_within(&self, place_m: DVec3, radius_m2: f64) -> RangeInclusive<i64> {
        let (y, reach) = ((place_m.y - self.south_m) / COLUMN_M, radius_m2.sqrt() / COLUMN_M);
        (y - reach).floor() as i64..=(y + reach).floor() as i64
    }

    /// The slots of the points in the columns of a row that the circle touches.
    #[inline(always)]
    fn slots_within(&self, row: i64, place_m: DVec3, radius_m2: f64) -> Range<usize> {
        let (x, y) = ((place_m.x - self.west_m) / COLUMN_M, (place_m.y - self.south_m) / COLUMN_M);
        let aside = (row as f64 - y).max(y - row as f64 - 1.0).max(0.0) * COLUMN_M;
        let rest = radius_m2 - aside * aside;
        if rest > 0.0 {
            let along = rest.sqrt() / COLUMN_M;
            self.slots(row, (x - along).floor() as i64, (x + along).floor() as i64)
        } else {
            0..0
        }
    }

    /// The column of a place, which may lie beside the box; `None` for what is no number or far from everything.
    #[inline(always)]
    fn column_of(&self, place_m: DVec3) -> Option<(i64, i64)> {
        let at = |t_m: f64, from_m: f64| {
            let column = ((t_m - from_m) / COLUMN_M).floor();
            (column.abs() < 1e6).then_some(column as i64)
        };
        Some((at(place_m.x, self.west_m)?, at(place_m.y, self.south_m)?))
    }

    /// The slots of the points in columns `from` to `to` of a row; none where these lie beside the box.
    #[inline(always)]
    fn slots(&self, row: i64, from: i64, to: i64) -> Range<usize> {
        let (first, last) = (from.max(0), to.min(self.width as i64 - 1));
        if row < 0 || row >= self.rows as i64 || first > last {
            return 0..0;
        }
        let row = row as usize * self.width;
        self.starts[row + first as usize] as usize..self.starts[row + last as usize + 1] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;

    fn scattered(count: usize) -> Vec<DVec3> {
        let wave = |k: usize, by: f64| 3.0 * math::sin(by * (k * k) as f64);
        (0..count).map(|k| DVec3::new(wave(k, 1.1), wave(k, 2.3), 0.1 * wave(k, 3.7))).collect()
    }

    #[test]
    fn equal_nearest_and_a_search_of_all() {
        let places_m = scattered(500);
        let (columns, order) = Columns::of(&places_m);
        for asked_m in scattered(900).iter().map(|p| *p * 1.3 + DVec3::new(0.01, -0.02, 0.03)) {
            for reach_m in [0.05, 0.2, 0.7] {
                let want = (0..places_m.len())
                    .map(|k| (places_m[k].distance_squared(asked_m), k))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .filter(|(apart, _)| *apart < reach_m * reach_m);
                let got = columns.nearest(asked_m, reach_m).map(|(at, apart)| (apart, order[at] as usize));
                assert_eq!(got, want, "{asked_m} within {reach_m}");
            }
        }
    }

    #[test]
    fn equal_those_within_a_radius_and_a_search_of_all() {
        let places_m = scattered(500);
        let (columns, _) = Columns::of(&places_m);
        for asked_m in scattered(200) {
            let mut count = 0;
            columns.each_within(asked_m, 0.3, |_| count += 1);
            assert_eq!(count, places_m.iter().filter(|p| p.distance_squared(asked_m) <= 0.3 * 0.3).count());
        }
    }

    #[test]
    fn extreme_no_points_and_places_that_are_no_numbers() {
        let (nothing, order) = Columns::of(&[]);
        assert!(order.is_empty() && nothing.nearest(DVec3::ZERO, 1.0).is_none());
        let (one, _) = Columns::of(&[DVec3::ZERO]);
        assert!(one.nearest(DVec3::NAN, 1.0).is_none());
        assert!(one.nearest(DVec3::splat(1e300), 1.0).is_none());
        assert_eq!(one.nearest(DVec3::new(0.3, 0.4, 0.0), 0.6).map(|(at, _)| at), Some(0));
    }
}
