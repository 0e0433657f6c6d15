//! One stored cell, found by its address: for comparing what is on disk with what a replay computes.

use arrow::array::Array;
use arrow::datatypes::{Float32Type, Int8Type, Int32Type};

use super::reader::{TableFile, column};
use super::{CorpusError, CorpusSpec, Store, Table};
use crate::cells::FeatureColumn;
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
    let file = TableFile::open(store, &Table::Cells.path(shard))?;
    let batch = file.rows_of_scene(scene)?;
    let odd = |reason: String| file.odd(reason);
    let whole = |name: &str| column::<Int32Type>(&batch, name).map_err(odd);
    let wanted = [(whole("scan_id")?, scan as i32), (whole("row")?, cell.row), (whole("col")?, cell.col)];
    let is_it = |at: usize| wanted.iter().all(|(column, value)| column.value(at) == *value);
    let Some(at) = (0..batch.num_rows()).find(|&at| is_it(at)) else { return Ok(None) };
    let label = column::<Int8Type>(&batch, "label").map_err(odd)?;
    let float = |feature: &FeatureColumn| {
        let values = column::<Float32Type>(&batch, &feature.name).map_err(odd)?;
        Ok((feature.name.clone(), values.value(at)))
    };
    Ok(Some(StoredCell {
        label: label.is_valid(at).then(|| label.value(at)),
        points: whole("points")?.value(at),
        features: spec.features.iter().map(float).collect::<Result<_, CorpusError>>()?,
    }))
}
