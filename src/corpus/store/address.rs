//! What a user calls a place -> a store: a folder, or a URL (`s3://`, `gs://`, `az://`, `file://`).
//!
//! A URL is taken literally, as the object stores' own tools take it: `%20` stays `%20`, but for `file://`, whose URLs are
//! percent-encoded by their standard. A URL that carries a key or a password is refused, and not repeated in the message:
//! credentials come from the environment and from the standard files alone.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{LocalFolder, Store, is_name};
use crate::corpus::CorpusError;
use crate::corpus::limits::FileKind;

/// Where objects lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Service {
    S3,
    Google,
    Azure,
}

impl Service {
    /// What a URL of it begins with.
    pub(crate) fn scheme(self) -> &'static str {
        match self {
            Service::S3 => "s3",
            Service::Google => "gs",
            Service::Azure => "az",
        }
    }
}

/// A place, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Address {
    Folder(PathBuf),
    /// `prefix`: no slash at either end; empty for a whole bucket.
    Objects {
        service: Service,
        bucket: String,
        prefix: String,
    },
}

/// Whether a place is written as a URL.
pub(crate) fn is_url(place: &Path) -> bool {
    parts(place).is_some()
}

/// Scheme and rest of a URL.
fn parts(place: &Path) -> Option<(&str, &str)> {
    let (scheme, rest) = place.to_str()?.split_once("://")?;
    let letters = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    letters.then_some((scheme, rest))
}

/// Whether a text holds a URL with a key, a password or a signature in it.
pub(crate) fn holds_credentials(text: &str) -> bool {
    let Some((_, rest)) = text.split_once("://") else { return false };
    let authority = rest.split(['/', '?', '#']).next().unwrap_or_default();
    // A key may hold slashes, so that its @ stands behind what looks like the authority.
    authority.contains('@') || rest.contains('?') || authority.contains(':') && rest.contains('@')
}

impl Address {
    pub(crate) fn parse(place: &Path) -> Result<Address, CorpusError> {
        let Some((scheme, rest)) = parts(place) else { return Ok(Address::Folder(place.into())) };
        let scheme = scheme.to_ascii_lowercase();
        if holds_credentials(&format!("{scheme}://{rest}")) {
            return Err(refused(
                &format!("{scheme}://..."),
                "the URL holds a user name, a key or a signature",
                "leave out what stands before @ and behind ?; credentials come from the environment or the standard files",
            ));
        }
        let service = match scheme.as_str() {
            "file" => return file(rest).map(Address::Folder),
            "s3" => Service::S3,
            "gs" => Service::Google,
            "az" => Service::Azure,
            "http" | "https" => {
                return Err(refused(
                    &format!("{scheme}://{rest}"),
                    "a corpus cannot be read over plain http",
                    "for a server that speaks S3, set AWS_ENDPOINT_URL to it and write s3://BUCKET/PATH; else copy it to a folder",
                ));
            }
            _ => {
                let cure = "places are folders, or URLs that begin with s3://, gs://, az:// or file://";
                return Err(refused(&format!("{scheme}://{rest}"), "no such kind of place is known", cure));
            }
        };
        let shown = format!("{scheme}://{rest}");
        let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
        let letter = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
        if bucket.is_empty() || !bucket.chars().all(letter) {
            let cure = format!("write {scheme}://BUCKET/PATH");
            // Not repeated: it may be a key in the wrong place.
            return Err(refused(&format!("{scheme}://..."), "what stands behind // is no name of a bucket", &cure));
        }
        let prefix = prefix.strip_suffix('/').unwrap_or(prefix);
        if !prefix.is_empty() && !is_name(prefix) || prefix.contains(['#', '\n']) {
            let cure = "parts of the path are not empty, not . or .., and hold neither \\ nor #";
            return Err(refused(&shown, "the path within the bucket is no name", cure));
        }
        Ok(Address::Objects { service, bucket: bucket.into(), prefix: prefix.into() })
    }

    /// A place of this name within this one.
    pub(crate) fn join(&self, name: &str) -> Address {
        match self {
            Address::Folder(folder) => Address::Folder(folder.join(name)),
            Address::Objects { service, bucket, prefix } => {
                let prefix = if prefix.is_empty() { name.into() } else { format!("{prefix}/{name}") };
                Address::Objects { service: *service, bucket: bucket.clone(), prefix }
            }
        }
    }

    /// Opens the place; nothing is asked of it yet.
    pub(crate) fn open(&self) -> Result<Arc<dyn Store>, CorpusError> {
        match self {
            Address::Folder(folder) => Ok(Arc::new(LocalFolder::new(folder))),
            #[cfg(feature = "object-stores")]
            Address::Objects { service, bucket, prefix } => {
                Ok(Arc::new(super::connect::connect(*service, bucket, prefix)?))
            }
            #[cfg(not(feature = "object-stores"))]
            Address::Objects { service, bucket, .. } => Err(refused(
                &format!("{}://{bucket}", service.scheme()),
                "this marsyard was built without object stores",
                "install one that has them with `cargo install --path . --features object-stores` (or try one with `cargo run \
                 --release --features object-stores`), or name a folder",
            )),
        }
    }
}

/// Opens a place of many files.
pub fn open(place: &Path) -> Result<Arc<dyn Store>, CorpusError> {
    Address::parse(place)?.open()
}

/// A file in a place of its own: the store, and the name within.
pub(crate) fn open_file(path: &Path) -> Result<(Arc<dyn Store>, String), CorpusError> {
    let address = Address::parse(path)?;
    let nameless = || refused(&path.display().to_string(), "this is no file", "write its name behind the last /");
    match address {
        Address::Folder(path) => {
            let name = path.file_name().and_then(|name| name.to_str()).ok_or_else(nameless)?.to_owned();
            let folder = path.parent().map(Path::to_owned).unwrap_or_default();
            Ok((Arc::new(LocalFolder::new(folder)), name))
        }
        Address::Objects { service, bucket, prefix } => {
            let (prefix, name) = prefix.rsplit_once('/').unwrap_or(("", &prefix));
            if name.is_empty() {
                return Err(nameless());
            }
            Ok((Address::Objects { service, bucket, prefix: prefix.into() }.open()?, name.into()))
        }
    }
}

/// The bytes of a file at a URL, `most` at most.
pub(crate) fn read_url(url: &Path, most: u64) -> Result<Vec<u8>, CorpusError> {
    let (store, name) = open_file(url)?;
    store.read_within(&name, most)
}

/// The bytes of a file that a user named, in a folder or at a URL.
pub fn read(path: &Path, kind: FileKind) -> Result<Vec<u8>, CorpusError> {
    if is_url(path) {
        return read_url(path, kind.most_bytes());
    }
    kind.read_path(path).map_err(|error| CorpusError::of_path(path, error))
}

fn refused(place: &str, reason: &str, cure: &str) -> CorpusError {
    CorpusError::Refused { place: place.into(), reason: reason.into(), cure: cure.into() }
}

/// `file:///folder` or `file://localhost/folder`, percent-decoded.
fn file(rest: &str) -> Result<PathBuf, CorpusError> {
    use std::os::unix::ffi::OsStringExt;
    let shown = format!("file://{rest}");
    let path = rest.strip_prefix("localhost").unwrap_or(rest);
    if !path.starts_with('/') {
        return Err(refused(&shown, "a file URL names a whole path", "write file:///FOLDER, with three slashes"));
    }
    let mut bytes = Vec::with_capacity(path.len());
    let mut left = path.bytes();
    while let Some(byte) = left.next() {
        let digit = |byte: Option<u8>| byte.and_then(|byte| char::from(byte).to_digit(16));
        bytes.push(match byte {
            b'%' => match (digit(left.next()), digit(left.next())) {
                (Some(high), Some(low)) if (high, low) != (0, 0) => (16 * high + low) as u8,
                _ => return Err(refused(&shown, "% stands before no two hexadecimal digits", "write % itself as %25")),
            },
            other => other,
        });
    }
    Ok(std::ffi::OsString::from_vec(bytes).into())
}

#[cfg(test)]
mod tests;
