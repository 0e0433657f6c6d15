//! Signs finished corpora, makes the keys for it, and checks signatures: a detached signature over the manifest.

use std::io::{IsTerminal, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use super::Failure;
use super::output::{errln, printable};
use super::place::{self, check_folder, corpus_failure};
use crate::corpus::limits::FileKind;
use crate::corpus::owner::RULE;
use crate::corpus::signature::{self, PublicKey, SignatureError, SigningKey};
use crate::corpus::{CorpusError, Finished, Manifest, Store, address, finished, manifest, sha256};
use crate::shell;

/// Where a key's password is looked for before it is asked for.
const PASSWORD: &str = "MARSYARD_KEY_PASSWORD";

#[derive(Debug, Args)]
#[command(
    after_help = RULE,
    after_long_help = format!("Once:   marsyard sign --new-key my.key        (writes my.key, and my.key.pub to be handed out)\n\
    then:   marsyard sign corpora/mine --key my.key\n\
    others: marsyard verify corpora/mine --key my.key.pub\n\
    or:     minisign -Vm corpora/mine/manifest.json -p my.key.pub   (the signature alone)\n\n\
    {RULE}")
)]
pub(super) struct SignArgs {
    /// Folder or URL of a finished corpus.
    #[arg(required_unless_present = "new_key")]
    place: Option<PathBuf>,
    /// The secret key, as --new-key or `minisign -G` writes it. Its password is taken from MARSYARD_KEY_PASSWORD, or asked for.
    #[arg(long, value_name = "FILE", required_unless_present = "new_key")]
    key: Option<PathBuf>,
    /// Where the signature is written, a file or a URL; default: manifest.json.minisig in the corpus. Nothing but a signature is
    /// replaced.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Make a key and sign nothing: the secret key in FILE, for you alone; the public key in FILE.pub, for all. Neither may be there.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["place", "key", "out"])]
    new_key: Option<PathBuf>,
    /// The new key has no password: whoever can read its file can sign with it.
    #[arg(long, requires = "new_key")]
    no_password: bool,
}

pub(super) fn run(args: &SignArgs) -> Result<(), Failure> {
    match (&args.new_key, &args.place, &args.key) {
        (Some(file), _, _) => new_key(file, args.no_password),
        (None, Some(corpus), Some(key)) => sign(corpus, key, args.out.as_deref()),
        _ => unreachable!("clap asks for both"),
    }
}

fn sign(corpus: &Path, key: &Path, out: Option<&Path>) -> Result<(), Failure> {
    check_folder(corpus)?;
    let store = place::open(corpus)?;
    let Finished { manifest, manifest_sha256, .. } = Finished::open(store.as_ref()).map_err(corpus_failure)?;
    if manifest.format < 2 {
        return Err(Failure::usage(miette::miette!(
            help = format!("`marsyard finalize {}` writes it anew with them", shell::word(corpus.display())),
            "{}: the manifest is of format 1 and lacks the hashes of other files: a signature over it would not cover them",
            corpus.display()
        )));
    }
    let bytes = FileKind::Manifest.read(store.as_ref(), manifest::NAME).map_err(corpus_failure)?;
    if sha256(&bytes) != manifest_sha256 {
        let changes = miette::miette!("{}: the manifest changes just now", corpus.display());
        return Err(Failure::new(Failure::TRY_AGAIN, changes));
    }
    let key = signing_key(key)?;
    let text = key.sign(&bytes, &comment(&manifest)).map_err(Failure::failed)?;
    let (place, name) = signature_file(store.as_ref(), out)?;
    // Beside the corpus's manifest a signature is the corpus's, whoever made it; elsewhere it may be of anything.
    let begins = if out.is_some() { COMMENT } else { "" };
    let there = shown(corpus, out);
    refuse_foreign(place.as_ref(), &name, begins, &there)?;
    place.replace(&name, text.as_bytes()).map_err(corpus_failure)?;
    errln!("{}: signed with the key {}, in {there}", corpus.display(), key.id());
    Ok(())
}

/// Where a signature is.
fn signature_file(corpus: &dyn Store, at: Option<&Path>) -> Result<(Arc<dyn Store>, String), Failure> {
    match at {
        Some(file) => address::open_file(file).map_err(corpus_failure),
        None => Ok((corpus.share(), signature::NAME.to_string())),
    }
}

/// The same as it was typed.
fn shown(corpus: &Path, at: Option<&Path>) -> String {
    at.map_or_else(|| corpus.join(signature::NAME), Path::to_path_buf).display().to_string()
}

/// How the comment of a corpus's signature begins.
const COMMENT: &str = "marsyard corpus of ";

/// What is signed with the bytes, for people: what the corpus was when it was signed.
fn comment(manifest: &Manifest) -> String {
    format!("{COMMENT}{} scenes, corpus_id {}, name {}", manifest.scenes, manifest.corpus_id, manifest.name)
}

/// Only a signature is replaced by a signature, one whose comment begins so.
fn refuse_foreign(place: &dyn Store, name: &str, begins: &str, shown: &str) -> Result<(), Failure> {
    let said = |bytes: &[u8]| std::str::from_utf8(bytes).ok().and_then(|text| signature::said(text).ok());
    let is_signature = |bytes: &[u8]| said(bytes).is_some_and(|said| said.comment.starts_with(begins));
    match finished::read_present(place, name, FileKind::Signature) {
        Ok(None) => return Ok(()),
        Ok(Some(bytes)) if is_signature(&bytes) => return Ok(()),
        Ok(Some(_)) | Err(CorpusError::TooLarge { .. } | CorpusError::NotAFile { .. }) => {}
        Err(error) => return Err(corpus_failure(error)),
    }
    Err(Failure::usage(miette::miette!(
        help = format!("name another file with --out, or move it away: {RULE}"),
        "{shown} is there and is no signature of a corpus"
    )))
}

fn new_key(file: &Path, no_password: bool) -> Result<(), Failure> {
    let mut public_file = file.as_os_str().to_owned();
    public_file.push(".pub");
    let public_file = PathBuf::from(public_file);
    for path in [file, &public_file] {
        if path.symlink_metadata().is_ok() {
            return Err(Failure::usage(miette::miette!(
                help = "name another file; a key that was lost cannot be made again",
                "{} is there already",
                path.display()
            )));
        }
    }
    let password = if no_password { None } else { Some(new_password()?) };
    let (secret, public) = signature::new_pair(password).map_err(Failure::failed)?;
    write_new(file, &secret, 0o600)?;
    write_new(&public_file, &public, 0o644)?;
    errln!("{}: the secret key, for you alone\n{}: the public key, for all", file.display(), public_file.display());
    Ok(())
}

fn write_new(path: &Path, text: &str, mode: u32) -> Result<(), Failure> {
    let failed = |error: std::io::Error| Failure::failed(format!("{}: {error}; choose another file", path.display()));
    let mut file = std::fs::File::options().write(true).create_new(true).mode(mode).open(path).map_err(failed)?;
    file.write_all(text.as_bytes()).and_then(|()| file.sync_all()).map_err(failed)
}

/// The password of a new key: from the environment, or typed twice.
fn new_password() -> Result<String, Failure> {
    let given = std::env::var(PASSWORD).ok();
    let typed = given.is_none();
    let password = given.map_or_else(|| ask("password of the new key: "), Ok)?;
    if password.is_empty() {
        return Err(Failure::usage(miette::miette!(
            help = "--no-password makes a key without one",
            "the password is empty"
        )));
    }
    if typed && ask("the same again: ")? != password {
        return Err(Failure::usage(miette::miette!("the two passwords differ; no key was made")));
    }
    Ok(password)
}

/// Asks on the terminal, without an echo.
fn ask(what: &str) -> Result<String, Failure> {
    if !std::io::stdin().is_terminal() {
        return Err(Failure::usage(miette::miette!(
            help = format!(
                "put the password into the environment variable {PASSWORD}, or use a key without one (--no-password)"
            ),
            "the key has a password, and there is no terminal to ask for it"
        )));
    }
    rpassword::prompt_password(what)
        .map_err(|error| Failure::failed(format!("the password could not be read: {error}")))
}

fn signing_key(file: &Path) -> Result<SigningKey, Failure> {
    let refused =
        |error: SignatureError| Failure::usage(miette::Report::msg(format!("--key {}: {error}", file.display())));
    let text = key_text(file)?;
    let password = match SigningKey::is_locked(&text).map_err(refused)? {
        false => None,
        true => Some(std::env::var(PASSWORD).or_else(|_| ask("password of the key: "))?),
    };
    SigningKey::parse(&text, password).map_err(refused)
}

/// The text of a key's file.
fn key_text(file: &Path) -> Result<String, Failure> {
    let unreadable = |why: String| {
        Failure::usage(miette::miette!(
            help = "make a key with `marsyard sign --new-key FILE`, or with `minisign -G`",
            "--key {}: {why}",
            file.display()
        ))
    };
    let bytes = FileKind::Signature.read_path(file).map_err(|error| unreadable(error.to_string()))?;
    String::from_utf8(bytes).map_err(|_| unreadable("it is not text".into()))
}

/// A public key: its file, or its second line itself.
fn public_key(typed: &str) -> Result<PublicKey, Failure> {
    let is_key = typed.len() == 56 && !Path::new(typed).exists();
    let text = if is_key { typed.to_string() } else { key_text(Path::new(typed))? };
    PublicKey::parse(&text).map_err(|error| Failure::usage(miette::Report::msg(format!("--key {typed}: {error}"))))
}

/// Holds the manifest against its signature; says whose it is, or why it is not to be trusted. Also the SHA-256 of what was signed.
pub(super) fn check(corpus: &Path, store: &dyn Store, key: &str, at: Option<&Path>) -> Result<String, Failure> {
    let key = public_key(key)?;
    let (place, name) = signature_file(store, at)?;
    let there = shown(corpus, at);
    let text = finished::read_present(place.as_ref(), &name, FileKind::Signature).map_err(corpus_failure)?;
    let Some(text) = text.map(|bytes| String::from_utf8_lossy(&bytes).into_owned()) else {
        let why = format!("{there}: there is no signature: the corpus was not signed, or it was taken away");
        return Err(distrust(&why));
    };
    let (manifest, bytes) = Manifest::read_with_bytes(store).map_err(corpus_failure)?;
    match key.check(&bytes, &text) {
        Ok(_) if manifest.format < 2 => Err(distrust(&format!(
            "{there}: manifest.json is what was signed, and of format 1: it lacks the hashes of the lists and receipts, so that \
             nothing else is covered"
        ))),
        Ok(said) => {
            let (id, said) = (key.id(), printable(&said));
            errln!("{}: manifest.json is what the key {id} signed ({said})", corpus.display());
            errln!("{}: it names the corpus {}, corpus_id {}", corpus.display(), manifest.name, manifest.corpus_id);
            Ok(sha256(&bytes))
        }
        Err(SignatureError::OtherBytes) => {
            let then = signature::said(&text).map(|said| printable(&said.comment)).unwrap_or_default();
            let now = comment(&manifest);
            Err(distrust(&format!(
                "{there}: manifest.json is not what was signed: by its comment that was a {then}; it is a {now}: the corpus grew, was \
                 renamed or finalized by another marsyard since, or somebody changed it"
            )))
        }
        Err(error) => Err(distrust(&format!("{there}: {error}"))),
    }
}

fn distrust(why: &str) -> Failure {
    let help = "get the corpus, its signature and the public key from whoever signed it, each by a way that you trust; whoever may sign \
                it signs again with `marsyard sign`";
    Failure::new(Failure::FAILED, miette::miette!(help = help, "{why}"))
}
