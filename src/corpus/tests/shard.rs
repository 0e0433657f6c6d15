//! Rows in, rows out; the same bytes each time.

use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, Float64Type, Int8Type, Int32Type, Int64Type};
use arrow_array::{Array, RecordBatch};

use super::fixture::{corpus, scene, spec, write_shard};
use crate::cells::Label;
use crate::corpus::reader::TableFile;
use crate::corpus::write::ROW_GROUP_ROWS;
use crate::corpus::{CorpusError, Finished, LocalFolder, ShardWriter, Store, Table, stored_cell};
use crate::episode::SceneOutput;
use crate::random::Drawn;

fn stored(files: &[(String, Vec<u8>)]) -> (tempfile::TempDir, LocalFolder) {
    let dir = tempfile::tempdir().unwrap();
    let store = LocalFolder::new(dir.path());
    for (name, bytes) in files {
        store.put(name, bytes).unwrap();
    }
    (dir, store)
}

fn whole(store: &LocalFolder, table: Table) -> RecordBatch {
    let file = TableFile::open(store, &table.path(0)).unwrap();
    let batches: Vec<RecordBatch> = file.batches().map(Result::unwrap).collect();
    arrow_select::concat::concat_batches(file.schema(), &batches).unwrap()
}

#[test]
fn equal_cells_written_and_read_back() {
    let spec = spec(2, &Table::ALL);
    let (_dir, store) = stored(&write_shard(&spec, 0).files);
    let batch = whole(&store, Table::Cells);
    let scenes = [scene(0, 40), scene(1, 40)];
    let expected: Vec<_> = scenes.iter().flat_map(|s| s.scans.iter().map(move |scan| (s.scene_id, scan))).collect();
    assert_eq!(batch.num_rows(), 160);
    let mut row = 0;
    for (scene_id, scan) in expected {
        for (k, cell) in scan.cells.rows.iter().enumerate() {
            let int = |name: &str| batch[name].as_primitive::<Int32Type>().value(row);
            assert_eq!(batch["scene_id"].as_primitive::<Int64Type>().value(row), scene_id as i64);
            assert_eq!((int("scan_id"), int("row"), int("col")), (scan.scan_id as i32, cell.index.row, cell.index.col));
            let labels = batch["label"].as_primitive::<Int8Type>();
            assert_eq!(labels.is_valid(row).then(|| labels.value(row)), cell.label.map(Label::number));
            assert_eq!(int("points"), cell.points);
            for (f, name) in ["mean_height_m", "height_variance_m2"].into_iter().enumerate() {
                assert_eq!(batch[name].as_primitive::<Float32Type>().value(row), scan.cells.features[2 * k + f]);
            }
            row += 1;
        }
    }
}

#[test]
fn exact_scene_rows_hold_counts_drawn_values_and_nulls() {
    let spec = spec(2, &Table::ALL);
    let (_dir, store) = stored(&write_shard(&spec, 0).files);
    let batch = whole(&store, Table::Scenes);
    let long = |name: &str| batch[name].as_primitive::<Int64Type>().values().to_vec();
    assert_eq!(long("points_in"), [20, 20]);
    assert_eq!(
        (long("points_binned"), long("points_beyond_range"), long("points_off_grid")),
        (vec![14, 14], vec![4, 4], vec![2, 2])
    );
    assert_eq!(
        (long("cells"), long("cells_traversable"), long("cells_untraversable")),
        (vec![80; 2], vec![40; 2], vec![20; 2])
    );
    let drawn = batch["scene.ground.source.random.rms_height_m"].as_primitive::<Float64Type>();
    assert_eq!(drawn.values().to_vec(), [0.25, 0.25]);
    assert_eq!(batch["scene.ground.source.random.correlation_length_m"].null_count(), 2);
    assert_eq!(batch["status"].as_string::<i32>().value(1), "ok");
    assert!(batch["error"].is_null(0) && batch["both_classes"].as_boolean().value(0));
}

#[test]
fn exact_points_keep_missed_slots_and_leave_far_ones_without_a_cell() {
    let spec = spec(2, &Table::ALL);
    let (_dir, store) = stored(&write_shard(&spec, 0).files);
    let batch = whole(&store, Table::Points).slice(0, 3);
    let status = batch["status"].as_primitive::<Int8Type>();
    assert_eq!(status.values().to_vec(), [0, 1, 0]);
    let (x, row, col) = (&batch["map_x_m"], &batch["row"], &batch["col"]);
    assert_eq!(x.as_primitive::<Float64Type>().value(0), 7.0);
    assert!(x.is_null(1) && batch["range_m"].is_null(1) && batch["truth_range_m"].is_null(1));
    assert_eq!((row.as_primitive::<Int32Type>().value(0), col.as_primitive::<Int32Type>().value(0)), (10, 14));
    assert!(x.is_valid(2) && row.is_null(1) && row.is_null(2));
    let truth = batch["truth_object_id"].as_primitive::<Int32Type>();
    assert_eq!(truth.values().to_vec(), [-1, -2, -1]);
}

#[test]
fn exact_poses_say_where_the_kept_scans_were_made() {
    let spec = spec(2, &[Table::Poses]);
    let (_dir, store) = stored(&write_shard(&spec, 0).files);
    let batch = whole(&store, Table::Poses);
    let scans = batch["scan_id"].as_primitive::<Int32Type>();
    assert_eq!(scans.iter().collect::<Vec<_>>(), [None, Some(1), None, Some(3)].repeat(2));
    assert_eq!(batch["sigma_x_m"].as_primitive::<Float64Type>().value(0), 0.2);
    // A height of -0.0 is written as 0.0.
    assert_eq!(batch["z_m"].as_primitive::<Float64Type>().value(0).to_bits(), 0);
}

#[test]
fn equal_bytes_for_equal_scenes() {
    let spec = spec(4, &Table::ALL);
    let (a, b) = (write_shard(&spec, 1), write_shard(&spec, 1));
    assert_eq!(a.files, b.files);
    assert_eq!(a.receipt, b.receipt);
    assert_eq!(a.files.len(), 4);
}

#[test]
fn equal_value_hashes_at_every_compression() {
    let spec = spec(2, &Table::ALL);
    let at = |level| {
        let mut writer = ShardWriter::with_zstd_level(&spec, 0, level).unwrap();
        (0..2).for_each(|id| writer.push(&scene(id, 500)).unwrap());
        writer.finish().unwrap().receipt.tables
    };
    let (fast, small) = (at(1), at(19));
    for (table, facts) in &fast {
        assert_eq!(facts.value_hash, small[table].value_hash, "{table:?}");
    }
    assert_ne!(fast[&Table::Cells].sha256, small[&Table::Cells].sha256);
}

/// What last year's corpus must still give: the values, not the bytes. Re-mint only with a new `FORMAT` and a note.
#[test]
fn golden_value_hashes_of_a_tiny_shard() {
    let spec = spec(2, &Table::ALL);
    let tables = write_shard(&spec, 0).receipt.tables;
    let hashes: Vec<String> =
        tables.iter().map(|(table, facts)| format!("{} {}", table.name(), facts.value_hash)).collect();
    insta::assert_snapshot!(hashes.join("\n"));
}

/// The bytes themselves: they change with the Parquet crates and zstd, and then `FORMAT` changes too.
#[test]
fn golden_file_bytes_of_a_tiny_shard() {
    let spec = spec(2, &Table::ALL);
    let tables = write_shard(&spec, 0).receipt.tables;
    let hashes: Vec<String> =
        tables.iter().map(|(table, facts)| format!("{} {} {}", table.name(), facts.bytes, facts.sha256)).collect();
    insta::assert_snapshot!(hashes.join("\n"));
}

#[test]
fn law_row_groups_hold_whole_scans() {
    let mut spec = spec(1, &[Table::Cells]);
    spec.scenes_per_shard = 1;
    let mut writer = ShardWriter::new(&spec, 0).unwrap();
    let sizes = [50_000, 50_000, 50_000, ROW_GROUP_ROWS + 5, 3];
    let mut scene = SceneOutput { family: "default".into(), ..SceneOutput::default() };
    for (scan_id, cells) in sizes.into_iter().enumerate() {
        let mut scan = super::fixture::scene(0, cells).scans.remove(0);
        scan.scan_id = scan_id as u32;
        scene.scans.push(scan);
    }
    writer.push(&scene).unwrap();
    let (_dir, store) = stored(&writer.finish().unwrap().files);
    let file = TableFile::open(&store, &Table::Cells.path(0)).unwrap();
    assert_eq!(file.row_groups(), [100_000, 50_000, ROW_GROUP_ROWS as u64 + 5, 3]);
    let some = file.read_row_group(1, Some(&["label", "scan_id"])).unwrap();
    assert_eq!(some.schema().fields().iter().map(|f| f.name().as_str()).collect::<Vec<_>>(), ["scan_id", "label"]);
    assert!(some["scan_id"].as_primitive::<Int32Type>().values().iter().all(|&id| id == 2));
    assert!(file.read_row_group(0, Some(&["no_such"])).unwrap_err().to_string().contains("no column 'no_such'"));
}

#[test]
fn equal_rows_of_a_scene_and_all_rows_filtered() {
    let spec = spec(2, &[Table::Cells]);
    let (_dir, store) = stored(&write_shard(&spec, 0).files);
    let file = TableFile::open(&store, &Table::Cells.path(0)).unwrap();
    assert_eq!(file.rows_of_scene(1).unwrap(), whole(&store, Table::Cells).slice(80, 80));
    assert_eq!(file.rows_of_scene(9).unwrap().num_rows(), 0);
}

#[test]
fn exact_a_stored_cell_is_found_by_its_address() {
    let spec = spec(2, &[Table::Cells]);
    let (_dir, store, _) = corpus(&spec);
    let finished = Finished::open(&store).unwrap();
    let scan = scene(1, 40).scans.remove(1);
    let cell = &scan.cells.rows[17];
    let found = stored_cell(&finished, 1, 3, cell.index).unwrap().unwrap();
    assert_eq!(&found.row, cell);
    assert_eq!(found.features, scan.cells.features[34..36]);
    assert_eq!(stored_cell(&finished, 1, 2, cell.index).unwrap(), None);
}

#[test]
fn extreme_a_shard_whose_scenes_all_failed_is_whole_and_empty() {
    let spec = spec(2, &Table::ALL);
    let mut writer = ShardWriter::new(&spec, 0).unwrap();
    for id in 0..2 {
        writer
            .push(&SceneOutput::failed(id, "default", 1, Drawn::default(), format!("no \"place\"\nto start {id}")))
            .unwrap();
    }
    let finished = writer.finish().unwrap();
    assert_eq!(finished.receipt.failed.len(), 2);
    let (_dir, store) = stored(&finished.files);
    assert_eq!(whole(&store, Table::Cells).num_rows(), 0);
    let scenes = whole(&store, Table::Scenes);
    assert_eq!(scenes["status"].as_string::<i32>().value(0), "failed");
    assert_eq!(scenes["error"].as_string::<i32>().value(1), "no \"place\"\nto start 1");
}

#[test]
fn extreme_scenes_that_break_a_promise_are_refused_by_name() {
    let spec = spec(2, &Table::ALL);
    let refusal = |change: fn(&mut SceneOutput)| {
        let mut bad = scene(0, 8);
        change(&mut bad);
        match ShardWriter::new(&spec, 0).unwrap().push(&bad) {
            Err(CorpusError::Rows { shard: 0, reason }) => reason,
            other => panic!("{other:?}"),
        }
    };
    assert!(refusal(|s| s.scene_id = 1).contains("scene 1 came where scene 0 was due"));
    assert!(refusal(|s| s.error = Some("x".into())).contains("failed and has scans"));
    assert!(refusal(|s| s.scans[0].cells.features.truncate(15)).contains("15 feature values for 8 rows of 2 features"));
    assert!(refusal(|s| s.scans[1].cells.rows.swap(0, 1)).contains("scene 0 scan 3: cells do not ascend"));
    assert!(refusal(|s| s.scans[0].cells.points_in += 1).contains("points in are not"));
    assert!(refusal(|s| s.scans[0].points = None).contains("the scan has no points"));
    assert!(refusal(|s| s.scans.reverse()).contains("scans do not ascend"));
    let late = ShardWriter::new(&spec, 0).unwrap().finish().err().unwrap().to_string();
    assert!(late.contains("scene 0 is missing"), "{late}");
}

#[test]
fn exact_receipt_statistics_are_those_of_the_rows() {
    let spec = spec(2, &[Table::Cells]);
    let receipt = write_shard(&spec, 0).receipt;
    let scans: Vec<_> = (0..2).flat_map(|id| scene(id, 40).scans).collect();
    for (k, feature) in receipt.features.iter().enumerate() {
        let values: Vec<f64> = scans
            .iter()
            .flat_map(|s| s.cells.features.chunks(2).map(|row| f64::from(row[k])).collect::<Vec<_>>())
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let m2: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        assert_eq!(feature.moments.count, 160);
        assert!((feature.moments.mean - mean).abs() < 1e-12 && (feature.moments.m2 - m2).abs() < 1e-9 * m2);
        assert_eq!(feature.moments.min, values.iter().copied().reduce(f64::min));
    }
    assert_eq!((receipt.labels.traversable, receipt.labels.untraversable, receipt.labels.unknown), (80, 40, 40));
    assert_eq!((receipt.points.points_in, receipt.points.binned), (40, 28));
}
