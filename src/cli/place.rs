//! What was typed for a place or a file -> the place or file: a folder, or a URL of an object store.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Failure;
use crate::corpus::{CorpusError, Store, address};

/// The largest file that is read as a whole from a URL.
const MAX_FILE_BYTES: u64 = 4 << 30;

/// Storage that fails may work again; everything else will not.
pub(super) fn corpus_failure(error: CorpusError) -> Failure {
    use std::io::ErrorKind;
    let again = "the same command again goes on";
    let (code, help) = match &error {
        CorpusError::Io { source, .. } => match source.kind() {
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                (Failure::FAILED, Some("make the folder writable, or choose another".into()))
            }
            ErrorKind::NotADirectory | ErrorKind::NotFound | ErrorKind::InvalidInput => (Failure::FAILED, None),
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
                (Failure::TRY_AGAIN, Some(format!("free some space, or choose another folder; {again}")))
            }
            ErrorKind::FileTooLarge => (Failure::TRY_AGAIN, Some(format!("raise the limit of `ulimit -f`; {again}"))),
            _ => (Failure::TRY_AGAIN, Some(again.into())),
        },
        CorpusError::Unreachable { .. } | CorpusError::NoRoom { .. } | CorpusError::Vanished { .. } => {
            (Failure::TRY_AGAIN, None)
        }
        CorpusError::Refused { .. }
        | CorpusError::OtherPlan { .. }
        | CorpusError::ForeignPlan { .. }
        | CorpusError::BeyondPlan { .. } => (Failure::USAGE, None),
        _ => (Failure::FAILED, None),
    };
    Failure::new(
        code,
        match help {
            Some(help) => miette::miette!(help = help, "{error}"),
            None => miette::Report::msg(error.to_string()),
        },
    )
}

/// Refuses a folder that is not there, whatever it should hold; what a URL names is asked for when it is read.
pub(super) fn check_folder(place: &Path) -> Result<(), Failure> {
    if address::is_url(place) || place.is_dir() {
        return Ok(());
    }
    let what = if place.exists() { "is a file, not a folder" } else { "no such folder" };
    Err(Failure::usage(miette::miette!(
        help = "give the folder that `marsyard generate` named, such as corpora/quickstart",
        "{}: {what}",
        place.display()
    )))
}

/// The store at a place.
pub(super) fn open(place: &Path) -> Result<Arc<dyn Store>, Failure> {
    address::open(place).map_err(corpus_failure)
}

/// The plan of a place that should be a corpus; refused where there is none.
pub(super) fn plan_file(place: &Path) -> Result<PathBuf, Failure> {
    check_folder(place)?;
    let there = if address::is_url(place) {
        open(place)?.size("plan.yaml").map_err(corpus_failure)?.is_some()
    } else {
        place.join("plan.yaml").is_file()
    };
    if there {
        return Ok(place.join("plan.yaml"));
    }
    Err(Failure::usage(miette::miette!(
        help = "give the place that `marsyard generate` named, such as corpora/quickstart",
        "{} is not a corpus: it holds no plan.yaml",
        place.display()
    )))
}

/// Whether a text names a config itself, and not the corpus that holds one.
pub(super) fn is_config(place: &Path) -> bool {
    let yaml = place.extension().is_some_and(|end| ["yaml", "yml"].iter().any(|known| end.eq_ignore_ascii_case(known)));
    if address::is_url(place) { yaml } else { !place.is_dir() }
}

/// The bytes of a file in a folder or at a URL.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    if address::is_url(path) {
        return address::read_url(path, MAX_FILE_BYTES).map_err(corpus_failure);
    }
    std::fs::read(path).map_err(|error| Failure::failed(format!("{}: {error}", path.display())))
}

/// Whether there is such a file in a folder or at a URL.
pub(super) fn is_file(path: &Path) -> Result<bool, Failure> {
    if !address::is_url(path) {
        return Ok(path.is_file());
    }
    let (store, name) = address::open_file(path).map_err(corpus_failure)?;
    Ok(store.size(&name).map_err(corpus_failure)?.is_some())
}

/// What is written file by file while it grows lies in a folder, and cannot be named by a URL.
pub(super) fn must_be_local(flag: &str, path: &Path) -> Result<(), Failure> {
    if !address::is_url(path) {
        return Ok(());
    }
    Err(Failure::usage(miette::miette!(
        help =
            "name a folder, and copy what is written there when it is done; corpora can be written to a URL themselves",
        "{flag}: cannot be a URL"
    )))
}

/// Refuses URLs with a key or a password before anything is made of them, and without repeating them.
pub(super) fn refuse_credentials(arguments: impl Iterator<Item = OsString>) -> Result<(), Failure> {
    for (number, argument) in arguments.enumerate().skip(1) {
        if argument.to_str().is_some_and(address::holds_credentials) {
            return Err(Failure::usage(miette::miette!(
                help = "credentials come from the environment (AWS_*, GOOGLE_*, AZURE_*) or the standard files, never from a command \
                        line, which others can read",
                "argument {number} is a URL with a user name, a key or a signature in it"
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_credentials_on_the_command_line_are_refused_by_number_alone() {
        let arguments = |list: &[&str]| list.iter().map(|text| (*text).into()).collect::<Vec<OsString>>().into_iter();
        assert!(refuse_credentials(arguments(&["marsyard", "verify", "s3://bucket/a@b"])).is_ok());
        for url in ["s3://key:hush@bucket/x", "s3://key:hu/hush+@bucket/x", "--out=az://box/x?sig=hush"] {
            let said = format!("{:?}", refuse_credentials(arguments(&["marsyard", "verify", url])).unwrap_err().report);
            assert!(said.contains("argument 2") && !said.contains("hush"), "{said}");
        }
    }

    #[test]
    fn exact_a_url_is_a_corpus_unless_it_ends_in_yaml() {
        assert!(is_config(Path::new("s3://b/corpus/plan.yaml")) && !is_config(Path::new("s3://b/corpus")));
        assert!(must_be_local("--out", Path::new("gs://b/runs")).is_err());
        assert!(must_be_local("--out", Path::new("runs/a")).is_ok());
    }
}
