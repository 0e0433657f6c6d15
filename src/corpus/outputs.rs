//! Files of results (of `classify`, `evaluate`, `preview`, `tradeoff`) -> a folder that knows which of its files are marsyard's.
//!
//! The folder's ledger, `marsyard.sha256`, has a line for each file that was written, hash and name, as `sha256sum --check` reads them.
//! The line is there before the file is, so that a folder that was left by a kill is still known; then a file may have two lines, and
//! is marsyard's where it is as one of them says. The same command again replaces these files, and no other. Commands that write into
//! one folder at once take turns, and keep each other's lines.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::address::Address;
use super::limits::FileKind;
use super::owner::{self, CHANGED, IS_INPUT, NOT_WRITTEN};
use super::store::create_synced;
use super::{CorpusError, Store, finished, sha256};

/// The ledger's name.
pub(crate) const LEDGER: &str = "marsyard.sha256";
const HEAD: &str =
    "# Files that marsyard wrote here, and may replace; check them with: sha256sum --check marsyard.sha256\n";

/// A folder for results.
pub(crate) struct Outputs {
    store: Arc<dyn Store>,
    /// Where the folder is no URL.
    folder: Option<PathBuf>,
    inputs: Vec<PathBuf>,
    ledger: Ledger,
    written: BTreeSet<String>,
}

/// By name, the hashes that the file may have: the last is that of the file written last.
#[derive(Default, PartialEq)]
struct Ledger(BTreeMap<String, Vec<String>>);

/// Refuses a folder that nothing could be written into, before hours are spent on what is to go there.
fn check_writable(folder: &Path) -> Result<(), CorpusError> {
    let named = |path: &Path| if path.as_os_str().is_empty() { PathBuf::from(".") } else { path.to_path_buf() };
    // It may not be there yet: then the nearest one above it is written into. What is no folder is refused by name when it is opened.
    let nearest = folder.ancestors().map(named).find(|path| path.exists());
    let Some(there) = nearest.filter(|path| path.is_dir()) else { return Ok(()) };
    let wanted = rustix::fs::Access::WRITE_OK | rustix::fs::Access::EXEC_OK;
    rustix::fs::access(&there, wanted).map_err(|error| CorpusError::of_path(&there, error.into()))
}

impl Ledger {
    fn read(store: &dyn Store) -> Result<Option<Ledger>, CorpusError> {
        let Some(bytes) = finished::read_present(store, LEDGER, FileKind::Ledger)? else { return Ok(None) };
        let text = String::from_utf8(bytes).ok();
        Ok(text.filter(|text| text.starts_with(HEAD)).map(|text| Ledger::parse(&text)))
    }

    /// Broken lines, such as one that a kill cut short, say nothing.
    fn parse(text: &str) -> Ledger {
        let mut ledger = Ledger::default();
        let lines = text.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
        for (hash, name) in lines.filter_map(|line| line.split_once("  ")).filter(|(hash, _)| hash.len() == 64) {
            ledger.add(name, hash);
        }
        ledger
    }

    /// False where it is known as the last.
    fn add(&mut self, name: &str, hash: &str) -> bool {
        let hashes = self.0.entry(name.into()).or_default();
        let is_new = hashes.last().is_none_or(|last| last != hash);
        if is_new {
            hashes.push(hash.into());
        }
        is_new
    }

    /// Adds what another command wrote meanwhile; of a name that both wrote the last hash stays.
    fn take_in(&mut self, there: &Ledger) {
        for (name, theirs) in &there.0 {
            let ours = self.0.entry(name.clone()).or_default();
            let new: Vec<String> = theirs.iter().filter(|hash| !ours.contains(hash)).cloned().collect();
            ours.splice(0..0, new);
        }
    }

    fn text(&self) -> String {
        let line = |name: &String, hash: &String| format!("{hash}  {name}\n");
        let lines = self.0.iter().flat_map(|(name, hashes)| hashes.iter().map(move |hash| line(name, hash)));
        HEAD.to_string() + &lines.collect::<String>()
    }
}

impl Outputs {
    /// Takes a place that is empty or marsyard's own, and in which these names are free or marsyard's own; touches nothing.
    /// `inputs` are read by the command, and so are never written.
    pub(crate) fn open<'n>(
        place: &Path,
        names: impl IntoIterator<Item = &'n str>,
        inputs: Vec<PathBuf>,
    ) -> Result<Outputs, CorpusError> {
        let address = Address::parse(place)?;
        let store = address.open()?;
        let folder = match address {
            Address::Folder(folder) => Some(folder),
            Address::Objects { .. } => None,
        };
        folder.as_deref().map_or(Ok(()), check_writable)?;
        // Before the ledger is looked for: what another command writes meanwhile has one.
        let is_empty = owner::check_empty(store.as_ref());
        let ledger = match Ledger::read(store.as_ref())? {
            Some(ledger) => ledger,
            None => is_empty.map(|()| Ledger::default())?,
        };
        let outputs = Outputs { store, folder, inputs, ledger, written: BTreeSet::new() };
        names.into_iter().try_for_each(|name| outputs.check(name))?;
        Ok(outputs)
    }

    /// Keeps other commands from writing here until the handle is dropped, and takes in what they wrote; also whether the ledger there
    /// holds all that is known here. A place that cannot be locked (a URL, some network file systems) is for one command at a time.
    fn hold(&mut self) -> Result<(Option<File>, bool), CorpusError> {
        let Some(folder) = &self.folder else { return Ok((None, !self.written.is_empty())) };
        let failed = |source| CorpusError::of_path(folder, source);
        create_synced(folder, None).map_err(failed)?;
        let held = File::open(folder).map_err(failed)?;
        // Where there are no locks nobody can be kept out.
        let _ = held.lock();
        let there = Ledger::read(self.store.as_ref())?.unwrap_or_default();
        self.ledger.take_in(&there);
        // A broken last line, which a kill left, is none of it: the first write is of the whole.
        let is_whole = !self.written.is_empty() && there == self.ledger;
        Ok((Some(held), is_whole))
    }

    /// Refuses a name under which there is something that marsyard did not write.
    fn check(&self, name: &str) -> Result<(), CorpusError> {
        let refused = |why| Err(owner::foreign(self.store.place(), name, why));
        if let Some(path) = self.folder.as_ref().map(|folder| folder.join(name)) {
            match std::fs::symlink_metadata(&path) {
                Ok(_) if self.inputs.iter().any(|input| owner::is_same_file(&path, input)) => return refused(IS_INPUT),
                Ok(facts) if !facts.is_file() => return refused(NOT_WRITTEN),
                _ => {}
            }
        }
        if self.store.size(name)?.is_none() {
            return Ok(());
        }
        match self.ledger.0.get(name) {
            None => refused(NOT_WRITTEN),
            Some(hashes) if !hashes.contains(&sha256(&self.store.read(name)?)) => refused(CHANGED),
            Some(_) => Ok(()),
        }
    }

    /// Writes files, each whole, in the place of those that an earlier command wrote.
    pub(crate) fn write(&mut self, files: &[(String, Vec<u8>)]) -> Result<(), CorpusError> {
        let (_held, is_whole) = self.hold()?;
        files.iter().try_for_each(|(name, _)| self.check(name))?;
        let mut lines = String::new();
        for (name, bytes) in files {
            let hash = sha256(bytes);
            if self.ledger.add(name, &hash) {
                lines += &format!("{hash}  {name}\n");
            }
        }
        if !is_whole {
            self.store.replace(LEDGER, self.ledger.text().as_bytes())?;
        } else if !lines.is_empty() {
            self.store.append(LEDGER, lines.as_bytes())?;
        }
        self.written.extend(files.iter().map(|(name, _)| name.clone()));
        files.iter().try_for_each(|(name, bytes)| self.store.replace(name, bytes))
    }

    /// Leaves one line in the ledger for each file written, and nothing of what a killed command left.
    pub(crate) fn finish(mut self) -> Result<(), CorpusError> {
        let _held = self.hold()?;
        let written = self.ledger.0.iter_mut().filter(|(name, _)| self.written.contains(*name));
        for (name, hashes) in written.filter(|(_, hashes)| hashes.len() > 1) {
            // Another command may have written the same name after this one.
            let there = self.store.size(name)?.map(|_| self.store.read(name)).transpose()?.map(|bytes| sha256(&bytes));
            let last = hashes.pop().expect("more than one");
            *hashes = vec![there.filter(|there| hashes.contains(there)).unwrap_or(last)];
        }
        self.store.replace(LEDGER, self.ledger.text().as_bytes())?;
        self.store.sweep_temporaries("")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_commands_that_write_into_one_folder_at_once_own_each_others_files() {
        let dir = tempfile::tempdir().unwrap();
        let names = ["a", "b", "both"];
        let open = || Outputs::open(dir.path(), names, Vec::new());
        let file = |name: &str, bytes: &[u8]| [(name.to_string(), bytes.to_vec())];
        let (mut first, mut second) = (open().unwrap(), open().unwrap());
        first.write(&file("a", b"1")).unwrap();
        second.write(&file("b", b"2")).unwrap();
        first.write(&file("both", b"1")).unwrap();
        second.write(&file("both", b"2")).unwrap();
        first.finish().unwrap();
        open().unwrap();
        second.finish().unwrap();
        let ledger = open().unwrap().ledger;
        let expected = [("a", b"1"), ("b", b"2"), ("both", b"2")];
        let hashes = expected.map(|(name, bytes)| (name.to_string(), vec![sha256(bytes)]));
        assert!(ledger == Ledger(BTreeMap::from(hashes)), "{}", ledger.text());
    }

    #[test]
    fn extreme_a_file_that_somebody_changed_since_is_not_overwritten() {
        let dir = tempfile::tempdir().unwrap();
        let open = || Outputs::open(dir.path(), ["a"], Vec::new());
        let file = [("a".to_string(), b"ours".to_vec())];
        let mut first = open().unwrap();
        first.write(&file).unwrap();
        first.finish().unwrap();
        // What a command wrote itself, the next one may replace.
        open().unwrap().write(&file).unwrap();
        let mut next = open().unwrap();
        std::fs::write(dir.path().join("a"), b"theirs").unwrap();
        let refused = next.write(&file).unwrap_err().to_string();
        assert!(refused.contains(CHANGED), "{refused}");
        assert_eq!(std::fs::read(dir.path().join("a")).unwrap(), b"theirs");
    }
}
