//! One cell of a replayed scan: its points, the arithmetic of each feature and of the label; against the stored row.

use std::path::Path;

use crate::cells::params::{LabelParams, ObstacleRule};
use crate::cells::{CellAssigner, CellRow, Offset, feature_columns, is_neighbour, neighbour_offsets};
use crate::cli::Failure;
use crate::cli::output::outln;
use crate::cli::place::{self, corpus_failure};
use crate::corpus::{self};
use crate::episode::Replay;
use crate::episode::{ScanOutput, ScanPoints};
use crate::geometry::{CellIndex, DVec3};
use crate::plan::Family;
use crate::scene::{Class, Scene};
use crate::sweep::Status;

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
    let placer = CellAssigner::new(points.grid, max_range_m, pose, &replay.rover_from_sensor);
    let sweep = &points.sweep;
    let hits = (0..sweep.returns.status.len()).filter(|&slot| sweep.returns.status[slot] == Status::Hit);
    hits.filter_map(|slot| {
        let placed = placer.place(sweep.returns.pattern.directions[slot], sweep.returns.range_m[slot]);
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

fn pose_of<'r>(replay: &'r Replay, scan: &ScanOutput) -> &'r crate::episode::PoseRow {
    replay.poses.iter().find(|row| row.scan_id == Some(scan.scan_id)).expect("every kept scan has its pose row")
}

pub(super) fn tell(family: &Family, replay: &Replay, scan: &ScanOutput, cell: CellIndex) -> Result<(), Failure> {
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
    let beams = points.sweep.returns.pattern.beams as usize;
    for p in &inside {
        outln!(
            "  {:>5} {:>5}  {:>8.4}  {:>8.4}  {:>8.4}  {:>8.4}  {}{}",
            p.slot / beams,
            p.slot % beams,
            points.sweep.returns.range_m[p.slot],
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
    let offsets = neighbour_offsets(family.cells.neighbours);
    let mut neighbours = offsets.iter();
    for (column, value) in columns.iter().zip(features) {
        let source = match is_neighbour(&column.name).then(|| neighbours.next()).flatten() {
            Some(offset) => neighbour(scan, cell, *offset, columns.len()),
            None => column.description.clone(),
        };
        outln!("  {:<24} {value:>14.6e} {:<3} {source}", column.name, column.unit);
    }
    tell_label(family, replay, row);
    Ok(())
}

/// Where a neighbour's height comes from.
fn neighbour(scan: &ScanOutput, cell: CellIndex, offset: Offset, width: usize) -> String {
    let index = CellIndex { row: cell.row + offset.rows, col: cell.col + offset.cols };
    match scan.cells.rows.iter().position(|row| row.index == index) {
        Some(at) => format!(
            "the mean height of cell {},{} ({}): {:.6e}",
            index.row,
            index.col,
            counted(scan.cells.rows[at].points, "point"),
            scan.cells.features[at * width]
        ),
        None => format!("cell {},{} is empty: the own mean height", index.row, index.col),
    }
}

fn tell_label(family: &Family, replay: &Replay, row: &CellRow) {
    let truth = &row.truth;
    let rule: &LabelParams = &family.cells.labels;
    outln!("\nlabel");
    outln!(
        "  tallest object: {} standing {:.3} m above the ground",
        object_name(&replay.scene, truth.object, truth.class),
        truth.protrusion_m
    );
    let wheel_diameter_m = family.drive.rover.wheel_diameter_m;
    outln!("  rule: {}", obstacle_rule(rule.obstacle, wheel_diameter_m));
    let (found, wanted) = (truth.obstacle_points, rule.min_obstacle_points);
    outln!(
        "  obstacle points: {found} of {} (on tops: {}); {wanted} make a cell untraversable: {}",
        row.points,
        truth.top_points,
        if i64::from(found) >= i64::from(wanted) { "met" } else { "not met" }
    );
    if let Some(limit_deg) = rule.max_ground_slope_deg {
        let slope_deg = f64::from(truth.slope_rad).to_degrees();
        let word = if slope_deg > limit_deg { "steeper" } else { "not steeper" };
        outln!("  ground slope: {slope_deg:.2} degrees, {word} than the limit of {limit_deg}");
    }
    outln!("  label: {}", label_words(row.label));
}

fn label_words(label: Option<i8>) -> &'static str {
    match label {
        Some(0) => "0, traversable",
        Some(_) => "1, untraversable",
        None => "unknown",
    }
}

/// Which solid objects count as obstacles.
fn obstacle_rule(rule: ObstacleRule, wheel_diameter_m: f64) -> String {
    match rule {
        ObstacleRule::TallerThanWheel => {
            format!("an obstacle stands taller than the rover's wheel of {wheel_diameter_m} m")
        }
        ObstacleRule::TallerThanM(height_m) => format!("an obstacle stands taller than {height_m} m"),
        ObstacleRule::All => "every object is an obstacle".into(),
    }
}

fn counted(count: i32, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
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
        Some(obstacle) => format!("{name} {object} ({:.2} m tall)", obstacle.body().protrusion_m),
        None if object >= 0 => format!("{name} {object}"),
        None => name.to_string(),
    }
}

/// Sets the replayed row beside the stored one.
pub(super) fn compare_stored(
    folder: &Path,
    scene: u64,
    family: &Family,
    scan: &ScanOutput,
    cell: CellIndex,
) -> Result<(), Failure> {
    let corpus = place::finished(folder)?;
    let stored = corpus::stored_cell(&corpus, scene, scan.scan_id, cell).map_err(corpus_failure)?;
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
        outln!("  differs: the stored label is {}", label_words(stored.label));
    }
    if differences == 0 {
        outln!("\nthe stored row is the same, bit for bit");
        return Ok(());
    }
    Err(Failure::failed(format!("{differences} values differ from the stored row")))
}
