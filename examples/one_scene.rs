//! One scene to arrays: a yard of `configs/quickstart.yaml` is drawn, driven through and scanned, and its cells are shown from above.
//!
//! `cargo run --release --example one_scene [SCENE]`. Nothing is written: what a corpus would hold of the scene is in memory.

use std::error::Error;
use std::path::Path;

use marsyard::cells::{Label, feature_columns};
use marsyard::geometry::GridSpec;
use marsyard::{config, episode::Prepared, simulate_scene};

fn main() -> Result<(), Box<dyn Error>> {
    let scene_id = std::env::args().nth(1).map_or(Ok(3), |text| text.parse())?;
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.yaml");
    // Overrides are those of `--set`: cells of 0.2 m fit on a screen.
    let prepared = Prepared::new(config::load(&config, &["cells.size_m=0.2".into()])?)?;
    let scene = simulate_scene(&prepared, scene_id)?;
    println!(
        "scene {scene_id}: {} obstacles, {} steps, {} stops, {} kept scan",
        scene.scene.obstacles.len(),
        scene.drive.truth.len(),
        scene.drive.stops.len(),
        scene.scans.len()
    );
    let last = scene.poses.last().ok_or("a drive has a first step")?;
    let off_m = (last.estimate.pose.position_m - last.truth.position_m).length();
    println!(
        "slam is {:.1} cm off at the end, and believes {:.1} cm in x",
        100.0 * off_m,
        100.0 * last.estimate.sigmas()[0]
    );

    let cells = &scene.scans[0].cells;
    let columns = feature_columns(&prepared.plan.families[scene.family].cells, false);
    println!("{} cells of {} features, the first:", cells.rows.len(), columns.len());
    for (column, value) in columns.iter().zip(&cells.features) {
        println!("  {:22} {value:9.4} {}", column.name, column.unit);
    }

    // Cells lie where slam believes them to lie, and so the rover is drawn there too.
    println!("from above, north up: . traversable, # untraversable, R the rover, blank unseen");
    let grid = GridSpec { size_m: prepared.plan.families[scene.family].cells.size_m };
    let estimate_m = last.estimate.pose.position_m;
    let rover = grid.cell(estimate_m.x, estimate_m.y).ok_or("an estimate is in the yard")?;
    let rows = cells.rows.iter().map(|cell| cell.index.row);
    let (south, north) = (rows.clone().min().unwrap_or(0), rows.max().unwrap_or(0));
    let (west, east) =
        cells.rows.iter().fold((rover.col, rover.col), |(w, e), cell| (w.min(cell.index.col), e.max(cell.index.col)));
    for row in (south.min(rover.row)..=north.max(rover.row)).rev() {
        let line = (west..=east).map(|col| {
            // Cells are sorted by row and column.
            let found = cells.rows.binary_search_by_key(&(row, col), |cell| (cell.index.row, cell.index.col));
            match found.ok().and_then(|k| cells.rows[k].label) {
                _ if (row, col) == (rover.row, rover.col) => 'R',
                Some(Label::Traversable) => '.',
                Some(Label::Untraversable) => '#',
                None => ' ',
            }
        });
        println!("{}", line.collect::<String>().trim_end());
    }
    Ok(())
}
