//! The cells of a sweep and its columns of beams -> rows for cells that hold no point, and the `gap_` features of every row.
//!
//! In: [`Cells`] as the points made them, the last sweep's [`BeamColumns`]. Out: the same rows with the same values, among them, in the
//! order of (row, col), a row with `points` = 0 for each empty cell that lies within `around_m` of a long gap and that beams passed
//! over: its column holds a return before it and one behind it, and its centre lies within the cells' range. Frames and units as in
//! `cells`. What such a row says in the other features: `mean_height_m` is the height of the line from the return before the cell to the
//! lowest one behind it; variance, difference, count and intensities are 0; neighbours, curvature, squares and the local ground are those of
//! cells with points, as for any row. Own construction. Not modelled: earlier sweeps of a window; where they saw the cell, it has points.

use super::bin::Scratch;
use super::columns::{GAP_COLUMNS, neighbour_offsets};
use super::curvature::bend_at;
use super::gaps::BeamColumns;
use super::layout::Layout;
use super::local::nearest_rank;
use super::params::{LocalHeightParams, SurroundingsParams, UnseenParams};
use super::surroundings::Surroundings;
use super::{CellParams, CellRow, CellTruth, Cells};
use crate::geometry::{CellIndex, GridSpec};

/// Adds the rows and the columns. `layout`: of a row's features before the gaps.
pub(super) fn add(
    params: &CellParams,
    unseen: &UnseenParams,
    layout: &Layout,
    scratch: &Scratch,
    max_range_m: f64,
    cells: &mut Cells,
) {
    let beams = &scratch.columns;
    if cells.rows.is_empty() {
        return;
    }
    let grid = GridSpec { size_m: params.size_m };
    let width = layout.width;
    let found = unseen_cells(unseen, beams, &grid, max_range_m, &cells.rows);
    let offsets = neighbour_offsets(params.neighbours);
    let squares = params
        .surroundings
        .as_ref()
        .map(|of| (of, Surroundings::new(&scratch.squares, &cells.features, width, layout.plane_height())));
    let seen = SeenCells { rows: &cells.rows, features: &cells.features, layout, scratch, squares };
    let wide = width + GAP_COLUMNS.len();
    let mut rows = Vec::with_capacity(cells.rows.len() + found.len());
    let mut features = Vec::with_capacity(rows.capacity() * wide);
    let mut found = found.into_iter().peekable();
    let tell = |features: &mut Vec<f32>, index: CellIndex, height_m: f64| {
        let (x_m, y_m) = grid.centre_m(index);
        let gaps = beams.features(x_m, y_m, height_m, params.size_m, unseen.around_m);
        features.extend(gaps.map(|value| value as f32));
    };
    for (k, row) in cells.rows.iter().enumerate() {
        while let Some((index, height_m)) = found.next_if(|(index, _)| *index < row.index) {
            rows.push(seen.unseen_row(index, height_m, beams, &grid, params, &offsets, &mut features));
            tell(&mut features, index, height_m);
        }
        rows.push(row.clone());
        let own = &cells.features[k * width..][..width];
        features.extend_from_slice(own);
        tell(&mut features, row.index, f64::from(own[0]));
    }
    for (index, height_m) in found {
        rows.push(seen.unseen_row(index, height_m, beams, &grid, params, &offsets, &mut features));
        tell(&mut features, index, height_m);
    }
    (cells.rows, cells.features) = (rows, features);
}

/// The empty cells, sorted, with the height of the line over each.
fn unseen_cells(
    unseen: &UnseenParams,
    beams: &BeamColumns,
    grid: &GridSpec,
    max_range_m: f64,
    rows: &[CellRow],
) -> Vec<(CellIndex, f64)> {
    let mut near = Vec::new();
    let most_m = max_range_m + grid.size_m;
    beams.each_near_gap(unseen.around_m, 0.5 * grid.size_m, most_m, |x_m, y_m| {
        // Steps are short: a cell comes several times in a row.
        if let Some(index) = grid.cell(x_m, y_m).filter(|index| near.last() != Some(index)) {
            near.push(index);
        }
    });
    near.sort_unstable();
    near.dedup();
    let is_empty = |index: &CellIndex| rows.binary_search_by_key(index, |row| row.index).is_err();
    let passed_over = |index: CellIndex| {
        let (x_m, y_m) = grid.centre_m(index);
        let height_m = beams.chord_m(x_m, y_m).filter(|_| beams.range_m(x_m, y_m) <= max_range_m)?;
        Some((index, height_m))
    };
    near.into_iter().filter(is_empty).filter_map(passed_over).collect()
}

/// The cells that hold points.
struct SeenCells<'a> {
    rows: &'a [CellRow],
    features: &'a [f32],
    layout: &'a Layout,
    scratch: &'a Scratch,
    /// The squares around cells, where they are asked for.
    squares: Option<(&'a SurroundingsParams, Surroundings<'a>)>,
}

impl SeenCells<'_> {
    /// The row of an empty cell; its features but the gaps' are appended.
    #[expect(clippy::too_many_arguments, reason = "what a row is made of")]
    fn unseen_row(
        &self,
        index: CellIndex,
        height_m: f64,
        beams: &BeamColumns,
        grid: &GridSpec,
        params: &CellParams,
        offsets: &[super::Offset],
        features: &mut Vec<f32>,
    ) -> CellRow {
        let (x_m, y_m) = grid.centre_m(index);
        let layout = self.layout;
        let first = features.len();
        // Pose and sigmas are those of any row; a scan without a cell has no gap either.
        features.extend_from_slice(&self.features[..layout.width]);
        let own = &mut features[first..];
        (own[0], own[1], own[2], own[3]) = (height_m as f32, 0.0, 0.0, 0.0);
        let mut neighbour_mask = 0;
        for (k, offset) in offsets.iter().enumerate() {
            let there = CellIndex { row: index.row + offset.rows, col: index.col + offset.cols };
            own[Layout::NEIGHBOURS + k] = match self.find(there) {
                Some(at) => {
                    neighbour_mask |= 1 << k;
                    self.height_m(at)
                }
                None => height_m as f32,
            };
        }
        if let Some(local) = &params.local_height {
            own[layout.local] = (height_m - self.local_ground_m(local, index, grid, height_m)) as f32;
            if local.plane {
                let of_plane = self.scratch.planes.features(index, height_m).map(|value| value as f32);
                own[layout.plane_height()..][..2].copy_from_slice(&of_plane);
            }
        }
        let radii_m = params.curvature.iter().flat_map(|curvature| &curvature.radii_m);
        for (own, &radius_m) in own[layout.curvature..layout.squares].chunks_exact_mut(2).zip(radii_m) {
            let height_at = |index| self.find(index).map(|at| f64::from(self.height_m(at)));
            own.copy_from_slice(&bend_at(radius_m, grid.size_m, index, height_m, height_at).map(|value| value as f32));
        }
        if let Some((of_squares, squares)) = &self.squares {
            let values = squares.of(of_squares, grid.size_m, index, own[layout.plane_height()]);
            own[layout.squares..layout.beams].iter_mut().zip(values).for_each(|(own, value)| *own = value);
        }
        if let Some(of_beams) = &params.beams {
            let Scratch { squares, beams, passages, .. } = self.scratch;
            // A cell without points has no highest one: the height of the beam that passed over it stands in for it.
            let plane_m = height_m - f64::from(own[layout.plane_height()]);
            let passage = beams.passage((x_m, y_m).into(), grid.size_m, plane_m, height_m);
            let values = passages.of(of_beams, grid.size_m, squares, index, &passage);
            own[layout.beams..layout.sigmas].iter_mut().zip(values).for_each(|(own, value)| *own = value);
        }
        if layout.intensity {
            own[layout.width - 2..].fill(0.0);
        }
        CellRow {
            index,
            label: None,
            points: 0,
            range_m: beams.range_m(x_m, y_m) as f32,
            neighbour_mask,
            truth: CellTruth::default(),
        }
    }

    fn find(&self, index: CellIndex) -> Option<usize> {
        self.rows.binary_search_by_key(&index, |row| row.index).ok()
    }

    fn height_m(&self, at: usize) -> f32 {
        self.features[at * self.layout.width]
    }

    /// The percentile of the mean heights around, the cell's own among them.
    fn local_ground_m(&self, local: &LocalHeightParams, index: CellIndex, grid: &GridSpec, height_m: f64) -> f64 {
        let reach = super::local::reach_cells(local.radius_m, grid.size_m);
        let mut heights_m = vec![height_m];
        let rows = reach.floor() as i32;
        for away in -rows..=rows {
            let half = (reach * reach - f64::from(away * away)).sqrt().floor() as i32;
            let row = index.row + away;
            let from = self.rows.partition_point(|seen| seen.index < CellIndex { row, col: index.col - half });
            let inside =
                self.rows[from..].iter().take_while(|seen| seen.index <= CellIndex { row, col: index.col + half });
            heights_m.extend((from..).zip(inside).map(|(at, _)| f64::from(self.height_m(at))));
        }
        let nth = nearest_rank(local.percentile, heights_m.len() as u32) as usize;
        *heights_m.select_nth_unstable_by(nth, f64::total_cmp).1
    }
}
