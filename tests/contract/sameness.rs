//! The contract: *the same plan gives the same bytes*, for any number of threads, any order of shards, after any kill and
//! resume. The corpus uses every stage and every effect, so that a draw or a sum that depends on the schedule shows.

use std::time::Duration;

use crate::yard::{Yard, assert_same, text};

#[test]
fn equal_bytes_for_one_two_three_and_seven_threads() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "one", &["--threads", "1"]);
    let one = yard.identity("one");
    assert!(one.keys().any(|name| name.starts_with("data/points/")), "{:?}", one.keys());
    for threads in ["2", "3", "7"] {
        yard.generate(&Yard::everything(), threads, &["--threads", threads]);
        assert_same(&one, &yard.identity(threads));
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
    assert_same(&yard.identity("1"), &yard.identity("3"));
}

#[test]
fn equal_bytes_for_shards_built_apart_and_finalized() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "whole", &[]);
    for range in ["3..4", "0..1", "1..3"] {
        yard.generate(&Yard::everything(), "apart", &["--shards", range]);
    }
    let output = yard.marsyard(["finalize", "apart"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_same(&yard.identity("whole"), &yard.identity("apart"));
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
            .command(["generate", &config, "--out", "killed", "--threads", "1"])
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
    // Temporary files of killed processes may lie about; they are never part of the corpus.
    let mut killed = yard.identity("killed");
    killed.retain(|name, _| !name.contains(".tmp"));
    assert_same(&yard.identity("whole"), &killed);
}

#[test]
fn equal_bytes_with_fma_and_avx2_hidden_from_the_c_library() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "plain", &["--shards", "0..1"]);
    let config = Yard::everything().display().to_string();
    let output = yard
        .command(["generate", &config, "--out", "hidden", "--shards", "0..1"])
        .env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F")
        .output()
        .expect("the binary starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_same(&yard.identity("plain"), &yard.identity("hidden"));
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
