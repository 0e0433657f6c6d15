//! `search.jsonl`: what a search was begun with, and a line for every network trained as far as a rung.
//!
//! The first line is written whole and synced before anything else; whoever writes holds a lock on the file. Each other line is
//! written by one call and carries a checksum, so that a kill leaves whole lines and at most one torn one at the end. From the first
//! line on that is not whole, all are cut off when the search goes on: those networks are trained again, to the same entries. Lines
//! stand in the order in which networks were finished, which differs from run to run; what they say does not, but for the seconds.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use super::entry::Entry;
use super::networks::Hidden;
use crate::corpus::{CorpusError, LocalFolder, Store, sha256};
use crate::train::{TrainError, lock};

pub(crate) const NAME: &str = "search.jsonl";
/// In what is searched on: the SHA-256 of the corpus's `shards.jsonl`.
pub const SHARDS: &str = "shards_sha256";
/// Of a line: the first digits of the SHA-256 of the line without it. Lines of earlier searches have none.
const CHECKSUM: &str = "checksum";

/// Open at its end, and locked.
pub struct Journal {
    path: PathBuf,
    file: File,
    /// By rung and network.
    entries: BTreeMap<(usize, Hidden), Entry>,
}

impl Journal {
    /// Begins one, with `identity` as its first line, or goes on with one that was begun with the same.
    pub fn open(folder: &Path, identity: &Json) -> Result<Journal, TrainError> {
        let first = format!("{}\n", json!({"search": identity}));
        match LocalFolder::new(folder).put(NAME, first.as_bytes()) {
            // There is one already.
            Ok(_) | Err(CorpusError::Differs { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        let path = folder.join(NAME);
        let mut journal = Journal { file: lock::hold(&path)?, path, entries: BTreeMap::new() };
        let mut bytes = Vec::new();
        journal.file.read_to_end(&mut bytes).map_err(|source| io(&journal.path, source))?;
        if !bytes.contains(&b'\n') && !first.as_bytes().starts_with(&bytes) {
            let reason =
                format!("its {NAME} was begun by no such search; move that file away, or choose another --out");
            return Err(TrainError::NoRun { path: folder.display().to_string(), reason });
        }
        let whole = journal.take_lines(&bytes, identity)?;
        journal.file.set_len(whole as u64).map_err(|source| io(&journal.path, source))?;
        if whole == 0 {
            journal.append(first.as_bytes())?;
        }
        Ok(journal)
    }

    /// Takes in the entries of all lines before the first that is not whole; how many bytes these lines have.
    fn take_lines(&mut self, bytes: &[u8], identity: &Json) -> Result<usize, TrainError> {
        let mut lines = bytes.split_inclusive(|&byte| byte == b'\n').filter(|line| line.ends_with(b"\n"));
        let Some(first) = lines.next() else { return Ok(0) };
        let begun: Json = serde_json::from_slice(first).map_err(|error| TrainError::BadState {
            path: self.path.display().to_string(),
            reason: format!("its first line, which says what was begun, is broken ({error})"),
        })?;
        check(&self.path, &begun["search"], identity)?;
        let mut whole = first.len();
        for line in lines {
            let Some(entry) = entry_of(line) else { break };
            self.entries.insert((entry.rung, entry.hidden.clone()), entry);
            whole += line.len();
        }
        Ok(whole)
    }

    pub fn get(&self, rung: usize, hidden: &[usize]) -> Option<&Entry> {
        self.entries.get(&(rung, hidden.to_vec()))
    }

    /// Lines, less the first.
    pub fn trainings(&self) -> usize {
        self.entries.len()
    }

    pub(crate) fn push(&mut self, entry: Entry) -> Result<(), TrainError> {
        self.append(line_of(&entry).as_bytes())?;
        self.entries.insert((entry.rung, entry.hidden.clone()), entry);
        Ok(())
    }

    /// Waits until it is on disk.
    pub(crate) fn sync(&self) -> Result<(), TrainError> {
        self.file.sync_all().map_err(|source| io(&self.path, source))
    }

    fn append(&mut self, line: &[u8]) -> Result<(), TrainError> {
        self.file.write_all(line).map_err(|source| io(&self.path, source))
    }
}

fn line_of(entry: &Entry) -> String {
    let mut line = json!(entry);
    line[CHECKSUM] = digits(&line).into();
    format!("{line}\n")
}

/// The entry of a line, where it is whole.
fn entry_of(line: &[u8]) -> Option<Entry> {
    let mut line: Json = serde_json::from_slice(line).ok()?;
    if let Some(there) = line.as_object_mut()?.remove(CHECKSUM)
        && there != digits(&line)
    {
        return None;
    }
    serde_json::from_value(line).ok()
}

fn digits(line: &Json) -> String {
    sha256(line.to_string().as_bytes())[..16].to_string()
}

fn io(path: &Path, source: std::io::Error) -> TrainError {
    TrainError::Io { path: path.display().to_string(), source }
}

fn check(path: &Path, there: &Json, here: &Json) -> Result<(), TrainError> {
    let mut differences = Vec::new();
    let mut here = here.clone();
    if let Some(data) = here["data"].as_object_mut().filter(|_| there["data"].get(SHARDS).is_none()) {
        // A search of an earlier marsyard did not note it.
        data.remove(SHARDS);
    }
    compare("", there, &here, &mut differences);
    if differences.is_empty() {
        return Ok(());
    }
    let folder = path.parent().unwrap_or(path);
    Err(TrainError::OtherRun { path: folder.display().to_string(), what: differences.join(", ") })
}

/// Names the keys whose values differ.
fn compare(key: &str, there: &Json, here: &Json, differences: &mut Vec<String>) {
    match (there, here) {
        (Json::Object(a), Json::Object(b)) => {
            let missing = b.keys().filter(|name| !a.contains_key(*name));
            for name in a.keys().chain(missing) {
                let inner = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                compare(&inner, a.get(name).unwrap_or(&Json::Null), b.get(name).unwrap_or(&Json::Null), differences);
            }
        }
        _ if there != here => differences.push(format!("'{key}' was {there} and is {here} now")),
        _ => (),
    }
}

#[cfg(test)]
mod tests {
    use super::super::rungs::tests::entry;
    use super::*;

    #[test]
    fn equal_a_journal_after_any_cut_holds_its_whole_lines() {
        let dir = tempfile::tempdir().unwrap();
        let identity = json!({"rows": 3, "config": {"seed": 1}});
        let mut journal = Journal::open(dir.path(), &identity).unwrap();
        let entries = [entry(&[1], 10, 0.5), entry(&[2, 2], 20, f64::NAN), entry(&[4], 40, 0.2)];
        entries.iter().for_each(|entry| journal.push(entry.clone()).unwrap());
        drop(journal);
        let path = dir.path().join(NAME);
        let bytes = std::fs::read(&path).unwrap();
        for cut in 0..=bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let mut journal = Journal::open(dir.path(), &identity).unwrap();
            let whole = bytes[..cut].iter().filter(|&&byte| byte == b'\n').count().saturating_sub(1);
            assert_eq!(journal.trainings(), whole, "{cut}");
            entries[whole..].iter().for_each(|entry| journal.push(entry.clone()).unwrap());
            assert!(std::fs::read(&path).unwrap() == bytes, "{cut}");
        }
    }

    #[test]
    fn exact_a_search_begun_otherwise_is_refused_with_what_differs() {
        let dir = tempfile::tempdir().unwrap();
        Journal::open(dir.path(), &json!({"rows": 3, "config": {"seed": 1, "clip": 8}})).unwrap();
        let here = json!({"rows": 4, "config": {"seed": 1, "clip": 5}});
        let error = Journal::open(dir.path(), &here).err().unwrap().to_string();
        assert!(error.contains("'rows' was 3 and is 4 now, 'config.clip' was 8 and is 5 now"), "{error}");
    }

    #[test]
    fn extreme_a_flipped_byte_costs_its_line_and_those_behind_it() {
        let dir = tempfile::tempdir().unwrap();
        let identity = json!({});
        let entries = [entry(&[1], 10, 0.5), entry(&[2], 20, 0.25), entry(&[3], 30, 0.125)];
        let mut journal = Journal::open(dir.path(), &identity).unwrap();
        entries.iter().for_each(|entry| journal.push(entry.clone()).unwrap());
        drop(journal);
        let path = dir.path().join(NAME);
        let whole = std::fs::read(&path).unwrap();
        let ends: Vec<usize> = (0..whole.len()).filter(|&at| whole[at] == b'\n').collect();
        for at in ends[1] + 1..ends[2] {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            std::fs::write(&path, bytes).unwrap();
            let journal = Journal::open(dir.path(), &identity).unwrap();
            assert_eq!((journal.trainings(), journal.get(0, &[1])), (1, Some(&entries[0])), "byte {at}");
        }
        std::fs::write(&path, [b"7", &whole[1..]].concat()).unwrap();
        let error = Journal::open(dir.path(), &identity).err().unwrap().to_string();
        assert!(error.contains("first line") && error.contains("delete that file"), "{error}");
    }

    #[test]
    fn extreme_a_line_of_another_s_is_refused_and_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(NAME);
        for text in ["notes of mine, without a line feed", "notes\nof mine\n", "{\"search\":{\"rows\":7"] {
            std::fs::write(&path, text).unwrap();
            assert!(Journal::open(dir.path(), &json!({"rows": 3})).is_err(), "{text}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }

    #[test]
    fn law_a_journal_is_written_by_one_at_a_time() {
        let dir = tempfile::tempdir().unwrap();
        let _journal = Journal::open(dir.path(), &json!({})).unwrap();
        assert!(matches!(Journal::open(dir.path(), &json!({})), Err(TrainError::Busy { .. })));
    }
}
