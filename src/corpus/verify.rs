//! A corpus -> what is wrong with it: files against receipts, rows against the schema and against each other.

use std::fmt;

use arrow::array::{Array, Float32Array, Int8Array, RecordBatch};

use super::manifest::{self, Merge};
use super::reader::TableFile;
use super::receipt::{FileFacts, Receipt};
use super::stats::{LabelCounts, Moments};
use super::value_hash::ValueHasher;
use super::{CorpusError, CorpusSpec, Manifest, Store, Table, schema, sha256};

/// Something that is not as it must be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The file.
    pub name: String,
    pub what: String,
    /// The shard to build anew, where that would help.
    pub shard: Option<u64>,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.what)
    }
}

/// Reads every byte of the corpus and checks it: sha256, schema, row counts, value hashes, statistics, manifest.
pub fn verify(store: &dyn Store, spec: &CorpusSpec) -> Result<Vec<Finding>, CorpusError> {
    let mut findings = Vec::new();
    let mut merge = Merge::new(spec);
    let mut receipts = 0;
    for shard in 0..spec.shards() {
        let name = Receipt::path(shard);
        let mut find =
            |name: &str, what: String| findings.push(Finding { name: name.into(), what, shard: Some(shard) });
        if store.size(&name)?.is_none() {
            find(&name, "is missing".into());
            continue;
        }
        let receipt = match Receipt::read(store, shard, &spec.scene_plan_hash) {
            Ok(receipt) => receipt,
            Err(error @ CorpusError::BadReceipt { .. }) => {
                find(&name, error.to_string());
                continue;
            }
            // It may be sound, so nothing here is to be built anew.
            Err(error @ CorpusError::OtherFormat { .. }) => {
                findings.push(Finding { name, what: error.to_string(), shard: None });
                continue;
            }
            Err(error) => return Err(error),
        };
        for &table in &spec.tables {
            match receipt.tables.get(&table) {
                None => find(&name, format!("says nothing of {}", table.name())),
                Some(facts) => {
                    verify_file(store, spec, table, facts, &receipt)?
                        .into_iter()
                        .for_each(|what| find(&facts.path, what));
                }
            }
        }
        merge.add(&receipt);
        receipts += 1;
    }
    if receipts == spec.shards() {
        verify_merged(store, merge, &mut findings)?;
    }
    Ok(findings)
}

/// The files that `finalize` writes, against the receipts.
fn verify_merged(store: &dyn Store, merge: Merge, findings: &mut Vec<Finding>) -> Result<(), CorpusError> {
    let (manifest, shard_lines) = merge.finish();
    let mut find =
        |name: &str, what: &str| findings.push(Finding { name: name.into(), what: what.into(), shard: None });
    match Manifest::read(store) {
        Err(error @ CorpusError::BadManifest { .. }) => find(manifest::NAME, &error.to_string()),
        Err(error) => return Err(error),
        Ok(there) if there != manifest => {
            find(manifest::NAME, "is not what the receipts add up to; run `marsyard finalize` again");
        }
        Ok(_) => {}
    }
    let lines = match store.size(manifest::SHARDS)? {
        None => Vec::new(),
        Some(_) => store.read(manifest::SHARDS)?,
    };
    if lines != shard_lines.as_bytes() {
        find(manifest::SHARDS, "is not what the receipts add up to; run `marsyard finalize` again");
    }
    Ok(())
}

fn verify_file(
    store: &dyn Store,
    spec: &CorpusSpec,
    table: Table,
    facts: &FileFacts,
    receipt: &Receipt,
) -> Result<Vec<String>, CorpusError> {
    if store.size(&facts.path)?.is_none() {
        return Ok(vec!["is missing".into()]);
    }
    let bytes = store.read(&facts.path)?;
    if bytes.len() as u64 != facts.bytes {
        return Ok(vec![format!("has {} bytes, its receipt says {}", bytes.len(), facts.bytes)]);
    }
    if sha256(&bytes) != facts.sha256 {
        return Ok(vec!["its sha256 is not the receipt's: bytes have changed".into()]);
    }
    drop(bytes);
    let file = match TableFile::open(store, &facts.path) {
        Ok(file) => file,
        Err(error) => return damage(error),
    };
    let mut faults = Vec::new();
    let expected = schema::arrow_schema(&schema::columns(table, &spec.features, &spec.drawn));
    if file.schema().fields() != expected.fields() {
        faults.push("its columns are not those of the plan".to_string());
    }
    if file.rows() != facts.rows {
        faults.push(format!("has {} rows, its receipt says {}", file.rows(), facts.rows));
    }
    let mut hasher = ValueHasher::new(file.schema());
    let mut labels = LabelCounts::default();
    let mut moments = vec![Moments::default(); receipt.features.len()];
    for batch in file.batches() {
        let batch = match batch {
            Ok(batch) => batch,
            Err(error) => return damage(error),
        };
        hasher.update(&batch);
        if table == Table::Cells {
            count(&batch, receipt, &mut labels, &mut moments);
        }
    }
    if hasher.finish() != facts.value_hash {
        faults.push("its value hash is not the receipt's: values have changed".into());
    }
    if table == Table::Cells {
        if labels != receipt.labels {
            faults.push(format!("its labels are {labels:?}, the receipt says {:?}", receipt.labels));
        }
        let wrong = receipt.features.iter().zip(&moments).filter(|(said, counted)| said.moments != **counted);
        faults.extend(wrong.map(|(said, _)| format!("the statistics of {} are not the receipt's", said.name)));
    }
    Ok(faults)
}

/// What cannot be read as Parquet is damaged; what the store does not give is not known to be.
fn damage(error: CorpusError) -> Result<Vec<String>, CorpusError> {
    match error {
        CorpusError::Parquet { .. } | CorpusError::Arrow { .. } => Ok(vec![error.to_string()]),
        other => Err(other),
    }
}

fn count(batch: &RecordBatch, receipt: &Receipt, labels: &mut LabelCounts, moments: &mut [Moments]) {
    if let Some(column) = batch.column_by_name("label").and_then(|c| c.as_any().downcast_ref::<Int8Array>()) {
        column.iter().for_each(|label| labels.add(label));
    }
    for (feature, moments) in receipt.features.iter().zip(moments) {
        if let Some(column) =
            batch.column_by_name(&feature.name).and_then(|c| c.as_any().downcast_ref::<Float32Array>())
        {
            column.values().iter().for_each(|&value| moments.add(f64::from(value)));
        }
    }
}
