//! A place -> the finished corpus that its manifest names, or why it is not that corpus: the one door for every reader.
//!
//! Held against each other: the manifest, the plan, the card, the Croissant file and `shards.jsonl` by their hashes; the lines of
//! `shards.jsonl` by what they add up to; the folders by one listing each. A file's own bytes are checked when it is opened
//! ([`Finished::open_table`]): its hash, and that it says itself that it is this shard's. A corpus that grows, or whose growth was
//! cut off, is refused: its plan is no longer the manifest's.
//!
//! Not seen here: a manifest, list, receipts and tables that were all edited to fit each other. `marsyard verify --rebuild` builds
//! shards again and sees that.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use super::checked::{Expected, Refused};
use super::limits::FileKind;
use super::listing::{Listing, Stray};
use super::manifest::{self, Manifest, ShardLine};
use super::plan_file::{self, Extent};
use super::reader::TableFile;
use super::totals;
use super::{CorpusError, Split, Store, Table, card, croissant, sha256};
use crate::shell;

/// A corpus, whole.
pub struct Finished {
    store: Arc<dyn Store>,
    pub manifest: Manifest,
    pub manifest_sha256: String,
    pub shards_sha256: String,
    /// By shard, ascending.
    pub lines: Vec<ShardLine>,
    /// What could not be checked, for people: a corpus of an earlier format lacks some hashes.
    pub unchecked: Vec<String>,
}

/// Something in a place that is not as the manifest says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    /// The file.
    pub name: String,
    pub what: String,
    pub cure: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; {}", self.name, self.what, self.cure)
    }
}

impl Fault {
    /// A file that belongs to no shard.
    pub(crate) fn of_stray(place: &str, name: String, stray: &Stray) -> Fault {
        let at = shell::word(place);
        let (what, cure) = match stray {
            Stray::Beyond { shard } => (
                format!("it is of shard {shard}, behind the end of the corpus"),
                format!(
                    "`marsyard generate {at} --discard-beyond` removes such shards; with a config of more scenes they belong to it"
                ),
            ),
            Stray::Ours => (
                "it belongs to no shard, and readers that go by *.parquet read it".into(),
                format!("`marsyard verify {at} --repair` removes it"),
            ),
            Stray::Foreign => {
                ("it was not written for this corpus, and readers of the folder read it".into(), "move it away".into())
            }
        };
        Fault { name, what, cure }
    }
}

impl Finished {
    /// Opens the corpus in a place; refuses, with the first thing that is wrong and its cure, whatever is not the corpus that
    /// its manifest names.
    pub fn open(store: &dyn Store) -> Result<Finished, CorpusError> {
        let mut looked = Looked::at(store)?;
        if let Some(Fault { name, what, cure }) = looked.first_fault(store)? {
            let more = looked.faults.len() + looked.strays.len() - 1;
            let more = if more == 0 { String::new() } else { format!(" (and {more} more)") };
            return Err(CorpusError::NotWhole { place: store.place(), name, reason: what + &more, cure });
        }
        Ok(looked.corpus)
    }

    /// Everything that is not as the manifest says.
    pub(crate) fn faults(store: &dyn Store) -> Result<Vec<Fault>, CorpusError> {
        let Looked { corpus, mut faults, strays, listing } = Looked::at(store)?;
        for name in &strays {
            faults.push(stray_fault(store, &listing, name, &corpus.manifest.scene_plan_hash, corpus.manifest.shards)?);
        }
        Ok(faults)
    }

    pub(crate) fn store(&self) -> &dyn Store {
        self.store.as_ref()
    }

    /// The shards of a split, ascending.
    pub fn lines_of(&self, split: Split) -> impl Iterator<Item = &ShardLine> {
        self.lines.iter().filter(move |line| line.split == split)
    }

    /// A table of a shard, its bytes and its own word checked; `None` where the corpus has no such table.
    pub fn open_table(&self, line: &ShardLine, table: Table) -> Result<Option<TableFile>, Refused> {
        let expected = Expected::of(&self.manifest.scene_plan_hash, line, table);
        expected.map(|expected| expected.open_checked(self.store.as_ref())).transpose()
    }

    /// Why a table of a shard could not be opened, as an error of the corpus.
    pub fn refused(&self, line: &ShardLine, table: Table, refused: Refused) -> CorpusError {
        match refused {
            Refused::Store(error) => error,
            Refused::Other(reason) => {
                let (place, at) = (self.store.place(), shell::word(self.store.place()));
                let cure = format!("`marsyard verify {at}` says what else, with --repair it is built anew");
                CorpusError::NotWhole { place, name: table.path(line.shard), reason, cure }
            }
        }
    }
}

/// A place, looked at: what there is of the corpus, and what is wrong with it.
struct Looked {
    corpus: Finished,
    faults: Vec<Fault>,
    /// Files of no shard; what they are is found out when they are told.
    strays: Vec<String>,
    listing: Listing,
}

impl Looked {
    fn at(store: &dyn Store) -> Result<Looked, CorpusError> {
        let (manifest, bytes) = Manifest::read_with_bytes(store)?;
        let mut faults = Vec::from_iter(plan_fault(store, &manifest)?);
        let mut lines = Vec::new();
        let mut shards_sha256 = String::new();
        let mut listing = Listing::none();
        let mut strays = Vec::new();
        // What is told first makes the rest follow: a corpus that grows has other shards, and no list of them adds up.
        if faults.is_empty() {
            (lines, shards_sha256) = shard_lines(store, &manifest, &mut faults)?;
            faults.extend(side_fault(store, &manifest, card::NAME, FileKind::Card)?);
            faults.extend(side_fault(store, &manifest, croissant::NAME, FileKind::Croissant)?);
        }
        if faults.is_empty() {
            listing = Listing::of(store)?;
            strays = listing.strays(manifest.shards, |table| manifest.tables.contains_key(&table));
            let cure = format!("`marsyard verify {} --repair` builds its shard anew", shell::word(store.place()));
            let fault = |(name, what)| Fault { name, what, cure: cure.clone() };
            faults.extend(listing.faults(&manifest, &lines).map(fault));
        }
        let unchecked = unchecked(store, &manifest);
        let manifest_sha256 = sha256(&bytes);
        let corpus = Finished { store: store.share(), manifest, manifest_sha256, shards_sha256, lines, unchecked };
        Ok(Looked { corpus, faults, strays, listing })
    }

    /// The fault to be told where one is.
    fn first_fault(&mut self, store: &dyn Store) -> Result<Option<Fault>, CorpusError> {
        if let Some(fault) = self.faults.first() {
            return Ok(Some(fault.clone()));
        }
        let Some(name) = self.strays.first() else { return Ok(None) };
        let Manifest { scene_plan_hash, shards, .. } = &self.corpus.manifest;
        stray_fault(store, &self.listing, name, scene_plan_hash, *shards).map(Some)
    }
}

/// What cannot be known of a corpus of an earlier format.
fn unchecked(store: &dyn Store, manifest: &Manifest) -> Vec<String> {
    if manifest.format > 1 {
        return Vec::new();
    }
    let (place, at) = (store.place(), shell::word(store.place()));
    vec![format!(
        "{place}: a corpus of format 1: nothing says whether the card, the Croissant file and the receipts are those that it was \
         finished with, nor how many labels of each class a shard has; `marsyard finalize {at}` writes what is missing"
    )]
}

/// Why the plan is not the one that the corpus was finished with, if so.
pub(crate) fn plan_fault(store: &dyn Store, manifest: &Manifest) -> Result<Option<Fault>, CorpusError> {
    let at = shell::word(store.place());
    let anew = format!(
        "`marsyard generate CONFIG --out {at}`, with the config that the corpus was built from, writes it anew"
    );
    let fault = |what: String, cure: String| Some(Fault { name: plan_file::NAME.into(), what, cure });
    let Some(bytes) = read_present(store, plan_file::NAME, FileKind::Config)? else {
        return Ok(fault("it is missing".into(), anew));
    };
    let head = plan_file::head_of(&bytes).filter(|head| head.scene_plan_hash == manifest.scene_plan_hash);
    let there = head.and_then(|head| head.extent);
    let finished = Extent::from(manifest);
    match there {
        Some(there) if (there.seed, there.scenes_per_shard) != (finished.seed, finished.scenes_per_shard) => Ok(fault(
            format!(
                "it has seed {} and {} scenes a shard, the corpus was finished with seed {} and {}: no growth leads from one to the other",
                there.seed, there.scenes_per_shard, finished.seed, finished.scenes_per_shard
            ),
            anew,
        )),
        Some(there) if there != finished => Ok(fault(
            format!(
                "it plans {} scenes of '{}', the corpus was finished with {} of '{}': it grows, or was left while it grew",
                there.scenes, there.name, finished.scenes, finished.name
            ),
            // Fewer than there are: what is behind the end must be let go by name.
            match there.scenes < finished.scenes {
                true => format!("`marsyard generate {at} --discard-beyond` completes it"),
                false => format!("`marsyard generate {at}` completes it"),
            },
        )),
        Some(_) if manifest.format == 1 || manifest.files.get(plan_file::NAME) == Some(&sha256(&bytes)) => Ok(None),
        _ => Ok(fault("it is not the plan that the corpus was finished with: it was edited or damaged".into(), anew)),
    }
}

/// Why a file that `finalize` writes is not the one it wrote, if so.
pub(crate) fn side_fault(
    store: &dyn Store,
    manifest: &Manifest,
    name: &str,
    kind: FileKind,
) -> Result<Option<Fault>, CorpusError> {
    let Some(expected) = manifest.files.get(name) else { return Ok(None) };
    let there = read_present(store, name, kind)?;
    Ok(unlike(store, name, there.as_deref().map(sha256).as_deref(), expected))
}

fn unlike(store: &dyn Store, name: &str, there: Option<&str>, expected: &str) -> Option<Fault> {
    let what = match there {
        Some(there) if there == expected => return None,
        Some(_) => "its SHA-256 is not the manifest's: it was edited or damaged, or a finalize was cut off",
        None => "it is missing",
    };
    let anew = format!("`marsyard finalize {}` writes it anew from the receipts", shell::word(store.place()));
    // People may have added something of their own, which finalize does not replace.
    let cure = if there.is_some() && [card::NAME, croissant::NAME].contains(&name) {
        format!("move away what was edited by hand, and {anew}")
    } else {
        anew
    };
    Some(Fault { name: name.into(), what: what.into(), cure })
}

/// The lines of `shards.jsonl` and its hash; what is wrong with it is added to the faults.
fn shard_lines(
    store: &dyn Store,
    manifest: &Manifest,
    faults: &mut Vec<Fault>,
) -> Result<(Vec<ShardLine>, String), CorpusError> {
    let kind = FileKind::ShardList { shards: manifest.shards };
    let bytes = read_present(store, manifest::SHARDS, kind)?;
    let there = bytes.as_deref().map(sha256);
    let expected = manifest.files.get(manifest::SHARDS).or(there.as_ref()).map_or("", String::as_str);
    faults.extend(unlike(store, manifest::SHARDS, there.as_deref(), expected));
    let (Some(bytes), Some(there), true) = (bytes, there, faults.is_empty()) else { return Ok(Default::default()) };
    let parsed = manifest::parse_shard_lines(&bytes).map_err(|reason| format!("it cannot be read: {reason}"));
    match parsed.and_then(|lines| totals::disagreement(manifest, &lines).map_or(Ok(lines), Err)) {
        Ok(lines) => Ok((lines, there)),
        Err(what) => {
            let cure = format!("`marsyard finalize {}` writes both anew from the receipts", shell::word(store.place()));
            faults.push(Fault { name: manifest::SHARDS.into(), what, cure });
            Ok(Default::default())
        }
    }
}

/// What the list of shards in a place is to the manifest there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Listed {
    /// The manifest's own: the SHA-256 of each shard's receipt, by shard, as the corpus was finished with them.
    Own(HashMap<u64, String>),
    /// A whole list that the manifest does not name: a finalize was cut off between the two.
    Other,
    /// None, or damaged; or of format 1, which knew no hashes.
    Unknown,
}

impl Listed {
    pub(crate) fn read(store: &dyn Store, manifest: &Manifest) -> Result<Listed, CorpusError> {
        // A growth may have left a longer one.
        let kind = FileKind::ShardList { shards: u64::MAX };
        let bytes = match read_present(store, manifest::SHARDS, kind) {
            Err(CorpusError::TooLarge { .. }) => None,
            other => other?,
        };
        let Some(lines) = bytes.as_deref().and_then(|bytes| manifest::parse_shard_lines(bytes).ok()) else {
            return Ok(Listed::Unknown);
        };
        if manifest.files.get(manifest::SHARDS) != bytes.as_deref().map(sha256).as_ref() {
            return Ok(Listed::Other);
        }
        let receipts = lines.into_iter().map(|line| Some((line.shard, line.receipt_sha256?))).collect::<Option<_>>();
        Ok(receipts.map_or(Listed::Unknown, Listed::Own))
    }

    /// Whether a shard is listed with another receipt than one of these bytes.
    pub(crate) fn has_other(&self, shard: u64, receipt: &[u8]) -> bool {
        let Listed::Own(receipts) = self else { return false };
        receipts.get(&shard).is_some_and(|there| *there != sha256(receipt))
    }
}

/// A stray in words.
pub(crate) fn stray_fault(
    store: &dyn Store,
    listing: &Listing,
    name: &str,
    scene_plan_hash: &str,
    shards: u64,
) -> Result<Fault, CorpusError> {
    let stray = listing.judge(store, name, scene_plan_hash, shards)?;
    Ok(Fault::of_stray(&store.place(), name.into(), &stray))
}

/// The bytes of a file, or `None` where there is none.
pub(crate) fn read_present(store: &dyn Store, name: &str, kind: FileKind) -> Result<Option<Vec<u8>>, CorpusError> {
    match kind.read(store, name) {
        Err(CorpusError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(None),
        other => other.map(Some),
    }
}
