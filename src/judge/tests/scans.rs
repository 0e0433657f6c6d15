//! Points known by hand -> cells, levels, scores and refusals.

use crate::cells::params::OverhangParams;
use crate::cloud::{Cloud, LabelMap};
use crate::drive::rover::Mount;
use crate::geometry::{DVec3, Pose};
use crate::judge::*;
use crate::train::Model;
use crate::train::model::tests::model;
use crate::train::operating_point::class;

fn small() -> Model {
    model(&["mean_height_m", "height_difference_m", "point_count"], &[2], true)
}

fn cloud(points: &[[f64; 3]]) -> Cloud {
    Cloud { points_m: points.iter().map(|&point| DVec3::from_array(point)).collect(), ..Cloud::default() }
}

fn in_map() -> Options {
    Options { frame: Frame::Map, max_range_m: Some(50.0), ..Options::default() }
}

/// Of each cell: column, points.
fn cells(judged: &JudgedScan) -> Vec<(i32, i32)> {
    judged.cells.cells.rows.iter().map(|row| (row.index.col, row.points)).collect()
}

#[test]
fn exact_a_window_holds_the_newest_scans_and_a_refused_one_changes_nothing() {
    let model = small();
    let mut judge = ScanJudge::new(&model, Options { window: Some(2), ..in_map() }).unwrap();
    let here = Pose::default();
    let mut scan = |points: &[[f64; 3]]| judge.scan("a scan", cloud(points), Some(&here));
    assert_eq!(cells(&scan(&[[1.05, 0.05, 0.0]]).unwrap()), [(10, 1)]);
    assert_eq!(cells(&scan(&[[1.05, 0.05, 0.1], [2.05, 0.05, 0.0]]).unwrap()), [(10, 2), (20, 1)]);
    assert!(matches!(scan(&[]), Err(JudgeError::Cloud(_))));
    // The first scan has left.
    assert_eq!(cells(&scan(&[[3.05, 0.05, 0.0]]).unwrap()), [(10, 1), (20, 1), (30, 1)]);
}

#[test]
fn law_cells_of_few_points_are_not_judged_and_the_others_get_the_models_output() {
    let model = small();
    let mut judge = ScanJudge::new(&model, Options { min_points: 2, ..in_map() }).unwrap();
    let points = [[1.05, 0.05, -4.0], [2.05, 0.05, 0.0], [2.06, 0.05, 0.5]];
    let judged = judge.scan("a scan", cloud(&points), Some(&Pose::default())).unwrap();
    let output = model.output(&[0.25, 0.5, 2.0]);
    assert_eq!(judged.cells.outputs, [None, Some(output)]);
    assert_eq!(judged.cells.classes, [None, Some(class(&model.about.thresholds, output))]);
    assert_eq!((judged.cells.count(None), judged.cells.count(Some(class(&model.about.thresholds, output)))), (1, 1));
    // One row an input; those of cells that were not judged are told as well.
    let heights = &judge.outside_training(&[judged.cells])[0];
    assert_eq!((heights.feature.as_str(), heights.below), ("mean_height_m", 0.5));
}

#[test]
fn exact_without_poses_each_scan_stands_on_its_own_ground_below_its_sensor() {
    let model = model(&["mean_height_m"], &[2], true);
    let options = Options { pose_source: PoseSource::Ground { sensor_height_m: 0.5 }, ..Options::default() };
    let mut judge = ScanJudge::new(&model, options).unwrap();
    assert_eq!(judge.setup().window, 1);
    let flat: Vec<[f64; 3]> = (0..900)
        .map(|k| [0.3 + 0.1 * f64::from(k % 30), 0.1 * f64::from(k / 30) - 1.5, -0.5])
        // A beam without a return.
        .chain([[0.0; 3]])
        .collect();
    for _ in 0..2 {
        let judged = judge.scan("flat", cloud(&flat), None).unwrap();
        let found = judged.scan.levelled.unwrap();
        assert!((found.height_m - 0.5).abs() < 1e-9 && found.tilt_rad < 1e-6, "{found:?}");
        assert_eq!((judged.scan.at_sensor, judged.cells.cells.points_in), (1, 900));
        assert!((0..judged.cells.cells.rows.len()).all(|row| judged.cells.mean_z_m(row).abs() < 1e-6));
    }
}

#[test]
fn exact_scores_count_the_cells_that_have_a_label_and_a_judgement() {
    let model = small();
    let labels = LabelMap::parse("m.yaml", "labels: {1: traversable, 2: untraversable, 0: ignore}").unwrap();
    let mut judge = ScanJudge::new(&model, Options { labels: Some(labels), ..in_map() }).unwrap();
    let points = [[1.05, 0.05, 0.0], [2.05, 0.05, 0.0], [3.05, 0.05, 0.0]];
    let labelled = Cloud { labels: Some(vec![1, 2, 0]), ..cloud(&points) };
    for _ in 0..2 {
        judge.scan("a scan", labelled.clone(), Some(&Pose::default())).unwrap();
    }
    let report = judge.report("two scans".into(), "m.yaml").unwrap();
    assert_eq!((report.groups[0].cells, report.data.unknown_cells, report.data.scans), (4, 2, 2));
    assert!(report.data.labels.contains("by m.yaml: a cell with at least 1 "), "{}", report.data.labels);
    // Cells that were not judged are no cells of unknown label.
    let labels = LabelMap::parse("m.yaml", "labels: {1: traversable, 2: untraversable, 0: ignore}").unwrap();
    let mut strict = ScanJudge::new(&model, Options { labels: Some(labels), min_points: 2, ..in_map() }).unwrap();
    let points = [[1.05, 0.05, 0.0], [1.06, 0.05, 0.0], [2.05, 0.05, 0.0], [3.05, 0.05, 0.0]];
    let labelled = Cloud { labels: Some(vec![1, 1, 2, 0]), ..cloud(&points) };
    strict.scan("a scan", labelled, Some(&Pose::default())).unwrap();
    let report = strict.report("a scan".into(), "m.yaml").unwrap();
    assert_eq!((report.groups[0].cells, report.data.unknown_cells, report.data.not_finite_cells), (1, 1, 0));
    let told = "labelled cells of fewer than 2 points were not judged and are left out: 1";
    assert!(report.notes.iter().any(|note| note.contains(told)), "{:?}", report.notes);
    let without = ScanJudge::new(&model, in_map()).unwrap();
    assert!(without.report(String::new(), "").is_none());
}

const BODY: OwnBody = OwnBody { length_m: 0.8, width_m: 0.6, height_m: 0.5 };

#[test]
fn exact_what_hangs_is_in_no_cell_and_its_points_get_no_class() {
    let model = model(&["height_difference_m"], &[2], true);
    let points = [
        [3.05, 0.05, -0.5],
        [3.05, 0.05, -0.5],
        [3.05, 0.05, 0.7],
        [4.05, 0.05, 0.7],
        [5.05, 0.05, -0.5],
        [5.05, 0.05, -0.5],
    ];
    let judged = |options: Options| {
        let mut judge = ScanJudge::new(&model, options).unwrap();
        judge.scan("a scan", cloud(&points), Some(&Pose::default())).unwrap()
    };
    let ruled = judged(Options { overhang_m: Some(0.8), ..in_map() });
    assert_eq!((ruled.cells.cells.rows.len(), ruled.cells.cells.overhanging), (2, 2));
    let classes: Vec<i8> = ruled.labelled_points().iter().map(|point| point.class).collect();
    assert!(classes.iter().enumerate().all(|(k, &class)| (class < 0) == [2, 3].contains(&k)), "{classes:?}");
    assert_eq!(judged(in_map()).cells.cells.rows.len(), 3);
    // A model with the rule brings it along.
    let mut with_rule = model.clone();
    with_rule.about.cells.overhang = Some(OverhangParams { above_m: Some(0.8) });
    let mut judge = ScanJudge::new(&with_rule, in_map()).unwrap();
    assert_eq!(judge.scan("a scan", cloud(&points), Some(&Pose::default())).unwrap().cells.cells.overhanging, 2);
}

#[test]
fn exact_returns_of_the_rover_itself_leave_by_its_outline_and_a_margin_in_every_frame() {
    let model = model(&["height_difference_m"], &[2], true);
    // In the rover's frame: on the box's faces from both sides, with the margin of 0.1 m, and ground around.
    let (out, within) = (0.501, 0.499);
    let in_rover = [
        [within, 0.0, 0.3],
        [out, 0.0, 0.3],
        [-within, 0.0, 0.3],
        [0.0, 0.399, 0.3],
        [0.0, 0.401, 0.3],
        [0.0, 0.0, 0.599],
        [0.0, 0.0, 0.601],
    ];
    let ground = (0..900).map(|k| [1.0 + 0.1 * f64::from(k % 30), 0.1 * f64::from(k / 30) - 1.5, 0.0]);
    let in_rover: Vec<DVec3> = in_rover.into_iter().chain(ground).map(DVec3::from_array).collect();
    let mount = Mount { x_m: 0.3, y_m: 0.05, z_m: 0.7, yaw_deg: 90.0, pitch_deg: 0.0, roll_deg: 0.0 };
    let rover = Pose { position_m: DVec3::new(3.0, -2.0, 0.5), roll_rad: 0.1, pitch_rad: -0.2, yaw_rad: 1.0 };
    let sensor = Pose::from_transform(&(rover.transform() * mount.rover_from_sensor()));
    let sensor_from_rover = mount.rover_from_sensor().inverse();
    let in_sensor: Vec<[f64; 3]> = in_rover.iter().map(|&p| sensor_from_rover.point(p).to_array()).collect();
    let in_the_map: Vec<[f64; 3]> = in_rover.iter().map(|&p| rover.transform().point(p).to_array()).collect();
    let own = Options { own_body: Some(BODY), mount: Some(mount), frame: Frame::Sensor, ..in_map() };
    let of_sensor = PoseSource::Sensor;
    let on_ground = PoseSource::Ground { sensor_height_m: 0.7 };
    for (options, points, pose) in [
        (own.clone(), &in_sensor, Some(&rover)),
        (Options { pose_source: of_sensor, ..own.clone() }, &in_sensor, Some(&sensor)),
        (Options { frame: Frame::Map, ..own.clone() }, &in_the_map, Some(&rover)),
        (Options { pose_source: on_ground, ..own.clone() }, &in_sensor, None),
    ] {
        let mut judge = ScanJudge::new(&model, options).unwrap();
        let judged = judge.scan("a scan", cloud(points), pose).unwrap();
        assert_eq!((judged.scan.on_rover, judged.scan.cloud.points_m.len()), (4, 903));
    }
    let mut judge = ScanJudge::new(&model, Options { own_body: None, ..own }).unwrap();
    assert_eq!(judge.scan("a scan", cloud(&in_sensor), Some(&rover)).unwrap().scan.on_rover, 0);
}

#[test]
fn extreme_options_that_no_scan_can_be_judged_by_are_refused_at_once() {
    let model = small();
    let ground = PoseSource::Ground { sensor_height_m: 0.5 };
    for (options, needle) in [
        (Options { max_range_m: Some(f64::NAN), ..in_map() }, "--max-range NaN"),
        (Options { max_range_m: Some(0.0), ..in_map() }, "--max-range 0"),
        (Options { overhang_m: Some(f64::NAN), ..in_map() }, "--overhang NaN"),
        (Options { overhang_m: Some(0.0), ..in_map() }, "--overhang 0"),
        (Options { own_body: Some(OwnBody { width_m: -1.0, ..BODY }), ..in_map() }, "--self-filter=0.8,-1,0.5"),
        (Options { window: Some(0), ..in_map() }, "--window 0"),
        (Options { window: Some(2), pose_source: ground, ..in_map() }, "--window needs poses"),
        (Options { pose_source: ground, ..in_map() }, "need poses"),
        (Options { sigma_z_m: Some(-1.0), ..in_map() }, "--sigma-z -1"),
        (Options { sigma_yaw_rad: Some(f64::INFINITY), ..in_map() }, "--sigma-yaw inf"),
        (Options { sigma_tilt_rad: Some(-0.5 * std::f64::consts::PI), ..in_map() }, "--sigma-tilt -90 degrees"),
    ] {
        let error = ScanJudge::new(&model, options).unwrap_err().to_string();
        assert!(error.contains(needle), "{error}");
    }
    let moist = crate::train::model::tests::model(&["soil_moisture"], &[2], true);
    assert!(ScanJudge::new(&moist, in_map()).unwrap_err().to_string().contains("soil_moisture"));
}

#[test]
fn extreme_scans_that_lack_something_are_refused_by_name() {
    let (plain, light) = (small(), model(&["intensity_mean"], &[2], true));
    let labels = LabelMap::parse("m.yaml", "labels: {1: traversable}").unwrap();
    let (here, one) = (Pose::default(), cloud(&[[1.0, 0.0, 0.0]]));
    let far = Pose { position_m: DVec3::new(0.0, 2e8, 0.0), ..here };
    let nowhere = Pose { position_m: DVec3::new(f64::NAN, 0.0, 0.0), ..here };
    let bright = Cloud { intensity: Some(vec![1.0; 2]), ..one.clone() };
    let labelled = Cloud { labels: Some(vec![7]), ..one.clone() };
    let with_labels = Options { labels: Some(labels), ..in_map() };
    for (model, options, cloud, pose, needle) in [
        (&plain, in_map(), &one, None, "one.ply: there is no pose for it"),
        (&plain, in_map(), &one, Some(&far), "subtract the origin"),
        (&plain, in_map(), &one, Some(&nowhere), "a pose at"),
        (&plain, in_map(), &Cloud::default(), Some(&here), "one.ply: there is no point in it"),
        (&plain, Options::default(), &cloud(&[[0.0; 3]]), Some(&here), "one.ply: there is no point in it"),
        (&plain, in_map(), &bright, Some(&here), "one.ply: 1 points, and 2 intensities"),
        (&light, in_map(), &one, Some(&here), "one.ply: the model takes intensity_mean"),
        (&plain, with_labels.clone(), &one, Some(&here), "one.ply: there are no labels"),
        (&plain, with_labels, &labelled, Some(&here), "one.ply: label 7 (point 0)"),
    ] {
        let mut judge = ScanJudge::new(model, options).unwrap();
        let error = judge.scan("one.ply", cloud.clone(), pose).unwrap_err().to_string();
        assert!(error.contains(needle), "{error}");
    }
}

#[test]
fn extreme_maps_name_the_scan_that_is_too_wide_for_them() {
    let model = small();
    let mut judge = ScanJudge::new(&model, Options { max_range_m: Some(1e9), ..in_map() }).unwrap();
    let points = [[0.0, 0.0, 0.0], [1e6, 1e6, 0.0]];
    let judged = judge.scan("wide.ply", cloud(&points), Some(&Pose::default())).unwrap();
    let error = judged.cost_map("a.pgm", Shown::Class).unwrap_err().to_string();
    assert!(error.starts_with("wide.ply: the cells span 10000001 by 10000001"), "{error}");
}
