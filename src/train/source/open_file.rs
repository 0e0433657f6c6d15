//! The address of a row group or scene -> its rows.

use super::{Group, SceneAddress, Sources, at, path};
use crate::corpus::Split;
use crate::corpus::cells::{CellBatch, KEYS, LABEL, POINTS, check_answers, projection, rule_truth};
use crate::corpus::checked::Refused;
use crate::corpus::reader::TableFile;
use crate::train::TrainError;
use crate::train::rows::{Rows, Wanted};

impl Sources {
    /// Adds the rows of a row group.
    pub fn read(&self, split: Split, group: Group, rows: &mut Rows) -> Result<(), TrainError> {
        let file = self.open(split, group.source, group.file, &[])?;
        let cells = file.read(group.group as usize)?;
        rows.features.reserve_exact(cells.rows() * rows.width);
        rows.labels.reserve_exact(cells.rows());
        rows.corpora.reserve_exact(cells.rows());
        file.push(&cells, rows)
    }

    /// Adds the rows of a scene.
    pub fn read_scene(&self, split: Split, address: SceneAddress, rows: &mut Rows) -> Result<(), TrainError> {
        let file = self.open(split, address.source, address.file, &KEYS[..1])?;
        for group in 0..file.table.row_groups().len() {
            let cells = file.read(group)?;
            let of_scene = cells.of_scene(address.scene).map_err(|reason| file.fault(Refused::Other(reason)))?;
            file.push(&of_scene, rows)?;
        }
        Ok(())
    }

    /// The rows of a row group scene by scene, scenes without rows left out.
    pub(crate) fn read_by_scene(&self, split: Split, group: Group) -> Result<Vec<Rows>, TrainError> {
        let scenes = self.list[usize::from(group.source)].files[at(split)][group.file as usize].scenes.clone();
        let file = self.open(split, group.source, group.file, &KEYS[..1])?;
        let cells = file.read(group.group as usize)?;
        let mut of_scenes = Vec::new();
        for scene in scenes {
            let mut rows = Rows::new(self.features.len());
            let of_scene = cells.of_scene(scene).map_err(|reason| file.fault(Refused::Other(reason)))?;
            file.push(&of_scene, &mut rows)?;
            of_scenes.extend((!rows.is_empty()).then_some(rows));
        }
        Ok(of_scenes)
    }

    /// A file with the columns that are read of it, and `more` of them.
    fn open(&self, split: Split, source: u16, file: u32, more: &[&'static str]) -> Result<OpenFile<'_>, TrainError> {
        let of = &self.list[usize::from(source)];
        let facts = &of.files[at(split)][file as usize];
        let truth = rule_truth(self.rule.as_ref());
        let features = self.features.iter().map(String::as_str);
        let points = self.seen_alone.then_some(POINTS);
        let needed = features.chain([LABEL]).chain(points).chain(more.iter().chain(truth).copied());
        let (name, table) = (path(split, facts.shard), of.open_file(split, facts)?);
        check_answers(self.rule.as_ref(), &table, &of.place())?;
        match projection(&table, needed, &[]) {
            Ok(wanted) => Ok(OpenFile { sources: self, source, name, table, wanted }),
            Err(reason) => Err(of.fault(&name, Refused::Other(reason))),
        }
    }
}

/// A file that rows are read from.
struct OpenFile<'s> {
    sources: &'s Sources,
    source: u16,
    name: String,
    table: TableFile,
    wanted: Vec<&'s str>,
}

impl OpenFile<'_> {
    fn fault(&self, refused: Refused) -> TrainError {
        self.sources.list[usize::from(self.source)].fault(&self.name, refused)
    }

    fn read(&self, group: usize) -> Result<CellBatch, TrainError> {
        CellBatch::read(&self.table, group, &self.wanted).map_err(|error| self.fault(error.into()))
    }

    fn push(&self, cells: &CellBatch, rows: &mut Rows) -> Result<(), TrainError> {
        let Sources { features, rule, seen_alone, .. } = self.sources;
        let wanted = Wanted { features, rule: rule.as_ref(), seen_alone: *seen_alone };
        rows.push(cells, &wanted, self.source).map_err(|reason| self.fault(Refused::Other(reason)))
    }
}
