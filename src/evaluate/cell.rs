//! This module holds a cell as reports see it: its label, its points, and what is known of the truth.
//!
//! Cells of a corpus or of a scan from elsewhere go in (metres). How many of a cell's points are untraversable by their own truth comes out, and how
//! many of those lie on an obstacle's flat top.

use crate::cells::{CellTruth, Label};
use crate::geometry::CellIndex;

/// A cell with a known label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    pub index: CellIndex,
    pub label: Label,
    /// Points in the cell.
    pub points: i32,
    pub range_m: f32,
    pub height_difference_m: f32,
    /// What is known of it: points of obstacles and on tops (0 where nobody knows), and the class.
    pub truth: CellTruth,
}

impl Cell {
    /// Untraversable points and those of them on tops, by their own truth. A rule other than the corpus's may call a cell
    /// untraversable for what the corpus did not count: then all its points are.
    pub(super) fn own_truth(&self) -> (u64, u64) {
        let points = self.points.max(0);
        let CellTruth { obstacle_points, top_points, .. } = self.truth;
        let of_obstacle = if obstacle_points > 0 { obstacle_points.min(points) } else { points };
        if !self.untraversable() {
            return (0, 0);
        }
        (of_obstacle as u64, top_points.clamp(0, of_obstacle) as u64)
    }

    pub(super) fn untraversable(&self) -> bool {
        self.label.is_untraversable()
    }

    /// Whether it holds points of an obstacle's flat top.
    pub(super) fn is_top(&self) -> bool {
        self.untraversable() && self.truth.top_points > 0
    }

    /// A cell of which nothing else is known.
    #[cfg(test)]
    pub(super) fn bare(row: i32, col: i32, untraversable: bool) -> Cell {
        Cell {
            index: CellIndex { row, col },
            label: Label::untraversable_if(untraversable),
            points: 0,
            range_m: 0.0,
            height_difference_m: 0.0,
            truth: CellTruth::default(),
        }
    }
}
