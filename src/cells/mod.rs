//! A sweep and the estimated pose -> cells: features and labels.
//!
//! In: sweeps of a window with their estimates, the mount, and (for labels and `truth_` columns only) the scene.
//! Out: [`Cells`], sorted by (row, col), frame `map`. Source: Hewitt et al. 2017, "Neural network input types", eqs 3 and 4.
//!
//! ```
//! use marsyard::cells::{CellParams, Scratch, WindowCloud, bin_clouds, feature_columns};
//! use marsyard::geometry::{DVec3, Pose, Transform};
//! use marsyard::slam;
//!
//! // Three points in one cell of 10 cm, and one in another.
//! let points_m = [(0.51, 0.02, 0.1), (0.55, 0.05, 0.2), (0.59, 0.08, 0.6), (1.25, 0.05, 0.0)];
//! let points_m = points_m.map(|(x, y, z)| DVec3::new(x, y, z));
//! let cloud = WindowCloud {
//!     points_m: &points_m,
//!     in_map: true,
//!     intensity: None,
//!     obstacle: None,
//!     estimate: &slam::truth(&Pose::default()),
//!     map_from_sensor: Transform::IDENTITY,
//! };
//! let params = CellParams::default();
//! let (cells, _) = bin_clouds(&params, &[cloud], 10.0, &mut Scratch::default());
//! let counts: Vec<i32> = cells.rows.iter().map(|row| row.points).collect();
//! assert_eq!((counts, cells.points_in, cells.points_binned), (vec![3, 1], 4, 4));
//! // Eqs 3 and 4: mean and population variance of the heights 0.1, 0.2 and 0.6.
//! let columns = feature_columns(&params, false);
//! let value = |name: &str| cells.features[columns.iter().position(|column| column.name == name).expect("a column")];
//! assert!((value("mean_height_m") - 0.3).abs() < 1e-6);
//! assert!((value("height_variance_m2") - (0.04 + 0.01 + 0.09) / 3.0).abs() < 1e-6);
//! assert!((value("height_difference_m") - 0.5).abs() < 1e-6);
//! ```

mod around;
mod assign;
mod beams;
mod bin;
mod columns;
mod crossing;
mod curvature;
mod extent;
mod fall;
#[cfg(test)]
mod fixtures;
pub(crate) mod frame;
mod gaps;
mod group;
mod label;
mod labels;
mod layout;
pub mod level;
mod local;
mod overhang;
pub mod params;
mod place;
mod plane;
mod points;
mod rule;
mod sectors;
mod slope;
mod squares;
mod summary;
mod surroundings;
#[cfg(test)]
mod tests;
mod unseen;

pub use assign::{CellAssigner, MapPoint, Unplaced};
pub use bin::{Scratch, WindowCloud, WindowScan, bin, bin_clouds};
pub(crate) use columns::loss_columns;
pub use columns::{
    DROP, HEIGHT_DIFFERENCE, HEIGHT_VARIANCE, LOCAL_HEIGHT, LossColumn, MEAN_HEIGHT, Offset, PIT, PLANE_HEIGHT,
    PLANE_SLOPE, TruthColumn, feature_columns, is_beams, is_curvature, is_gap, is_neighbour, is_surroundings,
    neighbour_offsets, truth_columns,
};
pub use crossing::params::RoverRule;
pub(crate) use crossing::{
    Asked as CrossingAsked, Scratch as CrossingScratch, judge as judge_crossing,
    judge_of_plane as judge_crossing_of_plane,
};
pub use crossing::{Crossing, Limit, PoseTruth, PoseWorst};
pub use frame::ScanPose;
pub use label::Label;
pub use labels::obstacles;
pub(crate) use overhang::Overhangs;
pub use params::{CellFrame, CellParams};
pub use rule::{LabelRule, Obstacle, Unanswerable};

use crate::geometry::CellIndex;
use crate::scene::Class;
use crate::sweep::{Returns, Status};

/// The cells of one kept sweep.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    pub rows: Vec<CellRow>,
    /// Row-major: `features[r * n..][..n]` are the n features of row r, in the order of `feature_columns`.
    pub features: Vec<f32>,
    /// Every point of the window is in one of these counts: points in = points binned + points dropped + those left out.
    pub points_in: u64,
    pub points_binned: u64,
    pub dropped_beyond_range: u64,
    pub dropped_off_grid: u64,
    /// All points of a sweep in which no plane was found to level it by (`cells.frame: fitted_plane`).
    pub without_ground: u64,
    /// Points that hang over free height (`cells.overhang`); those beyond range or off the grid among them.
    pub overhanging: u64,
}

/// A feature column: its name, unit and meaning stand here once.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureColumn {
    pub name: String,
    pub unit: &'static str,
    pub description: String,
}

impl Cells {
    /// Of a sweep that cannot be levelled: none, and all its points counted.
    pub(crate) fn without_ground(returns: &Returns) -> Cells {
        let hits = returns.status.iter().filter(|&&status| status == Status::Hit).count() as u64;
        Cells { points_in: hits, without_ground: hits, ..Cells::default() }
    }

    /// Counts the marked points of a sweep or cloud: they are in no cell.
    fn leave_out_hanging(&mut self, hanging: &[bool]) {
        let count = hanging.iter().filter(|&&hangs| hangs).count() as u64;
        self.points_in += count;
        self.overhanging += count;
    }

    /// Feeds every bit of the cells, in order, to a stage hash.
    pub fn hash_into(&self, hasher: &mut blake3::Hasher) {
        for count in [self.points_in, self.points_binned, self.dropped_beyond_range, self.dropped_off_grid] {
            hasher.update(&count.to_le_bytes());
        }
        // Only where a config leaves points out are there any.
        for count in [self.without_ground, self.overhanging].into_iter().filter(|&count| count > 0) {
            hasher.update(&count.to_le_bytes());
        }
        hasher.update(&(self.rows.len() as u64).to_le_bytes());
        for row in &self.rows {
            let truth = &row.truth;
            // No label is a value of its own.
            let label = i32::from(row.label.map_or(i8::MIN, Label::number));
            let class = i32::from(Class::number_or_none(truth.class));
            let whole = [row.index.row, row.index.col, label, row.points, row.neighbour_mask];
            for value in whole.into_iter().chain([truth.obstacle_points, truth.top_points, class, truth.object]) {
                hasher.update(&value.to_le_bytes());
            }
            for value in [row.range_m, truth.protrusion_m, truth.slope_rad] {
                hasher.update(&value.to_bits().to_le_bytes());
            }
            if let Some(crossing) = truth.crossing {
                hasher.update(&crossing.margin_m.to_bits().to_le_bytes());
                hasher.update(&crossing.limit.number().to_le_bytes());
            }
            if let Some(PoseTruth { headings, cost, worst }) = truth.pose {
                let worst = worst.map_or([f32::NAN; 2], |worst| [worst.tilt_rad, worst.clearance_m]);
                hasher.update(&[headings]);
                for value in [cost, worst[0], worst[1]] {
                    hasher.update(&value.to_bits().to_le_bytes());
                }
            }
        }
        // Only where a config asks for drops is there one.
        for row in self.rows.iter().filter(|row| row.truth.drop_m != 0.0) {
            hasher.update(&row.truth.drop_m.to_bits().to_le_bytes());
            hasher.update(&row.truth.pit_m.to_bits().to_le_bytes());
        }
        for value in &self.features {
            hasher.update(&value.to_bits().to_le_bytes());
        }
    }
}

/// One cell: of those that hold points, and, where `cells.unseen` asks for them, of those that beams passed over.
#[derive(Clone, Debug, PartialEq)]
pub struct CellRow {
    pub index: CellIndex,
    /// `None`: unknown.
    pub label: Option<Label>,
    pub points: i32,
    /// Mean horizontal distance of the points from the sensor, metres; of a cell without points that of its centre.
    pub range_m: f32,
    /// Bit k set: neighbour k (order of the columns: sw, s, se, w, e, nw, n, ne) is not empty.
    pub neighbour_mask: i32,
    pub truth: CellTruth,
}

/// What the label is made of: another rover's rule can be applied without a rebuild.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellTruth {
    /// Points of what the config's rule calls an obstacle. Of a cell without points: as many as the rule asks for where an obstacle
    /// stands at its centre, else 0; class, object, protrusion and slope are then those at the centre.
    pub obstacle_points: i32,
    /// Those of them that lie on a top.
    pub top_points: i32,
    /// Class of the object that made the label, of several the tallest; where none did, of the tallest among the points; ground where they
    /// are of ground alone, `None` where nobody knows.
    pub class: Option<Class>,
    /// Its id (the smallest of equals), -1 for ground alone.
    pub object: i32,
    /// Its height above the ground, 0 for patches and ground.
    pub protrusion_m: f32,
    /// Steepest true ground slope under the cell's ground points.
    pub slope_rad: f32,
    /// How a rover gets over the cell; `None` where no rover was asked.
    pub crossing: Option<Crossing>,
    /// How a rover stands in the cell's middle; `None` where none was asked.
    pub pose: Option<PoseTruth>,
    /// How far the true ground falls at the cell's centre, or how deep that lies; 0 where the config does not ask for it.
    pub drop_m: f32,
    /// How deep it lies between walls on two sides: the part of `drop_m` that tells interiors from lips.
    pub pit_m: f32,
}

/// Nothing is known: no points of an obstacle, no class, no object, flat.
impl Default for CellTruth {
    fn default() -> CellTruth {
        CellTruth {
            obstacle_points: 0,
            top_points: 0,
            class: None,
            object: points::UNKNOWN,
            protrusion_m: 0.0,
            slope_rad: 0.0,
            crossing: None,
            pose: None,
            drop_m: 0.0,
            pit_m: 0.0,
        }
    }
}
