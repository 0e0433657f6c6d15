//! Cell parameters -> the feature columns: names, units, meaning and order, said here once.
//!
//! Source: Hewitt et al. 2017, "Neural network input types" and figure 4. The order is part of the data contract.

use super::params::CellFrame;
use super::{CellParams, CellTruth, Cells, FeatureColumn};
use super::{beams, surroundings};

/// A cell near another: columns to the east and rows to the north.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Offset {
    pub cols: i32,
    pub rows: i32,
}

/// The column of a cell's own height.
pub const MEAN_HEIGHT: &str = "mean_height_m";
/// The column of the variance of the heights within a cell.
pub const HEIGHT_VARIANCE: &str = "height_variance_m2";
/// The column of the highest less the lowest height.
pub const HEIGHT_DIFFERENCE: &str = "height_difference_m";
/// The column of a cell's height above the ground around it.
pub const LOCAL_HEIGHT: &str = "local_height_m";
/// The columns of a cell's height above the plane of the ground around it, and of that plane's slope.
pub const PLANE_HEIGHT: &str = "plane_height_m";
pub const PLANE_SLOPE: &str = "plane_slope";
/// Columns of how the ground bends begin with this.
const CURVATURE: &str = "curvature_";
/// Columns of the squares around begin with this.
const SURROUNDINGS: &str = "surroundings_";
/// Columns of the beams that met the cell begin with this.
const BEAMS: &str = "beams_";
/// Columns of neighbours' heights begin with this.
const NEIGHBOUR: &str = "neighbour_";

/// Columns of what the beams know of a gap begin with this.
const GAP: &str = "gap_";

/// The columns of gaps: name, unit, meaning. The gap of a row is, of the long ones in the columns of beams over its cell, within
/// `around_m` of its centre along the line of sight, the one that exceeds its plane by most.
pub(super) const GAP_COLUMNS: [(&str, &str, &str); 16] = [
    ("gap_length_m", "m", "horizontal length of the gap along the line of sight; 0 where no long gap is near"),
    ("gap_excess_m", "m", "that length less what the plane before the gap would leave between the same two beams"),
    ("gap_from_m", "m", "distance of the cell's centre behind the return before the gap; around_m where none is near"),
    ("gap_to_m", "m", "distance of the return behind the gap behind the cell's centre; around_m where none is near"),
    ("gap_near_range_m", "m", "horizontal range of the return before the gap; the cell's where none is near"),
    ("gap_near_height_m", "m", "height of the return before the gap, as mean_height_m; the cell's where none is near"),
    ("gap_far_height_m", "m", "height of the return behind the gap, as mean_height_m; the cell's where none is near"),
    ("gap_drop_m", "m", "how far the return behind the gap lies below the plane before it"),
    (
        "gap_below_m",
        "m",
        "how far the lowest beam over the cell passes below the plane before the gap; negative above it",
    ),
    ("gap_slope", "1", "slope of the plane before the gap along the line of sight, rise over run"),
    ("gap_rise_m", "m", "height of the return before the gap above the lowest of the half metre before it"),
    ("gap_shadow_m", "m", "length of the shadow that a thing of that height throws, at most 10 m"),
    ("gap_wall_m", "m", "how far the returns within 0.3 m behind the gap rise above the first of them"),
    ("gap_beams", "1", "number of returns behind the cell in its column: beams that passed over it"),
    ("gap_left_m", "m", "length of the longest gap a cell and a half to the left, seen from the sensor"),
    ("gap_right_m", "m", "the same to the right"),
];

/// Whether a feature column tells of gaps.
pub fn is_gap(column: &str) -> bool {
    column.starts_with(GAP)
}

/// A truth column that only some configs have; float32.
#[derive(Clone, Copy, Debug)]
pub struct TruthColumn {
    pub name: &'static str,
    pub unit: &'static str,
    pub description: &'static str,
    pub take: fn(&CellTruth) -> f32,
}

/// The columns of how far the ground falls.
pub const DROP: &str = "truth_drop_m";
pub const PIT: &str = "truth_pit_m";

/// The truth columns that a config adds, in order.
pub fn truth_columns(params: &CellParams) -> Vec<TruthColumn> {
    if params.labels.max_drop_m.is_none() {
        return Vec::new();
    }
    let drop = TruthColumn {
        name: DROP,
        unit: "m",
        description: "How far the true ground falls within 0.3 m of the cell's centre, or truth_pit_m where that is more.",
        take: |truth| truth.drop_m,
    };
    let pit = TruthColumn {
        name: PIT,
        unit: "m",
        description: "How deep the cell's centre lies between walls on two opposite sides, each up to 2 m away.",
        take: |truth| truth.pit_m,
    };
    vec![drop, pit]
}

/// A count of points that only some configs leave out of the cells, for each scene.
#[derive(Clone, Copy, Debug)]
pub struct LossColumn {
    pub name: &'static str,
    pub description: &'static str,
    pub take: fn(&Cells) -> u64,
}

/// The counts that the families of a config add, in order.
pub(crate) fn loss_columns(families: &[&CellParams]) -> Vec<LossColumn> {
    let any = |leaves_out: fn(&CellParams) -> bool| families.iter().any(|params| leaves_out(params));
    let mut columns = Vec::new();
    if any(|params| params.frame == CellFrame::FittedPlane) {
        columns.push(LossColumn {
            name: "points_without_ground",
            description: "Of points_in, those of sweeps in which no plane was found to level them by.",
            take: |cells| cells.without_ground,
        });
    }
    if any(|params| params.overhang.is_some()) {
        columns.push(LossColumn {
            name: "points_overhanging",
            description: "Of points_in, those that hang over free height (cells.overhang).",
            take: |cells| cells.overhanging,
        });
    }
    columns
}

/// `20cm` of 0.2 m; a length that is no whole number of centimetres is written in micrometres.
fn length(radius_m: f64) -> String {
    let centimetres = 100.0 * radius_m;
    if (centimetres - centimetres.round()).abs() > 1e-9 {
        format!("{}um", (1e6 * radius_m).round())
    } else {
        format!("{}cm", centimetres.round())
    }
}

/// Whether a feature column tells of the squares around the cell.
pub fn is_surroundings(column: &str) -> bool {
    column.starts_with(SURROUNDINGS)
}

/// Whether a feature column tells of the beams that met the cell.
pub fn is_beams(column: &str) -> bool {
    column.starts_with(BEAMS)
}

/// Whether a feature column tells how the ground bends.
pub fn is_curvature(column: &str) -> bool {
    column.starts_with(CURVATURE)
}

/// Whether a feature column is the height of a neighbour.
pub fn is_neighbour(column: &str) -> bool {
    column.starts_with(NEIGHBOUR)
}

/// The neighbours whose means are features, from the bottom left, row by row: sw, s, se, w, e, nw, n, ne.
///
/// 4 keeps those that share a side (s, w, e, n); 24 reaches two cells out.
pub fn neighbour_offsets(neighbours: u32) -> Vec<Offset> {
    let reach = if neighbours == 24 { 2 } else { 1 };
    let square = (-reach..=reach).flat_map(|rows| (-reach..=reach).map(move |cols| Offset { cols, rows }));
    square
        .filter(|o| if neighbours == 4 { o.cols.abs() + o.rows.abs() == 1 } else { (o.cols, o.rows) != (0, 0) })
        .collect()
}

impl Offset {
    /// Compass letters, one a cell: `sw` is one south and one west, `nnee` two north and two east.
    pub fn name(self) -> String {
        let letters = |count: i32, minus: &str, plus: &str| {
            (if count < 0 { minus } else { plus }).repeat(count.unsigned_abs() as usize)
        };
        letters(self.rows, "s", "n") + &letters(self.cols, "w", "e")
    }
}

/// The feature columns of a corpus, in order. `intensity`: whether the sweeps carry intensities.
pub fn feature_columns(params: &CellParams, intensity: bool) -> Vec<FeatureColumn> {
    let column = |name: &str, unit, description: &str| FeatureColumn {
        name: name.to_string(),
        unit,
        description: description.to_string(),
    };
    let mut columns = vec![
        column(MEAN_HEIGHT, "m", "mean height of the points above the rover's estimated z (eq. 3)"),
        column(HEIGHT_VARIANCE, "m2", "population variance of the points' heights, 0 for one point (eq. 4)"),
        column(HEIGHT_DIFFERENCE, "m", "highest minus lowest point"),
        column("point_count", "1", "number of points"),
        column("pitch_rad", "rad", "estimated pitch of the rover, positive nose down"),
        column("roll_rad", "rad", "estimated roll of the rover, positive right side down"),
    ];
    columns.extend(neighbour_offsets(params.neighbours).into_iter().map(|offset| {
        let name = offset.name();
        let description =
            format!("mean height of the neighbour to the {name}, as mean_height_m; own mean where that cell is empty");
        FeatureColumn { name: format!("{NEIGHBOUR}{name}_m"), unit: "m", description }
    }));
    columns.extend(params.local_height.iter().map(|local| {
        let (radius_m, percentile) = (local.radius_m, local.percentile);
        let description = format!(
            "mean height above percentile {percentile} (nearest rank) of the mean heights of the cells of the scan whose \
             centres lie within {radius_m} m, the cell itself included"
        );
        column(LOCAL_HEIGHT, "m", &description)
    }));
    if let Some(local) = params.local_height.as_ref().filter(|local| local.plane) {
        let around =
            format!("the plane fitted low through the lowest cells of the ground some {} m around", local.radius_m);
        columns.push(column(PLANE_HEIGHT, "m", &format!("mean height above {around}")));
        columns.push(column(PLANE_SLOPE, "1", &format!("slope of {around}, rise over run")));
    }
    for &radius_m in params.curvature.iter().flat_map(|curvature| &curvature.radii_m) {
        columns.extend(["least", "most"].map(|extreme| {
            let description = format!(
                "{extreme} of the second differences of the mean heights along eight lines through the cell, {radius_m} m to either side"
            );
            FeatureColumn { name: format!("{CURVATURE}{extreme}_{}_m", length(radius_m)), unit: "m", description }
        }));
    }
    let ending = |unit| if unit == "m" { "_m" } else { "" };
    for &radius_m in params.surroundings.iter().flat_map(|surroundings| &surroundings.radii_m) {
        columns.extend(surroundings::NAMES.map(|(name, unit, meaning)| {
            let name = format!("{SURROUNDINGS}{name}_{}{}", length(radius_m), ending(unit));
            let description =
                format!("{meaning}, in the square that reaches {radius_m} m to each side; of cells that hold points");
            FeatureColumn { name, unit, description }
        }));
    }
    if let Some(of_beams) = &params.beams {
        columns.extend(beams::NAMES.map(|(name, unit, meaning)| FeatureColumn {
            name: format!("{BEAMS}{name}{}", ending(unit)),
            unit,
            description: meaning.to_owned(),
        }));
        for &radius_m in &of_beams.radii_m {
            columns.extend(beams::NAMES_OF_SQUARES.map(|(name, unit, meaning)| FeatureColumn {
                name: format!("{BEAMS}{name}_{}{}", length(radius_m), ending(unit)),
                unit,
                description: format!(
                    "{meaning}; of all cells that hold points in the square that reaches {radius_m} m to each side"
                ),
            }));
        }
    }
    columns.extend([("z", "m"), ("roll", "rad"), ("pitch", "rad"), ("x", "m"), ("y", "m"), ("yaw", "rad")].map(
        |(axis, unit)| {
            let description = format!("standard deviation of the rover's estimated {axis}");
            FeatureColumn { name: format!("sigma_{axis}_{unit}"), unit, description }
        },
    ));
    if intensity {
        columns.push(column(
            "intensity_mean",
            "1",
            "mean of the received intensity times the squared range, over range^2 of 1 m",
        ));
        columns.push(column("intensity_variance", "1", "population variance of the same"));
    }
    if params.unseen.is_some() {
        columns.extend(GAP_COLUMNS.map(|(name, unit, description)| column(name, unit, description)));
    }
    columns
}

#[cfg(test)]
mod tests;
