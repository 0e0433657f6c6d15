//! The columns of a row group of `cells` -> the cells of a scan, with the model's inputs, or why one cannot be judged.

use arrow_array::types::{Float32Type, Int8Type, Int32Type, Int64Type};
use arrow_array::{Array, PrimitiveArray, RecordBatch};

use super::judge::{Cell, Judge};
use crate::corpus::reader::column;
use crate::train::Model;
use crate::train::labels::{self, LabelRule, Truth};

pub(super) const HEIGHT_DIFFERENCE: &str = "height_difference_m";
pub(super) const OBSTACLE_POINTS: &str = "truth_obstacle_points";
pub(super) const TOP_POINTS: &str = "truth_top_points";
pub(super) const CLASS: &str = "truth_class";

/// One scan in the making.
#[derive(Default)]
pub(super) struct Scan {
    pub key: Option<(i64, i32)>,
    pub cells: Vec<Cell>,
    pub features: Vec<f32>,
}

/// The columns of a row group.
pub(super) struct Columns<'b> {
    scene_id: &'b PrimitiveArray<Int64Type>,
    scan_id: &'b PrimitiveArray<Int32Type>,
    row: &'b PrimitiveArray<Int32Type>,
    col: &'b PrimitiveArray<Int32Type>,
    label: &'b PrimitiveArray<Int8Type>,
    points: &'b PrimitiveArray<Int32Type>,
    range_m: &'b PrimitiveArray<Float32Type>,
    height_difference_m: Option<&'b PrimitiveArray<Float32Type>>,
    obstacle_points: Option<&'b PrimitiveArray<Int32Type>>,
    top_points: Option<&'b PrimitiveArray<Int32Type>>,
    class: Option<&'b PrimitiveArray<Int8Type>>,
    features: Vec<&'b PrimitiveArray<Float32Type>>,
    relabel: Option<Relabel<'b>>,
}

struct Relabel<'b> {
    rule: &'b LabelRule,
    obstacle_points: &'b PrimitiveArray<Int32Type>,
    class: &'b PrimitiveArray<Int8Type>,
    protrusion_m: &'b PrimitiveArray<Float32Type>,
    slope_rad: &'b PrimitiveArray<Float32Type>,
}

impl<'b> Columns<'b> {
    pub(super) fn of(
        batch: &'b RecordBatch,
        model: &Model,
        rule: Option<&'b LabelRule>,
    ) -> Result<Columns<'b>, String> {
        let optional = |name: &str| batch.column_by_name(name).map(|_| name.to_string());
        let relabel = rule
            .map(|rule| {
                let [obstacle_points, class, protrusion_m, slope_rad] = labels::COLUMNS;
                Ok::<_, String>(Relabel {
                    rule,
                    obstacle_points: column(batch, obstacle_points)?,
                    class: column(batch, class)?,
                    protrusion_m: column(batch, protrusion_m)?,
                    slope_rad: column(batch, slope_rad)?,
                })
            })
            .transpose()?;
        Ok(Columns {
            scene_id: column(batch, "scene_id")?,
            scan_id: column(batch, "scan_id")?,
            row: column(batch, "row")?,
            col: column(batch, "col")?,
            label: column(batch, "label")?,
            points: column(batch, "points")?,
            range_m: column(batch, "range_m")?,
            height_difference_m: optional(HEIGHT_DIFFERENCE).map(|name| column(batch, &name)).transpose()?,
            obstacle_points: optional(OBSTACLE_POINTS).map(|name| column(batch, &name)).transpose()?,
            top_points: optional(TOP_POINTS).map(|name| column(batch, &name)).transpose()?,
            class: optional(CLASS).map(|name| column(batch, &name)).transpose()?,
            features: model.about.features.iter().map(|name| column(batch, name)).collect::<Result<_, _>>()?,
            relabel,
        })
    }

    /// Scene and scan of a row.
    pub(super) fn scan(&self, row: usize) -> (i64, i32) {
        (self.scene_id.value(row), self.scan_id.value(row))
    }

    /// Adds a row to its scan, or counts why it cannot be judged.
    pub(super) fn push(&self, row: usize, scan: &mut Scan, judge: &mut Judge) {
        let untraversable = match &self.relabel {
            _ if self.label.is_null(row) => {
                judge.unknown_cells += 1;
                return;
            }
            Some(relabel) => relabel.untraversable(row),
            None => self.label.value(row) != 0,
        };
        let start = scan.features.len();
        scan.features.extend(self.features.iter().map(|c| if c.is_valid(row) { c.value(row) } else { f32::NAN }));
        if scan.features[start..].iter().any(|value| !value.is_finite()) {
            scan.features.truncate(start);
            judge.not_finite_cells += 1;
            return;
        }
        let count = |column: Option<&PrimitiveArray<Int32Type>>| column.map_or(0, |c| c.value(row));
        scan.cells.push(Cell {
            row: self.row.value(row),
            col: self.col.value(row),
            untraversable,
            points: self.points.value(row),
            obstacle_points: count(self.obstacle_points),
            top_points: count(self.top_points),
            range_m: self.range_m.value(row),
            height_difference_m: self.height_difference_m.map_or(0.0, |c| c.value(row)),
            class: self.class.filter(|c| c.is_valid(row)).map(|c| c.value(row)),
        });
    }
}

impl Relabel<'_> {
    fn untraversable(&self, row: usize) -> bool {
        let truth = Truth {
            obstacle_points: self.obstacle_points.value(row),
            class: self.class.value(row),
            protrusion_m: self.protrusion_m.value(row),
            slope_rad: self.slope_rad.value(row),
        };
        self.rule.label(&truth) != 0
    }
}
