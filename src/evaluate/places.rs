//! Judged cells by where they lie from the rover -> squares of its surroundings with their counts: where wrong cells gather.
//!
//! In: cells of a scan, whether each is called untraversable, and where the rover is believed to stand in their map. Out: squares, seen from
//! above, in the rover's level frame: metres ahead and to the left. Source: Hewitt et al. 2017, figure 13: density beside wrong cells. Deviation:
//! the paper shows one scan; these are all scans of a split upon each other, so that what depends on the place alone stands out.
//! Squares are as fine as a picture of some forty of them across shows, or up to 16 across where only coarser ones hold enough untraversable cells for
//! a rate of them; no cell counts that lies farther than 64 m off.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::confusion::Confusion;
use crate::geometry::DVec2;

/// Side of a square as cells are gathered.
const FINEST_M: f64 = 0.25;
const FARTHEST_M: f64 = 64.0;
/// Squares from the rover to the farthest cell, at most; and at least, where coarser ones have rates that finer ones lack.
const MOST_SQUARES: f64 = 20.0;
const LEAST_SQUARES: f64 = 8.0;
/// Share of the untraversable cells in squares that have a rate of them, from which on squares are fine enough.
const ENOUGH_RATED: f64 = 0.5;
/// A square of fewer cells of a class has no rate.
pub(super) const FEWEST_CELLS: u64 = 20;

/// A square by its number ahead and to the left; the rover stands in the corner of four.
type Index = [i32; 2];

/// Counts of the cells of each square, and their points.
type Squares = BTreeMap<Index, (Confusion, u64)>;

/// Gathers cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    squares: Squares,
}

/// What is known of the cells by place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlacesReport {
    /// Side of the squares, metres.
    pub square_m: f64,
    /// Those that hold a cell, from the rear to the front and from the right to the left.
    pub squares: Vec<Square>,
}

/// The cells whose centres lie in one square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    /// Its corner nearest to behind and to the right, metres.
    pub ahead_m: f64,
    pub left_m: f64,
    pub cells: Confusion,
    /// Points in all its cells.
    pub points: u64,
}

impl Places {
    /// Adds a cell at so many metres ahead and to the left.
    pub(super) fn add(&mut self, place_m: DVec2, points: i32, untraversable: bool, called: bool) {
        if place_m.x.abs() < FARTHEST_M && place_m.y.abs() < FARTHEST_M {
            let square = (place_m / FINEST_M).floor();
            let (cells, points_so_far) = self.squares.entry([square.x as i32, square.y as i32]).or_default();
            cells.add(untraversable, called, 1);
            *points_so_far += points.max(0) as u64;
        }
    }

    /// `None` where no cell has a place.
    pub(super) fn report(&self) -> Option<PlacesReport> {
        let farthest = self.squares.keys().flatten().map(|&k| if k < 0 { -k } else { k + 1 }).max()?;
        let across = |merged: i32| f64::from(farthest) / f64::from(merged);
        let mut finest = 1;
        while across(finest) > MOST_SQUARES {
            finest *= 2;
        }
        let coarser = std::iter::successors(Some(finest), |merged| Some(2 * merged));
        let mut best: Option<(i32, f64, Squares)> = None;
        for merged in coarser.take_while(|merged| *merged == finest || across(*merged) >= LEAST_SQUARES) {
            let squares = self.merged(merged);
            let rated = rated_share(&squares);
            if best.as_ref().is_none_or(|best| rated > best.1) {
                best = Some((merged, rated, squares));
            }
            if rated >= ENOUGH_RATED {
                break;
            }
        }
        let (merged, _, squares) = best?;
        let square_m = f64::from(merged) * FINEST_M;
        let square = |(&[ahead, left], &(cells, points)): (&Index, &(Confusion, u64))| Square {
            ahead_m: f64::from(ahead) * square_m,
            left_m: f64::from(left) * square_m,
            cells,
            points,
        };
        Some(PlacesReport { square_m, squares: squares.iter().map(square).collect() })
    }

    /// In squares so many times as wide.
    fn merged(&self, times: i32) -> Squares {
        let mut squares = Squares::new();
        for (square, &(cells, points)) in &self.squares {
            let (sum, points_so_far) = squares.entry(square.map(|k| k.div_euclid(times))).or_default();
            *sum += cells;
            *points_so_far += points;
        }
        squares
    }
}

/// The share of the untraversable cells that lie in squares which have a rate of them; all of none.
fn rated_share(squares: &Squares) -> f64 {
    let cells = || squares.values().map(|(cells, _)| cells.untraversable());
    let with_rate: u64 = cells().filter(|cells| *cells >= FEWEST_CELLS).sum();
    match cells().sum::<u64>() {
        0 => 1.0,
        all => with_rate as f64 / all as f64,
    }
}

impl PlacesReport {
    /// A line a square, with a head.
    pub(super) fn csv(&self) -> String {
        let mut csv = "ahead_m,left_m,square_m,points,true_traversable,false_untraversable,missed_untraversable,true_untraversable\n".to_string();
        for Square { ahead_m, left_m, cells, points } in &self.squares {
            let Confusion { true_traversable, false_untraversable, missed_untraversable, true_untraversable } = cells;
            let place = format!("{ahead_m},{left_m},{},{points}", self.square_m);
            let counts =
                format!("{true_traversable},{false_untraversable},{missed_untraversable},{true_untraversable}");
            writeln!(csv, "{place},{counts}").expect("text in memory takes all that is written");
        }
        csv
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_cells_are_counted_in_the_squares_that_hold_their_centres() {
        let mut places = Places::default();
        for (ahead_m, left_m, untraversable, called) in
            [(0.1, 0.1, false, false), (0.2, 0.0, false, true), (0.2, -0.01, true, false), (-0.3, 3.9, true, true)]
        {
            places.add(DVec2::new(ahead_m, left_m), 3, untraversable, called);
        }
        places.add(DVec2::new(f64::NAN, 0.0), 3, true, true);
        places.add(DVec2::new(64.0, 0.0), 3, true, true);
        let report = places.report().unwrap();
        let seen: Vec<_> = report.squares.iter().map(|s| (s.ahead_m, s.left_m, s.cells.total(), s.points)).collect();
        assert_eq!((report.square_m, seen), (0.25, vec![(-0.5, 3.75, 1, 3), (0.0, -0.25, 1, 3), (0.0, 0.0, 2, 6)]));
        assert_eq!(report.squares[2].cells.false_untraversable, 1);
        let csv = report.csv();
        assert!(csv.lines().nth(1) == Some("-0.5,3.75,0.25,3,0,0,0,1") && csv.lines().count() == 4, "{csv}");
    }

    #[test]
    fn law_squares_grow_until_some_forty_stand_across_and_lose_no_cell() {
        for (farthest_m, square_m) in [(0.1, 0.25), (4.9, 0.25), (5.1, 0.5), (-10.1, 1.0), (30.0, 2.0), (63.9, 4.0)] {
            let mut places = Places::default();
            (0..50).for_each(|k| places.add(DVec2::new(farthest_m * f64::from(k) / 49.0, -0.1), 1, false, false));
            let report = places.report().unwrap();
            assert_eq!(report.square_m, square_m, "{farthest_m}");
            assert_eq!(report.squares.iter().map(|square| square.cells.total()).sum::<u64>(), 50);
            assert!(report.squares.iter().all(|square| (square.ahead_m / square_m).fract() == 0.0));
        }
        assert_eq!(Places::default().report(), None);
    }

    #[test]
    fn law_squares_are_as_wide_as_most_untraversable_cells_need_for_a_rate() {
        for (a_square, square_m) in [(40, 0.25), (10, 0.5), (1, 0.25)] {
            let mut places = Places::default();
            for k in 0..19 * a_square {
                places.add(DVec2::new(0.25 * f64::from(k % 19) + 0.1, 0.1), 1, true, true);
            }
            assert_eq!(places.report().unwrap().square_m, square_m, "{a_square}");
        }
    }
}
