//! Files of results (of `classify`, `evaluate`, `preview`, `tradeoff`) -> a folder that knows which of its files are marsyard's.
//!
//! The folder's ledger, `marsyard.sha256`, has a line for each file that was written, hash and name, as `sha256sum --check` reads them.
//! The line is there before the file is, so that a folder that was left by a kill is still known; then a file may have two lines, and
//! is marsyard's where it is as one of them says. The same command again replaces these files, and no other.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::address::Address;
use super::owner::{self, CHANGED, IS_INPUT, NOT_WRITTEN};
use super::{CorpusError, Store, sha256};

/// The ledger's name.
pub const LEDGER: &str = "marsyard.sha256";
const HEAD: &str =
    "# Files that marsyard wrote here, and may replace; check them with: sha256sum --check marsyard.sha256\n";

/// A folder for results.
pub struct Outputs {
    store: Arc<dyn Store>,
    /// Where the folder is no URL.
    folder: Option<PathBuf>,
    inputs: Vec<PathBuf>,
    ledger: Ledger,
    written: BTreeSet<String>,
}

/// By name, the hashes that the file may have: the last is that of the file written last.
#[derive(Default)]
struct Ledger(BTreeMap<String, Vec<String>>);

impl Ledger {
    fn read(store: &dyn Store) -> Result<Option<Ledger>, CorpusError> {
        if store.size(LEDGER)?.is_none() {
            return Ok(None);
        }
        let text = String::from_utf8(store.read(LEDGER)?).ok();
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

    fn text(&self) -> String {
        let line = |name: &String, hash: &String| format!("{hash}  {name}\n");
        let lines = self.0.iter().flat_map(|(name, hashes)| hashes.iter().map(move |hash| line(name, hash)));
        HEAD.to_string() + &lines.collect::<String>()
    }
}

impl Outputs {
    /// Takes a place that is empty or marsyard's own, and in which these names are free or marsyard's own; touches nothing.
    /// `inputs` are read by the command, and so are never written.
    pub fn open<'n>(
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
    pub fn write(&mut self, files: &[(String, Vec<u8>)]) -> Result<(), CorpusError> {
        files.iter().try_for_each(|(name, _)| self.check(name))?;
        let mut lines = String::new();
        for (name, bytes) in files {
            let hash = sha256(bytes);
            if self.ledger.add(name, &hash) {
                lines += &format!("{hash}  {name}\n");
            }
        }
        if self.written.is_empty() {
            // Whole: what a kill left of it may end in a broken line.
            self.store.replace(LEDGER, self.ledger.text().as_bytes())?;
        } else if !lines.is_empty() {
            self.store.append(LEDGER, lines.as_bytes())?;
        }
        self.written.extend(files.iter().map(|(name, _)| name.clone()));
        files.iter().try_for_each(|(name, bytes)| self.store.replace(name, bytes))
    }

    /// Leaves one line in the ledger for each file written, and nothing of what a killed command left.
    pub fn finish(mut self) -> Result<(), CorpusError> {
        let written = self.ledger.0.iter_mut().filter(|(name, _)| self.written.contains(*name));
        written.for_each(|(_, hashes)| _ = hashes.drain(..hashes.len() - 1));
        self.store.replace(LEDGER, self.ledger.text().as_bytes())?;
        self.store.sweep_temporaries("")
    }
}
