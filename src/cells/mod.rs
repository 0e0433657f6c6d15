//! A sweep and the estimated pose -> cells: features and labels.
//!
//! In: sweeps of a window with their estimates, the mount, and (for labels and `truth_` columns only) the scene.
//! Out: [`Cells`], sorted by (row, col), frame `map`. Source: Hewitt et al. 2017, "Cell inputs", eqs 3 and 4.

pub mod params;

pub use params::CellParams;

use crate::geometry::CellIndex;

/// The cells of one kept sweep.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    pub rows: Vec<CellRow>,
    /// Row-major: `features[r * n..][..n]` are the n features of row r, in the order of `feature_columns`.
    pub features: Vec<f32>,
    /// Every point of the window is in one of these counts: points in = points binned + points dropped.
    pub points_in: u64,
    pub points_binned: u64,
    pub dropped_beyond_range: u64,
    pub dropped_off_grid: u64,
}

/// A feature column: its name, unit and meaning stand here once.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureColumn {
    pub name: String,
    pub unit: &'static str,
    pub description: String,
}

/// One non-empty cell.
#[derive(Clone, Debug)]
pub struct CellRow {
    pub index: CellIndex,
    /// 0 traversable, 1 untraversable, `None` unknown.
    pub label: Option<i8>,
    pub points: i32,
    /// Mean horizontal distance of the points from the sensor, metres.
    pub range_m: f32,
    /// Bit k set: neighbour k (order sw, s, se, w, e, nw, n, ne) is not empty.
    pub neighbour_mask: i32,
    pub truth: CellTruth,
}

/// What the label is made of: another rover's rule can be applied without a rebuild.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellTruth {
    pub obstacle_points: i32,
    pub top_points: i32,
    /// Class of the tallest object among the points (0 ground).
    pub class: i8,
    /// Its id, -1 for ground.
    pub object: i32,
    /// Its height above the ground, 0 for ground.
    pub protrusion_m: f32,
    /// Steepest true ground slope under the cell's ground points.
    pub slope_rad: f32,
}
