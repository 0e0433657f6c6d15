//! Tables of a corpus -> what its families hold, as [`advise`](crate::corpus::advice::advise) asks for it.
//!
//! Which scene is of which family, how it fared and where its returns went stand in the `scenes` tables of all shards; points, ranges and
//! labels are those of the `cells` of some shards, spread evenly over each split. Without a `scenes` table nothing is known by family. A
//! family counts as held out where all its scenes are in the test split, and others' are not. Drives that were cut short are in no table.
//! What scans show of obstacles is of the same cells; bearings need the `poses` table, and how each family's cells lie.

use std::collections::{BTreeMap, HashMap};

use arrow_array::types::Int64Type;
use arrow_array::{Array, RecordBatch, StringArray};

use crate::corpus::advice::{CellGrid, Content, View};
use crate::corpus::cells::{CellBatch, LABEL, OBJECT, OBSTACLE_POINTS, POINTS, RANGE_M, projection};
use crate::corpus::kept_poses::{Scan, kept_poses};
use crate::corpus::reader::column;
use crate::corpus::{CorpusError, Finished, Split, Table};

/// Shards of each split whose cells are read.
const SHARDS: usize = 16;
const CELL_COLUMNS: [&str; 8] = ["scene_id", "scan_id", "row", "col", LABEL, POINTS, RANGE_M, OBSTACLE_POINTS];

/// What is counted while the tables are read.
pub(super) struct Contents {
    /// In the manifest's order.
    families: Vec<Content>,
    has_learning_scenes: Vec<bool>,
    family_of_scene: HashMap<i64, usize>,
}

impl Contents {
    pub(super) fn of(families: &[String], grids: &BTreeMap<String, CellGrid>) -> Contents {
        let content = |family: &String| Content::of(family, false, 0).with_grid(grids.get(family).copied());
        Contents {
            families: families.iter().map(content).collect(),
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
                let mut views: BTreeMap<Scan, View> = BTreeMap::new();
                for group in 0..file.row_groups().len() {
                    let wanted = projection(&file, CELL_COLUMNS, &[OBJECT]).map_err(|reason| file.odd(reason))?;
                    let cells = CellBatch::read(&file, group, &wanted)?;
                    self.add_cells(&cells, &mut views).map_err(|reason| file.odd(reason))?;
                }
                let poses = corpus.open_table(line, Table::Poses);
                let poses = poses.map_err(|refused| corpus.refused(line, Table::Poses, refused))?;
                let poses = poses.map_or(Ok(HashMap::new()), |poses| kept_poses(&poses))?;
                for (scan, view) in views {
                    let content = &mut self.families[self.family_of_scene[&scan.0]];
                    content.views.add(&view, poses.get(&scan).zip(content.grid));
                }
            }
        }
        Ok((self.families, shards_read))
    }

    fn add_cells(&mut self, cells: &CellBatch, views: &mut BTreeMap<Scan, View>) -> Result<(), String> {
        let (scenes, labels) = (cells.scenes()?, cells.labels()?);
        let (keys, truth) = (cells.keys()?, cells.truth(&[OBSTACLE_POINTS])?);
        let (points, ranges_m) = (cells.points()?, cells.ranges_m()?);
        for row in 0..cells.rows() {
            let Some(&family) = self.family_of_scene.get(&scenes[row]) else {
                return Err(format!("its scene {} is in no table of scenes", scenes[row]));
            };
            self.families[family].add_cell(points[row], ranges_m[row], labels.at(row));
            let view = views.entry((scenes[row], keys.scans[row])).or_default();
            let truth = truth.at(row);
            if points[row] > 0 && truth.obstacle_points > 0 {
                view.add(keys.index(row), ranges_m[row], truth.object);
            }
        }
        Ok(())
    }
}
