//! A model and scans, in the order they were taken -> their cells, outputs and classes; and, where the clouds carry labels, how good
//! the model is.

use std::collections::VecDeque;
use std::sync::Arc;

use super::options::{Options, Setup};
use super::scan::{JudgedScan, PlacedScan, check_position};
use super::training_range::{self, Outside};
use super::{JudgeError, JudgedCells};
use crate::cells::params::OverhangParams;
use crate::cells::{self, CellParams, CellRow, FeatureColumn, HEIGHT_DIFFERENCE, WindowCloud, feature_columns};
use crate::cloud::{Cloud, LabelMap};
use crate::corpus::cell_file;
use crate::evaluate::{DataFacts, Judge, Report, Threshold, ThresholdOrigin};
use crate::geometry::{GridSpec, Pose};
use crate::train::operating_point::class;
use crate::train::{Model, OperatingPoint};

/// Judges scans one after another; the newest ones are its window.
#[derive(Clone, Debug)]
pub struct ScanJudge<'m> {
    model: &'m Model,
    setup: Setup,
    labels: Option<LabelMap>,
    /// Rising borders between classes of the output.
    thresholds: Vec<f64>,
    /// The model takes intensities.
    intensity: bool,
    /// The columns that are computed, and where among them the model's inputs stand.
    features: Vec<FeatureColumn>,
    inputs: Vec<usize>,
    /// The model's, without what it does not take.
    cells: CellParams,
    window: VecDeque<Arc<PlacedScan>>,
    scratch: cells::Scratch,
    scores: Judge,
    /// Labelled cells that had too few points to be judged.
    sparse_cells: u64,
    scans: u64,
}

impl<'m> ScanJudge<'m> {
    /// Refuses a model that takes what no cloud has, and options that no scan can be judged by.
    pub fn new(model: &'m Model, options: Options) -> Result<ScanJudge<'m>, JudgeError> {
        let about = &model.about;
        let intensity = about.features.iter().any(|name| is_intensity(name));
        let unseen = about.cells.unseen.clone().filter(|_| model.takes_unseen());
        let setup = Setup::of(&options, about)?;
        let overhang = setup.overhang_m.map(|above_m| OverhangParams { above_m: Some(above_m) });
        let cells = CellParams { unseen, overhang, ..about.cells.clone() };
        let features = feature_columns(&cells, intensity);
        let names: Vec<&str> = features.iter().map(|column| column.name.as_str()).collect();
        let inputs = model.inputs_of(&names)?;
        let thresholds = model.thresholds(&options.point)?;
        let of_model = options.point == OperatingPoint::Model;
        let origin = if of_model { ThresholdOrigin::Model } else { ThresholdOrigin::Given };
        let scored = thresholds.iter().map(|&value| Threshold { value, origin }).collect();
        let scores = Judge::new(scored, None).with_probabilities(model, &options.point);
        Ok(ScanJudge {
            model,
            setup,
            labels: options.labels,
            thresholds,
            intensity,
            features,
            inputs,
            cells,
            window: VecDeque::new(),
            scratch: cells::Scratch::default(),
            scores,
            sparse_cells: 0,
            scans: 0,
        })
    }

    pub(crate) fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Rising borders between classes of the output.
    pub(crate) fn thresholds(&self) -> &[f64] {
        &self.thresholds
    }

    /// Refuses what no scan could be judged by, before the first one is.
    pub(crate) fn check_pose(&self, pose: &Pose) -> Result<(), JudgeError> {
        check_position(pose).map(drop)
    }

    /// Judges one scan, with the points of those before it that are in its window. `name`: its file's, for messages; `pose`: as
    /// [`PoseSource`](super::PoseSource) says. A scan that is refused leaves the judge as it was.
    pub fn scan(&mut self, name: &str, cloud: Cloud, pose: Option<&Pose>) -> Result<JudgedScan, JudgeError> {
        let scan = Arc::new(self.place(name, cloud, pose)?);
        if self.window.len() == self.setup.window {
            self.window.pop_front();
        }
        self.window.push_back(Arc::clone(&scan));
        let cells = self.judge_window(&scan);
        if self.labels.is_some() {
            self.add_scores(&cells);
        }
        self.scans += 1;
        Ok(JudgedScan { scan, cells, setup: self.setup })
    }

    fn place(&self, name: &str, cloud: Cloud, pose: Option<&Pose>) -> Result<PlacedScan, JudgeError> {
        if self.intensity && cloud.intensity.is_none() {
            let features = self.model.about.features.iter().filter(|name| is_intensity(name)).cloned().collect();
            return Err(JudgeError::NoIntensities { scan: name.into(), features });
        }
        if self.labels.is_some() && cloud.labels.is_none() {
            return Err(JudgeError::NoLabels { scan: name.into() });
        }
        let mut scan = PlacedScan::of(name, cloud, pose, &self.setup)?;
        if let (Some(map), Some(labels)) = (&self.labels, &scan.cloud.labels) {
            scan.verdicts = Some(map.verdicts(name, labels)?);
        }
        Ok(scan)
    }

    /// Bins the window and asks the model about each cell that has points enough.
    fn judge_window(&mut self, newest: &PlacedScan) -> JudgedCells {
        let (model, setup) = (self.model, &self.setup);
        let clouds: Vec<WindowCloud> =
            self.window.iter().map(|scan| scan.as_cloud(setup.frame, self.intensity)).collect();
        let (cells, known_points) = cells::bin_clouds(&self.cells, &clouds, setup.max_range_m, &mut self.scratch);
        let rows = cells.features.chunks_exact(self.features.len());
        let inputs: Vec<f32> = rows.flat_map(|row| self.inputs.iter().map(|&k| row[k])).collect();
        let judged =
            |(output, row): (f64, &CellRow)| (setup.has_points_enough(row) && output.is_finite()).then_some(output);
        let outputs: Vec<Option<f64>> = model.outputs(&inputs).into_iter().zip(&cells.rows).map(judged).collect();
        JudgedCells {
            scan: newest.name.clone(),
            known_points,
            inputs,
            classes: outputs.iter().map(|output| output.map(|output| class(&self.thresholds, output))).collect(),
            probabilities: outputs.iter().map(|output| model.probability((*output)?)).collect(),
            outputs,
            of_classes: self.thresholds.len() + 1,
            targets: model.about.targets,
            grid: GridSpec { size_m: model.about.cells.size_m },
            rover_z_m: newest.pose.estimate.pose.position_m.z,
            cells,
        }
    }

    fn add_scores(&mut self, judged: &JudgedCells) {
        let height_difference = self.features.iter().position(|column| column.name == HEIGHT_DIFFERENCE);
        let (cells, outputs) = judged.scored(height_difference);
        let unlabelled = judged.cells.rows.iter().filter(|row| row.label.is_none()).count();
        let without_output = judged.cells.rows.len() - unlabelled - cells.len();
        let is_sparse = |row: &&CellRow| row.label.is_some() && !self.setup.has_points_enough(row);
        let sparse = judged.cells.rows.iter().filter(is_sparse).count();
        self.scores.unknown_cells += unlabelled as u64;
        self.scores.not_finite_cells += (without_output - sparse) as u64;
        self.sparse_cells += sparse as u64;
        self.scores.add_scan("", "", &cells, &outputs);
    }

    /// How much of some judged scans the model never saw the like of, one entry a feature.
    pub(crate) fn outside_training(&self, scans: &[JudgedCells]) -> Vec<Outside> {
        let rows: Vec<f32> = scans.iter().flat_map(|scan| scan.inputs.iter().copied()).collect();
        training_range::outside(&self.model.about.features, &self.model.about.quantiles, &rows)
    }

    /// The cells of judged scans as a Parquet file with the columns of a corpus's `cells`. `name`: the file's, for messages.
    pub fn parquet(&self, name: &str, scans: &[JudgedCells]) -> Result<Vec<u8>, JudgeError> {
        let rows = scans.iter().enumerate().map(|(number, scan)| cell_file::CellOutputs {
            scan_id: number as u32,
            cells: &scan.cells,
            outputs: &scan.outputs,
            probabilities: &scan.probabilities,
            classes: &scan.classes,
        });
        let scans: Vec<cell_file::CellOutputs> = rows.collect();
        Ok(cell_file::judged_cells(name, &self.features, &scans)?)
    }

    /// How good the model is by the labels of all scans so far; `None` without a mapping of labels. `clouds` and `mapping`: what the
    /// report calls them.
    pub(crate) fn report(&self, clouds: String, mapping: &str) -> Option<Report> {
        self.labels.as_ref()?;
        let data = DataFacts {
            name: clouds,
            labels: format!(
                "the clouds' own labels by {mapping}: a cell with at least {} untraversable points is untraversable",
                self.model.about.cells.labels.min_obstacle_points
            ),
            scans: self.scans,
            ..DataFacts::default()
        };
        let mut notes = vec!["points whose label is ignored count in the features and nowhere else".to_string()];
        let Setup { window, min_points, pose_source, overhang_m, .. } = self.setup;
        notes.extend(self.model.other_frame(pose_source.cell_frame()));
        notes.extend(self.model.other_overhang(overhang_m));
        if window > 1 {
            notes.push(format!("windows of {window} scans overlap: their points are counted once a window"));
        }
        if min_points > 1 {
            let sparse = self.sparse_cells;
            notes.push(format!(
                "labelled cells of fewer than {min_points} points were not judged and are left out: {sparse}"
            ));
        }
        Some(Report::new(self.model, &self.scores, data, notes))
    }
}

fn is_intensity(feature: &str) -> bool {
    feature.starts_with("intensity")
}
