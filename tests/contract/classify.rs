//! Clouds of a simulated scan, classified: the cells are the corpus's own, and all files are written.

use marsyard::cells::{Cells, Scratch, WindowCloud, bin_clouds, feature_columns};
use marsyard::cloud::{self, Options};
use marsyard::config;
use marsyard::drive::Rover;
use marsyard::episode::{self, Prepared, Replay, ScanPoints, Unobserved, replay_scene};
use marsyard::geometry::DVec3;
use marsyard::judge::{self, PoseSource, ScanJudge};
use marsyard::sweep::Sensor;
use marsyard::train::{About, Activation, Layout, MODEL_FORMAT, Model, Network, Scaler};

use crate::yard::{Yard, text};

const SCENE: u64 = 1;

fn prepared() -> Prepared {
    let plan = config::load(&Yard::everything(), &["cells.window_scans=1".to_string()]).expect("a good config");
    Prepared::new(plan).expect("patterns").keeping_points()
}

fn replay(prepared: &Prepared) -> Replay {
    replay_scene(prepared, SCENE, &mut episode::Scratch::default(), &mut Unobserved).expect("a scene")
}

/// The cloud that `marsyard preview` wrote of the scene's last scan.
fn preview(yard: &Yard) -> Vec<u8> {
    let config = Yard::everything().display().to_string();
    let output = yard.marsyard(["preview", &config, "--scene", "1", "--out", "p", "--set", "cells.window_scans=1"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    std::fs::read(yard.path("p/scene-1-cloud.ply")).expect("the cloud")
}

/// All but intensities and ranges bit for bit; those go through a length and may differ in f32's last digit.
fn assert_same_cells(here: &Cells, there: &Cells, names: &[String]) {
    assert_eq!(here.rows.len(), there.rows.len());
    let near = |a: f32, b: f32| (a - b).abs() <= 2.0 * f32::EPSILON * b.abs();
    for (a, b) in here.rows.iter().zip(&there.rows) {
        assert_eq!((a.index, a.points, a.neighbour_mask), (b.index, b.points, b.neighbour_mask));
        assert!(a.label.is_none() && near(a.range_m, b.range_m), "{a:?} {b:?}");
    }
    for (k, (a, b)) in here.features.iter().zip(&there.features).enumerate() {
        let name = &names[k % names.len()];
        let same = if name.starts_with("intensity") {
            near(*a, *b) || (a - b).abs() < 1e-6
        } else {
            a.to_bits() == b.to_bits()
        };
        assert!(same, "{name}: {a} {b}");
    }
}

#[test]
fn equal_clouds_in_sensor_and_map_frame_give_the_cells_of_the_corpus() {
    let yard = Yard::new();
    let prepared = prepared();
    let replay = replay(&prepared);
    let family = &prepared.plan.families[replay.family];
    let scan = replay.scans.last().expect("a kept scan");
    let points = scan.points.as_ref().expect("kept points");
    let row = replay.poses.iter().find(|row| row.scan_id == Some(scan.scan_id)).expect("its pose");
    let names: Vec<String> = feature_columns(&family.cells, true).into_iter().map(|c| c.name).collect();
    let bin = |points_m: &[DVec3], intensity: &[f32], in_map: bool| {
        let cloud = WindowCloud {
            points_m,
            in_map,
            intensity: Some(intensity),
            obstacle: None,
            estimate: &row.estimate,
            map_from_sensor: points.map_from_sensor,
        };
        bin_clouds(&family.cells, &[cloud], points.max_range_m, &mut Scratch::default()).0
    };
    let read = cloud::read("cloud.ply", &preview(&yard), None, &Options::default()).expect("a cloud");
    let here = bin(&read.points_m, read.intensity.as_ref().expect("intensities"), true);
    assert!(here.rows.len() > 100);
    assert_same_cells(&here, &scan.cells, &names);

    let sweep = &points.sweep;
    let hits: Vec<usize> =
        (0..sweep.returns.status.len()).filter(|&slot| sweep.returns.point_sensor(slot).is_some()).collect();
    let in_sensor: Vec<DVec3> = hits.iter().filter_map(|&slot| sweep.returns.point_sensor(slot)).collect();
    let intensity: Vec<f32> =
        hits.iter().map(|&slot| sweep.returns.intensity.as_ref().expect("intensities")[slot]).collect();
    assert_same_cells(&bin(&in_sensor, &intensity, false), &scan.cells, &names);
}

/// The points of a sweep in the sensor's frame, with their intensities.
fn returned(points: &ScanPoints) -> (Vec<DVec3>, Vec<f32>) {
    let returns = &points.sweep.returns;
    let hits: Vec<usize> = (0..returns.status.len()).filter(|&slot| returns.point_sensor(slot).is_some()).collect();
    let intensity = returns.intensity.as_ref().expect("intensities");
    (
        hits.iter().filter_map(|&slot| returns.point_sensor(slot)).collect(),
        hits.iter().map(|&slot| intensity[slot]).collect(),
    )
}

/// Sets that level a corpus by fitted planes.
fn levelled(more: &[&str]) -> Prepared {
    let sets = ["cells.window_scans=1", "cells.frame=fitted_plane"].iter().chain(more).map(|set| set.to_string());
    let plan = config::load(&Yard::everything(), &sets.collect::<Vec<_>>()).expect("a good config");
    Prepared::new(plan).expect("patterns").keeping_points()
}

#[test]
fn equal_cells_of_a_corpus_of_fitted_planes_are_those_that_classify_makes_without_a_pose() {
    assert_eq!(overhanging_by_fitted_planes(&[]), 0);
}

#[test]
fn equal_cells_without_what_hangs_are_those_that_classify_makes_by_the_rule_of_the_model() {
    let crowns = "scene.trees={count: 6, diameter_m: 0.2, height_m: 1, crown: {diameter_m: 1.5, extinction_per_m: 4}}";
    assert!(overhanging_by_fitted_planes(&["cells.overhang={above_m: 0.4}", crowns]) > 50);
}

/// Judges each kept scan of a corpus of fitted planes as a cloud, holds its cells to the corpus's, and counts the points that hang.
fn overhanging_by_fitted_planes(sets: &[&str]) -> u64 {
    let prepared = levelled(sets);
    let replay = replay(&prepared);
    let family = &prepared.plan.families[replay.family];
    let names: Vec<String> = feature_columns(&family.cells, true).into_iter().map(|c| c.name).collect();
    let features: Vec<&str> = names.iter().map(String::as_str).collect();
    // Pitch, roll and the sigmas of classify are the medians that the model saw: here those of the corpus, which are 0.
    let mut model = model(&prepared, &features);
    model.about.quantiles.iter_mut().for_each(|quantiles| quantiles[3] = 0.0);
    let sensor_height_m = replay.rover_from_sensor.translation_m.z;
    let options = judge::Options { pose_source: PoseSource::Ground { sensor_height_m }, ..judge::Options::default() };
    let (mut met, mut overhanging) = (0, 0);
    for scan in &replay.scans {
        let points = scan.points.as_ref().expect("kept points");
        let (points_m, intensity) = returned(points);
        let cloud = cloud::Cloud { points_m, intensity: Some(intensity), ..cloud::Cloud::default() };
        let mut judge = ScanJudge::new(&model, options.clone()).expect("a judge");
        let judged = judge.scan("a scan", cloud, None).expect("ground");
        assert_same_cells(&judged.cells.cells, &scan.cells, &names);
        assert_eq!(judged.scan.pose.map_from_sensor, points.map_from_sensor);
        // The plane is found, and no pose: every scan begins at its own sensor.
        let found = judged.scan.levelled.expect("levelled");
        assert!((found.height_m - sensor_height_m).abs() <= 0.25 * sensor_height_m, "{found:?}");
        assert!(scan.cells.rows.len() > 100 && scan.cells.rows.iter().all(|row| row.label.is_some()));
        assert_eq!(judged.cells.cells.overhanging, scan.cells.overhanging);
        let marked = points.hanging.iter().filter(|&&hangs| hangs).count() as u64;
        assert_eq!(marked, scan.cells.overhanging);
        (met, overhanging) = (met + 1, overhanging + marked);
    }
    assert!(met > 1);
    overhanging
}

#[test]
fn extreme_sweeps_without_ground_have_no_cells_and_their_points_are_counted() {
    let prepared = levelled(&["sweep.effects.dropout.rate=0.995"]);
    let replay = replay(&prepared);
    let mut lost = 0;
    for scan in &replay.scans {
        let cells = &scan.cells;
        assert!(cells.rows.is_empty() && cells.points_binned == 0);
        assert_eq!(cells.points_in, cells.without_ground);
        lost += cells.without_ground;
    }
    assert!(lost > 0, "no sweep has a point");
}

/// A network that calls cells untraversable by their height difference: 0.5 at 0.1 m.
fn model(prepared: &Prepared, features: &[&str]) -> Model {
    let family = &prepared.plan.families[0];
    let inputs = features.len();
    let layout = Layout { inputs, hidden: vec![1], bias: true, members: 1, activation: Activation::Logistic };
    let mut weights = vec![0.0; layout.weights()];
    weights[features.iter().position(|name| *name == "height_difference_m").expect("a feature")] = 40.0;
    weights[inputs] = -4.0;
    let end = weights.len();
    weights[end - 2..].copy_from_slice(&[4.0, -2.0]);
    let rover: Rover = (*family.drive.rover).clone();
    let sensor: Sensor = (*family.sweep.sensor).clone();
    let about = About {
        marsyard_model: MODEL_FORMAT,
        inputs,
        hidden: vec![1],
        bias: true,
        members: 1,
        activation: Activation::Logistic,
        features: features.iter().map(|name| name.to_string()).collect(),
        scaler: Scaler {
            minus: vec![None; inputs],
            mean: vec![0.0; inputs],
            scale: vec![1.0; inputs],
            clip: 1e3,
            scores: Vec::new(),
        },
        quantiles: vec![[-1.0, -0.9, -0.8, 0.01, 0.8, 0.9, 1.0]; inputs],
        targets: [0.1, 0.9],
        thresholds: vec![0.5],
        cells: family.cells.clone(),
        rover,
        sensor,
        mount: [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        corpus_ids: vec!["ab".repeat(32)],
        corpus_names: vec!["tiny".into()],
        run: None,
        learnt_from: Vec::new(),
        calibration: None,
        frames: Vec::new(),
        overhangs_m: Vec::new(),
        reach_m: None,
        labels: None,
    };
    Model { network: Network { layout, weights }, about, sha256: None }
}

/// Such a model in the yard, by its name.
pub fn model_file(yard: &Yard) -> String {
    let model = model(&prepared(), &["height_difference_m"]);
    std::fs::write(yard.path("model.safetensors"), model.save().expect("a model")).expect("a file");
    "model.safetensors".into()
}

#[test]
fn law_classify_writes_all_it_promises_and_judges_by_labels() {
    let yard = Yard::new();
    let prepared = prepared();
    let replay = replay(&prepared);
    let scan = replay.scans.last().expect("a kept scan");
    let pose = replay.poses.iter().find(|row| row.scan_id == Some(scan.scan_id)).expect("its pose").estimate.pose;
    preview(&yard);
    let model = model(&prepared, &["mean_height_m", "height_difference_m", "point_count", "sigma_z_m"]);
    std::fs::write(yard.path("model.safetensors"), model.save().expect("a model")).expect("a file");
    let p = pose.position_m;
    let [roll, pitch, yaw] = [pose.roll_rad, pose.pitch_rad, pose.yaw_rad].map(f64::to_degrees);
    let pose = format!("--pose={},{},{},{roll},{pitch},{yaw}", p.x, p.y, p.z);
    let map = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/labels/marsyard.yaml");
    let output = yard.marsyard([
        "classify",
        "model.safetensors",
        "p/scene-1-cloud.ply",
        &pose,
        "--frame",
        "map",
        "--json",
        "--labels",
        map,
        "--label-field",
        "truth_class",
        "--out",
        "c",
        "--max-range",
        "100",
    ]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let lines: Vec<serde_json::Value> =
        text(&output.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON lines")).collect();
    assert_eq!(lines[1]["cells"], scan.cells.rows.len());
    assert_eq!(lines[1]["cells_unknown"], 0);
    for end in ["labelled.ply", "labelled.pcd", "mesh.ply", "cost.pgm", "cost.yaml", "class.pgm", "class.yaml"] {
        assert!(yard.path(&format!("c/scene-1-cloud-{end}")).is_file(), "{end}");
    }
    for end in ["binary", "direct", "density"] {
        let png = std::fs::read(yard.path(&format!("c/scene-1-cloud-{end}.png"))).expect("a picture");
        assert!(png.starts_with(b"\x89PNG"));
    }
    let bare = [
        "classify",
        "model.safetensors",
        "p/scene-1-cloud.ply",
        &pose,
        "--frame",
        "map",
        "--no-pictures",
        "--out",
        "b",
    ];
    let output = yard.marsyard(bare);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let pictures = std::fs::read_dir(yard.path("b"))
        .expect("a folder")
        .filter(|entry| entry.as_ref().expect("an entry").path().extension().is_some_and(|end| end == "png"));
    assert_eq!(pictures.count(), 0);
    assert_eq!(
        std::fs::read(yard.path("b/scene-1-cloud-cost.pgm")).expect("a map"),
        std::fs::read(yard.path("c/scene-1-cloud-cost.pgm")).expect("a map")
    );
    let parquet = std::fs::read(yard.path("c/cells.parquet")).expect("a table");
    assert!(parquet.starts_with(b"PAR1") && parquet.ends_with(b"PAR1"));
    let report = std::fs::read_to_string(yard.path("c/evaluation.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let counted = report["groups"][0]["cells"].as_u64().expect("a count");
    assert_eq!(counted, scan.cells.rows.len() as u64);
    let yaml = std::fs::read_to_string(yard.path("c/scene-1-cloud-cost.yaml")).expect("a map");
    assert!(yaml.starts_with("image: scene-1-cloud-cost.pgm\nmode: raw\nresolution: 0.1\norigin: ["), "{yaml}");
}

#[test]
fn law_classify_says_what_is_wrong_and_exits_2() {
    let yard = Yard::new();
    let prepared = prepared();
    let save = |name: &str, features: &[&str]| {
        std::fs::write(yard.path(name), model(&prepared, features).save().expect("a model")).expect("a file");
    };
    save("plain.safetensors", &["height_difference_m"]);
    save("light.safetensors", &["height_difference_m", "intensity_mean"]);
    save("other.safetensors", &["height_difference_m", "soil_moisture"]);
    std::fs::write(yard.path("c.csv"), "x,y,z\n1,2,0\n2,2,0\n").expect("a file");
    std::fs::write(yard.path("nan.csv"), "x,y,z\nnan,2,0\n").expect("a file");
    std::fs::create_dir(yard.path("folder.ply")).expect("a folder");
    std::os::unix::fs::symlink("/dev/zero", yard.path("endless.xyz")).expect("a link");
    let place = "--pose=0,0,0,0,0,0";
    for (arguments, needle) in [
        (vec!["plain.safetensors", "c.csv"], "--pose"),
        (vec!["plain.safetensors", "nan.csv", place], "nan.csv: there is no point in it"),
        (vec!["plain.safetensors", "none.csv", place], "none.csv: there is no such file; check its name"),
        (vec!["plain.safetensors", "c.csv/a.ply", place], "c.csv/a.ply: there is no such file: what stands before"),
        (vec!["plain.safetensors", "folder.ply", place], "folder.ply: it is a folder; name the files in it"),
        (vec!["plain.safetensors", "endless.xyz", place], "endless.xyz: it cannot be read: it is not a file but"),
        (vec!["c.csv", "c.csv", place], "not a marsyard model"),
        (vec!["light.safetensors", "c.csv", place], "intensity_mean"),
        (vec!["other.safetensors", "c.csv", place], "soil_moisture"),
        (vec!["plain.safetensors", "c.csv", "--sensor-height", "0.5"], "no ground to level by"),
        (
            vec!["plain.safetensors", "c.csv", "c.csv", "--sensor-height", "0.5", "--window", "2"],
            "--window needs poses",
        ),
    ] {
        let output = yard.marsyard(["classify"].iter().chain(&arguments));
        let said = text(&output.stderr);
        // Long lines are wrapped for people.
        let flat = said.replace(['\n', '│'], " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(flat.contains(needle), "{arguments:?}: {said}");
    }
    // Where no point lies in reach nothing was judged, and that is no success.
    std::fs::write(yard.path("far.csv"), "x,y,z\n900,2,0\n").expect("a file");
    let output = yard.marsyard(["classify", "plain.safetensors", "far.csv", place, "--out", "far"]);
    let said = text(&output.stderr);
    assert!(output.status.code() == Some(1) && said.contains("no point of any scan fell into a cell"), "{said}");
    assert!(!text(&output.stdout).contains("outside the training range"), "{}", text(&output.stdout));
    // A name that is wrong, though it is the last, is told before anything is judged.
    let output = yard.marsyard(["classify", "plain.safetensors", "c.csv", "none.csv", place]);
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("none.csv"), "{}", text(&output.stderr));
    assert_eq!(text(&output.stdout), "");
}

#[test]
fn equal_cells_without_points_of_a_cloud_are_those_of_the_corpus() {
    let sets = [
        "cells.window_scans=1",
        "cells.unseen={}",
        "cells.labels.max_drop_m=0.2",
        "scene.ground.features=[{trench: {count: 4, depth_m: 0.5, width_m: 0.6}}, {hole: {count: 9, depth_m: 0.5, width_m: 0.8}}]",
    ];
    let plan = config::load(&Yard::everything(), &sets.map(String::from)).expect("a good config");
    let prepared = Prepared::new(plan).expect("patterns").keeping_points();
    let replay = replay(&prepared);
    let family = &prepared.plan.families[replay.family];
    let scan = replay.scans.last().expect("a kept scan");
    let points = scan.points.as_ref().expect("kept points");
    let row = replay.poses.iter().find(|row| row.scan_id == Some(scan.scan_id)).expect("its pose");
    let returns = &points.sweep.returns;
    let hits: Vec<usize> = (0..returns.status.len()).filter(|&slot| returns.point_sensor(slot).is_some()).collect();
    let points_m: Vec<DVec3> = hits.iter().filter_map(|&slot| returns.point_sensor(slot)).collect();
    let intensity: Vec<f32> = hits.iter().map(|&slot| returns.intensity.as_ref().expect("intensities")[slot]).collect();
    let cloud = WindowCloud {
        points_m: &points_m,
        in_map: false,
        intensity: Some(&intensity),
        obstacle: None,
        estimate: &row.estimate,
        map_from_sensor: points.map_from_sensor,
    };
    let (here, known) = bin_clouds(&family.cells, &[cloud], points.max_range_m, &mut Scratch::default());
    let unseen = here.rows.iter().filter(|row| row.points == 0).count();
    assert!(unseen > 20 && known.len() == here.rows.len(), "{unseen}");
    let names: Vec<String> = feature_columns(&family.cells, true).into_iter().map(|c| c.name).collect();
    assert!(here.features.iter().all(|value| value.is_finite()) && names.iter().any(|name| name == "gap_drop_m"));
    assert_same_cells(&here, &scan.cells, &names);
    let deep = |row: &marsyard::cells::CellRow| row.points == 0 && row.untraversable() && row.truth.drop_m > 0.2;
    assert!(scan.cells.rows.iter().any(deep));
}

/// A yard of two levels under a sensor 2 m up, with leaves 1.3 m over the lower one and returns of the rover itself, by model `--overhang 1`.
fn two_levels(yard: &Yard) -> (u64, u64) {
    let mut text = String::from("x,y,z\n");
    let mut push = |x: f64, y: f64, z: f64| text += &format!("{x:.3},{y:.3},{z:.3}\n");
    for (x, y) in (0..6400).map(|k| (0.1 * f64::from(k % 80) - 4.0, 0.1 * f64::from(k / 80) - 4.0)) {
        push(x, y, if y < 0.5 { -2.0 } else { -1.55 });
    }
    let leaves = (0..100).map(|k| (1.05 + 0.1 * f64::from(k % 10), -2.95 + 0.1 * f64::from(k / 10)));
    leaves.clone().for_each(|(x, y)| push(x, y, -0.7));
    let own = (0..20).map(|k| (-0.2 + 0.02 * f64::from(k), 0.1));
    own.clone().for_each(|(x, y)| push(x, y, -0.9));
    std::fs::write(yard.path("levels.csv"), text).expect("a file");
    (leaves.count() as u64, own.count() as u64)
}

#[test]
fn exact_classify_tells_a_second_ground_what_hangs_and_what_is_of_the_rover() {
    let yard = Yard::new();
    let model = model_file(&yard);
    let (leaves, own) = two_levels(&yard);
    let how =
        ["classify", &model, "levels.csv", "--sensor-height", "2", "--overhang", "1", "--self-filter=0.8,0.6,1.5"];
    let output = yard.marsyard(how.iter().chain(&["--out", "words"]));
    let (said, warned) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{warned}");
    for words in [
        "levels.csv: a second plane may be the ground: the sensor stands 1.550 m above it",
        "give --sensor-height more exactly, or the pose with --pose or --trajectory",
    ] {
        assert!(warned.contains(words), "{warned}");
    }
    assert!(said.contains("without what hangs over more than 1 m of free height"), "{said}");
    assert!(said.contains(&format!("{leaves} overhanging")), "{said}");

    let output = yard.marsyard(how.iter().chain(&["--out", "numbers", "--json"]));
    let lines = text(&output.stdout);
    let scan = lines.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON a line"));
    let scan = scan.into_iter().find(|object| object.get("levelled").is_some()).expect("a levelled scan");
    assert_eq!(scan["window_points_overhanging"], leaves);
    assert!(scan["points_on_rover"].as_u64().expect("a count") >= own, "{scan}");
    let rival = &scan["levelled"]["rival"];
    assert!((rival["sensor_height_m"].as_f64().expect("a height") - 1.55).abs() < 0.01, "{rival}");

    // The model learnt without the rule, and says so.
    let other = "the model learnt cells with all that hangs over them, and these are without what hangs over 1 m of free height";
    assert!(warned.contains(other), "{warned}");

    // One level, and nothing is warned of.
    let flat: String = (0..6400)
        .map(|k| format!("{:.3},{:.3},-2\n", 0.1 * f64::from(k % 80) - 4.0, 0.1 * f64::from(k / 80) - 4.0))
        .collect();
    std::fs::write(yard.path("flat.csv"), format!("x,y,z\n{flat}")).expect("a file");
    let output = yard.marsyard(["classify", &model, "flat.csv", "--sensor-height", "2", "--out", "flat"]);
    assert!(output.status.success() && !text(&output.stderr).contains("second plane"), "{}", text(&output.stderr));
    for (option, words) in [
        ("--overhang=0", "--overhang 0: the free height that the rover needs is a number of metres above 0"),
        ("--self-filter=1,0,1", "length, width and height of the rover are metres above 0"),
    ] {
        let output = yard.marsyard(["classify", &model, "flat.csv", "--sensor-height", "2", "--out", "no", option]);
        let flat = text(&output.stderr).replace(['\n', '│'], " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(2), "{flat}");
        assert!(flat.contains(words), "{flat}");
        assert!(!yard.path("no").exists(), "nothing is written by a refused call");
    }
}
