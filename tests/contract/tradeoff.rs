//! The contract of `tradeoff`: four files, a table on stdout, talk on stderr; refusals with exit code 2.

use std::path::Path;

use crate::yard::{Yard, text};

fn config() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml").display().to_string()
}

#[test]
fn law_tradeoff_writes_its_files_and_names_the_cheapest() {
    let yard = Yard::new();
    let quick = ["--scenes", "8", "--seeds", "2", "--only", "cast,batch", "--max-loss", "1", "--threads", "2"];
    let output = yard.marsyard(["tradeoff", config().as_str()].iter().chain(&quick));
    assert!(output.status.success(), "{}", text(&output.stderr));
    let (told, talk) = (text(&output.stdout), text(&output.stderr));
    assert!(told.contains("cast: raster 0.1 m") && told.contains("batch: 8 rows"), "{told}");
    assert!(told.contains("cheapest pipeline that loses at most 100 points"), "{told}");
    assert!(told.contains("cheapest filter that loses at most 100 points"), "{told}");
    assert!(talk.contains("8 scenes at 7 settings"), "{talk}");
    let folder = yard.path("tradeoffs/training");
    for name in ["tradeoff.parquet", "tradeoff.json", "tradeoff.md", "tradeoff.svg"] {
        assert!(folder.join(name).is_file(), "{name}");
    }
    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("tradeoff.json")).expect("a report")).expect("JSON");
    let rows = json["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 7 + 3);
    assert!(rows.iter().all(|row| row["classifier"]["balanced_accuracy"].as_array().map(Vec::len) == Some(2)));
    // No path, host or time of day.
    let folder = yard.path("").display().to_string();
    assert!(!json.to_string().contains(folder.trim_end_matches('/')));
}

#[test]
fn law_tradeoff_refuses_what_it_cannot_measure() {
    let yard = Yard::new();
    for (extra, expected) in [
        (&["--only", "colour"][..], "possible values"),
        (&["--scenes", "3"], "8..=100000"),
        (&["--max-loss", "2"], "no share of balanced accuracy"),
        (&["--set", "slam.fastslam.particels=3"], "particles"),
    ] {
        let output = yard.marsyard(["tradeoff", config().as_str()].iter().chain(extra));
        assert_eq!(output.status.code(), Some(2), "{extra:?}");
        let said = text(&output.stderr);
        assert!(said.contains(expected), "{extra:?}: {said}");
    }
    assert!(!yard.path("tradeoffs").exists());
}
