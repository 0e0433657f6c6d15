//! Replays one scene and says what was drawn and computed; for a cell, the arithmetic of its features and label.

mod cell;

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use super::options::{check_scene, plan_of};
use super::output::outln;
use super::place;
use crate::corpus::Split;
use crate::corpus::stats::PointCounts;
use crate::episode::ScanOutput;
use crate::episode::{Prepared, Replay, Scratch, StageHashes, replay_scene};
use crate::geometry::CellIndex;
use crate::plan::{Family, Plan};
use crate::random::Drawn;

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

pub(super) fn run(args: &ExplainArgs) -> Result<(), Failure> {
    let (plan, corpus) = plan_of(&args.place, &args.sets)?;
    corpus.map_or(Ok(()), place::check_if_finished)?;
    check_scene(&plan, args.scene)?;
    let prepared = Prepared::new(plan).map_err(Failure::failed)?.keeping_points();
    let mut hashes = StageHashes::new();
    let replay = replay_scene(&prepared, args.scene, &mut Scratch::default(), &mut hashes).map_err(|failed| {
        outln!("drawn values");
        tell_drawn(&failed.drawn);
        Failure::failed(format!("scene {} failed: {}", args.scene, failed.reason))
    })?;
    let family = &prepared.plan.families[replay.family];
    match args.cell {
        None => {
            tell_scene(&prepared.plan, args.scene, family, &replay, &hashes);
            Ok(())
        }
        Some(cell) => {
            let scan = pick_scan(&replay, args.scan)?;
            cell::tell(family, &replay, scan, cell)?;
            if corpus.is_some() && !args.sets.is_empty() {
                outln!("\nnot compared with the stored row: --set makes another plan than the corpus's");
                return Ok(());
            }
            corpus.map_or(Ok(()), |folder| cell::compare_stored(folder, args.scene, family, scan, cell))
        }
    }
}

fn tell_drawn(drawn: &Drawn) {
    for (purpose, value) in drawn.iter() {
        outln!("  {:<58} {value}", purpose.key());
    }
}

fn tell_scene(plan: &Plan, scene: u64, family: &Family, replay: &Replay, hashes: &StageHashes) {
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
        let bad = cells.rows.iter().filter(|row| row.untraversable()).count();
        outln!(
            "  scan {}: {} cells, {bad} untraversable; points in {} = binned {} + beyond range {} + off grid {}{}",
            scan.scan_id,
            cells.rows.len(),
            cells.points_in,
            cells.points_binned,
            cells.dropped_beyond_range,
            cells.dropped_off_grid,
            PointCounts::of(cells).words_left_out()
        );
    }
    if let Some(row) = replay.scans.last().and_then(|s| s.cells.rows.iter().find(|r| r.untraversable())) {
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
