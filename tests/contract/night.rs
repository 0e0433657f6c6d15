//! What happens to a build in the night: signals, full disks, folders that go away, other programs, too little memory. After
//! each the same command completes, with the same bytes. `scripts/trust/` injects the same many times at random moments.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use crate::yard::{Yard, assert_same, stopped, text, wait_for};

/// The binary under a limit of the shell, such as `ulimit -f 8`.
fn limited(yard: &Yard, limit: &str, arguments: &str) -> Output {
    let script = format!("{limit}; exec \"$0\" {arguments}");
    Command::new("bash")
        .args(["-c", &script, env!("CARGO_BIN_EXE_marsyard")])
        .current_dir(yard.path(""))
        // The standard library's backtrace of a failed allocation allocates, and waits for itself when that fails too.
        .env("RUST_BACKTRACE", "0")
        .output()
        .expect("bash starts")
}

/// A yard with a finished corpus, `whole`.
fn with_whole() -> (Yard, String) {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "whole", &[]);
    (yard, Yard::everything().display().to_string())
}

/// The same command once more completes the corpus.
fn assert_completes(yard: &Yard, out: &str) {
    yard.generate(&Yard::everything(), out, &[]);
    assert_same(&yard.identity("whole"), &yard.identity(out));
    assert!(yard.marsyard(["verify", out]).status.success());
}

#[test]
fn law_a_signal_stops_between_two_shards_and_says_how_to_go_on() {
    let (yard, config) = with_whole();
    for (signal, out) in [("-INT", "interrupted"), ("-TERM", "terminated")] {
        let mut arguments = vec!["generate", &config, "--out", out, "--threads", "1"];
        // A hundred times the scenes, so that the signal comes in time however fast the machine is, and 0.4 GB of disk are enough.
        arguments.extend(["--set", "scenes=800"]);
        let mut child = yard.command(&arguments).stderr(Stdio::piped()).spawn().expect("the binary starts");
        let receipts = yard.path(out).join("receipts");
        wait_for(&mut child, "receipt", || receipts.is_dir());
        let output = stopped(child, signal);
        assert!(text(&output.stderr).contains("the same command again goes on"), "{}", text(&output.stderr));
        let said = text(&yard.marsyard(["status", out]).stdout);
        assert!(said.contains("damaged        0"), "{said}");
        let there = yard.identity(out);
        let done = there.keys().filter(|name| name.starts_with("receipts/")).count();
        assert!(done > 0 && done < 400, "{done} shards");
        // What is there is what an undisturbed build has.
        for (name, bytes) in yard.identity("whole") {
            let shared = name.starts_with("data/") || name.starts_with("receipts/");
            assert!(!shared || there.get(&name).is_none_or(|here| *here == bytes), "{name} differs");
        }
        assert!(!there.keys().any(|name| name.contains(".marsyard-tmp-")), "{:?}", there.keys());
    }
}

#[test]
fn law_a_file_size_limit_is_an_error_and_not_the_end_of_the_process() {
    let (yard, config) = with_whole();
    // The tables of a shard are some 30 to 300 kB: eight blocks let the plan through, and no shard.
    let output = limited(&yard, "ulimit -f 16", &format!("generate {config} --out limited"));
    assert_eq!(output.status.code(), Some(75), "{:?} {}", output.status, text(&output.stderr));
    let said = text(&output.stderr);
    assert!(said.contains("File too large") && said.contains("ulimit -f"), "{said}");
    assert!(!yard.path("limited/manifest.json").exists());
    assert_completes(&yard, "limited");
}

#[test]
fn law_a_disk_with_too_little_room_is_refused_with_the_figures() {
    let (yard, config) = with_whole();
    let refused = |extra: &[&str]| {
        let output = yard.marsyard([&["generate", &config, "--out", "full"], extra].concat());
        assert_eq!(output.status.code(), Some(75), "{}", text(&output.stderr));
        // The frame of a message may break a line anywhere.
        text(&output.stderr).replace("\n  │ ", " ").replace("\n    ", " ")
    };
    // During: no shard fits.
    let said = refused(&["--keep-free-mb", "1000000000000"]);
    assert!(said.contains("shard") && said.contains("MB are free") && said.contains("the same command"), "{said}");
    assert!(text(&yard.marsyard(["status", "full"]).stdout).contains("done           0"));
    // Before: a build of many scenes is sampled, and nothing is built.
    let said = refused(&["--keep-free-mb", "1000000000000", "--set", "scenes=400"]);
    assert!(said.contains("a build of 200 shards takes"), "{said}");
    assert_completes(&yard, "full");
}

#[test]
fn law_a_folder_that_cannot_be_written_or_goes_away_is_told() {
    let (yard, config) = with_whole();
    std::fs::write(yard.path("file"), "not a folder").expect("a scratch file");
    let output = yard.marsyard(["generate", &config, "--out", "file/corpus"]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
    let mut child = yard
        .command(["generate", &config, "--out", "going", "--threads", "1", "--set", "scenes=800"])
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let receipts = yard.path("going/receipts");
    wait_for(&mut child, "receipt", || receipts.is_dir());
    std::fs::rename(yard.path("going"), yard.path("gone")).expect("a folder to move");
    let output = child.wait_with_output().expect("a child to wait for");
    assert_eq!(output.status.code(), Some(75), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("no longer the place of this plan"), "{}", text(&output.stderr));
    assert!(!yard.path("going/receipts").exists(), "nothing is built where the folder was");
    assert!(text(&yard.marsyard(["status", "gone"]).stdout).contains("damaged        0"));
}

#[test]
fn law_two_builds_of_one_corpus_at_once_do_not_disturb_each_other() {
    let (yard, config) = with_whole();
    let children: Vec<_> = (0..3)
        .map(|_| {
            let mut command = yard.command(["generate", &config, "--out", "shared"]);
            command.stderr(Stdio::piped()).spawn().expect("the binary starts")
        })
        .collect();
    for child in children {
        let output = child.wait_with_output().expect("a child to wait for");
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    assert_same(&yard.identity("whole"), &yard.identity("shared"));
}

#[test]
fn law_too_little_memory_ends_clearly_and_leaves_nothing_half_written() {
    let (yard, config) = with_whole();
    let mut ends = 0;
    // From enough for little more than the program itself to enough for all of it.
    for megabytes in [35, 45, 55, 65, 75, 100, 4000] {
        let out = format!("starved-{megabytes}");
        let limit = format!("ulimit -v {}", megabytes * 1024);
        let output = limited(&yard, &limit, &format!("generate {config} --threads 2 --out {out}"));
        if !output.status.success() {
            ends += 1;
            let said = text(&output.stderr);
            let clear = ["memory", "Cannot allocate", "Resource temporarily unavailable", "failed to map"];
            assert!(clear.iter().any(|word| said.contains(word)), "{megabytes} MB: {:?} {said}", output.status);
        }
        assert_completes(&yard, &out);
    }
    assert!(ends > 0 && ends < 7, "{ends} of 7 limits were too low");
}

#[test]
fn law_missing_shards_are_named_as_generate_takes_them() {
    let (yard, config) = with_whole();
    yard.generate(&Yard::everything(), "part", &["--shards", "1"]);
    let missing = text(&yard.marsyard(["status", "part", "--missing"]).stdout);
    assert_eq!(missing.trim(), "0,2..4");
    yard.generate(&Yard::everything(), "part", &["--shards", missing.trim()]);
    assert!(yard.marsyard(["finalize", "part"]).status.success());
    assert_same(&yard.identity("whole"), &yard.identity("part"));
    let output = yard.marsyard(["generate", &config, "--out", "part", "--shards", "2..5"]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn law_damage_of_every_kind_is_repaired_and_foreign_things_are_left_alone() {
    let (yard, config) = with_whole();
    yard.generate(&Yard::everything(), "other", &["--set", "seed=1"]);
    let path = |name: &str| yard.path("corpus").join(name);
    let corpus = || copy_folder(&yard.path("whole"), &yard.path("corpus"));
    let shard = "data/cells/train-0000001.parquet";
    let receipt = "receipts/0000002.json";
    let replace_from_other = |name: &str| {
        std::fs::copy(yard.path("other").join(name), path(name)).expect("a copy");
    };
    type Injure<'a> = Box<dyn Fn() + 'a>;
    let injuries: [(&str, Injure); 7] = [
        ("a truncated shard", Box::new(|| truncate(&path(shard)))),
        ("no shard", Box::new(|| std::fs::remove_file(path(shard)).expect("a file"))),
        ("a truncated receipt", Box::new(|| truncate(&path(receipt)))),
        ("a foreign receipt", Box::new(|| replace_from_other(receipt))),
        ("a truncated manifest", Box::new(|| truncate(&path("manifest.json")))),
        ("a foreign manifest", Box::new(|| replace_from_other("manifest.json"))),
        (
            "a truncated shard and a foreign manifest",
            Box::new(|| {
                truncate(&path(shard));
                replace_from_other("manifest.json");
            }),
        ),
    ];
    for (what, injure) in injuries {
        corpus();
        injure();
        assert_eq!(yard.marsyard(["verify", "corpus"]).status.code(), Some(1), "{what}");
        let output = yard.marsyard(["verify", "corpus", "--repair"]);
        assert!(output.status.success(), "{what}: {}", text(&output.stderr));
        assert_same(&yard.identity("whole"), &yard.identity("corpus"));
    }
    // A shard of another corpus may be somebody's only one.
    corpus();
    replace_from_other(shard);
    let before = yard.identity("corpus");
    let output = yard.marsyard(["verify", "corpus", "--repair"]);
    let said = text(&output.stderr);
    assert!(output.status.code() == Some(2) && said.contains(shard) && said.contains("move the file away"), "{said}");
    assert_same(&before, &yard.identity("corpus"));
    std::fs::remove_file(path(shard)).expect("a file");
    assert!(yard.marsyard(["verify", "corpus", "--repair"]).status.success());
    // Begun to be raised: the manifest is that of the smaller corpus, and nothing is wrong with what is there.
    corpus();
    yard.generate(&Yard::everything(), "corpus", &["--set", "scenes=12", "--plan-only"]);
    let output = yard.marsyard(["verify", "corpus", "--repair"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    // A receipt of a later format may be sound: nothing is built anew over it.
    corpus();
    let later = std::fs::read_to_string(path(receipt)).expect("a receipt").replace("\"format\": 2", "\"format\": 3");
    std::fs::write(path(receipt), later).expect("a receipt to change");
    let before = yard.identity("corpus");
    for arguments in
        [&["generate", &config, "--out", "corpus"][..], &["verify", "corpus", "--repair"], &["finalize", "corpus"]]
    {
        let output = yard.marsyard(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", text(&output.stderr));
    }
    assert!(text(&yard.marsyard(["status", "corpus"]).stdout).contains("written in format 3"));
    assert_same(&before, &yard.identity("corpus"));
    // A plan.yaml that was edited would make all shards another plan's.
    corpus();
    let edited = std::fs::read_to_string(path("plan.yaml")).expect("a plan").replace("seed: 0", "seed: 1");
    std::fs::write(path("plan.yaml"), edited).expect("a plan to change");
    let output = yard.marsyard(["verify", "corpus", "--repair"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("edited or damaged"), "{}", text(&output.stderr));
    assert_completes(&yard, "corpus");
}

#[test]
fn law_shards_of_another_program_are_told_when_a_build_goes_on() {
    let (yard, config) = with_whole();
    yard.generate(&Yard::everything(), "mixed", &["--shards", "0..2"]);
    for shard in 0..2 {
        let path = yard.path(&format!("mixed/receipts/000000{shard}.json"));
        let receipt = std::fs::read_to_string(&path).expect("a receipt");
        let mut receipt: serde_json::Value = serde_json::from_str(&receipt).expect("JSON");
        receipt["build"]["version"] = "0.0.7".into();
        receipt["build"]["sources_sha256"] = "7".repeat(64).into();
        std::fs::write(&path, receipt.to_string()).expect("a receipt to change");
    }
    let output = yard.marsyard(["generate", &config, "--out", "mixed"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    assert!(said.contains("2 of the shards there were written by another marsyard (0.0.7"), "{said}");
    let manifest = std::fs::read(yard.path("mixed/manifest.json")).expect("a manifest");
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).expect("JSON");
    assert_eq!(manifest["build"]["version"], "0.0.7");
    assert_eq!(manifest["other_builds"][0]["shards"], "2..4");
}

#[test]
#[ignore = "builds 1800 scenes: cargo test --release --test contract resident -- --ignored"]
fn law_resident_memory_is_flat_from_three_hundred_scenes_on() {
    let yard = Yard::new();
    let training = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml");
    let peak_kb = |scenes: &str| {
        let mut command = yard.command(["generate", "--out", scenes, "--threads", "2", "--set"]);
        let scenes = format!("scenes={scenes}");
        let mut child = command.arg(scenes).arg(&training).stderr(Stdio::null()).spawn().expect("the binary starts");
        yard.peak_kb(&mut child)
    };
    // A build of few scenes is over before its buffers are as large as they become.
    let (few, many) = (peak_kb("300"), peak_kb("1500"));
    eprintln!("resident: {few} kB at 300 scenes, {many} kB at 1500");
    assert!(many < 1.15 * few, "{few} kB at 300 scenes, {many} kB at 1500");
}

#[test]
fn law_ten_thousand_shards_are_surveyed_and_merged() {
    const SHARDS: u64 = 10_000;
    let yard = Yard::new();
    let scenes = format!("scenes={}", 2 * SHARDS);
    yard.generate(&Yard::everything(), "many", &["--set", &scenes, "--set", "tables=[cells]", "--shards", "0"]);
    let path = |name: &str| yard.path("many").join(name);
    let receipt = std::fs::read_to_string(path("receipts/0000000.json")).expect("a receipt");
    let receipt: serde_json::Value = serde_json::from_str(&receipt).expect("JSON");
    for shard in 1..SHARDS {
        let split = match shard % 20 {
            3 | 9 | 16 => "validation",
            6 | 13 | 19 => "test",
            _ => "train",
        };
        let data = format!("data/cells/{split}-{shard:07}.parquet");
        std::fs::hard_link(path("data/cells/train-0000000.parquet"), path(&data)).expect("a link");
        let mut receipt = receipt.clone();
        receipt["shard"] = shard.into();
        receipt["split"] = split.into();
        receipt["scenes"] = serde_json::json!([2 * shard, 2 * shard + 2]);
        receipt["tables"]["cells"]["path"] = data.into();
        std::fs::write(path(&format!("receipts/{shard:07}.json")), receipt.to_string()).expect("a receipt to write");
    }
    let output = yard.marsyard(["finalize", "many"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let manifest = std::fs::read(path("manifest.json")).expect("a manifest");
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).expect("JSON");
    let rows = receipt["tables"]["cells"]["rows"].as_u64().expect("a count");
    assert_eq!(manifest["tables"]["cells"]["rows"], rows * SHARDS);
    assert_eq!(manifest["splits"]["train"]["shards"], 7 * SHARDS / 10);
    std::fs::remove_file(path("receipts/0000017.json")).expect("a receipt");
    std::fs::write(path("receipts/0009999.json"), "{").expect("a receipt to damage");
    assert_eq!(text(&yard.marsyard(["status", "many", "--missing"]).stdout).trim(), "17,9999");
    let output = yard.marsyard(["finalize", "many"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("(17,9999)"), "{}", text(&output.stderr));
}

fn truncate(path: &std::path::Path) {
    let bytes = std::fs::read(path).expect("a file");
    std::fs::write(path, &bytes[..bytes.len() / 2]).expect("a file to shorten");
}

/// A fresh copy of a folder.
fn copy_folder(from: &std::path::Path, to: &std::path::Path) {
    let _ = std::fs::remove_dir_all(to);
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).expect("a copy");
        }
    }
}
