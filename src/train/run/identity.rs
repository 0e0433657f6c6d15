//! What a run was begun with: it goes on with the same only.

use serde_json::{Value as Json, json};

use super::Setup;
use crate::train::TrainError;

/// What must be the same for a run to go on.
pub(super) fn of(setup: &Setup) -> Json {
    let corpora: Vec<Json> = setup
        .sources
        .list
        .iter()
        .map(|source| {
            json!({
                "name": source.name,
                "corpus_id": source.corpus_id,
                "manifest_sha256": source.manifest_sha256,
                "scene_plan_hash": source.scene_plan_hash,
                "weight": source.weight,
            })
        })
        .collect();
    let init = setup.init.as_ref().map(|init| {
        let weights = init.model.network.weights.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        let mut hasher = blake3::Hasher::new();
        hasher.update(&weights).update(init.filter.as_deref().unwrap_or_default());
        hasher.finalize().to_hex().to_string()
    });
    json!({"config": setup.params, "corpora": corpora, "init": init})
}

/// Refuses to go on with a run that was begun otherwise, and says in what.
pub(super) fn check(setup: &Setup, there: &Json, here: &Json) -> Result<(), TrainError> {
    let differs = |what: &str| TrainError::OtherRun { path: setup.out.display().to_string(), what: what.into() };
    for (key, what) in [
        ("config", "the config is another one (its own is in train.yaml)"),
        ("corpora", "the corpora, or their weights, are others"),
        ("init", "the network it starts from is another one"),
    ] {
        if there[key] != here[key] {
            return Err(differs(what));
        }
    }
    Ok(())
}
