//! The contract of `tradeoff`: five files, a table on stdout, talk on stderr; refusals with exit code 2.

use std::path::Path;
use std::process::Output;

use crate::yard::{Yard, text};

fn config() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml").display().to_string()
}

/// A small measurement of the fixture's groups of settings, the best followed to so many times the scenes.
pub(crate) fn measured(yard: &Yard, only: &str, farther: &str, extra: &[&str]) -> Output {
    let config = config();
    let size = ["--scenes", "8", "--test-scenes", "4", "--seeds", "2", "--threads", "2"];
    let output =
        yard.marsyard(["tradeoff", &config, "--only", only, "--farther", farther].iter().chain(&size).chain(extra));
    assert!(output.status.success(), "{}", text(&output.stderr));
    output
}

#[test]
fn law_tradeoff_writes_its_files_and_recommends() {
    let yard = Yard::new();
    let output = measured(&yard, "cast,batch", "2", &[]);
    let (told, talk) = (text(&output.stdout), text(&output.stderr));
    assert!(told.contains("cast: raster 0.1 m") && told.contains("batch: 8 rows"), "{told}");
    assert!(told.contains("recommended pipeline: ") && told.contains("recommended filter: "), "{told}");
    assert!(told.contains("noise floor: other draws of the same config gain "), "{told}");
    assert!(talk.contains("8 scenes at 8 settings"), "{talk}");
    let folder = yard.path("tradeoffs/training");
    for name in ["tradeoff.parquet", "tradeoff.json", "tradeoff.md", "tradeoff.svg", "study.json"] {
        assert!(folder.join(name).is_file(), "{name}");
    }
    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("tradeoff.json")).expect("a report")).expect("JSON");
    let rows = json["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 8 + 3);
    assert!(rows.iter().all(|row| row["worth"]["curve"].as_array().map(Vec::len) == Some(4)));
    // 16 scenes beside 8, 4 and 2 of them, of the reference and of what is told better.
    assert_eq!(rows[0]["worth"]["farther"].as_array().map(Vec::len), Some(1));
    assert!(rows.iter().filter_map(|row| row["worth"]["farther"].as_array()).all(|sizes| sizes.len() == 1));
    assert!(told.contains("on more scenes"), "{told}");
    assert_eq!(json["test"][0]["scenes"], 4);
    // No path, host or time of day.
    let folder = yard.path("").display().to_string();
    assert!(!json.to_string().contains(folder.trim_end_matches('/')));
}

#[test]
fn law_rounds_end_by_what_was_asked_and_say_so() {
    let yard = Yard::new();
    // No second round fits in a thousandth of a minute.
    for (extra, words) in [
        (&["--resolve", "99"][..], "1 round, 2 trainings a size: resolved; "),
        (&["--resolve", "0.000001", "--minutes", "0.001"], "1 round, 2 trainings a size: the time was over; "),
        (&["--minutes", "0.001"], "1 round, 2 trainings a size: the time was over; "),
    ] {
        let output = measured(&yard, "contact", "1", extra);
        assert!(text(&output.stdout).contains(words), "{}", text(&output.stdout));
    }
}

#[test]
fn law_tradeoff_refuses_what_it_cannot_measure() {
    let yard = Yard::new();
    for (extra, expected) in [
        (&["--only", "colour"][..], "possible values"),
        (&["--resolve", "0"], "not a number above 0"),
        (&["--minutes", "soon"], "not a number above 0"),
        (&["--scenes", "3"], "8..=100000"),
        (&["--test-scenes", "1"], "2..=100000"),
        (&["--farther", "0"], "1..=1000"),
        (&["--set", "slam.fastslam.particels=3"], "particles"),
    ] {
        let output = yard.marsyard(["tradeoff", config().as_str()].iter().chain(extra));
        assert_eq!(output.status.code(), Some(2), "{extra:?}");
        let said = text(&output.stderr);
        assert!(said.contains(expected), "{extra:?}: {said}");
    }
    assert!(!yard.path("tradeoffs").exists());
}

#[test]
fn law_groups_of_which_the_config_has_nothing_are_refused_before_anything_is_measured() {
    let yard = Yard::new();
    let output = yard.marsyard(["tradeoff", &config(), "--only", "sub_rays"]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stdout));
    let said = text(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("of sub_rays the config has nothing that"), "{said}");
}
