//! A prefix in a bucket as a [`Store`]: `s3://`, `gs://`, `az://`.
//!
//! An object is there whole or not at all, and is put without replacing (`If-None-Match`, or what the service has instead): two
//! writers of the same bytes are both right. Where a put finds the name taken, the bytes there are read and compared; an answer
//! that was lost on the way (a dropped connection, a time-out) is met the same way by the next try. Reads go on where a
//! connection broke, as long as the object is still the same one.
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

use super::patience::{Limits, Patience};
use super::watch::{self, Fault};
use super::{Put, Store, compared, is_name};
use crate::corpus::CorpusError;

/// What a request costs in time, reading on costs for so many bytes.
const GRAIN_BYTES: usize = 4 << 20;
/// The slowest upload that is waited for, bytes a second.
const SLOWEST_PUT: f64 = 32_768.0;
/// Trouble is told of from this try on; before, it is over in less than a second.
const TELL_FROM_TRY: u32 = 4;

static RUNTIME: LazyLock<std::io::Result<Runtime>> =
    LazyLock::new(|| Builder::new_multi_thread().worker_threads(2).thread_name("store").enable_all().build());

/// Objects below a prefix.
#[derive(Clone)]
pub struct ObjectFolder {
    client: Arc<dyn ObjectStore>,
    /// `s3://bucket`.
    bucket: String,
    prefix: String,
    limits: Limits,
}

/// What has come of an object so far.
#[derive(Default)]
struct Coming {
    received: Vec<u8>,
    /// The entity tag that the rest must have too.
    same: Option<String>,
    /// The most that ever had come: only more than that is progress.
    furthest: usize,
}

impl ObjectFolder {
    pub fn new(client: Arc<dyn ObjectStore>, bucket: &str, prefix: &str) -> ObjectFolder {
        ObjectFolder { client, bucket: bucket.into(), prefix: prefix.into(), limits: Limits::of_environment() }
    }

    /// The same with other limits.
    #[cfg(test)]
    pub fn with_limits(self, limits: Limits) -> ObjectFolder {
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
        mut attempt: impl AsyncFnMut(&Patience) -> Result<T, Fault>,
    ) -> Result<Result<T, Fault>, CorpusError> {
        let runtime = RUNTIME.as_ref().map_err(|error| CorpusError::Io {
            place: self.place(),
            name: name.into(),
            source: std::io::Error::other(format!("cannot start threads for the network: {error}")),
        })?;
        runtime.block_on(async {
            let patience = Patience::new(self.limits, name);
            loop {
                let why = match attempt(&patience).await {
                    Ok(value) => return Ok(Ok(value)),
                    Err(Fault::Passing(why)) => why,
                    Err(Fault::Refused { reason, cure }) => {
                        return Err(CorpusError::Refused { place: self.place(), reason, cure: cure.into() });
                    }
                    Err(Fault::Lasting(reason)) => {
                        let source = std::io::Error::new(std::io::ErrorKind::InvalidInput, reason);
                        return Err(CorpusError::Io { place: self.place(), name: name.into(), source });
                    }
                    Err(other) => return Ok(Err(other)),
                };
                let Some(pause) = patience.pause() else {
                    let patience_s = self.limits.patience.as_secs_f64();
                    return Err(CorpusError::Unreachable { place: self.place(), name: name.into(), why, patience_s });
                };
                if patience.tries() == TELL_FROM_TRY {
                    tracing::warn!("{}/{name}: {why}; trying on", self.place());
                }
                tokio::time::sleep(pause).await;
            }
        })
    }

    /// The same, where a missing object is an error like any other.
    fn done<T>(&self, name: &str, attempt: impl AsyncFnMut(&Patience) -> Result<T, Fault>) -> Result<T, CorpusError> {
        self.persist(name, attempt)?.map_err(|fault| self.unexpected(name, &fault))
    }

    fn unexpected(&self, name: &str, fault: &Fault) -> CorpusError {
        let source = match fault {
            Fault::NotFound => std::io::ErrorKind::NotFound.into(),
            _ => std::io::Error::other("another writer was at it at the same time: try again"),
        };
        CorpusError::Io { place: self.place(), name: name.into(), source }
    }

    /// Reads a range, or all.
    fn fetch(&self, name: &str, range: Option<(u64, usize)>) -> Result<Vec<u8>, CorpusError> {
        let path = self.path(name)?;
        let mut coming = Coming::default();
        self.done(name, async |patience| self.take_in(&path, range, &mut coming, patience).await)?;
        Ok(coming.received)
    }

    /// Asks for what is missing of a range, or of all, and takes in what comes.
    async fn take_in(
        &self,
        path: &Path,
        range: Option<(u64, usize)>,
        coming: &mut Coming,
        patience: &Patience,
    ) -> Result<(), Fault> {
        if coming.same.is_none() {
            // Nothing would tell whether the rest is of the same object.
            coming.received.clear();
        }
        let first = range.map_or(0, |(offset, _)| offset);
        let begin = first + coming.received.len() as u64;
        let wanted = match range {
            Some((offset, length)) => Some(GetRange::Bounded(begin..offset + length as u64)),
            None if begin == 0 => None,
            None => Some(GetRange::Offset(begin)),
        };
        let options = GetOptions { range: wanted, if_match: coming.same.clone(), ..GetOptions::default() };
        let answer = match watch::attempt(self.limits.silence, self.client.get_opts(path, options)).await {
            Err(Fault::BeyondEnd) => return Ok(()),
            Err(Fault::Taken) => {
                coming.same = None;
                return Err(Fault::Passing("it was replaced while it was read".into()));
            }
            other => other?,
        };
        coming.same = answer.meta.e_tag.clone();
        let end = answer.range.end;
        let mut pieces = answer.into_stream();
        while let Some(piece) = watch::attempt(self.limits.silence, pieces.try_next()).await? {
            coming.received.extend_from_slice(&piece);
            if coming.received.len() > coming.furthest {
                coming.furthest = coming.received.len();
                patience.made_progress();
            }
        }
        match end.saturating_sub(first + coming.received.len() as u64) {
            0 => Ok(()),
            missing => Err(Fault::Passing(format!("the answer ended {missing} bytes early"))),
        }
    }

    async fn put_once(&self, path: &Path, bytes: &Bytes, mode: PutMode) -> Result<(), Fault> {
        let limit = self.limits.silence + Duration::from_secs_f64(bytes.len() as f64 / SLOWEST_PUT);
        let payload = PutPayload::from_bytes(bytes.clone());
        let options = PutOptions { mode, ..PutOptions::default() };
        watch::attempt(limit, self.client.put_opts(path, payload, options)).await.map(|_| ())
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
        let path = self.path(name)?;
        let bytes = Bytes::copy_from_slice(bytes);
        let there = self.done(name, async |patience| match self.put_once(&path, &bytes, PutMode::Create).await {
            // By another writer, or by a try of ours whose answer was lost.
            Err(Fault::Taken) => {
                let mut there = Coming::default();
                match self.take_in(&path, None, &mut there, patience).await {
                    Ok(()) => Ok(Some(there.received)),
                    // A conflict also says so while the other writer is not done.
                    Err(Fault::NotFound) => Err(Fault::Passing("another writer is at it".into())),
                    Err(fault) => Err(fault),
                }
            }
            other => other.map(|()| None),
        })?;
        there.map_or(Ok(Put::Created), |there| compared(self, name, &there, &bytes))
    }

    fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError> {
        let path = self.path(name)?;
        let bytes = Bytes::copy_from_slice(bytes);
        self.done(name, async |_| match self.put_once(&path, &bytes, PutMode::Overwrite).await {
            Err(Fault::Taken) => Err(Fault::Passing("another writer is at it".into())),
            other => other,
        })
    }

    fn read(&self, name: &str) -> Result<Vec<u8>, CorpusError> {
        self.fetch(name, None)
    }

    fn read_range(&self, name: &str, offset: u64, length: usize) -> Result<Vec<u8>, CorpusError> {
        if length == 0 {
            return Ok(Vec::new());
        }
        self.fetch(name, Some((offset, length)))
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, u64)>, CorpusError> {
        let path = self.path(folder)?;
        let mut furthest = 0;
        let mut files = self.done(folder, async |patience| {
            let mut files = Vec::new();
            let mut pages = self.client.list(Some(&path));
            while let Some(object) = watch::attempt(self.limits.silence, pages.try_next()).await? {
                if files.len() > furthest {
                    furthest = files.len();
                    patience.made_progress();
                }
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

    fn size(&self, name: &str) -> Result<Option<u64>, CorpusError> {
        let path = self.path(name)?;
        match self.persist(name, async |_| watch::attempt(self.limits.silence, self.client.head(&path)).await)? {
            Ok(meta) => Ok(Some(meta.size)),
            Err(Fault::NotFound) => Ok(None),
            Err(fault) => Err(self.unexpected(name, &fault)),
        }
    }

    fn remove(&self, name: &str) -> Result<(), CorpusError> {
        let path = self.path(name)?;
        match self.persist(name, async |_| watch::attempt(self.limits.silence, self.remove_once(&path)).await)? {
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
