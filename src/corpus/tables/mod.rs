//! The fixed columns of each table: what a column says of itself, beside the code that takes its value from a row.

pub mod cells;
pub mod points;
pub mod poses;
pub mod scenes;

use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, Int8Array, Int32Array, Int64Array, RecordBatch, StringArray,
};
use arrow::datatypes::SchemaRef;
use arrow::error::ArrowError;

use super::schema::{Column, Kind, Role};
use crate::cells::Cells;

/// How a column's value is taken from a row.
pub enum Take<R> {
    I64(fn(&R) -> i64),
    I32(fn(&R) -> i32),
    I32OrNull(fn(&R) -> Option<i32>),
    I8(fn(&R) -> i8),
    I8OrNull(fn(&R) -> Option<i8>),
    F32(fn(&R) -> f32),
    F32OrNull(fn(&R) -> Option<f32>),
    F64(fn(&R) -> f64),
    F64OrNull(fn(&R) -> Option<f64>),
    Bool(fn(&R) -> bool),
    Text(fn(&R) -> &str),
    TextOrNull(fn(&R) -> Option<&str>),
}

/// A column and the way to its values.
pub struct Definition<R> {
    name: &'static str,
    unit: &'static str,
    role: Role,
    description: &'static str,
    take: Take<R>,
}

fn define<R>(
    name: &'static str,
    unit: &'static str,
    role: Role,
    description: &'static str,
    take: Take<R>,
) -> Definition<R> {
    Definition { name, unit, role, description, take }
}

impl<R> Take<R> {
    fn kind(&self) -> (Kind, bool) {
        match self {
            Take::I64(_) => (Kind::Int64, false),
            Take::I32(_) => (Kind::Int32, false),
            Take::I32OrNull(_) => (Kind::Int32, true),
            Take::I8(_) => (Kind::Int8, false),
            Take::I8OrNull(_) => (Kind::Int8, true),
            Take::F32(_) => (Kind::Float32, false),
            Take::F32OrNull(_) => (Kind::Float32, true),
            Take::F64(_) => (Kind::Float64, false),
            Take::F64OrNull(_) => (Kind::Float64, true),
            Take::Bool(_) => (Kind::Bool, false),
            Take::Text(_) => (Kind::String, false),
            Take::TextOrNull(_) => (Kind::String, true),
        }
    }

    fn array(&self, rows: &[R]) -> ArrayRef {
        match self {
            Take::I64(take) => Arc::new(Int64Array::from_iter_values(rows.iter().map(take))),
            Take::I32(take) => Arc::new(Int32Array::from_iter_values(rows.iter().map(take))),
            Take::I32OrNull(take) => Arc::new(Int32Array::from_iter(rows.iter().map(take))),
            Take::I8(take) => Arc::new(Int8Array::from_iter_values(rows.iter().map(take))),
            Take::I8OrNull(take) => Arc::new(Int8Array::from_iter(rows.iter().map(take))),
            Take::F32(take) => Arc::new(Float32Array::from_iter_values(rows.iter().map(|r| canonical_f32(take(r))))),
            Take::F32OrNull(take) => Arc::new(Float32Array::from_iter(rows.iter().map(|r| take(r).map(canonical_f32)))),
            Take::F64(take) => Arc::new(Float64Array::from_iter_values(rows.iter().map(|r| canonical_f64(take(r))))),
            Take::F64OrNull(take) => Arc::new(Float64Array::from_iter(rows.iter().map(|r| take(r).map(canonical_f64)))),
            Take::Bool(take) => Arc::new(BooleanArray::from_iter(rows.iter().map(|r| Some(take(r))))),
            Take::Text(take) => Arc::new(StringArray::from_iter_values(rows.iter().map(take))),
            Take::TextOrNull(take) => Arc::new(StringArray::from_iter(rows.iter().map(|r| take(r)))),
        }
    }
}

/// What the definitions say of their columns.
pub fn columns<R>(definitions: &[Definition<R>]) -> Vec<Column> {
    definitions
        .iter()
        .map(|definition| {
            let (kind, nullable) = definition.take.kind();
            Column {
                name: definition.name.into(),
                kind,
                nullable,
                unit: definition.unit.into(),
                role: definition.role,
                description: definition.description.into(),
            }
        })
        .collect()
}

/// Rows as Arrow columns, with further columns after the defined ones.
pub fn batch<R>(
    schema: &SchemaRef,
    definitions: &[Definition<R>],
    rows: &[R],
    more: impl IntoIterator<Item = ArrayRef>,
) -> Result<RecordBatch, ArrowError> {
    let arrays = definitions.iter().map(|definition| definition.take.array(rows)).chain(more).collect();
    RecordBatch::try_new(schema.clone(), arrays)
}

/// The features of a scan's cells as Arrow columns.
pub fn features(cells: &Cells, columns: usize) -> impl Iterator<Item = ArrayRef> + use<> {
    // Row by row into all columns: each value is looked at once, where it lies.
    let rows = cells.features.chunks_exact(columns.max(1));
    let mut values = vec![Vec::with_capacity(rows.len()); columns];
    for row in rows {
        values.iter_mut().zip(row).for_each(|(column, &value)| column.push(canonical_f32(value)));
    }
    values.into_iter().map(|column| Arc::new(Float32Array::from(column)) as ArrayRef)
}

/// One bit pattern for every NaN, and no negative zero: equal values are equal bytes.
pub fn canonical_f64(value: f64) -> f64 {
    if value.is_nan() { f64::from_bits(0x7ff8_0000_0000_0000) } else { value + 0.0 }
}

/// As [`canonical_f64`].
pub fn canonical_f32(value: f32) -> f32 {
    if value.is_nan() { f32::from_bits(0x7fc0_0000) } else { value + 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extreme_nan_payloads_and_negative_zeros_become_one_pattern() {
        for bits in [0x7ff8_0000_0000_0000u64, 0xfff8_0000_0000_0000, 0x7ff0_0000_0000_0001, 0xffff_ffff_ffff_ffff] {
            assert_eq!(canonical_f64(f64::from_bits(bits)).to_bits(), 0x7ff8_0000_0000_0000);
        }
        for bits in [0x7fc0_0000u32, 0xffc0_0001, 0x7f80_0001] {
            assert_eq!(canonical_f32(f32::from_bits(bits)).to_bits(), 0x7fc0_0000);
        }
        assert_eq!(canonical_f64(-0.0).to_bits(), 0);
        assert_eq!(canonical_f32(-0.0).to_bits(), 0);
        for value in [f64::MIN_POSITIVE / 8.0, -1e308, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(canonical_f64(value).to_bits(), value.to_bits());
        }
    }
}
