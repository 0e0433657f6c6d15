//! One stored cell, found by its address: for comparing what is on disk with what a replay computes.

use arrow_array::Array;
use arrow_array::types::{Float32Type, Int8Type, Int32Type};

use super::manifest::FeatureSummary;
use super::reader::column;
use super::{CorpusError, Finished, Table};
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
    corpus: &Finished,
    scene: u64,
    scan: u32,
    cell: CellIndex,
) -> Result<Option<StoredCell>, CorpusError> {
    let Some(line) = corpus.lines.iter().find(|line| (line.scenes[0]..line.scenes[1]).contains(&scene)) else {
        return Ok(None);
    };
    let opened =
        corpus.open_table(line, Table::Cells).map_err(|refused| corpus.refused(line, Table::Cells, refused))?;
    let Some(file) = opened else { return Ok(None) };
    let batch = file.rows_of_scene(scene)?;
    let odd = |reason: String| file.odd(reason);
    let whole = |name: &str| column::<Int32Type>(&batch, name).map_err(odd);
    let wanted = [(whole("scan_id")?, scan as i32), (whole("row")?, cell.row), (whole("col")?, cell.col)];
    let is_it = |at: usize| wanted.iter().all(|(column, value)| column.value(at) == *value);
    let Some(at) = (0..batch.num_rows()).find(|&at| is_it(at)) else { return Ok(None) };
    let label = column::<Int8Type>(&batch, "label").map_err(odd)?;
    let float = |feature: &FeatureSummary| {
        let values = column::<Float32Type>(&batch, &feature.name).map_err(odd)?;
        Ok((feature.name.clone(), values.value(at)))
    };
    Ok(Some(StoredCell {
        label: label.is_valid(at).then(|| label.value(at)),
        points: whole("points")?.value(at),
        features: corpus.manifest.features.iter().map(float).collect::<Result<_, CorpusError>>()?,
    }))
}
