//! Judged scans -> files.

use std::path::PathBuf;

use super::Scan;
use super::args::ClassifyArgs;
use super::load::{Loaded, Setup};
use crate::cells::CellAssigner;
use crate::cli::Failure;
use crate::cli::evaluate::model_file;
use crate::cli::place::corpus_failure;
use crate::cloud::costmap::{Shown, cost_map};
use crate::cloud::export::{self, Judged};
use crate::corpus::Outputs;
use crate::corpus::cell_file::{self, JudgedScan};
use crate::geometry::GridSpec;
use crate::picture::{ShadedCell, Shades, cell_map};
use crate::train::Model;

/// Judges' reports, over all clouds.
pub(super) const EVALUATION: &str = "evaluation.json";
const CELLS: &str = "cells.parquet";
/// Behind a cloud's name.
const OF_SCAN: [&str; 10] = [
    "labelled.ply",
    "labelled.pcd",
    "mesh.ply",
    "cost.pgm",
    "cost.yaml",
    "class.pgm",
    "class.yaml",
    "binary.png",
    "direct.png",
    "density.png",
];

/// The folder for what is written; refused, before anything is, where it is another's or an input would be lost.
pub(super) fn open(args: &ClassifyArgs, setup: &Setup) -> Result<Outputs, Failure> {
    let of_scan = |stem: &String| OF_SCAN.map(|end| format!("{stem}-{end}"));
    let mut names: Vec<String> = setup.stems().iter().flat_map(of_scan).collect();
    names.extend([CELLS.into(), EVALUATION.into()]);
    let more = args.trajectory.iter().chain(&args.labels).chain(&args.clouds);
    let inputs = more.cloned().chain([model_file(&args.model)]).collect();
    Outputs::open(&args.out, names.iter().map(String::as_str), inputs).map_err(corpus_failure)
}

/// Writes files, and says where they are.
pub(super) fn files(
    args: &ClassifyArgs,
    outputs: &mut Outputs,
    files: Vec<(String, Vec<u8>)>,
) -> Result<Vec<PathBuf>, Failure> {
    outputs.write(&files).map_err(corpus_failure)?;
    Ok(files.iter().map(|(name, _)| args.out.join(name)).collect())
}

/// Clouds, mesh, pictures and cost maps of one scan.
pub(super) fn scan(
    args: &ClassifyArgs,
    model: &Model,
    setup: &Setup,
    loaded: &Loaded,
    scan: &Scan,
) -> Result<Vec<(String, Vec<u8>)>, Failure> {
    let grid = GridSpec { size_m: model.about.cells.size_m };
    let judged = Judged {
        cells: &scan.cells,
        outputs: &scan.outputs,
        classes: &scan.classes,
        of_classes: model.about.thresholds.len() + 1,
        targets: model.about.targets,
        grid,
        rover_z_m: loaded.place.estimate.pose.position_m.z,
    };
    let placer = CellAssigner::of_sensor(grid, setup.max_range_m, loaded.place.map_from_sensor);
    let points = export::labelled(&loaded.cloud, &placer, setup.in_map, &judged);
    let stem = &scan.stem;
    let mut files = vec![
        (format!("{stem}-labelled.ply"), export::ply(&points, &loaded.name)),
        (format!("{stem}-labelled.pcd"), export::pcd(&points)),
        (format!("{stem}-mesh.ply"), export::mesh(&judged, &loaded.name)),
    ];
    for (name, shown) in [("cost", Shown::Output), ("class", Shown::Class)] {
        let image = format!("{stem}-{name}.pgm");
        let map = cost_map(&judged, &image, shown).map_err(|e| Failure::failed(format!("{}: {e}", loaded.name)))?;
        files.push((image, map.pgm));
        files.push((format!("{stem}-{name}.yaml"), map.yaml.into_bytes()));
    }
    if !args.no_pictures {
        files.extend(pictures(stem, &judged, &placer_origin(loaded)));
    }
    Ok(files)
}

fn placer_origin(loaded: &Loaded) -> crate::geometry::DVec2 {
    loaded.place.map_from_sensor.translation_m.truncate()
}

fn pictures(stem: &str, judged: &Judged, sensor_m: &crate::geometry::DVec2) -> Vec<(String, Vec<u8>)> {
    let rows = &judged.cells.rows;
    let shaded = |shade: &dyn Fn(usize) -> Option<f64>| -> Vec<ShadedCell> {
        rows.iter().enumerate().map(|(i, row)| ShadedCell { index: row.index, shade: shade(i) }).collect()
    };
    let most = rows.iter().map(|row| row.points).max().unwrap_or(1);
    let log = |points: i32| crate::math::ln(f64::from(points.max(1)));
    let density = |i: usize| Some(log(rows[i].points) / log(most.max(2)));
    [
        ("binary", shaded(&|i| judged.class_shade(i)), Shades::Classes(judged.of_classes)),
        ("direct", shaded(&|i| judged.shade(i)), Shades::Output(judged.targets)),
        ("density", shaded(&density), Shades::Density(most)),
    ]
    .into_iter()
    .map(|(name, cells, shades)| {
        let png = cell_map(&format!("{stem}: {name}"), judged.grid, &cells, *sensor_m, shades);
        (format!("{stem}-{name}.png"), png)
    })
    .collect()
}

/// The cells of all scans as one Parquet file.
pub(super) fn cells(setup: &Setup, scans: &[Scan]) -> Result<(String, Vec<u8>), Failure> {
    let judged: Vec<JudgedScan> = scans
        .iter()
        .enumerate()
        .map(|(number, scan)| JudgedScan {
            scan_id: number as u32,
            cells: &scan.cells,
            outputs: &scan.outputs,
            classes: &scan.classes,
        })
        .collect();
    let bytes = cell_file::judged_cells(CELLS, &setup.features, &judged).map_err(Failure::failed)?;
    Ok((CELLS.into(), bytes))
}
