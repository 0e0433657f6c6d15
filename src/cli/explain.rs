//! Replays one scene and says what was drawn and computed; for a cell, the arithmetic of its features and label.

use std::path::{Path, PathBuf};

use clap::Args;

use super::generate::spec_of;
use super::output::outln;
use super::place::{self, corpus_failure, is_config};
use super::{Failure, config_failure};
use crate::cells::{Placer, feature_columns};
use crate::config::{self, Family, Plan};
use crate::corpus::{self, ScanOutput, ScanPoints, Split};
use crate::geometry::{CellIndex, DVec3};
use crate::pipeline::{Hashes, Prepared, Replay, Scratch, replay_scene};
use crate::random::Drawn;
use crate::scene::{Class, Scene};
use crate::sweep::Status;

#[derive(Debug, Args)]
pub(super) struct ExplainArgs {
    /// A config, a plan.yaml, or the folder or URL of a corpus (then the stored row is compared).
    place: PathBuf,
    /// Number of the scene.
    #[arg(long)]
    scene: u64,
    /// Number of the scan (the stop), for --cell; default: the last kept one.
    #[arg(long)]
    scan: Option<u32>,
    /// A cell as row,col.
    #[arg(long, value_parser = parse_cell, value_name = "ROW,COL", allow_hyphen_values = true)]
    cell: Option<CellIndex>,
    /// Override a key of a config.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
}

fn parse_cell(text: &str) -> Result<CellIndex, String> {
    let parse = |s: &str| s.trim().parse::<i32>().map_err(|e| format!("'{s}': {e}"));
    let (row, col) = text.split_once(',').ok_or("a cell is ROW,COL, such as 104,87")?;
    Ok(CellIndex { row: parse(row)?, col: parse(col)? })
}

/// The plan of a config file, a plan.yaml or a corpus; and the place of the corpus, if it is one.
pub(super) fn plan_of<'p>(place: &'p Path, sets: &[String]) -> Result<(Plan, Option<&'p Path>), Failure> {
    let (file, corpus) = if is_config(place) { (place.into(), None) } else { (place.join("plan.yaml"), Some(place)) };
    Ok((config::load(&file, sets).map_err(config_failure)?, corpus))
}

/// Refuses a scene that the plan does not have.
pub(super) fn check_scene(plan: &Plan, scene: u64) -> Result<(), Failure> {
    if scene < plan.scenes {
        return Ok(());
    }
    Err(Failure::usage(miette::miette!(
        help = format!("scenes are numbered 0 to {}", plan.scenes - 1),
        "--scene {scene}: the plan has {} scenes",
        plan.scenes
    )))
}

pub(super) fn run(args: &ExplainArgs) -> Result<(), Failure> {
    let (plan, corpus) = plan_of(&args.place, &args.sets)?;
    check_scene(&plan, args.scene)?;
    let prepared = Prepared::new(plan).map_err(Failure::failed)?.keeping_points();
    let mut hashes = Hashes::new();
    let replay = replay_scene(&prepared, args.scene, &mut Scratch::default(), &mut hashes).map_err(|failed| {
        outln!("drawn values");
        tell_drawn(&failed.drawn);
        Failure::failed(format!("scene {} failed after {} attempts: {}", args.scene, failed.attempts, failed.reason))
    })?;
    let family = &prepared.plan.families[replay.family];
    match args.cell {
        None => {
            tell_scene(&prepared.plan, args.scene, family, &replay, &hashes);
            Ok(())
        }
        Some(cell) => {
            let scan = pick_scan(&replay, args.scan)?;
            tell_cell(family, &replay, scan, cell)?;
            corpus.map_or(Ok(()), |folder| compare_stored(folder, &prepared.plan, args.scene, family, scan, cell))
        }
    }
}

fn tell_drawn(drawn: &Drawn) {
    for (purpose, value) in drawn.iter() {
        outln!("  {:<58} {value}", purpose.key());
    }
}

fn tell_scene(plan: &Plan, scene: u64, family: &Family, replay: &Replay, hashes: &Hashes) {
    let shard = plan.shard_of(scene);
    outln!("scene {scene} of '{}' (seed {}), family {}", plan.name, plan.seed, family.name);
    outln!("shard {shard} ({}), attempts {}\n", Split::of_shard(shard).name(), replay.attempts);
    outln!("drawn values");
    tell_drawn(&replay.drawn);
    outln!("\nstages (hash of their f64 results)");
    let hash_of =
        |name: &str| hashes.finish().into_iter().find(|(n, _)| *n == name).map(|(_, h)| h).unwrap_or_default();
    let (yard, drive) = (&replay.scene, &replay.drive);
    let driven_m: f64 = drive.truth.windows(2).map(|w| (w[1].position_m - w[0].position_m).length()).sum();
    let sizes =
        format!("{} obstacles, {} volumes, {} patches", yard.obstacles.len(), yard.volumes.len(), yard.patches.len());
    outln!("  scene {}  {sizes}", hash_of("scene"));
    outln!("  drive {}  {} steps, {driven_m:.2} m, {} stops", hash_of("drive"), drive.truth.len(), drive.stops.len());
    outln!("  sweep {}", hash_of("sweep"));
    outln!("  slam  {}", hash_of("slam"));
    outln!("  cells {}", hash_of("cells"));
    outln!("\npose at each stop: estimate (truth), metres and degrees");
    for row in replay.poses.iter().filter(|row| row.stop) {
        let (e, t) = (&row.estimate.pose, &row.truth);
        outln!(
            "  step {:>4}  x {:>7.3} ({:>7.3})  y {:>7.3} ({:>7.3})  z {:>6.3} ({:>6.3})  yaw {:>7.2} ({:>7.2})  pitch {:>6.2} ({:>6.2})  roll {:>6.2} ({:>6.2})",
            row.step,
            e.position_m.x,
            t.position_m.x,
            e.position_m.y,
            t.position_m.y,
            e.position_m.z,
            t.position_m.z,
            e.yaw_rad.to_degrees(),
            t.yaw_rad.to_degrees(),
            e.pitch_rad.to_degrees(),
            t.pitch_rad.to_degrees(),
            e.roll_rad.to_degrees(),
            t.roll_rad.to_degrees(),
        );
    }
    outln!("\nkept scans");
    for scan in &replay.scans {
        let cells = &scan.cells;
        let bad = cells.rows.iter().filter(|row| row.label == Some(1)).count();
        outln!(
            "  scan {}: {} cells, {bad} untraversable; points in {} = binned {} + beyond range {} + off grid {}",
            scan.scan_id,
            cells.rows.len(),
            cells.points_in,
            cells.points_binned,
            cells.dropped_beyond_range,
            cells.dropped_off_grid
        );
    }
    if let Some(row) = replay.scans.last().and_then(|s| s.cells.rows.iter().find(|r| r.label == Some(1))) {
        outln!("\none cell in full: add --cell {},{}", row.index.row, row.index.col);
    }
}

pub(super) fn pick_scan(replay: &Replay, scan: Option<u32>) -> Result<&ScanOutput, Failure> {
    let found = match scan {
        None => replay.scans.last(),
        Some(id) => replay.scans.iter().find(|s| s.scan_id == id),
    };
    found.ok_or_else(|| {
        let kept: Vec<String> = replay.scans.iter().map(|s| s.scan_id.to_string()).collect();
        Failure::usage(miette::miette!("no such kept scan; this scene keeps scans {}", kept.join(", ")))
    })
}

/// A point of the kept sweep that lies in the cell.
struct Point {
    slot: usize,
    map_m: DVec3,
    object: i32,
    class: i8,
    top: bool,
}

fn points_in(family: &Family, replay: &Replay, scan: &ScanOutput, points: &ScanPoints, cell: CellIndex) -> Vec<Point> {
    let pose = &pose_of(replay, scan).estimate.pose;
    let max_range_m = family.cells.max_range_m.unwrap_or(points.max_range_m);
    let placer = Placer::new(points.grid, max_range_m, pose, &replay.rover_from_sensor);
    let sweep = &points.sweep;
    let hits = (0..sweep.status.len()).filter(|&slot| sweep.status[slot] == Status::Hit);
    hits.filter_map(|slot| {
        let placed = placer.place(sweep.pattern.directions[slot], sweep.range_m[slot]);
        let truth = &sweep.truth[slot];
        (placed.cell == Ok(cell)).then_some(Point {
            slot,
            map_m: placed.point_m,
            object: truth.object,
            class: truth.class,
            top: truth.top,
        })
    })
    .collect()
}

fn pose_of<'r>(replay: &'r Replay, scan: &ScanOutput) -> &'r corpus::PoseRow {
    replay.poses.iter().find(|row| row.scan_id == Some(scan.scan_id)).expect("every kept scan has its pose row")
}

fn tell_cell(family: &Family, replay: &Replay, scan: &ScanOutput, cell: CellIndex) -> Result<(), Failure> {
    let Some(at) = scan.cells.rows.iter().position(|row| row.index == cell) else {
        return Err(Failure::failed(format!(
            "cell {},{} of scan {} is empty: it holds no point within range",
            cell.row, cell.col, scan.scan_id
        )));
    };
    let row = &scan.cells.rows[at];
    let points = scan.points.as_ref().expect("explain keeps the sweeps");
    let size_m = family.cells.size_m;
    outln!(
        "cell row {} col {} of scan {}: x {:.3} to {:.3} m, y {:.3} to {:.3} m (map)",
        cell.row,
        cell.col,
        scan.scan_id,
        f64::from(cell.col) * size_m,
        f64::from(cell.col + 1) * size_m,
        f64::from(cell.row) * size_m,
        f64::from(cell.row + 1) * size_m
    );
    let inside = points_in(family, replay, scan, points, cell);
    let rover_z_m = pose_of(replay, scan).estimate.pose.position_m.z;
    outln!("\npoints of the kept sweep (heights above the rover's estimated z, {rover_z_m:.4} m)");
    outln!("  {:>5} {:>5}  {:>8}  {:>8}  {:>8}  {:>8}  truth", "line", "beam", "range m", "x m", "y m", "height m");
    let beams = points.sweep.pattern.beams as usize;
    for p in &inside {
        outln!(
            "  {:>5} {:>5}  {:>8.4}  {:>8.4}  {:>8.4}  {:>8.4}  {}{}",
            p.slot / beams,
            p.slot % beams,
            points.sweep.range_m[p.slot],
            p.map_m.x,
            p.map_m.y,
            p.map_m.z - rover_z_m,
            object_name(&replay.scene, p.object, p.class),
            if p.top { ", on its top" } else { "" }
        );
    }
    let carried = row.points as usize - inside.len();
    if carried > 0 {
        outln!("  and {carried} points of earlier sweeps of the window");
    } else {
        let heights: Vec<f64> = inside.iter().map(|p| p.map_m.z - rover_z_m).collect();
        let count = heights.len() as f64;
        let mean = heights.iter().sum::<f64>() / count;
        let variance = heights.iter().map(|h| (h - mean) * (h - mean)).sum::<f64>() / count;
        outln!(
            "\n  mean = sum / {count} = {mean:.6} m (eq. 3);  variance = sum of squares / {count} = {variance:.3e} m2 (eq. 4)"
        );
    }
    outln!("\nfeatures (as stored, f32)");
    let columns = feature_columns(&family.cells, family.sweep.effects.intensity.is_some());
    let features = &scan.cells.features[at * columns.len()..][..columns.len()];
    for (column, value) in columns.iter().zip(features) {
        outln!("  {:<24} {value:>14.6e} {}", column.name, column.unit);
    }
    let truth = &row.truth;
    let rule = &family.cells.labels;
    outln!("\nlabel");
    outln!(
        "  tallest object: {} standing {:.3} m above the ground",
        object_name(&replay.scene, truth.object, truth.class),
        truth.protrusion_m
    );
    outln!(
        "  rule: {:?} (wheel {} m), at least {} points",
        rule.obstacle,
        family.drive.rover.wheel_diameter_m,
        rule.min_obstacle_points
    );
    outln!("  obstacle points {} of {} (on tops: {})", truth.obstacle_points, row.points, truth.top_points);
    if let Some(limit) = rule.max_ground_slope_deg {
        outln!("  ground slope {:.2} degrees, limit {limit}", f64::from(truth.slope_rad).to_degrees());
    }
    let word = match row.label {
        Some(0) => "0, traversable",
        Some(_) => "1, untraversable",
        None => "unknown",
    };
    outln!("  label: {word}");
    Ok(())
}

fn object_name(scene: &Scene, object: i32, class: i8) -> String {
    const NAMES: [(Class, &str); 7] = [
        (Class::Ground, "ground"),
        (Class::Rock, "rock"),
        (Class::Box, "box"),
        (Class::Trunk, "trunk"),
        (Class::Grass, "grass"),
        (Class::Bush, "bush"),
        (Class::Crown, "crown"),
    ];
    let name = NAMES.iter().find(|(c, _)| *c as i8 == class).map_or("nothing", |(_, name)| name);
    match scene.obstacles.get(object.max(0) as usize).filter(|_| object >= 0) {
        Some(obstacle) => format!("{name} {object} ({:.2} m tall)", obstacle.protrusion_m),
        None if object >= 0 => format!("{name} {object}"),
        None => name.to_string(),
    }
}

/// Sets the replayed row beside the stored one.
fn compare_stored(
    folder: &Path,
    plan: &Plan,
    scene: u64,
    family: &Family,
    scan: &ScanOutput,
    cell: CellIndex,
) -> Result<(), Failure> {
    let store = place::open(folder)?;
    let stored =
        corpus::stored_cell(store.as_ref(), &spec_of(plan), scene, scan.scan_id, cell).map_err(corpus_failure)?;
    let Some(stored) = stored else {
        return Err(Failure::failed("the corpus has no row for this cell: it was built by another plan or binary"));
    };
    let columns = feature_columns(&family.cells, family.sweep.effects.intensity.is_some());
    let at = scan.cells.rows.iter().position(|row| row.index == cell).expect("told above");
    let replayed = &scan.cells.features[at * columns.len()..][..columns.len()];
    let mut differences = 0;
    for ((name, there), here) in stored.features.iter().zip(replayed) {
        if there.to_bits() != here.to_bits() {
            differences += 1;
            outln!("  differs: {name} is stored as {there:e}, replayed as {here:e}");
        }
    }
    if stored.label != scan.cells.rows[at].label {
        differences += 1;
        outln!("  differs: the stored label is {:?}", stored.label);
    }
    if differences == 0 {
        outln!("\nthe stored row is the same, bit for bit");
        return Ok(());
    }
    Err(Failure::failed(format!("{differences} values differ from the stored row")))
}
