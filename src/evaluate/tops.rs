//! Missed tops of rocks -> can a rover reach them? The paper says that they are walled in.
//!
//! Source: Hewitt et al. 2017, "Outdoor tests", after table 1: most missed points lie on flat tops, "the rover will not attempt to
//! drive over this terrain as it is surrounded by untraversable points" (A61 in `docs/paper.md`). A missed top is a cell that holds
//! points of an obstacle's top and was called traversable. It is *enclosed* when no path of cells called traversable (8 neighbours,
//! cells with points only) leads from it to a cell that truly is traversable. It is *walled in* when, besides, no cell without points
//! touches that path: behind a rock there usually are such cells, in its shadow.

use serde::{Deserialize, Serialize};

use super::Cell;

/// Missed tops, and how many of them no rover can reach.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MissedTops {
    pub cells: u64,
    pub enclosed: u64,
    pub walled_in: u64,
}

impl MissedTops {
    /// Adds the missed tops of one scan; `called` says which cells were called untraversable.
    pub(crate) fn add_scan(&mut self, cells: &[Cell], called: impl Fn(usize) -> bool) {
        let missed_top = |k: usize| cells[k].is_top() && !called(k);
        if !(0..cells.len()).any(missed_top) {
            return;
        }
        let mut order: Vec<usize> = (0..cells.len()).collect();
        let place = |k: usize| (cells[k].index.row, cells[k].index.col);
        order.sort_by_key(|&k| place(k));
        let at =
            |row: i32, col: i32| order.binary_search_by_key(&(row, col), |&k| place(k)).ok().map(|found| order[found]);
        let mut seen = vec![false; cells.len()];
        for start in (0..cells.len()).filter(|&k| missed_top(k)) {
            if seen[start] {
                continue;
            }
            let region = flood(start, cells, &mut seen, &called, at);
            self.cells += region.tops;
            self.enclosed += if region.traversable { 0 } else { region.tops };
            self.walled_in += if region.traversable || region.open { 0 } else { region.tops };
        }
    }
}

/// A connected region of cells called traversable.
struct Region {
    tops: u64,
    /// A truly traversable cell is in it.
    traversable: bool,
    /// A cell without points touches it.
    open: bool,
}

fn flood(
    start: usize,
    cells: &[Cell],
    seen: &mut [bool],
    called: impl Fn(usize) -> bool,
    at: impl Fn(i32, i32) -> Option<usize>,
) -> Region {
    let mut region = Region { tops: 0, traversable: false, open: false };
    let mut waiting = vec![start];
    seen[start] = true;
    while let Some(k) = waiting.pop() {
        let cell = &cells[k];
        region.traversable |= !cell.untraversable();
        region.tops += u64::from(cell.is_top());
        for (rows, cols) in [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)] {
            match at(cell.index.row.saturating_add(rows), cell.index.col.saturating_add(cols)) {
                None => region.open = true,
                Some(next) if seen[next] || called(next) => {}
                Some(next) => {
                    seen[next] = true;
                    waiting.push(next);
                }
            }
        }
    }
    region
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `#` untraversable and called so, `t` a missed top, `.` ground, `!` ground called untraversable, blank: no points.
    fn count(map: &[&str]) -> MissedTops {
        let mut cells = Vec::new();
        let mut called = Vec::new();
        for (row, line) in map.iter().enumerate() {
            for (col, letter) in line.chars().enumerate().filter(|(_, letter)| *letter != ' ') {
                let top_points = i32::from(letter == 't');
                let untraversable = matches!(letter, '#' | 't');
                let mut cell = Cell::bare(row as i32, col as i32, untraversable);
                cell.truth.top_points = top_points;
                cells.push(cell);
                called.push(matches!(letter, '#' | '!'));
            }
        }
        let mut missed = MissedTops::default();
        missed.add_scan(&cells, |k| called[k]);
        missed
    }

    #[test]
    fn exact_a_ring_walls_a_top_in() {
        let missed = count(&[".....", ".###.", ".#t#.", ".###.", "....."]);
        assert_eq!(missed, MissedTops { cells: 1, enclosed: 1, walled_in: 1 });
    }

    #[test]
    fn exact_one_gap_at_a_corner_lets_a_rover_in() {
        let missed = count(&[".....", ".##..", ".#t#.", ".###.", "....."]);
        assert_eq!(missed, MissedTops { cells: 1, enclosed: 0, walled_in: 0 });
    }

    #[test]
    fn exact_a_shadow_leaves_a_top_enclosed_but_not_walled_in() {
        let missed = count(&["     ", ".#t# ", ".###.", "....."]);
        assert_eq!(missed, MissedTops { cells: 1, enclosed: 1, walled_in: 0 });
    }

    #[test]
    fn exact_neighbouring_tops_share_their_fate_and_false_alarms_fence_too() {
        assert_eq!(count(&["####", "#tt#", "#!!#", "...."]), MissedTops { cells: 2, enclosed: 2, walled_in: 2 });
        assert_eq!(count(&["####", "#tt#", "#!.#", "...."]), MissedTops { cells: 2, enclosed: 0, walled_in: 0 });
        assert_eq!(count(&["....", ".##."]), MissedTops::default());
    }
}
