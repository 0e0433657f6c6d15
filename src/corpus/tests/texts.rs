//! The texts that others read: card, Croissant, key-values. Their readers' own checks run in `scripts/interop`.

use super::fixture::{corpus, spec};
use crate::corpus::reader::TableFile;
use crate::corpus::{CorpusSpec, Store, Table, card, schema};

#[test]
fn golden_card_of_a_tiny_corpus() {
    let spec = spec(14, &[Table::Cells, Table::Scenes]);
    let (_dir, store, manifest) = corpus(&spec);
    let card = card::text(&spec, &manifest);
    assert_eq!(store.read("README.md").unwrap(), card.as_bytes());
    // No config may have such a name, and it would harm nothing.
    let spec = CorpusSpec { name: "tiny: \"a\" corpus".into(), ..spec };
    let card = card::text(&spec, &manifest);
    let card = card.replace(&manifest.corpus_id, "(corpus id)");
    insta::assert_snapshot!(card);
}

#[test]
fn equal_front_matter_and_columns() {
    let spec = spec(2, &Table::ALL);
    let (_dir, store, _) = corpus(&spec);
    let card = String::from_utf8(store.read("README.md").unwrap()).unwrap();
    let yaml = card.strip_prefix("---\n").unwrap().split_once("\n---\n").unwrap().0;
    let front: serde_json::Value = serde_saphyr::from_str(yaml).unwrap();
    assert_eq!(front["configs"].as_array().unwrap().len(), 4);
    // Two scenes are one shard: only the train split has files, and loaders refuse empty patterns.
    assert_eq!(front["configs"][0]["data_files"].as_array().unwrap().len(), 1);
    for (info, table) in front["dataset_info"].as_array().unwrap().iter().zip(Table::ALL) {
        let names: Vec<&str> =
            info["features"].as_array().unwrap().iter().map(|f| f["name"].as_str().unwrap()).collect();
        let columns = spec.columns(table);
        assert_eq!(names, columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>());
    }
    assert_eq!(front["dataset_info"][0]["features"][4]["dtype"]["class_label"]["names"]["1"], "untraversable");
}

#[test]
fn equal_croissant_fields_and_columns() {
    let spec = spec(2, &Table::ALL);
    let (_dir, store, manifest) = corpus(&spec);
    let document: serde_json::Value = serde_json::from_slice(&store.read("croissant.json").unwrap()).unwrap();
    for (records, table) in document["recordSet"].as_array().unwrap().iter().zip(Table::ALL) {
        let fields = records["field"].as_array().unwrap();
        assert_eq!(fields.len(), spec.columns(table).len());
    }
    assert!(document["citeAs"].as_str().unwrap().contains(&manifest.corpus_id));
}

#[test]
fn exact_key_values_are_sorted_and_hold_no_time_host_or_path() {
    let spec = spec(2, &[Table::Cells]);
    let (_dir, store, _) = corpus(&spec);
    let file = TableFile::open(&store, &Table::Cells.path(0)).unwrap();
    let pairs = file.key_values();
    let keys: Vec<&str> = pairs.keys().map(String::as_str).collect();
    let expected = ["columns", "format", "scene_plan_hash", "scenes", "shard", "split", "table"];
    assert_eq!(keys, expected.map(|key| format!("marsyard.{key}")));
    assert_eq!((pairs["marsyard.scenes"].as_str(), pairs["marsyard.split"].as_str()), ("0..2", "train"));
    let columns: Vec<schema::Column> = serde_json::from_str(&pairs["marsyard.columns"]).unwrap();
    assert_eq!(columns, spec.columns(Table::Cells));
    assert_eq!(file.schema().fields(), schema::arrow_schema(&columns).fields());
}
