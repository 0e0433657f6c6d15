//! Record batches -> the bytes of one Parquet file, the same bytes every time.
//!
//! Everything that parquet-rs would choose by itself and might choose otherwise tomorrow is set here; the crates' versions
//! are pinned by Cargo.lock, and a change of either is a change of [`PARQUET_FORMAT`](super::PARQUET_FORMAT). A batch is a whole scan (or scene), written
//! at once and never cut by a row group.

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, SortingColumn};
use parquet::file::properties::{BloomFilterPosition, EnabledStatistics, WriterProperties, WriterVersion};
use parquet::schema::types::ColumnPath;

use super::schema::{Column, Kind};
use super::value_hash::ValueHasher;
use super::{PARQUET_FORMAT, sha256};

/// Rows that a row group holds unless a single scan holds more: readers take one group per task.
pub(crate) const ROW_GROUP_ROWS: usize = 131_072;

/// A finished file and what the receipt says of it.
pub(crate) struct FinishedFile {
    pub bytes: Vec<u8>,
    pub rows: u64,
    pub row_groups: u32,
    pub sha256: String,
    pub value_hash: String,
}

/// One table of one shard in the making.
pub(crate) struct TableWriter {
    writer: ArrowWriter<Vec<u8>>,
    hasher: ValueHasher,
    rows: u64,
    rows_in_group: usize,
}

impl TableWriter {
    pub(super) fn new(
        schema: &SchemaRef,
        columns: &[Column],
        sorted_by: &[&str],
        key_values: &[(&str, String)],
        zstd_level: i32,
    ) -> Result<TableWriter, ParquetError> {
        let properties = properties(columns, sorted_by, key_values, zstd_level)?;
        let writer = ArrowWriter::try_new(Vec::new(), schema.clone(), Some(properties))?;
        Ok(TableWriter { writer, hasher: ValueHasher::new(schema), rows: 0, rows_in_group: 0 })
    }

    /// Writes a scan's (or scene's) rows; they share a row group.
    pub(super) fn write(&mut self, batch: &RecordBatch) -> Result<(), ParquetError> {
        if batch.num_rows() == 0 {
            return Ok(());
        }
        if self.rows_in_group > 0 && self.rows_in_group + batch.num_rows() > ROW_GROUP_ROWS {
            self.writer.flush()?;
            self.rows_in_group = 0;
        }
        self.writer.write(batch)?;
        self.hasher.update(batch);
        self.rows_in_group += batch.num_rows();
        self.rows += batch.num_rows() as u64;
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<FinishedFile, ParquetError> {
        self.writer.flush()?;
        let row_groups = self.writer.flushed_row_groups().len() as u32;
        let bytes = self.writer.into_inner()?;
        Ok(FinishedFile {
            rows: self.rows,
            row_groups,
            sha256: sha256(&bytes),
            value_hash: self.hasher.finish(),
            bytes,
        })
    }
}

fn properties(
    columns: &[Column],
    sorted_by: &[&str],
    key_values: &[(&str, String)],
    zstd_level: i32,
) -> Result<WriterProperties, ParquetError> {
    let mut key_values: Vec<KeyValue> =
        key_values.iter().map(|(key, value)| KeyValue::new((*key).to_string(), value.clone())).collect();
    key_values.sort_by(|a, b| a.key.cmp(&b.key));
    let sorting = sorted_by
        .iter()
        .filter_map(|key| columns.iter().position(|column| column.name == *key))
        .map(|index| SortingColumn { column_idx: index as i32, descending: false, nulls_first: false })
        .collect();
    let mut builder = WriterProperties::builder()
        .set_created_by(format!("marsyard {PARQUET_FORMAT}"))
        .set_writer_version(WriterVersion::PARQUET_1_0)
        .set_key_value_metadata(Some(key_values))
        .set_sorting_columns(Some(sorting))
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(zstd_level)?))
        // Groups are cut by `write`, between scans.
        .set_max_row_group_row_count(None)
        .set_max_row_group_bytes(None)
        .set_write_batch_size(1024)
        .set_data_page_row_count_limit(20_000)
        .set_data_page_size_limit(1 << 20)
        .set_dictionary_page_size_limit(1 << 20)
        .set_dictionary_enabled(true)
        .set_statistics_enabled(EnabledStatistics::Page)
        .set_statistics_truncate_length(Some(64))
        .set_column_index_truncate_length(Some(64))
        .set_write_page_header_statistics(false)
        .set_offset_index_disabled(false)
        .set_bloom_filter_enabled(false)
        .set_bloom_filter_position(BloomFilterPosition::End)
        .set_content_defined_chunking(None)
        .set_coerce_types(false);
    for column in columns.iter().filter(|column| matches!(column.kind, Kind::Float32 | Kind::Float64)) {
        let path = ColumnPath::from(column.name.as_str());
        builder = builder
            .set_column_dictionary_enabled(path.clone(), false)
            .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT);
    }
    Ok(builder.build())
}
