//! Names -> bytes: what stands between the corpus and the disk, or an object store.
//!
//! A [`Store`] holds whole files under names such as `data/cells/train-0000007.parquet`. A file is there whole or not at
//! all, and two writers of the same bytes are both right. [`address`] says what a user's text names, `local_folder` what a folder does,
//! `objects` what object stores do.

pub mod address;
#[cfg(feature = "object-stores")]
mod backoff;
#[cfg(feature = "object-stores")]
mod connect;
#[cfg(test)]
mod contract;
mod files;
#[cfg(feature = "object-stores")]
mod inspected_client;
mod local_folder;
#[cfg(feature = "object-stores")]
mod objects;
#[cfg(feature = "object-stores")]
mod profile;
#[cfg(feature = "object-stores")]
mod secrets;
#[cfg(feature = "object-stores")]
mod stored;
#[cfg(all(test, feature = "object-stores"))]
mod wire;

use std::sync::Arc;

use super::{CorpusError, sha256};
pub(crate) use files::{may_pass, read_folder, read_local};
pub use local_folder::LocalFolder;
#[cfg(feature = "train")]
pub(crate) use local_folder::sync_folder_of;
pub(crate) use local_folder::{create_synced, write_whole};

/// Unfinished files begin with this, and then the number of the process that writes them.
const TEMPORARY: &str = ".marsyard-tmp-";

/// The largest file that is read as a whole where nobody says otherwise.
pub(crate) const MAX_FILE_BYTES: u64 = 4 << 30;

/// What a create-only put found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Put {
    Created,
    /// The same bytes were there already.
    Same,
}

/// Files of a folder, by name: what they are called and their bytes.
pub(crate) type Files = Vec<(String, u64)>;

/// A place for whole files.
pub trait Store: Send + Sync {
    /// Writes a new file; the same bytes twice are fine, other bytes are refused ([`CorpusError::Differs`]).
    fn put(&self, name: &str, bytes: &[u8]) -> Result<Put, CorpusError>;
    /// Writes a file that may be there already with other bytes (the derived ones: manifest, card).
    fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError>;
    fn read(&self, name: &str) -> Result<Vec<u8>, CorpusError> {
        self.read_within(name, MAX_FILE_BYTES)
    }
    /// A whole file, refused where it is longer than that, before more of it is taken in.
    fn read_within(&self, name: &str, most: u64) -> Result<Vec<u8>, CorpusError>;
    /// The bytes from `offset` on, `length` of them, or fewer at the file's end.
    fn read_range(&self, name: &str, offset: u64, length: usize) -> Result<Vec<u8>, CorpusError>;
    /// Names and sizes of the files right in a folder, ascending by name; empty where there is no such folder.
    fn list(&self, folder: &str) -> Result<Vec<(String, u64)>, CorpusError>;
    /// The same, and the names of what lies right in the folder and is no file (links, folders, pipes), by one listing.
    fn list_all(&self, folder: &str) -> Result<(Files, Vec<String>), CorpusError> {
        Ok((self.list(folder)?, Vec::new()))
    }
    /// Size in bytes, or `None` where there is no such file; what bears the name and is no file is refused.
    fn size(&self, name: &str) -> Result<Option<u64>, CorpusError>;
    /// Removes a file; no such file is fine.
    fn remove(&self, name: &str) -> Result<(), CorpusError>;
    /// Adds to the end of a file that is there.
    fn append(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError> {
        let mut whole = self.read(name)?;
        whole.extend_from_slice(bytes);
        self.replace(name, &whole)
    }
    /// The name of something in the place, file or folder, that is none of marsyard's temporary files; the first of them where they
    /// have an order. `None` where the place is empty or not there.
    fn first_entry(&self) -> Result<Option<String>, CorpusError>;
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

/// Whether a name is that of an unfinished file of marsyard's: `.marsyard-tmp-PID-...`.
pub(crate) fn is_temporary(name: &str) -> bool {
    let pid = name.strip_prefix(TEMPORARY).and_then(|rest| rest.split_once('-'));
    pid.is_some_and(|(pid, _)| !pid.is_empty() && pid.bytes().all(|digit| digit.is_ascii_digit()))
}

/// What a temporary file or folder of this process begins with.
pub(crate) fn temporary_prefix() -> String {
    format!("{TEMPORARY}{}-", std::process::id())
}

/// Whether a name stays within its place, and is none of an unfinished file.
fn is_name(name: &str) -> bool {
    let sound = |part: &str| !part.is_empty() && part != "." && part != ".." && !is_temporary(part);
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
