//! Contract: the files in `schemas/` are what the types say, and say every range that the types refuse by.

use marsyard::config::{Kind, schema, schema_text};
use serde_json::Value as Json;

/// Rewrites the files instead: `MARSYARD_WRITE_SCHEMAS=1 cargo test --test config schemas`.
const WRITE: &str = "MARSYARD_WRITE_SCHEMAS";

#[test]
fn equal_schema_files_and_types() {
    for kind in Kind::ALL {
        let path = format!("schemas/{}.schema.json", kind.name());
        if std::env::var_os(WRITE).is_some() {
            std::fs::write(&path, schema_text(kind)).unwrap();
        }
        let written = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(written == schema_text(kind), "{path} is not what the types say: run the tests with {WRITE}=1");
    }
}

/// Numbers inside laws and lists have no range of their own: the key that holds them has.
fn numbers_without_a_range(part: &Json, path: &str, found: &mut Vec<String>) {
    let exempt = ["/Law", "/Dist"].iter().any(|end| path.ends_with(end));
    match part {
        _ if exempt => (),
        Json::Object(entries) => {
            let is_number =
                part["type"] == "number" || part["type"].as_array().is_some_and(|t| t.contains(&"number".into()));
            let is_dist = part["$ref"] == "#/$defs/Dist"
                || part["anyOf"].as_array().is_some_and(|any| any.iter().any(|p| p["$ref"] == "#/$defs/Dist"));
            let in_list = path.ends_with("/items");
            if (is_number || is_dist) && !in_list && part["maximum"].is_null() && !path.contains("/anyOf/") {
                found.push(path.to_owned());
            }
            for (key, child) in entries.iter().filter(|(key, _)| *key != "default") {
                numbers_without_a_range(child, &format!("{path}/{key}"), found);
            }
        }
        Json::Array(items) => {
            items.iter().enumerate().for_each(|(i, item)| numbers_without_a_range(item, &format!("{path}/{i}"), found));
        }
        _ => (),
    }
}

#[test]
fn law_every_number_of_a_schema_has_its_range() {
    for kind in Kind::ALL {
        let mut found = Vec::new();
        numbers_without_a_range(schema(kind), kind.name(), &mut found);
        assert!(found.is_empty(), "{found:#?}");
    }
}

#[test]
fn exact_a_range_of_a_type_stands_in_the_schema() {
    let corpus = schema(Kind::Corpus);
    let rocks = &corpus["$defs"]["RocksParams"]["properties"]["aspect"];
    assert_eq!((rocks["minimum"].as_f64(), rocks["maximum"].as_f64()), (Some(0.05), Some(5.0)));
    assert_eq!(corpus["$defs"]["CellParams"]["properties"]["neighbours"]["enum"], serde_json::json!([4, 8, 24]));
    // A family may override one key of a part that needs more.
    assert!(corpus["$defs"]["BoxesParams"]["required"].is_array());
    assert!(corpus["$defs"]["BoxesParamsOverride"]["required"].is_null());
}
