//! A place -> whose it is: the one rule by which every verb writes.
//!
//! A corpus's place is its plan's: `plan.yaml` is the first file written there, and its first line says the scene_plan_hash
//! ([`Place::open`](super::Place::open)). Folders of other verbs' results carry a ledger ([`super::outputs`]); a single file says itself
//! what wrote it. In a place of marsyard's, a file that it did not write is left alone, and is refused where one of its own would
//! take its name.

use std::fs;
use std::io::Read;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use super::limits::{self, FileKind};
use super::{CorpusError, Receipt, Store, Table, card, croissant, finished, listing, manifest, sha256};

/// The rule, as `--help` and every refusal say it.
pub(crate) const RULE: &str = "marsyard writes into a place that is empty, not there yet, or its own; it never replaces a file that it did \
                        not write, nor its own input";

pub(crate) const NOT_WRITTEN: &str = "marsyard did not write, or wrote for another purpose";
pub(crate) const CHANGED: &str = "was changed since marsyard wrote it";
pub(crate) const IS_INPUT: &str = "is an input of this very command";

const OTHER_PLACE: &str = "name another place, or move away what is there";
const MOVE_FILE: &str =
    "move the file away (a copy of it under another name is left alone), and the same command goes on";

/// The times and rates of a build.
pub(crate) const REPORT: &str = "report.json";

/// How a kind of file that marsyard may replace in its own place is known, also where it was cut short or damaged: by how it begins, or
/// by all of some words in it, if there are such.
struct FileSignature {
    begins: &'static str,
    holds: &'static [&'static str],
}

/// What `generate` and `finalize` replace in a corpus. The first two are read by people, who add to them: see [`check_text`].
const DERIVED: [(&str, FileSignature); 5] = [
    (card::NAME, FileSignature { begins: "---\npretty_name: ", holds: &[] }),
    (croissant::NAME, FileSignature { begins: "{\n  \"@context\"", holds: &[] }),
    (manifest::NAME, FileSignature { begins: "{\n  \"format\"", holds: &["\"corpus_id\"", "\"scene_plan_hash\""] }),
    (manifest::SHARDS, FileSignature { begins: "{\"shard\":", holds: &["{\"shard\":", "\"value_hash\":"] }),
    (REPORT, FileSignature { begins: "{\n  \"wall_s\"", holds: &["\"cell_rows_per_s\"", "\"stage_thread_seconds\""] }),
];
const RECEIPT: FileSignature =
    FileSignature { begins: "{\n  \"format\"", holds: &["\"scene_plan_hash\"", "\"shard\""] };
/// As much of a file is looked at.
const HEAD_BYTES: usize = 1 << 20;

/// A refusal to write `name`.
pub(crate) fn foreign(place: String, name: &str, why: &'static str) -> CorpusError {
    CorpusError::Foreign { place, name: name.into(), why, cure: MOVE_FILE }
}

/// Refuses a place that holds anything but what marsyard left there when it was killed in its first moments.
pub(crate) fn check_empty(store: &dyn Store) -> Result<(), CorpusError> {
    match store.first_entry()? {
        None => Ok(()),
        Some(name) => Err(CorpusError::Foreign { place: store.place(), name, why: NOT_WRITTEN, cure: OTHER_PLACE }),
    }
}

/// Refuses a corpus in which a file of another's has the name of one that is merged from the receipts.
pub(crate) fn check_derived(store: &dyn Store) -> Result<(), CorpusError> {
    DERIVED.iter().try_for_each(|(name, look)| check_look(store, name, look))
}

/// How the texts end that people read.
const ENDS: [(&str, &str); 2] = [(card::NAME, card::END), (croissant::NAME, croissant::END)];

/// Refuses to replace a text that people read where they may have edited it, or brought it themselves. It is marsyard's where it is
/// what is to be written now, whole or cut short; where it is what was written last, of this SHA-256; and, where that is not known,
/// where it begins and ends as marsyard's.
pub(crate) fn check_text(store: &dyn Store, name: &str, text: &[u8], last: Option<&str>) -> Result<(), CorpusError> {
    let there = match finished::read_present(store, name, FileKind::Card) {
        Ok(Some(there)) => there,
        Ok(None) => return Ok(()),
        Err(CorpusError::TooLarge { .. }) => return Err(foreign(store.place(), name, CHANGED)),
        Err(error) => return Err(error),
    };
    let ends = ENDS.iter().any(|(of, end)| *of == name && there.ends_with(end.as_bytes()));
    if text.starts_with(&there) || last.map_or(ends, |last| sha256(&there) == last) {
        // How it begins has been asked before anything was written.
        return Ok(());
    }
    Err(foreign(store.place(), name, CHANGED))
}

/// Refuses a shard, to be built anew, in whose place is a file that is not of the plan by its own metadata: it may be somebody's only
/// one. What is too damaged to say is the plan's where a receipt speaks for it.
pub(crate) fn check_shard(store: &dyn Store, scene_plan_hash: &str, shard: u64) -> Result<(), CorpusError> {
    let receipt = Receipt::path(shard);
    check_look(store, &receipt, &RECEIPT)?;
    let has_receipt = store.size(&receipt)?.is_some();
    for path in Table::ALL.map(|table| table.path(shard)) {
        let is_there = store.size(&path)?.is_some_and(|bytes| bytes > 0);
        if is_there && !listing::is_ours(store, &path, scene_plan_hash)?.unwrap_or(has_receipt) {
            return Err(foreign(store.place(), &path, NOT_WRITTEN));
        }
    }
    Ok(())
}

/// Refuses a file that does not look like its kind.
fn check_look(store: &dyn Store, name: &str, look: &FileSignature) -> Result<(), CorpusError> {
    if store.size(name)?.is_none() {
        return Ok(());
    }
    let head = store.read_range(name, 0, HEAD_BYTES)?;
    let shorter = head.len().min(look.begins.len());
    let begins = head[..shorter] == look.begins.as_bytes()[..shorter];
    let holds = |word: &&str| head.windows(word.len()).any(|part| part == word.as_bytes());
    if begins || (!look.holds.is_empty() && look.holds.iter().all(holds)) {
        Ok(())
    } else {
        Err(foreign(store.place(), name, NOT_WRITTEN))
    }
}

/// Refuses to replace a single file that is none of marsyard's, by what `is_ours` says of its bytes, or that is an input. Of what is
/// larger than any model the beginning alone is looked at.
pub(crate) fn check_file(path: &Path, inputs: &[PathBuf], is_ours: impl Fn(&[u8]) -> bool) -> Result<(), CorpusError> {
    let refused = |why| {
        let place = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        Err(foreign(place.display().to_string(), &name, why))
    };
    if fs::symlink_metadata(path).is_err() {
        return Ok(());
    }
    if inputs.iter().any(|input| is_same_file(path, input)) {
        return refused(IS_INPUT);
    }
    let kind = match fs::metadata(path) {
        Ok(facts) => facts.file_type(),
        Err(_) => return refused(NOT_WRITTEN),
    };
    if kind.is_fifo() || kind.is_char_device() {
        return Ok(()); // Nothing is there to be lost.
    }
    let failed = |source| CorpusError::of_path(path, source);
    let ours = kind.is_file() && {
        let mut bytes = Vec::new();
        let file = fs::File::open(path).map_err(failed)?;
        file.take(limits::MODEL_BYTES).read_to_end(&mut bytes).map_err(failed)?;
        bytes.is_empty() || is_ours(&bytes)
    };
    if ours { Ok(()) } else { refused(NOT_WRITTEN) }
}

/// Whether two paths lead to one file, by links or by other spellings too.
pub(crate) fn is_same_file(a: &Path, b: &Path) -> bool {
    let identity = |path: &Path| fs::metadata(path).ok().map(|facts| (facts.dev(), facts.ino()));
    identity(a).is_some_and(|a| identity(b) == Some(a))
}
