//! `cells`: one row per non-empty cell of a kept scan. The features follow these columns, and the truth that only some configs have.

use std::sync::Arc;

use arrow_array::{ArrayRef, Float32Array};

use super::{Definition, canonical_f32, define};
use crate::cells::{CellRow, Cells, Label as CellLabel, TruthColumn};
use crate::corpus::cells as name;
use crate::corpus::schema::Role::{Info, Key, Label, Truth};
use crate::scene::Class;

/// A cell and where it belongs.
pub(crate) struct Row<'a> {
    pub scene_id: i64,
    pub scan_id: i32,
    pub cell: &'a CellRow,
}

type Extract<'a> = super::Extract<Row<'a>>;

/// `by_rover`: cells are labelled by a rover; `poses`: it is set down in each of them.
#[rustfmt::skip]
pub(crate) fn definitions<'a>(by_rover: bool, poses: bool) -> Vec<Definition<Row<'a>>> {
    let [scene_id, scan_id, row, col] = name::KEYS;
    let mut definitions = vec![
        define(scene_id, "1", Key, "Number of the scene in the corpus.", Extract::number(|r| r.scene_id)),
        define(scan_id, "1", Key, "Number of the stop at which the kept scan was made, from 0.", Extract::number(|r| r.scan_id)),
        define(row, "1", Key, "Cell row: floor(y / cell size), frame map, from the yard's corner; may be negative.", Extract::number(|r| r.cell.index.row)),
        define(col, "1", Key, "Cell column: floor(x / cell size), frame map, from the yard's corner; may be negative.", Extract::number(|r| r.cell.index.col)),
        define(name::LABEL, "1", Label, "0 traversable, 1 untraversable, null unknown.", Extract::number_or_null(|r| r.cell.label.map(CellLabel::number))),
        define(name::POINTS, "1", Info, "Lidar points in the cell.", Extract::number(|r| r.cell.points)),
        define(name::RANGE_M, "m", Info, "Mean horizontal distance of the points from the sensor.", Extract::number(|r| r.cell.range_m)),
        define(name::NEIGHBOUR_MASK, "1", Info, "Bit k is set where neighbour k (order sw, s, se, w, e, nw, n, ne, then the outer ring) holds points.", Extract::number(|r| r.cell.neighbour_mask)),
        define(name::OBSTACLE_POINTS, "1", Truth, "Points in the cell that are an obstacle's, by the label's rule.", Extract::number(|r| r.cell.truth.obstacle_points)),
        define(name::TOP_POINTS, "1", Truth, "Points in the cell that lie on the flat top of an object.", Extract::number(|r| r.cell.truth.top_points)),
        define(name::CLASS, "1", Truth, "Class of the object that made the label (of several the tallest), else of the tallest among the points: 0 ground, 1 rock, 2 box, 3 trunk, 4 grass, 5 bush, 6 crown.", Extract::number(|r| Class::number_or_none(r.cell.truth.class))),
        define(name::OBJECT, "1", Truth, "Id of that object within the scene, -1 for ground.", Extract::number(|r| r.cell.truth.object)),
        define(name::PROTRUSION_M, "m", Truth, "Height of that object above the ground, 0 for ground.", Extract::number(|r| r.cell.truth.protrusion_m)),
        define(name::SLOPE_RAD, "rad", Truth, "Steepest true slope of the ground under the cell's ground points.", Extract::number(|r| r.cell.truth.slope_rad)),
    ];
    if by_rover {
        definitions.extend([
            define(name::MARGIN_M, "m", Truth, "Distance of what the rover meets in the cell from the nearest of its limits, negative beyond it; null where no rover was asked.", Extract::number_or_null(|r| r.cell.truth.crossing.map(|crossing| crossing.margin_m))),
            define(name::LIMIT, "1", Truth, "That limit: 0 climb, 1 drop, 2 gap, 3 belly, 4 tilt, 5 side slip; null where no rover was asked.", Extract::number_or_null(|r| r.cell.truth.crossing.map(|crossing| crossing.limit.number()))),
        ]);
    }
    if poses {
        definitions.extend([
            define(name::HEADINGS, "1", Truth, "Bit k is set where the rover, centred in the cell and looking along k times 45 degrees of the map (counter-clockwise from its x axis), can stand.", Extract::number_or_null(|r| r.cell.truth.pose.map(|pose| i32::from(pose.headings)))),
            define(name::COST, "1", Truth, "0 to 1: mean over those headings of the largest share of a limit that the rover takes up, 1 where it cannot stand.", Extract::number_or_null(|r| r.cell.truth.pose.map(|pose| pose.cost))),
            define(name::TILT_RAD, "rad", Truth, "Worst tilt of the headings along which it can stand; null where there is none.", Extract::number_or_null(|r| r.cell.truth.pose.and_then(|pose| pose.worst).map(|worst| worst.tilt_rad))),
            define(name::CLEARANCE_M, "m", Truth, "Least clearance under the belly of those headings; null where there is none.", Extract::number_or_null(|r| r.cell.truth.pose.and_then(|pose| pose.worst).map(|worst| worst.clearance_m))),
        ]);
    }
    definitions
}

/// A truth column that only some configs have.
pub(crate) fn truth(column: &TruthColumn, cells: &Cells) -> ArrayRef {
    let values = cells.rows.iter().map(|row| canonical_f32((column.take)(&row.truth)));
    Arc::new(Float32Array::from_iter_values(values))
}
