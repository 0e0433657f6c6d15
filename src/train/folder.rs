//! A run folder: what training writes, and what it goes on from after a kill.
//!
//! ```text
//! train.yaml                the resolved config                         }
//! model.safetensors         the best network                            } the same bits for the same corpora and config,
//! filter.safetensors        its covariance, for --init                  } killed and resumed or not
//! training.json             what was trained on what, and how it ended  }
//! curves.svg                training and validation error               }
//! training.jsonl            one line a look at the validation split, with the time
//! report.json               times and rates
//! checkpoint.safetensors    while training is under way
//! ```
//!
//! Files are written whole, under a temporary name first; `training.jsonl` is appended to, and cut back to the checkpoint on resume.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::TrainError;
use super::stopping::Look;
use crate::corpus::{LocalFolder, Store};

pub const CONFIG: &str = "train.yaml";
pub const MODEL: &str = "model.safetensors";
pub const FILTER: &str = "filter.safetensors";
pub const LOOKS: &str = "training.jsonl";
pub const SUMMARY: &str = "training.json";
pub const CURVES: &str = "curves.svg";
pub const REPORT: &str = "report.json";
pub const CHECKPOINT: &str = "checkpoint.safetensors";

/// A line of `training.jsonl`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    #[serde(flatten)]
    pub look: Look,
    /// Whether it was the best so far.
    pub best: bool,
    /// Seconds of training so far, those before a kill included.
    pub elapsed_s: f64,
}

/// A folder that belongs to one training.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    store: LocalFolder,
}

impl RunFolder {
    /// A new folder; one that is there already is refused.
    pub fn create(path: &Path) -> Result<RunFolder, TrainError> {
        if let Some(above) = path.parent() {
            fs::create_dir_all(above).map_err(|source| io(above, source))?;
        }
        match fs::create_dir(path) {
            Ok(()) => Ok(RunFolder::at(path)),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                Err(TrainError::Exists { path: path.display().to_string() })
            }
            Err(error) => Err(io(path, error)),
        }
    }

    /// The folder of a run that was begun; a new one where there is none.
    pub fn resume(path: &Path) -> Result<RunFolder, TrainError> {
        if !path.exists() {
            return RunFolder::create(path);
        }
        let empty = fs::read_dir(path).map_err(|source| io(path, source))?.next().is_none();
        if !empty && !path.join(CONFIG).is_file() {
            let reason = format!("it holds files, and no {CONFIG}");
            return Err(TrainError::NoRun { path: path.display().to_string(), reason });
        }
        Ok(RunFolder::at(path))
    }

    fn at(path: &Path) -> RunFolder {
        RunFolder { path: path.to_owned(), store: LocalFolder::new(path) }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn holds(&self, name: &str) -> bool {
        self.path.join(name).is_file()
    }

    pub fn read(&self, name: &str) -> Result<Vec<u8>, TrainError> {
        Ok(self.store.read(name)?)
    }

    /// Writes a file whole, in the place of an older one.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), TrainError> {
        Ok(self.store.replace(name, bytes)?)
    }

    pub fn remove(&self, name: &str) -> Result<(), TrainError> {
        Ok(self.store.remove(name)?)
    }

    /// The log of looks, cut back to its first `keep` lines; and the time in the last of them.
    pub fn looks(&self, keep: u64) -> Result<(LookLog, f64), TrainError> {
        let path = self.path.join(LOOKS);
        let failed = |source| io(&path, source);
        let (mut bytes, mut elapsed_s) = (0, 0.0);
        if keep > 0 {
            let mut reader = BufReader::new(File::open(&path).map_err(failed)?);
            let mut text = String::new();
            for kept in 0..keep {
                text.clear();
                bytes += reader.read_line(&mut text).map_err(failed)? as u64;
                let line: Line = serde_json::from_str(&text).map_err(|error| TrainError::BadState {
                    path: path.display().to_string(),
                    reason: format!("line {} of the {keep} that the checkpoint counts is broken ({error})", kept + 1),
                })?;
                elapsed_s = line.elapsed_s;
            }
        }
        let file = OpenOptions::new().create(true).append(true).open(&path).map_err(failed)?;
        file.set_len(bytes).map_err(failed)?;
        Ok((LookLog { path, file }, elapsed_s))
    }

    /// All looks so far.
    pub fn read_looks(&self) -> Result<Vec<Look>, TrainError> {
        let path = self.path.join(LOOKS);
        let text = fs::read_to_string(&path).map_err(|source| io(&path, source))?;
        let parse = |line: &str| serde_json::from_str::<Line>(line).map(|line| line.look);
        text.lines()
            .map(parse)
            .collect::<Result<_, _>>()
            .map_err(|error| TrainError::BadState { path: path.display().to_string(), reason: error.to_string() })
    }
}

/// `training.jsonl`, open at its end.
#[derive(Debug)]
pub struct LookLog {
    path: PathBuf,
    file: File,
}

impl LookLog {
    pub fn push(&mut self, line: &Line) -> Result<(), TrainError> {
        let text = serde_json::to_string(line).expect("a line is plain data") + "\n";
        self.file.write_all(text.as_bytes()).map_err(|source| io(&self.path, source))
    }
}

fn io(path: &Path, source: std::io::Error) -> TrainError {
    TrainError::Io { path: path.display().to_string(), source }
}
