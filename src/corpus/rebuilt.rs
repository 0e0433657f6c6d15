//! Shards that were built again and compared -> `rebuilt.json`: which they were, and by which program.
//!
//! It says what somebody found, and proves nothing: whoever doubts it builds them again. Of another corpus id (the corpus grew, or was
//! built anew) it says nothing, and is begun anew.

use serde::{Deserialize, Serialize};

use super::limits::FileKind;
use super::ranges::{self, Selection};
use super::{Build, CorpusError, Manifest, Store, finished, owner};

pub(crate) const NAME: &str = "rebuilt.json";

const FORMAT: u32 = 1;

/// `rebuilt.json`: no time and no host.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Rebuilt {
    pub marsyard_rebuilt: u32,
    pub corpus_id: String,
    pub rebuilt: Vec<Entry>,
}

/// What one program found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    /// As `3..5,9`.
    pub shards: String,
    pub build: Build,
    /// Every byte was the same.
    pub equal: bool,
}

impl Rebuilt {
    /// What is said of this corpus; nothing where there is no such file, or none that can be read.
    pub(crate) fn read(store: &dyn Store, manifest: &Manifest) -> Result<Rebuilt, CorpusError> {
        let none = Rebuilt { marsyard_rebuilt: FORMAT, corpus_id: manifest.corpus_id.clone(), rebuilt: Vec::new() };
        let bytes = finished::read_present(store, NAME, FileKind::Rebuilt)?;
        let there = bytes.and_then(|bytes| serde_json::from_slice::<Rebuilt>(&bytes).ok());
        let ours = |there: &Rebuilt| {
            let legible = there.rebuilt.iter().all(|entry| shards(&entry.shards, manifest.shards).is_some());
            there.marsyard_rebuilt == FORMAT && there.corpus_id == manifest.corpus_id && legible
        };
        Ok(there.filter(ours).unwrap_or(none))
    }

    /// Adds what a program found now, ascending; of a shard that it had compared before, this counts.
    pub(crate) fn add(&mut self, build: &Build, equal: &[u64], differing: &[u64], of: u64) {
        for (found, is_equal) in [(equal, true), (differing, false)] {
            let other = if is_equal { differing } else { equal };
            let there = self.rebuilt.iter().position(|entry| entry.build == *build && entry.equal == is_equal);
            let before = there.map(|at| self.rebuilt.remove(at)).and_then(|entry| shards(&entry.shards, of));
            let mut all: Vec<u64> =
                before.unwrap_or_default().into_iter().filter(|shard| other.binary_search(shard).is_err()).collect();
            all.extend(found);
            all.sort_unstable();
            all.dedup();
            if !all.is_empty() {
                self.rebuilt.push(Entry { shards: ranges::to_text(&all), build: build.clone(), equal: is_equal });
            }
        }
    }

    /// Replaces what an earlier record was; a file of that name which is none stays, and is refused.
    pub(crate) fn write(&self, store: &dyn Store) -> Result<(), CorpusError> {
        let is_record = |bytes: &[u8]| bytes.is_empty() || serde_json::from_slice::<Rebuilt>(bytes).is_ok();
        match finished::read_present(store, NAME, FileKind::Rebuilt) {
            Ok(there) if there.as_deref().is_none_or(is_record) => {}
            Ok(_) | Err(CorpusError::TooLarge { .. }) => {
                return Err(owner::foreign(store.place(), NAME, owner::NOT_WRITTEN));
            }
            Err(error) => return Err(error),
        }
        let text = serde_json::to_string_pretty(self).expect("it is plain data") + "\n";
        store.replace(NAME, text.as_bytes())
    }
}

fn shards(text: &str, of: u64) -> Option<Vec<u64>> {
    text.parse::<Selection>().ok()?.of(of).ok()
}

#[cfg(test)]
mod tests {
    use super::super::tests::fixture::{corpus, spec};
    use super::*;
    use crate::corpus::{LocalFolder, Table};

    fn by(version: &str) -> Build {
        Build { version: version.into(), ..Build::of_this_binary() }
    }

    fn said(rebuilt: &Rebuilt) -> Vec<(&str, &str, bool)> {
        rebuilt.rebuilt.iter().map(|e| (e.build.version.as_str(), e.shards.as_str(), e.equal)).collect()
    }

    #[test]
    fn exact_what_is_found_is_merged_by_program_and_the_last_look_counts() {
        let (_dir, store, manifest) = corpus(&spec(16, &[Table::Cells]));
        let mut rebuilt = Rebuilt::read(&store, &manifest).unwrap();
        rebuilt.add(&by("1"), &[0, 1], &[5], manifest.shards);
        rebuilt.add(&by("2"), &[7], &[], manifest.shards);
        rebuilt.add(&by("1"), &[2, 5], &[1], manifest.shards);
        assert_eq!(said(&rebuilt), [("2", "7", true), ("1", "0,2,5", true), ("1", "1", false)]);
        rebuilt.write(&store).unwrap();
        assert_eq!(Rebuilt::read(&store, &manifest).unwrap(), rebuilt);
    }

    #[test]
    fn law_of_another_corpus_or_damaged_it_says_nothing() {
        let (dir, store, manifest) = corpus(&spec(4, &[Table::Cells]));
        let mut rebuilt = Rebuilt::read(&store, &manifest).unwrap();
        rebuilt.add(&by("1"), &[0], &[], manifest.shards);
        rebuilt.write(&store).unwrap();
        let grown = Manifest { corpus_id: "ff".repeat(32), ..manifest.clone() };
        assert_eq!(Rebuilt::read(&store, &grown).unwrap().rebuilt, []);
        let path = dir.path().join("tiny").join(NAME);
        let text = std::fs::read_to_string(&path).unwrap();
        for damaged in ["{}".to_string(), text.replace("\"0\"", "\"0..99999999999\""), text.replace('{', "")] {
            std::fs::write(&path, damaged).unwrap();
            assert_eq!(Rebuilt::read(&LocalFolder::new(dir.path().join("tiny")), &manifest).unwrap().rebuilt, []);
        }
        // What is no record is somebody's, and stays.
        for mine in ["{}", "mine"] {
            std::fs::write(&path, mine).unwrap();
            assert!(matches!(rebuilt.write(&store), Err(CorpusError::Foreign { .. })));
            assert_eq!(std::fs::read_to_string(&path).unwrap(), mine);
        }
    }
}
