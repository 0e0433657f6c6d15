//! A table file's own metadata -> whether it is the table of the shard whose name it bears.
//!
//! A file may be whole, and listed with its right hash, and still be another shard's: one of the train split in a test shard's place
//! would put its scenes into both. The file itself says whose it is, and its statistics say which scenes it holds.

use parquet::file::statistics::Statistics;

use super::reader::TableFile;
use super::{Split, Table};

/// A shard of a corpus, as its files must name it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShardIdentity<'a> {
    pub scene_plan_hash: &'a str,
    pub shard: u64,
    pub split: Split,
    /// First scene, and the one after the last.
    pub scenes: [u64; 2],
}

impl ShardIdentity<'_> {
    /// Why a file is not this shard's, if so.
    pub(crate) fn check(&self, file: &TableFile, table: Table) -> Result<(), String> {
        let said = file.key_values();
        let [first, end] = self.scenes;
        for (key, expected) in [
            ("marsyard.scene_plan_hash", self.scene_plan_hash),
            ("marsyard.shard", &self.shard.to_string()),
            ("marsyard.split", self.split.name()),
            ("marsyard.scenes", &format!("{first}..{end}")),
            ("marsyard.table", table.name()),
        ] {
            match said.get(key) {
                Some(there) if there == expected => {}
                Some(there) => {
                    return Err(format!(
                        "it is not the file that its name says: its own {key} is '{}', not '{expected}'",
                        short(there)
                    ));
                }
                None => return Err(format!("it does not say its {key}: marsyard did not write it")),
            }
        }
        self.check_statistics(file)
    }

    /// The statistics of its scenes, of every row group that has rows.
    fn check_statistics(&self, file: &TableFile) -> Result<(), String> {
        for (number, group) in file.row_group_facts().iter().enumerate().filter(|(_, group)| group.num_rows() > 0) {
            let column = group.columns().iter().find(|column| column.column_path().string() == "scene_id");
            let range = match column.and_then(|column| column.statistics()) {
                Some(Statistics::Int64(said)) => said.min_opt().zip(said.max_opt()),
                _ => None,
            };
            let Some((&least, &most)) = range else {
                return Err(format!("row group {number} has no statistics of scene_id"));
            };
            self.check_scenes(least, most)?;
        }
        Ok(())
    }

    /// Whether scenes from one number to another are all this shard's.
    pub(crate) fn check_scenes(&self, least: i64, most: i64) -> Result<(), String> {
        let [first, end] = self.scenes;
        let within = |scene: i64| u64::try_from(scene).is_ok_and(|scene| (first..end).contains(&scene));
        if within(least) && within(most) {
            return Ok(());
        }
        Err(format!("it holds scenes {least} to {most}, the shard is of scenes {first} to {}", end.saturating_sub(1)))
    }
}

/// Enough of a text that may be anybody's.
fn short(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(12).collect()
}
