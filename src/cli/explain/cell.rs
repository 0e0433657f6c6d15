//! One cell of a replayed scan: its points, the arithmetic of each feature and of the label; against the stored row.

use std::path::Path;

use crate::cells::params::{LabelParams, ObstacleRule};
use crate::cells::{
    CellAssigner, CellRow, Crossing, FeatureColumn, HEIGHT_VARIANCE, Label, MEAN_HEIGHT, Offset, feature_columns,
    is_neighbour, neighbour_offsets,
};
use crate::cli::Failure;
use crate::cli::output::outln;
use crate::cli::place::{self, corpus_failure};
use crate::cli::progress::counted;
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
    class: Option<Class>,
    top: bool,
}

fn points_in(points: &ScanPoints, cell: CellIndex) -> Vec<Point> {
    let assigner = CellAssigner::of_sensor(points.grid, points.max_range_m, points.map_from_sensor);
    let sweep = &points.sweep;
    let hits = (0..sweep.returns.status.len()).filter(|&slot| sweep.returns.status[slot] == Status::Hit);
    hits.filter(|&slot| !points.hangs(slot))
        .filter_map(|slot| {
            let placed = assigner.place(sweep.returns.pattern.directions[slot], sweep.returns.range_m[slot]);
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

pub(super) fn tell(family: &Family, replay: &Replay, scan: &ScanOutput, cell: CellIndex) -> Result<(), Failure> {
    let Some(at) = scan.cells.rows.iter().position(|row| row.index == cell) else {
        return Err(Failure::failed(format!(
            "cell {},{} of scan {} is empty: it holds no point within range",
            cell.row, cell.col, scan.scan_id
        )));
    };
    let row = &scan.cells.rows[at];
    let columns = feature_columns(&family.cells, family.sweep.effects.intensity.is_some());
    let features = &scan.cells.features[at * columns.len()..][..columns.len()];
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
    let inside = points_in(points, cell);
    let rover_z_m = points.rover_z_m;
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
    let moments = if row.points == 0 {
        outln!("  none: beams passed over it");
        Ok(())
    } else if carried > 0 {
        outln!("  and {carried} points of earlier sweeps of the window");
        Ok(())
    } else {
        let heights_m: Vec<f64> = inside.iter().map(|p| p.map_m.z - rover_z_m).collect();
        tell_moments(&heights_m, &columns, features)
    };
    outln!("\nfeatures (as stored, f32)");
    let offsets = neighbour_offsets(family.cells.neighbours);
    let mut neighbours = offsets.iter();
    let width = columns.iter().map(|column| column.name.len()).max().unwrap_or(0).max(24);
    for (column, value) in columns.iter().zip(features) {
        let source = match is_neighbour(&column.name).then(|| neighbours.next()).flatten() {
            Some(offset) => neighbour(scan, cell, *offset, columns.len()),
            None => column.description.clone(),
        };
        outln!("  {:<width$} {value:>14.6e} {:<3} {source}", column.name, column.unit);
    }
    tell_label(family, replay, row);
    moments
}

/// Equations 3 and 4 by the points that are listed, against the row's own features.
fn tell_moments(heights_m: &[f64], columns: &[FeatureColumn], features: &[f32]) -> Result<(), Failure> {
    let count = heights_m.len() as f64;
    let mean_m = heights_m.iter().sum::<f64>() / count;
    let variance_m2 = heights_m.iter().map(|h| (h - mean_m) * (h - mean_m)).sum::<f64>() / count;
    outln!(
        "\n  mean = sum / {count} = {mean_m:.6} m (eq. 3);  variance = sum of squares / {count} = {variance_m2:.3e} m2 (eq. 4)"
    );
    for (name, by_points) in [(MEAN_HEIGHT, mean_m as f32), (HEIGHT_VARIANCE, variance_m2 as f32)] {
        let at = columns.iter().position(|column| column.name == name).expect("every cell has it");
        if features[at].to_bits() != by_points.to_bits() {
            let row = features[at];
            return Err(Failure::failed(format!("{name} is {by_points:e} by these points, and {row:e} in the row")));
        }
    }
    outln!("  both are those of the row below, bit for bit");
    Ok(())
}

/// Where a neighbour's height comes from.
fn neighbour(scan: &ScanOutput, cell: CellIndex, offset: Offset, width: usize) -> String {
    let index = CellIndex { row: cell.row + offset.rows, col: cell.col + offset.cols };
    match scan.cells.rows.iter().position(|row| row.index == index && row.points > 0) {
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
        "  named object: {} standing {:.3} m above the ground",
        object_name(&replay.scene, truth.object, truth.class),
        truth.protrusion_m
    );
    let wheel_diameter_m = family.drive.rover.wheel_diameter_m;
    outln!("  rule: {}", obstacle_rule(rule.obstacle, wheel_diameter_m));
    let (found, wanted) = (truth.obstacle_points, rule.min_obstacle_points);
    let of_counted = rule.of_counted();
    outln!(
        "  obstacle points: {found} of {} (on tops: {}); {wanted} make a cell untraversable: {}",
        row.points,
        truth.top_points,
        if of_counted.has_obstacle_points(truth) { "met" } else { "not met" }
    );
    if let Some(limit_deg) = rule.max_ground_slope_deg {
        let slope_deg = f64::from(truth.slope_rad).to_degrees();
        let word = if of_counted.is_steep(truth) { "steeper" } else { "not steeper" };
        outln!("  ground slope: {slope_deg:.2} degrees, {word} than the limit of {limit_deg}");
    }
    if let (Some(rover), Some(crossing)) = (&rule.rover, truth.crossing) {
        outln!("  the label is the rover's: it can cross {}", rover.words());
        outln!("  nearest limit: {}, {:.3} m {}", crossing.limit.name(), crossing.margin_m.abs(), side_words(crossing));
    }
    if let Some(pose) = truth.pose {
        let headings: Vec<String> =
            (0..8).filter(|k| pose.headings >> k & 1 == 1).map(|k| (45 * k).to_string()).collect();
        let headings = if headings.is_empty() { "none".to_owned() } else { headings.join(", ") };
        outln!("  it can stand in the cell's middle, looking along, degrees: {headings}; cost {:.3}", pose.cost);
    }
    if let Some(limit_m) = rule.max_drop_m {
        let word = if of_counted.is_deep(truth) { "deeper" } else { "not deeper" };
        outln!("  drop: {:.3} m, {word} than the limit of {limit_m}", truth.drop_m);
    }
    outln!("  label: {}", label_words(row.label));
}

fn side_words(crossing: Crossing) -> &'static str {
    if crossing.margin_m < 0.0 { "beyond it" } else { "within it" }
}

fn label_words(label: Option<Label>) -> String {
    label.map_or("unknown".into(), |label| format!("{}, {}", label.number(), label.name()))
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

fn object_name(scene: &Scene, object: i32, class: Option<Class>) -> String {
    let name = class.map_or("nothing", Class::name);
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
    let mut differences = fixed_differences(&stored.row, &scan.cells.rows[at]);
    for ((column, there), here) in columns.iter().zip(&stored.features).zip(replayed) {
        if !is_same(*there, *here) {
            differences.push(format!("{} is stored as {there:e}, replayed as {here:e}", column.name));
        }
    }
    if differences.is_empty() {
        outln!("\nthe stored row is the same, bit for bit");
        return Ok(());
    }
    differences.iter().for_each(|difference| outln!("  differs: {difference}"));
    Err(Failure::failed(format!("{} values differ from the stored row", differences.len())))
}

/// Whether a stored number is the replayed one: bit for bit, but for the sign of zero and the bits of NaN, which are one on disk.
fn is_same(stored: f32, replayed: f32) -> bool {
    stored == replayed || (stored.is_nan() && replayed.is_nan())
}

/// Where two rows of a cell differ in what is no feature.
fn fixed_differences(stored: &CellRow, replayed: &CellRow) -> Vec<String> {
    let mut differences = Vec::new();
    if stored.label != replayed.label {
        differences.push(format!("the stored label is {}", label_words(stored.label)));
    }
    let whole = |row: &CellRow| (row.points, row.neighbour_mask);
    if whole(stored) != whole(replayed) {
        let ((points, mask), (points_here, mask_here)) = (whole(stored), whole(replayed));
        differences.push(format!(
            "{points} points and neighbour mask {mask:#b} are stored, {points_here} and {mask_here:#b} replayed"
        ));
    }
    if !is_same(stored.range_m, replayed.range_m) {
        differences.push(format!("range_m is stored as {:e}, replayed as {:e}", stored.range_m, replayed.range_m));
    }
    if stored.truth != replayed.truth {
        differences.push(format!("the truth is stored as {:?}, replayed as {:?}", stored.truth, replayed.truth));
    }
    differences
}
