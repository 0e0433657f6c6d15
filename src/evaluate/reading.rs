//! The cells of one split of a corpus -> the judge, row group by row group.
//!
//! Row groups hold whole scans, so a scan is judged at once. Every file's size and sha256 are checked before a row of it is judged. Two row
//! groups are in memory: one that is judged, and the next one, which another thread reads meanwhile.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::columns::{self, Columns, Scans};
use super::corpus::{EvaluateError, FamilyFacts};
use super::judge::Judge;
use crate::cells::LabelRule;
use crate::corpus::advice::CellGrid;
use crate::corpus::cells::{CellBatch, check_answers};
use crate::corpus::checked::Refused;
use crate::corpus::kept_poses::{self, kept_poses};
use crate::corpus::manifest::ShardLine;
use crate::corpus::reader::TableFile;
use crate::corpus::{Finished, Split, Table, families_of_scenes};
use crate::geometry::Pose;
use crate::train::Model;

/// Reads a corpus for the judge.
pub(super) struct Reader<'a> {
    pub model: &'a Model,
    pub corpus: &'a Finished,
    pub families: &'a [FamilyFacts],
    /// Labels by another rule than the corpus's.
    pub labels: Option<&'a LabelRule>,
}

/// A shard, open.
struct Shard<'m> {
    cells: TableFile,
    /// The columns to read.
    wanted: Vec<&'m str>,
    family_of: BTreeMap<i64, String>,
    poses: HashMap<kept_poses::Scan, Pose>,
}

/// One row group of a shard's file of cells.
struct RowGroup<'m> {
    shard: Arc<Shard<'m>>,
    number: usize,
}

/// The scans of a row group, with the model's outputs.
struct GroupToJudge<'m> {
    shard: Arc<Shard<'m>>,
    scans: Scans,
    outputs: Vec<f64>,
}

impl<'a> Reader<'a> {
    /// Runs the cells of a split through the judge, those of some families where any is named; also the number of scans. While a row group
    /// is judged the next one is read and its outputs are formed.
    pub(super) fn judge(&self, split: Split, only: &[String], mut judge: Judge) -> Result<(Judge, u64), EvaluateError> {
        let mut groups = self.corpus.lines_of(split).flat_map(|line| self.groups(line));
        let mut next = || groups.next().map(|group| self.read(&group?, only));
        let (mut count, mut now) = (0, next().transpose()?);
        while let Some(group) = now {
            let (following, ()) = rayon::join(&mut next, || self.add(&group, &mut judge));
            count += group.scans.ends.len() as u64;
            now = following.transpose()?;
        }
        Ok((judge, count))
    }

    /// The row groups of a shard's cells.
    fn groups(&self, line: &ShardLine) -> Vec<Result<RowGroup<'a>, EvaluateError>> {
        match self.shard(line) {
            Err(error) => vec![Err(error)],
            Ok(None) => Vec::new(),
            Ok(Some(shard)) => {
                let shard = Arc::new(shard);
                let group = |number| Ok(RowGroup { shard: Arc::clone(&shard), number });
                (0..shard.cells.row_groups().len()).map(group).collect()
            }
        }
    }

    /// `None` where the shard has no cells.
    fn shard(&self, line: &ShardLine) -> Result<Option<Shard<'a>>, EvaluateError> {
        let Some(cells) = self.open(line, Table::Cells)? else { return Ok(None) };
        let family_of = self.families_of_scenes(line)?;
        let poses = self.poses(line)?;
        check_answers(self.labels, &cells, &self.corpus.store().place())?;
        let wanted =
            columns::wanted(&cells, self.model, self.labels).map_err(|reason| self.fault(cells.name(), reason))?;
        Ok(Some(Shard { cells, wanted, family_of, poses }))
    }

    /// Reads a row group and forms the outputs of its scans.
    fn read(
        &self,
        RowGroup { shard, number }: &RowGroup<'a>,
        only: &[String],
    ) -> Result<GroupToJudge<'a>, EvaluateError> {
        let Shard { cells: table, wanted, family_of, .. } = &**shard;
        let wanted_scene =
            |scene: i64| only.is_empty() || family_of.get(&scene).is_some_and(|family| only.contains(family));
        let cells = CellBatch::read(table, *number, wanted).map_err(|e| self.refused(table.name(), e.into()))?;
        let columns = Columns::of(&cells, self.model, self.labels).map_err(|r| self.fault(table.name(), r))?;
        let mut scans = columns.scans(wanted_scene);
        let outputs = self.model.outputs_in_parallel(&std::mem::take(&mut scans.features));
        Ok(GroupToJudge { shard: Arc::clone(shard), scans, outputs })
    }

    /// A file of the corpus, its bytes checked.
    fn open(&self, line: &ShardLine, table: Table) -> Result<Option<TableFile>, EvaluateError> {
        let opened = self.corpus.open_table(line, table);
        opened.map_err(|refused| self.refused(&table.path(line.shard), refused))
    }

    fn refused(&self, name: &str, refused: Refused) -> EvaluateError {
        match refused {
            Refused::Other(reason) => self.fault(name, reason),
            Refused::Store(error) => EvaluateError::Corpus(error),
        }
    }

    fn fault(&self, name: &str, reason: String) -> EvaluateError {
        EvaluateError::Table { place: self.corpus.store().place(), name: name.into(), reason }
    }

    /// Hands scans to the judge, one at a time.
    fn add(&self, GroupToJudge { shard, scans, outputs }: &GroupToJudge, judge: &mut Judge) {
        let Shard { family_of, poses, .. } = &**shard;
        judge.unknown_cells += scans.unknown_cells;
        judge.not_finite_cells += scans.not_finite_cells;
        let mut start = 0;
        for &(key @ (scene, _), end) in &scans.ends {
            let (cells, outputs) = (&scans.cells[start..end], &outputs[start..end]);
            start = end;
            let family = family_of.get(&scene).map_or("", String::as_str);
            let facts = self.families.iter().find(|facts| facts.name == family);
            judge.begin_scene(scene);
            judge.add_scan(family, facts.map_or("", |facts| facts.sensor.as_str()), cells, outputs);
            if let Some((pose, facts)) = poses.get(&key).zip(facts) {
                let grid = CellGrid { size_m: facts.cell_size_m, frame: facts.frame };
                judge.add_places(cells, outputs, |index| grid.seen_from_rover_m(index, pose));
            }
        }
    }

    /// Where the rover is believed to stand at each scan; empty where the corpus has no `poses` table.
    fn poses(&self, line: &ShardLine) -> Result<HashMap<kept_poses::Scan, Pose>, EvaluateError> {
        let poses = self.open(line, Table::Poses)?;
        poses.map_or(Ok(HashMap::new()), |table| kept_poses(&table).map_err(EvaluateError::Corpus))
    }

    /// Family by scene, from the small `scenes` table; empty where the corpus has none.
    fn families_of_scenes(&self, line: &ShardLine) -> Result<BTreeMap<i64, String>, EvaluateError> {
        let Some(table) = self.open(line, Table::Scenes)? else { return Ok(BTreeMap::new()) };
        families_of_scenes(&table).map_err(|error| self.refused(table.name(), error))
    }
}
