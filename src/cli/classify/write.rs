//! Judged scans -> files.

use std::path::PathBuf;

use super::args::ClassifyArgs;
use super::failure;
use crate::cli::Failure;
use crate::cli::evaluate::model_file;
use crate::cli::place::corpus_failure;
use crate::corpus::Outputs;
use crate::evaluate::Report;
use crate::geometry::DVec2;
use crate::judge::{JudgedCells, JudgedScan, ScanJudge, Shown};
use crate::picture::{ShadedCell, Shades, cell_map};

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
pub(super) fn open(args: &ClassifyArgs, stems: &[String]) -> Result<Outputs, Failure> {
    let of_scan = |stem: &String| OF_SCAN.map(|end| format!("{stem}-{end}"));
    let mut names: Vec<String> = stems.iter().flat_map(of_scan).collect();
    names.extend([CELLS.into(), Report::FILE.into()]);
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
pub(super) fn scan(args: &ClassifyArgs, stem: &str, judged: &JudgedScan) -> Result<Vec<(String, Vec<u8>)>, Failure> {
    let points = judged.labelled_points();
    let mut files = vec![
        (format!("{stem}-labelled.ply"), judged.ply(&points)),
        (format!("{stem}-labelled.pcd"), judged.pcd(&points)),
        (format!("{stem}-mesh.ply"), judged.mesh()),
    ];
    for (name, shown) in [("cost", Shown::Output), ("class", Shown::Class)] {
        let image = format!("{stem}-{name}.pgm");
        let map = judged.cost_map(&image, shown).map_err(failure)?;
        files.push((image, map.pgm));
        files.push((format!("{stem}-{name}.yaml"), map.yaml.into_bytes()));
    }
    if !args.no_pictures {
        files.extend(pictures(stem, &judged.cells, judged.scan.pose.map_from_sensor.translation_m.truncate()));
    }
    Ok(files)
}

fn pictures(stem: &str, judged: &JudgedCells, sensor_m: DVec2) -> Vec<(String, Vec<u8>)> {
    let (rows, names) = (&judged.cells.rows, judged.class_names());
    let shaded = |shade: &dyn Fn(usize) -> Option<f64>| -> Vec<ShadedCell> {
        rows.iter().enumerate().map(|(i, row)| ShadedCell { index: row.index, shade: shade(i) }).collect()
    };
    let most = rows.iter().map(|row| row.points).max().unwrap_or(1);
    let log = |points: i32| crate::math::ln(f64::from(points.max(1)));
    let density = |i: usize| Some(log(rows[i].points) / log(most.max(2)));
    [
        ("binary", shaded(&|i| judged.class_shade(i)), Shades::Classes(&names)),
        ("direct", shaded(&|i| judged.shade(i)), Shades::Output(judged.targets)),
        ("density", shaded(&density), Shades::Density(most)),
    ]
    .into_iter()
    .map(|(name, cells, shades)| {
        let png = cell_map(&format!("{stem}: {name}"), judged.grid, &cells, sensor_m, shades);
        (format!("{stem}-{name}.png"), png)
    })
    .collect()
}

/// The cells of all scans as one Parquet file.
pub(super) fn cells(judge: &ScanJudge, scans: &[JudgedCells]) -> Result<(String, Vec<u8>), Failure> {
    Ok((CELLS.into(), judge.parquet(CELLS, scans).map_err(failure)?))
}

pub(super) fn evaluation(report: &Report) -> (String, Vec<u8>) {
    (Report::FILE.into(), report.to_json().into_bytes())
}
