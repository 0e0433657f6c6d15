//! Local files and folders, where the standard library is not careful enough: bounded reads, listings, new names.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::fs::FileType;

/// The bytes of a file, `most` at most. A pipe would be waited for and a device has no end: neither is opened.
pub(crate) fn read_local(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let facts = fs::metadata(path)?;
    let kind = facts.file_type();
    if kind.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if !kind.is_file() {
        return Err(io::Error::new(ErrorKind::InvalidInput, "it is not a file but a pipe, a device or a socket"));
    }
    read_file(File::open(path)?, most)
}

/// Whether what the system said may be otherwise another time: all but what is wrong with a name, a kind of file or a right.
pub(crate) fn may_pass(error: &io::Error) -> bool {
    let is_lasting = matches!(
        error.kind(),
        ErrorKind::NotFound
            | ErrorKind::PermissionDenied
            | ErrorKind::ReadOnlyFilesystem
            | ErrorKind::IsADirectory
            | ErrorKind::NotADirectory
            | ErrorKind::InvalidInput
            | ErrorKind::InvalidFilename
            | ErrorKind::AlreadyExists
            | ErrorKind::Unsupported
    );
    !is_lasting && error.raw_os_error() != Some(rustix::io::Errno::LOOP.raw_os_error())
}

/// The bytes of an opened file, `most` at most.
pub(super) fn read_file(file: File, most: u64) -> io::Result<Vec<u8>> {
    let too_long = |there: u64| {
        let said = format!("it has {there} bytes, more than the {most} that are read");
        io::Error::new(ErrorKind::InvalidInput, said)
    };
    let announced = file.metadata()?.len();
    if announced > most {
        return Err(too_long(announced));
    }
    let mut bytes = Vec::with_capacity(announced as usize);
    // Files of /proc say that they are empty, and are not.
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_long(bytes.len() as u64)) } else { Ok(bytes) }
}

/// Something in a folder.
pub(crate) struct FolderEntry {
    folder: PathBuf,
    name: OsString,
    kind: FileType,
}

impl FolderEntry {
    pub(crate) fn file_name(&self) -> &OsStr {
        &self.name
    }

    /// Whether it is a file; a link to one is none.
    pub(super) fn is_file(&self) -> io::Result<bool> {
        match self.kind {
            // Some file systems do not say.
            FileType::Unknown => Ok(self.metadata()?.is_file()),
            kind => Ok(kind.is_file()),
        }
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.folder.join(&self.name)
    }

    /// Of the link itself, where it is one.
    pub(super) fn metadata(&self) -> io::Result<Metadata> {
        fs::symlink_metadata(self.path())
    }
}

/// What is in a folder. As `std::fs::read_dir`, which panics where the system fails to close the folder (EIO, on network file systems).
pub(crate) fn read_folder(folder: &Path) -> io::Result<std::vec::IntoIter<io::Result<FolderEntry>>> {
    let is_own = |name: &OsStr| name == "." || name == "..";
    let mut entries = Vec::new();
    for entry in rustix::fs::Dir::new(File::open(folder)?)? {
        match entry {
            Ok(entry) if is_own(OsStr::from_bytes(entry.file_name().to_bytes())) => {}
            Ok(entry) => {
                let name = OsStr::from_bytes(entry.file_name().to_bytes()).to_owned();
                entries.push(Ok(FolderEntry { folder: folder.to_owned(), name, kind: entry.file_type() }));
            }
            Err(error) => entries.push(Err(error.into())),
        }
    }
    Ok(entries.into_iter())
}

/// Gives a whole file its name, where nothing has it. Some file systems can neither rename without replacing nor link: there a
/// plain rename must do, so close behind the look that only a writer in between is replaced; its bytes are ours, by the same plan.
pub(super) fn take_name(
    file: tempfile::NamedTempFile,
    path: &Path,
    without_replacing: impl FnOnce(tempfile::NamedTempFile) -> Result<File, tempfile::PersistError>,
) -> io::Result<()> {
    use ErrorKind::{InvalidInput, PermissionDenied, TooManyLinks, Unsupported};
    match without_replacing(file) {
        Ok(_) => Ok(()),
        Err(refused)
            if matches!(refused.error.kind(), InvalidInput | PermissionDenied | TooManyLinks | Unsupported) =>
        {
            if path.symlink_metadata().is_ok() {
                return Err(ErrorKind::AlreadyExists.into());
            }
            refused.file.persist(path).map(drop).map_err(|error| error.error)
        }
        Err(refused) => Err(refused.error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_a_name_is_taken_where_the_file_system_can_neither_keep_nor_link() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        let written = |bytes: &[u8]| {
            let file = tempfile::NamedTempFile::new_in(dir.path()).unwrap();
            fs::write(file.path(), bytes).unwrap();
            file
        };
        let failing = |kind: ErrorKind| move |file| Err(tempfile::PersistError { error: kind.into(), file });
        take_name(written(b"one"), &path, failing(ErrorKind::InvalidInput)).unwrap();
        let taken = take_name(written(b"two"), &path, failing(ErrorKind::Unsupported)).unwrap_err();
        assert_eq!((taken.kind(), fs::read(&path).unwrap()), (ErrorKind::AlreadyExists, b"one".to_vec()));
        let full = take_name(written(b"x"), &dir.path().join("b"), failing(ErrorKind::StorageFull)).unwrap_err();
        assert!(full.kind() == ErrorKind::StorageFull && !dir.path().join("b").exists());
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 1, "what was not named is gone");
    }

    #[test]
    fn exact_what_may_pass_is_told_from_what_was_named_wrong() {
        use rustix::io::Errno;
        let passes = |errno: Errno| may_pass(&errno.into());
        assert!([Errno::IO, Errno::MFILE, Errno::NFILE, Errno::NOMEM, Errno::STALE].into_iter().all(passes));
        assert!(![Errno::NOENT, Errno::ACCESS, Errno::ISDIR, Errno::NOTDIR, Errno::LOOP].into_iter().any(passes));
    }

    #[test]
    fn equal_a_folder_is_read_as_std_reads_it() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("file"), b"123").unwrap();
        fs::create_dir(dir.path().join("folder")).unwrap();
        std::os::unix::fs::symlink("file", dir.path().join("link")).unwrap();
        let mut here: Vec<_> = read_folder(dir.path()).unwrap().map(Result::unwrap).map(|entry| entry.path()).collect();
        let mut there: Vec<_> = fs::read_dir(&dir).unwrap().map(|entry| entry.unwrap().path()).collect();
        here.sort();
        there.sort();
        assert_eq!((here.len(), here), (3, there));
        let file = read_folder(dir.path()).unwrap().map(Result::unwrap).find(|entry| entry.file_name() == "file");
        assert_eq!(file.unwrap().metadata().unwrap().len(), 3);
        assert_eq!(read_folder(&dir.path().join("none")).err().unwrap().kind(), ErrorKind::NotFound);
    }
}
