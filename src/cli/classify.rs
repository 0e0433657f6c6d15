//! Judges real scans with a trained model, and writes what other tools read.

mod args;
mod load;
mod report;
mod write;

pub(super) use args::ClassifyArgs;

use std::collections::VecDeque;

use super::Failure;
use super::evaluate::read_model;
use super::output::errln;
use super::place::{corpus_failure, must_be_local};
use crate::cells::{self, Cells, WindowCloud, feature_columns};
use crate::evaluate::{Cell, Judge, Threshold, ThresholdOrigin};
use crate::train::Model;
use load::{Loaded, Setup};

/// The cells of one scan and what the model said of them.
struct Scan {
    /// The cloud's name without its ending, fit for file names.
    stem: String,
    cells: Cells,
    /// Of each cell's points, those with a verdict.
    known_points: Vec<i32>,
    /// The model's inputs, cell by cell.
    inputs: Vec<f32>,
    outputs: Vec<Option<f64>>,
    classes: Vec<Option<usize>>,
}

pub(super) fn run(args: &ClassifyArgs) -> Result<(), Failure> {
    must_be_local("--out", &args.out)?;
    let model = read_model(&args.model)?;
    let setup = Setup::of(args, &model)?;
    let mut window: VecDeque<Loaded> = VecDeque::new();
    let mut scratch = cells::Scratch::default();
    let mut scans = Vec::new();
    let mut written = Vec::new();
    let thresholds =
        model.about.thresholds.iter().map(|&value| Threshold { value, origin: ThresholdOrigin::Model }).collect();
    let mut judge = Judge::new(thresholds, None);
    let mut outputs = write::open(args, &setup)?;
    report::assumed(args, &model, &setup);
    for (number, path) in args.clouds.iter().enumerate() {
        if window.len() == setup.window {
            window.pop_front();
        }
        window.push_back(setup.load(args, &model, number, path)?);
        let scan = classify(&model, &setup, &window, args.min_points, &mut scratch);
        let newest = window.back().expect("pushed above");
        report::nowhere(&setup, newest, &scan);
        report::scan(args, &model, newest, &scan);
        written.extend(write::files(args, &mut outputs, write::scan(args, &model, &setup, newest, &scan)?)?);
        if setup.labels.is_some() {
            let (judged, outputs) = judged_cells(&model, &setup, &scan);
            judge.unknown_cells += (scan.cells.rows.len() - judged.len()) as u64;
            judge.add_scan("", "", &judged, &outputs);
        }
        scans.push(scan);
    }
    written.extend(write::files(args, &mut outputs, vec![write::cells(&setup, &scans)?])?);
    report::ranges(args, &model, &scans);
    if setup.labels.is_some() {
        let evaluation = report::evaluation(args, &model, &setup, &judge, scans.len());
        written.extend(write::files(args, &mut outputs, vec![evaluation])?);
    }
    outputs.finish().map_err(corpus_failure)?;
    written.iter().for_each(|path| errln!("{}", path.display()));
    Ok(())
}

/// Bins the window and asks the model about each cell that has points enough.
fn classify(
    model: &Model,
    setup: &Setup,
    window: &VecDeque<Loaded>,
    min_points: u32,
    scratch: &mut cells::Scratch,
) -> Scan {
    let clouds: Vec<WindowCloud> = window.iter().map(|loaded| loaded.as_cloud(setup)).collect();
    let (cells, known_points) = cells::bin_clouds(&model.about.cells, &clouds, setup.max_range_m, scratch);
    let width = setup.features.len();
    let inputs: Vec<f32> =
        cells.features.chunks_exact(width).flat_map(|row| setup.inputs.iter().map(|&k| row[k])).collect();
    let mut outputs = Vec::with_capacity(cells.rows.len());
    model.outputs(&inputs, &mut outputs);
    let judged = |(output, row): (f64, &cells::CellRow)| {
        (i64::from(row.points) >= i64::from(min_points) && output.is_finite()).then_some(output)
    };
    let outputs: Vec<Option<f64>> = outputs.into_iter().zip(&cells.rows).map(judged).collect();
    let classes = outputs.iter().map(|output| output.map(|output| model.class(output))).collect();
    let stem = window.back().map_or(String::new(), |loaded| loaded.stem.clone());
    Scan { stem, cells, known_points, inputs, outputs, classes }
}

/// The cells that have a label and a judgement, as the judge takes them.
fn judged_cells(model: &Model, setup: &Setup, scan: &Scan) -> (Vec<Cell>, Vec<f64>) {
    let width = setup.features.len();
    let place =
        feature_columns(&model.about.cells, setup.intensity).iter().position(|c| c.name == "height_difference_m");
    let all = scan.cells.rows.iter().enumerate().filter_map(|(i, row)| {
        let cell = Cell {
            row: row.index.row,
            col: row.index.col,
            untraversable: row.label? == 1,
            class: None,
            points: scan.known_points[i],
            obstacle_points: row.truth.obstacle_points,
            top_points: 0,
            range_m: row.range_m,
            height_difference_m: place.map_or(0.0, |k| scan.cells.features[i * width + k]),
        };
        Some((cell, scan.outputs[i]?))
    });
    all.unzip()
}
