//! Whether a model contradicts itself.
//!
//! In: a model, read from a file or about to be written. Out: the first fault that is found, in words; none where its sizes agree, its
//! numbers are of sane size and what must rise does. Beyond that no code asks again.

use garde::Validate;

use super::{Model, ModelError};
use crate::train::operating_point::MOST_THRESHOLDS;
use crate::train::{Activation, Calibration, Scaler};

/// The greatest weight, scale or mean that a file may hold: far beyond use, and no sum of such products overflows.
const SANE: f64 = 1e100;

/// The same of weights where neurons have no bounds, and the most hidden layers of such: nor does a product of them, layer by layer, of the widest network that a
/// file may hold.
const SANE_RECTIFIED: f64 = 1e20;
const MOST_RECTIFIED_LAYERS: usize = 8;

impl Model {
    /// Everything that the rest of the program relies on; [`Model::load`] and [`Model::save`] both ask.
    pub(super) fn check(&self) -> Result<(), ModelError> {
        let fault = self.fault();
        fault.map_or(Ok(()), |reason| Err(ModelError::Contradiction { reason }))
    }

    pub(super) fn fault(&self) -> Option<String> {
        let (about, layout) = (&self.about, &self.network.layout);
        let finite = |values: &[f64]| values.iter().all(|v| v.abs() <= SANE);
        let ascending = |values: &[f64]| values.windows(2).all(|pair| pair[0] <= pair[1]);
        let rising = |values: &[f64]| values.windows(2).all(|pair| pair[0] < pair[1]);
        let in_unit = |values: &[f64]| values.iter().all(|v| (0.0..=1.0).contains(v));
        let Scaler { minus, mean, scale, scores, .. } = &about.scaler;
        let features = about.features.len();
        let per_feature = [minus.len(), mean.len(), scale.len(), about.quantiles.len()];
        if *layout != about.layout() {
            return Some("its network is not the one that its metadata tells of".into());
        }
        if let Some(other) = per_feature.iter().find(|&&count| count != features) {
            return Some(format!("{features} features, but scaling or quantiles of {other}"));
        }
        if !scores.is_empty() && scores.len() != features || about.inputs != about.scaler.inputs() {
            let (inputs, scores) = (about.inputs, scores.len());
            return Some(format!("{inputs} inputs, but {features} features and normal scores of {scores}"));
        }
        if self.network.weights.len() != layout.weights() {
            let (there, needed) = (self.network.weights.len(), layout.weights());
            return Some(format!("{there} weights where its layers need {needed}"));
        }
        let is_rectified = layout.activation != Activation::Logistic;
        if is_rectified && layout.hidden.len() > MOST_RECTIFIED_LAYERS {
            let (there, most) = (layout.hidden.len(), MOST_RECTIFIED_LAYERS);
            return Some(format!(
                "{there} hidden layers of rectified neurons, more than the {most} that a config may have"
            ));
        }
        let sane = if is_rectified { SANE_RECTIFIED } else { SANE };
        if let Some(at) = self.network.weights.iter().position(|w| w.abs() > sane || w.is_nan()) {
            return Some(format!("weight {at} is {}", self.network.weights[at]));
        }
        let mut names: Vec<&String> = about.features.iter().collect();
        names.sort();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Some(format!("the feature {} is named twice", pair[0]));
        }
        let scaler = &about.scaler;
        if !finite(&scaler.mean) || scaler.scale.iter().any(|s| !(1e-300..=SANE).contains(s)) {
            return Some("a mean that is not finite, or a scale that is not positive".into());
        }
        if let Some(other) = minus.iter().flatten().find(|&&other| minus.get(other) != Some(&None)) {
            return Some(format!("input {other} is subtracted from another and is no plain input"));
        }
        if !(1e-3..=1e6).contains(&scaler.clip) {
            return Some(format!("inputs are clipped to {}, not to 0.001 to 1e6", scaler.clip));
        }
        if let Some(fault) = scores.iter().find_map(|scores| scores.fault(scaler.clip, SANE)) {
            return Some(fault.into());
        }
        if about.quantiles.iter().any(|q| !finite(q) || !ascending(q)) {
            return Some("quantiles that do not ascend".into());
        }
        if !in_unit(&about.targets) || about.targets[0] >= about.targets[1] {
            return Some(format!("targets {:?} are not two rising numbers within 0 and 1", about.targets));
        }
        let thresholds = &about.thresholds;
        if !(1..=MOST_THRESHOLDS).contains(&thresholds.len()) || !in_unit(thresholds) || !rising(thresholds) {
            return Some(format!(
                "thresholds {thresholds:?} are not 1 to {MOST_THRESHOLDS} rising numbers within 0 and 1"
            ));
        }
        if about.overhangs_m.iter().flatten().any(|m| !(0.0..=SANE).contains(m)) {
            return Some("an overhang rule whose height is not a number from 0 on".into());
        }
        if about.reach_m.is_some_and(|m| !(1e-3..=1e6).contains(&m)) {
            return Some("a reach that is not 1 mm to 1000 km".into());
        }
        if !finite(&about.mount) {
            return Some("a mount that is not finite".into());
        }
        if let Some(fault) = about.calibration.as_ref().and_then(Calibration::fault) {
            return Some(fault);
        }
        let sections = [
            ("cells", about.cells.validate().err()),
            ("labels", about.labels.as_ref().and_then(|rule| rule.validate().err())),
            ("rover", about.rover.validate().err()),
            ("sensor", about.sensor.validate().err()),
        ];
        sections.into_iter().find_map(|(name, fault)| {
            fault.map(|fault| format!("its {name}: {}", fault.to_string().trim().replace('\n', "; ")))
        })
    }
}
