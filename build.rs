//! Tells the binary what it was made from: commit, sources, compiler, target, features. Receipts and manifests repeat them.

use std::path::Path;
use std::process::Command;

use sha2::{Digest, Sha256};

/// All that the compiler reads of this package: the code, what is compiled in, and what says which versions of what else.
const SOURCES: [&str; 6] = ["Cargo.lock", "Cargo.toml", "build.rs", "configs/rovers", "configs/sensors", "src"];

fn main() {
    let git = |args: &[&str]| said(Command::new("git").args(args));
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    set("COMMIT", &commit(&git).unwrap_or_else(|| "unknown".into()));
    set("SOURCES_SHA256", &sources_sha256());
    set("RUSTC", &said(Command::new(rustc).arg("--version")).unwrap_or_else(|| "unknown".into()));
    set("TARGET", &std::env::var("TARGET").unwrap_or_else(|_| "unknown".into()));
    set("FEATURES", &features());
    SOURCES.iter().for_each(|source| println!("cargo::rerun-if-changed={source}"));
    // Grows with every commit and checkout, in the main tree and in worktrees alike.
    if let Some(head_log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).filter(|path| Path::new(path).exists()) {
        println!("cargo::rerun-if-changed={head_log}");
    }
}

fn set(name: &str, value: &str) {
    println!("cargo::rustc-env=MARSYARD_{name}={value}");
}

/// The commit; with `-dirty` behind it where the sources are not those of the commit.
fn commit(git: &dyn Fn(&[&str]) -> Option<String>) -> Option<String> {
    let head = git(&["rev-parse", "HEAD"])?;
    let changed = git(&[&["status", "--porcelain", "--"][..], &SOURCES].concat())?;
    Some(if changed.is_empty() { head } else { format!("{head}-dirty") })
}

/// SHA-256 over the sources in the order of their paths: of each its path, a line feed, its length as eight bytes (the lowest
/// first), its bytes.
fn sources_sha256() -> String {
    let mut files = Vec::new();
    SOURCES.iter().for_each(|source| collect(Path::new(source), &mut files));
    files.sort();
    let mut hasher = Sha256::new();
    for file in files {
        let bytes = std::fs::read(&file).unwrap_or_else(|error| panic!("{file}: {error}"));
        hasher.update(&file);
        hasher.update(b"\n");
        hasher.update((bytes.len() as u64).to_le_bytes());
        hasher.update(&bytes);
    }
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A file, or the files below a folder; hidden ones are editors' and no sources.
fn collect(path: &Path, files: &mut Vec<String>) {
    let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    if hidden {
    } else if path.is_dir() {
        let entries = std::fs::read_dir(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        entries.flatten().for_each(|entry| collect(&entry.path(), files));
    } else if path.exists() {
        files.push(path.to_str().expect("the sources have plain names").into());
    }
}

/// The features of this crate that are on, by name.
fn features() -> String {
    let on = std::env::vars().filter_map(|(key, _)| key.strip_prefix("CARGO_FEATURE_").map(str::to_lowercase));
    let mut on: Vec<String> = on.map(|name| name.replace('_', "-")).filter(|name| name != "default").collect();
    on.sort();
    on.join(",")
}

/// What a command prints; nothing where it cannot be run (a source tree without git).
fn said(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    String::from_utf8(output.stdout).ok().map(|text| text.trim().to_string())
}
