//! Rows and weights -> the values of every layer, many rows at a time, in f32.
//!
//! For learning by batches and for its looks; a model's outputs are of f64 ([`Network::outputs`]), from which these differ by some 1e-6.
//! Rows of a matrix are rows of the corpus; the bias is an input that is 1. Sums of hidden neurons run in the order of the inputs, bias last, that of the
//! output as a sum of chunks whose lanes are added as a tree: a row has the same values among any others.

use super::matrix::{Matrix, times, times_transposed};
use super::{Layout, Network, Neuron};
use crate::math;
use crate::train::filter::lanes::{Isa, Kernel, Real, Simd};

/// Rows that go through a network together.
pub(crate) const MICRO_BATCH_ROWS: usize = 64;

/// The weights of one member, laid out for the forward pass of many rows.
#[derive(Debug)]
pub(crate) struct ForwardWeights {
    /// [inputs + 1, neurons] of each hidden layer, and [1, inputs + 1] of the output.
    layers: Vec<Matrix>,
    /// Of the hidden layers.
    pub(crate) neuron: Neuron,
}

impl ForwardWeights {
    pub(crate) fn new(layout: &Layout, member: usize) -> ForwardWeights {
        let bias = usize::from(layout.bias);
        let last = layout.hidden.len();
        let size = |(layer, (inputs, neurons))| {
            if layer == last { (neurons, inputs + bias) } else { (inputs + bias, neurons) }
        };
        let layers = layout.layers().enumerate().map(size).map(|(rows, columns)| Matrix::zeros(rows, columns));
        ForwardWeights { layers: layers.collect(), neuron: layout.hidden_neuron(member) }
    }

    /// To the weights of each layer, [neurons, inputs + 1].
    pub(crate) fn set<'m>(&mut self, layers: impl Iterator<Item = &'m Matrix>, isa: Isa) {
        let last = self.layers.len() - 1;
        for (number, (own, layer)) in self.layers.iter_mut().zip(layers).enumerate() {
            if number == last {
                own.copy(layer);
            } else {
                own.transpose_of(layer, isa);
            }
        }
    }
}

/// Some rows on their way through a member.
#[derive(Debug)]
pub(crate) struct Values {
    /// Into each layer, and ones for its bias: [rows, inputs + 1].
    pub into: Vec<Matrix>,
    /// [1, rows].
    pub outputs: Matrix,
}

impl Values {
    pub(crate) fn new(layout: &Layout) -> Values {
        let bias = usize::from(layout.bias);
        let values = |(inputs, _): (usize, usize)| {
            let mut values = Matrix::zeros(MICRO_BATCH_ROWS, inputs + bias);
            if layout.bias {
                (0..MICRO_BATCH_ROWS).for_each(|row| values.set(row, inputs, 1.0));
            }
            values
        };
        Values { into: layout.layers().map(values).collect(), outputs: Matrix::zeros(1, MICRO_BATCH_ROWS) }
    }

    /// Sets the inputs of up to [`MICRO_BATCH_ROWS`] rows, of f64 or of f32; places without one keep what they hold.
    pub(crate) fn set_rows<'r, T: Copy + Into<f64> + 'r>(&mut self, rows: impl Iterator<Item = &'r [T]>) {
        for (place, row) in rows.enumerate() {
            let chunks = self.into[0].row_mut(place);
            chunks.iter_mut().flat_map(AsMut::as_mut).zip(row).for_each(|(value, x)| *value = (*x).into() as f32);
        }
    }

    /// All layers, one after another.
    pub(crate) fn run(&mut self, weights: &ForwardWeights, isa: Isa) {
        let (output, hidden) = weights.layers.split_last().expect("a network has an output");
        for (layer, of_layer) in hidden.iter().enumerate() {
            let (before, after) = self.into.split_at_mut(layer + 1);
            times(&before[layer], of_layer, &mut after[0], isa);
            isa.run(Activate { values: &mut after[0], neurons: of_layer.columns, of: weights.neuron });
        }
        times_transposed(output, &self.into[hidden.len()], &mut self.outputs, isa);
        isa.run(Activate { values: &mut self.outputs, neurons: MICRO_BATCH_ROWS, of: Neuron::Logistic });
    }
}

const LANES: usize = <f32 as Real>::LANES;

/// The first columns of `values` become what neurons make of them; what lies behind them in their last chunk a 1 for the bias, where it has a
/// column, and noughts.
struct Activate<'a> {
    values: &'a mut Matrix,
    neurons: usize,
    of: Neuron,
}

impl Kernel<f32> for Activate<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Simd<f32>>(self) {
        let Activate { values, neurons, of } = self;
        let is_biased = values.columns > neurons;
        let (whole, left) = (neurons / LANES, neurons % LANES);
        let mut behind = [0.0; LANES];
        behind[left] = f32::from(u8::from(is_biased));
        for row in 0..values.rows {
            let row = values.row_mut(row);
            for chunk in &mut row[..whole] {
                for lanes in chunk.as_mut().as_chunks_mut::<LANES>().0 {
                    *lanes = values_of(of, lanes);
                }
            }
            // A chunk of the bias alone is as it was.
            if left > 0 {
                for lanes in row[whole].as_mut().as_chunks_mut::<LANES>().0 {
                    let own = values_of(of, lanes);
                    *lanes = behind;
                    lanes[..left].copy_from_slice(&own[..left]);
                }
            }
        }
    }
}

/// The values of several neurons from their sums; NaN for NaN. By kind and not as a function that is handed over: a call of one is not sure to become
/// part of the kernel, and what does not is compiled for any CPU: a training took six times as long by it.
#[inline(always)]
fn values_of(neuron: Neuron, sums: &[f32; LANES]) -> [f32; LANES] {
    let mut values = *sums;
    match neuron {
        // Eq. (1)
        Neuron::Logistic => {
            for value in &mut values {
                *value = -*value;
            }
            values = math::exp_lanes_f32(&values);
            for value in &mut values {
                *value = 1.0 / (1.0 + *value);
            }
        }
        Neuron::Rectified => {
            for value in &mut values {
                *value = if *value < 0.0 { 0.0 } else { *value };
            }
        }
    }
    values
}

/// A network in the precision that rows go through it in.
#[derive(Debug)]
pub(crate) enum NetworkIn<'n> {
    F64(&'n Network),
    F32(NetworkF32),
}

impl NetworkIn<'_> {
    /// As [`Network::outputs`].
    pub(crate) fn outputs(&self, rows: &[f64], outputs: &mut [f64]) {
        match self {
            NetworkIn::F64(network) => network.outputs(rows, outputs),
            NetworkIn::F32(network) => network.outputs(rows, outputs),
        }
    }
}

/// A network whose rows go through it in f32.
#[derive(Debug)]
pub(crate) struct NetworkF32 {
    layout: Layout,
    members: Vec<ForwardWeights>,
}

impl NetworkF32 {
    pub(crate) fn new(network: &Network) -> NetworkF32 {
        let layout = network.layout.clone();
        let bias = usize::from(layout.bias);
        let mut weights = network.weights.iter().map(|w| *w as f32);
        let member = |number| {
            let layer = |(inputs, neurons)| {
                let mut layer = Matrix::zeros(neurons, inputs + bias);
                layer.fill(&mut weights);
                layer
            };
            let layers: Vec<_> = layout.layers().map(layer).collect();
            let mut weights = ForwardWeights::new(&layout, number);
            weights.set(layers.iter(), Isa::detect());
            weights
        };
        let members = (0..layout.members).map(member).collect();
        NetworkF32 { layout, members }
    }

    pub(crate) fn outputs<T: Copy + Into<f64>>(&self, rows: &[T], outputs: &mut [f64]) {
        let (isa, inputs) = (Isa::detect(), self.layout.inputs);
        let mut values = Values::new(&self.layout);
        let share = 1.0 / self.members.len() as f64;
        for (rows, outputs) in rows.chunks(MICRO_BATCH_ROWS * inputs).zip(outputs.chunks_mut(MICRO_BATCH_ROWS)) {
            values.set_rows(rows.chunks_exact(inputs));
            outputs.fill(0.0);
            for member in &self.members {
                values.run(member, isa);
                for (place, output) in outputs.iter_mut().enumerate() {
                    *output += share * f64::from(values.outputs.get(0, place));
                }
            }
        }
    }
}
