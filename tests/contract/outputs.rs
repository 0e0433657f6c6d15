//! Far and absurd inputs end at once with a word, and what is told and written is so.

use std::time::{Duration, Instant};

use crate::yard::{Yard, text};

/// A yard with a model, a scan of nine points a metre apart.
fn yard() -> (Yard, String) {
    let yard = Yard::new();
    let model = crate::classify::model_file(&yard);
    let points: String = (0..9).map(|k| format!("{},{},0\n", k % 3 + 1, k / 3)).collect();
    std::fs::write(yard.path("a.csv"), format!("x,y,z\n{points}")).expect("a file");
    (yard, model)
}

#[test]
fn regress_poses_beyond_the_world_are_refused_within_a_moment() {
    let (yard, model) = yard();
    std::fs::write(yard.path("far.tum"), "0 1e17 0 0 0 0 0 1\n").expect("a file");
    for place in [["--pose", "1e15,0,0,0,0,0"], ["--trajectory", "far.tum"]] {
        let begun = Instant::now();
        let output = yard.marsyard(["classify", &model, "a.csv"].iter().chain(&place));
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains("subtract the origin"), "{place:?}: {said}");
        assert!(begun.elapsed() < Duration::from_secs(10), "{place:?}: {:?}", begun.elapsed());
    }
}

#[test]
fn law_the_earth_s_own_coordinates_are_judged() {
    let (yard, model) = yard();
    let output = yard.marsyard(["classify", &model, "a.csv", "--pose=445000,5030000,200,0,0,0", "--out", "utm"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let pcd = std::fs::read(yard.path("utm/a-labelled.pcd")).expect("a cloud");
    let back = marsyard::cloud::read("a.pcd", &pcd, None, &marsyard::cloud::Options::default()).expect("a cloud");
    let mount_z_m = back.points_m[0].z;
    for (k, point) in back.points_m.iter().enumerate() {
        let there = [445_001.0 + (k % 3) as f64, 5_030_000.0 + (k / 3) as f64, mount_z_m];
        let off = point.to_array().iter().zip(there).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off <= 1e-9, "{point} {there:?}");
    }
}

#[test]
fn law_scans_in_millimetres_and_in_map_coordinates_are_asked_about() {
    let (yard, model) = yard();
    let write = |name: &str, point: &dyn Fn(f64, f64) -> [f64; 3]| {
        let points = (0..400).map(|k| point(f64::from(k % 20) - 9.5, f64::from(k / 20) - 9.5));
        let lines: String = points.map(|[x, y, z]| format!("{x},{y},{z}\n")).collect();
        std::fs::write(yard.path(name), format!("x,y,z\n{lines}")).expect("a file");
    };
    write("mm.csv", &|x, y| [1000.0 * x, 1000.0 * y, -500.0]);
    write("utm.csv", &|x, y| [445_000.0 + x, 5_030_000.0 + y, 200.0]);
    for (cloud, question) in [("mm.csv", "are these millimetres?"), ("utm.csv", "Subtract the origin")] {
        for (place, code) in [(["--sensor-height", "0.5"], 2), (["--pose", "0,0,0,0,0,0"], 1)] {
            let output = yard.marsyard(["classify", &model, cloud].iter().chain(&place));
            let said = text(&output.stderr).replace(['\n', '│'], " ").split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(output.status.code(), Some(code), "{cloud} {place:?}: {said}");
            assert!(said.contains(question), "{cloud} {place:?}: {said}");
        }
    }
}

#[test]
fn extreme_links_to_devices_and_endless_files_are_not_read() {
    let (yard, model) = yard();
    let pose = "--pose=0,0,0,0,0,0";
    std::os::unix::fs::symlink("/dev/zero", yard.path("zero.csv")).expect("a link");
    for arguments in
        [vec!["zero.csv", pose], vec!["a.csv", pose, "--labels", "zero.csv"], vec!["a.csv", "--trajectory", "zero.csv"]]
    {
        let begun = Instant::now();
        let output = yard.marsyard(["classify", &model].iter().chain(&arguments));
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains("device"), "{arguments:?}: {said}");
        assert!(begun.elapsed() < Duration::from_secs(10), "{arguments:?}");
    }
}

#[test]
fn regress_absurd_numbers_of_threads_are_refused() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    for threads in ["0", "5000", "9223372036854775807"] {
        for arguments in [vec!["generate", &config, "--out", "c"], vec!["train", "c"]] {
            let output = yard.marsyard(arguments.into_iter().chain(["--threads", threads]));
            let said = text(&output.stderr);
            assert!(output.status.code() == Some(2) && said.contains("thread"), "{threads}: {said}");
        }
    }
    assert!(!yard.path("c").exists(), "nothing is written");
}

#[test]
fn regress_a_corpus_names_no_host_and_writing_is_a_share() {
    let yard = Yard::new();
    let config = Yard::everything().display().to_string();
    let output = yard.marsyard(["generate", &config, "--out", "c", "--threads", "3"]);
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    let share = said.split("writing ").nth(1).and_then(|rest| rest.split(" %").next()).expect("a share");
    let share: f64 = share.parse().expect("a number");
    assert!((0.0..=100.0).contains(&share), "{said}");
    let report = std::fs::read(yard.path("c/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
    assert!(report.get("host").is_none() && report["threads"] == 3, "{report}");
}

#[test]
fn regress_faults_of_a_place_have_their_exit_code_and_are_told_to_machines() {
    let yard = Yard::new();
    yard.generate(&Yard::everything(), "c", &[]);
    let shard = yard.path("c/data/cells/train-0000001.parquet");
    std::fs::remove_file(&shard).expect("a shard");
    std::fs::create_dir(&shard).expect("a folder in its place");
    let config = Yard::everything().display().to_string();
    let output = yard.marsyard(["--log", "json", "generate", &config, "--out", "c"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let mut events = said.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    let fault = events.rfind(|event| event["event"] == "store_fault").expect("an event");
    assert_eq!(
        (&fault["kind"], &fault["place"], &fault["exit_code"]),
        (&"not_a_file".into(), &"c".into(), &1.into()),
        "{fault}"
    );
}
