//! Rows and weights -> the gradient of half their weighted squared error, layer by layer.
//!
//! Rows stand in the columns of matrices, so that one product is a layer of all of them. Micro-batches are computed apart, by as many
//! threads as there are, and added in their order: the number of threads changes no bit. Products are of f32; the logistic function and the error
//! are of f64. Same network as [`Network`](crate::train::Network): logistic neurons, a bias as an input that is 1.

use super::matrix::{Matrix, times, times_transposed, transposed_times};
use crate::train::Layout;
use crate::train::filter::lanes::{Isa, Kernel, Real, Simd};
use crate::train::network::logistic;

/// Rows of a micro-batch.
pub(super) const MICRO_BATCH_ROWS: usize = 64;

/// A row to learn: its scaled inputs, its target, and 1 / R.
pub(super) struct Row<'a> {
    pub inputs: &'a [f64],
    pub target: f64,
    pub weight: f64,
}

/// Some rows on their way through the network and back.
pub(super) struct MicroBatch {
    /// Values into each layer, and a row of ones for its bias: [inputs + 1, rows].
    values: Vec<Matrix>,
    /// Outputs [1, rows].
    outputs: Matrix,
    /// d error / d sum of each neuron, by layer: [neurons, rows].
    slopes: Vec<Matrix>,
    /// The gradient by layer: [neurons, inputs + 1].
    pub gradients: Vec<Matrix>,
}

impl MicroBatch {
    pub(super) fn new(layout: &Layout) -> MicroBatch {
        let bias = usize::from(layout.bias);
        let values = |(inputs, _): (usize, usize)| {
            let mut values = Matrix::zeros(inputs + bias, MICRO_BATCH_ROWS);
            if layout.bias {
                (0..MICRO_BATCH_ROWS).for_each(|row| values.set(inputs, row, 1.0));
            }
            values
        };
        MicroBatch {
            values: layout.layers().map(values).collect(),
            outputs: Matrix::zeros(1, MICRO_BATCH_ROWS),
            slopes: layout.layers().map(|(_, neurons)| Matrix::zeros(neurons, MICRO_BATCH_ROWS)).collect(),
            gradients: layout.layers().map(|(inputs, neurons)| Matrix::zeros(neurons, inputs + bias)).collect(),
        }
    }

    /// The gradient of up to [`MICRO_BATCH_ROWS`] rows at these weights, one matrix a layer.
    pub(super) fn run(&mut self, weights: &[&Matrix], rows: &[Row], isa: Isa) {
        for (place, row) in rows.iter().enumerate() {
            row.inputs.iter().enumerate().for_each(|(input, x)| self.values[0].set(input, place, *x as f32));
        }
        let last = weights.len() - 1;
        for layer in 0..=last {
            let (before, after) = self.values.split_at_mut(layer + 1);
            let out = after.first_mut().unwrap_or(&mut self.outputs);
            times(weights[layer], &before[layer], out, isa);
            isa.run(Logistic { values: out, neurons: weights[layer].rows });
        }
        for place in 0..MICRO_BATCH_ROWS {
            // Places without a row teach nothing.
            let slope = rows.get(place).map_or(0.0, |row| {
                let y = f64::from(self.outputs.get(0, place));
                row.weight * (y - row.target) * y * (1.0 - y)
            });
            self.slopes[last].set(0, place, slope as f32);
        }
        for layer in (0..=last).rev() {
            let (before, from) = self.slopes.split_at_mut(layer);
            times_transposed(&from[0], &self.values[layer], &mut self.gradients[layer], isa);
            if let Some(slopes) = before.last_mut() {
                back(weights[layer], &from[0], slopes, &self.values[layer], isa);
            }
        }
    }
}

/// Slopes of a layer -> those of the layer before, whose values are `values`.
fn back(weights: &Matrix, slopes: &Matrix, before: &mut Matrix, values: &Matrix, isa: Isa) {
    transposed_times(weights, slopes, before, isa);
    for neuron in 0..before.rows {
        for (slopes, values) in before.row_mut(neuron).iter_mut().zip(values.row(neuron)) {
            slopes.as_mut().iter_mut().zip(values.as_ref()).for_each(|(slope, y)| *slope *= y * (1.0 - y));
        }
    }
}

/// The first rows of `values` become their logistic function.
struct Logistic<'a> {
    values: &'a mut Matrix,
    neurons: usize,
}

impl Kernel<f32> for Logistic<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Simd<f32>>(self) {
        const WIDE: usize = <f64 as Real>::LANES;
        for neuron in 0..self.neurons {
            for chunk in self.values.row_mut(neuron) {
                for eight in chunk.as_mut().as_chunks_mut::<WIDE>().0 {
                    *eight = logistic(&eight.map(f64::from)).map(|y| y as f32); // Eq. (1)
                }
            }
        }
    }
}
