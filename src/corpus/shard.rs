//! The scenes of one shard, in order -> its files and its receipt.
//!
//! Pure until [`FinishedShard::commit`]: equal scenes give equal bytes, wherever and how often the shard is made.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, Int64Array, RecordBatch};
use arrow_schema::SchemaRef;

use super::receipt::{FailedScene, FeatureMoments, FileFacts, Receipt};
use super::spec::CorpusSpec;
use super::stats::{LabelCounts, Moments, PointCounts, RowMoments};
use super::store::{Put, Store};
use super::write::{FinishedFile, TableWriter};
use super::{Build, CorpusError, FORMAT, PARQUET_FORMAT, Split, Table, schema, tables};
use crate::cells::FeatureColumn;
use crate::episode::{ScanOutput, SceneOutput};

/// zstd's own default; higher levels cost more time than they save space here.
pub(crate) const ZSTD_LEVEL: i32 = 3;

/// Takes the scenes of one shard in order.
pub struct ShardWriter<'a> {
    spec: &'a CorpusSpec,
    shard: u64,
    next_scene: u64,
    tables: BTreeMap<Table, (SchemaRef, TableWriter)>,
    scene_batches: Vec<RecordBatch>,
    moments: RowMoments,
    labels: LabelCounts,
    points: PointCounts,
    failed: Vec<FailedScene>,
}

/// A shard whose bytes are known and not yet in any place.
pub struct FinishedShard {
    pub receipt: Receipt,
    /// Path and bytes of each table.
    pub files: Vec<(String, Vec<u8>)>,
}

impl<'a> ShardWriter<'a> {
    pub fn new(spec: &'a CorpusSpec, shard: u64) -> Result<ShardWriter<'a>, CorpusError> {
        ShardWriter::with_zstd_level(spec, shard, ZSTD_LEVEL)
    }

    /// Another level gives other bytes and the same value hashes: for tests of that promise.
    pub(super) fn with_zstd_level(
        spec: &'a CorpusSpec,
        shard: u64,
        zstd_level: i32,
    ) -> Result<ShardWriter<'a>, CorpusError> {
        let mut writers = BTreeMap::new();
        for &table in &spec.tables {
            let columns = spec.columns(table);
            let arrow = schema::arrow_schema(&columns);
            let range = spec.scenes_of(shard);
            let key_values = [
                ("marsyard.columns", schema::columns_json(&columns)),
                ("marsyard.format", PARQUET_FORMAT.to_string()),
                ("marsyard.scene_plan_hash", spec.scene_plan_hash.clone()),
                ("marsyard.scenes", format!("{}..{}", range.start, range.end)),
                ("marsyard.shard", shard.to_string()),
                ("marsyard.split", Split::of_shard(shard).name().to_string()),
                ("marsyard.table", table.name().to_string()),
            ];
            let writer = TableWriter::new(&arrow, &columns, schema::sort_keys(table), &key_values, zstd_level)
                .map_err(|source| CorpusError::Parquet { name: table.path(shard), source })?;
            writers.insert(table, (arrow, writer));
        }
        Ok(ShardWriter {
            spec,
            shard,
            next_scene: spec.scenes_of(shard).start,
            tables: writers,
            scene_batches: Vec::new(),
            moments: RowMoments::new(spec.features.len()),
            labels: LabelCounts::default(),
            points: PointCounts::default(),
            failed: Vec::new(),
        })
    }

    /// The next scene of the shard.
    pub fn push(&mut self, scene: &SceneOutput) -> Result<(), CorpusError> {
        self.check(scene)?;
        self.next_scene += 1;
        if let Some(error) = &scene.error {
            self.failed.push(FailedScene { scene: scene.scene_id, error: error.clone() });
        }
        for scan in &scene.scans {
            self.count(scan);
            self.write(Table::Cells, |schema, spec| cells_batch(schema, spec, scene, scan))?;
            if let Some(points) = &scan.points {
                self.write(Table::Points, |schema, _| {
                    let rows = tables::points::Row::of_scan(scene.scene_id as i64, scan.scan_id as i32, points);
                    tables::batch(schema, &tables::points::definitions(), &rows, [])
                })?;
            }
        }
        self.write(Table::Poses, |schema, spec| poses_batch(schema, spec, scene))?;
        if let Some((schema, _)) = self.tables.get(&Table::Scenes) {
            let batch = scene_batch(schema, self.spec, scene).map_err(|source| self.arrow(Table::Scenes, source))?;
            self.scene_batches.push(batch);
        }
        Ok(())
    }

    /// The shard's bytes; all its scenes must have been pushed.
    pub fn finish(mut self) -> Result<FinishedShard, CorpusError> {
        let range = self.spec.scenes_of(self.shard);
        if self.next_scene != range.end {
            return Err(self.rows(format!("scene {} is missing", self.next_scene)));
        }
        if let Some((schema, _)) = self.tables.get(&Table::Scenes) {
            // One batch a shard: a row at a time would cost a page each.
            let whole = arrow_select::concat::concat_batches(schema, &self.scene_batches);
            self.write(Table::Scenes, |_, _| whole)?;
        }
        let mut files = Vec::new();
        let mut facts = BTreeMap::new();
        for (table, (_, writer)) in std::mem::take(&mut self.tables) {
            let path = table.path(self.shard);
            let FinishedFile { bytes, rows, row_groups, sha256, value_hash } =
                writer.finish().map_err(|source| CorpusError::Parquet { name: path.clone(), source })?;
            let size = bytes.len() as u64;
            facts.insert(table, FileFacts { path: path.clone(), rows, row_groups, bytes: size, sha256, value_hash });
            files.push((path, bytes));
        }
        let named =
            |(feature, moments): (&FeatureColumn, Moments)| FeatureMoments { name: feature.name.clone(), moments };
        let receipt = Receipt {
            format: FORMAT,
            scene_plan_hash: self.spec.scene_plan_hash.clone(),
            shard: self.shard,
            split: Split::of_shard(self.shard),
            scenes: [range.start, range.end],
            tables: facts,
            features: self.spec.features.iter().zip(self.moments.moments()).map(named).collect(),
            labels: self.labels,
            points: self.points,
            failed: self.failed,
            build: Build::of_this_binary(),
        };
        Ok(FinishedShard { receipt, files })
    }

    fn rows(&self, reason: String) -> CorpusError {
        CorpusError::Rows { shard: self.shard, reason }
    }

    fn arrow(&self, table: Table, source: arrow_schema::ArrowError) -> CorpusError {
        CorpusError::Arrow { name: table.path(self.shard), source }
    }

    /// What the stages promise of a scene; a breach is a bug there, and is told before a byte is written.
    fn check(&self, scene: &SceneOutput) -> Result<(), CorpusError> {
        let id = scene.scene_id;
        let range = self.spec.scenes_of(self.shard);
        if id != self.next_scene || !range.contains(&id) {
            return Err(self.rows(format!("scene {id} came where scene {} was due ({range:?})", self.next_scene)));
        }
        if scene.error.is_some() && !scene.scans.is_empty() {
            return Err(self.rows(format!("scene {id} failed and has scans all the same")));
        }
        if let Some((purpose, _)) = scene.drawn.iter().find(|(purpose, _)| !self.spec.drawn.contains(purpose)) {
            return Err(self.rows(format!("scene {id} draws {}, which the plan does not list", purpose.key())));
        }
        if !scene.scans.windows(2).all(|pair| pair[0].scan_id < pair[1].scan_id) {
            return Err(self.rows(format!("scene {id}: scans do not ascend")));
        }
        for ScanOutput { scan_id, cells, points } in &scene.scans {
            let place = format!("scene {id} scan {scan_id}");
            if cells.features.len() != cells.rows.len() * self.spec.features.len() {
                let (values, rows, columns) = (cells.features.len(), cells.rows.len(), self.spec.features.len());
                return Err(
                    self.rows(format!("{place}: {values} feature values for {rows} rows of {columns} features"))
                );
            }
            if !cells.rows.windows(2).all(|pair| pair[0].index < pair[1].index) {
                return Err(self.rows(format!("{place}: cells do not ascend by (row, col)")));
            }
            if !PointCounts::of(cells).add_up() {
                return Err(self.rows(format!("{place}: points in are not points binned plus points dropped")));
            }
            if points.is_none() && self.tables.contains_key(&Table::Points) {
                return Err(self.rows(format!("{place}: the points table is on, and the scan has no points")));
            }
        }
        Ok(())
    }

    fn count(&mut self, scan: &ScanOutput) {
        self.labels = self.labels + LabelCounts::of(&scan.cells);
        self.points = self.points + PointCounts::of(&scan.cells);
        self.moments.add(&scan.cells.features);
    }

    /// Writes a batch to a table, if the table is on.
    fn write(
        &mut self,
        table: Table,
        batch: impl FnOnce(&SchemaRef, &CorpusSpec) -> Result<RecordBatch, arrow_schema::ArrowError>,
    ) -> Result<(), CorpusError> {
        let name = table.path(self.shard);
        let Some((schema, writer)) = self.tables.get_mut(&table) else { return Ok(()) };
        let batch = batch(schema, self.spec).map_err(|source| CorpusError::Arrow { name: name.clone(), source })?;
        writer.write(&batch).map_err(|source| CorpusError::Parquet { name, source })
    }
}

impl FinishedShard {
    /// Puts the tables, then the receipt: where the receipt is, the shard is whole.
    pub(crate) fn commit(&self, store: &dyn Store) -> Result<Put, CorpusError> {
        for (path, bytes) in &self.files {
            store.put(path, bytes)?;
        }
        self.receipt.put(store)
    }

    /// Takes away what [`FinishedShard::commit`] put, or the part of it that got there: the receipt first.
    pub(crate) fn withdraw(&self, store: &dyn Store) -> Result<(), CorpusError> {
        let receipt = store.remove(&Receipt::path(self.receipt.shard));
        // Each is tried, whatever becomes of the others.
        self.files.iter().map(|(path, _)| store.remove(path)).fold(receipt, Result::and)
    }
}

type Batch = Result<RecordBatch, arrow_schema::ArrowError>;

fn cells_batch(schema: &SchemaRef, spec: &CorpusSpec, scene: &SceneOutput, scan: &ScanOutput) -> Batch {
    let row = |cell| tables::cells::Row { scene_id: scene.scene_id as i64, scan_id: scan.scan_id as i32, cell };
    let rows: Vec<_> = scan.cells.rows.iter().map(row).collect();
    let features = tables::features(&scan.cells, spec.features.len());
    let truth = spec.truth.iter().map(|column| tables::cells::truth(column, &scan.cells));
    tables::batch(schema, &tables::cells::definitions(spec.by_rover, spec.poses), &rows, features.chain(truth))
}

fn poses_batch(schema: &SchemaRef, spec: &CorpusSpec, scene: &SceneOutput) -> Batch {
    let rows: Vec<_> = scene.poses.iter().map(|pose| tables::poses::Row::of(scene.scene_id, pose)).collect();
    tables::batch(schema, &tables::poses::definitions(spec.pose_covariance), &rows, [])
}

fn scene_batch(schema: &SchemaRef, spec: &CorpusSpec, scene: &SceneOutput) -> Batch {
    let drawn = spec.drawn.iter().map(|&purpose| {
        let value = scene.drawn.get(purpose).map(tables::canonical_f64);
        Arc::new(Float64Array::from(vec![value])) as ArrayRef
    });
    let row = tables::scenes::Row::of(scene);
    let losses: Vec<ArrayRef> =
        spec.losses.iter().map(|loss| Arc::new(Int64Array::from(vec![row.sum(loss.take)])) as ArrayRef).collect();
    tables::batch(schema, &tables::scenes::definitions(), &[row], losses.into_iter().chain(drawn))
}
