//! The contract: *a corpus is opened whole or not at all*. Whatever is not the corpus that its manifest names is refused by every
//! reader with place, rule and cure, found by `verify`, and named by `status`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use marsyard::corpus::{Table, sha256};
use serde_json::{Value as Json, json};

use crate::yard::{Yard, assert_same, text};

/// Seven shards of one scene each, in some tenths of a second.
const TINY: &str = "{marsyard: 1, name: tiny, seed: 3, scenes: 7, scenes_per_shard: 1, tables: [cells, scenes, poses],
scene: {extent_m: 12, ground: {source: {random: {rms_height_m: {uniform: [0.05, 0.3]}, correlation_length_m: {uniform: [4, 6]}}},
  shape: {polynomial: {degree: 5}}}, rocks: {count: {uniform: [5, 15]}, diameter_m: {log_uniform: [0.1, 0.8]}}},
drive: {rover: kapvik, start: {near_obstacle_m: {uniform: [1, 2]}}, path: {toward_obstacle: {length_m: 1}}, stops: 2, keep: all,
  control_noise: {speed: 0.05, yaw_rate: 0.05, heading_deg_per_sqrt_m: 1}},
sweep: {sensor: {name: tiny, pattern: {tilted: {beams: 60, beam_step_deg: 4, tilt_from_deg: -45, tilt_to_deg: 5, tilt_step_deg: 4,
  line_time_s: 0.1}}, min_range_m: 0.06, max_range_m: 5.6, range_sigma_m: 0.01, range_sigma_per_m: 0.005, range_bias_m: 0.01,
  range_step_m: 0.001, divergence_mrad: 10, range_at_10_percent_m: 4, ranging: {phase: {modulation_mhz: 46.55}}}},
slam: {fastslam: {particles: 3}}, cells: {size_m: 0.2, max_range_m: 4, labels: {obstacle: taller_than_wheel}}}
";

/// A finished corpus in `G`, and its config in `tiny.yaml`.
fn yard() -> Yard {
    let yard = Yard::new();
    std::fs::write(yard.path("tiny.yaml"), TINY).expect("a config");
    yard.generate(Path::new("tiny.yaml"), "G", &["--threads", "1"]);
    yard
}

/// A fresh copy of `G`.
fn copy(yard: &Yard, to: &str) -> PathBuf {
    let _ = std::fs::remove_dir_all(yard.path(to));
    let copied = Command::new("cp").arg("-r").args([yard.path("G"), yard.path(to)]).status().expect("cp");
    assert!(copied.success());
    yard.path(to)
}

/// Exit status and all that was said, in one line; no reader may take a minute.
fn told(yard: &Yard, arguments: &[&str]) -> (Option<i32>, String) {
    let mut child = yard
        .command(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .stdin(Stdio::null())
        .spawn()
        .expect("the binary starts");
    let ended = (0..6000).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        child.try_wait().expect("a child to wait for").is_some()
    });
    if !ended {
        child.kill().expect("a child to end");
        panic!("{arguments:?} never ended");
    }
    let output = child.wait_with_output().expect("what it said");
    let said = text(&output.stdout) + &text(&output.stderr);
    let said = said.replace(['\n', '│'], " ").split_whitespace().collect::<Vec<_>>().join(" ");
    (output.status.code(), said)
}

const TRAIN: [&str; 6] = ["--set", "network.hidden=[4]", "--set", "epochs=1", "--threads", "1"];

fn train<'a>(corpus: &'a str, out: &'a str) -> Vec<&'a str> {
    [&["train", corpus, "--out", out][..], &TRAIN].concat()
}

/// Every reader refuses the corpus with exit 1 and these words, and writes nothing; `verify` fails on what the first of them names, and
/// `status`, which is asked about unfinished corpora too, tells it.
fn assert_refused(yard: &Yard, corpus: &str, words: &[&str]) {
    if !yard.path("learnt").exists() {
        assert_eq!(told(yard, &train("G", "learnt")).0, Some(0));
    }
    let explain = ["explain", corpus, "--scene", "6"];
    let preview = ["preview", corpus, "--scene", "6", "--out", "never"];
    let readers = [
        &train(corpus, "never")[..],
        &["search", corpus, "--out", "never"],
        &["evaluate", "learnt", corpus, "--out", "never"],
        &["inspect", corpus],
        &explain,
        &preview,
    ];
    for arguments in readers {
        let (code, said) = told(yard, arguments);
        assert_eq!(code, Some(1), "{arguments:?}: {said}");
        assert!(words.iter().all(|word| said.contains(word)), "{arguments:?} lacks one of {words:?}: {said}");
        assert!(!yard.path("never").exists(), "{arguments:?}");
    }
    let thing = words[0].strip_prefix(&format!("{corpus}/")).unwrap_or(words[0]);
    for verb in ["verify", "status"] {
        let (code, said) = told(yard, &[verb, corpus]);
        assert!(code == Some(1) || verb == "status" && code == Some(0), "{verb}: {code:?}: {said}");
        assert!(said.contains(thing), "{verb} lacks {thing}: {said}");
    }
}

fn edit(path: &Path, from: &str, to: &str) {
    let there = std::fs::read_to_string(path).expect("a file");
    assert!(there.contains(from), "{} lacks {from}", path.display());
    std::fs::write(path, there.replacen(from, to, 1)).expect("a file to write");
}

/// Sums and hashes of a manifest made those of an edited `shards.jsonl`.
pub fn mend(place: &Path) {
    let list = std::fs::read(place.join("shards.jsonl")).expect("a list");
    let lines: Vec<Json> = text(&list).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let path = place.join("manifest.json");
    let mut manifest: Json = serde_json::from_slice(&std::fs::read(&path).expect("a manifest")).expect("JSON");
    manifest["files"]["shards.jsonl"] = sha256(&list).into();
    let sum = |table: &str, split: Option<&str>, key: &str| -> u64 {
        let of_split = lines.iter().filter(|line| split.is_none_or(|split| line["split"] == split));
        of_split.map(|line| line["tables"][table][key].as_u64().expect("a count")).sum()
    };
    for table in ["cells", "scenes", "poses"] {
        for key in ["rows", "bytes"] {
            manifest["tables"][table][key] = sum(table, None, key).into();
        }
        for split in ["train", "validation", "test"] {
            manifest["splits"][split]["rows"][table] = sum(table, Some(split), "rows").into();
        }
    }
    std::fs::write(&path, manifest.to_string()).expect("a manifest to write");
}

#[test]
fn regress_a_corpus_that_lost_shards_is_refused_by_every_reader() {
    let yard = yard();
    let (code, said) = told(&yard, &train("G", "run"));
    assert_eq!(code, Some(0), "{said}");
    let list = copy(&yard, "c").join("shards.jsonl");
    let lines = std::fs::read_to_string(&list).expect("a list");
    let kept = lines.lines().enumerate().filter(|(k, _)| ![1, 2].contains(k)).map(|(_, line)| format!("{line}\n"));
    std::fs::write(&list, kept.collect::<String>()).expect("a list to write");
    assert_refused(&yard, "c", &["c/shards.jsonl", "marsyard finalize c"]);
    let (code, said) = told(&yard, &["evaluate", "run", "c"]);
    assert!(code == Some(1) && said.contains("c/shards.jsonl"), "{said}");
    // Nor where the manifest's hash is made to fit.
    mend(&yard.path("c"));
    assert_refused(&yard, "c", &["shards.jsonl", "it lists 5 shards, the manifest has 7", "marsyard finalize c"]);
    let (code, said) = told(&yard, &["status", "c"]);
    assert!(code == Some(0) && said.contains("it lists 5 shards"), "{said}");
    assert!(told(&yard, &["finalize", "c"]).0 == Some(0) && told(&yard, &["verify", "c"]).0 == Some(0));
    assert_same(&yard.identity("G"), &yard.identity("c"));
}

#[test]
fn regress_a_name_that_is_a_path_writes_nowhere() {
    let yard = yard();
    for name in ["../../evil", "/tmp/evil", ".hidden", "a/b"] {
        let manifest = copy(&yard, "e").join("manifest.json");
        edit(&manifest, "\"name\": \"tiny\"", &format!("\"name\": {}", json!(name)));
        for verb in [&["train", "e"][..], &["search", "e"]] {
            let (code, said) = told(&yard, verb);
            assert!(code == Some(1) && said.contains("letters, digits"), "{verb:?}: {said}");
        }
        assert!(!yard.path("runs").exists(), "{name}");
    }
}

#[test]
fn regress_files_beyond_the_plan_are_found_told_and_removed_where_they_are_ours() {
    let yard = yard();
    let place = copy(&yard, "f");
    let stray = "data/cells/train-0000099.parquet";
    std::fs::copy(place.join("data/cells/train-0000000.parquet"), place.join(stray)).expect("a copy");
    assert_refused(&yard, "f", &[stray, "marsyard verify f --repair"]);
    for verb in [&["verify", "f"][..], &["status", "f"]] {
        let (code, said) = told(&yard, verb);
        assert!(code == Some(i32::from(verb[0] == "verify")) && said.contains(stray), "{verb:?}: {said}");
    }
    let (code, said) = told(&yard, &["verify", "f", "--repair"]);
    assert!(code == Some(0) && said.contains(stray) && !place.join(stray).exists(), "{said}");
    assert_eq!(told(&yard, &["verify", "f", "--rebuild", "1"]).0, Some(0));
    // What somebody else put there is told and stays.
    std::fs::write(place.join("data/cells/mine.parquet"), "mine").expect("a file");
    assert_refused(&yard, "f", &["data/cells/mine.parquet", "move it away"]);
    for verb in [&["verify", "f"][..], &["verify", "f", "--repair"], &["finalize", "f"]] {
        let (code, said) = told(&yard, verb);
        assert!(code == Some(1) && said.contains("mine.parquet") && said.contains("move it away"), "{verb:?}: {said}");
    }
    assert_eq!(std::fs::read(place.join("data/cells/mine.parquet")).expect("the file"), b"mine");
}

#[test]
fn regress_pipes_links_and_folders_in_a_files_place_are_refused_at_once() {
    let yard = yard();
    let shard = "data/cells/train-0000001.parquet";
    for name in ["shards.jsonl", "manifest.json", "README.md", "receipts/0000001.json", shard] {
        for what in ["a pipe", "a folder", "a link"] {
            let path = copy(&yard, "p").join(name);
            let away = yard.path("away");
            std::fs::rename(&path, &away).expect("a file to move");
            let made = match what {
                "a pipe" => Command::new("mkfifo").arg(&path).status().expect("mkfifo").success(),
                "a folder" => std::fs::create_dir(&path).is_ok(),
                _ => std::os::unix::fs::symlink(&away, &path).is_ok(),
            };
            assert!(made);
            for verb in [&train("p", "never")[..], &["inspect", "p"], &["verify", "p"]] {
                let (code, said) = told(&yard, verb);
                assert!(code == Some(1) && said.contains(name), "{what} for {name}: {verb:?} {code:?} {said}");
            }
        }
    }
    let (code, said) = told(&yard, &["verify", "p", "--repair"]);
    assert!(code == Some(1) && said.contains("is a link, not a file; move it away"), "{said}");
}

#[test]
fn regress_a_train_shard_in_a_test_shards_place_is_refused_and_found() {
    let yard = yard();
    assert_eq!(told(&yard, &train("G", "run")).0, Some(0));
    let place = copy(&yard, "s");
    let receipt = |shard: u64| place.join(format!("receipts/{shard:07}.json"));
    let read =
        |shard| -> Json { serde_json::from_slice(&std::fs::read(receipt(shard)).expect("a file")).expect("JSON") };
    let (train, mut test) = (read(0), read(6));
    for key in ["features", "labels", "points", "failed"] {
        test[key] = train[key].clone();
    }
    for table in [Table::Cells, Table::Scenes, Table::Poses] {
        std::fs::copy(place.join(table.path(0)), place.join(table.path(6))).expect("a copy");
        test["tables"][table.name()] = train["tables"][table.name()].clone();
        test["tables"][table.name()]["path"] = table.path(6).into();
    }
    std::fs::write(receipt(6), test.to_string()).expect("a receipt");
    std::fs::remove_file(place.join("manifest.json")).expect("a manifest");
    assert_eq!(told(&yard, &["finalize", "s"]).0, Some(0), "finalize takes receipts at their word");
    for verb in [&["evaluate", "run", "s"][..], &["inspect", "s"], &["verify", "s"], &["verify", "s", "--rebuild", "1"]]
    {
        let (code, said) = told(&yard, verb);
        assert!(code == Some(1) && said.contains("test-0000006.parquet"), "{verb:?}: {said}");
        assert!(said.contains("marsyard.shard is '0', not '6'"), "{verb:?}: {said}");
    }
    let (code, said) = told(&yard, &["verify", "s", "--repair"]);
    assert!(code == Some(1) && said.contains("corpus_id was"), "{said}");
    assert_same(&yard.identity("G"), &yard.identity("s"));
}

#[test]
fn regress_edited_plans_cards_and_receipts_are_found() {
    let yard = yard();
    let more = |path: &Path| {
        let whole = std::fs::read_to_string(path).expect("a file");
        std::fs::write(path, whole + "\n").expect("a file to write");
    };
    for (name, cure) in [
        ("README.md", "marsyard finalize d"),
        ("croissant.json", "marsyard finalize d"),
        ("plan.yaml", "marsyard generate CONFIG"),
    ] {
        more(&copy(&yard, "d").join(name));
        assert_refused(&yard, "d", &[name, cure]);
        let (code, said) = told(&yard, &["verify", "d"]);
        assert!(code == Some(1) && said.contains(name), "{said}");
    }
    std::fs::remove_file(copy(&yard, "d").join("README.md")).expect("a file");
    assert_refused(&yard, "d", &["README.md: it is missing"]);
    assert!(told(&yard, &["finalize", "d"]).0 == Some(0) && told(&yard, &["verify", "d"]).0 == Some(0));
    let big = std::fs::File::create(copy(&yard, "d").join("README.md")).expect("a file");
    big.set_len(5 << 20).expect("a large file");
    assert_refused(&yard, "d", &["README.md is larger than 4194304 bytes", "a dataset card"]);
    for key in ["\"points_in\": ", "\"commit\": \"", "\"row_groups\": "] {
        edit(&copy(&yard, "d").join("receipts/0000002.json"), key, &format!("{key}1"));
        let (code, said) = told(&yard, &["verify", "d"]);
        assert!(code == Some(1) && said.contains("receipts/0000002.json: its SHA-256"), "{key}: {said}");
    }
    // What no table holds and no sum shows: the hash of the receipt.
    more(&copy(&yard, "d").join("receipts/0000002.json"));
    let (code, said) = told(&yard, &["verify", "d"]);
    assert!(code == Some(1) && said.contains("receipts/0000002.json: its SHA-256"), "{said}");
}

#[test]
fn regress_a_plan_of_another_seed_or_shard_size_is_told_as_no_growth() {
    let yard = yard();
    for (from, to) in [("seed: 3", "seed: 4"), ("scenes_per_shard: 1", "scenes_per_shard: 7")] {
        edit(&copy(&yard, "d").join("plan.yaml"), from, to);
        assert_refused(&yard, "d", &["plan.yaml", "marsyard generate CONFIG"]);
        let (_, said) = told(&yard, &train("d", "never"));
        assert!(said.contains("no growth leads from one to the other"), "{said}");
    }
}

#[test]
fn regress_an_edited_receipt_is_built_anew_and_its_word_is_never_taken() {
    let yard = yard();
    let place = copy(&yard, "d");
    let receipt = place.join("receipts/0000002.json");
    let manifest = || std::fs::read(place.join("manifest.json")).expect("a manifest");
    let before = manifest();
    edit(&receipt, "\"points_in\": ", "\"points_in\": 1");
    for verb in [&["finalize", "d"][..], &["generate", "tiny.yaml", "--out", "d"]] {
        let (code, said) = told(&yard, verb);
        let told = said.contains("d/receipts/0000002.json") && said.contains("marsyard verify d --repair");
        assert!(code == Some(1) && told && manifest() == before, "{verb:?}: {said}");
    }
    let (code, said) = told(&yard, &["verify", "d", "--repair"]);
    assert!(code == Some(0) && said.contains("shards 2 are built anew"), "{said}");
    assert_same(&yard.identity("G"), &yard.identity("d"));
    // Nor where the list that names it is damaged.
    edit(&receipt, "\"points_in\": ", "\"points_in\": 1");
    edit(&place.join("shards.jsonl"), "\"rows\":", "\"rows\":1");
    for verb in [&["finalize", "d"][..], &["verify", "d", "--repair"]] {
        let (code, said) = told(&yard, verb);
        assert!(code == Some(1) && said.contains("remove manifest.json") && manifest() == before, "{verb:?}: {said}");
    }
    // A growth holds the receipts that it found against its list, too.
    let place = copy(&yard, "g");
    edit(&place.join("receipts/0000002.json"), "\"points_in\": ", "\"points_in\": 1");
    let grow = ["generate", "tiny.yaml", "--out", "g", "--set", "scenes=8", "--threads", "1"];
    let (code, said) = told(&yard, &grow);
    assert!(code == Some(1) && said.contains("g/receipts/0000002.json"), "{said}");
    assert_eq!(told(&yard, &["verify", "g", "--repair"]).0, Some(0));
    yard.generate(Path::new("tiny.yaml"), "L", &grow[4..]);
    assert_same(&yard.identity("L"), &yard.identity("g"));
}

#[test]
fn regress_receipts_that_the_plan_does_not_ask_for_are_damaged_and_built_anew() {
    let yard = yard();
    let scenes = "\"scenes\": [\n    6,\n    7";
    for (from, to) in
        [(scenes, "\"scenes\": [6, 8"), ("\"failed\": []", "\"failed\": [{\"scene\": 99, \"error\": \"\"}]")]
    {
        let place = copy(&yard, "d");
        edit(&place.join("receipts/0000006.json"), from, to);
        std::fs::remove_file(place.join("manifest.json")).expect("a manifest");
        let (code, said) = told(&yard, &["finalize", "d"]);
        assert!(code == Some(1) && said.contains("1 of 7 shards are missing or damaged (6)"), "{said}");
        assert!(!place.join("manifest.json").exists());
        assert_eq!(told(&yard, &["generate", "d"]).0, Some(0));
        assert_same(&yard.identity("G"), &yard.identity("d"));
    }
}

#[test]
fn regress_while_a_corpus_grows_and_after_a_killed_growth_no_reader_takes_it() {
    let yard = yard();
    let large = ["--set", "scenes=14", "--threads", "1"];
    yard.generate(Path::new("tiny.yaml"), "L", &large);
    let place = copy(&yard, "g");
    assert_eq!(
        told(&yard, &[&["generate", "tiny.yaml", "--out", "g", "--plan-only"], &large[..2]].concat()).0,
        Some(0)
    );
    assert_refused(&yard, "g", &["plan.yaml", "14 scenes", "`marsyard generate g` completes it"]);
    // Half a shard, and the old config: nothing stays that a glob would read.
    let half = Table::Cells.path(7);
    std::fs::copy(yard.path("L").join(&half), place.join(&half)).expect("a copy");
    let (code, said) = told(&yard, &["generate", "tiny.yaml", "--out", "g"]);
    assert!(code == Some(0) && !place.join(&half).exists(), "{said}");
    assert_same(&yard.identity("G"), &yard.identity("g"));
    // A whole shard: kept, and told with both cures.
    let grown = |name: &str| std::fs::copy(yard.path("L").join(name), place.join(name)).expect("a copy");
    for table in [Table::Cells, Table::Scenes, Table::Poses] {
        grown(&table.path(7));
    }
    grown("receipts/0000007.json");
    assert_refused(&yard, "g", &["0000007", "--discard-beyond"]);
    assert_eq!(
        told(&yard, &[&["generate", "tiny.yaml", "--out", "g", "--plan-only"], &large[..2]].concat()).0,
        Some(0)
    );
    let (code, said) = told(&yard, &["generate", "tiny.yaml", "--out", "g"]);
    assert!(code == Some(2) && said.contains("raise `scenes`") && said.contains("--discard-beyond"), "{said}");
    let (code, said) = told(&yard, &["generate", "tiny.yaml", "--out", "g", "--discard-beyond"]);
    assert!(code == Some(0) && said.contains("1 shards behind the plan's end were removed"), "{said}");
    assert_same(&yard.identity("G"), &yard.identity("g"));
    // The command that is told completes the growth.
    assert_eq!(
        told(&yard, &[&["generate", "tiny.yaml", "--out", "g", "--plan-only"], &large[..2]].concat()).0,
        Some(0)
    );
    assert_eq!(told(&yard, &["generate", "g"]).0, Some(0));
    assert_same(&yard.identity("L"), &yard.identity("g"));
}

/// A corpus as the first format had it: no hashes beside the manifest, no labels by shard. By text, so that no number changes.
fn as_format_1(place: &Path) {
    let rewrite = |name: &str, change: &dyn Fn(String) -> String| {
        let path = place.join(name);
        std::fs::write(&path, change(std::fs::read_to_string(&path).expect("a file"))).expect("a file to write");
    };
    let first = |text: String| text.replacen("\"format\": 2", "\"format\": 1", 1);
    (0..7).for_each(|shard| rewrite(&format!("receipts/{shard:07}.json"), &first));
    let without = |text: &str, from: &str, to: &str| {
        let begin = text.find(from).unwrap_or_else(|| panic!("no {from}"));
        let behind = begin + from.len();
        let end = behind + text[behind..].find(to).expect("its end") + to.len();
        format!("{}{}", &text[..begin], &text[end..])
    };
    rewrite("manifest.json", &|text| {
        let text = without(&first(text), ",\n  \"files\": {", "}");
        let text = without(&text, ",\n  \"yards\": [", "]");
        without(&text, ",\n  \"receipts_sha256\": \"", "\"")
    });
    let line = |line: &str| without(&without(line, "\"labels\":{", "},"), "\"receipt_sha256\":\"", "\",") + "\n";
    rewrite("shards.jsonl", &|text| text.lines().map(line).collect());
}

#[test]
fn law_a_corpus_of_the_first_format_is_read_with_a_word_of_what_cannot_be_checked() {
    let yard = yard();
    let place = copy(&yard, "old");
    as_format_1(&place);
    for verb in [&train("old", "run")[..], &["inspect", "old"]] {
        let (code, said) = told(&yard, verb);
        assert!(code == Some(0) && said.contains("a corpus of format 1"), "{verb:?}: {said}");
    }
    let (code, said) = told(&yard, &["verify", "old"]);
    assert_eq!(code, Some(0), "{said}");
    // What can be checked is.
    let list = place.join("shards.jsonl");
    let whole = std::fs::read_to_string(&list).expect("a list");
    std::fs::write(&list, whole.lines().skip(1).map(|line| format!("{line}\n")).collect::<String>()).expect("a list");
    assert_refused(&yard, "old", &["shards.jsonl", "6 shards"]);
    std::fs::write(&list, whole).expect("a list");
    edit(&place.join("plan.yaml"), "scenes: 7", "scenes: 14");
    assert_refused(&yard, "old", &["plan.yaml", "marsyard generate old"]);
    edit(&place.join("plan.yaml"), "scenes: 14", "scenes: 7");
    edit(&place.join("plan.yaml"), "wheel_diameter_m: 0.1", "wheel_diameter_m: 0.2");
    let [explain, preview] = [["explain", "old", "--scene", "6"], ["preview", "old", "--scene", "6"]];
    for verb in [&train("old", "never")[..], &["evaluate", "run", "old"], &["inspect", "old"], &explain, &preview] {
        let (code, said) = told(&yard, verb);
        assert!(code == Some(1) && said.contains("old/plan.yaml: its keys give scene_plan_hash"), "{verb:?}: {said}");
    }
    edit(&place.join("plan.yaml"), "wheel_diameter_m: 0.2", "wheel_diameter_m: 0.1");
    // No signature covers what the manifest does not name; and no corpus of format 2 passes for one.
    assert_eq!(told(&yard, &["sign", "--new-key", "k", "--no-password"]).0, Some(0));
    assert_eq!(told(&yard, &["sign", "G", "--key", "k"]).0, Some(0));
    edit(&copy(&yard, "younger").join("manifest.json"), "\"format\": 2", "\"format\": 1");
    assert_refused(&yard, "younger", &["has keys of format 2"]);
    // A finalize writes what is missing, and nothing else.
    assert_eq!(told(&yard, &["finalize", "old"]).0, Some(0));
    let (code, said) = told(&yard, &["inspect", "old"]);
    assert!(code == Some(0) && !said.contains("format 1"), "{said}");
    let (code, said) = told(&yard, &["verify", "old"]);
    assert_eq!(code, Some(0), "{said}");
}
