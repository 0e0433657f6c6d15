//! A run folder: what training writes, and what it goes on from after a kill.
//!
//! ```text
//! train.yaml                the resolved config, written first        }
//! model.safetensors         the best network                          } the same bits for the same corpora and config,
//! filter.safetensors        its covariance, for --init                } killed and resumed or not
//! training.json             what was trained on what, how it ended    }
//! curves.svg                training and validation error             }
//! training.jsonl            one line a look at the validation split, with the time
//! report.json               times and rates
//! checkpoint.safetensors    while training is under way
//! ```
//!
//! Files are written whole: under a temporary name, synced, renamed. `training.jsonl` alone is appended to; it is made of what the
//! checkpoint says. Whoever writes in the folder holds a lock on `train.yaml`, and sweeps away what killed ones left.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::looks::{self, LookLog, Looks};
use super::{TrainError, lock};
use crate::corpus::limits::FileKind;
use crate::corpus::store::{create_synced, is_temporary, read_folder, sync_folder_of};
use crate::corpus::{CorpusError, LocalFolder, Store, owner};

pub(crate) const CONFIG: &str = "train.yaml";
pub(crate) const MODEL: &str = "model.safetensors";
pub(crate) const FILTER: &str = "filter.safetensors";
pub(crate) const LOOKS: &str = looks::NAME;
pub(crate) const SUMMARY: &str = "training.json";
pub(crate) const CURVES: &str = "curves.svg";
pub(crate) const REPORT: &str = "report.json";
pub(crate) const CHECKPOINT: &str = "checkpoint.safetensors";

/// A folder that belongs to one training, and that no other process writes in while this one is there.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    store: LocalFolder,
    lock: File,
}

/// Why a file in a run folder is left alone.
const OTHER_PRODUCT: &str = "is not what this command gives: it was changed since, or another wrote it";

impl RunFolder {
    /// A folder for a run with this config, which is written first of all. One that is there already is refused, but for what a
    /// run left there in its first moments where this one is to `resume`.
    pub(crate) fn begin(path: &Path, config: &str, resume: bool) -> Result<RunFolder, TrainError> {
        let above = path.parent().unwrap_or(Path::new(""));
        create_synced(above, None).map_err(|source| io(above, source))?;
        match fs::create_dir(path) {
            Ok(()) => sync_folder_of(path).map_err(|source| io(path, source))?,
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                if !resume {
                    return Err(TrainError::Exists { path: path.display().to_string() });
                }
            }
            Err(error) => return Err(io(path, error)),
        }
        match LocalFolder::new(path).put(CONFIG, config.as_bytes()) {
            Err(CorpusError::Differs { .. }) => return Err(other_config(path)),
            put => put?,
        };
        RunFolder::held(path)
    }

    /// The folder of a run that was begun; `None` where none was, or where it was killed before it had written its config.
    pub(crate) fn resume(path: &Path) -> Result<Option<RunFolder>, TrainError> {
        if LocalFolder::new(path).size(CONFIG)?.is_some() {
            return RunFolder::held(path).map(Some);
        }
        if path.try_exists().map_err(|source| io(path, source))? && !is_barely_begun(path)? {
            let reason = format!("it holds files, and no {CONFIG}");
            return Err(TrainError::NoRun { path: path.display().to_string(), reason });
        }
        Ok(None)
    }

    fn held(path: &Path) -> Result<RunFolder, TrainError> {
        let lock = lock::hold(&path.join(CONFIG))?;
        let store = LocalFolder::new(path);
        store.sweep_temporaries("")?;
        Ok(RunFolder { path: path.to_owned(), store, lock })
    }

    /// Refuses to begin a run anew where the folder says that it is another one's, or holds what no run leaves before its first
    /// checkpoint.
    pub(crate) fn check_unlearnt(&self, config: &str) -> Result<(), TrainError> {
        if !is_barely_begun(&self.path)? {
            let reason = format!("it holds other files, and neither {CHECKPOINT} nor {FILTER}");
            return Err(TrainError::NoRun { path: self.path.display().to_string(), reason });
        }
        if self.read(CONFIG)? != config.as_bytes() {
            return Err(other_config(&self.path));
        }
        Ok(())
    }

    /// Writes the config again where it was changed meanwhile; the lock moves on with the file.
    pub(crate) fn write_config(&mut self, config: &str) -> Result<(), TrainError> {
        if self.read(CONFIG)? != config.as_bytes() {
            self.write(CONFIG, config.as_bytes())?;
            self.lock = lock::hold(&self.path.join(CONFIG))?;
        }
        Ok(())
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn holds(&self, name: &str) -> Result<bool, TrainError> {
        Ok(self.store.size(name)?.is_some())
    }

    /// A file's bytes; `None` where it is not there.
    pub(crate) fn read_if_there(&self, name: &str) -> Result<Option<Vec<u8>>, TrainError> {
        if self.holds(name)? { self.read(name).map(Some) } else { Ok(None) }
    }

    pub(crate) fn read(&self, name: &str) -> Result<Vec<u8>, TrainError> {
        Ok(self.store.read_within(name, FileKind::Checkpoint.most_bytes())?)
    }

    /// Writes a file whole, in the place of an older one.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<(), TrainError> {
        Ok(self.store.replace(name, bytes)?)
    }

    pub(crate) fn remove(&self, name: &str) -> Result<(), TrainError> {
        Ok(self.store.remove(name)?)
    }

    /// Writes times and rates: [`write_report`].
    pub(crate) fn report(&self, is_idle: bool, report: &serde_json::Value) -> Result<(), TrainError> {
        Ok(write_report(&self.store, is_idle, report)?)
    }

    /// The log, with these looks in it.
    pub(crate) fn log(&self, looks: &Looks) -> Result<LookLog, TrainError> {
        LookLog::begin(&self.path, looks)
    }
}

/// Writes times and rates, which are no part of what a run finds; those that are there stay where this process did nothing.
pub(crate) fn write_report(store: &LocalFolder, is_idle: bool, report: &serde_json::Value) -> Result<(), CorpusError> {
    if is_idle && store.size(REPORT)?.is_some() {
        return Ok(());
    }
    store.replace(REPORT, format!("{report:#}\n").as_bytes())
}

/// Writes files whose bytes follow from what a run was begun with, in the place of those that it wrote `before`. One that is there with
/// other bytes was edited, or is another's: then nothing is written.
pub(crate) fn write_products(
    store: &LocalFolder,
    files: &[(String, Vec<u8>)],
    before: &[(String, Vec<u8>)],
) -> Result<(), CorpusError> {
    for (name, _) in files {
        let mut known = files.iter().chain(before).filter(|(other, _)| other == name).map(|(_, bytes)| bytes);
        if store.size(name)?.is_some() {
            let there = store.read(name)?;
            if !known.any(|bytes| *bytes == there) {
                return Err(owner::foreign(store.place(), name, OTHER_PRODUCT));
            }
        }
    }
    files.iter().try_for_each(|(name, bytes)| store.replace(name, bytes))
}

/// Whether a folder holds nothing but what a run leaves that is killed before its first checkpoint.
fn is_barely_begun(path: &Path) -> Result<bool, TrainError> {
    for entry in read_folder(path).map_err(|source| io(path, source))? {
        let entry = entry.map_err(|source| io(path, source))?;
        let ours = match entry.file_name().to_str() {
            Some(CONFIG) => true,
            Some(LOOKS) => is_log(&entry.path()) || path.join(CONFIG).is_file(),
            name => name.is_some_and(|name| is_temporary(name) || is_temporary_of_before(name)),
        };
        if !ours {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Whether a name is that of an unfinished file of an earlier marsyard: `.tmp-` and six letters or digits.
fn is_temporary_of_before(name: &str) -> bool {
    let drawn = name.strip_prefix(".tmp-");
    drawn.is_some_and(|drawn| drawn.len() == 6 && drawn.bytes().all(|byte| byte.is_ascii_alphanumeric()))
}

/// Whether a file of that name is a log of looks, or nothing yet.
fn is_log(path: &Path) -> bool {
    let length = fs::symlink_metadata(path).ok().filter(fs::Metadata::is_file).map(|facts| facts.len());
    let folder = path.parent().unwrap_or(path);
    length.is_some_and(|length| length == 0 || !looks::read(folder, 1).is_empty())
}

fn other_config(path: &Path) -> TrainError {
    let what = "the config is another one (its own is in train.yaml)".into();
    TrainError::OtherRun { path: path.display().to_string(), what }
}

fn io(path: &Path, source: std::io::Error) -> TrainError {
    TrainError::Io { path: path.display().to_string(), source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_what_a_kill_leaves_in_the_first_moments_is_told_from_files_of_others() {
        for (names, is_ours) in [
            (&["training.jsonl", ".tmp-a1B2c3"][..], true),
            (&[".marsyard-tmp-4711-x1"], true),
            (&["training.jsonl", ".tmp-notes-of-mine"], false),
            (&["train.yaml", "notes.txt"], false),
        ] {
            let dir = tempfile::tempdir().unwrap();
            names.iter().for_each(|name| fs::write(dir.path().join(name), "").unwrap());
            assert_eq!(is_barely_begun(dir.path()).unwrap(), is_ours, "{names:?}");
        }
    }

    #[test]
    fn law_a_product_that_was_edited_is_left_alone_with_all_others() {
        let dir = tempfile::tempdir().unwrap();
        let store = LocalFolder::new(dir.path());
        let files = |text: &str| ["a", "b"].map(|name| (name.to_owned(), text.as_bytes().to_vec()));
        write_products(&store, &files("one"), &[]).unwrap();
        write_products(&store, &files("two"), &files("one")).unwrap();
        fs::write(dir.path().join("b"), "mine").unwrap();
        let refused = write_products(&store, &files("three"), &files("two")).unwrap_err().to_string();
        assert!(refused.contains("holds b, which is not what this command gives"), "{refused}");
        assert_eq!(fs::read(dir.path().join("a")).unwrap(), b"two");
    }
}
