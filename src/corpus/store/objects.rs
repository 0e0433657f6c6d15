//! A prefix in a bucket as a [`Store`]: `s3://`, `gs://`, `az://`.
//!
//! An object is there whole or not at all, and is put without replacing (`If-None-Match`, or what the service has instead): two
//! writers of the same bytes are both right. Where a put finds the name taken, the bytes there are read and compared; an answer
//! that was lost on the way (a dropped connection, a time-out) is met the same way by the next try. Reads go on where a
//! connection broke, as long as the object is still the same one. What a put stored is held against what was sent ([`Stored`]).
//! What a server announces is judged before it is taken in, and what it sends is counted: bytes, names, and time.
//!
//! The pipeline is threads, `object_store` is async: one small runtime serves all stores of the process, and each call
//! waits for its own end. Faults that pass are borne with for as long as [`Limits`] say.

use std::sync::{Arc, LazyLock};
use std::time::Duration;

use bytes::Bytes;
use futures_util::TryStreamExt;
use object_store::path::Path;
use object_store::{Error, GetOptions, GetRange, ObjectStore, ObjectStoreExt, PutMode, PutOptions, PutPayload};
use tokio::runtime::{Builder, Runtime};

use super::backoff::{Backoff, Limits, NAME_BYTES, SLOWEST};
use super::inspected_client::{self, Fault, MAX_ANSWER_BYTES};
use super::stored::Stored;
use super::{Put, Store, compared, is_name, is_temporary};
use crate::corpus::CorpusError;

/// What a request costs in time, reading on costs for so many bytes.
const GRAIN_BYTES: usize = 4 << 20;
/// How much longer than ours an object may be that another writer put in our place, to be compared and told of.
const OTHERS_MORE: u64 = 64 << 20;
/// Names in the longest listing: a folder of a corpus holds a file a shard.
const MOST_NAMES: usize = 1 << 20;
/// Trouble is told of from this try on; before, it is over in less than a second.
const TELL_FROM_TRY: u32 = 4;

static RUNTIME: LazyLock<std::io::Result<Runtime>> =
    LazyLock::new(|| Builder::new_multi_thread().worker_threads(2).thread_name("store").enable_all().build());

/// Objects below a prefix.
#[derive(Clone)]
pub(crate) struct ObjectFolder {
    client: Arc<dyn ObjectStore>,
    /// `s3://bucket`.
    bucket: String,
    prefix: String,
    limits: Limits,
}

/// What has come of an object so far.
#[derive(Default)]
struct ResumableRead {
    received: Vec<u8>,
    /// The entity tag that the rest must have too.
    same: Option<String>,
    /// The most that ever had come: only more than that is progress.
    furthest: usize,
}

/// What is asked of an object.
#[derive(Clone, Copy, Debug)]
enum Part {
    /// All of it, refused where it is longer.
    Whole { most: u64 },
    /// Its bytes from `offset` on, or fewer at its end.
    Range { offset: u64, length: usize },
}

impl Part {
    fn first(self) -> u64 {
        if let Part::Range { offset, .. } = self { offset } else { 0 }
    }

    fn most(self) -> u64 {
        match self {
            Part::Whole { most } => most,
            Part::Range { length, .. } => length as u64,
        }
    }

    /// What to ask for where all before `begin` is there.
    fn rest(self, begin: u64) -> Option<GetRange> {
        match self {
            Part::Range { offset, length } => Some(GetRange::Bounded(begin..offset + length as u64)),
            Part::Whole { .. } if begin == 0 => None,
            Part::Whole { .. } => Some(GetRange::Offset(begin)),
        }
    }
}

/// What follows where other bytes were stored than were sent: once it may have been the way.
fn altered(again: bool) -> Fault {
    if again {
        Fault::Lasting(
            "twice other bytes were stored than were sent: the store, or something before it, damages data".into(),
        )
    } else {
        Fault::Passing("other bytes were stored than were sent".into())
    }
}

/// Takes one more name of a listing, as long as they are not too many and do not take too long. `furthest`: the most that ever came.
fn count_name(names: &mut usize, furthest: &mut usize, backoff: &Backoff) -> Result<(), Fault> {
    *names += 1;
    if *names > MOST_NAMES {
        return Err(Fault::Lasting(format!("more than {MOST_NAMES} names are listed there; no corpus has so many")));
    }
    if *names > *furthest {
        *furthest = *names;
        backoff.made_progress(NAME_BYTES);
    }
    if backoff.is_over() {
        return Err(Fault::Passing(format!("only {names} names came in all that time")));
    }
    Ok(())
}

impl ObjectFolder {
    pub(crate) fn new(client: Arc<dyn ObjectStore>, bucket: &str, prefix: &str) -> ObjectFolder {
        ObjectFolder { client, bucket: bucket.into(), prefix: prefix.into(), limits: Limits::of_environment() }
    }

    /// The same with other limits.
    #[cfg(test)]
    pub(crate) fn with_limits(self, limits: Limits) -> ObjectFolder {
        ObjectFolder { limits, ..self }
    }

    fn path(&self, name: &str) -> Result<Path, CorpusError> {
        let bad = || CorpusError::BadName { name: name.into() };
        let whole = if self.prefix.is_empty() { name.to_owned() } else { format!("{}/{name}", self.prefix) };
        if is_name(name) { Path::parse(whole).map_err(|_| bad()) } else { Err(bad()) }
    }

    /// Tries until it is done, until trying does not help, or until patience ends.
    fn persist<T>(
        &self,
        name: &str,
        mut attempt: impl AsyncFnMut(&Backoff) -> Result<T, Fault>,
    ) -> Result<Result<T, Fault>, CorpusError> {
        let runtime = RUNTIME.as_ref().map_err(|error| CorpusError::Io {
            place: self.place(),
            name: name.into(),
            source: std::io::Error::other(format!("cannot start threads for the network: {error}")),
        })?;
        runtime.block_on(async {
            let backoff = Backoff::new(self.limits, name);
            loop {
                let why = match attempt(&backoff).await {
                    Ok(value) => return Ok(Ok(value)),
                    Err(Fault::Passing(why)) => why,
                    Err(Fault::Refused { reason, cure }) => {
                        return Err(CorpusError::Refused { place: self.place(), reason, cure: cure.into() });
                    }
                    Err(Fault::Untrusted(reason)) => {
                        return Err(CorpusError::Untrusted { place: self.place(), reason });
                    }
                    Err(Fault::Lasting(reason) | Fault::TooLong(reason)) => {
                        let source = std::io::Error::new(std::io::ErrorKind::InvalidInput, reason);
                        return Err(CorpusError::Io { place: self.place(), name: name.into(), source });
                    }
                    Err(other) => return Ok(Err(other)),
                };
                let Some(pause) = backoff.pause() else {
                    let patience_s = self.limits.patience.as_secs_f64();
                    return Err(CorpusError::Unreachable { place: self.place(), name: name.into(), why, patience_s });
                };
                if backoff.tries() == TELL_FROM_TRY {
                    tracing::warn!("{}/{name}: {why}; trying on", self.place());
                }
                tokio::time::sleep(pause).await;
            }
        })
    }

    /// The same, where a missing object is an error like any other.
    fn done<T>(&self, name: &str, attempt: impl AsyncFnMut(&Backoff) -> Result<T, Fault>) -> Result<T, CorpusError> {
        self.persist(name, attempt)?.map_err(|fault| self.unexpected(name, &fault))
    }

    fn unexpected(&self, name: &str, fault: &Fault) -> CorpusError {
        let source = match fault {
            Fault::NotFound => std::io::ErrorKind::NotFound.into(),
            _ => std::io::Error::other("another writer was at it at the same time: try again"),
        };
        CorpusError::Io { place: self.place(), name: name.into(), source }
    }

    /// Reads a part.
    fn fetch(&self, name: &str, part: Part) -> Result<Vec<u8>, CorpusError> {
        let path = self.path(name)?;
        let mut coming = ResumableRead::default();
        self.done(name, async |backoff| self.take_in(&path, part, &mut coming, backoff).await)?;
        Ok(coming.received)
    }

    /// Asks for what is missing of a part, and takes in what comes.
    async fn take_in(
        &self,
        path: &Path,
        part: Part,
        coming: &mut ResumableRead,
        backoff: &Backoff,
    ) -> Result<(), Fault> {
        if coming.same.is_none() {
            // Nothing would tell whether the rest is of the same object.
            coming.received.clear();
        }
        let first = part.first();
        let begin = first + coming.received.len() as u64;
        let options = GetOptions { range: part.rest(begin), if_match: coming.same.clone(), ..GetOptions::default() };
        let (silence, most) = (self.limits.silence, part.most());
        let answer =
            match inspected_client::attempt(silence, most.max(MAX_ANSWER_BYTES), self.client.get_opts(path, options))
                .await
            {
                Err(Fault::BeyondEnd) => return Ok(()),
                Err(Fault::Taken) => {
                    coming.same = None;
                    return Err(Fault::Passing("it was replaced while it was read".into()));
                }
                other => other?,
            };
        coming.same = answer.meta.e_tag.clone();
        let end = answer.range.end;
        if end.saturating_sub(first) > most {
            return Err(Fault::TooLong(format!("it has {end} bytes, more than the {most} that are read")));
        }
        let mut pieces = answer.into_stream();
        while let Some(piece) =
            inspected_client::attempt(silence, most.max(MAX_ANSWER_BYTES), pieces.try_next()).await?
        {
            coming.received.extend_from_slice(&piece);
            if first + coming.received.len() as u64 > end {
                return Err(Fault::Lasting("the store sends more than it announced".into()));
            }
            if coming.received.len() > coming.furthest {
                backoff.made_progress(coming.received.len() - coming.furthest);
                coming.furthest = coming.received.len();
            }
            if backoff.is_over() && first + (coming.received.len() as u64) < end {
                return Err(Fault::Passing(format!("only {} bytes came in all that time", coming.furthest)));
            }
        }
        match end.saturating_sub(first + coming.received.len() as u64) {
            0 => Ok(()),
            missing => Err(Fault::Passing(format!("the answer ended {missing} bytes early"))),
        }
    }

    /// Puts the bytes, and makes sure that it is they that are stored.
    async fn put_once(&self, path: &Path, bytes: &Bytes, mode: PutMode, backoff: &Backoff) -> Result<(), Fault> {
        let limit = self.limits.silence + Duration::from_secs_f64(bytes.len() as f64 / SLOWEST);
        let payload = PutPayload::from_bytes(bytes.clone());
        let options = PutOptions { mode, ..PutOptions::default() };
        let told: Stored = inspected_client::attempt_put(limit, self.client.put_opts(path, payload, options)).await?;
        let is_stored = match told.holds(bytes) {
            Some(is_stored) => is_stored,
            None => {
                let mut there = ResumableRead::default();
                let part = Part::Whole { most: bytes.len() as u64 };
                match self.take_in(path, part, &mut there, backoff).await {
                    // What is longer is other bytes too.
                    Err(Fault::TooLong(_)) => false,
                    other => {
                        other?;
                        there.received == bytes[..]
                    }
                }
            }
        };
        if is_stored { Ok(()) } else { Err(Fault::Altered) }
    }

    /// Puts an object; where other bytes were stored than were sent, once more. What is not to stay is removed.
    fn put_checked(&self, name: &str, bytes: &[u8], create: bool) -> Result<Put, CorpusError> {
        let path = self.path(name)?;
        let bytes = Bytes::copy_from_slice(bytes);
        let mode = if create { PutMode::Create } else { PutMode::Overwrite };
        let (mut is_first, mut is_altered) = (true, false);
        let there = self.done(name, async |backoff| {
            if std::mem::take(&mut is_first) {
                backoff.made_progress(bytes.len());
            }
            match self.put_once(&path, &bytes, mode.clone(), backoff).await {
                Err(Fault::Taken) if create => self.what_is_there(&path, &bytes, backoff).await.map(Some),
                Err(Fault::Taken) => Err(Fault::Passing("another writer is at it".into())),
                Err(Fault::Altered) => {
                    if create || is_altered {
                        inspected_client::attempt(self.limits.silence, MAX_ANSWER_BYTES, self.remove_once(&path))
                            .await?;
                    }
                    Err(altered(std::mem::replace(&mut is_altered, true)))
                }
                other => other.map(|()| None),
            }
        })?;
        there.map_or(Ok(Put::Created), |there| compared(self, name, &there, &bytes))
    }

    /// The object that a create-only put found: by another writer, or by a try of ours whose answer was lost.
    async fn what_is_there(&self, path: &Path, bytes: &Bytes, backoff: &Backoff) -> Result<Vec<u8>, Fault> {
        let mut there = ResumableRead::default();
        let part = Part::Whole { most: bytes.len() as u64 + OTHERS_MORE };
        match self.take_in(path, part, &mut there, backoff).await {
            Ok(()) => Ok(there.received),
            // A conflict also says so while the other writer is not done.
            Err(Fault::NotFound) => Err(Fault::Passing("another writer is at it".into())),
            Err(fault) => Err(fault),
        }
    }

    async fn remove_once(&self, path: &Path) -> Result<(), Error> {
        match self.client.delete(path).await {
            Err(Error::NotFound { .. }) => Ok(()),
            other => other,
        }
    }
}

impl Store for ObjectFolder {
    fn put(&self, name: &str, bytes: &[u8]) -> Result<Put, CorpusError> {
        self.put_checked(name, bytes, true)
    }

    fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError> {
        self.put_checked(name, bytes, false).map(drop)
    }

    fn read_within(&self, name: &str, most: u64) -> Result<Vec<u8>, CorpusError> {
        self.fetch(name, Part::Whole { most })
    }

    fn read_range(&self, name: &str, offset: u64, length: usize) -> Result<Vec<u8>, CorpusError> {
        if length == 0 {
            return Ok(Vec::new());
        }
        self.fetch(name, Part::Range { offset, length })
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, u64)>, CorpusError> {
        let path = self.path(folder)?;
        let mut furthest = 0;
        let mut files = self.done(folder, async |backoff| {
            let mut files = Vec::new();
            let mut pages = self.client.list(Some(&path));
            let mut names = 0;
            while let Some(object) =
                inspected_client::attempt(self.limits.silence, MAX_ANSWER_BYTES, pages.try_next()).await?
            {
                count_name(&mut names, &mut furthest, backoff)?;
                let (whole, root): (&str, &str) = (object.location.as_ref(), path.as_ref());
                let below = whole.strip_prefix(root).and_then(|rest| rest.strip_prefix('/'));
                if let Some(name) = below.filter(|name| !name.contains('/')) {
                    files.push((format!("{folder}/{name}"), object.size));
                }
            }
            Ok(files)
        })?;
        files.sort();
        Ok(files)
    }

    fn first_entry(&self) -> Result<Option<String>, CorpusError> {
        let bad = |_| CorpusError::BadName { name: self.prefix.clone() };
        let root = if self.prefix.is_empty() { None } else { Some(Path::parse(&self.prefix).map_err(bad)?) };
        let mut furthest = 0;
        self.done("", async |backoff| {
            let mut objects = self.client.list(root.as_ref());
            let mut names = 0;
            while let Some(object) =
                inspected_client::attempt(self.limits.silence, MAX_ANSWER_BYTES, objects.try_next()).await?
            {
                count_name(&mut names, &mut furthest, backoff)?;
                let whole: &str = object.location.as_ref();
                let below = whole.strip_prefix(&self.prefix).unwrap_or(whole).trim_start_matches('/');
                let first = below.split('/').next().unwrap_or_default();
                // An object of the folder's own name is how some tools draw an empty folder.
                if !first.is_empty() && !is_temporary(first) {
                    return Ok(Some(below.to_string()));
                }
            }
            Ok(None)
        })
    }

    fn size(&self, name: &str) -> Result<Option<u64>, CorpusError> {
        let path = self.path(name)?;
        match self.persist(name, async |_| {
            inspected_client::attempt(self.limits.silence, MAX_ANSWER_BYTES, self.client.head(&path)).await
        })? {
            Ok(meta) => Ok(Some(meta.size)),
            Err(Fault::NotFound) => Ok(None),
            Err(fault) => Err(self.unexpected(name, &fault)),
        }
    }

    fn remove(&self, name: &str) -> Result<(), CorpusError> {
        let path = self.path(name)?;
        match self.persist(name, async |_| {
            inspected_client::attempt(self.limits.silence, MAX_ANSWER_BYTES, self.remove_once(&path)).await
        })? {
            Ok(()) | Err(Fault::NotFound) => Ok(()),
            Err(fault) => Err(self.unexpected(name, &fault)),
        }
    }

    /// Nothing: an upload that was cut off leaves no object.
    fn sweep_temporaries(&self, _: &str) -> Result<(), CorpusError> {
        Ok(())
    }

    fn grain_bytes(&self) -> usize {
        GRAIN_BYTES
    }

    fn share(&self) -> Arc<dyn Store> {
        Arc::new(self.clone())
    }

    fn place(&self) -> String {
        if self.prefix.is_empty() { self.bucket.clone() } else { format!("{}/{}", self.bucket, self.prefix) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_listing_ends_behind_the_most_names() {
        let backoff = Backoff::new(Limits::of_environment(), "data");
        let (mut names, mut furthest) = (MOST_NAMES - 1, MOST_NAMES - 1);
        count_name(&mut names, &mut furthest, &backoff).expect("as many as may be");
        let fault = count_name(&mut names, &mut furthest, &backoff).expect_err("one too many");
        assert!(matches!(&fault, Fault::Lasting(why) if why.contains("no corpus has so many")), "{fault:?}");
    }
}
