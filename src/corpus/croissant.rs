//! Manifest -> `croissant.json`: the corpus in the words of MLCommons Croissant 1.0, for catalogues and `mlcroissant`.
//!
//! Hashes of the single files stand in `shards.jsonl`; here each table is a set of files, so that the description does not
//! grow with the corpus.

use serde_json::{Value, json};

use super::schema::{self, Column};
use super::{CorpusSpec, Manifest, Table, card};

pub(crate) const NAME: &str = "croissant.json";
/// How it ends: behind the last field of the last record.
pub(crate) const END: &str = "          }\n        }\n      ]\n    }\n  ]\n}\n";

/// The description as JSON-LD text.
pub(crate) fn text(spec: &CorpusSpec, manifest: &Manifest) -> String {
    let files: Vec<Value> = spec.tables.iter().map(|&table| file_set(table)).collect();
    let records: Vec<Value> = spec.tables.iter().map(|&table| record_set(table, spec)).collect();
    let card = &spec.card;
    let mut document = json!({
        "@context": context(),
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": spec.name,
        "description": "Simulated lidar sweeps of random yards, as cells of a grid with features and labels: which ground can a rover cross?",
        "version": format!("{}.0.0", manifest.format),
        "keywords": ["lidar", "robotics", "traversability", "synthetic"],
        "citeAs": card::citation(spec, manifest),
        "distribution": files,
        "recordSet": records,
    });
    // What the config does not say is left out: a reader is told that it is missing, and gets no placeholder.
    let creators = || card.authors.iter().map(|name| json!({"@type": "sc:Person", "name": name})).collect();
    let stated = [
        ("license", card.license_url().or_else(|| card.license.clone()).map(Value::from)),
        ("creator", (!card.authors.is_empty()).then(creators)),
        ("url", card.url.clone().map(Value::from)),
        ("datePublished", card.date_published.clone().map(Value::from)),
    ];
    let entries = document.as_object_mut().expect("a mapping");
    for (key, value) in stated.into_iter().rev().filter_map(|(key, value)| Some((key, value?))) {
        // Behind the description: the file ends with its last record, by which it is known to be whole.
        entries.shift_insert(5, key.into(), value);
    }
    serde_json::to_string_pretty(&document).expect("plain JSON") + "\n"
}

fn file_set(table: Table) -> Value {
    json!({
        "@type": "cr:FileSet",
        "@id": format!("{}-files", table.name()),
        "name": format!("{}-files", table.name()),
        "description": format!("Parquet; one row is {}.", table.row_is()),
        "encodingFormat": "application/x-parquet",
        "includes": format!("data/{}/*.parquet", table.name()),
    })
}

fn record_set(table: Table, spec: &CorpusSpec) -> Value {
    let fields: Vec<Value> = spec.columns(table).iter().map(|column| field(table, column)).collect();
    json!({
        "@type": "cr:RecordSet",
        "@id": table.name(),
        "name": table.name(),
        "description": format!("One record is {}.", table.row_is()),
        "key": schema::sort_keys(table).iter().map(|key| json!({"@id": format!("{}/{key}", table.name())})).collect::<Vec<_>>(),
        "field": fields,
    })
}

fn field(table: Table, column: &Column) -> Value {
    let unit = if column.unit == "1" { String::new() } else { format!(" Unit: {}.", column.unit) };
    json!({
        "@type": "cr:Field",
        "@id": format!("{}/{}", table.name(), column.name),
        "name": column.name,
        "description": format!("{}{unit}", column.description),
        "dataType": column.kind.croissant(),
        "source": {"fileSet": {"@id": format!("{}-files", table.name())}, "extract": {"column": column.name}},
    })
}

/// The context that the Croissant specification prescribes.
fn context() -> Value {
    json!({
        "@language": "en",
        "@vocab": "https://schema.org/",
        "citeAs": "cr:citeAs",
        "column": "cr:column",
        "conformsTo": "dct:conformsTo",
        "cr": "http://mlcommons.org/croissant/",
        "data": {"@id": "cr:data", "@type": "@json"},
        "dataBiases": "cr:dataBiases",
        "dataCollection": "cr:dataCollection",
        "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
        "dct": "http://purl.org/dc/terms/",
        "equivalentProperty": "cr:equivalentProperty",
        "examples": {"@id": "cr:examples", "@type": "@json"},
        "extract": "cr:extract",
        "field": "cr:field",
        "fileObject": "cr:fileObject",
        "fileProperty": "cr:fileProperty",
        "fileSet": "cr:fileSet",
        "format": "cr:format",
        "includes": "cr:includes",
        "isLiveDataset": "cr:isLiveDataset",
        "jsonPath": "cr:jsonPath",
        "key": "cr:key",
        "md5": "cr:md5",
        "parentField": "cr:parentField",
        "path": "cr:path",
        "personalSensitiveInformation": "cr:personalSensitiveInformation",
        "rai": "http://mlcommons.org/croissant/RAI/",
        "recordSet": "cr:recordSet",
        "references": "cr:references",
        "regex": "cr:regex",
        "repeated": "cr:repeated",
        "replace": "cr:replace",
        "samplingRate": "cr:samplingRate",
        "sc": "https://schema.org/",
        "separator": "cr:separator",
        "source": "cr:source",
        "subField": "cr:subField",
        "transform": "cr:transform",
    })
}
