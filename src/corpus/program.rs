//! Which program wrote a shard: what `build.rs` knew of the running one, or what a file says of another.
//!
//! Named by its sources, not by the hash of its file: that hash costs 50 ms at every start, is not to be had where there is no
//! `/proc`, and says nothing to whoever has the sources. Optimisation does not enter: floating-point results do not depend on it, and
//! the pinned ids of the tests are the same in debug and release.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which program wrote a shard.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Build {
    pub version: String,
    /// With `-dirty` behind it where the sources were not those of the commit; `unknown` where there was no git.
    pub commit: String,
    /// Hash over the code, what is compiled into it, `Cargo.toml`, `Cargo.lock` and `build.rs`; since format 2.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub sources_sha256: String,
    /// In place of the sources' hash in corpora of format 1: hash of the program's file.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub binary_sha256: String,
    /// As `rustc --version` says.
    pub rustc: String,
    pub target: String,
    /// Cargo features that were on, with commas; none changes a byte of a corpus.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub features: String,
}

impl Build {
    /// The running program: known since it was compiled.
    pub(crate) fn of_this_binary() -> Build {
        Build {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: env!("MARSYARD_COMMIT").into(),
            sources_sha256: env!("MARSYARD_SOURCES_SHA256").into(),
            binary_sha256: String::new(),
            rustc: env!("MARSYARD_RUSTC").into(),
            target: env!("MARSYARD_TARGET").into(),
            features: env!("MARSYARD_FEATURES").into(),
        }
    }

    /// Whether equal values are promised of both: equal sources by an equal compiler. A commit that touched no source is no other
    /// program, and a feature changes no byte.
    pub(crate) fn is_like(&self, other: &Build) -> bool {
        let made_from = |build: &Build| {
            let Build { sources_sha256, binary_sha256, rustc, target, .. } = build.clone();
            (sources_sha256, binary_sha256, rustc, target)
        };
        made_from(self) == made_from(other)
    }
}

impl fmt::Display for Build {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let start = |text: &str| text.chars().take(12).collect::<String>();
        let (commit, dirty) = match self.commit.strip_suffix("-dirty") {
            Some(commit) => (commit, "-dirty"),
            None => (self.commit.as_str(), ""),
        };
        let (what, hash) = match self.sources_sha256.as_str() {
            "" => ("binary", &self.binary_sha256),
            _ => ("sources", &self.sources_sha256),
        };
        write!(f, "{} (commit {}{dirty}, {what} {})", self.version, start(commit), start(hash))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn collect(path: &Path, files: &mut Vec<std::path::PathBuf>) {
        for entry in
            std::fs::read_dir(path).unwrap().flatten().filter(|e| !e.file_name().as_encoded_bytes().starts_with(b"."))
        {
            if entry.path().is_dir() { collect(&entry.path(), files) } else { files.push(entry.path()) }
        }
    }

    #[test]
    fn equal_sources_hash_of_the_binary_and_of_the_files_on_disk() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut files = ["Cargo.lock", "Cargo.toml", "build.rs"].map(|name| root.join(name)).to_vec();
        ["configs/rovers", "configs/sensors", "src"].iter().for_each(|folder| collect(&root.join(folder), &mut files));
        let name = |file: &std::path::PathBuf| file.strip_prefix(root).unwrap().to_str().unwrap().to_string();
        files.sort_by_key(name);
        let mut all = Vec::new();
        for file in &files {
            let bytes = std::fs::read(file).unwrap();
            all.extend(name(file).bytes());
            all.push(b'\n');
            all.extend((bytes.len() as u64).to_le_bytes());
            all.extend(bytes);
        }
        assert!(files.len() > 100);
        assert_eq!(Build::of_this_binary().sources_sha256, crate::corpus::sha256(&all));
    }

    #[test]
    fn law_another_commit_of_the_same_sources_is_like_it_and_another_compiler_is_not() {
        let here = Build::of_this_binary();
        assert!(here.is_like(&Build { commit: "unknown".into(), features: String::new(), ..here.clone() }));
        assert!(!here.is_like(&Build { rustc: "rustc 1.0.0".into(), ..here.clone() }));
        assert!(!here.is_like(&Build { sources_sha256: "00".repeat(32), ..here.clone() }));
        let old = Build { sources_sha256: String::new(), binary_sha256: "ab".repeat(32), ..here.clone() };
        assert!(old.is_like(&old.clone()) && !here.is_like(&old));
    }

    #[test]
    fn exact_a_build_of_format_1_is_read_and_named_by_its_binary() {
        let text = format!(
            r#"{{"version": "0.1.0", "commit": "be6f814e3", "binary_sha256": "{}", "rustc": "rustc 1.95.0", "target": "x"}}"#,
            "ab".repeat(32)
        );
        let old: Build = serde_json::from_str(&text).unwrap();
        assert_eq!(old.to_string(), "0.1.0 (commit be6f814e3, binary abababababab)");
        // Written back as it was: a manifest of format 1 that names it stays equal.
        let value = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
        assert_eq!(value(&serde_json::to_string(&old).unwrap()), value(&text));
        let dirty = Build { commit: format!("{}-dirty", "c".repeat(40)), ..Build::of_this_binary() };
        assert!(dirty.to_string().contains("(commit cccccccccccc-dirty, sources "), "{dirty}");
    }
}
