//! A corpus -> what is wrong with it: files against receipts, rows against the schema and against each other.

use std::fmt;

use arrow_array::types::Int64Type;
use arrow_array::{Array, Float32Array, Int8Array, RecordBatch};

use super::belongs::ShardIdentity;
use super::finished::{self, Fault};
use super::limits::FileKind;
use super::listing::Listing;
use super::manifest::{self, Merge};
use super::reader::{TableFile, column};
use super::receipt::{FileFacts, Receipt};
use super::stats::{LabelCounts, Moments};
use super::value_hash::ValueHasher;
use super::{CorpusError, CorpusSpec, Manifest, Store, Table, card, croissant, schema, sha256};

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

impl From<Fault> for Finding {
    fn from(Fault { name, what, cure }: Fault) -> Finding {
        Finding { name, what: format!("{what}; {cure}"), shard: None }
    }
}

/// Reads every byte of the corpus and checks it: sha256, schema, row counts, value hashes, statistics, whose each file says it is,
/// what lies in its folders, manifest.
///
/// A receipt is held against its shard and against the manifest's hash of all receipts. One that was edited before a finalize (its
/// failed scenes, counts of points or build, which no table holds) is seen by none of these: only building the shard again tells.
pub fn verify(store: &dyn Store, spec: &CorpusSpec) -> Result<Vec<Finding>, CorpusError> {
    let mut findings = Vec::new();
    let manifest = match Manifest::read(store) {
        Ok(manifest) => Some(manifest),
        Err(
            error @ (CorpusError::BadManifest { .. } | CorpusError::NotAFile { .. } | CorpusError::TooLarge { .. }),
        ) => {
            findings.push(Finding { name: manifest::NAME.into(), what: error.to_string(), shard: None });
            None
        }
        Err(error) => return Err(error),
    };
    let mut merge = manifest.as_ref().map_or_else(|| Merge::new(spec), |there| Merge::in_format(spec, there.format));
    let mut receipts = 0;
    for shard in 0..spec.shards() {
        let name = Receipt::path(shard);
        let mut find =
            |name: &str, what: String| findings.push(Finding { name: name.into(), what, shard: Some(shard) });
        let (receipt, bytes) = match Receipt::read_with_bytes(store, shard, &spec.scene_plan_hash) {
            Ok(read) => read,
            Err(CorpusError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                find(&name, "is missing".into());
                continue;
            }
            Err(
                error @ (CorpusError::BadReceipt { .. } | CorpusError::NotAFile { .. } | CorpusError::TooLarge { .. }),
            ) => {
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
        merge.add(&receipt, &bytes);
        receipts += 1;
    }
    findings.extend(strays(store, spec)?);
    if let Some(manifest) = manifest {
        let merge = (receipts == spec.shards()).then_some(merge);
        findings.extend(verify_merged(store, &manifest, merge)?);
    }
    Ok(findings)
}

/// What lies in the folders and is of no shard.
pub fn strays(store: &dyn Store, spec: &CorpusSpec) -> Result<Vec<Finding>, CorpusError> {
    let listing = Listing::of(store)?;
    let names = listing.strays(spec.shards(), |table| spec.tables.contains(&table));
    names
        .iter()
        .map(|name| {
            finished::stray_fault(store, &listing, name, &spec.scene_plan_hash, spec.shards()).map(Finding::from)
        })
        .collect()
}

/// The files that `finalize` writes, against the receipts, where all are there, and against the manifest.
fn verify_merged(store: &dyn Store, there: &Manifest, merge: Option<Merge>) -> Result<Vec<Finding>, CorpusError> {
    let again = "is not what the receipts add up to; run `marsyard finalize` again";
    let find = |name: &str| Finding { name: name.into(), what: again.into(), shard: None };
    let mut findings: Vec<Finding> = finished::plan_fault(store, there)?.into_iter().map(Finding::from).collect();
    let sides = [
        (card::NAME, FileKind::Card),
        (croissant::NAME, FileKind::Croissant),
        (manifest::SHARDS, FileKind::ShardList { shards: there.shards }),
    ];
    for (name, kind) in sides {
        findings.extend(finished::side_fault(store, there, name, kind)?.map(Finding::from));
    }
    let Some((merged, shard_lines)) = merge.map(Merge::finish) else { return Ok(findings) };
    if (Manifest { files: there.files.clone(), receipts_sha256: there.receipts_sha256.clone(), ..merged.clone() })
        != *there
    {
        findings.push(find(manifest::NAME));
    } else if merged.receipts_sha256 != there.receipts_sha256 {
        let what = "its receipts_sha256 is not that of the receipts: one was edited since the corpus was finished";
        findings.push(Finding { name: manifest::NAME.into(), what: what.into(), shard: None });
    }
    if finished::read_present(store, manifest::SHARDS, FileKind::ShardList { shards: there.shards })?.as_deref()
        != Some(shard_lines.as_bytes())
        && findings.iter().all(|finding| finding.name != manifest::SHARDS)
    {
        findings.push(find(manifest::SHARDS));
    }
    Ok(findings)
}

fn verify_file(
    store: &dyn Store,
    spec: &CorpusSpec,
    table: Table,
    facts: &FileFacts,
    receipt: &Receipt,
) -> Result<Vec<String>, CorpusError> {
    match store.size(&facts.path) {
        Ok(Some(_)) => {}
        Ok(None) => return Ok(vec!["is missing".into()]),
        Err(error @ CorpusError::NotAFile { .. }) => return Ok(vec![error.to_string()]),
        Err(error) => return Err(error),
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
    let Receipt { scene_plan_hash, shard, split, scenes, .. } = receipt;
    let identity = ShardIdentity { scene_plan_hash, shard: *shard, split: *split, scenes: *scenes };
    faults.extend(identity.check(&file, table).err());
    let mut strange = None;
    let mut hasher = ValueHasher::new(file.schema());
    let mut labels = LabelCounts::default();
    let mut moments = vec![Moments::default(); receipt.features.len()];
    for batch in file.batches() {
        let batch = match batch {
            Ok(batch) => batch,
            Err(error) => return damage(error),
        };
        hasher.update(&batch);
        strange = strange.or_else(|| check_scenes(&batch, &identity).err());
        if table == Table::Cells {
            count(&batch, receipt, &mut labels, &mut moments);
        }
    }
    // What the statistics say of the scenes has been told.
    faults.extend(strange.filter(|_| faults.is_empty()));
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

/// The scenes of the rows themselves.
fn check_scenes(batch: &RecordBatch, identity: &ShardIdentity) -> Result<(), String> {
    let ids = column::<Int64Type>(batch, "scene_id")?;
    let range = ids.iter().flatten().min().zip(ids.iter().flatten().max());
    range.map_or(Ok(()), |(least, most)| identity.check_scenes(least, most))
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
