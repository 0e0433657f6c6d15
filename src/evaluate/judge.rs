//! Scans with outputs -> everything that a report is made of, cell by cell, in bounded memory.
//!
//! Three weighings: by *cells*; by *points*, each with its cell's label, as table 1 of Hewitt et al. 2017 is read (see
//! [`Table1`](super::Table1)); and by points with their *own* truth, a cell's obstacle points being untraversable and its other points
//! traversable. A call is always the cell's. `without_tops` leaves out the points that lie on an obstacle's flat top ("Outdoor
//! tests": most of the paper's error), and the cells whose obstacle points all do.

use std::collections::BTreeMap;

use super::by_scene::ByScene;
use super::cell::Cell;
use super::confusion::Confusion;
use super::places::Places;
use super::reliability::{Doubt, Reliability};
use super::spread::Spread;
use super::tally::{Panel, Tally};
use super::threshold::{Group, Threshold};
use super::tops::MissedTops;
use crate::geometry::{CellIndex, DVec2};
use crate::scene::Class;
use crate::train::{Calibration, Model, OperatingPoint};

/// Gathers scans.
#[derive(Clone, Debug)]
pub struct Judge {
    pub(super) thresholds: Vec<Threshold>,
    pub(super) height_threshold: Option<Threshold>,
    pub(super) groups: BTreeMap<Group, Tally>,
    /// What the model says that outputs mean, with its targets.
    meaning: Option<(Calibration, [f64; 2])>,
    /// Of all cells.
    pub(super) doubt: Option<Doubt>,
    /// Whose scans are added; `None` where scans are of no scene.
    scene: Option<i64>,
    /// One a threshold.
    pub(super) by_scene: Vec<ByScene>,
    /// At the first threshold.
    pub(super) by_points: Spread,
    pub(super) by_range: Spread,
    pub(super) by_place: Places,
    /// Cells by true class, at the first threshold.
    pub(super) by_class: BTreeMap<Class, Confusion>,
    /// One a threshold.
    pub(super) tops: Vec<MissedTops>,
    /// Cells that could not be judged: their label is unknown, or a feature is not finite.
    pub unknown_cells: u64,
    pub not_finite_cells: u64,
}

/// Height differences are told apart up to this; 0.06 mm a bin.
const HEIGHT_REACH_M: f64 = 4.0;

/// Cells of so few points are where most errors are; the rest is judged apart.
const WELL_SEEN_POINTS: u32 = 3;

impl Judge {
    /// With at least one threshold of the output; the first is the one for densities.
    pub fn new(thresholds: Vec<Threshold>, height_threshold: Option<Threshold>) -> Judge {
        let tops = vec![MissedTops::default(); thresholds.len()];
        let by_scene = vec![ByScene::default(); thresholds.len()];
        Judge {
            thresholds,
            height_threshold,
            groups: BTreeMap::new(),
            meaning: None,
            doubt: None,
            scene: None,
            by_scene,
            by_points: Spread::default(),
            by_range: Spread::default(),
            by_place: Places::default(),
            by_class: BTreeMap::new(),
            tops,
            unknown_cells: 0,
            not_finite_cells: 0,
        }
    }

    /// That judges the probabilities of a model too, and what its operating point leaves in doubt.
    pub(crate) fn with_probabilities(mut self, model: &Model, asked: &OperatingPoint) -> Judge {
        self.meaning = model.about.calibration.clone().map(|calibration| (calibration, model.about.targets));
        self.doubt = Doubt::of(model, asked);
        self
    }

    /// The scans that follow are of this scene: what is alike within it is drawn once.
    pub(super) fn begin_scene(&mut self, scene: i64) {
        self.scene = Some(scene);
    }

    /// Adds one scan: its cells and the output for each. Empty names of family and sensor make no group. A cell whose output is
    /// NaN is counted and left out.
    pub fn add_scan(&mut self, family: &str, sensor: &str, cells: &[Cell], outputs: &[f64]) {
        if outputs.iter().any(|output| output.is_nan()) {
            let finite = cells.iter().copied().zip(outputs.iter().copied()).filter(|(_, output)| !output.is_nan());
            let (cells_left, outputs_left): (Vec<Cell>, Vec<f64>) = finite.unzip();
            self.not_finite_cells += (cells.len() - cells_left.len()) as u64;
            return self.add_scan(family, sensor, &cells_left, &outputs_left);
        }
        let mut groups = vec![(Group::All, 0), (Group::Points(WELL_SEEN_POINTS), WELL_SEEN_POINTS as i32)];
        groups.extend((!family.is_empty()).then(|| (Group::Family(family.into()), 0)));
        groups.extend((!sensor.is_empty()).then(|| (Group::Sensor(sensor.into()), 0)));
        for (group, least_points) in groups {
            let (outputs_at, heights_at) = (&self.thresholds, self.height_threshold.as_slice());
            let tally = self.groups.entry(group).or_insert_with(|| Tally {
                cells: 0,
                points: 0,
                network: Panel::new(1.0, outputs_at.len()),
                height: Panel::new(HEIGHT_REACH_M, heights_at.len()),
                reliability: Reliability::default(),
            });
            for (cell, &output) in cells.iter().zip(outputs).filter(|(cell, _)| cell.points >= least_points) {
                tally.cells += 1;
                tally.points += cell.points.max(0) as u64;
                tally.network.add(cell, output, outputs_at);
                tally.height.add(cell, f64::from(cell.height_difference_m), heights_at);
                if let Some((calibration, targets)) = &self.meaning {
                    tally.reliability.add(cell.untraversable(), calibration.probability(output, *targets));
                }
            }
        }
        if let Some(doubt) = &mut self.doubt {
            cells.iter().zip(outputs).for_each(|(cell, &output)| doubt.add(cell.untraversable(), output));
        }
        if let Some(first) = self.thresholds.first() {
            for (cell, &output) in cells.iter().zip(outputs) {
                let called = output >= first.value;
                self.by_points.add(cell.points.max(0) as u32, cell.untraversable(), called);
                let range_cm = (cell.range_m * CM_PER_M).round().clamp(0.0, LARGEST_CM);
                self.by_range.add(range_cm as u32, cell.untraversable(), called);
                if let Some(class) = cell.truth.class {
                    self.by_class.entry(class).or_default().add(cell.untraversable(), called, 1);
                }
            }
        }
        for (by_scene, threshold) in self.by_scene.iter_mut().zip(&self.thresholds) {
            let mut counts = Confusion::default();
            cells
                .iter()
                .zip(outputs)
                .for_each(|(cell, &output)| counts.add(cell.untraversable(), output >= threshold.value, 1));
            by_scene.add(self.scene, counts);
        }
        for (tops, threshold) in self.tops.iter_mut().zip(&self.thresholds) {
            tops.add_scan(cells, |k| outputs[k] >= threshold.value);
        }
    }

    /// Adds the places of a scan's cells, metres ahead of the rover and to its left, at the first threshold; cells whose output is NaN have
    /// none.
    pub(super) fn add_places(&mut self, cells: &[Cell], outputs: &[f64], place_m: impl Fn(CellIndex) -> DVec2) {
        let Some(first) = self.thresholds.first() else { return };
        for (cell, &output) in cells.iter().zip(outputs).filter(|(_, output)| !output.is_nan()) {
            self.by_place.add(place_m(cell.index), cell.points, cell.untraversable(), output >= first.value);
        }
    }

    /// The best thresholds of the output and of the height difference for the cells gathered so far, by balanced accuracy.
    ///
    /// ```
    /// use marsyard::cells::{CellTruth, Label};
    /// use marsyard::evaluate::{Cell, Judge};
    /// use marsyard::geometry::CellIndex;
    ///
    /// // Low outputs on traversable cells, high ones on the others, with a gap from 0.4 to 0.7.
    /// let outputs = [0.1, 0.2, 0.4, 0.7, 0.9];
    /// let (index, truth) = (CellIndex { row: 0, col: 0 }, CellTruth::default());
    /// let cell = |label| Cell { index, label, points: 5, range_m: 2.0, height_difference_m: 0.0, truth };
    /// use Label::{Traversable, Untraversable};
    /// let cells = [Traversable, Traversable, Traversable, Untraversable, Untraversable].map(cell);
    /// let mut judge = Judge::new(Vec::new(), None);
    /// judge.add_scan("", "", &cells, &outputs);
    /// let (of_output, _) = judge.best_thresholds().ok_or("a scan was added")?;
    /// assert!(of_output > 0.4 && of_output <= 0.7);
    /// # Ok::<(), &str>(())
    /// ```
    pub fn best_thresholds(&self) -> Option<(f64, f64)> {
        let all = self.groups.get(&Group::All)?;
        all.network.scores.best_threshold().zip(all.height.scores.best_threshold())
    }
}

/// Ranges are ranked to the centimetre.
pub(super) const CM_PER_M: f32 = 100.0;
const LARGEST_CM: f32 = 1e9;
