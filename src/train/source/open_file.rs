//! The address of a row group or scene -> its rows.

use arrow_array::cast::AsArray;
use arrow_array::types::Int64Type;
use arrow_array::{BooleanArray, RecordBatch};
use arrow_select::filter::filter_record_batch;

use super::{Group, SceneAddress, Sources, at, path};
use crate::corpus::Split;
use crate::corpus::checked::Refused;
use crate::corpus::reader::TableFile;
use crate::train::rows::Rows;
use crate::train::{TrainError, labels};

impl Sources {
    /// Adds the rows of a row group.
    pub fn read(&self, split: Split, group: Group, rows: &mut Rows) -> Result<(), TrainError> {
        let file = self.open(split, group.source, group.file, &[])?;
        let batch = file.read(group.group as usize)?;
        rows.features.reserve_exact(batch.num_rows() * rows.width);
        rows.labels.reserve_exact(batch.num_rows());
        rows.corpora.reserve_exact(batch.num_rows());
        file.push(&batch, rows)
    }

    /// Adds the rows of a scene.
    pub fn read_scene(&self, split: Split, address: SceneAddress, rows: &mut Rows) -> Result<(), TrainError> {
        let file = self.open(split, address.source, address.file, &["scene_id"])?;
        for group in 0..file.table.row_groups().len() {
            let batch = file.read(group)?;
            let of_scene = rows_of_scene(&batch, address.scene).map_err(|reason| file.fault(Refused::Other(reason)))?;
            file.push(&of_scene, rows)?;
        }
        Ok(())
    }

    /// A file with the columns that are read of it, and `more` of them.
    fn open(&self, split: Split, source: u16, file: u32, more: &[&'static str]) -> Result<OpenFile<'_>, TrainError> {
        let of = &self.list[usize::from(source)];
        let facts = &of.files[at(split)][file as usize];
        let truth = if self.rule.is_some() { &labels::COLUMNS[..] } else { &[] };
        let features = self.features.iter().map(String::as_str);
        let wanted: Vec<&str> = features.chain(["label"]).chain(more.iter().chain(truth).copied()).collect();
        let open = OpenFile {
            sources: self,
            source,
            name: path(split, facts.shard),
            table: of.open_file(split, facts)?,
            wanted,
        };
        match open.wanted.iter().find(|name| open.table.schema().field_with_name(name).is_err()) {
            Some(absent) => Err(open.fault(Refused::Other(format!("it has no column '{absent}'")))),
            None => Ok(open),
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

    fn read(&self, group: usize) -> Result<RecordBatch, TrainError> {
        self.table.read_row_group(group, Some(&self.wanted)).map_err(|error| self.fault(error.into()))
    }

    fn push(&self, batch: &RecordBatch, rows: &mut Rows) -> Result<(), TrainError> {
        let Sources { features, rule, .. } = self.sources;
        rows.push(batch, features, rule.as_ref(), self.source).map_err(|reason| self.fault(Refused::Other(reason)))
    }
}

fn rows_of_scene(batch: &RecordBatch, scene: u64) -> Result<RecordBatch, String> {
    let column = batch.column_by_name("scene_id").and_then(|column| column.as_primitive_opt::<Int64Type>());
    let ids = column.ok_or("its column 'scene_id' is not Int64")?;
    let mask: BooleanArray = ids.iter().map(|id| Some(id == Some(scene as i64))).collect();
    filter_record_batch(batch, &mask).map_err(|error| error.to_string())
}
