//! Names -> bytes: what stands between the corpus and the disk, or an object store.
//!
//! A [`Store`] holds whole files under names such as `data/cells/train-0000007.parquet`. A file is there whole or not at
//! all, and two writers of the same bytes are both right. In a folder it is written to a temporary name of its own, synced, and
//! renamed without replacing; then the folder is synced. What ends in a crash is a file whose name begins with `.tmp-`; it is
//! never listed and never taken for whole. A live writer holds a lock on each of its temporary files, and the lock ends with the
//! process, however it ends: who sweeps removes only what it can lock itself. [`address`] says what a user's text names, `objects`
//! what object stores do.

pub mod address;
#[cfg(feature = "object-stores")]
mod connect;
#[cfg(test)]
mod contract;
#[cfg(feature = "object-stores")]
mod objects;
#[cfg(feature = "object-stores")]
mod patience;
#[cfg(feature = "object-stores")]
mod profile;
#[cfg(feature = "object-stores")]
mod secrets;
#[cfg(feature = "object-stores")]
mod watch;
#[cfg(all(test, feature = "object-stores"))]
mod wire;

use std::fs::{self, File, Permissions};
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{CorpusError, sha256};

/// Unfinished files begin with this.
const TEMPORARY: &str = ".tmp-";

/// What a create-only put found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Put {
    Created,
    /// The same bytes were there already.
    Same,
}

/// A place for whole files.
pub trait Store: Send + Sync {
    /// Writes a new file; the same bytes twice are fine, other bytes are refused ([`CorpusError::Differs`]).
    fn put(&self, name: &str, bytes: &[u8]) -> Result<Put, CorpusError>;
    /// Writes a file that may be there already with other bytes (the derived ones: manifest, card).
    fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError>;
    fn read(&self, name: &str) -> Result<Vec<u8>, CorpusError>;
    /// The bytes from `offset` on, `length` of them, or fewer at the file's end.
    fn read_range(&self, name: &str, offset: u64, length: usize) -> Result<Vec<u8>, CorpusError>;
    /// Names and sizes of the files right in a folder, ascending by name; empty where there is no such folder.
    fn list(&self, folder: &str) -> Result<Vec<(String, u64)>, CorpusError>;
    /// Size in bytes, or `None` where there is no such file.
    fn size(&self, name: &str) -> Result<Option<u64>, CorpusError>;
    /// Removes a file; no such file is fine.
    fn remove(&self, name: &str) -> Result<(), CorpusError>;
    /// Removes what crashed writers left in a folder (or, for "", beside the folders); what a live writer holds stays.
    fn sweep_temporaries(&self, folder: &str) -> Result<(), CorpusError>;
    /// Bytes that may still be written, where the place can say.
    fn free_bytes(&self) -> Result<Option<u64>, CorpusError> {
        Ok(None)
    }
    /// Writes a little and removes it: a place that cannot be written is better told before hours of work.
    fn probe(&self) -> Result<(), CorpusError> {
        Ok(())
    }
    /// Bytes that cost no more to read than one: readers ask for so many at a time.
    fn grain_bytes(&self) -> usize {
        64 * 1024
    }
    /// A handle of its own, for readers that outlive a borrow.
    fn share(&self) -> Arc<dyn Store>;
    /// The place as the user named it, for messages only.
    fn place(&self) -> String;
}

/// A folder on a local (or network) file system.
#[derive(Clone, Debug)]
pub struct LocalFolder {
    root: PathBuf,
}

impl LocalFolder {
    /// The folder need not exist; the first file right in it creates it.
    pub fn new(root: impl Into<PathBuf>) -> LocalFolder {
        LocalFolder { root: root.into() }
    }

    fn path(&self, name: &str) -> Result<PathBuf, CorpusError> {
        if is_name(name) { Ok(self.root.join(name)) } else { Err(CorpusError::BadName { name: name.into() }) }
    }

    fn failed(&self, name: &str) -> impl Fn(std::io::Error) -> CorpusError {
        move |source| CorpusError::Io { place: self.place(), name: name.into(), source }
    }

    /// The bytes, synced, under a temporary name beside their final one.
    fn written(&self, path: &Path, bytes: &[u8]) -> std::io::Result<tempfile::NamedTempFile> {
        let folder = path.parent().unwrap_or(&self.root);
        // A file right in the root may be the first one; for others a root that has gone away is not made again.
        if folder != self.root && !self.root.is_dir() {
            return Err(std::io::Error::new(ErrorKind::NotFound, "the folder has gone away"));
        }
        create_synced(folder, if folder == self.root { None } else { Some(&self.root) })?;
        let mut file = locked_temporary(folder)?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        Ok(file)
    }
}

impl Store for LocalFolder {
    fn put(&self, name: &str, bytes: &[u8]) -> Result<Put, CorpusError> {
        let path = self.path(name)?;
        if self.size(name)?.is_some() {
            return compared(self, name, &self.read(name)?, bytes);
        }
        let file = self.written(&path, bytes).map_err(self.failed(name))?;
        match file.persist_noclobber(&path) {
            Ok(_) => {
                sync_folder_of(&path).map_err(self.failed(name))?;
                Ok(Put::Created)
            }
            // Another writer was faster.
            Err(_) if self.size(name)?.is_some() => compared(self, name, &self.read(name)?, bytes),
            Err(error) => Err(self.failed(name)(error.error)),
        }
    }

    fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError> {
        let path = self.path(name)?;
        if self.size(name)? == Some(bytes.len() as u64) && self.read(name)? == bytes {
            return Ok(());
        }
        let file = self.written(&path, bytes).map_err(self.failed(name))?;
        file.persist(&path).map_err(|error| self.failed(name)(error.error))?;
        sync_folder_of(&path).map_err(self.failed(name))
    }

    fn read(&self, name: &str) -> Result<Vec<u8>, CorpusError> {
        fs::read(self.path(name)?).map_err(self.failed(name))
    }

    fn read_range(&self, name: &str, offset: u64, length: usize) -> Result<Vec<u8>, CorpusError> {
        let read = || {
            let mut file = File::open(self.root.join(name))?;
            file.seek(SeekFrom::Start(offset))?;
            let mut bytes = Vec::new();
            file.take(length as u64).read_to_end(&mut bytes)?;
            Ok(bytes)
        };
        self.path(name)?;
        read().map_err(self.failed(name))
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, u64)>, CorpusError> {
        let entries = match fs::read_dir(self.path(folder)?) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            other => other.map_err(self.failed(folder))?,
        };
        let mut files = Vec::new();
        for entry in entries {
            let entry = entry.map_err(self.failed(folder))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with(TEMPORARY) {
                continue;
            }
            let facts = entry.metadata().map_err(self.failed(folder))?;
            if facts.is_file() {
                files.push((format!("{folder}/{name}"), facts.len()));
            }
        }
        files.sort();
        Ok(files)
    }

    fn size(&self, name: &str) -> Result<Option<u64>, CorpusError> {
        match fs::metadata(self.path(name)?) {
            Ok(facts) => Ok(facts.is_file().then_some(facts.len())),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(self.failed(name)(error)),
        }
    }

    fn remove(&self, name: &str) -> Result<(), CorpusError> {
        match fs::remove_file(self.path(name)?) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(self.failed(name)(error)),
            _ => Ok(()),
        }
    }

    fn sweep_temporaries(&self, folder: &str) -> Result<(), CorpusError> {
        let path = if folder.is_empty() { self.root.clone() } else { self.path(folder)? };
        let Ok(entries) = fs::read_dir(path) else { return Ok(()) };
        for entry in entries.flatten() {
            if !entry.file_name().to_string_lossy().starts_with(TEMPORARY) {
                continue;
            }
            // The lock is held while the file is removed: a writer that waits for it finds its file gone and takes another.
            let Some(_lock) = abandoned(&entry.path()) else { continue };
            match fs::remove_file(entry.path()) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(self.failed(folder)(error)),
                _ => {}
            }
        }
        Ok(())
    }

    fn free_bytes(&self) -> Result<Option<u64>, CorpusError> {
        // The folder may not be there yet: the nearest one above it is on the same disk.
        let here = self.root.ancestors().find(|path| path.is_dir()).filter(|path| !path.as_os_str().is_empty());
        let facts = rustix::fs::statvfs(here.unwrap_or(Path::new("."))).map_err(|e| self.failed("")(e.into()))?;
        Ok(Some(facts.f_bavail.saturating_mul(facts.f_frsize)))
    }

    fn probe(&self) -> Result<(), CorpusError> {
        self.written(&self.root.join("probe"), b"marsyard").map(drop).map_err(self.failed(""))
    }

    fn share(&self) -> Arc<dyn Store> {
        Arc::new(self.clone())
    }

    fn place(&self) -> String {
        self.root.display().to_string()
    }
}

/// A new file that says, by its lock, that its writer lives.
fn locked_temporary(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    loop {
        // Mode 666 less the umask, as any other new file: others shall read a corpus.
        let file = tempfile::Builder::new()
            .prefix(&format!("{TEMPORARY}{}-", std::process::id()))
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(folder)?;
        match file.as_file().lock() {
            // Between its creation and its lock, another process may have taken it for abandoned.
            Ok(()) if file.as_file().metadata()?.nlink() == 0 => {}
            // A file system without locks: nobody there can take the lock, so nobody takes the file for abandoned.
            Ok(()) | Err(_) => return Ok(file),
        }
    }
}

/// A temporary file that nobody holds, locked; where that cannot be known, somebody does.
fn abandoned(path: &Path) -> Option<File> {
    File::open(path).ok().filter(|file| file.try_lock().is_ok())
}

/// Whether a name stays within its place, and is none of an unfinished file.
fn is_name(name: &str) -> bool {
    let sound = |part: &str| !part.is_empty() && part != "." && part != ".." && !part.starts_with(TEMPORARY);
    name.split('/').all(sound) && !name.contains(['\\', '\0'])
}

/// A file of that name is there: the same bytes, or not?
fn compared(store: &dyn Store, name: &str, there: &[u8], here: &[u8]) -> Result<Put, CorpusError> {
    if there == here {
        return Ok(Put::Same);
    }
    let (there, here) = (sha256(there), sha256(here));
    Err(CorpusError::Differs {
        place: store.place(),
        name: name.into(),
        there: there[..12].into(),
        here: here[..12].into(),
    })
}

/// Creates a folder and those above it, `root` and beyond left out; each new name is synced into the folder that holds it.
fn create_synced(folder: &Path, root: Option<&Path>) -> std::io::Result<()> {
    if folder.as_os_str().is_empty() || folder.is_dir() || Some(folder) == root {
        return Ok(());
    }
    if let Some(above) = folder.parent() {
        create_synced(above, root)?;
    }
    match fs::create_dir(folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => Err(error),
        _ => sync_folder_of(folder),
    }
}

/// A name is on disk only once its folder is.
fn sync_folder_of(path: &Path) -> std::io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> (tempfile::TempDir, LocalFolder) {
        let dir = tempfile::tempdir().unwrap();
        let store = LocalFolder::new(dir.path().join("corpus"));
        store.put("plan", b"").unwrap();
        (dir, store)
    }

    #[test]
    fn law_of_many_writers_of_one_name_exactly_one_creates_it() {
        let (_dir, store) = folder();
        let created: usize = std::thread::scope(|scope| {
            let writers: Vec<_> = (0..8).map(|_| scope.spawn(|| store.put("data/a", &[7; 100_000]).unwrap())).collect();
            writers.into_iter().map(|w| usize::from(w.join().unwrap() == Put::Created)).sum()
        });
        assert_eq!(created, 1);
        assert_eq!(store.list("data").unwrap(), vec![("data/a".to_string(), 100_000)]);
        assert_eq!(fs::read_dir(store.root.join("data")).unwrap().count(), 1, "no temporary file stays");
    }

    #[test]
    fn law_what_a_killed_writer_leaves_is_never_taken_for_whole() {
        let (_dir, store) = folder();
        store.put("data/a", b"whole").unwrap();
        fs::write(store.root.join("data/.tmp-4711-x1"), b"half").unwrap();
        assert_eq!(store.list("data").unwrap(), vec![("data/a".to_string(), 5)]);
        assert!(store.read("data/.tmp-4711-x1").is_err());
        store.sweep_temporaries("data").unwrap();
        assert_eq!(fs::read_dir(store.root.join("data")).unwrap().count(), 1);
    }

    #[test]
    fn law_the_temporary_files_of_a_live_writer_are_never_swept() {
        let (_dir, store) = folder();
        store.put("data/a", b"whole").unwrap();
        let live = locked_temporary(&store.root.join("data")).unwrap();
        fs::write(store.root.join("data/.tmp-1-dead"), b"half").unwrap();
        fs::write(store.root.join(".tmp-1-dead"), b"half").unwrap();
        store.sweep_temporaries("data").unwrap();
        store.sweep_temporaries("").unwrap();
        assert!(live.path().exists() && !store.root.join("data/.tmp-1-dead").exists());
        assert!(!store.root.join(".tmp-1-dead").exists());
        let abandoned = live.path().to_path_buf();
        // The lock ends with the file's handle, as it does with the process.
        let (handle, path) = live.keep().unwrap();
        drop(handle);
        assert_eq!(path, abandoned);
        store.sweep_temporaries("data").unwrap();
        assert!(!abandoned.exists());
    }

    #[test]
    fn law_writers_and_sweepers_at_once_lose_nothing() {
        let (_dir, store) = folder();
        let over = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            let sweeper = scope.spawn(|| {
                while !over.load(std::sync::atomic::Ordering::Relaxed) {
                    store.sweep_temporaries("data").unwrap();
                }
            });
            let puts: Vec<_> = (0..200).map(|k| store.put(&format!("data/{k}"), &[k as u8; 1000])).collect();
            over.store(true, std::sync::atomic::Ordering::Relaxed);
            sweeper.join().unwrap();
            assert!(puts.into_iter().all(|put| put.unwrap() == Put::Created));
        });
        assert_eq!(store.list("data").unwrap().len(), 200);
    }

    #[test]
    fn law_a_place_says_what_is_free_and_whether_it_can_be_written() {
        let (_dir, store) = folder();
        assert!(store.free_bytes().unwrap().unwrap() > 0);
        store.probe().unwrap();
        assert_eq!(fs::read_dir(&store.root).unwrap().count(), 1, "the probe is gone");
        fs::remove_dir_all(&store.root).unwrap();
        assert!(store.put("data/a", b"x").is_err() && !store.root.exists(), "what has gone away is not made again");
        fs::write(&store.root, b"a file").unwrap();
        assert!(matches!(store.probe(), Err(CorpusError::Io { .. })));
    }

    #[test]
    fn law_others_may_read_what_is_written() {
        let (_dir, store) = folder();
        store.put("a", b"x").unwrap();
        let plain = store.root.join("plain");
        fs::write(&plain, b"x").unwrap();
        let mode = |path: PathBuf| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(store.root.join("a")), mode(plain));
    }
}
