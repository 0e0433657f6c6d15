//! Scenes, as they were run or as their tables tell them -> what they hold, counted by family.
//!
//! Ranges in metres, in bins of one metre.

use super::{CellGrid, FEW_POINTS, SPARSE_SHARE, View, Views, share};
use crate::cells::Label;
use crate::episode::SceneOutput;

/// Range bins; the last holds all that is farther.
const RANGE_BINS: usize = 64;

/// What the scenes of one family hold that were looked at.
#[derive(Clone, Debug, Default)]
pub(crate) struct Content {
    pub family: String,
    /// Whether its scenes are in the test split alone.
    pub is_held_out: bool,
    /// Its scenes in the whole corpus's test split, counted up to `LEAST_TEST_SCENES` at least.
    pub test_scenes: u64,
    pub scenes: u64,
    pub failed: u64,
    /// Why the first of the failed ones did.
    pub first_failure: Option<String>,
    pub cut_short: u64,
    pub returns: u64,
    /// Returns beyond `cells.max_range_m`.
    pub returns_unread: u64,
    /// Cells with a label, of them untraversable ones.
    pub labelled: u64,
    pub untraversable: u64,
    /// What its scans show of obstacles.
    pub views: Views,
    /// How its cells lie; `None` where that is not known.
    pub grid: Option<CellGrid>,
    /// Cells by range, of them those with fewer than `FEW_POINTS`.
    cells_at: Vec<u64>,
    sparse_at: Vec<u64>,
}

impl Content {
    /// Of a family of which nothing was looked at yet.
    pub(crate) fn of(family: &str, is_held_out: bool, test_scenes: u64) -> Content {
        Content { family: family.to_owned(), is_held_out, test_scenes, ..Content::default() }
    }

    /// Where it is known how its cells lie, so that bearings can be told.
    pub(crate) fn with_grid(self, grid: Option<CellGrid>) -> Content {
        Content { grid, ..self }
    }

    /// Adds a scene that was run.
    pub(crate) fn add(&mut self, output: &SceneOutput) {
        self.scenes += 1;
        if let Some(error) = &output.error {
            self.failed += 1;
            self.first_failure.get_or_insert_with(|| error.clone());
            return;
        }
        self.cut_short += u64::from(output.counts.cut_short);
        for scan in &output.scans {
            let cells = &scan.cells;
            let mut view = View::default();
            self.returns += cells.points_in;
            self.returns_unread += cells.dropped_beyond_range;
            for row in &cells.rows {
                self.add_cell(row.points, row.range_m, row.label);
                if row.points > 0 && row.truth.obstacle_points > 0 {
                    view.add(row.index, row.range_m, row.truth.object);
                }
            }
            let pose = output.poses.iter().find(|pose| pose.scan_id == Some(scan.scan_id));
            self.views.add(&view, pose.map(|pose| &pose.estimate.pose).zip(self.grid));
        }
    }

    /// Adds a cell by its number of points, its range in metres and its label.
    pub(crate) fn add_cell(&mut self, points: i32, range_m: f32, label: Option<Label>) {
        self.cells_at.resize(RANGE_BINS, 0);
        self.sparse_at.resize(RANGE_BINS, 0);
        let bin = (range_m as usize).min(RANGE_BINS - 1);
        self.cells_at[bin] += 1;
        self.sparse_at[bin] += u64::from(points < FEW_POINTS);
        self.labelled += u64::from(label.is_some());
        self.untraversable += u64::from(label == Some(Label::Untraversable));
    }

    /// Scenes that did not fail.
    pub(crate) fn driven(&self) -> u64 {
        self.scenes - self.failed
    }

    pub(super) fn cells(&self) -> u64 {
        self.cells_at.iter().sum()
    }

    /// Share of the cells with 1 or 2 points.
    pub(super) fn sparse_share(&self) -> f64 {
        share(self.sparse_at.iter().sum(), self.cells())
    }

    /// The whole metres of range up to which fewer than `SPARSE_SHARE` of the cells are sparse; 0 where they are from the first on.
    pub(super) fn dense_range_m(&self) -> usize {
        let (mut cells, mut sparse, mut dense_m) = (0, 0, 0);
        for (k, (at, few)) in self.cells_at.iter().zip(&self.sparse_at).enumerate() {
            (cells, sparse) = (cells + at, sparse + few);
            if cells > 0 && share(sparse, cells) < SPARSE_SHARE {
                dense_m = k + 1;
            }
        }
        dense_m
    }

    /// The range, to the metre, that all but one in a thousand of the cells keep.
    pub(super) fn reach_m(&self) -> usize {
        let (cells, mut within) = (self.cells(), 0);
        let is_reached = |at: &u64| {
            within += at;
            within * 1000 >= cells * 999
        };
        self.cells_at.iter().position(is_reached).map_or(0, |bin| bin + 1)
    }

    pub(super) fn share_beyond(&self, range_m: usize) -> f64 {
        share(self.cells_at.iter().skip(range_m).sum(), self.cells())
    }
}
