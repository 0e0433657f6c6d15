//! A name -> the run folder of the next run of that name: `<name>-1`, `-2`, ...

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::corpus::CorpusError;
use crate::corpus::store::read_folder;

/// The first free number below `runs`; to resume, the highest that is there.
pub(crate) fn numbered(runs: &Path, name: &str, resume: bool) -> Result<PathBuf, CorpusError> {
    let entries = match read_folder(runs) {
        Err(error) if error.kind() == ErrorKind::NotFound => Vec::new(),
        entries => entries.and_then(Iterator::collect).map_err(|error| CorpusError::of_path(runs, error))?,
    };
    let taken: BTreeSet<u64> =
        entries.iter().filter_map(|entry| number_of(entry.file_name().to_str()?, name)).collect();
    let number = taken.last().copied().filter(|_| resume);
    let number = number.or_else(|| (1..).find(|number| !taken.contains(number))).unwrap_or(1);
    Ok(runs.join(format!("{name}-{number}")))
}

/// The number in `<name>-<number>`, written as marsyard writes it.
fn number_of(entry: &str, name: &str) -> Option<u64> {
    let digits = entry.strip_prefix(name)?.strip_prefix('-')?;
    digits.parse().ok().filter(|number: &u64| *number > 0 && number.to_string() == digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_run_s_number_is_read_as_it_is_written() {
        let numbers = ["a-1", "a-12", "a-0", "a-01", "a-x", "a-b-3", "a", "b-2"].map(|entry| number_of(entry, "a"));
        assert_eq!(numbers, [Some(1), Some(12), None, None, None, None, None, None]);
    }

    #[test]
    fn exact_the_next_run_takes_the_first_gap_and_a_resumed_one_the_last() {
        let runs = tempfile::tempdir().unwrap();
        let next = |resume| numbered(runs.path(), "a", resume).unwrap();
        assert_eq!(next(true), runs.path().join("a-1"));
        for there in ["a-1", "a-3", "b-2"] {
            std::fs::create_dir(runs.path().join(there)).unwrap();
        }
        assert_eq!([next(false), next(true)], ["a-2", "a-3"].map(|name| runs.path().join(name)));
    }
}
