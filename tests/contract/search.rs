//! The contract of `search`: the same leaderboard for any number of threads and after any kill; what is refused is refused with the
//! cure.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::yard::{Yard, assert_same, stopped, text, wait_for};

fn with_corpus() -> Yard {
    let yard = Yard::new();
    let config: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml");
    yard.generate(&config, "corpus", &[]);
    yard
}

/// 12 networks on a few hundred rows.
const QUICK: [&str; 17] = [
    "search",
    "corpus",
    "--widths",
    "2",
    "3",
    "6",
    "--layers",
    "2",
    "--rows",
    "800",
    "--validation-rows",
    "300",
    "--rungs",
    "2",
    "--set",
    "validate_every=200",
    "--resume",
];

fn search(yard: &Yard, out: &str, extra: &[&str]) -> std::process::Output {
    yard.marsyard(QUICK.iter().chain(&["--out", out]).chain(extra))
}

/// The files whose bytes are promised; a search that was stopped may have left others.
fn promised(yard: &Yard, out: &str) -> BTreeMap<String, Vec<u8>> {
    let mut files = yard.search_identity(out);
    files.retain(|name, _| !name.contains(".marsyard-tmp-"));
    files
}

#[test]
fn law_search_writes_a_leaderboard_and_a_config_that_trains() {
    let yard = with_corpus();
    let output = yard.marsyard(QUICK);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let run = yard.path("runs/training-search-1");
    for name in "search.jsonl search.json search.svg train.yaml report.json".split(' ') {
        assert!(run.join(name).is_file(), "{name}");
    }
    let (table, told) = (text(&output.stdout), text(&output.stderr));
    assert!(table.contains("hidden layers") && table.lines().any(|line| line.starts_with("> ")), "{table}");
    assert!(told.contains("12 networks (12 x ") && told.contains("rows/s a thread"), "{told}");
    let board: serde_json::Value =
        serde_json::from_slice(&std::fs::read(run.join("search.json")).expect("a leaderboard")).expect("JSON");
    assert_eq!(board["networks"], 12);
    assert_eq!(board["begun_with"]["data"]["features"].as_array().map(Vec::len), Some(14));
    let config = run.join("train.yaml").display().to_string();
    let output = yard.marsyard(["train", "corpus", "--config", &config, "--set", "epochs=1", "--out", "trained"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let summary = std::fs::read(yard.path("trained/training.json")).expect("a summary");
    let summary: serde_json::Value = serde_json::from_slice(&summary).expect("JSON");
    assert_eq!(summary["config"]["network"]["hidden"], board["chosen"]["hidden"]);
}

#[test]
fn equal_leaderboards_for_any_thread_number_and_after_kills_and_resumes() {
    let yard = with_corpus();
    for (out, threads) in [("one", "1"), ("three", "3")] {
        let output = search(&yard, out, &["--threads", threads]);
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    assert_same(&promised(&yard, "one"), &promised(&yard, "three"));
    // Killed each time that its journal has grown, however fast the machine is.
    let journal = yard.path("killed/search.jsonl");
    let journal_bytes = || std::fs::metadata(&journal).map_or(0, |file| file.len());
    let mut kills = 0;
    loop {
        let before = journal_bytes();
        let mut command = yard.command(QUICK.iter().chain(&["--out", "killed"]));
        let quiet = std::process::Stdio::null;
        let mut child = command.stderr(quiet()).stdout(quiet()).spawn().expect("the binary starts");
        while child.try_wait().expect("a child to wait for").is_none() && journal_bytes() <= before {
            std::thread::sleep(Duration::from_millis(1));
        }
        // One that has ended cannot be killed any more, and says how it ended.
        child.kill().expect("a child to kill");
        let status = child.wait().expect("a child to wait for");
        if status.success() {
            break;
        }
        assert_eq!(status.code(), None, "a search failed by itself");
        kills += 1;
    }
    assert!(kills > 0, "no search was killed");
    assert_same(&promised(&yard, "one"), &promised(&yard, "killed"));
}

#[test]
fn law_an_interrupted_search_exits_75_and_says_how_to_go_on() {
    let yard = with_corpus();
    let long = ["--out", "run", "--epochs", "1000000", "--set", "patience=100000"];
    let mut command = yard.command(QUICK.iter().chain(&long));
    command.stderr(std::process::Stdio::piped()).stdout(std::process::Stdio::null());
    let mut child = command.spawn().expect("the binary starts");
    let journal = yard.path("run/search.jsonl");
    wait_for(&mut child, "journal", || journal.exists());
    let output = stopped(child, "-INT");
    assert!(text(&output.stderr).contains("--resume --out run"), "{}", text(&output.stderr));
}

#[test]
fn exact_faults_of_a_search_exit_2_with_the_cure() {
    let yard = with_corpus();
    assert!(search(&yard, "begun", &[]).status.success());
    for (arguments, says) in [
        (vec!["search", "corpus", "--widths", "0"], "0 is not in 1..=4096"),
        (vec!["search", "corpus", "--full", "--widths", "3"], "cannot be used with"),
        (vec!["search", "corpus", "--keep", "0"], "not a share in (0, 1]"),
        (vec!["search", "corpus", "--sample", "1e-9"], "give a larger share"),
        (vec!["search", "corpus", "--set", "networks.hidden=[3]"], "did you mean 'network'"),
        (vec!["search", "corpus", "--rows", "50"], "allow_few_rows"),
        (vec!["search", "corpus", "--rows", "0"], "'0' is no number of rows from 1 on"),
        (vec!["search", "--widths", "4", "16", "corpus"], "--widths 4 8 16 behind the corpus"),
        (
            vec!["search", "corpus", "--labels", "taller_than_m=50"],
            "are traversable: a network could only learn to say so",
        ),
        (vec!["search", "corpus", "--out", "begun"], "--resume"),
        (
            vec!["search", "corpus", "--widths", "2,3,6", "--layers", "2", "--out", "begun", "--resume"],
            "'data.rows' was 800 and is 20000 now",
        ),
    ] {
        let output = yard.marsyard(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", text(&output.stderr));
        assert!(text(&output.stderr).replace("\n  │ ", " ").contains(says), "{arguments:?}: {}", text(&output.stderr));
    }
    assert!(!yard.path("runs").exists(), "nothing was written");
}
