//! The sampled scenes -> a shard's bytes and the time of making them.
//!
//! Each file is a line: bytes = fixed + rows x slope, through the sample's first half and the whole of it. All threads write
//! the same shard at once, as in a build; the time for other rows is taken in proportion to their bytes.

use super::EstimateError;
use super::strata::{Figure, Sample};
use crate::corpus::{CorpusError, CorpusSpec, FinishedShard, ShardWriter, Table};
use crate::episode::SceneOutput;
use crate::measure::clock::{Seconds, thread_cpu_s};
use crate::parallel;

/// The shard of a sample, and lines through it.
pub(super) struct Encoded {
    /// Of the whole sample, and of its first half.
    pub whole: FinishedShard,
    pub half: FinishedShard,
    files: Vec<File>,
    receipt_bytes: f64,
    seconds: Seconds,
    alone_s: Vec<(Table, f64)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct File {
    table: Table,
    fixed_bytes: f64,
    bytes_per_row: f64,
}

impl File {
    /// The line through two files; where they tell nothing apart, all bytes are the rows'.
    fn through(table: Table, half: (f64, f64), whole: (f64, f64)) -> File {
        let slope = (whole.1 - half.1) / (whole.0 - half.0);
        let fixed_bytes = whole.1 - slope * whole.0;
        if slope > 0.0 && fixed_bytes >= 0.0 && fixed_bytes.is_finite() {
            return File { table, fixed_bytes, bytes_per_row: slope };
        }
        File { table, fixed_bytes: 0.0, bytes_per_row: whole.1 / whole.0.max(1.0) }
    }
}

/// Bytes of a shard's tables.
pub(super) fn bytes_of(shard: &FinishedShard) -> f64 {
    shard.files.iter().map(|(_, bytes)| bytes.len() as f64).sum()
}

pub(super) fn encode(spec: &CorpusSpec, outputs: Vec<SceneOutput>, threads: usize) -> Result<Encoded, EstimateError> {
    // Numbered anew: the scenes of one shard.
    let outputs: Vec<_> = (0u64..).zip(outputs).map(|(scene_id, scene)| SceneOutput { scene_id, ..scene }).collect();
    let half = shard(spec, &outputs[..outputs.len().div_ceil(2)], &spec.tables)?;
    let timed = || {
        let (cpu, wall) = (thread_cpu_s(), std::time::Instant::now());
        let shard = shard(spec, &outputs, &spec.tables)?;
        Ok((shard, Seconds { cpu: thread_cpu_s() - cpu, wall: wall.elapsed().as_secs_f64() }))
    };
    let made = parallel::on_every_thread(threads, timed)?;
    let made = made.into_iter().collect::<Result<Vec<_>, CorpusError>>()?;
    let mean = |of: fn(&Seconds) -> f64| made.iter().map(|(_, s)| of(s)).sum::<f64>() / threads as f64;
    let seconds = Seconds { cpu: mean(|s| s.cpu), wall: mean(|s| s.wall) };
    let whole = made.into_iter().next().expect("there is at least one thread").0;
    let point = |shard: &FinishedShard, table| {
        let facts = &shard.receipt.tables[table];
        (facts.rows as f64, facts.bytes as f64)
    };
    let files = spec.tables.iter().map(|t| File::through(*t, point(&half, t), point(&whole, t))).collect();
    let receipt_bytes = serde_json::to_string_pretty(&whole.receipt).map_or(0.0, |text| text.len() as f64);
    let alone_s = spec.tables.iter().map(|&table| {
        let cpu = thread_cpu_s();
        shard(spec, &outputs, &[table])?;
        Ok((table, thread_cpu_s() - cpu))
    });
    let alone_s = alone_s.collect::<Result<_, CorpusError>>()?;
    Ok(Encoded { whole, half, files, receipt_bytes, seconds, alone_s })
}

fn shard(spec: &CorpusSpec, outputs: &[SceneOutput], tables: &[Table]) -> Result<FinishedShard, CorpusError> {
    let count = outputs.len() as u32;
    let tables = tables.to_vec();
    let spec = CorpusSpec { scenes: u64::from(count), scenes_per_shard: count, tables, ..spec.clone() };
    let mut writer = ShardWriter::new(&spec, 0)?;
    outputs.iter().try_for_each(|output| writer.push(output))?;
    writer.finish()
}

impl Encoded {
    /// Bytes of all shards of the plan, receipts included.
    pub(super) fn bytes(&self, sample: &Sample, shards: u64) -> Figure {
        let rows = sample.total(|cost| self.files.iter().map(|f| f.bytes_per_row * cost.rows[f.table as usize]).sum());
        let fixed: f64 = self.files.iter().map(|file| file.fixed_bytes).sum();
        Figure { value: rows.value + (fixed + self.receipt_bytes) * shards as f64, ..rows }
    }

    /// CPU and wall seconds of making so many bytes, on one of the threads.
    pub(super) fn seconds(&self, bytes: f64) -> (f64, f64) {
        let share = bytes / bytes_of(&self.whole).max(1.0);
        (self.seconds.cpu * share, self.seconds.wall * share)
    }

    /// Such a time, shared out among the tables as they took it one by one.
    pub(crate) fn tables_s(&self, seconds: f64) -> Vec<(Table, f64)> {
        let all: f64 = self.alone_s.iter().map(|(_, alone_s)| alone_s).sum();
        self.alone_s.iter().map(|(table, alone_s)| (*table, seconds * alone_s / all.max(1e-9))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_line_through_two_files() {
        let file = File::through(Table::Cells, (100.0, 700.0), (300.0, 1100.0));
        assert_eq!(file, File { table: Table::Cells, fixed_bytes: 500.0, bytes_per_row: 2.0 });
        // One scene: both files are the same, and all of it is the rows'.
        let file = File::through(Table::Cells, (100.0, 700.0), (100.0, 700.0));
        assert_eq!(file, File { table: Table::Cells, fixed_bytes: 0.0, bytes_per_row: 7.0 });
    }
}
