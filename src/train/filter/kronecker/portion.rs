//! Rows as they are handed over -> those that members learn, and a count of the others.

use super::gradient::Row;
use crate::train::filter::Counters;
use crate::train::filter::linearised::finite;

/// The most that a row may weigh: its gradient is finite in f32. A batch whose squares are not is left out whole.
const MOST_ROW_WEIGHT: f64 = 1e15;

/// Rows that every member learns after one another, and what is counted of them and of those that are left out.
#[derive(Default)]
pub(super) struct Portion<'r> {
    pub rows: Vec<Row<'r>>,
    pub seen: Counters,
}

impl<'r> Portion<'r> {
    /// Takes rows in; `clip`: inputs end there.
    pub(super) fn take(&mut self, inputs: &'r [f64], targets: &[f64], noise: &[f64], clip: f64) {
        self.rows.reserve(targets.len());
        let width = inputs.len() / targets.len().max(1);
        for ((inputs, &target), &noise) in inputs.chunks_exact(width.max(1)).zip(targets).zip(noise) {
            let weight = 1.0 / noise;
            if finite(inputs) && target.is_finite() && weight > 0.0 && weight <= MOST_ROW_WEIGHT {
                self.seen.take_inputs(inputs, clip);
                self.rows.push(Row { inputs, target, weight });
            } else {
                self.seen.rejected += 1;
            }
        }
    }
}
