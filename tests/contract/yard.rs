//! A scratch folder, a config in it, and the binary.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder that goes away with the test.
pub struct Yard {
    folder: tempfile::TempDir,
}

impl Yard {
    pub fn new() -> Yard {
        Yard { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The config that uses every stage and every effect.
    pub fn everything() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/everything.yaml")
    }

    /// Runs the binary.
    pub fn marsyard<I: AsRef<std::ffi::OsStr>>(&self, arguments: impl IntoIterator<Item = I>) -> Output {
        self.command(arguments).output().expect("the binary starts")
    }

    pub fn command<I: AsRef<std::ffi::OsStr>>(&self, arguments: impl IntoIterator<Item = I>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_marsyard"));
        command.args(arguments).current_dir(self.folder.path());
        command
    }

    /// Builds the config into `out` with extra arguments, and asserts success.
    pub fn generate(&self, config: &Path, out: &str, extra: &[&str]) {
        let mut arguments = vec!["generate".to_string(), config.display().to_string(), "--out".into(), out.into()];
        arguments.extend(extra.iter().map(|a| (*a).to_string()));
        let output = self.marsyard(&arguments);
        assert!(output.status.success(), "{arguments:?}:\n{}", text(&output.stderr));
    }

    /// Every file of a corpus that belongs to its identity, by path, with its bytes.
    pub fn identity(&self, corpus: &str) -> BTreeMap<String, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(&self.path(corpus), "", &mut files);
        files.remove("report.json");
        files
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn collect(folder: &Path, prefix: &str, files: &mut BTreeMap<String, Vec<u8>>) {
    for entry in std::fs::read_dir(folder).expect("the corpus folder") {
        let entry = entry.expect("an entry");
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            collect(&entry.path(), &format!("{name}/"), files);
        } else {
            files.insert(name, std::fs::read(entry.path()).expect("a readable file"));
        }
    }
}

/// Asserts that two corpora are the same, naming the first file that differs.
pub fn assert_same(left: &BTreeMap<String, Vec<u8>>, right: &BTreeMap<String, Vec<u8>>) {
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(left), names(right), "the corpora hold other files");
    for (name, bytes) in left {
        assert!(bytes == &right[name], "{name} differs");
    }
}
