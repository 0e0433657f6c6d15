//! A data file and what `shards.jsonl` says of it -> the file, opened; or why it is not that file.
//!
//! For whoever learns from a corpus or judges by it: a truncated, damaged or foreign file is refused before one row of it is
//! taken. The bytes are hashed piece by piece, never held as a whole.

use sha2::Digest;

use super::belongs::ShardIdentity;
use super::manifest::ShardLine;
use super::reader::TableFile;
use super::{CorpusError, Store, Table, hex};

/// What a finished corpus says of one of its files.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expected<'a> {
    pub name: &'a str,
    pub bytes: u64,
    pub sha256: &'a str,
    pub rows: u64,
    pub row_groups: u32,
    pub table: Table,
    pub identity: ShardIdentity<'a>,
}

/// Why a file cannot be taken.
#[derive(Debug)]
pub enum Refused {
    /// It is not the file that the corpus was finalized with.
    Other(String),
    Store(CorpusError),
}

impl From<CorpusError> for Refused {
    fn from(error: CorpusError) -> Refused {
        match error {
            CorpusError::Parquet { source, .. } => Refused::Other(format!("it cannot be read as Parquet ({source})")),
            CorpusError::Arrow { source, .. } => Refused::Other(format!("it cannot be read as Parquet ({source})")),
            other => Refused::Store(other),
        }
    }
}

impl<'a> Expected<'a> {
    /// A table of a shard; `None` where the corpus has no such table.
    pub(crate) fn of(scene_plan_hash: &'a str, line: &'a ShardLine, table: Table) -> Option<Expected<'a>> {
        let facts = line.tables.get(&table)?;
        Some(Expected {
            name: &facts.path,
            bytes: facts.bytes,
            sha256: &facts.sha256,
            rows: facts.rows,
            row_groups: facts.row_groups,
            table,
            identity: ShardIdentity { scene_plan_hash, shard: line.shard, split: line.split, scenes: line.scenes },
        })
    }
}

/// Files are hashed in pieces of this size, or more where a request is dear.
const PIECE_BYTES: usize = 1 << 20;

impl Expected<'_> {
    /// Checks size and sha256 first, then opens, and asks the file whose it is.
    pub(crate) fn open_checked(&self, store: &dyn Store) -> Result<TableFile, Refused> {
        let other = |reason: String| Err(Refused::Other(reason));
        let Some(bytes) = store.size(self.name)? else { return other("it is missing".into()) };
        if bytes != self.bytes {
            return other(format!("it has {bytes} bytes, shards.jsonl says {}", self.bytes));
        }
        if sha256_of(store, self.name, bytes)? != self.sha256 {
            return other("its sha256 is not that of shards.jsonl: bytes have changed".into());
        }
        let table = self.open(store)?;
        self.identity.check(&table, self.table).map_err(Refused::Other)?;
        Ok(table)
    }

    /// Opens a file that was checked before.
    pub(crate) fn open(&self, store: &dyn Store) -> Result<TableFile, Refused> {
        let table = TableFile::open_sized(store, self.name, self.bytes)?;
        let (rows, row_groups) = (table.rows(), table.row_groups().len());
        if row_groups == self.row_groups as usize && rows == self.rows {
            return Ok(table);
        }
        Err(Refused::Other(format!(
            "it holds {rows} rows in {row_groups} row groups, shards.jsonl says {} in {}",
            self.rows, self.row_groups
        )))
    }
}

/// The SHA-256 of a file of so many bytes.
pub(crate) fn sha256_of(store: &dyn Store, name: &str, bytes: u64) -> Result<String, CorpusError> {
    let mut hasher = sha2::Sha256::new();
    let mut offset = 0;
    while offset < bytes {
        let piece = store.read_range(name, offset, PIECE_BYTES.max(store.grain_bytes()))?;
        if piece.is_empty() {
            break;
        }
        hasher.update(&piece);
        offset += piece.len() as u64;
    }
    Ok(hex(&hasher.finalize()))
}
