//! Record batches of `cells` -> typed columns: the one reader of that table.
//!
//! In: a file and the names of the columns that are wanted of it (`projection`); a batch of it. Out: a [`CellBatch`], whose columns are
//! slices, one entry a row, taken without a copy. Numbers on disk become the types of the core here and nowhere else: a label is a [`Label`] or
//! unknown (null), a class a [`Class`] or unknown (-1 or null). A column that is absent or of another type, and a number that stands for
//! no label or class, is refused by name. Units and meanings: `tables/cells.rs`. Not checked: the order of the rows, and whether counts
//! agree with each other; the verifier does that.

use arrow_array::types::{Float32Type, Int8Type, Int32Type, Int64Type};
use arrow_array::{Array, ArrowPrimitiveType, RecordBatch};
use arrow_buffer::NullBuffer;

use super::CorpusError;
use super::reader::{TableFile, column, rows_of_scene};
use crate::cells::{CellTruth, Crossing, Label, LabelRule, Limit, PoseTruth, PoseWorst, Unanswerable};
use crate::geometry::CellIndex;
use crate::scene::Class;

/// Where a cell is: scene, scan, row, column.
pub(crate) const KEYS: [&str; 4] = ["scene_id", "scan_id", "row", "col"];
pub const LABEL: &str = "label";
pub const POINTS: &str = "points";
pub const RANGE_M: &str = "range_m";
pub(super) const NEIGHBOUR_MASK: &str = "neighbour_mask";
pub(crate) const OBSTACLE_POINTS: &str = "truth_obstacle_points";
pub(crate) const TOP_POINTS: &str = "truth_top_points";
pub(crate) const CLASS: &str = "truth_class";
pub(crate) const OBJECT: &str = "truth_object_id";
pub(super) const PROTRUSION_M: &str = "truth_protrusion_m";
pub(super) const SLOPE_RAD: &str = "truth_slope_rad";
/// Where a rover labels the cells, what it said.
pub(crate) const MARGIN_M: &str = "truth_margin_m";
pub(crate) const LIMIT: &str = "truth_limit";
/// Where it is set down in them too, what it said.
pub(super) const HEADINGS: &str = "truth_headings";
pub(super) const COST: &str = "truth_cost";
pub(super) const TILT_RAD: &str = "truth_tilt_rad";
pub(super) const CLEARANCE_M: &str = "truth_clearance_m";
/// Only in corpora whose labels ask for it.
pub(crate) const DROP_M: &str = crate::cells::DROP;
const PIT_M: &str = crate::cells::PIT;
/// What only the simulator knows of any cell.
pub(crate) const TRUTH: [&str; 6] = [OBSTACLE_POINTS, TOP_POINTS, CLASS, OBJECT, PROTRUSION_M, SLOPE_RAD];
/// What a [`LabelRule`] asks of the truth.
const RULE_TRUTH: [&str; 5] = [OBSTACLE_POINTS, CLASS, PROTRUSION_M, SLOPE_RAD, DROP_M];

/// What it asks where it goes by a rover's margin.
const MARGIN_TRUTH: [&str; 4] = [OBSTACLE_POINTS, CLASS, MARGIN_M, LIMIT];

/// The columns that a rule asks for; drops, where it limits them.
pub(crate) fn rule_truth(rule: Option<&LabelRule>) -> &'static [&'static str] {
    match rule {
        None => &[],
        Some(LabelRule { min_margin_m: Some(_), .. }) => &MARGIN_TRUTH,
        Some(LabelRule { max_drop_m: Some(_), .. }) => &RULE_TRUTH,
        Some(_) => &RULE_TRUTH[..4],
    }
}

/// Fails where a rule goes by a margin that no rover measured, or by drops that no label asked for: the corpus is whole, and cannot answer.
pub(crate) fn check_answers(rule: Option<&LabelRule>, file: &TableFile, place: &str) -> Result<(), Unanswerable> {
    let lacks = |name: &str| file.schema().field_with_name(name).is_err();
    match rule {
        Some(LabelRule { min_margin_m: Some(_), .. }) if lacks(MARGIN_M) => {
            Err(Unanswerable::NoMargin { place: place.to_owned() })
        }
        Some(LabelRule { max_drop_m: Some(_), .. }) if lacks(DROP_M) => {
            Err(Unanswerable::NoDrop { place: place.to_owned() })
        }
        _ => Ok(()),
    }
}

/// The columns to read of a file: those that are needed, and of the others those that it has. `Err` names one that is needed and
/// not there.
pub(crate) fn projection<'n>(
    file: &TableFile,
    needed: impl IntoIterator<Item = &'n str>,
    others: &[&'n str],
) -> Result<Vec<&'n str>, String> {
    let has = |name: &str| file.schema().field_with_name(name).is_ok();
    let mut wanted: Vec<&str> = needed.into_iter().collect();
    if let Some(absent) = wanted.iter().find(|name| !has(name)) {
        return Err(format!("it has no column '{absent}'"));
    }
    wanted.extend(others.iter().filter(|name| has(name)));
    wanted.sort_unstable();
    wanted.dedup();
    Ok(wanted)
}

/// Rows of `cells`; a column is looked up and checked when it is asked for.
#[derive(Clone, Debug)]
pub struct CellBatch(RecordBatch);

/// A column's values, and which of them are null.
#[derive(Clone, Copy, Debug)]
struct Column<'b, N> {
    values: &'b [N],
    nulls: Option<&'b NullBuffer>,
}

impl<N: Copy> Column<'_, N> {
    #[inline]
    fn at(&self, row: usize) -> Option<N> {
        if self.nulls.is_some_and(|nulls| nulls.is_null(row)) { None } else { Some(self.values[row]) }
    }
}

impl CellBatch {
    pub(crate) fn of(batch: RecordBatch) -> CellBatch {
        CellBatch(batch)
    }

    /// Some columns of a row group.
    pub fn read(file: &TableFile, group: usize, columns: &[&str]) -> Result<CellBatch, CorpusError> {
        file.read_row_group(group, Some(columns)).map(CellBatch)
    }

    /// The rows of one scene.
    pub(crate) fn of_scene(&self, scene_id: u64) -> Result<CellBatch, String> {
        rows_of_scene(&self.0, scene_id).map(CellBatch)
    }

    pub(crate) fn rows(&self) -> usize {
        self.0.num_rows()
    }

    fn column<T: ArrowPrimitiveType>(&self, name: &str) -> Result<Column<'_, T::Native>, String> {
        let array = column::<T>(&self.0, name)?;
        Ok(Column { values: array.values(), nulls: array.nulls().filter(|nulls| nulls.null_count() > 0) })
    }

    fn column_if_there<T: ArrowPrimitiveType>(&self, name: &str) -> Result<Option<Column<'_, T::Native>>, String> {
        self.0.column_by_name(name).map(|_| self.column::<T>(name)).transpose()
    }

    fn values<T: ArrowPrimitiveType>(&self, name: &str) -> Result<&[T::Native], String> {
        Ok(self.column::<T>(name)?.values)
    }

    pub(crate) fn keys(&self) -> Result<Keys<'_>, String> {
        let [scene, scan, row, col] = KEYS;
        Ok(Keys {
            scenes: self.values::<Int64Type>(scene)?,
            scans: self.values::<Int32Type>(scan)?,
            rows: self.values::<Int32Type>(row)?,
            cols: self.values::<Int32Type>(col)?,
        })
    }

    pub(crate) fn scenes(&self) -> Result<&[i64], String> {
        self.values::<Int64Type>(KEYS[0])
    }

    pub fn labels(&self) -> Result<Labels<'_>, String> {
        let column = self.column::<Int8Type>(LABEL)?;
        match wrong_number(&column, |number| Label::of_number(number).is_some()) {
            Some(number) => Err(format!("its column '{LABEL}' holds {number}; labels are 0, 1 or null")),
            None => Ok(Labels(column)),
        }
    }

    /// Lidar points of each cell.
    pub(crate) fn points(&self) -> Result<&[i32], String> {
        self.values::<Int32Type>(POINTS)
    }

    pub(crate) fn ranges_m(&self) -> Result<&[f32], String> {
        self.values::<Float32Type>(RANGE_M)
    }

    pub(crate) fn neighbour_masks(&self) -> Result<&[i32], String> {
        self.values::<Int32Type>(NEIGHBOUR_MASK)
    }

    /// The features of these names, in this order.
    pub(crate) fn features<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Result<Features<'_>, String> {
        Ok(Features(names.into_iter().map(|name| self.column::<Float32Type>(name)).collect::<Result<_, _>>()?))
    }

    /// The values of a feature that only some corpora have.
    pub fn feature_if_there(&self, name: &str) -> Result<Option<&[f32]>, String> {
        Ok(self.column_if_there::<Float32Type>(name)?.map(|column| column.values))
    }

    /// What the batch has of the truth; `needed` names columns of it that must be there.
    pub(crate) fn truth(&self, needed: &[&str]) -> Result<TruthColumns<'_>, String> {
        if let Some(absent) = needed.iter().find(|name| self.0.column_by_name(name).is_none()) {
            return Err(format!("it has no column '{absent}'"));
        }
        let class = self.column_if_there::<Int8Type>(CLASS)?;
        let is_known = |number| number == -1 || Class::of_number(number).is_some();
        if let Some(number) = class.and_then(|column| wrong_number(&column, is_known)) {
            let last = Class::ALL.len() - 1;
            return Err(format!("its column '{CLASS}' holds {number}; classes are 0 to {last}, -1 or null"));
        }
        let limit = self.column_if_there::<Int8Type>(LIMIT)?;
        if let Some(number) =
            limit.and_then(|column| wrong_number(&column, |number| Limit::of_number(number).is_some()))
        {
            let last = Limit::ALL.len() - 1;
            return Err(format!("its column '{LIMIT}' holds {number}; limits are 0 to {last} or null"));
        }
        let whole = |name: &str| self.column_if_there::<Int32Type>(name);
        let real = |name: &str| self.column_if_there::<Float32Type>(name);
        Ok(TruthColumns {
            obstacle_points: whole(OBSTACLE_POINTS)?,
            top_points: whole(TOP_POINTS)?,
            class,
            object: whole(OBJECT)?,
            protrusion_m: real(PROTRUSION_M)?,
            slope_rad: real(SLOPE_RAD)?,
            margin_m: real(MARGIN_M)?,
            limit,
            headings: whole(HEADINGS)?,
            cost: real(COST)?,
            tilt_rad: real(TILT_RAD)?,
            clearance_m: real(CLEARANCE_M)?,
            drop_m: real(DROP_M)?,
            pit_m: real(PIT_M)?,
        })
    }
}

/// A number of the column that its kind does not have.
fn wrong_number(column: &Column<i8>, is_known: impl Fn(i8) -> bool) -> Option<i8> {
    (0..column.values.len()).filter_map(|row| column.at(row)).find(|&number| !is_known(number))
}

/// Which cell each row is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Keys<'b> {
    pub scenes: &'b [i64],
    pub scans: &'b [i32],
    rows: &'b [i32],
    cols: &'b [i32],
}

impl Keys<'_> {
    pub(crate) fn index(&self, row: usize) -> CellIndex {
        CellIndex { row: self.rows[row], col: self.cols[row] }
    }
}

/// The label of each row.
#[derive(Clone, Copy, Debug)]
pub struct Labels<'b>(Column<'b, i8>);

impl Labels<'_> {
    /// `None`: unknown.
    #[inline]
    pub fn at(&self, row: usize) -> Option<Label> {
        self.0.at(row).and_then(Label::of_number)
    }
}

/// Some features of each row.
#[derive(Clone, Debug)]
pub struct Features<'b>(Vec<Column<'b, f32>>);

impl Features<'_> {
    /// Appends the features of a row if all are finite numbers, and says whether they are.
    #[inline]
    pub(crate) fn append_finite(&self, row: usize, out: &mut Vec<f32>) -> bool {
        let start = out.len();
        out.extend(self.row(row));
        let is_finite = out[start..].iter().all(|value| value.is_finite());
        if !is_finite {
            out.truncate(start);
        }
        is_finite
    }

    /// The features of a row, NaN for a null.
    #[inline]
    pub(crate) fn row(&self, row: usize) -> impl ExactSizeIterator<Item = f32> + '_ {
        self.0.iter().map(move |column| column.at(row).unwrap_or(f32::NAN))
    }
}

/// The truth of each row, as far as the batch has it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TruthColumns<'b> {
    obstacle_points: Option<Column<'b, i32>>,
    top_points: Option<Column<'b, i32>>,
    class: Option<Column<'b, i8>>,
    object: Option<Column<'b, i32>>,
    protrusion_m: Option<Column<'b, f32>>,
    slope_rad: Option<Column<'b, f32>>,
    margin_m: Option<Column<'b, f32>>,
    limit: Option<Column<'b, i8>>,
    headings: Option<Column<'b, i32>>,
    cost: Option<Column<'b, f32>>,
    tilt_rad: Option<Column<'b, f32>>,
    clearance_m: Option<Column<'b, f32>>,
    drop_m: Option<Column<'b, f32>>,
    pit_m: Option<Column<'b, f32>>,
}

impl TruthColumns<'_> {
    fn crossing_at(&self, row: usize) -> Option<Crossing> {
        let limit = self.limit.and_then(|column| column.at(row)).and_then(Limit::of_number)?;
        Some(Crossing { margin_m: self.margin_m.and_then(|column| column.at(row))?, limit })
    }

    fn pose_at(&self, row: usize) -> Option<PoseTruth> {
        let real = |column: Option<Column<f32>>| column.and_then(|column| column.at(row));
        let worst = real(self.tilt_rad).zip(real(self.clearance_m));
        let worst = worst.map(|(tilt_rad, clearance_m)| PoseWorst { tilt_rad, clearance_m });
        let headings = self.headings.and_then(|column| column.at(row))?;
        Some(PoseTruth { headings: u8::try_from(headings).ok()?, cost: real(self.cost)?, worst })
    }

    /// What a column that is absent or null would say is as in [`CellTruth::default`]: nothing is known of it.
    #[inline]
    pub(crate) fn at(&self, row: usize) -> CellTruth {
        let unknown = CellTruth::default();
        let whole = |column: &Option<Column<i32>>, or| column.and_then(|column| column.at(row)).unwrap_or(or);
        let real = |column: &Option<Column<f32>>, or| column.and_then(|column| column.at(row)).unwrap_or(or);
        CellTruth {
            obstacle_points: whole(&self.obstacle_points, unknown.obstacle_points),
            top_points: whole(&self.top_points, unknown.top_points),
            class: self.class.and_then(|column| column.at(row)).and_then(Class::of_number),
            object: whole(&self.object, unknown.object),
            protrusion_m: real(&self.protrusion_m, unknown.protrusion_m),
            slope_rad: real(&self.slope_rad, unknown.slope_rad),
            crossing: self.crossing_at(row),
            pose: self.pose_at(row),
            drop_m: real(&self.drop_m, unknown.drop_m),
            pit_m: real(&self.pit_m, unknown.pit_m),
        }
    }
}

#[cfg(test)]
mod tests;
