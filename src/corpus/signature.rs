//! The bytes of a manifest and a key -> a detached signature over them, and back: whether it is that key's, over these bytes.
//!
//! Source: minisign (Denis 2015): Ed25519 over the BLAKE2b hash of the file, and over signature and comment. `minisign -Vm
//! manifest.json -p KEY.pub` and `rsign` check what is written here, and what they write is checked here. The manifest names every other
//! file of the corpus by its hash, so that one signature covers all of them.

use ct_codecs::{Base64, Decoder};
use minisign::{KeyPair, PublicKeyBox, SecretKey, SecretKeyBox, SignatureBox};

/// Where the signature of a corpus lies, beside its manifest; as minisign names it.
pub(crate) const NAME: &str = "manifest.json.minisig";

/// Why a key cannot be used, or a signature is not taken.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SignatureError {
    #[error(
        "not a secret key as minisign writes it: {0}; make one with `marsyard sign --new-key FILE`, or `minisign -G`"
    )]
    NotASecretKey(String),
    #[error(
        "not a public key as minisign writes it: {0}; give the file (KEY.pub), or the 56 letters of its second line"
    )]
    NotAPublicKey(String),
    #[error("the secret key has a password, and this is another one")]
    WrongPassword,
    #[error("not a signature as minisign writes it: {0}")]
    NotASignature(String),
    #[error("signed with the key {signed}, and the key that was given is {given}")]
    OtherKey { signed: String, given: String },
    #[error("the bytes are not those that were signed")]
    OtherBytes,
    #[error("the key cannot sign: {0}")]
    Unable(String),
}

/// A secret key, unlocked. Not to be printed.
pub(crate) struct SigningKey(SecretKey);

/// A public key.
pub(crate) struct PublicKey(minisign::PublicKey);

/// What a signature says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Said {
    pub key_id: String,
    /// Proven only where the signature is.
    pub comment: String,
}

/// A new pair: the texts of the secret key's file and of the public key's.
pub(crate) fn new_pair(password: Option<String>) -> Result<(String, String), SignatureError> {
    let unable = |error: minisign::PError| SignatureError::Unable(error.to_string());
    let KeyPair { pk, sk } = match password {
        Some(password) => KeyPair::generate_encrypted_keypair(Some(password)),
        None => KeyPair::generate_unencrypted_keypair(),
    }
    .map_err(unable)?;
    let secret = sk.to_box(Some("marsyard secret key")).map_err(unable)?.to_string();
    Ok((secret, pk.to_box().map_err(unable)?.to_string()))
}

impl SigningKey {
    /// Whether the text of a secret key's file needs a password.
    pub(crate) fn is_locked(text: &str) -> Result<bool, SignatureError> {
        Ok(bytes_of_secret(text)?[2..4] != [0, 0])
    }

    /// The key in the text of its file; the password is asked for where it has one.
    pub(crate) fn parse(text: &str, password: Option<String>) -> Result<SigningKey, SignatureError> {
        let bytes = bytes_of_secret(text)?;
        if SigningKey::is_locked(text)? {
            let unlocked = SecretKeyBox::from(text.to_string()).into_secret_key(Some(password.unwrap_or_default()));
            return unlocked.map(SigningKey).map_err(|_| SignatureError::WrongPassword);
        }
        // minisign leaves the checksum of a key without a password empty, and the crate asks for it; what was damaged is found by
        // the trial of `sign`, whose result is held against the public half.
        let key = SecretKey::from_bytes(&bytes).map_err(|error| SignatureError::NotASecretKey(error.to_string()))?;
        Ok(SigningKey(key))
    }

    pub(crate) fn id(&self) -> String {
        key_id(self.0.keynum())
    }

    /// The text of a signature over `bytes` and the comment, a line.
    pub(crate) fn sign(&self, bytes: &[u8], comment: &str) -> Result<String, SignatureError> {
        let unable = |error: minisign::PError| SignatureError::Unable(error.to_string());
        let public = minisign::PublicKey::from_secret_key(&self.0).map_err(unable)?;
        let untrusted = "signature of a marsyard corpus";
        let signature =
            minisign::sign(Some(&public), &self.0, bytes, Some(comment), Some(untrusted)).map_err(unable)?.to_string();
        PublicKey(public).check(bytes, &signature)?;
        Ok(signature)
    }
}

impl PublicKey {
    /// The key in the text of its file, or in its second line alone.
    pub(crate) fn parse(text: &str) -> Result<PublicKey, SignatureError> {
        let fault = |error: minisign::PError| SignatureError::NotAPublicKey(error.to_string());
        let text = text.trim();
        let key = match text.lines().count() {
            1 => minisign::PublicKey::from_base64(text),
            _ => PublicKeyBox::from(text.to_string()).into_public_key(),
        };
        key.map(PublicKey).map_err(fault)
    }

    pub(crate) fn id(&self) -> String {
        key_id(self.0.keynum())
    }

    /// Whether a signature is this key's, over these bytes; its comment, proven with it.
    pub(crate) fn check(&self, bytes: &[u8], signature: &str) -> Result<String, SignatureError> {
        let Said { key_id: signed, comment } = said(signature)?;
        if signed != self.id() {
            return Err(SignatureError::OtherKey { signed, given: self.id() });
        }
        let signature = parse(signature)?;
        let checked = minisign::verify(&self.0, &signature, std::io::Cursor::new(bytes), true, false, false);
        checked.map(|()| comment).map_err(|_| SignatureError::OtherBytes)
    }
}

/// What a signature says of itself, whoever made it.
pub(crate) fn said(signature: &str) -> Result<Said, SignatureError> {
    let signature = parse(signature)?;
    let comment = signature.trusted_comment().map_err(|error| SignatureError::NotASignature(error.to_string()))?;
    Ok(Said { key_id: key_id(signature.keynum()), comment })
}

/// Base64 of the 64 bytes of a signature.
const SIGNATURE_LETTERS: usize = 88;

fn parse(signature: &str) -> Result<SignatureBox, SignatureError> {
    let fault = |what: &dyn std::fmt::Display| SignatureError::NotASignature(what.to_string());
    // The crate takes a shorter one for whole, and would panic on it.
    if signature.lines().nth(3).map_or(0, |line| line.trim().len()) != SIGNATURE_LETTERS {
        return Err(fault(&"its fourth line is not the signature of its comment"));
    }
    let parsed = SignatureBox::from_string(signature).map_err(|error| fault(&error))?;
    if parsed.is_prehashed() {
        Ok(parsed)
    } else {
        Err(fault(&"it is of the old kind; sign again, without `minisign -l`"))
    }
}

/// Bytes of a secret key: three algorithms, salt and limits of the password's function, key id, key, checksum.
const SECRET_BYTES: usize = 3 * 2 + 32 + 2 * 8 + 8 + 64 + 32;

fn bytes_of_secret(text: &str) -> Result<Vec<u8>, SignatureError> {
    let fault = |what: &str| SignatureError::NotASecretKey(what.into());
    let line = text.lines().nth(1).ok_or_else(|| fault("it has no second line"))?;
    let bytes = Base64::decode_to_vec(line.trim(), None).map_err(|_| fault("its second line is not Base64"))?;
    let whole = bytes.len() == SECRET_BYTES && bytes.starts_with(b"Ed") && bytes[4..6] == *b"B2";
    if whole { Ok(bytes) } else { Err(fault("it is of another kind or length")) }
}

fn key_id(bytes: &[u8]) -> String {
    bytes.iter().rev().map(|byte| format!("{byte:02X}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BYTES: &[u8] = b"{\"format\": 2}\n";

    /// Made by `minisign -G -W`, version 0.11, and its signature over [`BYTES`] by `minisign -S`.
    const MINISIGN_KEY: &str = "untrusted comment: minisign encrypted secret key\n\
        RWQAAEIyAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAIIEUUzGgGJGrStwy7NvMir9CUEpmaVEaWIOMn97Z8FXNVAE4DwhRTL2BBz9qTXSlfkKQqlbUx6FF+Sjj7TTUF9INJh7800+fAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=\n";
    const MINISIGN_PUBLIC: &str = "RWQggRRTMaAYkb2BBz9qTXSlfkKQqlbUx6FF+Sjj7TTUF9INJh7800+f";
    const MINISIGN_SIGNATURE: &str = "untrusted comment: signature from minisign secret key\n\
        RUQggRRTMaAYkdXQMUVSo3VpAehyt/4VSDHF3X8xYO/TvmwXGn5hVrlyiPCYe9YnuhDsjw673z+zonjwJMH8nuLtD4sO4gZYPQo=\n\
        trusted comment: by minisign\n\
        Sevya2F3yTH5bmhnS3cA4a1RwilmCdJUdj/I1ajZposOw9YVGip9cMhV14ZnINTiq6TtwT3F9Mm00aiN8HpuAw==\n";

    #[test]
    fn equal_what_is_signed_is_taken_by_its_key_and_by_no_other() {
        for password in [None, Some("hush".to_string())] {
            let (secret, public) = new_pair(password.clone()).unwrap();
            assert_eq!(SigningKey::is_locked(&secret).unwrap(), password.is_some());
            let key = SigningKey::parse(&secret, password).unwrap();
            let signature = key.sign(BYTES, "7 scenes").unwrap();
            let public = PublicKey::parse(&public).unwrap();
            assert_eq!(public.check(BYTES, &signature).unwrap(), "7 scenes");
            assert_eq!(public.check(b"other", &signature), Err(SignatureError::OtherBytes));
            let longer = signature.replace("7 scenes", "8 scenes");
            assert_eq!(public.check(BYTES, &longer), Err(SignatureError::OtherBytes));
            let other = PublicKey::parse(&new_pair(None).unwrap().1).unwrap();
            assert!(matches!(other.check(BYTES, &signature), Err(SignatureError::OtherKey { .. })));
        }
    }

    #[test]
    fn exact_a_wrong_password_is_named() {
        let (secret, _) = new_pair(Some("hush".into())).unwrap();
        assert_eq!(SigningKey::parse(&secret, Some("other".into())).err(), Some(SignatureError::WrongPassword));
        assert_eq!(SigningKey::parse(&secret, None).err(), Some(SignatureError::WrongPassword));
    }

    #[test]
    fn equal_keys_and_signatures_of_minisign_itself_are_taken() {
        let public = PublicKey::parse(MINISIGN_PUBLIC).unwrap();
        assert_eq!(public.check(BYTES, MINISIGN_SIGNATURE).unwrap(), "by minisign");
        let signature = SigningKey::parse(MINISIGN_KEY, None).unwrap().sign(BYTES, "by marsyard").unwrap();
        assert_eq!(public.check(BYTES, &signature).unwrap(), "by marsyard");
    }

    #[test]
    fn extreme_damaged_keys_and_signatures_are_refused_in_words() {
        let (secret, public) = new_pair(None).unwrap();
        let signature = SigningKey::parse(&secret, None).unwrap().sign(BYTES, "c").unwrap();
        let key = PublicKey::parse(&public).unwrap();
        for end in 0..signature.len() - 1 {
            assert!(key.check(BYTES, &signature[..end]).is_err(), "{end} letters");
        }
        for end in 0..secret.len() - 2 {
            assert!(SigningKey::parse(&secret[..end], None).is_err(), "{end} letters");
        }
        for text in ["", "\n", "untrusted comment: x\nRWQ", "\u{e9}\u{e9}\n\u{e9}"] {
            assert!(PublicKey::parse(text).is_err() && SigningKey::parse(text, None).is_err() && said(text).is_err());
        }
        // A letter of the secret half changed: the trial finds it.
        let mut damaged = secret.clone().into_bytes();
        let at = secret.find('\n').unwrap() + 100;
        damaged[at] = if damaged[at] == b'A' { b'B' } else { b'A' };
        let damaged = SigningKey::parse(&String::from_utf8(damaged).unwrap(), None);
        assert!(damaged.is_err() || damaged.unwrap().sign(BYTES, "c").is_err());
    }
}
