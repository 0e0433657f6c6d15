//! A shard built again -> where it differs from the one in the corpus.
//!
//! A corpus is what its plan says: whoever builds a shard anew must get its bytes. Where the bytes differ, the tables' values are
//! compared, and the first row and column that differ are named. Equal values in other bytes (another compression level, say) are
//! told apart from other values.

use std::fmt;

use arrow_array::cast::AsArray;
use arrow_array::{Array, RecordBatch};
use arrow_schema::DataType;

use super::reader::TableFile;
use super::receipt::Receipt;
use super::shard::FinishedShard;
use super::spec::CorpusSpec;
use super::verify::Finding;
use super::{Build, CorpusError, LocalFolder, Store};

/// Compares a shard in the corpus with the same shard built again; empty where every byte is equal.
pub(crate) fn compare(store: &dyn Store, spec: &CorpusSpec, again: FinishedShard) -> Result<Vec<Finding>, CorpusError> {
    let FinishedShard { receipt: here, files } = again;
    let shard = here.shard;
    let (there, _) = Receipt::read_of(store, spec, shard)?;
    let mut findings = Vec::new();
    let mut find = |name: &str, what: String| findings.push(Finding::in_shard(shard, name, what));
    for (name, bytes) in &files {
        if store.size(name)?.is_none() {
            find(name, "is missing".into());
        } else if store.read(name)? != *bytes {
            find(name, difference(store, name, bytes)? + &other_program(&there.build, &here.build));
        }
    }
    if (Receipt { format: there.format, build: there.build.clone(), ..here }) != there {
        find(&Receipt::path(shard), "is not the receipt of the shard built again".into());
    }
    Ok(findings)
}

/// What differs, for two files whose bytes do.
fn difference(store: &dyn Store, name: &str, bytes: &[u8]) -> Result<String, CorpusError> {
    let failed = |source| CorpusError::Io { place: "the temporary folder".into(), name: name.into(), source };
    let folder = tempfile::tempdir().map_err(failed)?;
    let again = LocalFolder::new(folder.path());
    again.put(name, bytes)?;
    let there = match TableFile::open(store, name) {
        Ok(file) => file,
        Err(error) => return Ok(error.to_string()),
    };
    Ok(match first_difference(&there, &TableFile::open(&again, name)?) {
        Ok(Some(first)) => first.to_string(),
        Ok(None) => "its values are those built again, its bytes are others".into(),
        Err(error) => error.to_string(),
    })
}

fn other_program(there: &Build, here: &Build) -> String {
    if there == here {
        return String::new();
    }
    format!("; the corpus is by marsyard {there}, this is {here}")
}

/// The first place at which two versions of a table differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FirstDifference {
    pub row: u64,
    /// Empty where one table ends before the other.
    pub column: String,
    pub there: String,
    pub here: String,
}

impl fmt::Display for FirstDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "row {}, column {}: {} in the corpus, {} when built again",
            self.row, self.column, self.there, self.here
        )
    }
}

/// Compares a table in the corpus with the same table built again; `None` where all values are equal.
pub(crate) fn first_difference(there: &TableFile, here: &TableFile) -> Result<Option<FirstDifference>, CorpusError> {
    let read = |file: &TableFile| -> Result<RecordBatch, CorpusError> {
        let batches = file.batches().collect::<Result<Vec<_>, _>>()?;
        arrow_select::concat::concat_batches(file.schema(), &batches)
            .map_err(|source| CorpusError::Arrow { name: file.name().into(), source })
    };
    let (there, here) = (read(there)?, read(here)?);
    let names = |batch: &RecordBatch| batch.schema().fields().iter().map(|f| f.name().clone()).collect::<Vec<_>>();
    if names(&there) != names(&here) {
        let (there, here) = (names(&there).join(" "), names(&here).join(" "));
        return Ok(Some(FirstDifference { row: 0, column: "names".into(), there, here }));
    }
    let rows = there.num_rows().min(here.num_rows());
    let differs = |k: usize| first_row(there.column(k).as_ref(), here.column(k).as_ref(), rows).map(|row| (row, k));
    let first = (0..there.num_columns()).filter_map(differs).min();
    let text = |batch: &RecordBatch, row: usize, k: usize| value_text(batch.column(k), row);
    Ok(match first {
        Some((row, k)) => Some(FirstDifference {
            row: row as u64,
            column: there.schema().field(k).name().clone(),
            there: text(&there, row, k),
            here: text(&here, row, k),
        }),
        None if there.num_rows() != here.num_rows() => Some(FirstDifference {
            row: rows as u64,
            column: "(number of rows)".into(),
            there: format!("{} rows", there.num_rows()),
            here: format!("{} rows", here.num_rows()),
        }),
        None => None,
    })
}

/// A value of a table as people read it.
fn value_text(column: &dyn Array, row: usize) -> String {
    use arrow_array::types::{Float32Type, Float64Type, Int8Type, Int32Type, Int64Type};
    if column.is_null(row) {
        return "null".into();
    }
    match column.data_type() {
        DataType::Boolean => column.as_boolean().value(row).to_string(),
        DataType::Int8 => column.as_primitive::<Int8Type>().value(row).to_string(),
        DataType::Int32 => column.as_primitive::<Int32Type>().value(row).to_string(),
        DataType::Int64 => column.as_primitive::<Int64Type>().value(row).to_string(),
        DataType::Float32 => column.as_primitive::<Float32Type>().value(row).to_string(),
        DataType::Float64 => column.as_primitive::<Float64Type>().value(row).to_string(),
        DataType::Utf8 => column.as_string::<i32>().value(row).to_string(),
        other => format!("a value of type {other}"),
    }
}

/// The first of `rows` rows in which two columns differ: found by halving, since slices compare fast.
fn first_row(a: &dyn Array, b: &dyn Array, rows: usize) -> Option<usize> {
    let same = |from: usize, length: usize| a.slice(from, length).to_data() == b.slice(from, length).to_data();
    if same(0, rows) {
        return None;
    }
    let (mut from, mut length) = (0, rows);
    while length > 1 {
        let half = length / 2;
        if same(from, half) {
            from += half;
            length -= half;
        } else {
            length = half;
        }
    }
    Some(from)
}
