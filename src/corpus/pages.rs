//! What a Parquet file says of itself -> whether its rows may be expanded.
//!
//! Files come from other people. A few hundred bytes may announce two billion rows or a page of 2 GiB, and the Parquet crate
//! reserves what is announced before it expands a byte. So the footer is judged when a file is opened, and every page header of
//! what is to be read before it is read: only flat columns of the types that marsyard writes, only encodings that cannot repeat
//! without end, and no more bytes than the file's own size warrants ([`most_bytes`]).
//! Source: parquet.thrift (`PageHeader`), in Thrift's compact protocol. Not here: whether the values are right (hashes say that).

use std::sync::Arc;

use arrow_schema::{DataType, Schema};
use bytes::{Buf, Bytes};
use parquet::arrow::arrow_reader::ArrowReaderMetadata;
use parquet::basic::Type;
use parquet::column::page::{Page, PageReader};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, RowGroupMetaData};
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

/// Bytes that a row group of a file of this size may become: a whole group of the widest table of all misses, or 32 times the file.
fn most_bytes(file_bytes: u64) -> u64 {
    file_bytes.saturating_mul(32).saturating_add(96 << 20)
}

/// Whether the file holds a flat table of types that marsyard writes.
pub(super) fn check_shape(facts: &ArrowReaderMetadata) -> Result<(), String> {
    for column in facts.metadata().file_metadata().schema_descr().columns() {
        let name = column.name();
        let known = matches!(
            column.physical_type(),
            Type::BOOLEAN | Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE | Type::BYTE_ARRAY
        );
        if column.max_rep_level() > 0 || column.max_def_level() > 1 || column.path().parts().len() > 1 {
            return Err(format!("its column '{name}' is nested; a corpus has flat columns"));
        }
        if !known {
            return Err(format!("its column '{name}' is {}, which no table has", column.physical_type()));
        }
    }
    check_types(facts.schema())?;
    match facts.metadata().row_groups().iter().position(|group| group.num_rows() < 0) {
        Some(group) => Err(format!("its row group {group} has fewer than no rows")),
        None => Ok(()),
    }
}

fn check_types(schema: &Schema) -> Result<(), String> {
    use DataType::{Boolean, Float32, Float64, Int8, Int32, Int64, Utf8};
    let known = |kind: &DataType| matches!(kind, Boolean | Int8 | Int32 | Int64 | Float32 | Float64 | Utf8);
    match schema.fields().iter().find(|field| !known(field.data_type())) {
        Some(odd) => Err(format!("its column '{}' is {}, which no table has", odd.name(), odd.data_type())),
        None => Ok(()),
    }
}

/// The bytes of some columns of a row group, read once; to the Parquet reader, a file with holes.
#[derive(Clone)]
pub(super) struct ColumnChunks {
    file_bytes: u64,
    /// Ascending by offset.
    parts: Arc<Vec<(u64, Bytes)>>,
}

impl ColumnChunks {
    /// Reads and judges the columns with these numbers; `read` gives the bytes from an offset on.
    pub(crate) fn fetch(
        file_bytes: u64,
        group: &RowGroupMetaData,
        columns: &[usize],
        read: impl Fn(u64, usize) -> Result<Bytes, ParquetError>,
    ) -> Result<ColumnChunks, ParquetError> {
        let refused = |reason: String| ParquetError::General(format!("not a file of marsyard's: {reason}"));
        let most = most_bytes(file_bytes);
        let rows = group.num_rows().max(0) as u64;
        let wide: u64 = columns.iter().map(|&k| bytes_of(group.column(k).column_type())).sum();
        if rows.saturating_mul(wide) > most {
            return Err(refused(format!("{rows} rows in a row group are more than {file_bytes} bytes may hold")));
        }
        let mut parts = Vec::new();
        let (mut stored, mut expanded) = (0u64, 0u64);
        for &k in columns {
            let column = group.column(k);
            let said = || format!("column '{}'", column.column_path().string());
            let (start, length) =
                range_of(column).ok_or_else(|| refused(format!("{} is nowhere in the file", said())))?;
            stored = stored.saturating_add(length);
            if start.saturating_add(length) > file_bytes || stored > file_bytes {
                return Err(refused(format!("{} reaches beyond the file's {file_bytes} bytes", said())));
            }
            let bytes = read(start, length as usize)?;
            let pages = expanded_bytes(&bytes).map_err(|reason| refused(format!("{}: {reason}", said())))?;
            expanded = expanded.saturating_add(pages);
            if expanded > most {
                return Err(refused(format!("{} grows beyond what {file_bytes} bytes may hold", said())));
            }
            parts.push((start, bytes));
        }
        parts.sort_by_key(|(start, _)| *start);
        let chunks = ColumnChunks { file_bytes, parts: Arc::new(parts) };
        for &k in columns.iter().filter(|&&k| group.column(k).column_type() == Type::BYTE_ARRAY) {
            let longest = chunks.longest_in_dictionary(group.column(k), rows)?;
            expanded = expanded.saturating_add(rows.saturating_mul(longest));
            if expanded > most {
                let name = group.column(k).column_path().string();
                return Err(refused(format!("column '{name}' repeats texts of {longest} bytes {rows} times")));
            }
        }
        Ok(chunks)
    }

    /// Bytes of the longest text that rows may refer to; 0 without a dictionary (pages then hold what they hold).
    fn longest_in_dictionary(&self, column: &ColumnChunkMetaData, rows: u64) -> Result<u64, ParquetError> {
        let mut pages = SerializedPageReader::new(Arc::new(self.clone()), column, rows as usize, None)?;
        let Some(Page::DictionaryPage { mut buf, .. }) = pages.get_next_page()? else { return Ok(0) };
        let mut longest = 0;
        while buf.remaining() >= 4 {
            let length = buf.get_u32_le() as usize;
            longest = longest.max(length as u64);
            buf.advance(length.min(buf.remaining()));
        }
        Ok(longest)
    }
}

/// Offset and length of a column's pages.
fn range_of(column: &ColumnChunkMetaData) -> Option<(u64, u64)> {
    let start = column.dictionary_page_offset().unwrap_or_else(|| column.data_page_offset());
    u64::try_from(start).ok().zip(u64::try_from(column.compressed_size()).ok())
}

/// Of one value in memory; a text's own bytes are not known before its pages are.
fn bytes_of(kind: Type) -> u64 {
    match kind {
        Type::BOOLEAN => 1,
        Type::INT64 | Type::DOUBLE => 8,
        _ => 4,
    }
}

impl Length for ColumnChunks {
    fn len(&self) -> u64 {
        self.file_bytes
    }
}

impl ChunkReader for ColumnChunks {
    type T = bytes::buf::Reader<Bytes>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        Ok(self.tail(start)?.reader())
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let bytes = self.tail(start)?;
        if bytes.len() < length {
            return Err(ParquetError::EOF(format!("a page of {length} bytes from {start} leaves its column")));
        }
        Ok(bytes.slice(..length))
    }
}

impl ColumnChunks {
    /// From an offset to the end of the column that it lies in.
    fn tail(&self, start: u64) -> Result<Bytes, ParquetError> {
        let part = self.parts.iter().find(|(first, bytes)| (*first..*first + bytes.len() as u64).contains(&start));
        let (first, bytes) = part.ok_or_else(|| ParquetError::EOF(format!("no column has a page at {start}")))?;
        Ok(bytes.slice((start - first) as usize..))
    }
}

/// What a column's pages become, by their headers.
fn expanded_bytes(mut chunk: &[u8]) -> Result<u64, String> {
    let mut sum = 0u64;
    let mut page = 0;
    while !chunk.is_empty() {
        let mut header = PageHeader::default();
        let mut walk = PageHeaderReader { rest: chunk };
        walk.structure(0, 0, &mut header).ok_or_else(|| format!("the header of page {page} is broken"))?;
        let (Ok(stored), Ok(expanded)) = (usize::try_from(header.stored), u64::try_from(header.expanded)) else {
            return Err(format!("page {page} has fewer than no bytes"));
        };
        if header.encoding.is_some_and(|encoding| !ENCODINGS.contains(&encoding)) {
            return Err(format!("page {page} has an encoding that marsyard does not write"));
        }
        if header.kind == DICTIONARY && page > 0 {
            return Err(format!("page {page} is a dictionary; only the first may be one"));
        }
        chunk = walk.rest.get(stored..).ok_or_else(|| format!("page {page} ends early"))?;
        sum = sum.saturating_add(expanded);
        page += 1;
    }
    Ok(sum)
}

/// PLAIN, PLAIN_DICTIONARY, RLE, RLE_DICTIONARY, BYTE_STREAM_SPLIT: those in which a page cannot hold more text than it has bytes.
const ENCODINGS: [i64; 5] = [0, 2, 3, 8, 9];
/// The page type of dictionaries.
const DICTIONARY: i64 = 2;

#[derive(Debug, Default)]
struct PageHeader {
    kind: i64,
    expanded: i64,
    stored: i64,
    encoding: Option<i64>,
}

/// A walk over Thrift's compact protocol.
struct PageHeaderReader<'b> {
    rest: &'b [u8],
}

impl PageHeaderReader<'_> {
    /// Page headers nest two deep.
    const DEEPEST: u8 = 4;

    /// Passes over a structure; `of` is the field that it stands in, 0 for the page header itself.
    fn structure(&mut self, depth: u8, of: i64, header: &mut PageHeader) -> Option<()> {
        if depth > Self::DEEPEST {
            return None;
        }
        let mut field = 0i64;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            field = match head >> 4 {
                0 => self.zigzag()?,
                delta => field.wrapping_add(i64::from(delta)),
            };
            match head & 15 {
                // Booleans are in the head.
                1 | 2 => {}
                3 => drop(self.byte()?),
                4..=6 => {
                    let value = self.zigzag()?;
                    match (depth, of, field) {
                        (0, _, 1) => header.kind = value,
                        (0, _, 2) => header.expanded = value,
                        (0, _, 3) => header.stored = value,
                        (1, 5 | 7, 2) | (1, 8, 4) => header.encoding = Some(value),
                        _ => {}
                    }
                }
                7 => self.rest = self.rest.get(8..)?,
                8 => {
                    let length = usize::try_from(self.varint()?).ok()?;
                    self.rest = self.rest.get(length..)?;
                }
                12 => self.structure(depth + 1, field, header)?,
                // No page header holds lists, sets or maps.
                _ => return None,
            }
        }
    }

    fn byte(&mut self) -> Option<u8> {
        let (&first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(first)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 127) << shift;
            if byte < 128 {
                return Some(value);
            }
        }
        None
    }

    fn zigzag(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A page header as Thrift writes it: type, size expanded, size stored, and a data page of one row in PLAIN.
    fn page(kind: u8, expanded: u64, stored: u8) -> Vec<u8> {
        let mut bytes = vec![0x15, 2 * kind, 0x15];
        let mut zigzag = 2 * expanded;
        while zigzag >= 128 {
            bytes.push(zigzag as u8 | 128);
            zigzag >>= 7;
        }
        bytes.push(zigzag as u8);
        bytes.extend([0x15, 2 * stored, 0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0, 0]);
        bytes.extend(std::iter::repeat_n(7, usize::from(stored)));
        bytes
    }

    #[test]
    fn exact_sizes_announced_by_page_headers_add_up() {
        assert_eq!(expanded_bytes(&[page(0, 100, 5), page(0, 1 << 30, 0)].concat()), Ok(100 + (1 << 30)));
        assert_eq!(expanded_bytes(&[]), Ok(0));
    }

    #[test]
    fn extreme_headers_that_are_cut_or_nested_or_foreign_are_refused() {
        let whole = page(0, 100, 5);
        for end in 1..whole.len() {
            assert!(expanded_bytes(&whole[..end]).is_err(), "cut at {end}");
        }
        assert!(expanded_bytes(&[0x1c; 200]).unwrap_err().contains("broken"));
        assert!(expanded_bytes(&[page(0, 1, 1), page(2, 1, 1)].concat()).unwrap_err().contains("dictionary"));
        let mut delta = whole.clone();
        let at = delta.iter().position(|&byte| byte == 0x2c).unwrap();
        delta[at + 4] = 2 * 7;
        assert!(expanded_bytes(&delta).unwrap_err().contains("encoding"));
    }
}
