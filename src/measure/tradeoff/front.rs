//! Learning curves of all settings -> the sizes of which no other is both cheaper and more accurate: the Pareto front.
//!
//! Sizes beyond those at which all settings are compared are among them.
//! Of means, so that a lucky setting may stand on it; what is told apart is told elsewhere. Other yards are not on it, nor poses that no
//! rover knows.

use super::report::{CurveRow, Report, Row};
use super::settings::Side;

/// The front of the pipeline's settings, the cheapest first.
pub(super) fn front(report: &Report) -> Vec<(&Row, &CurveRow)> {
    let open = report.side(Side::Pipeline).filter(|row| row.may_be_recommended);
    let mut all: Vec<(&Row, &CurveRow)> = open
        .filter_map(|row| Some((row, row.worth.as_ref()?)))
        .flat_map(|(row, worth)| worth.sizes().map(move |size| (row, size)))
        .collect();
    all.sort_by(|a, b| a.1.cpu_s().total_cmp(&b.1.cpu_s()));
    let mut best = f64::NEG_INFINITY;
    all.retain(|(_, size)| {
        let is_better = size.balanced_accuracy.mean > best;
        best = best.max(size.balanced_accuracy.mean);
        is_better
    });
    all
}
