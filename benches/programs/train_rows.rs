//! The marsyard side of studies in Python: trains on the rows of one table, in memory and on one thread, and gives back the output
//! for every row.
//!
//! The table is a Parquet file, not compressed or by zstd (`compression="zstd"` in pyarrow). Its columns: `role` (whole number: 0 learn, 1 validate by, anything else only judge), `label` (whole
//! number: 0 traversable, 1 untraversable; null where unknown), and f32 columns, which are the features in their order. The outputs are
//! written as a NumPy array of f64 in row order, NaN where a feature is not finite. The looks at the validation rows, with the CPU seconds
//! until each and what judging a row took, go to stdout as JSON.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, Int8Type, Int32Type, Int64Type};
use arrow_array::{Array, Int64Array, RecordBatch};
use arrow_schema::DataType;
use clap::Parser;
use marsyard::cells::Label;
use marsyard::config::load_train;
use marsyard::measure::clock::thread_cpu_s;
use marsyard::train::memory::{self, Event, Held};
use marsyard::train::rows::Rows;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::{Value as Json, json};

type Fault = Box<dyn std::error::Error>;

/// Train on the rows of a Parquet file (columns `role`, `label` and f32 features) and write the output for each row.
#[derive(Debug, Parser)]
struct Arguments {
    /// Parquet: `role` (0 learn, 1 validate, else judge), `label` (0, 1, null), and f32 columns as features.
    rows: PathBuf,
    /// The outputs, a NumPy file with one f64 a row.
    outputs: PathBuf,
    /// A training config, as `marsyard train` takes it; its `features` and `labels` do not apply.
    #[arg(long)]
    config: Option<PathBuf>,
    /// Override a key: --set network.hidden=[8] (repeatable).
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Look at all rows to validate by, not at as many as the trainer's pace allows.
    #[arg(long)]
    look_at_all: bool,
    /// Learn for so many CPU seconds, looks not counted, and tell the looks up to the first after that; no outputs are written.
    #[arg(long, value_name = "SECONDS")]
    only_looks_of_s: Option<f64>,
}

/// A table as it was read.
struct Table {
    features: Vec<String>,
    /// Row-major.
    values: Vec<f32>,
    labels: Vec<Option<Label>>,
    roles: Vec<i64>,
}

fn main() -> Result<(), Fault> {
    let arguments = Arguments::parse();
    let params = load_train(arguments.config.as_deref(), &arguments.sets).map_err(|error| error.lines())?;
    let table = Table::read(&arguments.rows)?;
    let mut held = Held::new(&table.features, table.of_role(0), table.of_role(1), &[1.0], &params)?;
    if arguments.look_at_all {
        (held.validation, held.looked_every) = (table.of_role(1), 1);
    }
    let mut looks = Vec::new();
    let begun = thread_cpu_s();
    let (mut learning_s, mut since) = (0.0, begun);
    let is_stopped = AtomicBool::new(false);
    let trained = memory::train(&params, &held, held.course(&params), &is_stopped, &mut |event| {
        let now = thread_cpu_s();
        match event {
            Event::Rows(_) => learning_s += now - since,
            Event::Look { look, is_best } => {
                let mut line = json!(look);
                line["best"] = json!(is_best);
                line["cpu_s"] = json!(now - begun);
                line["cpu_learning_s"] = json!(learning_s);
                looks.push(line);
                let is_over = arguments.only_looks_of_s.is_some_and(|limit_s| learning_s > limit_s);
                is_stopped.store(is_over, Ordering::Relaxed);
            }
        }
        since = thread_cpu_s();
    })?;
    if let Some(limit_s) = arguments.only_looks_of_s {
        if trained.is_some() {
            return Err(format!("the training ended within {limit_s} s: give it more epochs and patience").into());
        }
        println!("{:#}", json!({ "looks": looks, "config": params }));
        return Ok(());
    }
    let trained = trained.expect("only the limit above stops it");
    let all = table.all();
    let judging = thread_cpu_s();
    let outputs = held.outputs(&trained.network, &all);
    let judge_us_a_row = (thread_cpu_s() - judging) * 1e6 / all.len() as f64;
    write_npy(&arguments.outputs, &outputs)?;
    let name = |feature: &usize| table.features[*feature].clone();
    let told: Json = json!({
        "train_rows": held.train.len(),
        "validation_rows": held.validation.len(),
        "left_out": held.train.left_out,
        "left_out_of_validation": held.validation.left_out,
        "features": table.features,
        "constant_features": held.constant.iter().map(name).collect::<Vec<_>>(),
        "class_weights": held.objective.weights.class,
        "weights": trained.network.weights.len(),
        "rows_learnt": trained.rows_learnt,
        "stopped": trained.stopped,
        "best": trained.best,
        "counters": trained.counters,
        "cpu_s": since - begun,
        "cpu_learning_s": learning_s,
        "judge_us_a_row": judge_us_a_row,
        "looks": looks,
        "config": params,
    });
    println!("{told:#}");
    Ok(())
}

/// A column of signed integers, widened.
fn integers(column: &dyn Array) -> Option<Int64Array> {
    Some(match column.data_type() {
        DataType::Int8 => column.as_primitive::<Int8Type>().unary(i64::from),
        DataType::Int32 => column.as_primitive::<Int32Type>().unary(i64::from),
        DataType::Int64 => column.as_primitive::<Int64Type>().clone(),
        _ => return None,
    })
}

impl Table {
    fn read(path: &Path) -> Result<Table, Fault> {
        let fault = |reason: String| format!("{}: {reason}", path.display());
        let file = File::open(path).map_err(|error| fault(error.to_string()))?;
        let builder = ParquetRecordBatchReaderBuilder::try_new(file).map_err(|error| fault(error.to_string()))?;
        let fields = builder.schema().fields().clone();
        let others = fields.iter().filter(|field| !["role", "label"].contains(&field.name().as_str()));
        let mut features = Vec::new();
        for field in others {
            if field.data_type() != &DataType::Float32 {
                return Err(
                    fault(format!("column '{}' is {}, features are Float32", field.name(), field.data_type())).into()
                );
            }
            features.push(field.name().clone());
        }
        let mut table = Table { features, values: Vec::new(), labels: Vec::new(), roles: Vec::new() };
        for batch in builder.build()? {
            let batch = batch.map_err(|error| fault(format!("{error}; write it with compression zstd or none")))?;
            table.push(&batch).map_err(&fault)?;
        }
        Ok(table)
    }

    fn push(&mut self, batch: &RecordBatch) -> Result<(), String> {
        let column = |name: &str| batch.column_by_name(name).ok_or(format!("it has no column '{name}'"));
        let whole = |name: &str| {
            integers(column(name)?).ok_or(format!("column '{name}' holds no signed integers of 8, 32 or 64 bits"))
        };
        let (labels, roles) = (whole("label")?, whole("role")?);
        let features = self
            .features
            .iter()
            .map(|name| Ok(column(name)?.as_primitive::<Float32Type>()))
            .collect::<Result<Vec<_>, String>>()?;
        for row in 0..batch.num_rows() {
            self.values.extend(features.iter().map(|f| if f.is_null(row) { f32::NAN } else { f.value(row) }));
            self.labels.push(match labels.is_valid(row).then(|| labels.value(row)) {
                None => None,
                Some(label @ (0 | 1)) => Some(Label::untraversable_if(label == 1)),
                Some(label) => return Err(format!("column 'label' holds {label}; labels are 0, 1 or null")),
            });
            self.roles.push(if roles.is_null(row) { -1 } else { roles.value(row) });
        }
        Ok(())
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.features.len()..][..self.features.len()]
    }

    /// The rows of a role that can be learnt; the others are counted.
    fn of_role(&self, role: i64) -> Rows {
        let mut rows = Rows::new(self.features.len());
        for row in (0..self.labels.len()).filter(|&row| self.roles[row] == role) {
            let Some(label) = self.labels[row] else {
                rows.left_out.unlabelled += 1;
                continue;
            };
            if self.row(row).iter().any(|value| !value.is_finite()) {
                rows.left_out.not_finite += 1;
                continue;
            }
            rows.features.extend(self.row(row));
            rows.labels.push(label);
            rows.corpora.push(0);
        }
        rows
    }

    /// Every row, to judge.
    fn all(&self) -> Rows {
        let labels: Vec<Label> = self.labels.iter().map(|label| label.unwrap_or(Label::Traversable)).collect();
        Rows { features: self.values.clone(), corpora: vec![0; labels.len()], labels, ..Rows::new(self.features.len()) }
    }
}

/// NumPy's format 1.0: a header of 64 or 128 bytes, then the numbers.
fn write_npy(path: &Path, values: &[f64]) -> Result<(), Fault> {
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({},), }}", values.len());
    let ends_at = (10 + header.len() + 1).next_multiple_of(64);
    header.extend(std::iter::repeat_n(' ', ends_at - 10 - header.len() - 1));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len())?.to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    File::create(path)
        .and_then(|mut file| file.write_all(&bytes))
        .map_err(|error| format!("{}: {error}", path.display()).into())
}
