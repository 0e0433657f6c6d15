//! The checksum that models, filter states and checkpoints carry in their metadata.
//!
//! It is the SHA-256 of the whole file, with its own 64 digits taken as zeros: no byte of the file can change unnoticed. In: the
//! bytes of a safetensors file whose JSON metadata hold [`UNSET`] under [`KEY`]. Out: the same bytes with the digits put in; or
//! whether the digits that a file holds are those of its bytes.

use std::ops::Range;

use serde_json::Value as Json;
use sha2::Digest;

use crate::corpus::hex;

/// Its key in the metadata.
pub(super) const KEY: &str = "checksum";
/// What stands there until the bytes around it are known.
pub(crate) const UNSET: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// Puts the checksum in the place of [`UNSET`].
pub(crate) fn seal(mut bytes: Vec<u8>) -> Vec<u8> {
    let place = find(&bytes, UNSET).expect("whoever seals a file has left room for its checksum");
    let digits = digest(&bytes, &place);
    bytes[place].copy_from_slice(digits.as_bytes());
    bytes
}

/// Takes the checksum out of metadata; whether there was one, which is then that of the bytes. `needed`: this format has one.
pub(super) fn take(bytes: &[u8], metadata: &mut Json, needed: bool) -> Result<bool, String> {
    match metadata.as_object_mut().and_then(|pairs| pairs.remove(KEY)) {
        Some(digits) => check(bytes, digits.as_str().unwrap_or_default()).map(|()| true),
        None if needed => Err("it lacks the checksum that its format has".into()),
        None => Ok(false),
    }
}

fn check(bytes: &[u8], digits: &str) -> Result<(), String> {
    let place = find(bytes, digits).filter(|_| digits.len() == UNSET.len());
    match place {
        Some(place) if digest(bytes, &place) == digits => Ok(()),
        _ => Err("its bytes are not those that its checksum was taken of".into()),
    }
}

/// Where the digits stand in the file's header, which holds the metadata as JSON within JSON.
fn find(bytes: &[u8], digits: &str) -> Option<Range<usize>> {
    let length = u64::from_le_bytes(bytes.get(..8)?.try_into().ok()?);
    let header = bytes.get(..usize::try_from(length).ok()?.checked_add(8)?)?;
    let pattern = format!("\\\"{KEY}\\\":\\\"{digits}\\\"");
    let start = header.windows(pattern.len()).position(|part| part == pattern.as_bytes())?;
    let end = start + pattern.len() - "\\\"".len();
    Some(end - digits.len()..end)
}

fn digest(bytes: &[u8], place: &Range<usize>) -> String {
    let mut hasher = sha2::Sha256::new();
    hasher.update(&bytes[..place.start]);
    hasher.update(UNSET);
    hasher.update(&bytes[place.end..]);
    hex(&hasher.finalize())
}
