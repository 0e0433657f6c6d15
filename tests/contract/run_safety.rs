//! The contract of run folders: whatever a kill, a power cut, a lost file or a flipped bit leaves of a training or a search, the
//! same command with `--resume` either goes on to the bits of an undisturbed run, or says what is wrong and what to do. Two never
//! write in one folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::time::Duration;

use serde_json::Value as Json;

use crate::yard::{Yard, assert_same, stopped, text, wait_for};

const CHECKPOINT: &str = "run/checkpoint.safetensors";
/// What a killed writer leaves.
const TEMPORARY: &str = ".marsyard-tmp-4711-x1";

/// Seven shards of one scene.
fn with_corpus() -> Yard {
    let yard = Yard::new();
    let config: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml");
    yard.generate(&config, "corpus", &["--set", "scenes=7", "--set", "scenes_per_shard=1"]);
    yard
}

const QUICK: [&str; 8] =
    ["--set", "network.hidden=[4]", "--set", "epochs=3", "--set", "validate_every=400", "--set", "patience=1000"];

fn train(yard: &Yard, out: &str, extra: &[&str]) -> Output {
    yard.marsyard(["train", "corpus", "--out", out].iter().chain(&QUICK).chain(extra))
}

fn trained(yard: &Yard, out: &str, extra: &[&str]) {
    let output = train(yard, out, extra);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// A training that goes on for minutes, in the folder `run`, and has its first checkpoint.
fn long(yard: &Yard, extra: &[&str]) -> Child {
    let mut begun = begin(yard, &[&LONG, extra].concat());
    wait_for(&mut begun, "checkpoint", || yard.path(CHECKPOINT).exists());
    begun
}

const LONG: [&str; 4] = ["--set", "epochs=100000", "--set", "patience=100000"];

fn begin(yard: &Yard, extra: &[&str]) -> Child {
    let mut command = yard.command(["train", "corpus", "--out", "run"].iter().chain(&QUICK).chain(extra));
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the binary starts")
}

fn killed(mut child: Child) {
    child.kill().expect("a child to kill");
    child.wait().expect("a child to wait for");
}

/// All files of a run; times are taken out of the log, and what is not promised is left out.
fn promised(yard: &Yard, out: &str) -> BTreeMap<String, Vec<u8>> {
    let mut files = yard.identity(out);
    let log = files.get_mut("training.jsonl").expect("training.jsonl");
    let timeless = |line: &str| line.split(",\"elapsed_s\"").next().unwrap_or_default().to_owned() + "\n";
    *log = text(log).lines().map(timeless).collect::<String>().into_bytes();
    files
}

/// What was said, in one line.
fn told(output: &Output) -> String {
    text(&output.stderr).replace(['\n', '│'], " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

fn flip(path: &Path, at: usize) {
    let mut bytes = std::fs::read(path).expect("a file to break");
    let at = at.min(bytes.len() - 1);
    bytes[at] ^= 1;
    std::fs::write(path, bytes).expect("a file");
}

#[test]
fn equal_bits_after_a_log_that_was_damaged_in_six_ways() {
    let yard = with_corpus();
    // Slow enough to be interrupted, and to the bits of one that was not.
    let sets = ["--set", "network.hidden=[12, 12]", "--set", "epochs=8", "--set", "filter={ekf: {precision: f64}}"];
    trained(&yard, "whole", &sets);
    let mut child = begin(&yard, &sets);
    wait_for(&mut child, "looks", || std::fs::read(yard.path("run/training.jsonl")).is_ok_and(|log| log.len() > 900));
    stopped(child, "-TERM");
    let log = std::fs::read(yard.path("run/training.jsonl")).expect("a log");
    let half = log[..log.len() / 2].to_vec();
    let garbage = b"\0\0\0\0{]\xff\n".repeat(50);
    let foreign =
        b"{\"rows\":1,\"epoch\":1,\"train_error\":9,\"validation_error\":9,\"best\":true,\"elapsed_s\":1}\n".to_vec();
    for (name, damage) in [
        ("lost", None),
        ("empty", Some(Vec::new())),
        ("cut", Some(half)),
        ("garbage", Some(garbage)),
        ("foreign", Some(foreign)),
        ("too long", Some([log.as_slice(), b"{\"rows\":9"].concat())),
    ] {
        copy(&yard.path("run"), &yard.path(name));
        let path = yard.path(name).join("training.jsonl");
        match damage {
            Some(bytes) => std::fs::write(&path, bytes).expect("a log"),
            None => std::fs::remove_file(&path).expect("a log to lose"),
        }
        trained(&yard, name, &[&sets[..], &["--resume"]].concat());
        assert_same(&promised(&yard, "whole"), &promised(&yard, name));
        // The times before the interruption are those that were measured then.
        let resumed = std::fs::read(path).expect("a log");
        assert!(resumed.starts_with(&log), "{name}");
    }
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).expect("a new folder");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        std::fs::copy(entry.path(), to.join(entry.file_name())).expect("a copy");
    }
}

#[test]
fn equal_bits_after_kills_at_random_moments_and_nothing_temporary_stays() {
    let yard = with_corpus();
    trained(&yard, "whole", &[]);
    let mut draw = 20_170_601_u64;
    let mut killed_in_time = 0;
    for kill in 0.. {
        draw = draw.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mut child = begin(&yard, &["--resume"]);
        std::thread::sleep(Duration::from_millis((draw >> 33) % 60 + 30 * kill));
        if child.try_wait().expect("a child to wait for").is_some_and(|status| status.success()) {
            break;
        }
        killed(child);
        killed_in_time += 1;
    }
    assert!(killed_in_time > 0, "a training that is over before the first kill proves nothing");
    trained(&yard, "run", &["--resume"]);
    assert_same(&promised(&yard, "whole"), &promised(&yard, "run"));
}

#[test]
fn equal_bits_from_what_a_kill_leaves_in_the_first_moments() {
    let yard = with_corpus();
    trained(&yard, "whole", &[]);
    let config = std::fs::read(yard.path("whole/train.yaml")).expect("a config");
    for (name, files) in [
        ("nothing", vec![]),
        ("temporary", vec![(TEMPORARY, &b"marsy"[..])]),
        ("config", vec![("train.yaml", config.as_slice())]),
        ("old", vec![("training.jsonl", &b""[..]), (TEMPORARY, &b"x"[..])]),
        ("config-and-log", vec![("train.yaml", config.as_slice()), ("training.jsonl", &b"{\"rows\""[..])]),
    ] {
        std::fs::create_dir(yard.path(name)).expect("a folder");
        for (file, bytes) in files {
            std::fs::write(yard.path(name).join(file), bytes).expect("a file");
        }
        trained(&yard, name, &["--resume"]);
        assert_same(&promised(&yard, "whole"), &promised(&yard, name));
    }
    // What is no run's is not touched.
    std::fs::create_dir(yard.path("mine")).expect("a folder");
    std::fs::write(yard.path("mine/training.jsonl"), "{\"messages\": []}\n").expect("a file");
    let output = train(&yard, "mine", &["--resume"]);
    assert_eq!((output.status.code(), told(&output).contains("no run folder")), (Some(2), true));
    assert_eq!(std::fs::read_dir(yard.path("mine")).expect("a folder").count(), 1);
}

#[test]
fn law_a_finished_run_gets_back_whatever_of_it_is_gone() {
    let yard = with_corpus();
    trained(&yard, "run", &[]);
    let whole = promised(&yard, "run");
    for gone in ["model.safetensors", "training.json", "curves.svg", "training.jsonl", "evaluation.json", "report.json"]
    {
        std::fs::remove_file(yard.path("run").join(gone)).expect("a file to lose");
        trained(&yard, "run", &["--resume"]);
        assert!(yard.path("run/report.json").is_file());
        assert_same(&whole, &promised(&yard, "run"));
    }
    // A kill between the summary and the end left these.
    std::fs::write(yard.path(CHECKPOINT), "half").expect("a file");
    std::fs::write(yard.path("run").join(TEMPORARY), "half").expect("a file");
    trained(&yard, "run", &["--resume"]);
    assert_same(&whole, &promised(&yard, "run"));
    // Without the record all is learnt again, to the same bits; a flipped bit is as bad as none.
    std::fs::remove_file(yard.path("run/filter.safetensors")).expect("a file to lose");
    let output = train(&yard, "run", &["--resume"]);
    assert!(output.status.success() && told(&output).contains("trained anew"), "{}", told(&output));
    assert_same(&whole, &promised(&yard, "run"));
    flip(&yard.path("run/filter.safetensors"), usize::MAX);
    flip(&yard.path("run/model.safetensors"), usize::MAX);
    trained(&yard, "run", &["--resume"]);
    assert_same(&whole, &promised(&yard, "run"));
}

#[test]
fn law_a_flipped_bit_is_refused_with_the_place_and_the_cure() {
    let yard = with_corpus();
    killed(long(&yard, &[]));
    let resume = [&LONG[..], &["--resume"]].concat();
    for at in [0, 40, 3000, usize::MAX] {
        flip(&yard.path(CHECKPOINT), at);
        let output = train(&yard, "run", &resume);
        let said = told(&output);
        assert_eq!(output.status.code(), Some(1), "byte {at}: {said}");
        assert!(said.contains("checkpoint.safetensors") && said.contains("delete that file"), "byte {at}: {said}");
        flip(&yard.path(CHECKPOINT), at);
    }
    // The cure works.
    std::fs::remove_file(yard.path(CHECKPOINT)).expect("a checkpoint");
    killed(long(&yard, &["--resume"]));
    trained(&yard, "other", &[]);
    flip(&yard.path("other/model.safetensors"), usize::MAX);
    flip(&yard.path("other/filter.safetensors"), usize::MAX);
    let model = yard.marsyard(["evaluate", "other", "corpus"]);
    assert_eq!(model.status.code(), Some(2));
    assert!(told(&model).contains("model.safetensors") && told(&model).contains("is damaged"), "{}", told(&model));
    flip(&yard.path("other/model.safetensors"), usize::MAX);
    let output = train(&yard, "on", &["--init", "other"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(told(&output).contains("filter.safetensors: its bytes are not"), "{}", told(&output));
}

#[test]
fn law_one_training_writes_in_a_folder_and_others_are_told_at_once() {
    let yard = with_corpus();
    let first = long(&yard, &[]);
    for _ in 0..3 {
        let output = train(&yard, "run", &[&LONG[..], &["--resume"]].concat());
        assert_eq!(output.status.code(), Some(75), "{}", told(&output));
        assert!(told(&output).contains("another training or search writes there"), "{}", told(&output));
    }
    // The kernel ends a lock with its holder, and readers never ask for one.
    killed(first);
    let mut again = begin(&yard, &[&LONG[..], &["--resume"]].concat());
    let log = yard.path("run/training.jsonl");
    let length = || std::fs::metadata(&log).map_or(0, |facts| facts.len());
    let before = length();
    wait_for(&mut again, "look", || length() > before);
    stopped(again, "-TERM");
}

#[test]
fn law_three_at_once_in_a_new_folder_train_once() {
    let yard = with_corpus();
    trained(&yard, "whole", &[]);
    let all: Vec<Child> = (0..3).map(|_| begin(&yard, &["--resume"])).collect();
    let codes: Vec<Option<i32>> =
        all.into_iter().map(|child| child.wait_with_output().expect("a child to wait for").status.code()).collect();
    assert!(codes.iter().all(|code| matches!(code, Some(0 | 75))) && codes.contains(&Some(0)), "{codes:?}");
    assert_same(&promised(&yard, "whole"), &promised(&yard, "run"));
}

#[test]
fn law_a_run_goes_on_with_the_same_shards_only() {
    let yard = with_corpus();
    killed(long(&yard, &[]));
    let lines = yard.path("corpus/shards.jsonl");
    let whole = std::fs::read_to_string(&lines).expect("shards.jsonl");
    let fewer: String = whole.split_inclusive('\n').skip(1).collect();
    std::fs::write(&lines, fewer).expect("shards.jsonl");
    let output = train(&yard, "run", &[&LONG[..], &["--resume"]].concat());
    assert!(matches!(output.status.code(), Some(1 | 2)), "{}", told(&output));
    // Another config is refused from the first moment on.
    std::fs::write(&lines, whole).expect("shards.jsonl");
    std::fs::remove_file(yard.path(CHECKPOINT)).expect("a checkpoint");
    let output = train(&yard, "run", &["--resume"]);
    assert_eq!(output.status.code(), Some(2), "{}", told(&output));
    assert!(told(&output).contains("the config is another one"), "{}", told(&output));
}

#[test]
fn exact_a_model_names_its_run_and_its_hash_is_told() {
    let yard = with_corpus();
    trained(&yard, "run", &[]);
    trained(&yard, "again", &[]);
    trained(&yard, "other", &["--seed", "9"]);
    let summary = |run: &str| -> Json {
        let bytes = std::fs::read(yard.path(run).join("training.json")).expect("a summary");
        serde_json::from_slice(&bytes).expect("JSON")
    };
    let bytes = std::fs::read(yard.path("run/model.safetensors")).expect("a model");
    let sha256 = marsyard::corpus::sha256(&bytes);
    assert_eq!(summary("run")["model_sha256"], sha256.as_str());
    let model = marsyard::train::Model::load(&bytes).expect("a model");
    assert_eq!((model.about.run.as_deref(), model.sha256.as_deref()), (summary("run")["run"].as_str(), Some(&*sha256)));
    assert_eq!(summary("run")["run"], summary("again")["run"]);
    assert_ne!(summary("run")["run"], summary("other")["run"]);
    let output = yard.marsyard(["evaluate", "run", "corpus"]);
    assert!(text(&output.stdout).contains(&sha256[..12]), "{}", text(&output.stdout));
    let report = std::fs::read_to_string(yard.path("run/report.json")).expect("a report");
    assert!(!report.contains("\"host\""), "{report}");
}

#[test]
fn law_models_of_before_are_read_with_a_word() {
    let yard = with_corpus();
    trained(&yard, "run", &[]);
    let mut model = marsyard::train::Model::read(&yard.path("run/model.safetensors")).expect("a model");
    (model.about.marsyard_model, model.about.run) = (1, None);
    std::fs::write(yard.path("old.safetensors"), model.save().expect("a model")).expect("a file");
    let output = yard.marsyard(["evaluate", "old.safetensors", "corpus"]);
    assert!(output.status.success() && told(&output).contains("has no checksum"), "{}", told(&output));
}

#[test]
fn law_a_run_folder_that_cannot_be_written_says_how_to_go_on() {
    let yard = with_corpus();
    std::fs::write(yard.path("file"), "").expect("a file");
    let output = train(&yard, "file/run", &[]);
    assert!(matches!(output.status.code(), Some(1 | 2)), "{}", told(&output));
    // A limit on the size of files stands for a full disk.
    let binary = env!("CARGO_BIN_EXE_marsyard");
    let arguments = format!("train corpus --out run --set network.hidden=[40,40] {}", QUICK[2..].join(" "));
    let mut limited = std::process::Command::new("bash");
    limited.args(["-c", &format!("ulimit -f 60; exec {binary} {arguments}")]).current_dir(yard.path(""));
    let output = limited.output().expect("bash");
    assert_eq!(output.status.code(), Some(75), "{}", told(&output));
    assert!(told(&output).contains("--resume --out run"), "{}", told(&output));
    let whole = ["train", "corpus", "--set", "network.hidden=[40,40]"].iter().chain(&QUICK[2..]);
    let output = yard.marsyard(whole.clone().chain(&["--out", "run", "--resume"]));
    assert!(output.status.success(), "{}", told(&output));
    assert!(yard.marsyard(whole.chain(&["--out", "whole"])).status.success());
    assert_same(&promised(&yard, "whole"), &promised(&yard, "run"));
}

const SEARCH: [&str; 14] = [
    "search",
    "corpus",
    "--widths",
    "2,3",
    "--layers",
    "2",
    "--rows",
    "600",
    "--validation-rows",
    "200",
    "--rungs",
    "2",
    "--threads",
    "1",
];

fn search(yard: &Yard, out: &str) -> Output {
    yard.marsyard(SEARCH.iter().chain(&["--out", out, "--resume"]))
}

#[test]
fn equal_leaderboards_after_a_journal_that_was_damaged_or_lost() {
    let yard = with_corpus();
    let output = search(&yard, "whole");
    assert!(output.status.success(), "{}", told(&output));
    let journal = std::fs::read(yard.path("whole/search.jsonl")).expect("a journal");
    let ends: Vec<usize> = (0..journal.len()).filter(|&at| journal[at] == b'\n').collect();
    let mut flipped = journal.clone();
    flipped[ends[3] + 40] ^= 1;
    let zeros = [&journal[..ends[2] + 1], &[0; 300][..]].concat();
    for (name, bytes) in [
        ("empty", Some(&b""[..])),
        ("begun", Some(&journal[..9])),
        ("cut", Some(&journal[..ends[4] + 17])),
        ("zeros", Some(&zeros[..])),
        ("flipped", Some(&flipped[..])),
        ("temporary", None),
    ] {
        std::fs::create_dir(yard.path(name)).expect("a folder");
        match bytes {
            Some(bytes) => std::fs::write(yard.path(name).join("search.jsonl"), bytes).expect("a journal"),
            None => std::fs::write(yard.path(name).join(TEMPORARY), "x").expect("a file"),
        }
        let output = search(&yard, name);
        assert!(output.status.success(), "{name}: {}", told(&output));
        assert_same(&yard.search_identity("whole"), &yard.search_identity(name));
    }
    let whole = yard.search_identity("whole");
    for gone in ["search.jsonl", "search.json", "search.svg", "train.yaml"] {
        std::fs::remove_file(yard.path("whole").join(gone)).expect("a file to lose");
        let output = search(&yard, "whole");
        assert!(output.status.success(), "{gone}: {}", told(&output));
        assert_same(&whole, &yard.search_identity("whole"));
    }
}

#[test]
fn law_one_search_writes_in_a_folder() {
    let yard = with_corpus();
    let arguments = ["--out", "run", "--resume", "--epochs", "100000", "--set", "patience=100000"];
    let mut command = yard.command(SEARCH.iter().chain(&arguments));
    let mut first = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the binary starts");
    wait_for(&mut first, "journal", || yard.path("run/search.jsonl").exists());
    let output = yard.marsyard(SEARCH.iter().chain(&arguments));
    killed(first);
    assert_eq!(output.status.code(), Some(75), "{}", told(&output));
    assert!(told(&output).contains("another training or search writes there"), "{}", told(&output));
}
