//! Rows and weights -> the gradient of their weighted loss, layer by layer.
//!
//! Micro-batches are computed apart, by as many threads as there are, and added in their order: the number of threads changes no bit. All is
//! of f32 but the slope of the loss. Same network as [`Network`](crate::train::Network), its bias an input that is 1.

use crate::train::filter::lanes::Isa;
use crate::train::network::Neuron;
use crate::train::network::forward::{ForwardWeights, MICRO_BATCH_ROWS, Values};
use crate::train::network::matrix::{Matrix, times, transposed_times};
use crate::train::{Layout, Loss};

/// A row to learn: its scaled inputs, its target, and 1 / R.
pub(super) struct Row<'a> {
    pub inputs: &'a [f64],
    pub target: f64,
    pub weight: f64,
}

/// Some rows on their way through a member and back.
pub(super) struct MicroBatch {
    values: Values,
    /// d loss / d sum of each neuron, by layer: [rows, neurons].
    slopes: Vec<Matrix>,
    /// The gradient by layer: [neurons, inputs + 1].
    pub gradients: Vec<Matrix>,
}

impl MicroBatch {
    pub(super) fn new(layout: &Layout) -> MicroBatch {
        let bias = usize::from(layout.bias);
        MicroBatch {
            values: Values::new(layout),
            slopes: layout.layers().map(|(_, neurons)| Matrix::zeros(MICRO_BATCH_ROWS, neurons)).collect(),
            gradients: layout.layers().map(|(inputs, neurons)| Matrix::zeros(neurons, inputs + bias)).collect(),
        }
    }

    /// The gradient of up to [`MICRO_BATCH_ROWS`] rows at these weights, one matrix a layer, [neurons, inputs + 1]; `forward`: the same
    /// weights, as rows meet them.
    pub(super) fn run(&mut self, weights: &[&Matrix], forward: &ForwardWeights, rows: &[Row], loss: Loss, isa: Isa) {
        let MicroBatch { values, slopes, gradients } = self;
        values.set_rows(rows.iter().map(|row| row.inputs));
        values.run(forward, isa);
        let last = weights.len() - 1;
        for place in 0..MICRO_BATCH_ROWS {
            // Places without a row teach nothing.
            let slope = rows.get(place).map_or(0.0, |row| {
                let y = f64::from(values.outputs.get(0, place));
                loss.slope(row.weight, y, row.target)
            });
            slopes[last].set(place, 0, slope as f32);
        }
        for layer in (0..=last).rev() {
            let (before, from) = slopes.split_at_mut(layer);
            transposed_times(&from[0], &values.into[layer], &mut gradients[layer], isa);
            if let Some(slopes) = before.last_mut() {
                times(&from[0], weights[layer], slopes, isa);
                let values = &values.into[layer];
                match forward.neuron {
                    // Behind the last neuron values are 1 and nought, which leaves nothing there.
                    Neuron::Logistic => slopes.change_by(values, isa, |slope, y| slope * (y * (1.0 - y))),
                    Neuron::Rectified => {
                        slopes.change_by(values, isa, |slope, y| if y > 0.0 { slope } else { 0.0 });
                        slopes.zero_padding();
                    }
                }
            }
        }
    }
}
