//! What stands in a corpus at an address: one cell, for comparing with what a replay computes; the family of each scene of a shard.

use std::collections::BTreeMap;

use arrow_array::types::Int64Type;
use arrow_array::{Array, StringArray};

use super::cells::{CellBatch, KEYS, TRUTH};
use super::checked::Refused;
use super::reader::{TableFile, column};
use super::{CorpusError, Finished, Table};
use crate::cells::CellRow;
use crate::geometry::CellIndex;

/// A row of `cells` as it is stored.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredCell {
    pub row: CellRow,
    /// In the order of the columns.
    pub features: Vec<f32>,
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
    let names = corpus.manifest.features.iter().map(|feature| feature.name.as_str());
    find(&CellBatch::of(batch), scan, cell, names).map_err(|reason| file.odd(reason))
}

/// A row by its address within a scene.
fn find<'n>(
    cells: &CellBatch,
    scan: u32,
    index: CellIndex,
    features: impl Iterator<Item = &'n str>,
) -> Result<Option<StoredCell>, String> {
    let keys = cells.keys()?;
    let is_it = |&at: &usize| keys.scans[at] == scan as i32 && keys.index(at) == index;
    let Some(at) = (0..cells.rows()).find(is_it) else { return Ok(None) };
    let row = CellRow {
        index,
        label: cells.labels()?.at(at),
        points: cells.points()?[at],
        range_m: cells.ranges_m()?[at],
        neighbour_mask: cells.neighbour_masks()?[at],
        truth: cells.truth(&TRUTH)?.at(at),
    };
    Ok(Some(StoredCell { row, features: cells.features(features)?.row(at).collect() }))
}

/// Family by scene, from a file of `scenes`.
pub(crate) fn families_of_scenes(file: &TableFile) -> Result<BTreeMap<i64, String>, Refused> {
    let absent = || Refused::Other("it has no columns 'scene_id' and 'family' of whole numbers and text".into());
    let wanted = [KEYS[0], "family"];
    if wanted.iter().any(|name| file.schema().field_with_name(name).is_err()) {
        return Err(absent());
    }
    let mut families = BTreeMap::new();
    for group in 0..file.row_groups().len() {
        let batch = file.read_row_group(group, Some(&wanted))?;
        let ids = column::<Int64Type>(&batch, wanted[0]).map_err(|_| absent())?;
        let names = batch.column_by_name(wanted[1]).and_then(|c| c.as_any().downcast_ref::<StringArray>());
        let names = names.ok_or_else(absent)?.iter().map(|name| name.unwrap_or("").to_string());
        families.extend(ids.values().iter().copied().zip(names));
    }
    Ok(families)
}
