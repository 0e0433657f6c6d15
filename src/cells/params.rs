//! The `cells` section of a config, as written and as checked.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::beams;
use super::crossing::params::RoverRule;
use crate::drive::Rover;
use crate::random::{Bounded, within};
use crate::sweep::params::MountParams;

/// The grid, its features and its labels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct CellParams {
    /// Side of a cell, metres; about one wheel diameter.
    #[garde(custom(within(0.005, 100.0)))]
    pub size_m: f64,
    /// Points farther than this from the sensor (horizontally) are left out, metres; default: the sensor's own reach.
    #[garde(custom(within(0.1, 10_000.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_range_m: Option<f64>,
    /// Neighbours whose mean heights are features: 4, 8 or 24.
    #[garde(custom(four_eight_or_twenty_four))]
    pub neighbours: u32,
    /// The frame that heights, cells, pitch and roll are taken in; default: `estimated_pose`.
    #[garde(skip)]
    #[serde(skip_serializing_if = "CellFrame::is_estimated_pose")]
    pub frame: CellFrame,
    /// Sweeps (up to this many, the kept one the last) whose points are put together.
    #[garde(range(min = 1, max = 1000))]
    pub window_scans: u32,
    /// One feature more: each cell's height above the ground around it; absent = none.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub local_height: Option<LocalHeightParams>,
    /// Features more: how the ground bends at each cell, over several distances; absent = none.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curvature: Option<CurvatureParams>,
    /// Features more: what the ground looks like in squares around each cell; absent = none. They need `local_height.plane`.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surroundings: Option<SurroundingsParams>,
    /// Features more: which beams ended in each cell and which went through or over it; absent = none. They need `local_height.plane`.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beams: Option<BeamParams>,
    /// Rows also for cells that hold no point where beams passed over them, and columns of what those beams know; absent = none.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen: Option<UnseenParams>,
    /// Points that hang so high over ground that the rover fits beneath are in no cell: crowns, branches, gates; absent = all points are.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overhang: Option<OverhangParams>,
    #[garde(dive)]
    pub labels: LabelParams,
}

impl Default for CellParams {
    fn default() -> Self {
        CellParams {
            size_m: 0.1,
            max_range_m: None,
            neighbours: 8,
            frame: CellFrame::EstimatedPose,
            window_scans: 1,
            local_height: None,
            curvature: None,
            surroundings: None,
            beams: None,
            unseen: None,
            overhang: None,
            labels: LabelParams::default(),
        }
    }
}

impl CellParams {
    /// Free height over which a point hangs, metres; `None` where the rule is absent, or no rover has given it a height yet.
    pub(crate) fn above_m(&self) -> Option<f64> {
        self.overhang.as_ref().and_then(|overhang| overhang.above_m)
    }
}

fn four_eight_or_twenty_four(value: &u32, _: &()) -> garde::Result {
    if [4, 8, 24].contains(value) { Ok(()) } else { Err(garde::Error::new(format!("must be 4, 8 or 24, got {value}"))) }
}

/// How scans are levelled before they are cut into cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CellFrame {
    /// By the rover's estimated pose: the frame `map`, whose z is up.
    #[default]
    EstimatedPose,
    /// By a plane fitted to each kept sweep's own points at the height of its mount, as `marsyard classify --sensor-height` does where no
    /// pose is known, and with the same errors: a map of its own for each sweep, origin on the plane below the sensor, x under the
    /// sensor's. Pitch, roll and all sigmas are 0. Sweeps without such a plane have no cells; their points are counted.
    FittedPlane,
}

impl CellFrame {
    /// As configs name it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            CellFrame::EstimatedPose => "estimated_pose",
            CellFrame::FittedPlane => "fitted_plane",
        }
    }

    /// The default, which plans of before there was a choice do not name.
    fn is_estimated_pose(&self) -> bool {
        *self == CellFrame::EstimatedPose
    }
}

/// The cell's mean height less a low percentile (nearest rank) of the mean heights of the cells around it: column
/// `local_height_m`. It holds where levelling errors or slopes move the height above the rover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct LocalHeightParams {
    /// Cells of the same scan whose centres lie within this of the cell's centre count, the cell itself too, metres; at most
    /// 100 cells.
    #[garde(custom(within(0.1, 10.0)))]
    pub radius_m: f64,
    /// Percentile of their mean heights that stands for the ground: 0 is the lowest, 50 the median.
    #[garde(custom(within(0.0, 50.0)))]
    pub percentile: f64,
    /// Two features more: the cell's height above a plane fitted low through the ground around, and that plane's slope (`plane_height_m`,
    /// `plane_slope`). A steep bank lies high above its foot and not above its plane.
    #[garde(skip)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub plane: bool,
}

impl Default for LocalHeightParams {
    fn default() -> Self {
        LocalHeightParams { radius_m: 1.0, percentile: 10.0, plane: false }
    }
}

impl LocalHeightParams {
    /// For people: `percentile 10 within 1 m`.
    pub fn words(&self) -> String {
        let plane = if self.plane { ", and a plane" } else { "" };
        format!("percentile {} within {} m{plane}", self.percentile, self.radius_m)
    }

    /// Feature columns that it adds.
    pub(super) fn columns(&self) -> usize {
        if self.plane { 3 } else { 1 }
    }
}

/// For each distance the least and the greatest of the second differences of the mean heights along eight lines through the cell: how far the
/// ground on both sides, together, lies above twice the cell (`curvature_least_20cm_m`, `curvature_most_20cm_m`). A plane has none,
/// however steep: steps and stones are told apart from slopes that training did not have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct CurvatureParams {
    /// Distances to either side, metres, each from one cell to 100, in rising order; at most 8.
    #[garde(length(min = 1, max = 8), inner(custom(within(0.01, 10.0))))]
    pub radii_m: Vec<f64>,
}

impl Default for CurvatureParams {
    fn default() -> Self {
        CurvatureParams { radii_m: vec![0.2, 0.4, 0.8] }
    }
}

impl CurvatureParams {
    /// For people: `curvature over 0.1, 0.2 m`.
    pub fn words(&self) -> String {
        format!("curvature over {} m", list(&self.radii_m))
    }
}

/// For each distance, of the cells that hold points in the square that reaches so far to each side: the mean and the standard deviation of their
/// heights above the plane, the mean spread of heights within them, and the share of the square that they are
/// (`surroundings_height_20cm_m`, `surroundings_roughness_20cm_m`, `surroundings_spread_20cm_m`, `surroundings_cover_20cm`). What one cell
/// of few points cannot tell, grass from a bush, its neighbourhood does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct SurroundingsParams {
    /// Distances to each side, metres, each from one cell to 10, in rising order; at most 8.
    #[garde(length(min = 1, max = 8), inner(custom(within(0.01, 10.0))))]
    pub radii_m: Vec<f64>,
}

impl Default for SurroundingsParams {
    fn default() -> Self {
        SurroundingsParams { radii_m: vec![0.2, 0.4] }
    }
}

impl SurroundingsParams {
    /// For people: `surroundings within 0.2, 0.4 m`.
    pub fn words(&self) -> String {
        format!("surroundings within {} m", list(&self.radii_m))
    }
}

/// What the beams tell that meet a cell, seen from above: the share of those that came low over it and went on, the lowest of them, and how far and
/// how high the next returns before and behind the cell are (`beams_through`, `beams_through_high`, `beams_lowest_m`, `beams_behind_m`, ...);
/// and for each distance the shares over all cells of the square that reaches so far to each side (`beams_through_20cm`,
/// `beams_through_low_20cm`, `beams_through_high_20cm`). Grass and bushes let beams through, stones of the same shape do not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct BeamParams {
    /// Distances to each side, metres, each from one cell to 10, in rising order; at most 8.
    #[garde(length(min = 1, max = 8), inner(custom(within(0.01, 10.0))))]
    pub radii_m: Vec<f64>,
}

impl Default for BeamParams {
    fn default() -> Self {
        BeamParams { radii_m: vec![0.1, 0.2, 0.4] }
    }
}

impl BeamParams {
    /// For people: `beams within 0.1, 0.2, 0.4 m`.
    pub fn words(&self) -> String {
        format!("beams within {} m", list(&self.radii_m))
    }

    /// Columns that they make.
    pub(super) fn columns(&self) -> usize {
        beams::NAMES.len() + beams::NAMES_OF_SQUARES.len() * self.radii_m.len()
    }
}

fn list(radii_m: &[f64]) -> String {
    radii_m.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}

/// A row (of `points` = 0) for each empty cell near a gap: two returns that are neighbours in a column of beams, with more ground
/// between them than the plane before them explains. Every row gets the `gap_` columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct UnseenParams {
    /// Width of a column of beams, seen from the sensor, degrees; a few beams wide.
    #[garde(custom(within(0.05, 30.0)))]
    pub sector_deg: f64,
    /// Empty cells within this of a gap, along the line of sight, have a row; and of cells within it the columns tell of the gap, metres.
    #[garde(custom(within(0.05, 5.0)))]
    pub around_m: f64,
}

impl Default for UnseenParams {
    fn default() -> Self {
        UnseenParams { sector_deg: 1.0, around_m: 0.5 }
    }
}

impl UnseenParams {
    /// For people: `columns of 1 degrees, 0.5 m around gaps`.
    pub fn words(&self) -> String {
        format!("columns of {} degrees, {} m around gaps", self.sector_deg, self.around_m)
    }
}

/// A point leaves its cell where two other beams of the same sweep, in its column of 4 degrees, passed more than `above_m` beneath it:
/// they came back from behind it, or from the ground below. What stands on the ground keeps its foot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct OverhangParams {
    /// Free height that the rover needs, metres; default: the height of its body (`height_m` of its file) or of its sensor's head, as high
    /// as `sweep.mount` may put it, whichever is more, and 0.2 m.
    #[garde(custom(within(0.1, 100.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub above_m: Option<f64>,
}

/// Room above the highest of the rover, metres; the same under which its drives call a crown in the way.
const HEADROOM_M: f64 = 0.2;

impl OverhangParams {
    /// The same, with the height that it leaves open taken from the rover and from where its sensor may sit.
    pub fn resolved(&self, rover: &Rover, mount: Option<&MountParams>) -> OverhangParams {
        let highest_m = |mount: &MountParams| mount.z_m.extent().ok().flatten().map(|(_, high_m)| high_m);
        let head_m = mount.and_then(highest_m).unwrap_or(rover.mount.z_m);
        let top_m = rover.height_m.map_or(head_m, |body_m| body_m.max(head_m));
        OverhangParams { above_m: self.above_m.or(Some(top_m + HEADROOM_M)) }
    }

    /// For people: `what hangs with more than 0.8 m free beneath`, to the millimetre.
    pub fn words(&self) -> String {
        let above_mm = (1e3 * self.above_m.unwrap_or_default()).round();
        format!("what hangs with more than {} m free beneath", above_mm / 1e3)
    }
}

/// When a cell is untraversable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct LabelParams {
    /// Which objects are obstacles.
    #[garde(dive)]
    pub obstacle: ObstacleRule,
    /// Points of an obstacle that a cell must hold.
    #[garde(range(min = 1, max = 1_000_000))]
    pub min_obstacle_points: u32,
    /// Ground steeper than this is untraversable too, degrees; absent = ground never is.
    #[garde(custom(within(0.1, 90.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_ground_slope_deg: Option<f64>,
    /// Labels by what a rover can cross, judged on the true ground and bodies, instead of by obstacles' points; absent = by points.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rover: Option<RoverRule>,
    /// A cell is untraversable too where the true ground falls by more than this within 0.3 m of its centre (a lip), or where it lies so
    /// deep between walls on two opposite sides up to 2 m away (an interior), metres; adds the columns `truth_drop_m` and `truth_pit_m`.
    /// Absent = drops do not count.
    #[garde(custom(within(0.0, 100.0)))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_drop_m: Option<f64>,
}

impl Default for LabelParams {
    fn default() -> Self {
        LabelParams {
            obstacle: ObstacleRule::TallerThanWheel,
            min_obstacle_points: 1,
            max_ground_slope_deg: None,
            rover: None,
            max_drop_m: None,
        }
    }
}

/// Which solid objects (and porous ones that are marked untraversable) count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ObstacleRule {
    /// Objects that stand taller than the rover's wheel diameter.
    TallerThanWheel,
    /// All (the paper's).
    All,
    /// Objects that stand taller than this, metres.
    TallerThanM(#[garde(custom(within(0.0, 100.0)))] f64),
}
