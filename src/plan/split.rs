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

impl Table {
    pub const ALL: [Table; 4] = [Table::Cells, Table::Scenes, Table::Poses, Table::Points];

    pub fn name(self) -> &'static str {
        match self {
            Table::Cells => "cells",
            Table::Scenes => "scenes",
            Table::Poses => "poses",
            Table::Points => "points",
        }
    }

    /// What one row is.
    pub fn row_is(self) -> &'static str {
        match self {
            Table::Cells => "a non-empty cell of a kept scan",
            Table::Scenes => "a scene",
            Table::Poses => "a step of a drive: the true and the estimated pose",
            Table::Points => "a beam slot of a kept scan, misses included",
        }
    }

    /// Where its files lie.
    pub fn folder(self) -> String {
        format!("data/{}", self.name())
    }

    /// Where a shard's rows of this table lie.
    pub fn path(self, shard: u64) -> String {
        format!("data/{}/{}-{shard:07}.parquet", self.name(), Split::of_shard(shard).name())
    }

    /// The table and the shard whose rows lie at a path.
    pub fn of_path(path: &str) -> Option<(Table, u64)> {
        let shard = path.strip_suffix(".parquet")?.rsplit_once('-')?.1.parse().ok()?;
        Table::ALL.into_iter().map(|table| (table, shard)).find(|(table, shard)| table.path(*shard) == path)
    }
}

/// Which part of the 70 / 15 / 15 split a shard is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    Train,
    Validation,
    Test,
}

impl Split {
    pub const ALL: [Split; 3] = [Split::Train, Split::Validation, Split::Test];

    /// 14 + 3 + 3 in every 20 shards.
    ///
    /// ```
    /// use marsyard::plan::Split;
    ///
    /// let count = |split| (0..20).filter(|&shard| Split::of_shard(shard) == split).count();
    /// assert_eq!(Split::ALL.map(count), [14, 3, 3]);
    /// // A corpus that grows moves no shard to another split; seven shards are enough for one of each.
    /// assert_eq!(Split::of_shard(3), Split::of_shard(23));
    /// assert!(Split::ALL.iter().all(|&split| (0..7).any(|shard| Split::of_shard(shard) == split)));
    /// ```
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_every_twenty_shards_hold_14_train_3_validation_3_test() {
        for start in [0, 1, 7, 20, 1_000_003] {
            let count = |split| (start..start + 20).filter(|&shard| Split::of_shard(shard) == split).count();
            assert_eq!([14, 3, 3], Split::ALL.map(count), "from shard {start}");
        }
    }

    #[test]
    fn exact_every_split_has_a_shard_from_seven_on() {
        let splits = |shards: u64| Split::ALL.iter().filter(|&&s| (0..shards).any(|i| Split::of_shard(i) == s)).count();
        assert_eq!(splits(6), 2);
        assert_eq!(splits(7), 3);
    }

    #[test]
    fn exact_paths_carry_table_split_and_shard() {
        assert_eq!(Table::Cells.path(7), "data/cells/train-0000007.parquet");
        assert_eq!(Table::Points.path(12_345_669), "data/points/validation-12345669.parquet");
        assert_eq!(Table::of_path("data/points/validation-12345669.parquet"), Some((Table::Points, 12_345_669)));
        for other in
            ["data/cells/train-7.parquet", "data/cells/test-0000007.parquet", "cells", "data/cells/train-0000007"]
        {
            assert_eq!(Table::of_path(other), None, "{other}");
        }
    }
}
