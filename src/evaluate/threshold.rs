//! This module names the thresholds of a report and the groups of cells that are judged on their own.
//!
//! Thresholds go into `judge`, and groups come out of it; both stand in a report's JSON, in snake case.

use serde::{Deserialize, Serialize};

/// Outputs from `value` on are called untraversable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Threshold {
    pub value: f64,
    pub origin: ThresholdOrigin,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThresholdOrigin {
    /// The model's own.
    Model,
    /// Asked for by the user.
    Given,
    /// The best balanced accuracy by cells on the validation split.
    Validation,
}

/// How many of a report's thresholds are asked for: they come first.
pub(super) fn asked(thresholds: &[Threshold]) -> usize {
    thresholds.iter().filter(|threshold| threshold.origin != ThresholdOrigin::Validation).count()
}

/// A part of the cells that is judged on its own.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    All,
    /// Cells with at least so many points.
    Points(u32),
    Family(String),
    Sensor(String),
}
