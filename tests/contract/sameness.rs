//! The contract: *the same plan gives the same bytes*, for any number of threads, any order of shards, after any kill and
//! resume, on any set of vector instructions. The corpus uses every stage and every effect, so that a draw or a sum that
//! depends on the schedule shows; stages are compared by the hashes of their f64 results as well, since f32 columns hide
//! differences. `scripts/trust/` does the same many times over.

use std::collections::BTreeSet;
use std::time::Duration;

use crate::yard::{Yard, assert_same, text};

/// Asserts that two corpora have the same files, and their scenes the same f64 results in every stage.
fn assert_equal(yard: &Yard, left: &str, right: &str) {
    assert_same(&yard.identity(left), &yard.identity(right));
    let (left, right) = (yard.stage_hashes(left), yard.stage_hashes(right));
    assert!(!left.is_empty());
    assert_eq!(left, right, "stages differ below f32");
}

#[test]
fn law_the_corpus_of_these_tests_names_every_part_that_a_plan_can_have() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    let absent = |sets: &[&str]| -> BTreeSet<String> {
        let said = text(&yard.marsyard([&["plan", &config, "--sample", "0"], sets].concat()).stdout);
        let absent =
            said.lines().find_map(|line| line.strip_prefix("not named in the config")).expect("what is absent");
        let (_, names) = absent.split_once(": ").unwrap_or_default();
        names.split(", ").map(String::from).filter(|name| !name.is_empty()).collect()
    };
    let of_all = LABELS_OF_PLACES.iter().fold(absent(&[]), |all, (_, sets)| &all & &absent(sets));
    assert_eq!(of_all, BTreeSet::new());
    // Parts that `plan` does not list one by one: whatever the schema knows.
    let schema: serde_json::Value =
        serde_json::from_slice(&yard.marsyard(["schema", "corpus"]).stdout).expect("a schema");
    let config: serde_json::Value =
        serde_saphyr::from_str(&std::fs::read_to_string(Yard::everything()).expect("the config")).expect("YAML");
    for (definition, section) in [
        ("SceneParams", &config["scene"]),
        ("VegetationParams", &config["scene"]["vegetation"]),
        ("TreesParams", &config["scene"]["trees"]),
        ("ControlNoise", &config["drive"]["control_noise"]),
        ("Effects", &config["sweep"]["effects"]),
    ] {
        let known = schema["$defs"][definition]["properties"].as_object().expect("a definition of the schema");
        for part in known.keys() {
            assert!(!section[part].is_null(), "{definition}: {part} is not in everything.yaml");
        }
    }
}

#[test]
fn equal_bytes_for_one_two_three_and_seven_threads() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "one", &["--threads", "1"]);
    assert!(yard.identity("one").keys().any(|name| name.starts_with("data/points/")));
    for threads in ["2", "3", "7"] {
        yard.generate(&Yard::everything(), threads, &["--threads", threads]);
        assert_equal(&yard, "one", threads);
    }
}

/// Roughness and landforms make a ground a raster; without them it stays the polynomial.
const POLYNOMIAL: [&str; 4] = ["--set", "scene.ground.roughness=null", "--set", "scene.ground.features=[]"];

#[test]
fn equal_bytes_of_polynomial_grounds_for_one_and_three_threads() {
    let yard = Yard::new();
    for threads in ["1", "3"] {
        yard.generate(&Yard::everything(), threads, &[&POLYNOMIAL[..], &["--threads", threads]].concat());
    }
    assert_equal(&yard, "1", "3");
}

/// What everything.yaml cannot name at once: labels by the rover stand in the place of labels by points, frames fitted to a sweep in
/// the place of a window of sweeps, drives over bodies in the place of drives through them, and crowns so low that beams meet them. All
/// look at the ground around the points, and at cells that hold none.
const LABELS_OF_PLACES: [(&str, &[&str]); 6] = [
    ("holes", &["--set", "cells.unseen={}", "--set", AROUND, "--set", "cells.labels.max_drop_m=0.1", "--set", HOLES]),
    ("rover", &["--set", "cells.unseen={}", "--set", "cells.labels={rover: {}}", "--set", HOLES]),
    ("pose", &["--set", "cells.labels={rover: {pose: true}}", "--set", HOLES]),
    ("drive", &["--set", "drive.over_bodies=true", "--set", "cells.labels={rover: {}}", "--set", HOLES]),
    ("overhang", &["--set", "cells.overhang={above_m: 0.4}", "--set", "cells.unseen={}", "--set", LOW_CROWNS]),
    ("plane", &["--set", FRAME, "--set", "cells.unseen={}", "--set", "cells.labels={rover: {}}", "--set", HOLES]),
];
const LOW_CROWNS: &str =
    "scene.trees={count: 6, diameter_m: 0.2, height_m: 1, crown: {diameter_m: 1.5, extinction_per_m: 4}}";
const AROUND: &str = "cells={local_height: {plane: true}, curvature: {}, surroundings: {}, beams: {}}";
const FRAME: &str = "cells={window_scans: 1, frame: fitted_plane}";
const HOLES: &str = "scene.ground.features=[{trench: {count: 2, depth_m: 0.4, width_m: 0.5, length_m: 3}}, \
                     {hole: {count: 4, depth_m: 0.4, width_m: 0.8}}, {drop_off: {count: 1, depth_m: 0.3, width_m: 2}}]";

#[test]
fn equal_bytes_of_labels_of_places_for_any_threads_and_kernels() {
    let yard = Yard::new();
    for (labels, sets) in LABELS_OF_PLACES {
        let name = |how: &str| format!("{labels}-{how}");
        yard.generate(&Yard::everything(), &name("one"), &[sets, &["--threads", "1"]].concat());
        yard.generate(&Yard::everything(), &name("three"), &[sets, &["--threads", "3"]].concat());
        yard.generate_with(&Yard::everything(), &name("plain"), sets, &[("MARSYARD_KERNELS", "plain")]);
        assert_equal(&yard, &name("one"), &name("three"));
        assert_equal(&yard, &name("one"), &name("plain"));
    }
}

#[test]
fn equal_bytes_of_plain_and_vector_kernels() {
    let yard = Yard::new();
    for (ground, extra) in [("raster", &[][..]), ("polynomial", &POLYNOMIAL[..])] {
        let name = |kernels: &str| format!("{ground}-{kernels}");
        yard.generate(&Yard::everything(), &name("widest"), extra);
        for kernels in ["plain", "avx2"] {
            yard.generate_with(&Yard::everything(), &name(kernels), extra, &[("MARSYARD_KERNELS", kernels)]);
            assert_equal(&yard, &name("widest"), &name(kernels));
        }
    }
    let refused =
        yard.command(["schema", "corpus"]).env("MARSYARD_KERNELS", "sse").output().expect("the binary starts");
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("plain, avx2, avx512"), "{}", text(&refused.stderr));
}

#[test]
fn equal_bytes_for_shards_in_any_order_by_processes_of_their_own() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "whole", &[]);
    for shards in ["3", "0,2", "1..3"] {
        yard.generate(&Yard::everything(), "apart", &["--shards", shards]);
    }
    let output = yard.marsyard(["finalize", "apart"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_equal(&yard, "whole", "apart");
}

#[test]
fn equal_bytes_from_twenty_fresh_processes() {
    let yard = Yard::new();
    for run in 0..20 {
        yard.generate(&Yard::everything(), &run.to_string(), &["--shards", "1", "--threads", "2"]);
        assert_equal(&yard, "0", &run.to_string());
    }
}

#[test]
fn equal_bytes_for_parts_of_a_plan_that_was_laid_down() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "whole", &[]);
    yard.generate(&Yard::everything(), "parts", &["--plan-only"]);
    let laid: Vec<String> = yard.identity("parts").into_keys().collect();
    assert_eq!(laid, ["plan.yaml"], "nothing is built");
    // The corpus is its own config; a part of more parts than shards is empty, and what is there is not built again.
    for shards in ["2/3", "0/3", "1,0..2", "5/6"] {
        let output = yard.marsyard(["generate", "parts", "--shards", shards]);
        assert!(output.status.success(), "{shards}: {}", text(&output.stderr));
    }
    assert!(!yard.path("parts/manifest.json").exists(), "a part leaves the whole to finalize");
    let output = yard.marsyard(["finalize", "parts"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_same(&yard.identity("whole"), &yard.identity("parts"));
}

#[test]
fn equal_bytes_after_kills_and_resumes() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "whole", &[]);
    let config = Yard::everything().display().to_string();
    // Kill at growing delays until a run gets through: kills fall into every phase of the build.
    let mut kills = 0;
    for delay_ms in (20..).step_by(60) {
        let mut child = yard
            .command(["generate", &config, "--out", "killed", "--threads", "1", "--stage-hashes", "killed.hashes"])
            .stderr(std::process::Stdio::null())
            .spawn()
            .expect("the binary starts");
        std::thread::sleep(Duration::from_millis(delay_ms));
        if let Some(status) = child.try_wait().expect("a child to wait for") {
            assert!(status.success());
            break;
        }
        child.kill().expect("a child to kill");
        child.wait().expect("a child to wait for");
        kills += 1;
    }
    assert!(kills > 0, "no run was killed: the build is quicker than the first delay");
    // The run that got through has swept what the killed ones left.
    assert_equal(&yard, "whole", "killed");
}

#[test]
fn equal_bytes_with_fma_and_avx2_hidden_from_the_c_library() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "shown", &["--shards", "0..1"]);
    let hidden = [("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F")];
    yard.generate_with(&Yard::everything(), "hidden", &["--shards", "0..1"], &hidden);
    assert_equal(&yard, "shown", "hidden");
    // Plain kernels call the C library's fma, which is then a routine without the instruction.
    let both = [hidden[0], ("MARSYARD_KERNELS", "plain")];
    yard.generate_with(&Yard::everything(), "plain", &["--shards", "0..1"], &both);
    assert_equal(&yard, "shown", "plain");
}

#[test]
#[ignore = "needs qemu-x86_64 (Debian's qemu-user): cargo test --release --test contract emulated -- --ignored"]
fn equal_bytes_on_an_emulated_processor_without_fma() {
    let yard = Yard::new();
    let tiny = ["--set", "scenes_per_shard=1", "--set", "scenes=1"];
    for (ground, extra) in [("raster", &[][..]), ("polynomial", &POLYNOMIAL[..])] {
        let extra = [&tiny[..], extra].concat();
        yard.generate(&Yard::everything(), ground, &extra);
        let emulated = format!("{ground}-emulated");
        let hashes = format!("{emulated}.hashes");
        let output = std::process::Command::new("qemu-x86_64")
            .args(["-cpu", "Nehalem", env!("CARGO_BIN_EXE_marsyard"), "generate"])
            .arg(Yard::everything())
            .args(["--out", &emulated, "--stage-hashes", &hashes])
            .args(&extra)
            .current_dir(yard.path(""))
            .output()
            .expect("qemu-x86_64 starts");
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert_equal(&yard, ground, &emulated);
    }
}

#[test]
fn law_raising_scenes_only_adds_shards() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "small", &["--set", "scenes=4"]);
    let small = yard.identity("small");
    yard.generate(&Yard::everything(), "small", &[]);
    let large = yard.identity("small");
    for (name, bytes) in small.iter().filter(|(name, _)| name.starts_with("data/") || name.starts_with("receipts/")) {
        assert!(bytes == &large[name], "{name} changed");
    }
    yard.generate(&Yard::everything(), "whole", &[]);
    assert_same(&yard.identity("whole"), &large);
}
