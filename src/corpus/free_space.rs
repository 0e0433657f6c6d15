//! What a build still writes, against what is free on its disk.
//!
//! In: bytes about to be written. Out: go on, or an error with the figures. Asked before a build with the whole of it, where its
//! size is known or sampled, and before every shard with its exact bytes: a full disk is told in the evening, or stops a build
//! between two shards. A place that cannot say what is free (an object store) is never refused. Not seen: quotas, and what
//! others write meanwhile; then the disk's own error stops the build, between two shards as well.

use super::{CorpusError, Store};

/// A place's free space, some of which is to stay free.
pub(crate) struct FreeSpace<'a> {
    store: &'a dyn Store,
    keep_bytes: u64,
}

impl<'a> FreeSpace<'a> {
    pub(crate) fn new(store: &'a dyn Store, keep_bytes: u64) -> FreeSpace<'a> {
        FreeSpace { store, keep_bytes }
    }

    /// Refuses what would leave less than is to stay free.
    pub(crate) fn check(&self, bytes: u64, what: impl FnOnce() -> String) -> Result<(), CorpusError> {
        match self.store.free_bytes()? {
            Some(free_bytes) if free_bytes < bytes.saturating_add(self.keep_bytes) => {
                let (place, keep_bytes) = (self.store.place(), self.keep_bytes);
                Err(CorpusError::NoRoom { place, what: what(), bytes, keep_bytes, free_bytes })
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::LocalFolder;

    #[test]
    fn exact_what_leaves_too_little_is_refused_with_the_figures() {
        let dir = tempfile::tempdir().unwrap();
        let store = LocalFolder::new(dir.path().join("not/there/yet"));
        FreeSpace::new(&store, 0).check(0, String::new).unwrap();
        let free = store.free_bytes().unwrap().unwrap();
        // Others write on the same disk while this runs, so only a wide margin is exact.
        for (keep_bytes, bytes) in [(2 * free, 0), (0, 2 * free), (u64::MAX, u64::MAX)] {
            let said = FreeSpace::new(&store, keep_bytes).check(bytes, || "the build".into()).unwrap_err().to_string();
            assert!(said.contains("the build takes") && said.contains("the same command again"), "{said}");
        }
    }
}
