//! The contract of `plan` without hours: what it says of the machine, of its own limits, and of a corpus that would be of little use.

use std::path::Path;

use crate::yard::{Yard, text};

fn shipped(path: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path).display().to_string()
}

/// What `plan` says of the small corpus with some keys set.
fn said(extra: &[&str]) -> String {
    said_of("tests/fixtures/training.yaml", &[&["--limit", "1", "--no-parts"], extra].concat())
}

/// What it says of another.
fn said_of(config: &str, extra: &[&str]) -> String {
    let config = shipped(config);
    let output = Yard::new().marsyard(["plan", config.as_str()].iter().chain(extra));
    assert!(output.status.success(), "{extra:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

#[test]
fn law_a_corpus_that_does_not_fit_on_the_disk_is_told() {
    let large = said(&["--set", "scenes=900000000", "--set", "scenes_per_shard=10000"]);
    assert!(large.contains("warning: the build takes ") && large.contains("B for it: lower scenes"), "{large}");
    assert!(!said(&[]).contains("warning: the build takes "));
}

#[test]
fn law_more_threads_than_cores_are_told_and_not_measured() {
    let many = said(&["--threads", "4000"]);
    assert!(many.contains("4000 threads are asked for and this machine has "), "{many}");
    assert!(many.contains("on 4000 cores as fast as these, all free, it would be some "), "{many}");
    assert!(many.contains("(extrapolated: the CPU time over the threads)"), "{many}");
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    assert!(many.contains(&format!(", {cores} at a time, on {cores} core")), "{many}");
    assert!(!said(&["--threads", "1"]).contains("extrapolated"));
}

#[test]
fn law_a_plan_whose_scenes_all_fail_ends_with_the_reason() {
    let config = shipped("tests/fixtures/training.yaml");
    let crowded = "scene.rocks={count: 2000, diameter_m: 0.9}";
    let output = Yard::new().marsyard(["plan", &config, "--limit", "1", "--set", crowded]);
    assert_eq!((output.status.code(), text(&output.stdout).as_str()), (Some(1), ""));
    let words = text(&output.stderr);
    assert!(words.contains("sampled scenes fail, so there is nothing to estimate"), "{words}");
    assert!(words.contains("no place to start"), "{words}");
}

#[test]
fn law_what_makes_a_corpus_useless_is_told_in_a_line_each() {
    let bare = said(&["--set", "cells.labels.obstacle={taller_than_m: 5}"]);
    assert!(bare.contains("advice: no untraversable cell: none of "), "{bare}");
    let far = ["cells.max_range_m=1", "cells.size_m=0.02", "drive.path={toward_obstacle: {length_m: 9}}"];
    let weak = said(&far.map(|set| ["--set", set]).concat());
    for words in [
        "advice: drives that end before their length or goal, so that scans repeat one view: 100 %",
        "advice: cells with 1 or 2 points: ",
        "advice: returns beyond cells.max_range_m, cast and not read: ",
    ] {
        assert!(weak.contains(words), "{words} is not in:\n{weak}");
    }
}

#[test]
fn law_held_out_families_with_too_few_test_scenes_are_one_line() {
    let config = shipped("configs/mixed.yaml");
    let few = ["--limit", "1", "--no-parts", "--set", "scenes=70", "--set", "scenes_per_shard=10"];
    let output = Yard::new().marsyard(["plan", config.as_str()].iter().chain(&few));
    let words = text(&output.stdout);
    let lines: Vec<&str> = words.lines().filter(|line| line.contains("test scenes to tell 1 point")).collect();
    let [line] = lines.as_slice() else { panic!("{words}") };
    assert!(line.contains("unseen_kinds ") && line.contains("unseen_slope "), "{line}");
}

#[test]
fn law_parts_that_were_not_resolved_are_one_line_and_never_infinite() {
    let config = shipped("tests/fixtures/training.yaml");
    let output = Yard::new().marsyard(["plan", config.as_str(), "--limit", "0.01"]);
    let words = text(&output.stdout);
    assert!(output.status.success() && words.contains("what each part costs"), "{words}");
    assert!(!words.contains("inf"), "{words}");
    let unresolved = |line: &&str| line.contains("ms each: ") || line.contains("without an error: ");
    assert!(words.lines().filter(unresolved).count() <= 1, "{words}");
    // A part that was not resolved is named all the same.
    assert!(words.contains("range_noise"), "{words}");
    // One scene tells no error, and is not told to have none.
    let output = Yard::new().marsyard(["plan", config.as_str(), "--sample", "1", "--no-parts"]);
    let words = text(&output.stdout);
    assert!(output.status.success() && words.contains("no family had two measured scenes"), "{words}");
    assert!(!words.contains("inf") && !words.contains("\u{b1} 0.0 %"), "{words}");
    // Nor do families of which none was run.
    let output = Yard::new().marsyard(["plan", &shipped("configs/mixed.yaml"), "--sample", "3", "--no-parts"]);
    assert!(text(&output.stdout).contains("rows of cells (\u{b1} ?)"), "{}", text(&output.stdout));
}

#[test]
fn equal_plan_and_inspect_show_the_same_views_and_say_where_one_bearing_rules() {
    let yard = Yard::new();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml");
    // A rover that drives at the nearest rock, and no farther.
    let extra = ["--set", "scenes=28"];
    yard.generate(&config, "corpus", &extra);
    let config = config.display().to_string();
    let planned = ["plan", &config, "--no-parts", "--sample", "28", "--json"];
    let json = |output: std::process::Output| -> serde_json::Value {
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", text(&output.stderr)))
    };
    let plan = json(yard.marsyard(planned.iter().chain(&extra)));
    let inspection = json(yard.marsyard(["inspect", "corpus", "--json"]));
    let (views, built) = (&plan["families"][0]["views"], &inspection["views"]["default"]);
    assert_eq!(views, built);
    let sum =
        |of: &str| views[of].as_array().expect("counts").iter().filter_map(serde_json::Value::as_u64).sum::<u64>();
    assert_eq!((views["scans"].as_u64(), sum("obstacles_in_view")), (Some(28), 28));
    assert!(sum("nearest_bearings") > 20 && sum("nearest_ranges") == sum("nearest_bearings"), "{views}");
    let drives = &plan["families"][0]["drives"];
    let told = format!("drives that end before their length or goal: {} of 28\n", drives["cut_short"]);
    assert_eq!(drives["driven"], 28);
    assert!(
        (1..28).contains(&drives["cut_short"].as_u64().expect("a count")),
        "rocks end some drives, not all: {drives}"
    );
    for arguments in [&["plan", &config, "--no-parts", "--sample", "28"][..], &["inspect", "corpus"]] {
        let more = if arguments[0] == "plan" { &extra[..] } else { &[] };
        let words = text(&yard.marsyard(arguments.iter().chain(more)).stdout);
        assert_eq!(words.contains(&told), arguments[0] == "plan", "{words}");
        for part in [
            "what 28 kept scans show of obstacles:",
            "bearing of the nearest, degrees (0 ahead, left positive)",
            "   165 to -165 ",
            "range of the nearest, m",
            "obstacles in view",
            "advice: scans whose nearest obstacle stands in the same sector of 30 degrees: ",
            "% straight ahead",
        ] {
            assert!(words.contains(part), "{part} is not in:\n{words}");
        }
    }
}

#[test]
fn law_what_the_config_names_in_place_of_its_fidelity_is_told_with_the_key_that_takes_the_words() {
    let of = |sets: &[&str]| {
        let sets = sets.iter().flat_map(|set| ["--set", *set]);
        said_of("configs/paper.yaml", &["--sample", "0"].into_iter().chain(sets).collect::<Vec<_>>())
    };
    // paper.yaml names the keys itself, so that the word changes nothing of it.
    let paper = of(&["fidelity=draft"]);
    for own in ["drive.contact", "slam"] {
        assert!(paper.contains(&format!("  but the config names {own} itself, which wins: --set '{own}=")), "{paper}");
    }
    let with_words = of(&["fidelity=draft", "slam={surrogate: {}}", "drive.contact=plane_fit"]);
    assert!(with_words.contains("fidelity draft: ") && !with_words.contains("but the config names"), "{with_words}");
    let json = said_of("configs/paper.yaml", &["--sample", "0", "--json", "--set", "fidelity=draft"]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON on stdout");
    assert_eq!(json["own_choices"], serde_json::json!(["drive.contact", "slam"]));
}

#[test]
fn law_parts_that_were_not_reached_are_told_of_families_that_the_plan_has_scenes_of() {
    let few = ["--set", "scenes=3", "--set", "scenes_per_shard=1", "--limit", "0.001"];
    let of = |extra: &[&str]| said_of("configs/mixed.yaml", &[&few, extra].concat());
    let (told, without) = (of(&[]), of(&["--no-parts"]));
    let families = told.matches("\nfamily ").count();
    let parts = told.matches("what each part costs").count();
    assert!(families == 15 && (1..=3).contains(&parts), "{parts} of {families}: {told}");
    assert!(!without.contains("what each part costs"), "{without}");
}
