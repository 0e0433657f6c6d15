//! A file of a run folder -> the right to write in that folder, for as long as the file is held open.
//!
//! The lock is the kernel's (`flock`): it ends with its holder, however that ends, so that no kill leaves a stale one. Readers never
//! ask for it.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use rustix::io::Errno;

use super::TrainError;

/// The file, open for appending and locked; another holder is told at once ([`TrainError::Busy`]).
pub(crate) fn hold(path: &Path) -> Result<File, TrainError> {
    let failed = |source| TrainError::Io { path: path.display().to_string(), source };
    loop {
        let file = OpenOptions::new().read(true).append(true).open(path).map_err(failed)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let folder = path.parent().unwrap_or(path);
                return Err(TrainError::Busy { path: folder.display().to_string() });
            }
            Err(TryLockError::Error(error)) if !is_unknown(&error) => return Err(failed(error)),
            // A file system without locks cannot tell two writers apart: whoever uses it must.
            _ if is_named(&file, path).map_err(failed)? => return Ok(file),
            // Another file took its name between the two calls.
            _ => {}
        }
    }
}

/// Whether a file system has no locks.
fn is_unknown(error: &std::io::Error) -> bool {
    let code = error.raw_os_error().map(Errno::from_raw_os_error);
    error.kind() == ErrorKind::Unsupported || matches!(code, Some(Errno::NOLCK | Errno::NOSYS | Errno::OPNOTSUPP))
}

/// Whether the path still names the file.
fn is_named(file: &File, path: &Path) -> std::io::Result<bool> {
    let address = |facts: fs::Metadata| (facts.dev(), facts.ino());
    match fs::metadata(path) {
        Ok(there) => Ok(address(there) == address(file.metadata()?)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_a_file_is_held_once_and_free_when_its_holder_is_gone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("train.yaml");
        fs::write(&path, "seed: 1\n").unwrap();
        let held = hold(&path).unwrap();
        assert!(matches!(hold(&path), Err(TrainError::Busy { .. })));
        assert_eq!(fs::read(&path).unwrap(), b"seed: 1\n", "readers are not stopped");
        drop(held);
        hold(&path).unwrap();
    }

    #[test]
    fn law_a_file_that_took_the_name_of_a_held_one_is_free() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("train.yaml");
        fs::write(&path, "old").unwrap();
        let _held = hold(&path).unwrap();
        fs::write(dir.path().join("new"), "new").unwrap();
        fs::rename(dir.path().join("new"), &path).unwrap();
        hold(&path).unwrap();
    }
}
