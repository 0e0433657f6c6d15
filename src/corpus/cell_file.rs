//! Cells that a model judged -> one Parquet file with the columns of a corpus's `cells`, and the judgement behind them.

use std::sync::Arc;

use arrow_array::{ArrayRef, Float32Array, Int8Array};

use super::schema::{self, Column, Kind, Role};
use super::shard::ZSTD_LEVEL;
use super::write::TableWriter;
use super::{CorpusError, PARQUET_FORMAT, Table, tables};
use crate::cells::{Cells, FeatureColumn};

/// One scan's cells, and per cell the output, the probability of being untraversable and the class, `None` where it was not judged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellOutputs<'a> {
    pub scan_id: u32,
    pub cells: &'a Cells,
    pub outputs: &'a [Option<f64>],
    pub probabilities: &'a [Option<f64>],
    pub classes: &'a [Option<usize>],
}

/// The bytes of a Parquet file; `scene_id` is 0, scans ascend. `name`: the file's, for messages.
pub(crate) fn judged_cells(
    name: &str,
    features: &[FeatureColumn],
    scans: &[CellOutputs],
) -> Result<Vec<u8>, CorpusError> {
    let mut columns = schema::columns(Table::Cells, features, &[], &[], &[], [false; 3]);
    let judgement = |name: &str, kind, description: &str| Column {
        name: name.into(),
        kind,
        nullable: true,
        unit: "1".into(),
        role: Role::Info,
        description: description.into(),
    };
    columns.push(judgement(
        "output",
        Kind::Float32,
        "Output of the model: low is traversable; null where the cell was not judged.",
    ));
    columns.push(judgement(
        "probability",
        Kind::Float32,
        "Probability that the cell is untraversable, as cells occur on the model's validation scenes; null where the cell was not judged, or \
         the model has no calibration.",
    ));
    columns.push(judgement(
        "class",
        Kind::Int8,
        "Class by the model's thresholds, 0 the most traversable; null where the cell was not judged.",
    ));
    let arrow = schema::arrow_schema(&columns);
    let parquet = |source| CorpusError::Parquet { name: name.into(), source };
    let key_values = [
        ("marsyard.columns", schema::columns_json(&columns)),
        ("marsyard.format", PARQUET_FORMAT.to_string()),
        ("marsyard.table", Table::Cells.name().to_string()),
    ];
    let sorted_by = schema::sort_keys(Table::Cells);
    let mut writer = TableWriter::new(&arrow, &columns, sorted_by, &key_values, ZSTD_LEVEL).map_err(parquet)?;
    for scan in scans {
        let row = |cell| tables::cells::Row { scene_id: 0, scan_id: scan.scan_id as i32, cell };
        let rows: Vec<_> = scan.cells.rows.iter().map(row).collect();
        let single = |values: &[Option<f64>]| -> ArrayRef {
            Arc::new(values.iter().map(|value| value.map(|value| value as f32)).collect::<Float32Array>())
        };
        let judgement: [ArrayRef; 3] = [
            single(scan.outputs),
            single(scan.probabilities),
            Arc::new(scan.classes.iter().map(|class| class.map(|value| value as i8)).collect::<Int8Array>()),
        ];
        let more = tables::features(scan.cells, features.len()).chain(judgement);
        let batch = tables::batch(&arrow, &tables::cells::definitions(false, false), &rows, more)
            .map_err(|source| CorpusError::Arrow { name: name.into(), source })?;
        writer.write(&batch).map_err(parquet)?;
    }
    Ok(writer.finish().map_err(parquet)?.bytes)
}
