//! Bad input: each fault names the file and the cure, and nothing is learnt from it.

use super::fixture::{circle, circles, corpus, params, run, setup, sources};
use crate::cells::Label;
use crate::config::load_train;
use crate::train::{Setup, TrainError, TrainParams};

fn with(sets: &[&str]) -> TrainParams {
    load_train(None, &sets.iter().map(|set| (*set).to_string()).collect::<Vec<_>>()).unwrap()
}

/// What a training on the corpus says, which must be a fault.
fn fault(place: &std::path::Path, params: &TrainParams) -> String {
    let out = place.with_extension("run");
    let told = setup(&[place.to_owned()], params, out.clone()).and_then(|setup| run(&setup));
    let _ = std::fs::remove_dir_all(out);
    told.expect_err("a fault").to_string()
}

fn shard(place: &std::path::Path) -> std::path::PathBuf {
    place.join("data/cells/train-0000001.parquet")
}

#[test]
fn extreme_damaged_and_foreign_files_are_named_with_the_cure() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 300);
    let whole = std::fs::read(shard(&place)).unwrap();
    let told_after = |bytes: Option<&[u8]>| {
        match bytes {
            Some(bytes) => std::fs::write(shard(&place), bytes).unwrap(),
            None => std::fs::remove_file(shard(&place)).unwrap(),
        }
        let told = fault(&place, &params());
        assert!(told.contains("train-0000001.parquet") && told.contains("marsyard verify"), "{told}");
        told
    };
    assert!(told_after(Some(&whole[..whole.len() / 2])).contains("shards.jsonl says"));
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 1;
    assert!(told_after(Some(&flipped)).contains("sha256"));
    assert!(told_after(Some(&vec![7; whole.len()])).contains("sha256"));
    assert!(told_after(None).contains("it is missing"));
    std::fs::write(shard(&place), &whole).unwrap();
    run(&setup(std::slice::from_ref(&place), &params(), dir.path().join("run")).unwrap()).unwrap();
}

#[test]
fn extreme_foreign_files_with_a_matching_hash_are_refused_by_what_they_say() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 300);
    // A corpus whose books were cooked: the line of shards.jsonl is that of another file.
    let other = std::fs::read(place.join("data/cells/train-0000002.parquet")).unwrap();
    let garbage = vec![b'x'; 1000];
    for (bytes, says) in [(&other, "its own marsyard.shard is '2', not '1'"), (&garbage, "cannot be read as Parquet")] {
        std::fs::write(shard(&place), bytes).unwrap();
        let lines = std::fs::read_to_string(place.join("shards.jsonl")).unwrap();
        let mut lines: Vec<serde_json::Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        lines[1]["tables"]["cells"]["bytes"] = bytes.len().into();
        lines[1]["tables"]["cells"]["sha256"] = crate::corpus::sha256(bytes).into();
        let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
        std::fs::write(place.join("shards.jsonl"), text).unwrap();
        crate::corpus::tests::books::mend(&place);
        let setup =
            setup(std::slice::from_ref(&place), &params(), dir.path().join(format!("run-{}", bytes.len()))).unwrap();
        let told = run(&setup).unwrap_err().to_string();
        assert!(told.contains(says), "{told}");
    }
}

#[test]
fn extreme_corpora_that_are_none_or_of_another_format_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    assert!(fault(&dir.path().join("nowhere"), &params()).contains("no manifest, nor a plan"));
    let place = circles(&dir, "a", 100);
    let manifest = place.join("manifest.json");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, text.replacen("\"format\": 2", "\"format\": 9", 1)).unwrap();
    assert!(fault(&place, &params()).contains("written in format 9, this program reads formats 1 to 2"));
}

#[test]
fn extreme_features_that_are_not_there_or_not_the_same_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 100);
    let told = fault(&place, &with(&["features={columns: [mean_height_m, slope]}"]));
    assert!(told.contains("no feature 'slope'") && told.contains("mean_height_m height_difference_m"), "{told}");
    let told = fault(&place, &with(&["features={columns: [mean_height_m, mean_height_m]}"]));
    assert!(told.contains("named twice"), "{told}");
    let twice = sources(&[place.clone(), place], &params()).err().unwrap();
    assert!(matches!(twice, TrainError::Twice { .. }));
}

#[test]
fn extreme_too_few_rows_and_empty_splits_are_refused_with_the_cure() {
    let dir = tempfile::tempdir().unwrap();
    let few = corpus(&dir, "few", &(0..7).map(|shard| circle(shard, 10)).collect::<Vec<_>>());
    let told = fault(&few, &with(&["features=all"]));
    assert!(told.contains("50 rows to learn for 4673 weights") && told.contains("allow_few_rows"), "{told}");
    let bare =
        |shard| circle(shard, 100).into_iter().map(|(_, row)| (Some(Label::Traversable), row)).collect::<Vec<_>>();
    let told = fault(&corpus(&dir, "bare", &(0..7).map(bare).collect::<Vec<_>>()), &params());
    assert!(told.contains("all 500 rows to learn are traversable") && told.contains("allow_one_class"), "{told}");
    let no_validation = corpus(&dir, "three", &(0..3).map(|shard| circle(shard, 300)).collect::<Vec<_>>());
    let told = fault(&no_validation, &params());
    assert!(told.contains("the validation split holds no row") && told.contains("7 shards"), "{told}");
    let unknown = |shard: u64| circle(shard, 50).into_iter().map(|(_, row)| (None, row)).collect::<Vec<_>>();
    let unlabelled = corpus(&dir, "unlabelled", &(0..7).map(unknown).collect::<Vec<_>>());
    assert!(fault(&unlabelled, &params()).contains("the train split holds no row with a label"));
}

#[test]
fn law_a_run_folder_is_never_overwritten_and_never_mixed() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 200);
    let out = dir.path().join("run");
    let first = setup(std::slice::from_ref(&place), &params(), out.clone()).unwrap();
    super::fixture::run_until(&first, 600, false);
    let told = run(&first).unwrap_err().to_string();
    assert!(told.contains("is there already") && told.contains("--resume"), "{told}");
    let other = with(&["network.hidden=[4]", "features=all", "epochs=4", "validate_every=300"]);
    let other = Setup { resume: true, ..setup(std::slice::from_ref(&place), &other, out.clone()).unwrap() };
    assert!(run(&other).unwrap_err().to_string().contains("the config is another one"));
    let elsewhere = circles(&dir, "b", 210);
    let other = Setup { resume: true, ..setup(&[elsewhere], &params(), out).unwrap() };
    assert!(run(&other).unwrap_err().to_string().contains("the corpora, or their weights, are others"));
    let foreign = dir.path().join("foreign");
    std::fs::create_dir(&foreign).unwrap();
    std::fs::write(foreign.join("thesis.tex"), "").unwrap();
    let other = Setup { resume: true, ..setup(&[place], &params(), foreign).unwrap() };
    assert!(run(&other).unwrap_err().to_string().contains("no run folder"));
}
