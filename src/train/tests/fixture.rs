//! Small corpora made of given rows, and trainings on them.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::cells::{CellParams, CellRow, CellTruth, Cells, FeatureColumn, Label};
use crate::corpus::{CorpusSpec, LocalFolder, ShardWriter, Store, Table, finalize};
use crate::episode::{ScanOutput, SceneOutput};
use crate::geometry::CellIndex;
use crate::math;
use crate::plan::CardParams;
use crate::random::{Purpose, Stage, Streams};
use crate::sweep::Sensor;
use crate::train::run::Origin;
use crate::train::{Event, Outcome, Setup, Source, Sources, TrainError, TrainParams, train};

/// A row: label and three features.
pub(super) type Row = (Option<Label>, [f32; 3]);

pub(super) const FEATURES: [&str; 3] = ["mean_height_m", "height_difference_m", "sigma_x_m"];

/// A corpus with one scene a shard, in the folder `name`.
pub(super) fn corpus(dir: &tempfile::TempDir, name: &str, shards: &[Vec<Row>]) -> PathBuf {
    let place = dir.path().join(name);
    let store = LocalFolder::new(&place);
    let feature = |name: &str| FeatureColumn { name: name.into(), unit: "m", description: "A number.".into() };
    let spec = CorpusSpec {
        name: name.into(),
        seed: 1,
        scenes: shards.len() as u64,
        scenes_per_shard: 1,
        tables: vec![Table::Cells],
        features: FEATURES.map(feature).into(),
        pose_covariance: false,
        by_rover: false,
        poses: false,
        truth: vec![],
        losses: vec![],
        drawn: Vec::new(),
        families: vec!["default".into()],
        scene_plan_hash: "cd".repeat(32),
        yards: vec![format!("yards of {name}")],
        plan_yaml: format!("marsyard: 1\nname: {name}\nseed: 1\nscenes: {}\nscenes_per_shard: 1\n", shards.len()),
        card: CardParams { license: Some("CC0-1.0".into()), ..CardParams::default() },
        facts: Vec::new(),
    };
    crate::corpus::Place::open(&store, &spec).unwrap();
    for (shard, rows) in shards.iter().enumerate() {
        let mut writer = ShardWriter::new(&spec, shard as u64).unwrap();
        writer.push(&scene(shard as u64, rows)).unwrap();
        writer.finish().unwrap().commit(&store).unwrap();
    }
    finalize(&store, &spec).unwrap();
    place
}

fn scene(scene_id: u64, rows: &[Row]) -> SceneOutput {
    let row = |(k, (label, _)): (usize, &Row)| CellRow {
        index: CellIndex { row: (k / 100) as i32, col: (k % 100) as i32 },
        label: *label,
        points: 3,
        range_m: 1.0,
        neighbour_mask: 0,
        truth: CellTruth { obstacle_points: i32::from(*label == Some(Label::Untraversable)), ..CellTruth::default() },
    };
    let cells = Cells {
        rows: rows.iter().enumerate().map(row).collect(),
        features: rows.iter().flat_map(|(_, features)| *features).collect(),
        points_in: 1,
        points_binned: 1,
        dropped_beyond_range: 0,
        dropped_off_grid: 0,
        without_ground: 0,
        overhanging: 0,
    };
    SceneOutput {
        scene_id,
        family: "default".into(),
        attempts: 1,
        scans: vec![ScanOutput { scan_id: 0, cells, points: None }],
        ..SceneOutput::default()
    }
}

/// Rows of a problem that a small network can learn: untraversable where a^2 + b > 1, with a number for the rest.
pub(super) fn circle(shard: u64, count: usize) -> Vec<Row> {
    let stream = Streams { seed: 5, scene: shard, attempt: 0, stage: Stage::Cells, step: 0 }.open(Purpose::GroundNoise);
    let mut draws = vec![0.0; 3 * count];
    stream.fill_normal(0, &mut draws);
    let row = |xs: &[f64]| {
        let untraversable = xs[0] * xs[0] + math::exp(xs[1]) > 2.5;
        (Some(Label::untraversable_if(untraversable)), [xs[0] as f32, (xs[1] * 3.0 + 10.0) as f32, xs[2] as f32])
    };
    draws.chunks_exact(3).map(row).collect()
}

/// Seven shards, so that all splits are there.
pub(super) fn circles(dir: &tempfile::TempDir, name: &str, rows: usize) -> PathBuf {
    corpus(dir, name, &(0..7).map(|shard| circle(shard, rows)).collect::<Vec<_>>())
}

pub(super) fn origin() -> Origin {
    Origin {
        frames: Vec::new(),
        overhangs_m: Vec::new(),
        reach_m: None,
        cells: CellParams::default(),
        rover: serde_saphyr::from_str(include_str!("../../../configs/rovers/kapvik.yaml")).unwrap(),
        sensor: serde_saphyr::from_str::<Sensor>(include_str!("../../../configs/sensors/urg-04lx.yaml")).unwrap(),
        mount: [0.2, 0.0, 0.4, 0.0, 0.0, 0.0],
    }
}

pub(super) fn sources(places: &[PathBuf], params: &TrainParams) -> Result<Sources, TrainError> {
    let list = places.iter().map(|place| Source::open(&LocalFolder::new(place), 1.0)).collect::<Result<_, _>>()?;
    Sources::new(list, &params.features, params.labels.clone())
}

/// A small network, a few passes.
pub(super) fn params() -> TrainParams {
    with(&[])
}

/// The same with other settings.
pub(super) fn with(sets: &[&str]) -> TrainParams {
    let base = ["network.hidden=[4]", "features=all", "epochs=3", "validate_every=300", "patience=5"];
    // Corpora this small are learnt by the Kalman filter.
    let filter = Some(&"filter={ekf: {}}").filter(|_| !sets.iter().any(|set| set.starts_with("filter")));
    let sets: Vec<String> = base.iter().chain(filter).chain(sets).map(|set| (*set).to_string()).collect();
    crate::config::load_train(None, &sets).unwrap()
}

pub(super) fn setup(places: &[PathBuf], params: &TrainParams, out: PathBuf) -> Result<Setup, TrainError> {
    Ok(Setup {
        config_yaml: crate::config::train_yaml(params),
        sources: Arc::new(sources(places, params)?),
        params: params.clone(),
        origin: origin(),
        out,
        resume: false,
        init: None,
        ahead: 1,
    })
}

/// Trains to the end.
pub(super) fn run(setup: &Setup) -> Result<crate::train::run::Summary, TrainError> {
    match train(setup, &AtomicBool::new(false), &mut |_| ())? {
        Outcome::Done(summary, _) => Ok(*summary),
        Outcome::Interrupted { .. } => panic!("nobody asked it to stop"),
    }
}

/// Trains until so many rows are learnt; then the run is interrupted, or (`crash`) dropped without a last checkpoint.
pub(super) fn run_until(setup: &Setup, rows: u64, crash: bool) {
    let stop = AtomicBool::new(false);
    let mut tell = |event: Event| {
        if let Event::Rows(learnt) = event
            && learnt >= rows
        {
            assert!(!crash, "crash");
            stop.store(true, std::sync::atomic::Ordering::Relaxed);
        }
    };
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| train(setup, &stop, &mut tell)));
    match outcome {
        Ok(outcome) => assert!(matches!(outcome.unwrap(), Outcome::Interrupted { .. })),
        Err(_) => assert!(crash),
    }
}

/// The files of a run that must have the same bits.
pub(super) fn identity(setup: &Setup) -> Vec<(&'static str, Vec<u8>)> {
    use crate::train::folder::{CONFIG, CURVES, FILTER, LOOKS, MODEL, SUMMARY};
    let store = LocalFolder::new(&setup.out);
    let mut files: Vec<_> =
        [CONFIG, MODEL, FILTER, SUMMARY, CURVES].into_iter().map(|name| (name, store.read(name).unwrap())).collect();
    let looks = String::from_utf8(store.read(LOOKS).unwrap()).unwrap();
    let timeless = |line: &str| line.split(",\"elapsed_s\"").next().unwrap_or_default().to_string() + "\n";
    files.push((LOOKS, looks.lines().map(timeless).collect::<String>().into_bytes()));
    files
}

/// The looks of a run.
pub(super) fn looks(setup: &Setup) -> Vec<crate::train::stopping::Look> {
    let text = std::fs::read_to_string(setup.out.join(crate::train::folder::LOOKS)).unwrap();
    text.lines().map(|line| serde_json::from_str::<crate::train::looks::Line>(line).unwrap().look).collect()
}
