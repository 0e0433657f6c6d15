//! Tables of a corpus -> what its families hold, as [`advise`](crate::corpus::advice::advise) asks for it.
//!
//! Which scene is of which family, how it fared and where its returns went stand in the `scenes` tables of all shards; points, ranges and
//! labels are those of the `cells` of some shards, spread evenly over each split. Without a `scenes` table nothing is known by family. A
//! family counts as held out where all its scenes are in the test split, and others' are not. Drives that were cut short are in no table.

use std::collections::HashMap;

use arrow_array::types::Int64Type;
use arrow_array::{Array, RecordBatch, StringArray};

use crate::corpus::advice::Content;
use crate::corpus::cells::{CellBatch, LABEL, POINTS, RANGE_M};
use crate::corpus::reader::column;
use crate::corpus::{CorpusError, Finished, Split, Table};

/// Shards of each split whose cells are read.
const SHARDS: usize = 16;
const CELL_COLUMNS: [&str; 4] = ["scene_id", LABEL, POINTS, RANGE_M];

/// What is counted while the tables are read.
pub(super) struct Contents {
    /// In the manifest's order.
    families: Vec<Content>,
    has_learning_scenes: Vec<bool>,
    family_of_scene: HashMap<i64, usize>,
}

impl Contents {
    pub(super) fn of(families: &[String]) -> Contents {
        Contents {
            families: families.iter().map(|family| Content::of(family, false, 0)).collect(),
            has_learning_scenes: vec![false; families.len()],
            family_of_scene: HashMap::new(),
        }
    }

    /// Adds a batch of a `scenes` table of a shard of this split.
    pub(super) fn add_scenes(&mut self, batch: &RecordBatch, split: Split) -> Result<(), String> {
        let text = |name: &str| {
            let found = batch.column_by_name(name).and_then(|column| column.as_any().downcast_ref::<StringArray>());
            found.ok_or_else(|| format!("it has no column '{name}' of text"))
        };
        let number = |name: &str| Ok::<_, String>(column::<Int64Type>(batch, name)?.values());
        let (names, errors) = (text("family")?, text("error")?);
        let (ids, points_in, beyond) = (number("scene_id")?, number("points_in")?, number("points_beyond_range")?);
        for row in 0..batch.num_rows() {
            let name = names.value(row);
            let known = self.families.iter().position(|content| content.family == name);
            let family = known.ok_or_else(|| format!("its family '{name}' is none of the manifest's"))?;
            self.family_of_scene.insert(ids[row], family);
            self.has_learning_scenes[family] |= split != Split::Test;
            let content = &mut self.families[family];
            content.scenes += 1;
            content.test_scenes += u64::from(split == Split::Test);
            content.returns += points_in[row] as u64;
            content.returns_unread += beyond[row] as u64;
            if errors.is_valid(row) {
                content.failed += 1;
                content.first_failure.get_or_insert_with(|| errors.value(row).to_owned());
            }
        }
        Ok(())
    }

    /// Reads cells; gives the families, and the number of shards that were read.
    pub(super) fn with_cells(mut self, corpus: &Finished) -> Result<(Vec<Content>, usize), CorpusError> {
        let is_any_learnt_from = self.has_learning_scenes.contains(&true);
        for (content, has_learning_scenes) in self.families.iter_mut().zip(&self.has_learning_scenes) {
            content.is_held_out = is_any_learnt_from && !has_learning_scenes && content.scenes > 0;
        }
        let mut shards_read = 0;
        for split in Split::ALL {
            let lines: Vec<_> = corpus.lines_of(split).collect();
            let step = lines.len().div_ceil(SHARDS).max(1);
            for line in lines.into_iter().step_by(step) {
                let refused = |refused| corpus.refused(line, Table::Cells, refused);
                let Some(file) = corpus.open_table(line, Table::Cells).map_err(refused)? else { continue };
                shards_read += 1;
                for group in 0..file.row_groups().len() {
                    let cells = CellBatch::read(&file, group, &CELL_COLUMNS)?;
                    self.add_cells(&cells).map_err(|reason| file.odd(reason))?;
                }
            }
        }
        Ok((self.families, shards_read))
    }

    fn add_cells(&mut self, cells: &CellBatch) -> Result<(), String> {
        let (scenes, labels) = (cells.scenes()?, cells.labels()?);
        let (points, ranges_m) = (cells.points()?, cells.ranges_m()?);
        for row in 0..cells.rows() {
            let Some(&family) = self.family_of_scene.get(&scenes[row]) else {
                return Err(format!("its scene {} is in no table of scenes", scenes[row]));
            };
            self.families[family].add_cell(points[row], ranges_m[row], labels.at(row));
        }
        Ok(())
    }
}
