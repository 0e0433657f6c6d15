//! `points`: one row per beam slot of a kept scan, misses included.
//!
//! A missed slot keeps its line and beam and has no range, position or cell. A point that is in no cell (beyond
//! `cells.max_range_m`, or left out by `cells.overhang`) has a position and no cell.

use super::{Definition, define};
use crate::cells::CellAssigner;
use crate::corpus::schema::Role::{Info, Key, Truth};
use crate::episode::ScanPoints;
use crate::geometry::{CellIndex, DVec3};
use crate::scene::Class;
use crate::sweep::{Status, TrueReturn};

/// A slot and where its point falls.
pub(crate) struct Row {
    scene_id: i64,
    scan_id: i32,
    line: i32,
    beam: i32,
    status: Status,
    range_m: Option<f64>,
    sensor_m: Option<DVec3>,
    map_m: Option<DVec3>,
    intensity: Option<f32>,
    truth: TrueReturn,
    obstacle: bool,
    cell: Option<CellIndex>,
}

impl Row {
    /// One row a slot, in firing order.
    pub(crate) fn of_scan(scene_id: i64, scan_id: i32, points: &ScanPoints) -> Vec<Row> {
        let sweep = &points.sweep;
        let assigner = CellAssigner::of_sensor(points.grid, points.max_range_m, points.map_from_sensor);
        let is_obstacle =
            |object: i32| usize::try_from(object).ok().and_then(|id| points.obstacles.get(id)) == Some(&true);
        let row = |slot: usize| {
            let range_m = (sweep.returns.status[slot] == Status::Hit).then(|| sweep.returns.range_m[slot]);
            let direction = sweep.returns.pattern.directions[slot];
            let placed = range_m.map(|range_m| assigner.place(direction, range_m));
            Row {
                scene_id,
                scan_id,
                line: (slot / sweep.returns.pattern.beams as usize) as i32,
                beam: (slot % sweep.returns.pattern.beams as usize) as i32,
                status: sweep.returns.status[slot],
                range_m,
                sensor_m: range_m.map(|range_m| direction * range_m),
                // There is no map where no plane was found.
                map_m: placed.map(|placed| placed.point_m).filter(|map_m| map_m.is_finite()),
                intensity: sweep.returns.intensity.as_ref().map(|values| values[slot]).filter(|_| range_m.is_some()),
                truth: sweep.truth[slot],
                obstacle: is_obstacle(sweep.truth[slot].object),
                cell: placed.and_then(|placed| placed.cell.ok()).filter(|_| !points.hangs(slot)),
            }
        };
        (0..sweep.returns.status.len()).map(row).collect()
    }
}

type Extract = super::Extract<Row>;

#[rustfmt::skip]
pub(crate) fn definitions() -> Vec<Definition<Row>> {
    vec![
        define("scene_id", "1", Key, "Number of the scene in the corpus.", Extract::number(|r| r.scene_id)),
        define("scan_id", "1", Key, "Number of the stop at which the kept scan was made, from 0.", Extract::number(|r| r.scan_id)),
        define("line", "1", Key, "Scan line (a position of the tilt head, or a ring).", Extract::number(|r| r.line)),
        define("beam", "1", Key, "Beam within the line, in firing order.", Extract::number(|r| r.beam)),
        define("status", "1", Info, "0 hit, 1 nothing in reach, 2 dropped (too little light, or at random), 3 outside the sensor's gates.", Extract::number(|r| r.status as i8)),
        define("range_m", "m", Info, "Measured range; null unless hit.", Extract::number_or_null(|r| r.range_m)),
        define("sensor_x_m", "m", Info, "Point in the sensor's frame: x forward.", Extract::number_or_null(|r| r.sensor_m.map(|p| p.x))),
        define("sensor_y_m", "m", Info, "Point in the sensor's frame: y left.", Extract::number_or_null(|r| r.sensor_m.map(|p| p.y))),
        define("sensor_z_m", "m", Info, "Point in the sensor's frame: z up.", Extract::number_or_null(|r| r.sensor_m.map(|p| p.z))),
        define("map_x_m", "m", Info, "Point in the map, by the estimated pose.", Extract::number_or_null(|r| r.map_m.map(|p| p.x))),
        define("map_y_m", "m", Info, "Point in the map, by the estimated pose.", Extract::number_or_null(|r| r.map_m.map(|p| p.y))),
        define("map_z_m", "m", Info, "Point in the map, by the estimated pose.", Extract::number_or_null(|r| r.map_m.map(|p| p.z))),
        define("intensity", "1", Info, "Received intensity; null unless hit and the effect is on.", Extract::number_or_null(|r| r.intensity)),
        define("truth_range_m", "m", Truth, "True distance to the first surface along the beam's axis; null where there is none.", Extract::number_or_null(|r| Some(r.truth.range_m).filter(|range_m| range_m.is_finite()))),
        define("truth_class", "1", Truth, "Class of what was met: 0 ground, 1 rock, 2 box, 3 trunk, 4 grass, 5 bush, 6 crown, -1 nothing.", Extract::number(|r| Class::number_or_none(r.truth.class))),
        define("truth_object_id", "1", Truth, "Id of the object met within the scene, -1 ground, -2 nothing.", Extract::number(|r| r.truth.object)),
        define("truth_top", "1", Truth, "The point lies on the flat top of an object.", Extract::flag(|r| r.truth.top)),
        define("truth_obstacle", "1", Truth, "What was met is an obstacle by the label's rule: a cell with enough such points is untraversable.", Extract::flag(|r| r.obstacle)),
        define("row", "1", Info, "Row of the cell that holds the point; null where none does.", Extract::number_or_null(|r| r.cell.map(|c| c.row))),
        define("col", "1", Info, "Column of the cell that holds the point; null where none does.", Extract::number_or_null(|r| r.cell.map(|c| c.col))),
    ]
}
