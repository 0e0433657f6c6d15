//! One stored cell, found by its address: for comparing what is on disk with what a replay computes.

use arrow::array::{Array, AsArray};
use arrow::datatypes::{Float32Type, Int8Type, Int32Type};

use super::reader::TableFile;
use super::{CorpusError, CorpusSpec, Store, Table};
use crate::geometry::CellIndex;

/// A row of `cells` as it is stored.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredCell {
    pub label: Option<i8>,
    pub points: i32,
    /// Name and value, in the order of the columns.
    pub features: Vec<(String, f32)>,
}

/// The stored row of a cell; `None` where there is no such row.
pub fn stored_cell(
    store: &dyn Store,
    spec: &CorpusSpec,
    scene: u64,
    scan: u32,
    cell: CellIndex,
) -> Result<Option<StoredCell>, CorpusError> {
    let shard = scene / u64::from(spec.scenes_per_shard.max(1));
    let batch = TableFile::open(store, &Table::Cells.path(shard))?.rows_of_scene(scene)?;
    let wanted = [("scan_id", scan as i32), ("row", cell.row), ("col", cell.col)];
    let is_it = |at: usize| {
        wanted.iter().all(|(name, value)| {
            batch.column_by_name(name).is_some_and(|c| c.as_primitive::<Int32Type>().value(at) == *value)
        })
    };
    let Some(at) = (0..batch.num_rows()).find(|&at| is_it(at)) else { return Ok(None) };
    let float = |name: &str| batch.column_by_name(name).map_or(f32::NAN, |c| c.as_primitive::<Float32Type>().value(at));
    let label = batch.column_by_name("label").map(|c| c.as_primitive::<Int8Type>());
    let points = batch.column_by_name("points").map_or(0, |c| c.as_primitive::<Int32Type>().value(at));
    Ok(Some(StoredCell {
        label: label.filter(|c| c.is_valid(at)).map(|c| c.value(at)),
        points,
        features: spec.features.iter().map(|f| (f.name.clone(), float(&f.name))).collect(),
    }))
}
