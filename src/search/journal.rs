//! `search.jsonl`: what a search was begun with, and a line for every network trained as far as a rung.
//!
//! Each line is written by one call, so that a kill leaves whole lines and at most one torn one at the end, which is cut off when the
//! search goes on. Lines stand in the order in which networks were finished, which differs from run to run; what they say does not,
//! but for the seconds.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use super::entry::Entry;
use super::networks::Hidden;
use crate::train::TrainError;

pub const NAME: &str = "search.jsonl";

/// Open at its end.
pub struct Journal {
    path: PathBuf,
    file: File,
    /// By rung and network.
    entries: BTreeMap<(usize, Hidden), Entry>,
}

impl Journal {
    /// Begins one; `identity` is its first line.
    pub fn create(folder: &Path, identity: &Json) -> Result<Journal, TrainError> {
        let path = folder.join(NAME);
        let file = OpenOptions::new().create(true).truncate(true).write(true).open(&path);
        let file = file.map_err(|source| io(&path, source))?;
        let mut journal = Journal { path, file, entries: BTreeMap::new() };
        journal.line(&json!({"search": identity}))?;
        Ok(journal)
    }

    /// Goes on with one that was begun with the same `identity`; begins it where there is no whole line.
    pub fn resume(folder: &Path, identity: &Json) -> Result<Journal, TrainError> {
        let path = folder.join(NAME);
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Journal::create(folder, identity),
            Err(error) => return Err(io(&path, error)),
        };
        let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1);
        if whole == 0 {
            return Journal::create(folder, identity);
        }
        let bad = |line: usize, reason: String| TrainError::BadState {
            path: path.display().to_string(),
            reason: format!("line {line} is broken ({reason})"),
        };
        let mut entries = BTreeMap::new();
        for (number, line) in bytes[..whole].split_inclusive(|&byte| byte == b'\n').enumerate() {
            if number == 0 {
                let first: Json = serde_json::from_slice(line).map_err(|error| bad(1, error.to_string()))?;
                check(&path, &first["search"], identity)?;
                continue;
            }
            let entry: Entry = serde_json::from_slice(line).map_err(|error| bad(number + 1, error.to_string()))?;
            entries.insert((entry.rung, entry.hidden.clone()), entry);
        }
        let file = OpenOptions::new().append(true).open(&path).map_err(|source| io(&path, source))?;
        file.set_len(whole as u64).map_err(|source| io(&path, source))?;
        Ok(Journal { path, file, entries })
    }

    pub fn get(&self, rung: usize, hidden: &[usize]) -> Option<&Entry> {
        self.entries.get(&(rung, hidden.to_vec()))
    }

    /// Lines, less the first.
    pub fn trainings(&self) -> usize {
        self.entries.len()
    }

    pub fn push(&mut self, entry: Entry) -> Result<(), TrainError> {
        self.line(&json!(entry))?;
        self.entries.insert((entry.rung, entry.hidden.clone()), entry);
        Ok(())
    }

    fn line(&mut self, line: &Json) -> Result<(), TrainError> {
        self.file.write_all(format!("{line}\n").as_bytes()).map_err(|source| io(&self.path, source))
    }
}

fn io(path: &Path, source: std::io::Error) -> TrainError {
    TrainError::Io { path: path.display().to_string(), source }
}

fn check(path: &Path, there: &Json, here: &Json) -> Result<(), TrainError> {
    let mut differences = Vec::new();
    compare("", there, here, &mut differences);
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
        let mut journal = Journal::create(dir.path(), &identity).unwrap();
        let entries = [entry(&[1], 10, 0.5), entry(&[2, 2], 20, f64::NAN), entry(&[4], 40, 0.2)];
        entries.iter().for_each(|entry| journal.push(entry.clone()).unwrap());
        let path = dir.path().join(NAME);
        let bytes = std::fs::read(&path).unwrap();
        for cut in 0..=bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let mut journal = Journal::resume(dir.path(), &identity).unwrap();
            let whole = bytes[..cut].iter().filter(|&&byte| byte == b'\n').count().saturating_sub(1);
            assert_eq!(journal.trainings(), whole, "{cut}");
            entries[whole..].iter().for_each(|entry| journal.push(entry.clone()).unwrap());
            assert!(std::fs::read(&path).unwrap() == bytes, "{cut}");
        }
    }

    #[test]
    fn exact_a_search_begun_otherwise_is_refused_with_what_differs() {
        let dir = tempfile::tempdir().unwrap();
        Journal::create(dir.path(), &json!({"rows": 3, "config": {"seed": 1, "clip": 8}})).unwrap();
        let here = json!({"rows": 4, "config": {"seed": 1, "clip": 5}});
        let error = Journal::resume(dir.path(), &here).err().unwrap().to_string();
        assert!(error.contains("'rows' was 3 and is 4 now, 'config.clip' was 8 and is 5 now"), "{error}");
    }

    #[test]
    fn extreme_a_broken_line_in_the_middle_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let identity = json!({});
        Journal::create(dir.path(), &identity).unwrap().push(entry(&[1], 10, 0.5)).unwrap();
        let path = dir.path().join(NAME);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("\"rung\"", "rung\"")).unwrap();
        let error = Journal::resume(dir.path(), &identity).err().unwrap().to_string();
        assert!(error.contains("line 2 is broken"), "{error}");
    }
}
