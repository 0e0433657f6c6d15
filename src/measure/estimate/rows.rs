//! The sampled scenes' cells -> what training takes of a row: reading it, learning it, and judging it.
//!
//! Read as training reads it: decoded, checked, laid out row by row in memory that held rows before. Judged: scaled and put through a network of the
//! default size: in f64, as calibration and reports do it, and in f32, as what is left to learn is told. Learnt by the default training from
//! memory, without its looks. CPU seconds of one thread, by every cell that is there.
//! Not measured: checksums of files and reading their footers; what reports read and tally of a row beside its features and output.

use std::sync::atomic::AtomicBool;

use bytes::Bytes;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::EstimateError;
use crate::cells::is_gap;
use crate::corpus::cells::{CellBatch, LABEL, POINTS};
use crate::corpus::{CorpusError, CorpusSpec, FinishedShard, Table};
use crate::measure::clock::{LearningTime, thread_cpu_s};
use crate::random::{Stage, Streams};
use crate::statistics::median;
use crate::train::feature_choice::taken;
use crate::train::memory::{self, Course, Held};
use crate::train::rows::{Rows, Wanted};
use crate::train::{Network, TrainParams};

/// Rows are read again until this is over: a clock of microseconds and a cold cache are then a few percent.
const LEAST_S: f64 = 0.05;
/// Cells that are read at most: what a row takes does not depend on how many there are.
const MOST_CELLS: usize = 200_000;
/// Rows that are learnt, those of later passes counted again: some tenths of a second.
const LEARNT_ROWS: u64 = 150_000;
/// Rows that the trial's looks judge: looks are not counted, and few keep them short.
const LOOK_ROWS: usize = 500;

/// CPU seconds of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RowCost {
    pub reading_s: f64,
    /// `None` where the sampled rows could not be learnt, such as those of one class.
    pub learning_s: Option<f64>,
    /// In f64.
    pub judging_s: f64,
    /// In f32.
    pub judging_f32_s: f64,
}

impl RowCost {
    /// Of several samples, each figure by itself; nothing of none.
    pub(crate) fn median(of: impl Iterator<Item = RowCost>) -> RowCost {
        let of: Vec<RowCost> = of.collect();
        let of_figure = |figure: fn(&RowCost) -> Option<f64>| {
            let found: Vec<f64> = of.iter().filter_map(figure).collect();
            median(&found)
        };
        RowCost {
            reading_s: of_figure(|cost| Some(cost.reading_s)).unwrap_or_default(),
            learning_s: of_figure(|cost| cost.learning_s),
            judging_s: of_figure(|cost| Some(cost.judging_s)).unwrap_or_default(),
            judging_f32_s: of_figure(|cost| Some(cost.judging_f32_s)).unwrap_or_default(),
        }
    }
}

/// Of the default training's features and network; `None` where there are no cells, or none that can be learnt.
pub(super) fn cost(spec: &CorpusSpec, shard: &FinishedShard) -> Result<Option<RowCost>, EstimateError> {
    let path = Table::Cells.path(shard.receipt.shard);
    let Some((_, bytes)) = shard.files.iter().find(|(name, _)| *name == path) else { return Ok(None) };
    let params = TrainParams { allow_few_rows: true, ..TrainParams::default() };
    let columns = spec.features.iter().map(|column| column.name.as_str());
    let is_taken = taken(&params.features, columns.clone());
    let features: Vec<String> = columns.clone().filter(|name| is_taken(name)).map(String::from).collect();
    let seen_alone = columns.clone().any(is_gap) && !features.iter().any(|name| is_gap(name));
    let wanted = Wanted { features: &features, rule: None, seen_alone };
    let bytes = Bytes::from(bytes.clone());
    let mut rows = Rows::new(features.len());
    // The first time is not counted: a training reads into memory that is its own already.
    read(&path, &bytes, &wanted, &mut rows)?;
    if rows.is_empty() {
        return Ok(None);
    }
    let (begun, mut cells) = (thread_cpu_s(), 0);
    while thread_cpu_s() - begun < LEAST_S {
        rows.clear(features.len());
        cells += read(&path, &bytes, &wanted, &mut rows)?;
    }
    let reading_s = (thread_cpu_s() - begun) / cells as f64;
    let validation = rows.clone().thinned(rows.len().div_ceil(LOOK_ROWS));
    let Ok(held) = Held::new(&features, rows, validation, &[1.0], &params) else { return Ok(None) };
    let [judging_s, judging_f32_s] = judging(&held, &params);
    Ok(Some(RowCost { reading_s, learning_s: learning(&held, &params), judging_s, judging_f32_s }))
}

/// Of a row; `None` where the rows cannot be learnt.
fn learning(held: &Held, params: &TrainParams) -> Option<f64> {
    let course = Course { rows: LEARNT_ROWS, ..held.course(params) };
    let mut learning = LearningTime::start();
    let trained = memory::train(params, held, course, &AtomicBool::new(false), &mut |event| learning.hear(event));
    Some(learning.cpu_s / trained.ok()??.rows_learnt as f64)
}

/// Adds the rows of a file of cells, up to [`MOST_CELLS`]; how many cells were read.
fn read(name: &str, bytes: &Bytes, wanted: &Wanted, rows: &mut Rows) -> Result<usize, CorpusError> {
    let refused = |source| CorpusError::Parquet { name: name.to_owned(), source };
    let builder = ParquetRecordBatchReaderBuilder::try_new(bytes.clone()).map_err(refused)?;
    let points = wanted.seen_alone.then_some(POINTS);
    let needed = wanted.features.iter().map(String::as_str).chain([LABEL]).chain(points);
    let mask = ProjectionMask::columns(builder.parquet_schema(), needed);
    let reader = builder.with_projection(mask).with_batch_size(MOST_CELLS).build().map_err(refused)?;
    let mut cells = 0;
    for batch in reader {
        let failed = |reason: String| refused(parquet::errors::ParquetError::General(reason));
        let batch = CellBatch::of(batch.map_err(|error| failed(error.to_string()))?);
        rows.push(&batch, wanted, 0).map_err(failed)?;
        cells += batch.rows();
        if cells >= MOST_CELLS {
            break;
        }
    }
    Ok(cells)
}

/// Of a row, in f64 and in f32.
fn judging(held: &Held, params: &TrainParams) -> [f64; 2] {
    let streams = Streams { seed: 0, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    let network = Network::random(params.layout(held.train.width), &streams);
    let begun_s = thread_cpu_s();
    held.outputs(&network, &held.train);
    let between_s = thread_cpu_s();
    held.objective.sum_here(&network, &held.train);
    [between_s - begun_s, thread_cpu_s() - between_s].map(|all_s| all_s / held.train.len() as f64)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config;
    use crate::corpus::ShardWriter;
    use crate::episode::{Prepared, Scratch, Unobserved, run_scene};

    fn cost_of(config: &str, sets: &[&str]) -> Option<RowCost> {
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        let prepared = Prepared::new(config::load(Path::new(config), &sets).unwrap()).unwrap();
        let spec = prepared.plan.corpus_spec();
        let mut shard = ShardWriter::new(&spec, 0).unwrap();
        for scene in 0..u64::from(spec.scenes_per_shard) {
            shard.push(&run_scene(&prepared, scene, &mut Scratch::default(), &mut Unobserved)).unwrap();
        }
        cost(&spec, &shard.finish().unwrap()).unwrap()
    }

    #[test]
    fn law_rows_cost_something() {
        let few = ["scenes=2", "scenes_per_shard=2", "slam=truth"];
        for config in ["configs/quickstart.yaml", "configs/paper.yaml", "configs/holes.yaml"] {
            let told = cost_of(config, &few).unwrap();
            assert!(told.reading_s > 1e-9 && told.reading_s < 1e-3, "{config}: {told:?}");
            assert!(
                told.learning_s.is_some_and(|learning_s| learning_s > 1e-8 && learning_s < 1e-3),
                "{config}: {told:?}"
            );
            assert!(told.judging_s > 1e-9 && told.judging_s < 1e-3, "{config}: {told:?}");
            assert!(told.judging_f32_s > 1e-9 && told.judging_f32_s < 1e-3, "{config}: {told:?}");
        }
    }

    #[test]
    fn exact_the_median_of_each_figure_by_itself_and_nothing_of_nothing() {
        let of = |reading_s, learning_s| RowCost {
            reading_s,
            learning_s,
            judging_s: 2.0 * reading_s,
            judging_f32_s: reading_s,
        };
        let found = RowCost::median([of(3.0, Some(1.0)), of(1.0, None), of(2.0, Some(3.0))].into_iter());
        assert_eq!(found, of(2.0, Some(2.0)));
        assert_eq!(RowCost::median(std::iter::empty()), RowCost::default());
    }

    #[test]
    fn extreme_a_corpus_without_cells_costs_no_training() {
        let sets = ["scenes=2", "scenes_per_shard=2", "slam=truth", "tables=[scenes, poses]"];
        assert_eq!(cost_of("configs/quickstart.yaml", &sets), None);
    }
}
