//! What goes wrong on disks, and what is said of it.

use std::fs;

use super::fixture::{corpus, spec, write_shard};
use crate::cells::Label;
use crate::corpus::reader::TableFile;
use crate::corpus::rebuild::first_difference;
use crate::corpus::verify::verify;
use crate::corpus::{CorpusError, LocalFolder, Place, Receipt, ShardWriter, Store, Table, finalize, status};

fn path(store: &LocalFolder, name: &str) -> std::path::PathBuf {
    std::path::Path::new(&store.place()).join(name)
}

#[test]
fn extreme_bad_receipts_are_damaged_and_say_so() {
    let spec = spec(4, &[Table::Cells]);
    let (_dir, store, _) = corpus(&spec);
    let name = Receipt::path(1);
    let whole = String::from_utf8(store.read(&name).unwrap()).unwrap();
    let cases = [
        (whole[..whole.len() / 2].to_string(), "not a whole receipt"),
        (String::new(), "not a whole receipt"),
        ("{\"hello\": 1}".to_string(), "not a whole receipt"),
        (
            whole.replace(&"ab".repeat(32), &"cd".repeat(32)),
            "it belongs to another plan (scene_plan_hash cdcdcdcdcdcd, not abababababab)",
        ),
        (whole.replace("\"shard\": 1", "\"shard\": 0"), "it is the receipt of shard 0"),
        (whole.replace("data/cells/", "data/sells/"), "its split or paths"),
        (whole.replace("    2,\n    4\n", "    2,\n    5\n"), "it says scenes 2..5, where the plan has 2..4"),
        (
            whole.replace("\"failed\": []", "\"failed\": [{\"scene\": 9, \"error\": \"\"}]"),
            "it lists scene 9 as failed",
        ),
        // In falling order; one of them twice.
        (
            whole.replace(
                "\"failed\": []",
                "\"failed\": [{\"scene\": 3, \"error\": \"\"}, {\"scene\": 2, \"error\": \"\"}]",
            ),
            "its failed scenes do not ascend",
        ),
        (
            whole.replace(
                "\"failed\": []",
                "\"failed\": [{\"scene\": 2, \"error\": \"\"}, {\"scene\": 2, \"error\": \"\"}]",
            ),
            "its failed scenes do not ascend",
        ),
        (whole.replace("\"mean_height_m\"", "\"height_m\""), "its features are not those of the plan"),
    ];
    for (text, reason) in cases {
        fs::write(path(&store, &name), &text).unwrap();
        let found = status(&store, &spec).unwrap();
        assert_eq!((found.done.clone(), found.to_build()), (vec![0], vec![1]), "{reason}");
        let said = found.to_string();
        assert!(
            said.contains(reason) && said.contains("receipts/0000001.json") && said.contains("delete the file"),
            "{said}"
        );
        assert!(matches!(finalize(&store, &spec), Err(CorpusError::Gaps { missing: 1, .. })));
    }
}

#[test]
fn law_a_receipt_of_another_format_is_not_damage_and_is_left_alone() {
    let spec = spec(4, &[Table::Cells]);
    let (_dir, store, _) = corpus(&spec);
    let name = Receipt::path(1);
    let whole = String::from_utf8(store.read(&name).unwrap()).unwrap();
    // What a later format holds beside its number is not known.
    let later = whole.replace("\"format\": 2", "\"format\": 99").replace("\"split\"", "\"part\"");
    fs::write(path(&store, &name), &later).unwrap();
    let found = status(&store, &spec).unwrap();
    assert_eq!((found.done.clone(), found.to_build(), found.other_format.len()), (vec![0], vec![], 1));
    let said = found.to_string();
    assert!(
        said.contains("written in format 99, this program reads formats 1 to 2") && said.contains("other format"),
        "{said}"
    );
    assert!(matches!(finalize(&store, &spec), Err(CorpusError::Gaps { missing: 1, .. })));
    let findings = verify(&store, &spec, None).unwrap();
    assert!(findings.iter().all(|finding| finding.shard.is_none()) && findings.len() == 1, "{findings:?}");
}

#[test]
fn law_a_place_that_goes_away_is_noticed_and_not_made_again() {
    let spec = spec(4, &[Table::Cells]);
    let (dir, store, _) = corpus(&spec);
    let place = Place::open(&store, &spec).unwrap();
    place.commit(&write_shard(&spec, 1)).unwrap();
    let away = dir.path().join("away");
    fs::rename(store.place(), &away).unwrap();
    assert!(matches!(place.commit(&write_shard(&spec, 1)), Err(CorpusError::Vanished { .. })));
    assert!(!path(&store, "").exists());
    // Another corpus in its place is not the place either.
    let other = crate::corpus::CorpusSpec { scene_plan_hash: "cd".repeat(32), ..spec.clone() };
    Place::open(&store, &other).unwrap();
    assert!(matches!(place.commit(&write_shard(&spec, 1)), Err(CorpusError::Vanished { .. })));
}

#[test]
fn law_verify_finds_every_kind_of_damage_and_discard_cures_it() {
    let spec = spec(4, &Table::ALL);
    let (_dir, store, _) = corpus(&spec);
    assert_eq!(verify(&store, &spec, None).unwrap(), []);
    let cells = path(&store, &Table::Cells.path(1));
    let whole = fs::read(&cells).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 1;
    for (bytes, what) in [(&whole[..whole.len() - 9], "bytes, its receipt says"), (&flipped[..], "sha256")] {
        fs::write(&cells, bytes).unwrap();
        let findings = verify(&store, &spec, None).unwrap();
        assert!(findings.len() == 1 && findings[0].what.contains(what) && findings[0].shard == Some(1), "{findings:?}");
    }
    let refused = write_shard(&spec, 1).commit(&store).unwrap_err().to_string();
    assert!(refused.contains("is there already with other bytes") && refused.contains("delete it"), "{refused}");
    fs::remove_file(&cells).unwrap();
    assert!(verify(&store, &spec, None).unwrap()[0].to_string().contains("train-0000001.parquet: is missing"));
    Place::open(&store, &spec).unwrap().discard(1).unwrap();
    write_shard(&spec, 1).commit(&store).unwrap();
    assert_eq!(verify(&store, &spec, None).unwrap(), []);
}

#[test]
fn law_verify_sees_receipts_and_manifests_that_lie() {
    let spec = spec(4, &[Table::Cells]);
    let (_dir, store, _) = corpus(&spec);
    let edit = |name: &str, from: &str, to: &str| {
        let text = String::from_utf8(store.read(name).unwrap()).unwrap();
        assert!(text.contains(from), "{name} lacks {from}");
        fs::write(path(&store, name), text.replacen(from, to, 1)).unwrap();
        text
    };
    let said = || verify(&store, &spec, None).unwrap().iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    for (name, from, to, expected) in [
        (Receipt::path(0), "\"traversable\": 80", "\"traversable\": 81", "its labels are"),
        (Receipt::path(0), "\"rows\": 160", "\"rows\": 161", "has 160 rows, its receipt says 161"),
        (Receipt::path(0), "\"count\": 160", "\"count\": 159", "the statistics of mean_height_m"),
        (Receipt::path(0), "\"value_hash\": \"", "\"value_hash\": \"0", "its value hash is not the receipt's"),
        ("manifest.json".into(), "\"scenes\": 4", "\"scenes\": 5", "is not what the receipts add up to"),
        ("manifest.json".into(), "{", "[", "not a whole manifest"),
        ("shards.jsonl".into(), "train", "test", "shards.jsonl: its SHA-256 is not the manifest's"),
    ] {
        let whole = edit(&name, from, to);
        // With a manifest the receipt's hash alone would be told.
        let manifest = name.starts_with("receipts").then(|| store.read("manifest.json").unwrap());
        manifest.iter().for_each(|_| store.remove("manifest.json").unwrap());
        let text = said();
        manifest.iter().for_each(|bytes| store.replace("manifest.json", bytes).unwrap());
        assert!(text.contains(expected), "{name}: {text}");
        fs::write(path(&store, &name), whole).unwrap();
    }
    assert_eq!(said(), "");
}

#[test]
fn extreme_a_file_that_is_no_parquet_is_an_error_with_its_name() {
    let spec = spec(2, &[Table::Cells]);
    let (_dir, store, _) = corpus(&spec);
    let name = Table::Cells.path(0);
    let whole = store.read(&name).unwrap();
    for length in [0, 3, 8, whole.len() / 3, whole.len() - 1] {
        fs::write(path(&store, &name), &whole[..length]).unwrap();
        let error = TableFile::open(&store, &name).err().unwrap().to_string();
        assert!(error.contains(&name), "{length}: {error}");
    }
    assert!(TableFile::open(&store, "data/cells/none.parquet").is_err());
}

#[test]
fn exact_the_first_difference_of_two_tables_is_found() {
    let spec = spec(2, &[Table::Cells]);
    let dir = tempfile::tempdir().unwrap();
    let store = LocalFolder::new(dir.path());
    let write = |folder: &str, change: fn(&mut crate::episode::SceneOutput)| {
        let mut writer = crate::corpus::ShardWriter::new(&spec, 0).unwrap();
        for id in 0..2 {
            let mut scene = super::fixture::scene(id, 40);
            change(&mut scene);
            writer.push(&scene).unwrap();
        }
        let name = format!("{folder}/cells");
        store.put(&name, &writer.finish().unwrap().files[0].1).unwrap();
        TableFile::open(&store, &name).unwrap()
    };
    let base = write("base", |_| {});
    assert_eq!(first_difference(&base, &write("same", |_| {})).unwrap(), None);
    let changed = write("feature", |scene| {
        if scene.scene_id == 1 {
            scene.scans[0].cells.features[2 * 7 + 1] = 99.5;
            scene.scans[0].cells.rows[9].points = 1000;
        }
    });
    let found = first_difference(&base, &changed).unwrap().unwrap();
    assert_eq!((found.row, found.column.as_str(), found.here.as_str()), (87, "height_variance_m2", "99.5"));
    let label =
        first_difference(&base, &write("label", |scene| scene.scans[0].cells.rows[3].label = Some(Label::Traversable)))
            .unwrap()
            .unwrap();
    assert_eq!(
        (label.row, label.column.as_str(), label.there.as_str(), label.here.as_str()),
        (3, "label", "null", "0")
    );
    let shorter = write("shorter", |scene| drop(scene.scans.pop()));
    assert!(first_difference(&base, &shorter).unwrap().is_some());
}

#[test]
fn exact_a_shard_built_again_from_other_scenes_is_told_by_row_and_column() {
    let spec = spec(2, &[Table::Cells, Table::Scenes]);
    let (_dir, store, _) = corpus(&spec);
    let scenes = |change: fn(&mut crate::episode::SceneOutput)| {
        let of_shard = spec.scenes_of(0).map(|id| super::fixture::scene(id, 40));
        of_shard.map(|mut scene| (change(&mut scene), scene).1).collect::<Vec<_>>()
    };
    let compare = |scenes: &[crate::episode::SceneOutput]| {
        let mut again = ShardWriter::new(&spec, 0)?;
        scenes.iter().try_for_each(|scene| again.push(scene))?;
        crate::corpus::rebuild::compare(&store, &spec, again.finish()?)
    };
    let same = compare(&scenes(|_| {})).unwrap();
    assert!(same.is_empty(), "{same:?}");
    let other = compare(&scenes(|scene| scene.scans[0].cells.rows[5].points += 1)).unwrap();
    let said: Vec<String> = other.iter().map(ToString::to_string).collect();
    assert!(said[0].starts_with(&Table::Cells.path(0)) && said[0].contains("row 5, column points"), "{said:?}");
    assert!(said.last().unwrap().contains("is not the receipt"), "{said:?}");
}
