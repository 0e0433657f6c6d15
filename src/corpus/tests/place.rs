//! A place through its life: empty, half built, finished, grown, someone else's.

use std::fs;

use super::fixture::{corpus, spec, write_shard};
use crate::cells::Label;
use crate::corpus::advice::{Content, advise};
use crate::corpus::plan_difference::difference;
use crate::corpus::{
    CorpusError, LocalFolder, Manifest, Place, ShardWriter, Split, Store, Table, finalize, inspect, status, verify,
};
use crate::episode::SceneOutput;
use crate::random::Drawn;

fn place() -> (tempfile::TempDir, LocalFolder) {
    let dir = tempfile::tempdir().unwrap();
    let store = LocalFolder::new(dir.path().join("tiny"));
    (dir, store)
}

/// The files of a place, by name.
fn bytes_of(store: &LocalFolder) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for folder in ["receipts", "data/cells", "data/scenes", "data/poses", "data/points"] {
        files.extend(store.list(folder).unwrap().into_iter().map(|(name, _)| name));
    }
    files.extend(["README.md", "croissant.json", "manifest.json", "shards.jsonl", "plan.yaml"].map(String::from));
    files.into_iter().map(|name| (name.clone(), store.read(&name).unwrap())).collect()
}

#[test]
fn equal_bytes_in_any_order_of_shards_and_when_made_twice() {
    let spec = spec(16, &Table::ALL);
    let (_a, forward, _) = corpus(&spec);
    let (_b, backward) = place();
    Place::open(&backward, &spec).unwrap();
    for shard in (0..8).rev().chain([3, 5]) {
        write_shard(&spec, shard).commit(&backward).unwrap();
    }
    finalize(&backward, &spec).unwrap();
    assert_eq!(bytes_of(&forward), bytes_of(&backward));
}

#[test]
fn exact_status_names_what_is_missing_as_ranges_and_finalize_refuses_it() {
    let spec = spec(16, &[Table::Cells, Table::Scenes]);
    let (_dir, store) = place();
    let place = Place::open(&store, &spec).unwrap();
    for shard in [0, 1, 2, 7] {
        write_shard(&spec, shard).commit(&store).unwrap();
    }
    let found = status(&store, &spec).unwrap();
    assert_eq!((found.done.clone(), found.missing.clone()), (vec![0, 1, 2, 7], vec![3, 4, 5, 6]));
    let text = found.to_string();
    assert!(text.contains("0..3,7") && text.contains("3..7"), "{text}");
    assert!(place.is_done(7).unwrap() && !place.is_done(6).unwrap());
    let refused = finalize(&store, &spec).unwrap_err().to_string();
    assert!(refused.contains("4 of 8 shards are missing or damaged (3..7)"), "{refused}");
    assert!(store.size("manifest.json").unwrap().is_none());
}

#[test]
fn law_a_shard_without_its_receipt_is_not_there_and_is_made_again() {
    let spec = spec(2, &Table::ALL);
    let (_dir, store) = place();
    let place = Place::open(&store, &spec).unwrap();
    let shard = write_shard(&spec, 0);
    // Killed between the second table and the third.
    for (name, bytes) in &shard.files[..2] {
        store.put(name, bytes).unwrap();
    }
    fs::write(format!("{}/data/cells/.marsyard-tmp-1-half", store.place()), b"PAR1 half").unwrap();
    assert!(!place.is_done(0).unwrap());
    shard.commit(&store).unwrap();
    assert!(place.is_done(0).unwrap());
    finalize(&store, &spec).unwrap();
    assert!(verify::verify(&store, &spec, None).unwrap().is_empty());
    assert_eq!(fs::read_dir(format!("{}/data/cells", store.place())).unwrap().count(), 1);
}

#[test]
fn law_raising_scenes_only_adds_shards() {
    let (_dir, store, small) = corpus(&spec(4, &Table::ALL));
    let before = store.read(&Table::Cells.path(1)).unwrap();
    let grown = spec(8, &Table::ALL);
    Place::open(&store, &grown).unwrap();
    let found = status(&store, &grown).unwrap();
    assert_eq!((found.done, found.missing), (vec![0, 1], vec![2, 3]));
    for shard in 2..4 {
        write_shard(&grown, shard).commit(&store).unwrap();
    }
    let manifest = finalize(&store, &grown).unwrap();
    assert_eq!(store.read(&Table::Cells.path(1)).unwrap(), before);
    assert_ne!(manifest.corpus_id, small.corpus_id);
    assert!(String::from_utf8(store.read("plan.yaml").unwrap()).unwrap().contains("scenes: 8"));
    let (_fresh_dir, fresh, _) = corpus(&grown);
    assert_eq!(bytes_of(&store), bytes_of(&fresh));
    let shrunk = Place::open(&store, &spec(4, &Table::ALL)).err().unwrap().to_string();
    assert!(shrunk.contains("holds shard 2, but the plan ends before shard 2"), "{shrunk}");
}

#[test]
fn exact_another_plan_is_refused_with_the_keys_that_differ() {
    let ours = spec(4, &[Table::Cells]);
    let (_dir, store, _) = corpus(&ours);
    let mut other = ours.clone();
    other.scene_plan_hash = "cd".repeat(32);
    other.plan_yaml = "marsyard: 1\nname: other\nseed: 42\nscenes: 8\nscene:\n  extent_m: 30.0\n".into();
    let refused = Place::open(&store, &other).err().unwrap().to_string();
    assert!(refused.contains("- scene.extent_m: 20.0\n  + scene.extent_m: 30.0"), "{refused}");
    assert!(!refused.contains("scenes: 8") && refused.contains("another corpus"), "{refused}");
    fs::write(format!("{}/plan.yaml", store.place()), "seed: 1\n").unwrap();
    assert!(matches!(Place::open(&store, &ours), Err(CorpusError::ForeignPlan { .. })));
}

#[test]
fn exact_differences_name_added_and_lost_keys() {
    let text = difference("a: {b: 1}\nlist: [1, 2]\n", "a: {c: 1}\nlist: [1, 3]\nfamilies: [{name: x}]\n");
    let expected = ["  - a.b: 1", "  + a.c: 1", "  + families.0.name: \"x\"", "  - list: [1,2]", "  + list: [1,3]"];
    assert_eq!(text, expected.join("\n"));
}

#[test]
fn equal_manifest_written_and_read_back_and_its_sums() {
    let spec = spec(14, &Table::ALL);
    let (_dir, store, manifest) = corpus(&spec);
    assert_eq!(Manifest::read(&store).unwrap(), manifest);
    assert_eq!(manifest.tables[&Table::Cells].rows, 14 * 80);
    assert_eq!(manifest.splits.values().map(|s| s.shards).collect::<Vec<_>>(), [5, 1, 1]);
    // Statistics are the train split's alone.
    assert_eq!(manifest.features[0].moments.count, 5 * 2 * 80);
    assert_eq!(manifest.labels().total(), 14 * 80);
    assert_eq!(manifest.splits[&Split::Test].rows[&Table::Scenes], 2);
    assert!(manifest.other_builds.is_empty() && manifest.build.sources_sha256.len() == 64);
}

#[test]
fn exact_failed_scenes_are_listed_with_the_command_that_replays_them() {
    let spec = spec(4, &Table::ALL);
    let (_dir, store) = place();
    Place::open(&store, &spec).unwrap();
    write_shard(&spec, 0).commit(&store).unwrap();
    let mut writer = ShardWriter::new(&spec, 1).unwrap();
    writer.push(&super::fixture::scene(2, 40)).unwrap();
    writer.push(&SceneOutput::failed(3, "default", 2, Drawn::default(), "drive: no place to start".into())).unwrap();
    writer.finish().unwrap().commit(&store).unwrap();
    let found = status(&store, &spec).unwrap();
    assert_eq!((found.failed_scenes, found.with_failed_scenes.clone(), found.to_build()), (1, vec![1], vec![]));
    let manifest = finalize(&store, &spec).unwrap();
    assert_eq!(manifest.failed.len(), 1);
    assert_eq!(
        (manifest.failed[0].scene, manifest.failed[0].replay.as_str()),
        (3, "marsyard explain plan.yaml --scene 3")
    );
    assert_eq!(manifest.splits[&Split::Train].failed_scenes, 1);
    let said = inspect(&store).unwrap().to_string();
    assert!(said.contains("1 of 4 scenes failed; replay: marsyard explain plan.yaml --scene 3"), "{said}");
    assert!(verify::verify(&store, &spec, None).unwrap().is_empty());
}

#[test]
fn law_shards_of_another_program_are_named_in_the_manifest() {
    let spec = spec(8, &[Table::Cells]);
    let (_dir, store) = place();
    Place::open(&store, &spec).unwrap();
    for shard in 0..4 {
        let mut finished = write_shard(&spec, shard);
        if shard >= 2 {
            finished.receipt.build.version = "9.9.9".into();
        }
        finished.commit(&store).unwrap();
    }
    let manifest = finalize(&store, &spec).unwrap();
    assert_eq!(manifest.other_builds.len(), 1);
    assert_eq!(
        (manifest.other_builds[0].shards.as_str(), manifest.other_builds[0].build.version.as_str()),
        ("2..4", "9.9.9")
    );
    // The same shard by this program again: the same values, so nothing to refuse.
    write_shard(&spec, 3).commit(&store).unwrap();
}

#[test]
fn exact_inspection_finds_constant_features_and_empty_splits() {
    let mut spec = spec(2, &Table::ALL);
    spec.features.truncate(1);
    let (_dir, store) = place();
    Place::open(&store, &spec).unwrap();
    let mut writer = ShardWriter::new(&spec, 0).unwrap();
    for id in 0..2 {
        let mut scene = super::fixture::scene(id, 8);
        scene.scans.iter_mut().for_each(|scan| scan.cells.features = vec![0.5; 8]);
        writer.push(&scene).unwrap();
    }
    writer.finish().unwrap().commit(&store).unwrap();
    finalize(&store, &spec).unwrap();
    let inspection = inspect(&store).unwrap();
    let warnings = inspection.warnings().join("\n");
    assert!(warnings.contains("mean_height_m is always 0.5"), "{warnings}");
    assert!(
        warnings.contains("the validation split is empty") && warnings.contains("the test split is empty"),
        "{warnings}"
    );
    assert_eq!(inspection.families["default"].with_both_classes, 2);
    insta::assert_snapshot!(inspection.to_string());
}

#[test]
fn exact_inspection_finds_a_split_of_one_class() {
    let spec = spec(2, &Table::ALL);
    for (label, is_told) in [(Some(Label::Traversable), true), (Some(Label::Untraversable), true), (None, true)] {
        let (_dir, store) = place();
        Place::open(&store, &spec).unwrap();
        let mut writer = ShardWriter::new(&spec, 0).unwrap();
        for id in 0..2 {
            let mut scene = super::fixture::scene(id, 8);
            scene.scans.iter_mut().flat_map(|scan| &mut scan.cells.rows).for_each(|row| row.label = label);
            writer.push(&scene).unwrap();
        }
        writer.finish().unwrap().commit(&store).unwrap();
        finalize(&store, &spec).unwrap();
        let warnings = inspect(&store).unwrap().warnings();
        let said = warnings.iter().any(|warning| warning == "the train split lacks one of the two classes");
        assert_eq!(said, is_told, "{label:?}: {warnings:?}");
    }
    let (_dir, store, _) = super::fixture::corpus(&spec);
    let warnings = inspect(&store).unwrap().warnings();
    assert!(!warnings.iter().any(|warning| warning.contains("lacks one")), "{warnings:?}");
}

#[test]
fn exact_a_corpus_gets_the_advice_that_its_scenes_got_before_they_were_written() {
    let mut spec = spec(14, &Table::ALL);
    spec.families = vec!["yard".into(), "unseen".into()];
    let mut contents = [Content::of("yard", false, 0), Content::of("unseen", true, 0)];
    let (_dir, store) = place();
    Place::open(&store, &spec).unwrap();
    for shard in 0..7 {
        let is_test = Split::of_shard(shard) == Split::Test;
        let content = &mut contents[usize::from(is_test)];
        let mut writer = ShardWriter::new(&spec, shard).unwrap();
        for id in 2 * shard..2 * shard + 2 {
            let mut scene = super::fixture::scene(id, if is_test { 16 } else { 8 });
            scene.family = content.family.as_str().into();
            scene.scans.iter_mut().flat_map(|scan| &mut scan.cells.rows).for_each(|row| row.points = 2);
            content.add(&scene);
            content.test_scenes += u64::from(is_test);
            writer.push(&scene).unwrap();
        }
        writer.finish().unwrap().commit(&store).unwrap();
    }
    finalize(&store, &spec).unwrap();
    let inspection = inspect(&store).unwrap();
    assert_eq!(inspection.advice, advise(&contents));
    let said = inspection.to_string();
    assert!(said.contains("by the cells of 7 of 7 shards:\nadvice: cells with 1 or 2 points: yard 100 %"), "{said}");
    assert!(said.contains("held-out families with too few test scenes to tell 1 point: unseen 2"), "{said}");
    assert!(
        said.contains("advice: cells of held-out families beyond 4 m, where no training family has any: unseen "),
        "{said}"
    );
}
