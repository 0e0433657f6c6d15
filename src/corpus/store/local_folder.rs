//! A folder on a local (or network) file system, as a [`Store`].
//!
//! In: names and bytes. Out: files that are whole or not there, also after a crash or a loss of power. A file is written to a temporary name
//! of its own, synced, and renamed without replacing; then the folder is synced. What ends in a crash is a file named
//! `.marsyard-tmp-PID-...`; it is never listed and never taken for whole. A live writer holds a lock on each of its temporary files, and
//! the lock ends with the process, however it ends: who sweeps removes only what it can lock itself, in folders of marsyard's own
//! ([`owner`](crate::corpus::owner)).
//!
//! Beside `LocalFileSystem` of `object_store` 0.14, which syncs files and folders as well: it needs hard links to put without replacing,
//! where a few file systems have none but rename so; nothing tells the staged files of a process that was killed from those of one that
//! writes; and a plain build is to do without the crate. Each call of this one was made to fail, and each write cut off by a loss of
//! power, in turn (`docs/evidence.md`).

use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::files::{FolderEntry, read_file, take_name};
use super::{Files, Put, Store, compared, is_name, is_temporary, read_folder, temporary_prefix};
use crate::corpus::CorpusError;

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

    /// Refuses a link that leads nowhere: what is made at its end is not what was named. A folder may be there all the same: another build
    /// of the same corpus may have made it since it was looked for.
    fn refuse_broken_link(&self) -> Result<(), CorpusError> {
        let is_link = fs::symlink_metadata(&self.root).is_ok_and(|facts| facts.is_symlink());
        let leads_nowhere = || fs::metadata(&self.root).is_err_and(|error| error.kind() == ErrorKind::NotFound);
        if !is_link || !leads_nowhere() {
            return Ok(());
        }
        let (reason, cure) = ("it is a link to a folder that is not there", "make that folder, or remove the link");
        Err(CorpusError::Refused { place: self.place(), reason: reason.into(), cure: cure.into() })
    }

    /// A file, opened without waiting: for a pipe, whose writer may never come, as for all else that is no file, it is refused.
    fn opened(&self, name: &str) -> Result<File, CorpusError> {
        self.opened_by(name, File::options().read(true))
    }

    /// The same, opened for what the options say.
    fn opened_by(&self, name: &str, options: &mut OpenOptions) -> Result<File, CorpusError> {
        let path = self.path(name)?;
        let not_a_file = |what| CorpusError::NotAFile { place: self.place(), name: name.into(), what };
        let facts = fs::symlink_metadata(&path).map_err(self.failed(name))?;
        let refused = |facts: &fs::Metadata| kind_of(facts.file_type()).map_or(Ok(()), |what| Err(not_a_file(what)));
        refused(&facts)?;
        // It may have been replaced since.
        let flags = rustix::fs::OFlags::NOFOLLOW | rustix::fs::OFlags::NONBLOCK;
        let file = options.custom_flags(flags.bits() as i32).open(&path).map_err(self.failed(name))?;
        refused(&file.metadata().map_err(self.failed(name))?)?;
        Ok(file)
    }

    /// What lies right in a folder; nothing where there is no such folder.
    fn entries(&self, folder: &str) -> Result<Vec<FolderEntry>, CorpusError> {
        let entries = match read_folder(&self.path(folder)?) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            other => other.map_err(self.failed(folder))?,
        };
        let mut kept = Vec::new();
        for entry in entries {
            let entry = entry.map_err(self.failed(folder))?;
            if !is_temporary(&entry.file_name().to_string_lossy()) {
                kept.push(entry);
            }
        }
        Ok(kept)
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
        match take_name(file, &path, |file| file.persist_noclobber(&path)) {
            Ok(()) => {
                sync_folder_of(&path).map_err(self.failed(name))?;
                Ok(Put::Created)
            }
            // Another writer was faster.
            Err(_) if self.size(name)?.is_some() => compared(self, name, &self.read(name)?, bytes),
            Err(error) => Err(self.failed(name)(error)),
        }
    }

    fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError> {
        let path = self.path(name)?;
        // What cannot be read is replaced: it may be damaged, or nobody's to read.
        if self.size(name)? == Some(bytes.len() as u64) && self.read(name).is_ok_and(|there| there == bytes) {
            return Ok(());
        }
        let file = self.written(&path, bytes).map_err(self.failed(name))?;
        file.persist(&path).map_err(|error| self.failed(name)(error.error))?;
        sync_folder_of(&path).map_err(self.failed(name))
    }

    fn read_within(&self, name: &str, most: u64) -> Result<Vec<u8>, CorpusError> {
        read_file(self.opened(name)?, most).map_err(self.failed(name))
    }

    fn read_range(&self, name: &str, offset: u64, length: usize) -> Result<Vec<u8>, CorpusError> {
        let mut file = self.opened(name)?;
        let mut read = || {
            file.seek(SeekFrom::Start(offset))?;
            let mut bytes = Vec::new();
            (&file).take(length as u64).read_to_end(&mut bytes)?;
            Ok(bytes)
        };
        read().map_err(self.failed(name))
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, u64)>, CorpusError> {
        Ok(self.list_all(folder)?.0)
    }

    fn list_all(&self, folder: &str) -> Result<(Files, Vec<String>), CorpusError> {
        let (mut files, mut others) = (Vec::new(), Vec::new());
        for entry in self.entries(folder)? {
            let name = format!("{folder}/{}", entry.file_name().to_string_lossy());
            let facts = match entry.metadata() {
                // Removed since it was listed.
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                other => other.map_err(self.failed(&name))?,
            };
            if facts.is_file() {
                files.push((name, facts.len()));
            } else {
                others.push(name);
            }
        }
        files.sort();
        Ok((files, others))
    }

    fn size(&self, name: &str) -> Result<Option<u64>, CorpusError> {
        match fs::symlink_metadata(self.path(name)?) {
            Ok(facts) => match kind_of(facts.file_type()) {
                None => Ok(Some(facts.len())),
                Some(what) => Err(CorpusError::NotAFile { place: self.place(), name: name.into(), what }),
            },
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(self.failed(name)(error)),
        }
    }

    fn remove(&self, name: &str) -> Result<(), CorpusError> {
        if self.size(name)?.is_none() {
            return Ok(());
        }
        let path = self.path(name)?;
        match fs::remove_file(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            // What a power cut brings back would be there beside what was written since.
            removed => removed.and_then(|()| sync_folder_of(&path)).map_err(self.failed(name)),
        }
    }

    fn append(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError> {
        let mut file = self.opened_by(name, File::options().append(true))?;
        file.write_all(bytes).and_then(|()| file.sync_data()).map_err(self.failed(name))
    }

    fn first_entry(&self) -> Result<Option<String>, CorpusError> {
        let entries = match read_folder(&self.root) {
            Err(error) if error.kind() == ErrorKind::NotFound => return self.refuse_broken_link().map(|()| None),
            other => other.map_err(self.failed(""))?,
        };
        let names = entries.map(|entry| entry.map(|entry| entry.file_name().to_string_lossy().into_owned()));
        let names = names.collect::<Result<Vec<_>, _>>().map_err(self.failed(""))?;
        Ok(names.into_iter().filter(|name| !is_temporary(name)).min())
    }

    fn sweep_temporaries(&self, folder: &str) -> Result<(), CorpusError> {
        let path = if folder.is_empty() { self.root.clone() } else { self.path(folder)? };
        let Ok(entries) = read_folder(&path) else { return Ok(()) };
        for entry in entries.flatten() {
            if !entry.is_file().unwrap_or(false) || !is_temporary(&entry.file_name().to_string_lossy()) {
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

/// What is no file, in words; `None` for a file.
fn kind_of(kind: fs::FileType) -> Option<&'static str> {
    match kind {
        kind if kind.is_file() => None,
        kind if kind.is_symlink() => Some("a link"),
        kind if kind.is_dir() => Some("a folder"),
        kind if kind.is_fifo() => Some("a pipe"),
        _ => Some("a device or a socket"),
    }
}

/// A new file that says, by its lock, that its writer lives.
fn locked_temporary(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    loop {
        // Mode 666 less the umask, as any other new file: others shall read a corpus.
        let file = tempfile::Builder::new()
            .prefix(&temporary_prefix())
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

/// Writes a file that lies in no place of marsyard's: whole, or not at all. What is no file (a pipe, a terminal) is written to.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if fs::metadata(path).is_ok_and(|facts| !facts.is_file()) {
        return fs::write(path, bytes);
    }
    // Through a link, so that it stays one.
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = locked_temporary(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(&path).map_err(|error| error.error)?;
    sync_folder_of(&path)
}

/// A temporary file that nobody holds, locked; where that cannot be known, somebody does.
fn abandoned(path: &Path) -> Option<File> {
    File::open(path).ok().filter(|file| file.try_lock().is_ok())
}

/// Creates a folder and those above it, `root` and beyond left out; each new name is synced into the folder that holds it.
pub(crate) fn create_synced(folder: &Path, root: Option<&Path>) -> std::io::Result<()> {
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
pub(crate) fn sync_folder_of(path: &Path) -> std::io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests;
