//! What was typed for a place or a file -> the place or file: a folder, or a URL of an object store.

use std::ffi::OsString;
use std::fmt;
use std::fs::Metadata;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{Failure, config_failure};
use crate::config::{self};
use crate::corpus::limits::FileKind;
use crate::corpus::store::{may_pass, write_whole};
use crate::corpus::{CorpusError, Finished, Manifest, Store, address, manifest, plan_file};
use crate::plan::Plan;
use crate::shell;

/// Storage that fails may work again; everything else will not.
pub(super) fn corpus_failure(error: CorpusError) -> Failure {
    let again = "the same command again goes on";
    let (code, help) = match &error {
        CorpusError::Io { source, .. } => match source.kind() {
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                (Failure::FAILED, Some("make the folder writable, or choose another".into()))
            }
            ErrorKind::IsADirectory => (Failure::FAILED, Some("move it away, and run the same command again".into())),
            ErrorKind::NotADirectory => (Failure::USAGE, Some("name a folder, or a place where nothing is yet".into())),
            ErrorKind::NotFound => (
                Failure::FAILED,
                Some("look at the path; where something is to be written, choose another folder".into()),
            ),
            // Whatever the next try would find, it would find this.
            ErrorKind::InvalidInput
            | ErrorKind::InvalidFilename
            | ErrorKind::AlreadyExists
            | ErrorKind::Unsupported => (Failure::FAILED, None),
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
        | CorpusError::Foreign { .. }
        | CorpusError::Overtaken { .. }
        | CorpusError::BeyondPlan { .. } => (Failure::USAGE, None),
        _ => (Failure::FAILED, None),
    };
    let said = match &error {
        CorpusError::Io { source, .. } => error.to_string().replace(&source.to_string(), &fault_words(source)),
        _ => error.to_string(),
    };
    Failure::new(code, StoreFault { kind: error.kind(), place: error.place().to_owned(), said, help })
}

/// What a file system says, in words where the kind alone says all.
pub(super) fn fault_words(fault: &std::io::Error) -> String {
    match fault.kind() {
        ErrorKind::NotFound => "there is no such file or folder".into(),
        ErrorKind::NotADirectory => "a file is where a folder should be".into(),
        ErrorKind::IsADirectory => "a folder is where a file should be".into(),
        _ => fault.to_string(),
    }
}

/// A fault of a corpus's place, as machines are told of it too.
#[derive(Debug)]
pub(super) struct StoreFault {
    pub(super) kind: &'static str,
    pub(super) place: String,
    pub(super) said: String,
    pub(super) help: Option<String>,
}

impl fmt::Display for StoreFault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.said)
    }
}

impl std::error::Error for StoreFault {}

impl miette::Diagnostic for StoreFault {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }
}

/// A fault of a file that was named on the command line: what may pass is told as a store's is, the rest is `usage`.
pub(super) fn named_failure(
    path: &Path,
    source: std::io::Error,
    usage: impl FnOnce(std::io::Error) -> Failure,
) -> Failure {
    if may_pass(&source) { corpus_failure(CorpusError::of_path(path, source)) } else { usage(source) }
}

/// Writes a file that was named on the command line, whole or not at all; where its folder is missing, that is what is told.
pub(super) fn write_named(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let failed = |source| {
        let missing = path.parent().filter(|above| !above.as_os_str().is_empty() && !above.exists());
        corpus_failure(CorpusError::of_path(missing.unwrap_or(path), source))
    };
    write_whole(path, bytes).map_err(failed)
}

/// What is at a path, links followed; `None` where there is nothing.
fn facts_of(path: &Path) -> Result<Option<Metadata>, Failure> {
    match std::fs::metadata(path) {
        Ok(facts) => Ok(Some(facts)),
        Err(error) if may_pass(&error) => Err(corpus_failure(CorpusError::of_path(path, error))),
        Err(_) => Ok(None),
    }
}

/// Refuses a folder that is not there, whatever it should hold; what a URL names is asked for when it is read.
pub(super) fn check_folder(place: &Path) -> Result<(), Failure> {
    if address::is_url(place) {
        return Ok(());
    }
    let what = match facts_of(place)? {
        Some(facts) if facts.is_dir() => return Ok(()),
        Some(_) => "is a file, not a folder",
        None => "no such folder",
    };
    Err(Failure::usage(miette::miette!(
        help = "give the folder that `marsyard generate` named, such as corpora/quickstart",
        "{}: {what}",
        place.display()
    )))
}

/// The file that a verb reads of what was named: a config, or the plan of a corpus.
pub(super) fn config_file(place: &Path) -> PathBuf {
    if is_config(place) { place.into() } else { place.join("plan.yaml") }
}

/// What a verb reads and so never writes.
pub(super) fn inputs(place: &Path) -> Vec<PathBuf> {
    vec![config_file(place)]
}

/// The store at a place.
pub(super) fn open(place: &Path) -> Result<Arc<dyn Store>, Failure> {
    address::open(place).map_err(corpus_failure)
}

/// The finished corpus at a place, and a word of what could not be checked.
pub(super) fn finished(place: &Path) -> Result<Finished, Failure> {
    let corpus = Finished::open(open(place)?.as_ref()).map_err(corpus_failure)?;
    corpus.unchecked.iter().for_each(|what| tracing::warn!("{what}"));
    Ok(corpus)
}

/// The plan of a finished corpus, held against its manifest: the first line of plan.yaml says a hash, its keys must give the same.
/// That the corpus is whole is for [`finished`] to say.
pub(super) fn finished_plan(place: &Path) -> Result<Plan, Failure> {
    let store = open(place)?;
    let there = Manifest::read(store.as_ref()).map_err(corpus_failure)?.scene_plan_hash;
    let plan = config::load(&place.join(plan_file::NAME), &[]).map_err(config_failure)?;
    let here = plan.scene_plan_hash();
    if here == there {
        return Ok(plan);
    }
    Err(corpus_failure(CorpusError::NotWhole {
        place: store.place(),
        name: plan_file::NAME.into(),
        reason: format!(
            "its keys give scene_plan_hash {here}, the manifest says {there}: it was edited or damaged, or written by another version \
             of marsyard"
        ),
        cure: format!(
            "`marsyard generate CONFIG --out {}`, with the config that the corpus was built from, writes it anew",
            shell::word(place.display())
        ),
    }))
}

/// Refuses a corpus that is not the one that its manifest names; one that is not finished yet has only its plan.
pub(super) fn check_if_finished(place: &Path) -> Result<(), Failure> {
    match open(place)?.size(manifest::NAME).map_err(corpus_failure)? {
        Some(_) => finished(place).and_then(|_| finished_plan(place)).map(drop),
        None => Ok(()),
    }
}

/// The plan of a place that should be a corpus; refused where there is none.
pub(super) fn plan_file(place: &Path) -> Result<PathBuf, Failure> {
    check_folder(place)?;
    let there = if address::is_url(place) {
        open(place)?.size("plan.yaml").map_err(corpus_failure)?.is_some()
    } else {
        is_file(&place.join("plan.yaml"))?
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
pub(super) fn read(path: &Path, kind: FileKind) -> Result<Vec<u8>, Failure> {
    address::read(path, kind).map_err(corpus_failure)
}

/// Whether there is such a file in a folder or at a URL.
pub(super) fn is_file(path: &Path) -> Result<bool, Failure> {
    if !address::is_url(path) {
        return Ok(facts_of(path)?.is_some_and(|facts| facts.is_file()));
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
