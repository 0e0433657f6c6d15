//! Verbs from the outside: exit codes, what is written, what is said.

use std::path::Path;

use crate::yard::{Yard, stopped, text};

#[test]
fn law_a_bad_config_exits_2_and_writes_nothing() {
    let yard = Yard::new();
    std::fs::write(
        yard.path("bad.yaml"),
        "marsyard: 1\nname: bad\nseed: 1\nscenes: 10\nscenes_per_shard: 5\nscene: {extend_m: 20}\n",
    )
    .expect("a scratch file");
    let output = yard.marsyard(["generate", "bad.yaml"]);
    assert_eq!(output.status.code(), Some(2));
    let said = text(&output.stderr);
    assert!(said.contains("bad.yaml") && said.contains("extend_m") && said.contains("extent_m"), "{said}");
    assert_eq!(std::fs::read_dir(yard.path("")).expect("the folder").count(), 1, "something was written");
}

#[test]
fn law_another_plan_in_the_same_place_is_refused_with_the_difference() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "place", &["--shards", "0..1"]);
    let before = yard.identity("place");
    let config = Yard::everything().display().to_string();
    let output = yard.marsyard(["generate", &config, "--out", "place", "--set", "seed=1"]);
    assert_eq!(output.status.code(), Some(2));
    let said = text(&output.stderr);
    assert!(said.contains("seed") && said.contains('0') && said.contains('1'), "{said}");
    crate::yard::assert_same(&before, &yard.identity("place"));
}

#[test]
fn law_shards_beyond_the_plan_and_parts_beyond_the_parts_exit_2() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    for (shards, named) in [("2..5", "0..4"), ("4/4", "0 to 3"), ("3..3", "half open"), ("x", "'x'")] {
        let output = yard.marsyard(["generate", &config, "--out", "place", "--shards", shards]);
        assert_eq!(output.status.code(), Some(2), "{shards}");
        assert!(text(&output.stderr).contains(named), "{shards}: {}", text(&output.stderr));
    }
    assert!(!yard.path("place").exists(), "nothing is written");
}

#[test]
fn law_finalize_refuses_gaps_and_names_them() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "gap", &["--shards", "0..1"]);
    yard.generate(&Yard::everything(), "gap", &["--shards", "3..4"]);
    let output = yard.marsyard(["finalize", "gap"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("1..3"), "{}", text(&output.stderr));
    let output = yard.marsyard(["status", "gap", "--missing"]);
    assert_eq!(text(&output.stdout).trim(), "1..3");
}

#[test]
fn equal_the_resolved_plan_builds_the_same_corpus() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "first", &[]);
    let plan = yard.path("first/plan.yaml");
    yard.generate(&plan, "second", &[]);
    crate::yard::assert_same(&yard.identity("first"), &yard.identity("second"));
}

#[test]
fn law_verify_finds_a_flipped_bit() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "corpus", &[]);
    assert!(yard.marsyard(["verify", "corpus"]).status.success());
    let shard = yard.path("corpus/data/cells/train-0000001.parquet");
    let mut bytes = std::fs::read(&shard).expect("a shard");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&shard, bytes).expect("a writable shard");
    let output = yard.marsyard(["verify", "corpus"]);
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stdout) + &text(&output.stderr);
    assert!(said.contains("train-0000001.parquet"), "{said}");
    assert!(text(&output.stderr).contains("verify corpus --repair"), "{}", text(&output.stderr));
    let repaired = yard.marsyard(["verify", "corpus", "--repair"]);
    assert!(repaired.status.success() && text(&repaired.stderr).contains("shards 1 are built anew"), "{repaired:?}");
    let whole = yard.marsyard(["verify", "corpus", "--rebuild", "2"]);
    assert!(whole.status.success(), "a repaired corpus is whole, and what its plan says: {}", text(&whole.stderr));
    assert!(text(&whole.stderr).contains("have the same bytes"), "{}", text(&whole.stderr));
}

#[test]
fn law_preview_writes_pictures_a_cloud_and_trajectories() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    let output = yard.marsyard(["preview", &config, "--scene", "1", "--out", "pictures"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let starts = |name: &str, magic: &[u8]| {
        let bytes = std::fs::read(yard.path("pictures").join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(bytes.starts_with(magic), "{name}");
    };
    for name in ["scene-1-top.png", "scene-1-perspective.png", "scene-1-scan.png"] {
        starts(name, b"\x89PNG");
    }
    starts("scene-1-cloud.ply", b"ply\n");
    let truth = std::fs::read_to_string(yard.path("pictures/scene-1-truth.tum")).expect("a trajectory");
    assert!(truth.lines().all(|line| line.split_whitespace().count() == 8), "{truth}");
    // What is asked for alone, and each named as it is done.
    let output = yard.marsyard(["preview", &config, "--scene", "1", "--out", "some", "--only", "truth,scan"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let mut names: Vec<_> =
        std::fs::read_dir(yard.path("some")).expect("a folder").map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["marsyard.sha256", "scene-1-scan.png", "scene-1-truth.tum"]);
    assert!(text(&output.stderr).contains("scene 1: made in") && text(&output.stderr).contains("scan.png: "));
    let output = yard.marsyard(["preview", &config, "--scene", "1", "--only", "film"]);
    assert!(
        output.status.code() == Some(2) && text(&output.stderr).contains("perspective"),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn law_explain_gives_the_arithmetic_of_a_cell() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "corpus", &[]);
    let output = yard.marsyard(["explain", "corpus", "--scene", "1"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(said.contains("scene.ground.source.random.rms_height_m"), "{said}");
    let cell = said.rsplit("--cell ").next().expect("a suggested cell").trim();
    let output = yard.marsyard(["explain", "corpus", "--scene", "1", "--cell", cell]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    for part in
        ["mean_height_m", "label: 1, untraversable", "the same, bit for bit", "the mean height of cell", "wheel of"]
    {
        assert!(said.contains(part), "{part} is not in:\n{said}");
    }
    // Under other keys it is another corpus's cell, and no fault of this one.
    let others = ["--set", "name=other"];
    let output = yard.marsyard(["explain", "corpus", "--scene", "1", "--cell", cell].iter().chain(&others));
    let under_others = text(&output.stdout);
    assert!(
        output.status.success() && under_others.contains("--set makes another plan than the corpus's"),
        "{under_others}"
    );
    // The arithmetic of a neighbour names the cell beside, and its own mean.
    let (row, col) = cell.split_once(',').map(|(r, c)| (r.parse::<i32>().unwrap(), c.parse::<i32>().unwrap())).unwrap();
    let west = said.lines().find(|line| line.trim_start().starts_with("neighbour_w_m")).expect("a neighbour's line");
    assert!(west.contains(&format!("cell {row},{}", col - 1)), "{west}");
}

#[test]
fn law_plan_names_the_parts_in_words_and_json_parses() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    let output = yard.marsyard(["plan", &config, "--limit", "1"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    for part in ["rocks", "kapvik, 3 stops, all kept", "mixed_pixels", "points table", "no shard is in the test split"]
    {
        assert!(said.contains(part), "{part} is not in:\n{said}");
    }
    let output = yard.marsyard(["plan", &config, "--json", "--limit", "1"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON on stdout");
    assert_eq!(json["scenes"], 8);
    let prices = json["families"][0]["cpu_s_of_parts"].as_object().expect("prices of parts");
    assert!(prices["mixed_pixels"]["cpu_s"].as_f64().is_some_and(f64::is_finite));
    assert!(!prices.contains_key("dead_reckoning"), "a part that is not on has a price");
}

#[test]
fn equal_plan_of_all_scenes_and_the_corpus() {
    let yard = Yard::new();
    let config = Yard::everything();
    yard.generate(&config, "corpus", &[]);
    let config = config.display().to_string();
    let entries = || std::fs::read_dir(yard.path("")).expect("the folder").count();
    let before = entries();
    // More scenes than there are: each is run once, and nothing is left to guess.
    let output =
        yard.marsyard(["plan", &config, "--json", "--no-parts", "--sample", "99", "--out", "elsewhere/corpus"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON on stdout");
    let manifest = std::fs::read(yard.path("corpus/manifest.json")).expect("a manifest");
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).expect("a manifest");
    let estimate = &json["estimate"];
    assert_eq!(estimate["scenes_measured"], 8);
    assert_eq!(estimate["rows"]["value"].as_f64(), manifest["tables"]["cells"]["rows"].as_f64());
    assert_eq!(estimate["rows"]["standard_error"], 0.0);
    let tables = manifest["tables"].as_object().expect("tables").values();
    let there: f64 = tables.map(|table| table["bytes"].as_f64().expect("bytes")).sum();
    let receipts = std::fs::read_dir(yard.path("corpus/receipts")).expect("receipts");
    let there = there + receipts.map(|entry| entry.unwrap().metadata().unwrap().len() as f64).sum::<f64>();
    let ratio = estimate["bytes"]["value"].as_f64().expect("bytes") / there;
    assert!((ratio - 1.0).abs() < 0.15, "bytes are estimated at {ratio} of what they are");
    assert!(estimate["storage"]["bytes_per_s"].as_f64().is_some_and(|rate| rate > 0.0));
    let url = format!("file://{}", yard.path("elsewhere/corpus").display());
    let output = yard.marsyard(["plan", &config, "--json", "--no-parts", "--sample", "1", "--out", &url]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("bytes_per_s"), "a file:// place is measured, too");
    assert!(!yard.path("elsewhere").exists(), "the probe left something behind");
    assert_eq!(entries(), before, "the probe left something behind");
}

#[test]
fn law_an_interrupted_plan_leaves_nothing_at_the_place() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    // So many scenes that the signal comes in time however fast the machine is.
    let arguments = ["plan", &config, "--set", "scenes=80000", "--sample", "80000", "--out", "there"];
    let mut command = yard.command(arguments);
    command.stderr(std::process::Stdio::piped()).stdout(std::process::Stdio::null());
    let child = command.spawn().expect("the binary starts");
    std::thread::sleep(std::time::Duration::from_secs(2));
    let output = stopped(child, "-INT");
    assert!(text(&output.stderr).contains("there is no estimate"), "{}", text(&output.stderr));
    assert_eq!(std::fs::read_dir(yard.path("")).expect("the folder").count(), 0, "something was left");
}

#[test]
fn law_a_held_out_family_without_a_test_shard_is_warned_of() {
    let yard = Yard::new();
    let mixed = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/mixed.yaml").display().to_string();
    let plan = |scenes: &str| {
        let output = yard.marsyard(["plan", &mixed, "--sample", "0", "--set", scenes]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let few = plan("scenes=300");
    assert!(few.contains("held out for the test split, which has no shard, so that no scene of them is built: unseen_pattern, unseen_density"), "{few}");
    assert!(!plan("scenes=350").contains("warning"), "from seven shards on nothing is missing");
}

#[test]
fn extreme_nobody_reads_stderr() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    for arguments in [
        vec!["generate", config.as_str(), "--out", "corpus"],
        vec!["--log", "json", "generate", config.as_str(), "--out", "other"],
        vec!["status", "nowhere"],
    ] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let status = yard.command(&arguments).stderr(writer).status().expect("the binary starts");
        let wanted = if arguments[0] == "status" { 2 } else { 0 };
        assert_eq!(status.code(), Some(wanted), "{arguments:?}");
    }
    crate::yard::assert_same(&yard.identity("corpus"), &yard.identity("other"));
}

#[test]
fn extreme_nobody_reads_the_completions() {
    let yard = Yard::new();
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let output = yard.command(["completions", "bash"]).stdout(writer).output().expect("the binary starts");
    assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""));
}

#[test]
fn law_commands_that_are_printed_are_as_a_shell_takes_them() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    let generate = |more: &[&str]| {
        let output = yard.marsyard(["generate", &config, "--out", "my corpus"].iter().chain(more));
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stderr)
    };
    assert!(generate(&["--shards", "0/2"]).contains("marsyard finalize 'my corpus'"));
    let status = || text(&yard.marsyard(["status", "my corpus"]).stdout);
    assert!(status().contains("not finished: `marsyard generate 'my corpus'` does that"), "{}", status());
    generate(&["--shards", "1/2"]);
    assert!(status().contains("not finished: `marsyard finalize 'my corpus'` does that"), "{}", status());
    assert!(generate(&[]).contains("next: marsyard inspect 'my corpus'"));
    assert!(!status().contains("not finished"), "{}", status());
}

#[test]
fn law_machines_are_told_of_all_in_json() {
    let yard = Yard::new();
    std::fs::write(yard.path("bad.yaml"), "marsyard: 1\nname: bad\nseed: 1\nscenes: ten\n").expect("a file");
    yard.generate(&Yard::everything(), "corpus", &[]);
    let lines = |arguments: &[&str]| -> Vec<serde_json::Value> {
        let output = yard.marsyard(["--log", "json"].iter().chain(arguments));
        let said = text(&output.stderr);
        said.lines()
            .map(|line| serde_json::from_str(line).unwrap_or_else(|_| panic!("{arguments:?}: {line}")))
            .collect()
    };
    let faults = lines(&["plan", "bad.yaml"]);
    let is_placed =
        |fault: &serde_json::Value| fault["file"] == "bad.yaml" && fault["line"] == 4 && fault["column"] == 9;
    assert!(faults.iter().any(is_placed), "{faults:?}");
    for arguments in [&["verify", "corpus"] as &[&str], &["preview", "corpus", "--scene", "0", "--out", "seen"]] {
        assert!(lines(arguments).iter().any(|line| line["level"] == "INFO"), "{arguments:?}");
    }
}

#[test]
fn law_a_file_or_folder_that_is_missing_is_named_as_it_was_given() {
    let yard = Yard::new();
    let model = crate::classify::model_file(&yard);
    for (arguments, named, not_said) in [
        (vec!["export", &model, "--onnx", "none/k.onnx"], "none: there is no such file or folder", "k.onnx"),
        (vec!["train", "corpus", "--config", "none.yaml"], "the config cannot be read", "is not shown"),
    ] {
        let said = text(&yard.marsyard(&arguments).stderr);
        assert!(said.contains(named) && !said.contains(not_said), "{arguments:?}: {said}");
    }
}

#[test]
fn law_a_folder_that_is_not_there_is_told_as_such() {
    let yard = Yard::new();
    for verb in ["status", "finalize", "inspect", "verify", "train", "search"] {
        let output = yard.marsyard([verb, "nowhere"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{verb}: {said}");
        assert!(said.contains("nowhere: no such folder"), "{verb}: {said}");
    }
}

#[test]
fn law_the_binary_imports_no_transcendental_function() {
    let output =
        std::process::Command::new("nm").args(["-D", "--undefined-only", env!("CARGO_BIN_EXE_marsyard")]).output();
    let output = output.expect("nm, from binutils, which a C compiler brings");
    let symbols = text(&output.stdout);
    let imported: Vec<&str> = symbols
        .lines()
        .filter_map(|line| line.split_whitespace().last()?.split('@').next())
        .filter(|symbol| NAMES.split(' ').any(|name| *symbol == name || symbol.strip_suffix('f') == Some(name)))
        .collect();
    assert!(symbols.contains("malloc"), "nm lists what is imported: {symbols}");
    assert!(imported.is_empty(), "{imported:?} come from the C library: their bits depend on the machine");
}

/// Functions of the C library whose last bits differ between machines, each with its f32 twin in `f`. Not `fma`, `sqrt`,
/// `floor` and their like: IEEE 754 leaves them no choice.
const NAMES: &str = "sin cos sincos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 exp10 expm1 log log2 \
                     log10 log1p pow hypot cbrt erf erfc lgamma tgamma";

#[test]
fn law_a_corpus_without_a_cell_fails_with_the_reason() {
    let yard = Yard::new();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml").display().to_string();
    let blind = ["--set", "sweep.effects.dropout={rate: 1}", "--out", "blind"];
    let output = yard.marsyard(["generate", &config].into_iter().chain(blind));
    let said = text(&output.stderr).replace("\n  │ ", " ");
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("14 scenes gave 0 cells") && said.contains("no beam of a kept sweep came back"), "{said}");
    assert!(!said.contains("next:"), "{said}");
    let output = yard.marsyard(["train", "blind"]);
    let said = text(&output.stderr).replace("\n  │ ", " ");
    assert!(!output.status.success() && said.contains("no sweep of its scenes fell into one"), "{said}");
    let output = yard.marsyard(["finalize", "blind"]);
    assert_eq!(output.status.code(), Some(1), "finalize says it, too: {}", text(&output.stderr));
}

#[test]
fn law_a_file_in_the_place_of_a_folder_is_told_without_an_error_number() {
    let yard = Yard::new();
    std::fs::write(yard.path("file"), "mine").expect("a file");
    let config = Yard::everything().display().to_string();
    for (out, word) in [("file", "a file is where a folder should be"), ("/proc/none", "choose another folder")] {
        let output = yard.marsyard(["generate", &config, "--out", out]);
        let said = text(&output.stderr).replace("\n        ", " ");
        assert!(!output.status.success() && said.contains(word) && !said.contains("os error"), "{out}: {said}");
    }
    assert_eq!(std::fs::read(yard.path("file")).expect("the file"), b"mine");
}

#[test]
fn law_help_lists_what_can_be_given_and_wraps_once() {
    let yard = Yard::new();
    let help = |arguments: &[&str]| text(&yard.marsyard(arguments).stdout);
    let schema = help(&["schema", "--help"]);
    assert!(["manifest", "cells", "train"].iter().all(|file| schema.contains(file)), "{schema}");
    assert!(help(&["schema", "receipt"]).contains("$schema"));
    assert!(help(&["search", "--help"]).contains("[default: 2,4,8,16,24,32]"));
    // Lines of a paragraph are filled: none but the last ends before its half.
    let whole = help(&["--help"]);
    let paragraph: Vec<&str> = whole.split("\n\n").nth(1).expect("a second paragraph").lines().collect();
    let (_, filled) = paragraph.split_last().expect("lines");
    assert!(filled.iter().all(|line| line.len() > 50), "{paragraph:?}");
}

#[test]
fn law_failed_scenes_are_listed_with_their_replay_and_fail_the_run_past_the_share() {
    let yard = Yard::new();
    // No random ground of this roughness stays under a degree of slope.
    let steep = |share: &str| {
        let config = Yard::everything().display().to_string();
        let share = format!("max_failed_share={share}");
        let extra = ["--set", "scene.ground.max_slope_deg=0.1", "--set", &share, "--out", &share];
        yard.marsyard(["generate", &config].into_iter().chain(extra))
    };
    let output = steep("0.5");
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(said.contains("8 of 8 scenes failed") && said.contains("--scene 0"), "{said}");
    let manifest = std::fs::read(yard.path("max_failed_share=0.5/manifest.json")).expect("a manifest all the same");
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).expect("JSON");
    assert_eq!(manifest["failed"].as_array().map(Vec::len), Some(8));
    assert!(manifest["failed"][3]["replay"].as_str().is_some_and(|r| r.contains("--scene 3")), "{manifest}");
    let all = steep("1");
    assert!(all.status.success(), "all may fail where the config says so");
    assert!(!text(&all.stderr).contains("next:"), "there is nothing to look at: {}", text(&all.stderr));
    let part = Yard::everything().display().to_string();
    let steep = ["--set", "scene.ground.max_slope_deg=0.1", "--shards", "0/2", "--out", "part"];
    let output = yard.marsyard(["generate", &part].into_iter().chain(steep));
    assert!(output.status.success(), "a part is not judged: {}", text(&output.stderr));
    let output = yard.marsyard(["finalize", "max_failed_share=0.5"]);
    assert_eq!(output.status.code(), Some(1), "finalize judges the same share");
    let output = yard.marsyard(["explain", "max_failed_share=0.5", "--scene", "3"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stdout).contains("scene.rocks.count"), "a failed scene's draws are told");
}
