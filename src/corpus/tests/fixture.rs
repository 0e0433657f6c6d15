//! Small scenes whose every number is known: no stage of the simulator is involved.

use std::sync::Arc;

use crate::cells::{CellRow, CellTruth, Cells, FeatureColumn, Label};
use crate::corpus::{CorpusSpec, LocalFolder, Manifest, Place, ShardWriter, Table, finalize};
use crate::episode::{PoseRow, ScanOutput, ScanPoints, SceneCounts, SceneOutput};
use crate::geometry::{CellIndex, DMat3, DVec3, GridSpec, Pose, Transform};
use crate::plan::CardParams;
use crate::random::{Dist, Drawn, Purpose, Stage, Streams};
use crate::scene::Class;
use crate::slam::Estimate;
use crate::sweep::{Pattern, Returns, Status, Sweep, TrueReturn};

pub(crate) fn spec(scenes: u64, tables: &[Table]) -> CorpusSpec {
    let feature = |name: &str, unit, description: &str| FeatureColumn {
        name: name.into(),
        unit,
        description: description.into(),
    };
    CorpusSpec {
        name: "tiny".into(),
        seed: 42,
        scenes,
        scenes_per_shard: 2,
        tables: tables.to_vec(),
        features: vec![
            feature("mean_height_m", "m", "Mean height of the points above the rover."),
            feature("height_variance_m2", "m2", "Variance of the points' heights."),
        ],
        pose_covariance: false,
        by_rover: false,
        poses: false,
        truth: vec![],
        losses: vec![],
        drawn: vec![Purpose::GroundRmsHeight, Purpose::GroundCorrelationLength],
        families: vec!["default".into()],
        scene_plan_hash: "ab".repeat(32),
        yards: vec!["ef".repeat(32)],
        plan_yaml: format!(
            "marsyard: 1\nname: tiny\nseed: 42\nscenes: {scenes}\nscenes_per_shard: 2\nscene:\n  extent_m: 20.0\n"
        ),
        card: CardParams { license: Some("CC0-1.0".into()), ..CardParams::default() },
        facts: Vec::new(),
    }
}

/// Two kept scans of `cells` cells, some poses; values depend on the scene's number alone.
pub(crate) fn scene(scene_id: u64, cells: usize) -> SceneOutput {
    let streams = Streams { seed: 42, scene: scene_id, attempt: 0, stage: Stage::Scene, step: 0 };
    SceneOutput {
        scene_id,
        family: "default".into(),
        attempts: 1,
        error: None,
        drawn: Drawn::draw(&streams, [(Purpose::GroundRmsHeight, &Dist::Constant(0.25))]),
        counts: SceneCounts { rocks: 5, boxes: 1, trees: 0, volumes: 2, patches: 0, stops: 4, cut_short: false },
        scans: [1, 3]
            .map(|scan_id| ScanOutput { scan_id, cells: grid(scene_id, scan_id, cells), points: Some(points()) })
            .into(),
        poses: (0..4).map(|step| pose(scene_id, step)).collect(),
    }
}

fn grid(scene_id: u64, scan_id: u32, cells: usize) -> Cells {
    let row = |k: usize| CellRow {
        index: CellIndex { row: k as i32 / 10 - 2, col: k as i32 % 10 },
        label: [Some(Label::Traversable), Some(Label::Traversable), Some(Label::Untraversable), None][k % 4],
        points: k as i32 + 1,
        range_m: 0.5 * k as f32,
        neighbour_mask: k as i32 % 256,
        truth: CellTruth { class: Some(Class::ALL[k % 2]), object: k as i32 % 2 - 1, ..CellTruth::default() },
    };
    let feature = |k: usize| 0.125 * (k as f32) - scene_id as f32 + scan_id as f32;
    Cells {
        rows: (0..cells).map(row).collect(),
        features: (0..2 * cells).map(feature).collect(),
        points_in: 10,
        points_binned: 7,
        dropped_beyond_range: 2,
        dropped_off_grid: 1,
        without_ground: 0,
        overhanging: 0,
    }
}

/// Three beams ahead: a hit at 2 m, a miss, a hit at 20 m that is beyond the cells' reach. The sensor stands at (5, 5, 1).
fn points() -> ScanPoints {
    let pattern = Pattern { lines: 1, beams: 3, directions: vec![DVec3::X; 3], times_s: vec![0.0, 0.1, 0.2] };
    let ground = |range_m| TrueReturn { range_m, object: -1, class: Some(Class::Ground), top: false };
    ScanPoints {
        sweep: Sweep {
            returns: Returns {
                pattern: Arc::new(pattern),
                range_m: vec![2.0, f64::NAN, 20.0],
                status: vec![Status::Hit, Status::None, Status::Hit],
                intensity: None,
            },
            mixed: None,
            truth: vec![
                ground(2.5),
                TrueReturn { range_m: f64::INFINITY, object: -2, class: None, top: false },
                ground(20.0),
            ],
        },
        map_from_sensor: Transform { rotation: DMat3::IDENTITY, translation_m: DVec3::new(5.0, 5.0, 1.0) },
        rover_z_m: 0.5,
        grid: GridSpec { size_m: 0.5 },
        max_range_m: 10.0,
        hanging: Vec::new(),
        obstacles: vec![true],
    }
}

fn pose(scene_id: u64, step: u32) -> PoseRow {
    let position_m = DVec3::new(f64::from(step), scene_id as f64, -0.0);
    let truth = Pose { position_m, ..Pose::default() };
    let mut covariance = [[0.0; 6]; 6];
    covariance[0][0] = 0.04;
    let estimate = Estimate {
        pose: truth,
        covariance,
        effective_samples: 30.0,
        features: 6,
        matched: 4,
        new_landmarks: 2,
        landmarks: 9,
        skipped: 0,
        sigma_optimistic: false,
    };
    PoseRow {
        step,
        time_s: 0.5 * f64::from(step),
        stop: step % 2 == 1,
        scan_id: (step % 2 == 1).then_some(step),
        truth,
        estimate,
    }
}

/// A shard of two scenes.
pub(crate) fn write_shard(spec: &CorpusSpec, shard: u64) -> crate::corpus::FinishedShard {
    let mut writer = ShardWriter::new(spec, shard).unwrap();
    spec.scenes_of(shard).for_each(|id| writer.push(&scene(id, 40)).unwrap());
    writer.finish().unwrap()
}

/// A whole corpus in a folder of its own.
pub(crate) fn corpus(spec: &CorpusSpec) -> (tempfile::TempDir, LocalFolder, Manifest) {
    let dir = tempfile::tempdir().unwrap();
    let store = LocalFolder::new(dir.path().join("tiny"));
    Place::open(&store, spec).unwrap();
    for shard in 0..spec.shards() {
        write_shard(spec, shard).commit(&store).unwrap();
    }
    let manifest = finalize(&store, spec).unwrap();
    (dir, store, manifest)
}
