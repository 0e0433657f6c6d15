//! Two plans -> the keys that make other corpora of them, as data and for people.
//!
//! In: both plans as YAML. Out: a [`Difference`] a key, or lines with `-` and `+`. Which keys differ at all is said by
//! [`key_differences`]; here those are left out that change no scene.

use super::key_differences::{KeyDifference, key_differences};

/// A dotted key in which two plans differ, with its value in each as JSON.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    pub key: String,
    pub there: Option<String>,
    pub here: Option<String>,
}

/// The keys in which two plans differ, by key; `name`, `scenes`, `card` and the word `fidelity` make no other corpus. `None` where one
/// cannot be read as YAML.
pub fn differences(there: &str, here: &str) -> Option<Vec<Difference>> {
    let document = |yaml: &str| serde_saphyr::from_str::<serde_json::Value>(yaml).ok();
    let found = key_differences(&document(there)?, &document(here)?);
    let is_of_scenes = |key: &str| !matches!(key, "name" | "scenes" | "fidelity") && !key.starts_with("card.");
    let text = |value: Option<serde_json::Value>| value.map(|value| value.to_string());
    let found = found.into_iter().filter(|difference| is_of_scenes(&difference.key));
    Some(found.map(|KeyDifference { key, a, b }| Difference { key, there: text(a), here: text(b) }).collect())
}

/// The same for people: `-` as it is in the place, `+` as it was asked for.
pub(crate) fn difference(there: &str, here: &str) -> String {
    let Some(differences) = differences(there, here) else {
        return "  (plan.yaml in the place cannot be read as YAML)".into();
    };
    let lines = differences.iter().flat_map(|Difference { key, there, here }| {
        let old = there.iter().map(move |value| format!("  - {key}: {value}"));
        old.chain(here.iter().map(move |value| format!("  + {key}: {value}")))
    });
    let lines: Vec<String> = lines.collect();
    if lines.is_empty() {
        "  (no key differs: another version of marsyard made the other hash, or the first line of plan.yaml is damaged; if so, \
             write into it the scene_plan_hash of this plan, and the same command goes on)"
            .into()
    } else {
        lines.join("\n")
    }
}
