//! The fixed columns of each table: what a column says of itself, beside the code that takes its value from a row.

pub(super) mod cells;
pub(crate) mod points;
pub(crate) mod poses;
pub(crate) mod scenes;

use std::sync::Arc;

use arrow_array::types::{Float32Type, Float64Type, Int8Type, Int32Type, Int64Type};
use arrow_array::{ArrayRef, ArrowPrimitiveType, BooleanArray, PrimitiveArray, RecordBatch, StringArray};
use arrow_buffer::ArrowNativeType;
use arrow_buffer::{BooleanBuffer, NullBuffer};
use arrow_schema::ArrowError;
use arrow_schema::SchemaRef;

use super::schema::{Column, Kind, Role};
use crate::cells::Cells;

/// How a column is taken from rows: all of it at one call, so that the way to a value is compiled into a loop of its own.
pub(crate) struct Extract<R> {
    kind: Kind,
    nullable: bool,
    column: ExtractColumn<R>,
}

/// Rows -> a column of them.
type ExtractColumn<R> = Box<dyn Fn(&[R]) -> ArrayRef>;

/// A number that a column may hold.
pub(crate) trait ColumnValue: ArrowNativeType {
    type Arrow: ArrowPrimitiveType<Native = Self>;
    const KIND: Kind;
    /// Equal values in equal bytes.
    fn canonical(self) -> Self;
}

macro_rules! number {
    ($($native:ty, $arrow:ty, $kind:expr, $canonical:expr;)*) => {$(
        impl ColumnValue for $native {
            type Arrow = $arrow;
            const KIND: Kind = $kind;
            fn canonical(self) -> Self {
                $canonical(self)
            }
        }
    )*};
}
number! {
    i64, Int64Type, Kind::Int64, |v| v;
    i32, Int32Type, Kind::Int32, |v| v;
    i8, Int8Type, Kind::Int8, |v| v;
    f32, Float32Type, Kind::Float32, canonical_f32;
    f64, Float64Type, Kind::Float64, canonical_f64;
}

/// A column and the way to its values.
pub(crate) struct Definition<R> {
    name: &'static str,
    unit: &'static str,
    role: Role,
    description: &'static str,
    take: Extract<R>,
}

fn define<R>(
    name: &'static str,
    unit: &'static str,
    role: Role,
    description: &'static str,
    take: Extract<R>,
) -> Definition<R> {
    Definition { name, unit, role, description, take }
}

impl<R> Extract<R> {
    pub(super) fn number<N: ColumnValue>(take: impl Fn(&R) -> N + 'static) -> Extract<R> {
        Extract::column(N::KIND, false, move |rows| {
            let values: Vec<N> = rows.iter().map(|row| take(row).canonical()).collect();
            Arc::new(PrimitiveArray::<N::Arrow>::new(values.into(), None))
        })
    }

    pub(crate) fn number_or_null<N: ColumnValue>(take: impl Fn(&R) -> Option<N> + 'static) -> Extract<R> {
        Extract::column(N::KIND, true, move |rows| {
            let values: Vec<N> = rows.iter().map(|row| take(row).unwrap_or_default().canonical()).collect();
            let valid = BooleanBuffer::collect_bool(rows.len(), |i| take(&rows[i]).is_some());
            let nulls = Some(NullBuffer::new(valid)).filter(|nulls| nulls.null_count() > 0);
            Arc::new(PrimitiveArray::<N::Arrow>::new(values.into(), nulls))
        })
    }

    pub(super) fn flag(take: impl Fn(&R) -> bool + 'static) -> Extract<R> {
        Extract::column(Kind::Bool, false, move |rows| {
            Arc::new(BooleanArray::from(BooleanBuffer::collect_bool(rows.len(), |i| take(&rows[i]))))
        })
    }

    pub(super) fn text(take: impl Fn(&R) -> &str + 'static) -> Extract<R> {
        Extract::column(Kind::String, false, move |rows| {
            Arc::new(StringArray::from_iter_values(rows.iter().map(&take)))
        })
    }

    pub(crate) fn text_or_null(take: impl Fn(&R) -> Option<&str> + 'static) -> Extract<R> {
        Extract::column(Kind::String, true, move |rows| Arc::new(rows.iter().map(&take).collect::<StringArray>()))
    }

    fn column(kind: Kind, nullable: bool, column: impl Fn(&[R]) -> ArrayRef + 'static) -> Extract<R> {
        Extract { kind, nullable, column: Box::new(column) }
    }
}

/// What the definitions say of their columns.
pub(super) fn columns<R>(definitions: &[Definition<R>]) -> Vec<Column> {
    definitions
        .iter()
        .map(|definition| {
            let Extract { kind, nullable, .. } = definition.take;
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
pub(super) fn batch<R>(
    schema: &SchemaRef,
    definitions: &[Definition<R>],
    rows: &[R],
    more: impl IntoIterator<Item = ArrayRef>,
) -> Result<RecordBatch, ArrowError> {
    let arrays = definitions.iter().map(|definition| (definition.take.column)(rows)).chain(more).collect();
    RecordBatch::try_new(schema.clone(), arrays)
}

/// Rows that are turned into columns together.
const BLOCK_ROWS: usize = 64;

/// The features of a scan's cells as Arrow columns.
pub(super) fn features(cells: &Cells, columns: usize) -> impl Iterator<Item = ArrayRef> + use<> {
    let mut values = vec![vec![0.0f32; cells.rows.len()]; columns];
    // Some rows into all columns at a time: a block stays in the nearest cache while each column is picked from it.
    for (block, rows) in cells.features.chunks(BLOCK_ROWS * columns.max(1)).enumerate() {
        for (k, column) in values.iter_mut().enumerate() {
            let places = column[block * BLOCK_ROWS..].iter_mut();
            places.zip(rows[k..].iter().step_by(columns)).for_each(|(place, &value)| *place = canonical_f32(value));
        }
    }
    values.into_iter().map(|column| Arc::new(PrimitiveArray::<Float32Type>::from(column)) as ArrayRef)
}

/// One bit pattern for every NaN, and no negative zero: equal values are equal bytes.
pub(crate) fn canonical_f64(value: f64) -> f64 {
    if value.is_nan() { f64::from_bits(0x7ff8_0000_0000_0000) } else { value + 0.0 }
}

/// As [`canonical_f64`].
pub(crate) fn canonical_f32(value: f32) -> f32 {
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
