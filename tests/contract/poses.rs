//! Poses with their whole covariance, and the filter on recordings: what a reader computes from the files is what the filter believed.

use std::path::Path;

use arrow_array::types::Float64Type;
use arrow_array::{Array, PrimitiveArray, RecordBatch};
use marsyard::config;
use marsyard::corpus::reader::TableFile;
use marsyard::corpus::{LocalFolder, Table};
use marsyard::episode::{Prepared, Scratch, Unobserved, run_scene};
use marsyard::math;
use marsyard::slam::matrix::{cholesky, half_solve, square};
use serde_json::Value as Json;

use crate::yard::{Yard, text};

const STATE: [(&str, &str); 6] =
    [("x", "m"), ("y", "m"), ("z", "m"), ("roll", "rad"), ("pitch", "rad"), ("yaw", "rad")];

fn numbers<'b>(batch: &'b RecordBatch, name: &str) -> &'b PrimitiveArray<Float64Type> {
    batch.column_by_name(name).and_then(|c| c.as_any().downcast_ref()).unwrap_or_else(|| panic!("a column {name}"))
}

/// The normalised error squared of each row, from the table alone; `None` where the covariance has no inverse.
fn nees_of_table(batch: &RecordBatch) -> Vec<Option<f64>> {
    let of_row = |row: usize| {
        let entry = |i: usize, j: usize| {
            let ((a, unit_a), (b, unit_b)) = (STATE[i.min(j)], STATE[i.max(j)]);
            let unit = if unit_a == unit_b { format!("{unit_a}2") } else { format!("{unit_a}_{unit_b}") };
            numbers(batch, &format!("covariance_{a}_{b}_{unit}")).value(row)
        };
        let covariance: [[f64; 6]; 6] = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
        let error: [f64; 6] = std::array::from_fn(|i| {
            let (axis, unit) = STATE[i];
            let sigma = numbers(batch, &format!("sigma_{axis}_{unit}")).value(row);
            assert!((sigma * sigma - covariance[i][i]).abs() <= 1e-15 * covariance[i][i], "{axis} of row {row}");
            let of = |column: &str| numbers(batch, column).value(row);
            let apart = of(&format!("{axis}_{unit}")) - of(&format!("truth_{axis}_{unit}"));
            if i < 3 { apart } else { math::wrap_angle(apart) }
        });
        cholesky(&covariance).map(|factor| square(&half_solve(&factor, &error)))
    };
    (0..batch.num_rows()).map(of_row).collect()
}

#[test]
fn equal_nees_of_a_corpus_and_of_the_filter_that_made_it() {
    let yard = Yard::new();
    let sets = ["pose_covariance=true", "scenes=2", "scenes_per_shard=2"].map(String::from);
    let extra: Vec<&str> = sets.iter().flat_map(|set| ["--set", set.as_str()]).collect();
    yard.generate(&Yard::everything(), "corpus", &extra);
    let table = TableFile::open(&LocalFolder::new(yard.path("corpus")), &Table::Poses.path(0)).expect("a shard");
    let prepared = Prepared::new(config::load(&Yard::everything(), &sets).expect("a plan")).expect("beams");
    let mut judged = 0;
    for scene in 0..2 {
        let Ok(stored) = table.rows_of_scene(scene) else { continue };
        let made = run_scene(&prepared, scene, &mut Scratch::default(), &mut Unobserved);
        let read = nees_of_table(&stored);
        assert_eq!(read.len(), made.poses.len());
        for (read, row) in read.into_iter().zip(&made.poses) {
            let (estimate, truth) = (&row.estimate, &row.truth);
            let apart_m = estimate.pose.position_m - truth.position_m;
            let error = [
                apart_m.x,
                apart_m.y,
                apart_m.z,
                math::wrap_angle(estimate.pose.roll_rad - truth.roll_rad),
                math::wrap_angle(estimate.pose.pitch_rad - truth.pitch_rad),
                math::wrap_angle(estimate.pose.yaw_rad - truth.yaw_rad),
            ];
            let believed = cholesky(&estimate.covariance).map(|factor| square(&half_solve(&factor, &error)));
            match (read, believed) {
                (Some(read), Some(believed)) => {
                    assert!((read - believed).abs() <= 1e-9 * believed.max(1.0), "{read} {believed}");
                    judged += 1;
                }
                (read, believed) => assert_eq!(read.is_some(), believed.is_some()),
            }
        }
    }
    assert!(judged > 10, "{judged} rows have a covariance with an inverse");
}

/// The mean distance of the poses of a corpus from the truth, metres, over all rows.
fn mean_error_m(yard: &Yard, corpus: &str) -> f64 {
    let table = TableFile::open(&LocalFolder::new(yard.path(corpus)), &Table::Poses.path(0)).expect("a shard");
    let (mut sum_m, mut rows) = (0.0, 0);
    for scene in 0..20 {
        let Ok(stored) = table.rows_of_scene(scene) else { continue };
        for row in 0..stored.num_rows() {
            let apart_m = |axis: &str| {
                let of = |column: String| numbers(&stored, &column).value(row);
                of(format!("{axis}_m")) - of(format!("truth_{axis}_m"))
            };
            sum_m += square(&["x", "y", "z"].map(apart_m)).sqrt();
            rows += 1;
        }
    }
    assert!(rows > 100, "{rows}");
    sum_m / f64::from(rows)
}

#[test]
fn law_a_corpus_located_by_registration_is_nearer_to_the_truth_and_the_same_on_any_number_of_threads() {
    let yard = Yard::new();
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/paper.yaml");
    let build = |out: &str, slam: &str, threads: &str| {
        let slam = format!("slam={slam}");
        yard.generate(
            &paper,
            out,
            &["--set", "scenes=20", "--set", "scenes_per_shard=20", "--set", &slam, "--threads", threads],
        );
    };
    build("registered", "{registration: {}}", "1");
    build("again", "{registration: {range_m: 5.3}}", "2");
    build("reckoned", "dead_reckoning", "2");
    let manifest = |out: &str| {
        let text = std::fs::read_to_string(yard.path(out).join("manifest.json")).expect("a manifest");
        serde_json::from_str::<Json>(&text).expect("JSON")["corpus_id"].clone()
    };
    assert!(manifest("registered").is_string());
    assert_eq!(manifest("registered"), manifest("again"));
    let (registered_m, reckoned_m) = (mean_error_m(&yard, "registered"), mean_error_m(&yard, "reckoned"));
    assert!(registered_m < 0.85 * reckoned_m, "{registered_m} {reckoned_m}");
    // Sweeps on the way of a quarter of the beams: other poses, not much farther off, by the same kept sweeps.
    build("thinned", "{registration: {every: 2}}", "2");
    assert_ne!(manifest("registered"), manifest("thinned"));
    let thinned_m = mean_error_m(&yard, "thinned");
    assert!(thinned_m < 0.9 * reckoned_m && thinned_m != registered_m, "{thinned_m} {registered_m} {reckoned_m}");
}

fn logs() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/logs")
}

fn localise(yard: &Yard, extra: &[&str]) -> std::process::Output {
    let file = |name: &str| logs().join(name).display().to_string();
    let (odometry, features, truth) = (file("odometry.csv"), file("features.csv"), file("truth.csv"));
    let arguments = ["localise", &odometry, "--features", &features, "--truth", &truth, "--json"];
    yard.marsyard(arguments.iter().chain(extra))
}

fn score(yard: &Yard, extra: &[&str]) -> Json {
    let output = localise(yard, extra);
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn law_without_features_the_drive_is_told_once() {
    let yard = Yard::new();
    let file = |name: &str| logs().join(name).display().to_string();
    let output = yard.marsyard(["localise", &file("odometry.csv"), "--truth", &file("truth.csv"), "--out", "a"]);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(said.contains("\ndead reckoning: ATE ") && !said.contains("this drive"), "{said}");
    assert!(said.contains("measurements that make no sense\n"), "{said}");
}

#[test]
fn law_localise_beats_dead_reckoning_on_the_sample_and_writes_what_it_says() {
    let yard = Yard::new();
    let known = score(&yard, &["--out", "a", "--particles", "100"]);
    let ate_m = |said: &Json, of: &str| said[of]["ate_m"].as_f64().expect("a number");
    assert!(ate_m(&known, "score") < 0.5 * ate_m(&known, "dead_reckoning"), "{known}");
    let unknown = score(&yard, &["--out", "b", "--particles", "100", "--unknown-ids"]);
    assert!(ate_m(&unknown, "score") < 0.7 * ate_m(&unknown, "dead_reckoning"), "{unknown}");
    // The error is computed again from the trajectory that was written: every truth stands at a time of the log.
    let read = |path: std::path::PathBuf| std::fs::read_to_string(path).expect("a file");
    let numbers = |line: &str, by: char| -> Vec<f64> { line.split(by).map(|v| v.parse().expect("a number")).collect() };
    let truth: Vec<Vec<f64>> = read(logs().join("truth.csv")).lines().skip(1).map(|line| numbers(line, ',')).collect();
    let trajectory: Vec<Vec<f64>> =
        read(yard.path("a/trajectory.tum")).lines().map(|line| numbers(line, ' ')).collect();
    let squares = trajectory.iter().map(|pose| {
        let row = truth.iter().find(|row| row[0] == pose[0]).expect("a truth at this time");
        let (x_m, y_m) = (pose[1] - row[1], pose[2] - row[2]);
        x_m * x_m + y_m * y_m
    });
    let again_m = (squares.sum::<f64>() / trajectory.len() as f64).sqrt();
    assert!((again_m - ate_m(&known, "score")).abs() < 1e-9, "{again_m} {known}");
    assert_eq!(read(yard.path("a/covariance.csv")).lines().count(), 1 + trajectory.len());
    // Every landmark has the id of a feature.
    let landmarks = read(yard.path("a/landmarks.csv"));
    assert_eq!(landmarks.lines().count() as u64, 1 + known["landmarks"].as_u64().expect("a count"));
    assert!(landmarks.lines().skip(1).all(|line| line.split(',').next().is_some_and(|id| id.parse::<u32>().is_ok())));
}

#[test]
fn extreme_localise_refuses_nonsense_with_file_line_and_cure() {
    let yard = Yard::new();
    std::fs::write(yard.path("o.csv"), "time_s,speed_mps,yaw_rate_radps\n0,0,0\n1,fast,0\n").expect("a file");
    for (name, rows) in [
        ("twice.csv", "time_s,speed_mps,yaw_rate_radps,speed_mps\n0,0,0,0\n"),
        ("still.csv", "time_s,speed_mps,yaw_rate_radps\n0,0,0\n1,0,0\n"),
        ("degrees.csv", "time_s,range_m,bearing_rad\n0,2,-1\n0,2,95\n"),
        ("up.csv", "time_s,range_m,bearing_rad,elevation_rad\n0,2,0,90\n"),
        ("far.csv", "time_s,range_m,bearing_rad\n0,1e200,0\n"),
        ("late.csv", "time_s,x_m,y_m,yaw_rad\n5000,0,0,0\n"),
    ] {
        std::fs::write(yard.path(name), rows).expect("a file");
    }
    // Nothing is written where there is no score to tell.
    let late = yard.marsyard(["localise", "still.csv", "--truth", "late.csv", "--out", "nothing"]);
    assert_eq!(late.status.code(), Some(2));
    assert!(text(&late.stderr).contains("it covers no step of the odometry"), "{}", text(&late.stderr));
    assert!(!yard.path("nothing/trajectory.tum").exists());
    for (arguments, said) in [
        (&["localise", "o.csv"][..], "o.csv:3: speed_mps is 'fast'; write a finite number"),
        (&["localise", "absent.csv"], "absent.csv cannot be read"),
        (&["localise", "o.csv", "--range-m=-1"], "a number of at least 0 is needed"),
        (&["localise", "o.csv", "--slip=0.95"], "a number of 0 to 0.9 is needed"),
        (&["localise", "o.csv", "--slip=-0.1"], "a number of 0 to 0.9 is needed"),
        (&["localise", "o.csv", "--slip=nan"], "a number of 0 to 0.9 is needed"),
        (&["localise", "o.csv", "--sensor=nan,0,0"], "a number is not finite"),
        (&["localise", "o.csv", "--motion-inflation", "0"], "a number of 0.01 to 1000 is needed"),
        (&["localise", "o.csv", "--measurement-inflation", "1e308"], "a number of 0.01 to 1000 is needed"),
        (&["localise", "twice.csv"], "twice.csv:1: it names 'speed_mps' twice"),
        (&["localise", "still.csv", "--features", "degrees.csv"], "degrees.csv:3: bearing_rad is 95"),
        (&["localise", "still.csv", "--features", "up.csv"], "up.csv:2: elevation_rad is 90"),
        (&["localise", "still.csv", "--features", "far.csv"], "far.csv:2: range_m is 1e200; a range is in metres"),
        (&["localise", "o.csv", "--start", "1,0"], "2 numbers, three are needed"),
    ] {
        let output = yard.marsyard(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(text(&output.stderr).contains(said), "{}", text(&output.stderr));
    }
}

/// The first line of the trajectory: x, y, z and heading (radians).
fn first_pose(yard: &Yard, out: &str) -> [f64; 4] {
    let trajectory = std::fs::read_to_string(yard.path(&format!("{out}/trajectory.tum"))).expect("a file");
    let values: Vec<f64> =
        trajectory.lines().next().expect("a line").split(' ').map(|v| v.parse().expect("a number")).collect();
    // time, x, y, z, and the quaternion x, y, z, w of a level rover.
    [values[1], values[2], values[3], 2.0 * marsyard::math::atan2(values[6], values[7])]
}

#[test]
fn law_a_drive_starts_where_the_truth_says_that_the_rover_was_at_the_logs_first_time() {
    let yard = Yard::new();
    std::fs::write(yard.path("o.csv"), "time_s,speed_mps,yaw_rate_radps\n2,0,0\n3,1,0\n4,1,0\n").expect("a file");
    let truth = |name: &str, first_s: f64| {
        let row = |k: u32| format!("{},{k},0,0.5\n", first_s + f64::from(k));
        let rows: String = (0..8).map(row).collect();
        std::fs::write(yard.path(name), format!("time_s,x_m,y_m,yaw_rad\n{rows}")).expect("a file");
    };
    // One metre a second from half a second, and from two and a half: the first holds the log's first time.
    truth("earlier.csv", 0.5);
    truth("later.csv", 2.5);
    for (name, x_m) in [("earlier", 1.5), ("later", 0.0)] {
        let output = yard.marsyard(["localise", "o.csv", "--truth", &format!("{name}.csv"), "--out", name]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let [x, y, z, yaw_rad] = first_pose(&yard, name);
        assert!(
            (x - x_m).abs() < 1e-9 && y == 0.0 && z == 0.0 && (yaw_rad - 0.5).abs() < 1e-9,
            "{name}: {x} {yaw_rad}"
        );
    }
}

#[test]
fn law_angles_that_are_told_later_and_not_at_the_start_are_refused_unless_somebody_tells_them() {
    let yard = Yard::new();
    let log = |name: &str, column: &str| {
        let text = format!("time_s,speed_mps,yaw_rate_radps,{column}\n0,0,0,\n1,1,0,0.7\n2,1,0,0.7\n");
        std::fs::write(yard.path(name), text).expect("a file");
    };
    log("yaw.csv", "yaw_rad");
    log("roll.csv", "roll_rad");
    std::fs::write(yard.path("t.csv"), "time_s,x_m,y_m,yaw_rad\n0,0,0,0.7\n2,2,0,0.7\n").expect("a file");
    let refused = |arguments: &[&str], cure: &str| {
        let output = yard.marsyard(arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("is empty in the first row") && said.contains(cure), "{said}");
    };
    refused(&["localise", "yaw.csv"], "--start");
    refused(&["localise", "roll.csv", "--start=0,0,40"], "--truth");
    for arguments in [
        &["localise", "yaw.csv", "--start", "-1,0,40", "--out", "a"][..],
        &["localise", "yaw.csv", "--truth", "t.csv", "--out", "b"],
        &["localise", "roll.csv", "--truth", "t.csv", "--out", "c"],
    ] {
        let output = yard.marsyard(arguments);
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    // The truth's height and tilt stay where the start is told otherwise.
    std::fs::write(yard.path("s.csv"), "time_s,x_m,y_m,z_m,yaw_rad,roll_rad\n0,5,5,3,0,0.7\n2,7,5,3,0,0.7\n")
        .expect("a file");
    let output =
        yard.marsyard(["localise", "roll.csv", "--truth", "s.csv", "--start", "1,2,0", "--out", "d", "--json"]);
    let said: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(said["left_out"]["gated"], 0, "{said}");
    assert_eq!(first_pose(&yard, "d")[..3], [1.0, 2.0, 3.0]);
}

#[test]
fn law_all_features_of_a_time_are_mapped() {
    let yard = Yard::new();
    std::fs::write(yard.path("o.csv"), "time_s,speed_mps,yaw_rate_radps\n0,0,0\n1,0,0\n").expect("a file");
    let seen: String = (0..40).map(|k| format!("0,{},{},{k}\n", 2 + k, 0.1 * f64::from(k))).collect();
    std::fs::write(yard.path("f.csv"), format!("time_s,range_m,bearing_rad,id\n{seen}")).expect("a file");
    let output = yard.marsyard(["localise", "o.csv", "--features", "f.csv", "--out", "a"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let landmarks = std::fs::read_to_string(yard.path("a/landmarks.csv")).expect("a file");
    assert_eq!(landmarks.lines().count(), 1 + 40, "{landmarks}");
}

#[test]
fn law_features_that_are_passed_over_are_counted() {
    let yard = Yard::new();
    std::fs::write(yard.path("o.csv"), "time_s,speed_mps,yaw_rate_radps\n0,0,0\n1,0,0\n").expect("a file");
    // Two metres from one to the next; every second one has another a tenth of a metre behind it.
    let ranges_m = (1..=8).flat_map(|k| [2.0 * f64::from(k), 2.0 * f64::from(k) + if k % 2 == 0 { 0.1 } else { 1.0 }]);
    let seen: String = ranges_m.map(|range_m| format!("0,{range_m},0\n")).collect();
    std::fs::write(yard.path("f.csv"), format!("time_s,range_m,bearing_rad\n{seen}")).expect("a file");
    let output = yard.marsyard(["localise", "o.csv", "--features", "f.csv", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(said["landmarks"], 12, "{said}");
    let left_out = serde_json::json!({ "not_finite": 0, "gated": 0, "ambiguous": 0, "passed_over": 4 });
    assert_eq!(said["left_out"], left_out, "{said}");
}
