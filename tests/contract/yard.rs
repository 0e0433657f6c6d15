//! A scratch folder, a config in it, and the binary.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};

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

    /// Builds the config into `out` with extra arguments, and asserts success; see [`Yard::stage_hashes`].
    pub fn generate(&self, config: &Path, out: &str, extra: &[&str]) {
        self.generate_with(config, out, extra, &[]);
    }

    /// As [`Yard::generate`], in another environment.
    pub fn generate_with(&self, config: &Path, out: &str, extra: &[&str], environment: &[(&str, &str)]) {
        let hashes = format!("{out}.hashes");
        let mut command = self.command(["generate", "--out", out, "--stage-hashes", &hashes]);
        command.arg(config).args(extra).envs(environment.iter().copied());
        let output = command.output().expect("the binary starts");
        assert!(output.status.success(), "{command:?}:\n{}", text(&output.stderr));
    }

    /// By scene, the hashes of its stages' f64 results, as all builds of `out` wrote them; a scene that was built twice must
    /// have had the same ones.
    pub fn stage_hashes(&self, out: &str) -> BTreeMap<u64, serde_json::Value> {
        let written = std::fs::read_to_string(self.path(&format!("{out}.hashes"))).expect("the hashes of the stages");
        let mut scenes = BTreeMap::new();
        // A line that ends without a newline was cut short by a kill.
        for line in written.split_inclusive('\n').filter(|line| line.ends_with('\n')) {
            let line: serde_json::Value = serde_json::from_str(line).expect("a line of JSON");
            let scene = line["scene"].as_u64().expect("a scene");
            if let Some(before) = scenes.insert(scene, line.clone()) {
                assert_eq!(before, line, "scene {scene}, built twice");
            }
        }
        scenes
    }

    /// Waits for a process that must succeed: the kernel's own high-water mark of its resident memory, kB.
    pub fn peak_kb(&self, child: &mut Child) -> f64 {
        let status = PathBuf::from(format!("/proc/{}/status", child.id()));
        let mut peak = 0.0_f64;
        while child.try_wait().expect("a child to wait for").is_none() {
            let text = std::fs::read_to_string(&status).unwrap_or_default();
            let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            let kb = line.and_then(|line| line.trim_end_matches("kB").trim().parse().ok());
            peak = peak.max(kb.unwrap_or(0.0));
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert!(child.wait().expect("a child to wait for").success());
        peak
    }

    /// The `identity` of a search's folder, with the journal's lines in order and without times.
    pub fn search_identity(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let mut files = self.identity(out);
        let journal = files.get_mut("search.jsonl").expect("search.jsonl");
        let whole = text(journal);
        let mut lines: Vec<&str> =
            whole.lines().map(|line| line.split(",\"seconds\"").next().unwrap_or_default()).collect();
        lines.sort_unstable();
        *journal = lines.join("\n").into_bytes();
        files
    }

    /// Every file of a corpus that belongs to its identity, by path, with its bytes.
    pub fn identity(&self, corpus: &str) -> BTreeMap<String, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(&self.path(corpus), "", &mut files);
        files.remove("report.json");
        files
    }
}

/// Waits until something of a running process is there, ten minutes at most; one that ended is told with what it said.
pub fn wait_for(child: &mut Child, what: &str, is_there: impl Fn() -> bool) {
    for _ in 0..60_000 {
        if is_there() {
            return;
        }
        if let Some(status) = child.try_wait().expect("a child to wait for") {
            if is_there() {
                return;
            }
            let mut said = String::new();
            if let Some(mut stderr) = child.stderr.take() {
                stderr.read_to_string(&mut said).expect("what it said");
            }
            panic!("no {what}, and {status}: {said}");
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    panic!("no {what} within ten minutes");
}

/// Sends a signal that asks a process to stop, and waits for what it says; it must ask to be run again.
pub fn stopped(child: Child, signal: &str) -> Output {
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("kill");
    assert!(sent.success());
    let output = child.wait_with_output().expect("a child to wait for");
    assert_eq!(output.status.code(), Some(75), "{}", text(&output.stderr));
    output
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
