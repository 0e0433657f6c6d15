//! The types and columns -> `schemas/`: what the files that marsyard writes look like, for people and for validators.
//!
//! `NAME.schema.json` are JSON Schemas (draft 2020-12) of the JSON files; `NAME.columns.json` list a table's columns with
//! types, units and meanings (`cells` with its default features; `scenes` without the drawn values, which a config names).

use serde::Serialize;
use serde_json::Value;

use super::compare::Comparison;
use super::inspect::InspectionDocument;
use super::manifest::{Manifest, ShardLine};
use super::{Receipt, Table, schema};
use crate::cells::{CellParams, feature_columns};

/// File names within `schemas/` and their texts.
pub(crate) fn documents() -> Vec<(String, String)> {
    let types = [
        ("comparison", titled(schemars::schema_for!(Comparison), "what marsyard compare --json prints")),
        ("inspection", titled(schemars::schema_for!(InspectionDocument), "what marsyard inspect --json prints")),
        ("manifest", titled(schemars::schema_for!(Manifest), "manifest.json of a corpus")),
        ("receipt", titled(schemars::schema_for!(Receipt), "receipts/0000000.json of a corpus: one finished shard")),
        ("shards", titled(schemars::schema_for!(ShardLine), "a line of shards.jsonl of a corpus")),
    ];
    let features = feature_columns(&CellParams::default(), false);
    let tables = Table::ALL.map(|table| (table.name(), schema::document(table, &features, &[])));
    let named = |kind: &str, (name, document): (&str, Value)| {
        (format!("{name}.{kind}.json"), serde_json::to_string_pretty(&document).expect("plain JSON") + "\n")
    };
    types
        .into_iter()
        .map(|pair| named("schema", pair))
        .chain(tables.into_iter().map(|pair| named("columns", pair)))
        .collect()
}

/// A document as it is printed.
pub(crate) fn text(document: &impl Serialize) -> String {
    serde_json::to_string_pretty(document).expect("a document is plain data") + "\n"
}

fn titled(schema: schemars::Schema, title: &str) -> Value {
    let mut schema = schema.to_value();
    schema["title"] = title.into();
    schema
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `MARSYARD_WRITE_SCHEMAS=1 cargo test --lib corpus::documents` writes them anew.
    #[test]
    fn golden_schemas_on_disk_are_those_of_the_types() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas");
        for (name, text) in documents() {
            let path = folder.join(&name);
            if std::env::var_os("MARSYARD_WRITE_SCHEMAS").is_some() {
                std::fs::create_dir_all(&folder).unwrap();
                std::fs::write(&path, &text).unwrap();
            }
            let there = std::fs::read_to_string(&path).unwrap_or_default();
            assert_eq!(there, text, "schemas/{name}: write it anew with MARSYARD_WRITE_SCHEMAS=1");
        }
    }
}
