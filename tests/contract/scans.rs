//! From a corpus to a classified cloud, for every way that a sensor scans: the cells and labels of a cloud are the corpus's.

use std::path::{Path, PathBuf};

use arrow_array::types::{ArrowPrimitiveType, Float32Type, Int8Type, Int32Type};
use arrow_array::{Array, PrimitiveArray, RecordBatch};
use marsyard::corpus::reader::TableFile;
use marsyard::corpus::{LocalFolder, Table};
use serde_json::Value as Json;

use crate::yard::{Yard, text};

/// Of the test split.
const SCENE: u64 = 12;
const SHARD: u64 = 6;

fn corpus_config() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training.yaml")
}

fn column<'b, T: ArrowPrimitiveType>(batch: &'b RecordBatch, name: &str) -> &'b PrimitiveArray<T> {
    batch.column_by_name(name).and_then(|c| c.as_any().downcast_ref()).unwrap_or_else(|| panic!("a column {name}"))
}

/// A corpus of the sensor with every rock an obstacle, a model trained on it, the cloud of a scene's only kept scan and its pose.
fn yard_of(sensor: &str) -> Yard {
    let yard = Yard::new();
    let sensor = format!("sweep.sensor={sensor}");
    yard.generate(&corpus_config(), "corpus", &["--set", &sensor, "--set", "cells.labels={obstacle: all}"]);
    let run = |arguments: &[&str]| {
        let output = yard.marsyard(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    };
    run(&["train", "corpus", "--out", "run", "--set", "network.hidden=[6]", "--set", "epochs=2"]);
    run(&["preview", "corpus", "--scene", &SCENE.to_string(), "--out", "p"]);
    let trajectory = std::fs::read_to_string(yard.path(&format!("p/scene-{SCENE}-estimate.tum"))).expect("poses");
    std::fs::write(yard.path("last.tum"), trajectory.lines().last().expect("a pose")).expect("a file");
    yard
}

fn classify(yard: &Yard, out: &str, extra: &[&str]) -> Vec<Json> {
    let cloud = format!("p/scene-{SCENE}-cloud.ply");
    let map = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/labels/marsyard.yaml");
    let arguments = ["classify", "run/model.safetensors", &cloud, "--trajectory", "last.tum", "--frame", "map"];
    let judged = ["--labels", map, "--label-field", "truth_class", "--json", "--out", out];
    let output = yard.marsyard(arguments.iter().chain(&judged).chain(extra));
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON lines")).collect()
}

fn cells_and_labels_are_the_corpus_s(sensor: &str) {
    let yard = yard_of(sensor);
    let said = classify(&yard, "c", &[]);
    let stored = TableFile::open(&LocalFolder::new(yard.path("corpus")), &Table::Cells.path(SHARD)).expect("a shard");
    let stored = stored.rows_of_scene(SCENE).expect("its rows");
    let here = TableFile::open(&LocalFolder::new(yard.path("c")), "cells.parquet").expect("cells");
    let here = here.read_row_group(0, None).expect("its rows");
    let count = here.num_rows();
    assert_eq!((count, said[1]["cells"].as_u64()), (stored.num_rows(), Some(count as u64)), "{sensor}");
    assert!(count > 50, "{sensor}: {count} cells");
    for name in ["row", "col", "points"] {
        assert_eq!(column::<Int32Type>(&here, name), column::<Int32Type>(&stored, name), "{sensor}: {name}");
    }
    // Labels by the cloud's classes, point by point; the corpus's by what each beam hit.
    let (mine, theirs) = (column::<Int8Type>(&here, "label"), column::<Int8Type>(&stored, "label"));
    assert_eq!(mine, theirs, "{sensor}");
    let untraversable = mine.iter().flatten().filter(|&label| label == 1).count();
    assert!(untraversable > 5, "{sensor}: {untraversable} untraversable");
    for field in stored.schema().fields().iter().map(|f| f.name().as_str()) {
        let is_feature = ["height", "neighbour_", "point_count"].iter().any(|part| field.contains(part));
        let (Some(a), Some(b)) = (here.column_by_name(field), stored.column_by_name(field)) else { continue };
        let of = |c: &dyn Array| c.as_any().downcast_ref::<PrimitiveArray<Float32Type>>().map(|c| c.values().to_vec());
        if let (true, Some(a), Some(b)) = (is_feature && field != "neighbour_mask", of(a.as_ref()), of(b.as_ref())) {
            // The pose went through a file of decimal quaternions.
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-6), "{sensor}: {field}");
        }
    }
    // The report is over these very cells, by their labels.
    let report: Json =
        serde_json::from_slice(&std::fs::read(yard.path("c/evaluation.json")).expect("a report")).expect("JSON");
    assert_eq!(report["groups"][0]["cells"], count as u64);
    let confusion = report["groups"][0].to_string();
    assert!(confusion.contains("balanced_accuracy"), "{confusion}");
    // Cells of one or two points are judged unless told otherwise; then they are unknown.
    let points = column::<Int32Type>(&here, "points");
    let few = points.values().iter().filter(|&&points| points < 3).count();
    assert_eq!(said[1]["cells_unknown"], 0);
    assert_eq!(classify(&yard, "few", &["--min-points", "3"])[1]["cells_unknown"], few as u64);
    // Two thresholds make a third class, and probabilities rise with the outputs.
    let doubting = classify(&yard, "doubt", &["--doubtful", "2%"]);
    let borders: Vec<f64> =
        doubting[0]["thresholds"].as_array().expect("borders").iter().filter_map(Json::as_f64).collect();
    assert!(matches!(borders[..], [low, high] if low < high) || borders.len() == 1, "{borders:?}");
    let told = TableFile::open(&LocalFolder::new(yard.path("doubt")), "cells.parquet").expect("cells");
    let told = told.read_row_group(0, None).expect("its rows");
    let (outputs, chances) = (column::<Float32Type>(&told, "output"), column::<Float32Type>(&told, "probability"));
    let mut pairs: Vec<(f32, f32)> = outputs.values().iter().copied().zip(chances.values().iter().copied()).collect();
    // Outputs that are alike as f32 may have probabilities that differ in f32.
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    assert!(pairs.windows(2).all(|pair| pair[0].1 <= pair[1].1) && pairs.iter().all(|(_, p)| (0.0..=1.0).contains(p)));
    for (class, output) in column::<Int8Type>(&told, "class").iter().flatten().zip(outputs.values()) {
        let reached = borders.iter().filter(|&&border| f64::from(*output) >= border).count();
        let near = borders.iter().any(|border| (f64::from(*output) - border).abs() < 1e-6);
        assert!(near || reached == class as usize, "{output} is of class {class}");
    }
    // A shorter range cuts points, and with them cells.
    let mut ranges = column::<Float32Type>(&here, "range_m").values().to_vec();
    ranges.sort_unstable_by(f32::total_cmp);
    let cut_m = ranges[count / 2];
    let cut = classify(&yard, "cut", &["--max-range", &cut_m.to_string()]);
    // A cell's centre may lie half a diagonal nearer than its points.
    let near = ranges.iter().filter(|&&range| range < cut_m - 0.08).count();
    assert!(cut[1]["window_points_beyond_range"].as_u64() > Some(0));
    assert!((near as u64..count as u64).contains(&cut[1]["cells"].as_u64().expect("a count")), "{}", cut[1]);
}

#[test]
fn equal_cells_and_labels_of_a_spinning_scan_and_its_corpus() {
    cells_and_labels_are_the_corpus_s("os1-64");
}

#[test]
fn equal_cells_and_labels_of_a_rosette_scan_and_its_corpus() {
    cells_and_labels_are_the_corpus_s("rosette");
}

#[test]
fn equal_cells_and_labels_of_a_tilted_scan_and_its_corpus() {
    cells_and_labels_are_the_corpus_s("urg-04lx");
}

#[test]
fn exact_windows_put_points_together_and_single_points_make_single_cells() {
    let yard = yard_of("urg-04lx");
    let write = |name: &str, points: &str| std::fs::write(yard.path(name), format!("x,y,z\n{points}")).expect("a file");
    write("a.csv", "1.05,0.05,0.0\n1.06,0.04,0.1\n2.05,0.05,0.0\n");
    write("b.csv", "1.05,0.05,0.2\nnan,0,0\n3.05,0.05,0.0\n");
    write("one.csv", "1.05,0.05,0.0\n");
    write("none.csv", "");
    let run = |clouds: &[&str], extra: &[&str]| {
        let place = ["--pose=0,0,0,0,0,0", "--frame", "map", "--json"];
        yard.marsyard(["classify", "run/model.safetensors"].iter().chain(clouds).chain(&place).chain(extra))
    };
    let lines = |clouds: &[&str], extra: &[&str]| -> Vec<Json> {
        let output = run(clouds, extra);
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON lines")).collect()
    };
    let alone = lines(&["a.csv", "b.csv"], &["--window", "1"]);
    assert_eq!((&alone[1]["cells"], &alone[2]["cells"]), (&2.into(), &2.into()));
    assert_eq!(alone[2]["points_not_finite"], 1);
    let together = lines(&["a.csv", "b.csv"], &["--window", "2"]);
    assert_eq!((&together[2]["window_points"], &together[2]["cells"]), (&5.into(), &3.into()));
    let one = lines(&["one.csv"], &[]);
    assert_eq!((&one[1]["points"], &one[1]["cells"]), (&1.into(), &1.into()));
    let output = run(&["none.csv"], &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("none.csv"), "{}", text(&output.stderr));
}
