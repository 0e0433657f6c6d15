//! Judges a scan with a network: which cells around the sensor can be crossed.
//!
//! `cargo run --release --example judge_scan [MODEL SCAN SENSOR_HEIGHT_M]`. MODEL is a `model.safetensors`, SCAN a cloud in the sensor's
//! frame (PLY, PCD, LAS, KITTI, CSV, XYZ). Without them a small network is trained, and a simulated scan of a yard that it does not know is
//! judged beside the truth.

use std::error::Error;
use std::path::Path;

use marsyard::cells::Label;
use marsyard::cloud::{self, Cloud};
use marsyard::geometry::Pose;
use marsyard::judge::{JudgedScan, Options, PoseSource, ScanJudge};
use marsyard::{build_corpus, config, episode::Prepared, simulate_scene, train::Model, train_network};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [model, scan, height_m] = &words[..] else {
        return if words.is_empty() { simulated() } else { Err("give MODEL SCAN SENSOR_HEIGHT_M, or nothing".into()) };
    };
    let model = Model::read(Path::new(model))?;
    let cloud = cloud::read(scan, &std::fs::read(scan)?, None, &cloud::Options::default())?;
    // No pose: the ground is looked for at this height below the sensor.
    let pose_source = PoseSource::Ground { sensor_height_m: height_m.parse()? };
    let mut judge = ScanJudge::new(&model, Options { pose_source, ..Options::default() })?;
    draw(&judge.scan(scan, cloud, None)?, |_| None);
    Ok(())
}

/// A scan whose truth is known.
fn simulated() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let (corpus, run) = (folder.path().join("corpus"), folder.path().join("run"));
    let quickstart = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.yaml");
    let load = |sets: [&str; 3]| config::load(&quickstart, &sets.map(String::from));
    let plan = load(["scenes=20", "scenes_per_shard=1", "cells.size_m=0.2"])?;
    build_corpus(&plan, &corpus, std::thread::available_parallelism()?.get())?;
    let params = config::load_train(None, &["network.hidden=[8]", "epochs=3"].map(String::from))?;
    let model = train_network(&corpus, params, &run)?;

    let other_yards = Prepared::new(load(["seed=1", "scenes=50", "cells.size_m=0.2"])?)?.keeping_points();
    let scan = simulate_scene(&other_yards, 0)?.scans.swap_remove(0);
    let points = scan.points.ok_or("points are kept")?;
    let returns = &points.sweep.returns;
    let points_m = (0..returns.status.len()).filter_map(|slot| returns.point_sensor(slot)).collect();
    let mut judge = ScanJudge::new(&model, Options { pose_source: PoseSource::Sensor, ..Options::default() })?;
    let sensor = Pose::from_transform(&points.map_from_sensor);
    let judged = judge.scan("simulated", Cloud { points_m, ..Cloud::default() }, Some(&sensor))?;
    // The same points in the same grid: cell by cell the truth.
    draw(&judged, |cell| scan.cells.rows[cell].label);
    Ok(())
}

/// The cells from above, north up, with what was judged wrongly where `truth` is known.
fn draw(judged: &JudgedScan, truth: impl Fn(usize) -> Option<Label>) {
    let cells = &judged.cells;
    let places: Vec<(i32, i32)> = cells.cells.rows.iter().map(|row| (row.index.row, row.index.col)).collect();
    let (Some(south), Some(north)) = (places.first(), places.last()) else { return };
    let cols = || places.iter().map(|place| place.1);
    println!(". crossed, # not, ! not but called so, ? the other way round, blank unseen");
    for row in (south.0..=north.0).rev() {
        let sign = |col| {
            let cell = places.binary_search(&(row, col)).ok()?;
            Some(match (cells.classes[cell]?, truth(cell)) {
                (0, Some(Label::Untraversable)) => '!',
                (0, _) => '.',
                (_, Some(Label::Traversable)) => '?',
                _ => '#',
            })
        };
        let line: String =
            (cols().min().unwrap_or(0)..=cols().max().unwrap_or(0)).map(|col| sign(col).unwrap_or(' ')).collect();
        println!("{}", line.trim_end());
    }
}
