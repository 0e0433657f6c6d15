//! Headers of an answer -> whether the bytes that a store keeps are those that were sent.
//!
//! Services say it in different ways: S3 gives the MD5 as entity tag (but not of encrypted objects, whose tag looks alike), or a
//! SHA-256 where it was asked for one; Google gives `x-goog-hash`, Azure `Content-MD5`. Where nothing decides, the object is read.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use md5::Md5;
use object_store::HeaderMap;
use sha2::{Digest, Sha256};

/// What an answer says of the object's bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stored {
    /// An MD5, if it is one: equal is proof, other is none.
    tag: Option<String>,
    md5: Option<Vec<u8>>,
    sha256: Option<Vec<u8>>,
}

impl Stored {
    pub(crate) fn of(headers: &HeaderMap) -> Stored {
        let header = |name: &str| headers.get(name).and_then(|value| value.to_str().ok());
        // Google writes one header a kind of hash.
        let all = |name: &str| headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
        let digest = |text: &str| BASE64_STANDARD.decode(text.trim()).ok();
        let google = |text: &str| text.split(',').find_map(|part| digest(part.trim().strip_prefix("md5=")?));
        Stored {
            tag: header("etag").map(|tag| tag.trim_matches('"').to_ascii_lowercase()),
            md5: header("content-md5").and_then(digest).or_else(|| all("x-goog-hash").find_map(google)),
            sha256: header("x-amz-checksum-sha256").and_then(digest),
        }
    }

    /// Whether these bytes are stored; `None` where the answer does not tell.
    pub(crate) fn holds(&self, bytes: &[u8]) -> Option<bool> {
        if let Some(sha256) = &self.sha256 {
            return Some(sha256[..] == Sha256::digest(bytes)[..]);
        }
        let md5 = Md5::digest(bytes);
        if let Some(told) = &self.md5 {
            return Some(told[..] == md5[..]);
        }
        let digits: String = md5.iter().map(|byte| format!("{byte:02x}")).collect();
        (self.tag.as_ref() == Some(&digits)).then_some(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(headers: &[(&'static str, &'static str)], bytes: &[u8]) -> Option<bool> {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(*name, object_store::HeaderValue::from_static(value));
        }
        Stored::of(&map).holds(bytes)
    }

    #[test]
    fn exact_each_service_s_word_for_abc() {
        // RFC 1321 and FIPS 180-2 give the digests of "abc".
        let tag = ("etag", "\"900150983CD24FB0D6963F7D28E17F72\"");
        let md5 = ("content-md5", "kAFQmDzST7DWlj99KOF/cg==");
        let google = ("x-goog-hash", "crc32c=AAAAAA==, md5=kAFQmDzST7DWlj99KOF/cg==");
        let sha256 = ("x-amz-checksum-sha256", "ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=");
        for header in [tag, md5, google, sha256] {
            assert_eq!(holds(&[header], b"abc"), Some(true), "{header:?}");
        }
        for header in [md5, google, sha256] {
            assert_eq!(holds(&[header], b"abd"), Some(false), "{header:?}");
        }
        let apart = [("x-goog-hash", "crc32c=AAAAAA=="), ("x-goog-hash", "md5=kAFQmDzST7DWlj99KOF/cg==")];
        assert_eq!((holds(&apart, b"abc"), holds(&apart, b"abd")), (Some(true), Some(false)));
        // The tag of an encrypted object looks like an MD5 and is none.
        assert_eq!((holds(&[tag], b"abd"), holds(&[], b"abc")), (None, None));
        assert_eq!(holds(&[("etag", "0x8D"), ("content-md5", "not base64!")], b"abc"), None);
    }
}
