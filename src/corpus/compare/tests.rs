use serde_json::json;

use super::*;
use crate::corpus::tests::fixture::{corpus, spec};

fn side<'a>(at: &'a str, plan: &'a Json, hash: &'a str, corpus: &'a Finished) -> Side<'a> {
    Side { at, plan, scene_plan_hash: hash, corpus: Some(corpus) }
}

fn range(mean: f64, sd: f64) -> Option<FeatureRange> {
    let (min, max) = (Some(mean - sd), Some(mean + sd));
    let (name, unit) = ("height_m".to_string(), "m".to_string());
    Some(FeatureRange { name, unit, count: 9, not_finite: 0, mean: Some(mean), sd: Some(sd), min, max, fault: None })
}

/// A corpus of four shards and the same again, to be changed; the folder lives as long as both.
fn opened_twice() -> (tempfile::TempDir, Finished, Finished) {
    let (dir, store, _) = corpus(&spec(8, &[Table::Cells]));
    let open = || Finished::open(&store).unwrap();
    (dir, open(), open())
}

#[test]
fn exact_a_corpus_equals_itself_and_is_extended_by_more_scenes() {
    let (few, more) = (spec(4, &[Table::Cells]), spec(8, &[Table::Cells]));
    let ((_few, few_store, _), (_more, more_store, _)) = (corpus(&few), corpus(&more));
    let (few, more) = (Finished::open(&few_store).unwrap(), Finished::open(&more_store).unwrap());
    let (plan, grown) = (json!({"scenes": 4}), json!({"scenes": 8}));
    let same = compare(side("a", &plan, "h", &few), side("b", &plan, "h", &few));
    assert!(same.is_equal && same.relation == Relation::Same && same.keys.is_empty(), "{same}");
    let extended = compare(side("a", &plan, "h", &few), side("b", &grown, "h", &more));
    assert!(!extended.is_equal && extended.relation == Relation::BExtendsA, "{extended}");
    assert_eq!(extended.keys[0].key, "scenes");
    let rows = extended.rows.as_ref().unwrap();
    assert_eq!((rows.shards_equal, rows.shards_other.as_str()), (2, ""));
    assert!(extended.to_string().contains("all 2 shards of A are in B with the same values, and 2 more"), "{extended}");
    let back = compare(side("b", &grown, "h", &more), side("a", &plan, "h", &few));
    assert_eq!(back.relation, Relation::AExtendsB);
    let other = compare(side("a", &plan, "h", &few), side("b", &grown, "other", &more));
    assert_eq!(other.relation, Relation::Other);
}

#[test]
fn exact_shards_of_other_values_are_named() {
    let (_dir, there, mut other) = opened_twice();
    for shard in [1, 2] {
        other.lines[shard].tables.get_mut(&Table::Cells).unwrap().value_hash = "00".repeat(32);
    }
    other.manifest.corpus_id = "11".repeat(32);
    let plan = json!({});
    let found = compare(side("a", &plan, "h", &there), side("b", &plan, "h", &other));
    assert_eq!(found.relation, Relation::SamePlanOtherRows);
    assert_eq!(found.rows.as_ref().unwrap().shards_other, "1..3");
    assert!(found.to_string().contains("shards 1..3 hold other values"), "{found}");
}

#[test]
fn exact_corpora_of_equal_rows_differ_where_other_programs_wrote_some_of_their_shards() {
    let (_dir, there, mut other) = opened_twice();
    let build = Build { version: "0.0.7".into(), ..other.manifest.build.clone() };
    other.manifest.other_builds = vec![OtherBuild { shards: "1..3".into(), build }];
    let plan = json!({});
    let found = compare(side("a", &plan, "h", &there), side("b", &plan, "h", &other));
    assert!(!found.is_equal && found.relation == Relation::Same, "{found}");
    let said = found.to_string();
    assert!(
        said.contains("what differs stands below") && said.contains("  A  none\n  B  shards 1..3: 0.0.7"),
        "{said}"
    );
}

#[test]
fn exact_a_plan_is_compared_by_its_keys_alone() {
    let (a, b) = (json!({"seed": 1, "cells": {"size_m": 0.1}}), json!({"seed": 1, "cells": {"size_m": 0.2}}));
    let side = |plan, scene_plan_hash| Side { at: "x", plan, scene_plan_hash, corpus: None };
    let same = compare(side(&a, "h"), side(&a, "h"));
    assert!(same.is_equal && same.relation == Relation::SamePlan && same.rows.is_none());
    let found = compare(side(&a, "h"), side(&b, "g"));
    assert!(!found.is_equal && found.relation == Relation::Other);
    assert!(found.to_string().contains("cells.size_m") && found.to_string().contains("0.1 -> 0.2"), "{found}");
}

#[test]
fn exact_standardised_differences() {
    let moved = FeatureComparison::of("x", range(1.0, 3.0), range(3.0, 4.0));
    // sqrt((9 + 16) / 2) is 3.5355.
    assert!((moved.standardised_difference.unwrap() - 2.0 / 12.5_f64.sqrt()).abs() < 1e-15);
    assert!(moved.has_moved() && (moved.sd_ratio.unwrap() - 4.0 / 3.0).abs() < 1e-15);
    assert!(!FeatureComparison::of("x", range(1.0, 1.0), range(1.09, 1.0)).has_moved());
    // Constant in both: equal, or apart by no number of standard deviations.
    let constant = FeatureComparison::of("x", range(2.0, 0.0), range(2.0, 0.0));
    assert!(constant.standardised_difference == Some(0.0) && !constant.has_moved());
    let apart = FeatureComparison::of("x", range(2.0, 0.0), range(3.0, 0.0));
    assert!(apart.standardised_difference.is_none() && apart.sd_ratio.is_none() && apart.has_moved());
    assert!(FeatureComparison::of("x", range(1.0, 1.0), None).has_moved());
}
