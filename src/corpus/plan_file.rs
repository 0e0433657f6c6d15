//! `plan.yaml` of a place -> whose place it is, and how far its plan goes.
//!
//! The first line says the plan's hash; the keys that a growth or a new name may change, and those that shards are counted by,
//! stand right behind it, so that whoever asks again and again reads a few hundred bytes.

use serde::Deserialize;

use super::{CorpusError, CorpusSpec, Manifest, Store};

pub(crate) const NAME: &str = "plan.yaml";
const HEAD: &str = "# scene_plan_hash: ";
/// The hash, a comment and five short keys.
const HEAD_BYTES: usize = 1024;
/// The last of the keys that are read.
const LAST_KEY: &str = "scenes_per_shard:";

/// What the head of a plan says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PlanHead {
    pub scene_plan_hash: String,
    /// `None` where they cannot be read.
    pub extent: Option<Extent>,
}

/// The corpus that a plan asks for, apart from what its scenes are like.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub(crate) struct Extent {
    pub name: String,
    pub seed: u64,
    pub scenes: u64,
    pub scenes_per_shard: u32,
}

impl From<&CorpusSpec> for Extent {
    fn from(spec: &CorpusSpec) -> Extent {
        let CorpusSpec { name, seed, scenes, scenes_per_shard, .. } = spec;
        Extent { name: name.clone(), seed: *seed, scenes: *scenes, scenes_per_shard: *scenes_per_shard }
    }
}

impl From<&Manifest> for Extent {
    fn from(manifest: &Manifest) -> Extent {
        let Manifest { name, seed, scenes, scenes_per_shard, .. } = manifest;
        Extent { name: name.clone(), seed: *seed, scenes: *scenes, scenes_per_shard: *scenes_per_shard }
    }
}

/// The file of a plan.
pub(crate) fn text(spec: &CorpusSpec) -> String {
    format!("{HEAD}{}\n{}", spec.scene_plan_hash, spec.plan_yaml)
}

/// Hash and YAML of a plan's file; `None` where its first line is not ours.
pub(crate) fn split(text: &str) -> Option<(&str, &str)> {
    let (hash, plan) = text.strip_prefix(HEAD)?.split_once('\n')?;
    Some((hash.trim(), plan))
}

/// The head of the plan in a place; `Ok(None)` where there is no plan of marsyard's.
pub(crate) fn head(store: &dyn Store) -> Result<Option<PlanHead>, CorpusError> {
    match store.read_range(NAME, 0, HEAD_BYTES) {
        Ok(bytes) => Ok(head_of(&bytes)),
        Err(CorpusError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// The head of a plan, of its file or of the first bytes of it.
pub(crate) fn head_of(bytes: &[u8]) -> Option<PlanHead> {
    let bytes = &bytes[..bytes.len().min(HEAD_BYTES)];
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).expect("valid up to there"),
    };
    let (hash, rest) = text.strip_prefix(HEAD)?.split_once('\n').unwrap_or((text.strip_prefix(HEAD)?, ""));
    let end = rest.lines().position(|line| line.starts_with(LAST_KEY));
    let keys = end.map(|end| rest.split_inclusive('\n').take(end + 1).collect::<String>());
    let extent = keys.and_then(|keys| serde_saphyr::from_str(&keys).ok());
    Some(PlanHead { scene_plan_hash: hash.trim().into(), extent })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_the_head_says_whose_the_place_is_and_how_far_it_goes() {
        let text = "# scene_plan_hash: abc\n# The resolved config.\nmarsyard: 1\nname: \"1.5\"\nseed: 3\nscenes: 14\n\
                    scenes_per_shard: 2\ntables:\n- cells\n";
        let head = head_of(text.as_bytes()).unwrap();
        assert_eq!(head.scene_plan_hash, "abc");
        let extent = Extent { name: "1.5".into(), seed: 3, scenes: 14, scenes_per_shard: 2 };
        assert_eq!(head.extent, Some(extent));
        let cut = head_of(&text.as_bytes()[..60]).unwrap();
        assert_eq!((cut.scene_plan_hash.as_str(), cut.extent), ("abc", None));
        assert_eq!(head_of(b"name: mine\n"), None);
        assert!(head_of(b"# scene_plan_hash: \xff\n").is_some());
    }
}
