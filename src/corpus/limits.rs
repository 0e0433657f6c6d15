//! The kind of a file -> the most bytes that are read of it. Whatever is larger is not what its name says.
//!
//! A corpus, a model or a cloud may be anybody's: without a limit, a file without end would be read until memory is gone. The
//! limits lie far above what marsyard writes; `docs/files.md` shows this table.

use std::path::Path;

use super::store::read_local;
use super::{CorpusError, Store};

const MIB: u64 = 1 << 20;

/// Of the largest model.
pub(crate) const MODEL_BYTES: u64 = 512 * MIB;

/// Of the largest covariance that a filter may have.
pub(crate) const COVARIANCE_BYTES: u64 = 8192 * MIB;

/// A kind of file that is read as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    Manifest,
    Receipt,
    /// `shards.jsonl` of a corpus of so many shards.
    ShardList {
        shards: u64,
    },
    Config,
    Card,
    Croissant,
    Model,
    Checkpoint,
    LabelMap,
    Trajectory,
    Cloud,
    Signature,
    Rebuilt,
    Ledger,
}

/// Bytes of one line of `shards.jsonl`: four tables with their hashes take 1.3 kB.
const SHARD_LINE: u64 = 4096;

impl FileKind {
    /// One of each kind, in the order of the table.
    #[cfg(test)]
    pub(crate) const ALL: [FileKind; 14] = [
        FileKind::Manifest,
        FileKind::Receipt,
        FileKind::ShardList { shards: 1 },
        FileKind::Config,
        FileKind::Card,
        FileKind::Croissant,
        FileKind::Model,
        FileKind::Checkpoint,
        FileKind::LabelMap,
        FileKind::Trajectory,
        FileKind::Cloud,
        FileKind::Signature,
        FileKind::Rebuilt,
        FileKind::Ledger,
    ];

    /// What it is called in messages and in the table.
    pub(crate) fn name(self) -> &'static str {
        match self {
            FileKind::Manifest => "a manifest",
            FileKind::Receipt => "a receipt",
            FileKind::ShardList { .. } => "a list of shards",
            FileKind::Config => "a config",
            FileKind::Card => "a dataset card",
            FileKind::Croissant => "a Croissant description",
            FileKind::Model => "a model",
            FileKind::Checkpoint => "a checkpoint",
            FileKind::LabelMap => "a label map",
            FileKind::Trajectory => "a trajectory",
            FileKind::Cloud => "a cloud",
            FileKind::Signature => "a key or a signature",
            FileKind::Rebuilt => "a record of shards built again",
            FileKind::Ledger => "a ledger of results",
        }
    }

    /// The files of this kind.
    #[cfg(test)]
    fn files(self) -> &'static str {
        match self {
            FileKind::Manifest => "`manifest.json`",
            FileKind::Receipt => "`receipts/*.json`",
            FileKind::ShardList { .. } => "`shards.jsonl`",
            FileKind::Config => "configs, `plan.yaml`, presets, patterns, height maps",
            FileKind::Card => "`README.md` of a corpus",
            FileKind::Croissant => "`croissant.json`",
            FileKind::Model => "`model.safetensors`",
            FileKind::Checkpoint => "`checkpoint.safetensors`, `filter.safetensors`",
            FileKind::LabelMap => "`--labels` of `classify`",
            FileKind::Trajectory => "`--trajectory` of `classify`, logs that `localise` reads",
            FileKind::Cloud => "clouds that `classify` and `localise` read",
            FileKind::Signature => "`*.minisig`, keys of `sign` and `verify`",
            FileKind::Rebuilt => "`rebuilt.json`",
            FileKind::Ledger => "`marsyard.sha256` in folders of results",
        }
    }

    /// The largest file of this kind that is read.
    pub(crate) fn most_bytes(self) -> u64 {
        match self {
            FileKind::Manifest | FileKind::Config => 256 * MIB,
            FileKind::Receipt => 64 * MIB,
            FileKind::ShardList { shards } => shards.saturating_mul(SHARD_LINE).min(4096 * MIB),
            FileKind::Card | FileKind::Croissant | FileKind::LabelMap => 4 * MIB,
            FileKind::Signature => MIB,
            FileKind::Rebuilt | FileKind::Ledger => 16 * MIB,
            FileKind::Trajectory => 1024 * MIB,
            FileKind::Model => MODEL_BYTES,
            FileKind::Cloud => 4096 * MIB,
            // Of now and of the best look, with their weights; the looks and names are far shorter than a model.
            FileKind::Checkpoint => 2 * (COVARIANCE_BYTES + MODEL_BYTES),
        }
    }

    /// Reads a file of this kind, and no more than its limit and a byte.
    pub(crate) fn read(self, store: &dyn Store, name: &str) -> Result<Vec<u8>, CorpusError> {
        let most_bytes = self.most_bytes();
        let bytes = store.read_range(name, 0, most_bytes.saturating_add(1) as usize)?;
        if bytes.len() as u64 <= most_bytes {
            return Ok(bytes);
        }
        Err(CorpusError::TooLarge { place: store.place(), name: name.into(), kind: self.name(), most_bytes })
    }
}

impl FileKind {
    /// Reads a file that a user named, wherever a link of that name leads; a pipe or a folder is refused, not waited for.
    pub(crate) fn read_path(self, path: &Path) -> std::io::Result<Vec<u8>> {
        read_local(path, self.most_bytes())
    }
}

/// The table in Markdown.
#[cfg(test)]
pub(crate) fn markdown() -> String {
    let row = |kind: &FileKind| {
        let most = match kind {
            FileKind::ShardList { .. } => format!("{} KiB a shard, 4096 MiB", SHARD_LINE >> 10),
            kind => format!("{} MiB", kind.most_bytes() / MIB),
        };
        format!("| {} | {} | {most} |\n", kind.name(), kind.files())
    };
    let rows: String = FileKind::ALL.iter().map(row).collect();
    format!("| kind | files | at most |\n|---|---|--:|\n{rows}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::LocalFolder;

    #[test]
    fn equal_the_table_in_the_docs_is_this_one() {
        let docs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/files.md");
        let text = std::fs::read_to_string(docs).unwrap();
        assert!(text.contains(&markdown()), "docs/files.md must hold:\n{}", markdown());
    }

    #[test]
    fn extreme_a_file_above_its_limit_is_refused_and_one_at_it_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let store = LocalFolder::new(dir.path());
        let kind = FileKind::ShardList { shards: 2 };
        for (bytes, fine) in [(0, true), (8192, true), (8193, false)] {
            store.replace("x", &vec![b' '; bytes]).unwrap();
            assert_eq!(kind.read(&store, "x").map(|read| read.len()).ok(), fine.then_some(bytes));
        }
        let refused = kind.read(&store, "x").unwrap_err().to_string();
        assert!(refused.contains("larger than 8192 bytes") && refused.contains("a list of shards"), "{refused}");
    }
}
