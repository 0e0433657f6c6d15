//! Two resolved plans -> the keys that differ: dotted path, and both values.
//!
//! A path is written as `--set` takes it (`scene.rocks.count`); an entry of a list of parts, such as a family, by its number from 0
//! (`families.1.cells.size_m`). Lists of plain values are one value.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value as Json;

/// A key that two plans have different values of.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(crate) struct KeyDifference {
    /// From the plan's top, as `cells.size_m`.
    pub key: String,
    /// Null where the plan has no such key.
    pub a: Option<Json>,
    pub b: Option<Json>,
}

/// The keys that differ, in the order of the alphabet.
pub(crate) fn key_differences(a: &Json, b: &Json) -> Vec<KeyDifference> {
    let (a, b) = (flattened(a), flattened(b));
    let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let both = |key: &String| (a.get(key).copied(), b.get(key).copied());
    keys.into_iter()
        .map(|key| (key, both(key)))
        .filter(|(_, (a, b))| a != b)
        .map(|(key, (a, b))| KeyDifference { key: key.clone(), a: a.cloned(), b: b.cloned() })
        .collect()
}

/// A document as dotted keys with plain values.
fn flattened(document: &Json) -> BTreeMap<String, &Json> {
    fn walk<'a>(key: String, value: &'a Json, out: &mut BTreeMap<String, &'a Json>) {
        let below = |part: &str| if key.is_empty() { part.to_string() } else { format!("{key}.{part}") };
        match value {
            Json::Object(map) if !map.is_empty() => map.iter().for_each(|(k, v)| walk(below(k), v, out)),
            Json::Array(list) if list.iter().any(|v| v.is_object() || v.is_array()) => {
                list.iter().enumerate().for_each(|(i, v)| walk(below(&i.to_string()), v, out));
            }
            plain => {
                out.insert(key, plain);
            }
        }
    }
    let mut out = BTreeMap::new();
    walk(String::new(), document, &mut out);
    out
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn exact_keys_that_differ_by_path_with_both_values() {
        let a = json!({"scenes": 4, "tables": ["cells"], "cells": {"size_m": 0.1, "labels": {"min": 1}}, "rocks": {"n": 1}});
        let b = json!({"scenes": 4, "tables": ["cells", "poses"], "cells": {"size_m": 0.2, "labels": {"min": 1}}, "box": null});
        let found = key_differences(&a, &b);
        let keys: Vec<&str> = found.iter().map(|difference| difference.key.as_str()).collect();
        assert_eq!(keys, ["box", "cells.size_m", "rocks.n", "tables"]);
        assert_eq!((&found[0].a, &found[0].b), (&None, &Some(Json::Null)));
        assert_eq!((&found[1].a, &found[1].b), (&Some(json!(0.1)), &Some(json!(0.2))));
        assert_eq!((&found[2].a, &found[2].b), (&Some(json!(1)), &None));
        assert!(key_differences(&a, &a).is_empty());
        let a = json!({"families": [{"name": "near", "x": 1}, {"name": "far", "x": 2}]});
        let b = json!({"families": [{"name": "near", "x": 1}, {"name": "far", "x": 3}]});
        assert_eq!(key_differences(&a, &b)[0].key, "families.1.x");
    }
}
