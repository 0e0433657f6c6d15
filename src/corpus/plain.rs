//! A table that is no part of a corpus (results of a measurement) -> one Parquet file, its columns described as a corpus's are.

use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray};

use super::schema::{self, Column, Kind, Role};
use super::shard::ZSTD_LEVEL;
use super::write::TableWriter;
use super::{CorpusError, PARQUET_FORMAT};

/// A column's values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    Text(Vec<Option<String>>),
    Whole(Vec<Option<i64>>),
    Number(Vec<Option<f64>>),
    Flag(Vec<Option<bool>>),
}

/// A column with what it means; `unit` is SI, or "1".
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlainColumn {
    pub name: String,
    pub unit: &'static str,
    pub description: String,
    pub values: Values,
}

impl Values {
    fn kind(&self) -> Kind {
        match self {
            Values::Text(_) => Kind::String,
            Values::Whole(_) => Kind::Int64,
            Values::Number(_) => Kind::Float64,
            Values::Flag(_) => Kind::Bool,
        }
    }

    fn array(&self) -> ArrayRef {
        match self {
            Values::Text(values) => Arc::new(StringArray::from_iter(values)),
            Values::Whole(values) => Arc::new(Int64Array::from_iter(values)),
            Values::Number(values) => Arc::new(Float64Array::from_iter(values)),
            Values::Flag(values) => Arc::new(BooleanArray::from_iter(values)),
        }
    }
}

/// The bytes of a Parquet file. `name`: the table's, for messages and metadata; all columns have one value a row.
pub(crate) fn plain_table(name: &str, columns: &[PlainColumn]) -> Result<Vec<u8>, CorpusError> {
    let described: Vec<Column> = columns
        .iter()
        .map(|column| Column {
            name: column.name.clone(),
            kind: column.values.kind(),
            nullable: true,
            unit: column.unit.into(),
            role: Role::Info,
            description: column.description.clone(),
        })
        .collect();
    let arrow = schema::arrow_schema(&described);
    let parquet = |source| CorpusError::Parquet { name: name.into(), source };
    let key_values = [
        ("marsyard.columns", schema::columns_json(&described)),
        ("marsyard.format", PARQUET_FORMAT.to_string()),
        ("marsyard.table", name.to_string()),
    ];
    let arrays = columns.iter().map(|column| column.values.array()).collect();
    let batch = RecordBatch::try_new(arrow.clone(), arrays)
        .map_err(|source| CorpusError::Arrow { name: name.into(), source })?;
    let mut writer = TableWriter::new(&arrow, &described, &[], &key_values, ZSTD_LEVEL).map_err(parquet)?;
    writer.write(&batch).map_err(parquet)?;
    Ok(writer.finish().map_err(parquet)?.bytes)
}

#[cfg(test)]
mod tests {
    use arrow_array::Array;
    use arrow_array::cast::AsArray;
    use arrow_array::types::{Float64Type, Int64Type};
    use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

    use super::*;

    fn column(name: &str, unit: &'static str, values: Values) -> PlainColumn {
        PlainColumn { name: name.into(), unit, description: format!("About {name}."), values }
    }

    #[test]
    fn equal_values_written_and_read_back() {
        let columns = [
            column("name", "1", Values::Text(vec![Some("a".into()), None])),
            column("count", "1", Values::Whole(vec![None, Some(-7)])),
            column("range_m", "m", Values::Number(vec![Some(0.1), None])),
            column("good", "1", Values::Flag(vec![Some(true), Some(false)])),
        ];
        let bytes = plain_table("results", &columns).unwrap();
        let reader = ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(bytes)).unwrap();
        let unit = reader.schema().field_with_name("range_m").unwrap().metadata().get("unit").cloned();
        assert_eq!(unit.as_deref(), Some("m"));
        let batch = reader.build().unwrap().next().unwrap().unwrap();
        let text = batch.column(0).as_string::<i32>();
        assert!(text.value(0) == "a" && text.is_null(1));
        let count = batch.column(1).as_primitive::<Int64Type>();
        assert!(count.is_null(0) && count.value(1) == -7);
        let range = batch.column(2).as_primitive::<Float64Type>();
        assert!(range.value(0) == 0.1 && range.is_null(1));
        assert!(batch.column(3).as_boolean().value(0) && !batch.column(3).as_boolean().value(1));
    }

    #[test]
    fn extreme_columns_of_unequal_length_are_refused() {
        let columns = [column("a", "1", Values::Whole(vec![None])), column("b", "1", Values::Whole(vec![]))];
        assert!(plain_table("results", &columns).is_err());
    }
}
