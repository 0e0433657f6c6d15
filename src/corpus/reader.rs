//! A corpus's Parquet files -> Arrow record batches, row group by row group, without the whole file in memory.
//!
//! Where a request is dear (an object store), a file keeps the last few megabytes that it read: pages and their headers, which the
//! Parquet reader asks for one by one, then come from there. What a store says when it fails is kept too, and goes before what
//! the Parquet reader makes of it: a lost connection is no damaged file.
//!
//! Files may be anybody's: what they announce is judged before it is believed (`pages`), and where the Parquet crate panics on
//! what is left, that is an error like any other.

use std::collections::BTreeMap;
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard};

use arrow_array::types::Int64Type;
use arrow_array::{ArrowPrimitiveType, BooleanArray, PrimitiveArray, RecordBatch};
use arrow_schema::SchemaRef;
use arrow_select::concat::concat_batches;
use arrow_select::filter::filter_record_batch;
use bytes::Bytes;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::errors::ParquetError;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{ChunkReader, Length};

use super::pages::{self, ColumnChunks};
use super::{CorpusError, Store};

/// A Parquet file in a store, opened: its footer is read, its rows are not.
#[derive(Clone)]
pub struct TableFile {
    file: StoredFile,
    facts: ArrowReaderMetadata,
}

impl TableFile {
    pub fn open(store: &dyn Store, name: &str) -> Result<TableFile, CorpusError> {
        let Some(length) = store.size(name)? else {
            let source = std::io::ErrorKind::NotFound.into();
            return Err(CorpusError::Io { place: store.place(), name: name.into(), source });
        };
        TableFile::open_sized(store, name, length)
    }

    /// Opens a file whose length is known.
    pub(crate) fn open_sized(store: &dyn Store, name: &str, length: u64) -> Result<TableFile, CorpusError> {
        let file = StoredFile { store: store.share(), name: name.into(), length, seen: Arc::default() };
        let facts = contained(|| {
            let facts = ArrowReaderMetadata::load(&file, ArrowReaderOptions::new())?;
            pages::check_shape(&facts).map_err(ParquetError::General)?;
            Ok(facts)
        });
        match facts {
            Ok(facts) => Ok(TableFile { file, facts }),
            Err(source) => Err(file.failed(CorpusError::Parquet { name: name.into(), source })),
        }
    }

    pub(crate) fn name(&self) -> &str {
        &self.file.name
    }

    pub(crate) fn schema(&self) -> &SchemaRef {
        self.facts.schema()
    }

    /// Rows of each row group.
    pub fn row_groups(&self) -> Vec<u64> {
        self.facts.metadata().row_groups().iter().map(|group| group.num_rows() as u64).collect()
    }

    pub fn rows(&self) -> u64 {
        self.row_groups().iter().sum()
    }

    /// What the footer says of each row group.
    pub(crate) fn row_group_facts(&self) -> &[RowGroupMetaData] {
        self.facts.metadata().row_groups()
    }

    /// The file's key-values, less Arrow's own schema blob.
    pub fn key_values(&self) -> BTreeMap<String, String> {
        let pairs = self.facts.metadata().file_metadata().key_value_metadata();
        pairs
            .into_iter()
            .flatten()
            .filter(|pair| pair.key != "ARROW:schema")
            .map(|pair| (pair.key.clone(), pair.value.clone().unwrap_or_default()))
            .collect()
    }

    /// One row group as one batch, all columns or (in the file's order) those named.
    pub fn read_row_group(&self, group: usize, columns: Option<&[&str]>) -> Result<RecordBatch, CorpusError> {
        let failed =
            |source: ParquetError| self.file.failed(CorpusError::Parquet { name: self.file.name.to_string(), source });
        let fields = self.schema().fields();
        let known = |name: &&&str| self.schema().field_with_name(name).is_err();
        if let Some(unknown) = columns.into_iter().flatten().find(known) {
            return Err(failed(ParquetError::General(format!("there is no column '{unknown}'"))));
        }
        let wanted = |name: &str| columns.is_none_or(|columns| columns.contains(&name));
        let numbers: Vec<usize> = (0..fields.len()).filter(|&k| wanted(fields[k].name())).collect();
        contained(|| self.row_group(group, &numbers)).map_err(failed)
    }

    /// One row group of some columns, by their numbers; columns are flat, so that a number is one of Arrow and of Parquet.
    fn row_group(&self, group: usize, columns: &[usize]) -> Result<RecordBatch, ParquetError> {
        let Some(facts) = self.facts.metadata().row_groups().get(group) else {
            return Err(ParquetError::General(format!("there is no row group {group}")));
        };
        let read = |start: u64, length: usize| self.file.get_bytes(start, length);
        let chunks = ColumnChunks::fetch(self.file.length, facts, columns, read)?;
        let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(chunks, self.facts.clone())
            .with_row_groups(vec![group])
            .with_batch_size((facts.num_rows() as usize).max(1));
        let mask = ProjectionMask::roots(builder.parquet_schema(), columns.iter().copied());
        let mut reader = builder.with_projection(mask).build()?;
        let schema = arrow_array::RecordBatchReader::schema(&reader);
        let rows = reader.next().transpose()?;
        Ok(rows.unwrap_or_else(|| RecordBatch::new_empty(schema)))
    }

    /// All row groups in order.
    pub fn batches(&self) -> impl Iterator<Item = Result<RecordBatch, CorpusError>> + '_ {
        (0..self.row_groups().len()).map(|group| self.read_row_group(group, None))
    }

    /// The rows of one scene.
    pub fn rows_of_scene(&self, scene_id: u64) -> Result<RecordBatch, CorpusError> {
        let arrow = |source| CorpusError::Arrow { name: self.file.name.to_string(), source };
        let mut found = Vec::new();
        for batch in self.batches() {
            let batch = batch?;
            let rows = rows_of_scene(&batch, scene_id).map_err(|reason| self.odd(reason))?;
            if rows.num_rows() > 0 {
                found.push(rows);
            }
        }
        concat_batches(self.schema(), &found).map_err(arrow)
    }

    /// An error about this file.
    pub(crate) fn odd(&self, reason: String) -> CorpusError {
        CorpusError::Parquet { name: self.file.name.to_string(), source: ParquetError::General(reason) }
    }
}

/// Those rows of a batch that are a scene's.
pub(crate) fn rows_of_scene(batch: &RecordBatch, scene_id: u64) -> Result<RecordBatch, String> {
    let ids = column::<Int64Type>(batch, "scene_id")?;
    let mask: BooleanArray = ids.iter().map(|id| Some(id == Some(scene_id as i64))).collect();
    filter_record_batch(batch, &mask).map_err(|error| error.to_string())
}

/// A column of a batch, by name and type; `Err` says what is wrong with it.
pub(crate) fn column<'b, T: ArrowPrimitiveType>(
    batch: &'b RecordBatch,
    name: &str,
) -> Result<&'b PrimitiveArray<T>, String> {
    let found = batch.column_by_name(name).ok_or_else(|| format!("it has no column '{name}'"))?;
    let typed = found.as_any().downcast_ref::<PrimitiveArray<T>>();
    typed.ok_or_else(|| format!("its column '{name}' is {:?}, not {:?}", found.data_type(), T::DATA_TYPE))
}

/// What a reader gives; a panic of it is an error of the file.
fn contained<T>(read: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, ParquetError> {
    let panicked = |_| Err(ParquetError::General("the file is broken: the Parquet reader panicked on it".into()));
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(panicked)
}

/// A stored file as the Parquet reader wants it: parts on demand.
#[derive(Clone)]
struct StoredFile {
    store: Arc<dyn Store>,
    name: Arc<str>,
    length: u64,
    seen: Arc<Mutex<Seen>>,
}

/// What was read last, and what the store said when it failed.
#[derive(Default)]
struct Seen {
    start: u64,
    bytes: Bytes,
    fault: Option<CorpusError>,
}

/// Page headers are small; this holds a few of them.
const BLOCK_BYTES: usize = 64 * 1024;

impl StoredFile {
    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().expect("no thread panics while it reads")
    }

    /// What the store said, or else what the reader made of the bytes.
    fn failed(&self, by_reader: CorpusError) -> CorpusError {
        self.seen().fault.take().unwrap_or(by_reader)
    }

    /// The bytes from `start` on, `length` of them, or fewer at the file's end.
    fn fetch(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let grain = self.store.grain_bytes();
        let near = grain <= BLOCK_BYTES;
        let mut seen = self.seen();
        let end = self.length.min(start.saturating_add(length as u64));
        let kept = seen.start..seen.start + seen.bytes.len() as u64;
        if start < end && kept.contains(&start) && end <= kept.end {
            return Ok(seen.bytes.slice((start - kept.start) as usize..(end - kept.start) as usize));
        }
        // At the end of the file stands the footer, which is read backwards.
        let from = if near { start } else { start.min(self.length.saturating_sub(grain as u64)) };
        let wanted = if near { length } else { ((end.max(from + grain as u64)).min(self.length) - from) as usize };
        let bytes: Bytes = match self.store.read_range(&self.name, from, wanted) {
            Ok(bytes) => bytes.into(),
            Err(error) => {
                let said = ParquetError::General(error.to_string());
                seen.fault = Some(error);
                return Err(said);
            }
        };
        if near {
            return Ok(bytes);
        }
        let within = |at: u64| ((at - from) as usize).min(bytes.len());
        let part = bytes.slice(within(start)..within(end.max(start)));
        (seen.start, seen.bytes) = (from, bytes);
        Ok(part)
    }
}

impl Length for StoredFile {
    fn len(&self) -> u64 {
        self.length
    }
}

impl ChunkReader for StoredFile {
    type T = StoredReader;

    fn get_read(&self, start: u64) -> Result<StoredReader, ParquetError> {
        Ok(StoredReader { file: self.clone(), offset: start, buffer: Bytes::new() })
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let bytes = self.fetch(start, length)?;
        if bytes.len() < length {
            return Err(ParquetError::EOF(format!("{} ends within the {length} bytes from {start}", self.name)));
        }
        Ok(bytes)
    }
}

/// Reads on from an offset, a block at a time.
struct StoredReader {
    file: StoredFile,
    offset: u64,
    buffer: Bytes,
}

impl Read for StoredReader {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        if self.buffer.is_empty() {
            self.buffer = self.file.fetch(self.offset, BLOCK_BYTES).map_err(std::io::Error::other)?;
            self.offset += self.buffer.len() as u64;
        }
        let part = self.buffer.split_to(out.len().min(self.buffer.len()));
        out[..part.len()].copy_from_slice(&part);
        Ok(part.len())
    }
}
