//! Shard number -> split, and the tables a shard may hold.
//!
//! One shard is one block of scenes is one split, so that no scene is ever in two splits.

use serde::{Deserialize, Serialize};

/// The tables of a corpus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Table {
    Cells,
    Scenes,
    Poses,
    Points,
}

/// Which part of the 70 / 15 / 15 split a shard is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    Train,
    Validation,
    Test,
}

impl Split {
    /// 14 + 3 + 3 in every 20 shards.
    pub fn of_shard(shard: u64) -> Split {
        match shard % 20 {
            3 | 9 | 16 => Split::Validation,
            6 | 13 | 19 => Split::Test,
            _ => Split::Train,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Split::Train => "train",
            Split::Validation => "validation",
            Split::Test => "test",
        }
    }
}
