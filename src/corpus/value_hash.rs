//! Arrow values -> a hash that outlives a change of compression, encoding, row groups or Parquet writer.
//!
//! Per column two BLAKE3 streams: validity (one byte a row, nullable columns only) and values (little-endian; text as
//! length and bytes; a null's value is left out). The table's hash covers, column by column, name, type and both streams.
//! Batches may be cut anywhere.

use arrow_array::{
    Array, BooleanArray, Float32Array, Float64Array, Int8Array, Int32Array, Int64Array, RecordBatch, StringArray,
};
use arrow_schema::{DataType, Schema};

use super::hex;
use super::tables::{canonical_f32, canonical_f64};

/// A table's hash in the making.
pub(crate) struct ValueHasher {
    columns: Vec<ColumnHasher>,
    rows: u64,
}

struct ColumnHasher {
    head: String,
    validity: Option<Stream>,
    values: Stream,
}

/// Bytes that come bit by bit, hashed by whole blocks: BLAKE3 hashes sixteen chunks of 1 KiB side by side.
#[derive(Default)]
struct Stream {
    hasher: blake3::Hasher,
    pending: Vec<u8>,
}

const BLOCK_BYTES: usize = 16 << 10;

impl Stream {
    /// Takes whole blocks from what waits.
    fn hash_blocks(&mut self) {
        let whole = self.pending.len() / BLOCK_BYTES * BLOCK_BYTES;
        self.hasher.update(&self.pending[..whole]);
        self.pending.drain(..whole);
    }

    fn finish(mut self) -> blake3::Hash {
        self.hasher.update(&self.pending);
        self.hasher.finalize()
    }
}

impl ValueHasher {
    pub(super) fn new(schema: &Schema) -> ValueHasher {
        let columns = schema
            .fields()
            .iter()
            .map(|field| ColumnHasher {
                head: format!("{}\0{}\0{}\0", field.name(), field.data_type(), field.is_nullable()),
                validity: field.is_nullable().then(Stream::default),
                values: Stream::default(),
            })
            .collect();
        ValueHasher { columns, rows: 0 }
    }

    /// The next rows; their columns are those of the schema.
    pub(super) fn update(&mut self, batch: &RecordBatch) {
        self.rows += batch.num_rows() as u64;
        for (column, array) in self.columns.iter_mut().zip(batch.columns()) {
            if let Some(validity) = &mut column.validity {
                match array.nulls() {
                    Some(nulls) => validity.pending.extend(nulls.iter().map(u8::from)),
                    None => validity.pending.resize(validity.pending.len() + array.len(), 1),
                }
                validity.hash_blocks();
            }
            append_values(array.as_ref(), &mut column.values.pending);
            column.values.hash_blocks();
        }
    }

    /// 64 hexadecimal digits.
    pub(super) fn finish(self) -> String {
        let mut hasher = blake3::Hasher::new_derive_key("marsyard 1 value hash");
        hasher.update(&self.rows.to_le_bytes());
        for column in self.columns {
            hasher.update(column.head.as_bytes());
            if let Some(validity) = column.validity {
                hasher.update(validity.finish().as_bytes());
            }
            hasher.update(column.values.finish().as_bytes());
        }
        hex(hasher.finalize().as_bytes())
    }
}

/// Values of a fixed size, one after the other; nulls are left out.
macro_rules! append {
    ($array:expr, $out:expr, $type:ty, $bytes:expr) => {
        if let Some(array) = $array.as_any().downcast_ref::<$type>() {
            let mut append = |values: &[_]| {
                let from = $out.len();
                $out.resize(from + size_of_val(values), 0);
                for (bytes, &value) in $out[from..].as_chunks_mut().0.iter_mut().zip(values) {
                    *bytes = $bytes(value);
                }
            };
            match array.nulls() {
                Some(nulls) => nulls.valid_slices().for_each(|(from, to)| append(&array.values()[from..to])),
                None => append(array.values()),
            }
            return;
        }
    };
}

fn append_values(array: &dyn Array, out: &mut Vec<u8>) {
    append!(array, out, Float32Array, |v| canonical_f32(v).to_le_bytes());
    append!(array, out, Float64Array, |v| canonical_f64(v).to_le_bytes());
    append!(array, out, Int8Array, i8::to_le_bytes);
    append!(array, out, Int32Array, i32::to_le_bytes);
    append!(array, out, Int64Array, i64::to_le_bytes);
    if let Some(array) = array.as_any().downcast_ref::<BooleanArray>() {
        out.extend(array.iter().flatten().map(u8::from));
        return;
    }
    if let Some(array) = array.as_any().downcast_ref::<StringArray>() {
        for value in array.iter().flatten() {
            out.extend_from_slice(&(value.len() as u64).to_le_bytes());
            out.extend_from_slice(value.as_bytes());
        }
        return;
    }
    debug_assert!(matches!(array.data_type(), DataType::Null), "no table has a column of type {}", array.data_type());
}

/// The identity of a corpus: a hash over the sorted value hashes of its files.
pub(super) fn corpus_id<'a>(value_hashes: impl IntoIterator<Item = &'a str>) -> String {
    let mut hashes: Vec<&str> = value_hashes.into_iter().collect();
    hashes.sort_unstable();
    let mut hasher = blake3::Hasher::new_derive_key("marsyard 1 corpus id");
    for hash in hashes {
        hasher.update(hash.as_bytes());
        hasher.update(b"\n");
    }
    hex(hasher.finalize().as_bytes())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_schema::Field;

    use super::*;

    fn batch(numbers: Vec<Option<i32>>, values: Vec<f64>, texts: Vec<&str>) -> RecordBatch {
        let schema = Schema::new(vec![
            Field::new("n", DataType::Int32, true),
            Field::new("x", DataType::Float64, false),
            Field::new("t", DataType::Utf8, false),
        ]);
        let columns: Vec<Arc<dyn Array>> = vec![
            Arc::new(Int32Array::from(numbers)),
            Arc::new(Float64Array::from(values)),
            Arc::new(StringArray::from(texts)),
        ];
        RecordBatch::try_new(Arc::new(schema), columns).unwrap()
    }

    fn hash(batches: &[RecordBatch]) -> String {
        let mut hasher = ValueHasher::new(&batches[0].schema());
        batches.iter().for_each(|b| hasher.update(b));
        hasher.finish()
    }

    #[test]
    fn law_the_hash_does_not_see_how_batches_are_cut() {
        let whole = batch(vec![Some(1), None, Some(3)], vec![0.5, 1.5, 2.5], vec!["a", "", "c"]);
        assert_eq!(hash(std::slice::from_ref(&whole)), hash(&[whole.slice(0, 1), whole.slice(1, 2)]));
    }

    #[test]
    fn law_every_change_of_a_value_changes_the_hash() {
        let base = batch(vec![Some(1), None], vec![0.5, 1.5], vec!["ab", "c"]);
        let others = [
            batch(vec![None, Some(1)], vec![0.5, 1.5], vec!["ab", "c"]),
            batch(vec![Some(1), Some(0)], vec![0.5, 1.5], vec!["ab", "c"]),
            batch(vec![Some(1), None], vec![0.5, 1.5f64.next_up()], vec!["ab", "c"]),
            batch(vec![Some(1), None], vec![0.5, 1.5], vec!["a", "bc"]),
            batch(vec![Some(1)], vec![0.5], vec!["ab"]),
        ];
        for other in others {
            assert_ne!(hash(std::slice::from_ref(&base)), hash(&[other]));
        }
    }

    #[test]
    fn extreme_zero_signs_and_nan_payloads_do_not_count() {
        let a = batch(vec![None, None], vec![0.0, f64::NAN], vec!["", ""]);
        let b = batch(vec![None, None], vec![-0.0, f64::from_bits(0xfff8_0000_0000_1234)], vec!["", ""]);
        assert_eq!(hash(&[a]), hash(&[b]));
    }

    #[test]
    fn law_corpus_id_does_not_depend_on_order() {
        assert_eq!(corpus_id(["a", "b", "c"]), corpus_id(["c", "a", "b"]));
        assert_ne!(corpus_id(["a", "b"]), corpus_id(["ab"]));
    }
}
