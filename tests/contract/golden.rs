//! Corpora of last month: their ids are pinned, so that no change of a program moves a value unseen.
//!
//! A change that means to move values mints the ids anew with `MARSYARD_MINT=1 cargo test --release --test contract golden`, and says
//! so in `CHANGELOG.md` under *Value-breaking*.

use std::collections::BTreeMap;
use std::path::Path;

use crate::yard::Yard;

/// Config, and what makes it small.
const CORPORA: [(&str, &str, &[&str]); 5] = [
    ("everything", "tests/fixtures/everything.yaml", &[]),
    ("paper", "configs/paper.yaml", &["--set", "scenes=14", "--set", "scenes_per_shard=2"]),
    ("rover", "tests/fixtures/everything.yaml", &["--set", "cells.labels={rover: {pose: true}}"]),
    ("drive", "tests/fixtures/everything.yaml", &["--set", "drive.over_bodies=true"]),
    ("mixed", "configs/mixed.yaml", &["--set", "scenes=21", "--set", "scenes_per_shard=3"]),
];

#[test]
fn golden_corpus_ids_are_those_of_the_last_minting() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let yard = Yard::new();
    let ids: BTreeMap<&str, String> = CORPORA
        .iter()
        .map(|(name, config, extra)| {
            yard.generate(&root.join(config), name, extra);
            let manifest = std::fs::read(yard.path(name).join("manifest.json")).expect("a manifest");
            let manifest: serde_json::Value = serde_json::from_slice(&manifest).expect("JSON");
            (*name, manifest["corpus_id"].as_str().expect("an id").to_string())
        })
        .collect();
    let golden = root.join("tests/contract/golden.json");
    let here = serde_json::to_string_pretty(&ids).expect("plain data") + "\n";
    if std::env::var_os("MARSYARD_MINT").is_some() {
        std::fs::write(&golden, &here).expect("a writable checkout");
    }
    let there = std::fs::read_to_string(&golden).expect("tests/contract/golden.json");
    assert_eq!(there, here, "values have moved; see the head of tests/contract/golden.rs");
}
