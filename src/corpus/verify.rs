//! A corpus -> what is wrong with it: files against receipts, rows against the schema and against each other.

use std::fmt;

use arrow_array::RecordBatch;
use arrow_array::types::Int64Type;

use super::belongs::ShardIdentity;
use super::cells::CellBatch;
use super::checked::sha256_of;
use super::finalize::CHANGED_RECEIPT;
use super::finished::{self, Fault, Listed};
use super::limits::FileKind;
use super::listing::{Listing, Stray};
use super::manifest::{self, Merge};
use super::reader::{TableFile, column};
use super::receipt::{FileFacts, Receipt};
use super::stats::{LabelCounts, Moments};
use super::value_hash::ValueHasher;
use super::{Build, CorpusError, CorpusSpec, Manifest, Store, Table, card, croissant, schema, sha256};

const AGAIN: &str = "the same command again checks the one that is there now";

/// Something that is not as it must be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Finding {
    /// The file.
    pub name: String,
    pub what: String,
    /// The shard to build anew, where that would help.
    pub shard: Option<u64>,
    /// It belongs to no shard and is marsyard's: a repair removes it.
    pub is_ours: bool,
}

impl Finding {
    /// In a shard, to be built anew.
    pub(crate) fn in_shard(shard: u64, name: &str, what: String) -> Finding {
        Finding { name: name.into(), what, shard: Some(shard), is_ours: false }
    }

    /// In a file that no shard built anew would mend.
    fn beside(name: &str, what: impl Into<String>) -> Finding {
        Finding { name: name.into(), what: what.into(), shard: None, is_ours: false }
    }

    /// Whether `verify --repair` helps.
    pub(crate) fn is_repairable(&self) -> bool {
        self.shard.is_some() || self.is_ours
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.what)
    }
}

impl From<Fault> for Finding {
    fn from(Fault { name, what, cure }: Fault) -> Finding {
        Finding::beside(&name, format!("{what}; {cure}"))
    }
}

/// Reads every byte of the corpus and checks it: sha256, schema, row counts, value hashes, statistics, whose each file says it is,
/// what lies in its folders, manifest. Where the manifest was signed, its bytes must be those of this SHA-256.
///
/// A receipt is held against its shard and against the hash of it in the list. One that was edited before the first finalize (its
/// failed scenes, counts of points or build, which no table holds) is seen by neither: only building the shard again tells.
pub(crate) fn verify(store: &dyn Store, spec: &CorpusSpec, signed: Option<&str>) -> Result<Vec<Finding>, CorpusError> {
    let mut findings = Vec::new();
    let manifest = match Manifest::read_with_bytes(store) {
        Ok((_, bytes)) if signed.is_some_and(|signed| sha256(&bytes) != signed) => {
            let (place, reason) = (store.place(), "it was replaced since its signature was checked".into());
            return Err(CorpusError::NotWhole { place, name: manifest::NAME.into(), reason, cure: AGAIN.into() });
        }
        Ok(read) => Some(read),
        Err(
            error @ (CorpusError::BadManifest { .. } | CorpusError::NotAFile { .. } | CorpusError::TooLarge { .. }),
        ) => {
            findings.push(Finding::beside(manifest::NAME, error.to_string()));
            None
        }
        Err(error) => return Err(error),
    };
    let mut merge =
        manifest.as_ref().map_or_else(|| Merge::new(spec), |(there, _)| Merge::in_format(spec, there.format));
    let listed = manifest.as_ref().map_or(Ok(Listed::Unknown), |(there, _)| Listed::read(store, there))?;
    let mut receipts = 0;
    for shard in 0..spec.shards() {
        let name = Receipt::path(shard);
        let mut find = |name: &str, what: String| findings.push(Finding::in_shard(shard, name, what));
        let (receipt, bytes) = match Receipt::read_of(store, spec, shard) {
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
                findings.push(Finding::beside(&name, error.to_string()));
                continue;
            }
            Err(error) => return Err(error),
        };
        if listed.has_other(shard, &bytes) {
            // What it says of its tables, and gives to the sums, is nobody's word.
            find(&name, CHANGED_RECEIPT.into());
            continue;
        }
        for (&table, facts) in &receipt.tables {
            verify_file(store, spec, table, facts, &receipt)?.into_iter().for_each(|what| find(&facts.path, what));
        }
        merge.add(&receipt, &bytes);
        receipts += 1;
    }
    findings.extend(strays(store, spec)?);
    if let Some((manifest, bytes)) = manifest {
        let merge = (receipts == spec.shards()).then_some(merge);
        findings.extend(verify_merged(store, &manifest, merge)?);
        if findings.is_empty() {
            findings.extend(verify_texts(store, spec, &manifest, &bytes)?);
        }
    }
    Ok(findings)
}

/// What lies in the folders and is of no shard.
pub(crate) fn strays(store: &dyn Store, spec: &CorpusSpec) -> Result<Vec<Finding>, CorpusError> {
    let listing = Listing::of(store)?;
    let finding = |name: String| {
        let stray = listing.judge(store, &name, &spec.scene_plan_hash, spec.shards())?;
        let is_ours = stray == Stray::Ours;
        Ok(Finding { is_ours, ..Fault::of_stray(&store.place(), name, &stray).into() })
    };
    let names = listing.strays(spec.shards(), |table| spec.tables.contains(&table));
    names.into_iter().map(finding).collect()
}

/// The files that `finalize` writes, against the receipts, where all are there, and against the manifest.
fn verify_merged(store: &dyn Store, there: &Manifest, merge: Option<Merge>) -> Result<Vec<Finding>, CorpusError> {
    let again = "is not what the receipts add up to; run `marsyard finalize` again";
    let find = |name: &str| Finding::beside(name, again);
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
    if merged.receipts_sha256 != there.receipts_sha256 {
        let what = "its receipts_sha256 is not that of the receipts: one was edited since the corpus was finished, or a finalize \
                    was cut off, which `marsyard finalize` then completes";
        findings.push(Finding::beside(manifest::NAME, what));
    } else if (Manifest { files: there.files.clone(), ..merged }) != *there {
        findings.push(find(manifest::NAME));
    }
    if finished::read_present(store, manifest::SHARDS, FileKind::ShardList { shards: there.shards })?.as_deref()
        != Some(shard_lines.as_bytes())
        && findings.iter().all(|finding| finding.name != manifest::SHARDS)
    {
        findings.push(find(manifest::SHARDS));
    }
    Ok(findings)
}

/// Card, Croissant file and manifest byte by byte, where this very program wrote them: an edit whose hash was put into the manifest, or
/// a key that the manifest does not know, is seen by nothing else.
fn verify_texts(
    store: &dyn Store,
    spec: &CorpusSpec,
    manifest: &Manifest,
    bytes: &[u8],
) -> Result<Vec<Finding>, CorpusError> {
    let is_by_another = manifest.format == 1 || !Build::of_this_binary().is_like(&manifest.build);
    if is_by_another || !manifest.other_builds.is_empty() {
        return Ok(Vec::new());
    }
    let read = |name, kind| finished::read_present(store, name, kind).map(Option::unwrap_or_default);
    let texts = [
        (card::NAME, read(card::NAME, FileKind::Card)?, card::text(spec, manifest)),
        (croissant::NAME, read(croissant::NAME, FileKind::Croissant)?, croissant::text(spec, manifest)),
        (manifest::NAME, bytes.to_vec(), manifest.text()),
    ];
    let what = "it is not what this program writes of these receipts, though its hash was made to fit; `marsyard finalize` writes it anew";
    let other = texts.into_iter().filter(|(_, there, wanted)| there != wanted.as_bytes());
    Ok(other.map(|(name, ..)| Finding::beside(name, what)).collect())
}

fn verify_file(
    store: &dyn Store,
    spec: &CorpusSpec,
    table: Table,
    facts: &FileFacts,
    receipt: &Receipt,
) -> Result<Vec<String>, CorpusError> {
    let bytes = match store.size(&facts.path) {
        Ok(Some(bytes)) => bytes,
        Ok(None) => return Ok(vec!["is missing".into()]),
        Err(error @ CorpusError::NotAFile { .. }) => return Ok(vec![error.to_string()]),
        Err(error) => return Err(error),
    };
    if bytes != facts.bytes {
        return Ok(vec![format!("has {bytes} bytes, its receipt says {}", facts.bytes)]);
    }
    // Piece by piece: a table may be larger than memory.
    if sha256_of(store, &facts.path, bytes)? != facts.sha256 {
        return Ok(vec!["its sha256 is not the receipt's: bytes have changed".into()]);
    }
    let file = match TableFile::open(store, &facts.path) {
        Ok(file) => file,
        Err(error) => return damage(error),
    };
    let mut faults = Vec::new();
    let expected = schema::arrow_schema(&spec.columns(table));
    if file.schema().fields() != expected.fields() {
        faults.push("its columns are not those of the plan".to_string());
    }
    if file.rows() != facts.rows {
        faults.push(format!("has {} rows, its receipt says {}", file.rows(), facts.rows));
    }
    let Receipt { scene_plan_hash, shard, split, scenes, .. } = receipt;
    let identity = ShardIdentity { scene_plan_hash, shard: *shard, split: *split, scenes: *scenes };
    faults.extend(identity.check(&file, table).err());
    let (mut strange, mut odd) = (None, None);
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
            let counted = count(&batch, receipt, &mut labels, &mut moments);
            odd = odd.or_else(|| counted.err());
        }
    }
    // What the statistics say of the scenes has been told.
    faults.extend(strange.filter(|_| faults.is_empty()));
    if hasher.finish() != facts.value_hash {
        faults.push("its value hash is not the receipt's: values have changed".into());
    }
    faults.extend(odd);
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

/// Adds a batch's labels and features to the statistics; `Err` names the column that is not as it must be.
fn count(
    batch: &RecordBatch,
    receipt: &Receipt,
    labels: &mut LabelCounts,
    moments: &mut [Moments],
) -> Result<(), String> {
    let cells = CellBatch::of(batch.clone());
    let stored = cells.labels()?;
    (0..cells.rows()).for_each(|row| labels.add(stored.at(row)));
    for (feature, moments) in receipt.features.iter().zip(moments) {
        let values = cells.feature_if_there(&feature.name)?.unwrap_or_default();
        values.iter().for_each(|&value| moments.add(f64::from(value)));
    }
    Ok(())
}
