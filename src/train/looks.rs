//! The looks of a run: what its checkpoint keeps of them, and `training.jsonl`, the log that is made of that.
//!
//! The log is for whoever watches, and for the learning curves. Nothing is read from it that a training goes on from: on resume
//! it is written anew from the checkpoint, then appended to, and at the end it is written whole.

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::TrainError;
use super::stopping::Look;
use crate::corpus::{LocalFolder, Store};

pub(crate) const NAME: &str = "training.jsonl";

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

/// Numbers of a line in a file: five words of 8 bytes.
pub const WORDS: usize = 5;

impl Line {
    pub(crate) fn to_words(self) -> [u64; WORDS] {
        let Look { rows, epoch, train_error, validation_error } = self.look;
        let bits = |error: Option<f64>| error.unwrap_or(f64::NAN).to_bits();
        let epoch_and_best = u64::from(epoch) << 1 | u64::from(self.best);
        [rows, epoch_and_best, bits(train_error), bits(validation_error), self.elapsed_s.to_bits()]
    }

    pub(crate) fn from_words([rows, epoch_and_best, train, validation, elapsed]: [u64; WORDS]) -> Line {
        let error = |bits| Some(f64::from_bits(bits)).filter(|error| error.is_finite());
        let epoch = (epoch_and_best >> 1) as u32;
        Line {
            look: Look { rows, epoch, train_error: error(train), validation_error: error(validation) },
            best: epoch_and_best & 1 == 1,
            elapsed_s: f64::from_bits(elapsed),
        }
    }

    /// The same without its time, which another run of the same training has otherwise.
    pub(crate) fn timeless(self) -> Line {
        Line { elapsed_s: 0.0, ..self }
    }
}

/// So many looks are kept at most, in 5 MB of a checkpoint: where there are more, every second goes, and so on.
const MOST: usize = 1 << 17;

/// The looks that are kept, the first one always.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Looks(Vec<Line>);

impl Looks {
    /// Those that a file holds.
    pub fn new(lines: Vec<Line>) -> Looks {
        Looks(lines)
    }

    pub fn lines(&self) -> &[Line] {
        &self.0
    }

    /// Takes the look of this number in, from 0. Which are kept is a function of their number alone.
    pub(crate) fn push(&mut self, number: u64, line: Line) {
        if number > 0 && every(number) > every(number - 1) {
            let mut keep = false;
            self.0.retain(|_| {
                keep = !keep;
                keep
            });
        }
        if number.is_multiple_of(every(number)) {
            self.0.push(line);
        }
    }

    /// As the lines of `training.jsonl`.
    pub(crate) fn text(&self) -> String {
        self.0.iter().map(shown).collect()
    }
}

/// The steps between the looks that are kept, up to one of this number: a power of two.
fn every(number: u64) -> u64 {
    (number / MOST as u64 + 1).next_power_of_two()
}

fn shown(line: &Line) -> String {
    serde_json::to_string(line).expect("a line is plain data") + "\n"
}

/// `training.jsonl`, open at its end.
#[derive(Debug)]
pub struct LookLog {
    path: PathBuf,
    file: File,
}

impl LookLog {
    /// The log with these looks in it and no others, whatever was there before.
    pub fn begin(folder: &Path, looks: &Looks) -> Result<LookLog, TrainError> {
        let path = folder.join(NAME);
        let text = looks.text();
        // Where it holds them already it is only cut, so that whoever watches the file goes on seeing it.
        if !begins_with(&path, text.as_bytes()) {
            LocalFolder::new(folder).replace(NAME, text.as_bytes())?;
        }
        let failed = |source| io(&path, source);
        let file = OpenOptions::new().append(true).open(&path).map_err(failed)?;
        file.set_len(text.len() as u64).map_err(failed)?;
        Ok(LookLog { path, file })
    }

    pub(crate) fn push(&mut self, line: &Line) -> Result<(), TrainError> {
        self.file.write_all(shown(line).as_bytes()).map_err(|source| io(&self.path, source))
    }

    /// Waits until it is on disk.
    pub(crate) fn sync(&self) -> Result<(), TrainError> {
        self.file.sync_all().map_err(|source| io(&self.path, source))
    }
}

/// Whether a plain file begins with these bytes; what cannot be read does not.
fn begins_with(path: &Path, bytes: &[u8]) -> bool {
    if !fs::symlink_metadata(path).is_ok_and(|facts| facts.is_file() && facts.len() >= bytes.len() as u64) {
        return false;
    }
    let mut there = Vec::with_capacity(bytes.len());
    let read = File::open(path).and_then(|file| file.take(bytes.len() as u64).read_to_end(&mut there));
    read.is_ok() && there == bytes
}

/// The whole lines at the beginning of a log, `most` at most: all that can be had of one that was damaged.
pub fn read(folder: &Path, most: u64) -> Vec<Line> {
    let path = folder.join(NAME);
    if !fs::symlink_metadata(&path).is_ok_and(|facts| facts.is_file()) {
        return Vec::new();
    }
    let text = fs::read(&path).unwrap_or_default();
    let lines = text.split_inclusive(|&byte| byte == b'\n').filter(|line| line.ends_with(b"\n"));
    let lines = lines.map_while(|line| serde_json::from_slice(line).ok());
    lines.take(usize::try_from(most).unwrap_or(usize::MAX)).collect()
}

fn io(path: &Path, source: std::io::Error) -> TrainError {
    TrainError::Io { path: path.display().to_string(), source }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(rows: u64) -> Line {
        let look = Look { rows, epoch: 3, train_error: Some(0.1 + 0.2), validation_error: None };
        Line { look, best: rows.is_multiple_of(2), elapsed_s: 0.25 * rows as f64 }
    }

    #[test]
    fn equal_a_line_and_its_words_read_back() {
        for rows in [0, 1, u64::MAX] {
            assert_eq!(Line::from_words(line(rows).to_words()), line(rows));
        }
    }

    #[test]
    fn law_the_looks_that_are_kept_are_bounded_and_depend_on_their_number_alone() {
        let mut looks = Looks::default();
        for number in 0..5 * MOST as u64 + 7 {
            looks.push(number, line(number));
            // A checkpoint between any two changes nothing.
            if number.is_multiple_of(100_003) {
                looks = Looks::new(looks.lines().to_vec());
            }
            assert!(looks.lines().len() <= MOST);
        }
        let kept: Vec<u64> = looks.lines().iter().map(|line| line.look.rows).collect();
        assert_eq!(kept, (0..5 * MOST as u64 + 7).step_by(8).collect::<Vec<_>>());
    }

    #[test]
    fn exact_a_log_is_made_of_the_looks_whatever_was_there() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(NAME);
        let looks = Looks::new(vec![line(0), line(10)]);
        let more = looks.text() + "{\"rows\":20,\"epo";
        for there in [None, Some(""), Some("{\"rows\":0"), Some("\0\0\0\0"), Some(more.as_str()), Some("[1]\n[2]\n")] {
            let _ = fs::remove_file(&path);
            there.iter().for_each(|text| fs::write(&path, text).unwrap());
            LookLog::begin(dir.path(), &looks).unwrap().push(&line(20)).unwrap();
            assert_eq!(read(dir.path(), 9), [line(0), line(10), line(20)], "{there:?}");
        }
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "nothing temporary stays");
    }

    #[test]
    fn extreme_a_link_in_the_place_of_the_log_is_refused_and_not_followed() {
        let dir = tempfile::tempdir().unwrap();
        let other = dir.path().join("other");
        fs::write(&other, "mine\n").unwrap();
        std::os::unix::fs::symlink(&other, dir.path().join(NAME)).unwrap();
        let refused = LookLog::begin(dir.path(), &Looks::new(vec![line(0)])).unwrap_err().to_string();
        assert!(refused.contains("training.jsonl is a link"), "{refused}");
        assert_eq!(fs::read_to_string(&other).unwrap(), "mine\n");
    }

    #[test]
    fn law_a_log_that_begins_with_the_looks_is_cut_in_its_place_and_any_other_is_replaced() {
        use std::os::unix::fs::MetadataExt;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(NAME);
        let looks = Looks::new(vec![line(0), line(10)]);
        let inode = || fs::metadata(&path).unwrap().ino();
        for (there, is_kept) in [(looks.text() + "{\"rows\":20}\n", true), ("x".repeat(4 * looks.text().len()), false)]
        {
            let _ = fs::remove_file(&path);
            fs::write(&path, there).unwrap();
            // Held open, so that no new file gets the number of this one.
            let (before, _held) = (inode(), File::open(&path).unwrap());
            LookLog::begin(dir.path(), &looks).unwrap();
            assert_eq!(inode() == before, is_kept);
            assert_eq!(fs::read_to_string(&path).unwrap(), looks.text());
        }
    }
}
