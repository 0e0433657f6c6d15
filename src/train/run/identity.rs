//! What a run was begun with: it goes on with the same only.

use serde_json::{Value as Json, json};

use super::Setup;
use crate::corpus::sha256;
use crate::train::{Activation, Loss, TrainError};

/// What runs of an earlier marsyard did not note.
const SHARDS: &str = "shards_sha256";
const SCORES: &str = "normal_scores";
const ACTIVATION: &str = "activation";
const LOSS: &str = "loss";

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
                SHARDS: source.shards_sha256,
                "scene_plan_hash": source.scene_plan_hash,
                "weight": source.weight,
            })
        })
        .collect();
    let init = setup.init.as_ref().map(|init| {
        let weights = init.model.network.weights.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        let mut hasher = blake3::Hasher::new();
        // The weights mean what they mean behind the model's own scaling: all of its file counts.
        hasher.update(&weights).update(init.model.sha256.as_deref().unwrap_or_default().as_bytes());
        hasher.update(init.filter.as_deref().unwrap_or_default());
        hasher.finalize().to_hex().to_string()
    });
    json!({"config": setup.params, "corpora": corpora, "init": init})
}

/// A run's name for itself: the SHA-256 of what it was begun with, without what earlier runs of the same bits did not note.
pub(super) fn run_id(identity: &Json) -> String {
    let mut sorted = identity.clone();
    if let Some(config) = sorted.get_mut("config") {
        leave_unnoted(config);
    }
    sorted.sort_all_objects();
    sha256(sorted.to_string().as_bytes())
}

/// What earlier runs did not note, where it stands in a config, and what it was of theirs.
fn unnoted() -> [(&'static str, &'static str, Json); 3] {
    [
        ("/network", SCORES, json!(false)),
        ("/network", ACTIVATION, json!(Activation::Logistic)),
        ("/filter/kronecker", LOSS, json!(Loss::Squared)),
    ]
}

fn part_of<'c>(config: &'c mut Json, place: &str) -> Option<&'c mut serde_json::Map<String, Json>> {
    config.pointer_mut(place).and_then(Json::as_object_mut)
}

/// Takes out of a config what earlier runs of the same bits did not note.
pub(crate) fn leave_unnoted(config: &mut Json) {
    for (place, key, was) in unnoted() {
        if let Some(part) = part_of(config, place).filter(|part| part.get(key) == Some(&was)) {
            part.shift_remove(key);
        }
    }
}

/// Refuses to go on with a run that was begun otherwise, and says in what.
pub(super) fn check(setup: &Setup, there: &Json, here: &Json) -> Result<(), TrainError> {
    let differs = |what: &str| TrainError::OtherRun { path: setup.out.display().to_string(), what: what.into() };
    let corpora = as_known(&here["corpora"], &there["corpora"]);
    let config = as_noted_now(&there["config"]);
    for (there, here, what) in [
        (&config, &here["config"], "the config is another one (its own is in train.yaml)"),
        (&there["corpora"], &corpora, "the corpora, or their weights, are others"),
        (&there["init"], &here["init"], "the network it starts from is another one"),
    ] {
        if there != here {
            return Err(differs(what));
        }
    }
    Ok(())
}

/// The config; where it is of an earlier marsyard, with what that did and did not note: it learnt every row, took no normal scores, had logistic
/// neurons, and lowered the squared error.
pub(crate) fn as_noted_now(there: &Json) -> Json {
    let mut config = there.clone();
    for (place, key, was) in unnoted() {
        if let Some(part) = part_of(&mut config, place) {
            part.entry(key).or_insert(was);
        }
    }
    if let Some(ekf) = config.pointer_mut("/filter/ekf").and_then(Json::as_object_mut) {
        ekf.entry("rows").or_insert_with(|| json!("every"));
    }
    config
}

/// The corpora, without what a run of an earlier marsyard did not know of them.
fn as_known(here: &Json, there: &Json) -> Json {
    let mut corpora = here.clone();
    for (ours, theirs) in corpora.as_array_mut().into_iter().flatten().zip(there.as_array().into_iter().flatten()) {
        if let Some(facts) = ours.as_object_mut().filter(|_| theirs.get(SHARDS).is_none()) {
            facts.remove(SHARDS);
        }
    }
    corpora
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(network: &Json) -> Json {
        json!({"config": {"network": network, "filter": {"ekf": {"rows": "every"}}}, "corpora": [], "init": null})
    }

    #[test]
    fn equal_runs_of_logistic_neurons_without_normal_scores_and_those_that_did_not_know_of_others() {
        let earlier = identity(&json!({"hidden": [4]}));
        let none = identity(&json!({"hidden": [4], "normal_scores": false, "activation": "logistic"}));
        let scores = identity(&json!({"hidden": [4], "normal_scores": true, "activation": "logistic"}));
        let rectified = identity(&json!({"hidden": [4], "normal_scores": false, "activation": "relu"}));
        assert_eq!(run_id(&earlier), run_id(&none));
        assert_ne!(run_id(&earlier), run_id(&scores));
        assert_ne!(run_id(&earlier), run_id(&rectified));
        assert_eq!(as_noted_now(&earlier["config"]), none["config"]);
        assert_eq!(as_noted_now(&scores["config"]), scores["config"]);
    }

    #[test]
    fn equal_runs_of_batches_by_squares_and_those_that_knew_no_other_loss() {
        let of = |kronecker: Json| json!({"config": {"network": {"hidden": [4]}, "filter": {"kronecker": kronecker}}});
        let [earlier, squares, logarithms] = [
            json!({"rate": 0.005}),
            json!({"rate": 0.005, "loss": "squared"}),
            json!({"rate": 0.005, "loss": "logarithmic"}),
        ]
        .map(of);
        assert_eq!(run_id(&earlier), run_id(&squares));
        assert_ne!(run_id(&earlier), run_id(&logarithms));
        assert_eq!(as_noted_now(&earlier["config"])["filter"], squares["config"]["filter"]);
        assert_eq!(as_noted_now(&logarithms["config"])["filter"], logarithms["config"]["filter"]);
    }

    #[test]
    fn exact_an_earlier_config_learnt_every_row() {
        let config = as_noted_now(&json!({"network": {}, "filter": {"ekf": {"batch": 1}}}));
        assert_eq!(config["filter"]["ekf"], json!({"batch": 1, "rows": "every"}));
    }
}
