//! Scenes of a shard -> a line of JSON each, with the hashes of their stages' f64 results: what f32 columns would hide.
//!
//! Lines are added when their shard is whole, just before it is put in its place: a build that is asked to stop adds none for the shards
//! that it discards, and none is lost by a kill. A kill or a failed write between the two leaves lines of a shard that the next run adds again.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde_json::json;

use crate::corpus::CorpusError;
use crate::episode::{SceneOutput, StageRecord};

/// A file of hashes that lines are added to, from any thread.
pub(super) struct StageHashFile {
    path: PathBuf,
    scenes_per_shard: u64,
    /// The file, and the lines of shards in the making by their number, in the order in which scenes were done.
    inner: Mutex<(File, BTreeMap<u64, String>)>,
}

/// Whether a file holds such lines: what is appended to another's file is lost in it.
pub(crate) fn is_stage_hashes(bytes: &[u8]) -> bool {
    bytes.starts_with(b"{\"scene\":")
}

impl StageHashFile {
    pub(super) fn open(path: &Path, scenes_per_shard: u32) -> Result<StageHashFile, CorpusError> {
        let file = File::options().create(true).append(true).open(path);
        let file = file.map_err(|source| CorpusError::of_path(path, source))?;
        let inner = Mutex::new((file, BTreeMap::new()));
        Ok(StageHashFile { path: path.into(), scenes_per_shard: scenes_per_shard.into(), inner })
    }

    /// Keeps a scene's line until its shard is whole.
    pub(super) fn scene(&self, output: &SceneOutput, record: &StageRecord) {
        let hashes = record.hashes.iter().flat_map(|hashes| hashes.finish());
        let stages: serde_json::Map<_, _> = hashes.map(|(stage, hash)| (stage.into(), hash.into())).collect();
        let line = json!({"scene": output.scene_id, "stages": stages, "error": output.error});
        let (_, lines) = &mut *self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        *lines.entry(output.scene_id / self.scenes_per_shard).or_default() += &format!("{line}\n");
    }

    /// Adds the lines of a shard that is whole, by one write, so that the lines of two builds do not mix.
    pub(super) fn shard(&self, shard: u64) -> Result<(), CorpusError> {
        let (file, lines) = &mut *self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let whole = lines.remove(&shard).unwrap_or_default();
        file.write_all(whole.as_bytes()).map_err(|source| CorpusError::of_path(&self.path, source))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_only_the_scenes_of_whole_shards_are_in_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("hashes");
        let file = StageHashFile::open(&path, 2).unwrap();
        for scene_id in [2, 0, 1] {
            file.scene(&SceneOutput { scene_id, ..SceneOutput::default() }, &StageRecord::default());
        }
        file.shard(0).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(is_stage_hashes(text.as_bytes()), "{text}");
        let scene = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap()["scene"].clone();
        assert_eq!(text.lines().map(scene).collect::<Vec<_>>(), [0, 1]);
    }
}
