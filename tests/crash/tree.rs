//! A folder -> its files by name, as far as their bytes are promised; and copies of folders.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Files by name. Times and the hosts' names are no part of any promise.
pub type Tree = BTreeMap<String, Vec<u8>>;

/// What is promised of a folder; temporary files count, since none may stay.
pub fn promised(folder: &Path) -> Tree {
    let mut files = Tree::new();
    collect(folder, "", &mut files);
    files.retain(|name, _| !name.ends_with("report.json"));
    for (name, bytes) in &mut files {
        if name.ends_with("training.jsonl") {
            *bytes = without(bytes, ",\"elapsed_s\"").join("\n").into_bytes();
        } else if name.ends_with("search.jsonl") {
            // In the order in which networks were finished, which differs from run to run.
            let mut lines = without(bytes, ",\"seconds\"");
            lines.sort_unstable();
            *bytes = lines.join("\n").into_bytes();
        }
    }
    files
}

/// The first difference of two trees, in words.
pub fn difference(expected: &Tree, there: &Tree) -> Option<String> {
    let missing = expected.keys().find(|name| !there.contains_key(*name)).map(|name| format!("{name} is missing"));
    let stray = || there.keys().find(|name| !expected.contains_key(*name)).map(|name| format!("{name} stays behind"));
    let other = || expected.iter().find(|(name, bytes)| there.get(*name) != Some(bytes));
    missing.or_else(stray).or_else(|| other().map(|(name, _)| format!("{name} has other bytes")))
}

/// Whether a file's name is that of one that was not yet whole.
pub fn is_temporary(name: &str) -> bool {
    name.starts_with(".tmp-") || name.starts_with(".marsyard-tmp-")
}

/// Copies what is in a folder into another one.
pub fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for path in entries(from) {
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, &target).expect("a copy");
        }
    }
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths
}

fn collect(folder: &Path, prefix: &str, files: &mut Tree) {
    for path in entries(folder) {
        let name = format!("{prefix}{}", path.file_name().expect("a name").to_string_lossy());
        if path.is_dir() {
            collect(&path, &format!("{name}/"), files);
        } else {
            files.insert(name, fs::read(&path).expect("a readable file"));
        }
    }
}

/// Lines of text without their times, which stand last in each.
fn without(bytes: &[u8], times: &str) -> Vec<String> {
    let text = String::from_utf8_lossy(bytes);
    text.lines().map(|line| line.split(times).next().unwrap_or_default().to_owned()).collect()
}
