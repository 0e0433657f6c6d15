//! Scaled features -> one output in (0, 1), and its gradient by the weights.
//!
//! Source: Hewitt et al. 2017, eqs 1 and 2: logistic neurons, linear input layer. Deviations: a bias per neuron, unless switched
//! off (the paper's eq. 2 prints none); rectified hidden neurons, where asked for; several members of one shape, whose mean is the output (Hansen & Salamon 1990). Of f64; `forward` is the same of f32. The gradient is exact, by reverse mode. A row's output has the same bits alone
//! and among others, on every CPU: sums run in the order of the inputs, bias first, with fused multiply-adds.

mod batch;
pub(crate) mod forward;
mod layout;
pub(crate) mod matrix;
mod neuron;

use self::batch::NetworkBatch;
pub(crate) use self::layout::LayerOf;
pub use self::layout::Layout;
pub use self::neuron::Activation;
pub(crate) use self::neuron::Neuron;
use super::filter::lanes::{Isa, Kernel, Simd};
use crate::random::{Purpose, Streams};

/// Layer sizes and weights. Order of the weights: member by member; within a member layer by layer from the input on; within a layer
/// neuron by neuron; within a neuron its inputs in order, then its bias.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    pub layout: Layout,
    pub weights: Vec<f64>,
}

/// What a forward run leaves for the way back. Reused from row to row.
#[derive(Clone, Debug, Default)]
pub struct Activations {
    /// Values of all nodes of a member, layer by layer, inputs first.
    values: Vec<f64>,
    /// d output / d value of the nodes of a layer, and of the layer before it.
    slopes: Vec<f64>,
    slopes_before: Vec<f64>,
}

impl Network {
    /// Weights uniform within a bound that goes by the fan-in and the neurons, each drawn at its own address.
    pub fn random(layout: Layout, streams: &Streams) -> Network {
        let mut weights = vec![0.0; layout.weights()];
        streams.open(Purpose::InitialWeights).fill_uniform(0, &mut weights);
        let mut rest = &mut weights[..];
        for ((inputs, neurons), neuron) in
            (0..layout.members).flat_map(|member| layout.layers().zip(layout.neurons(member)))
        {
            let (layer, after) = rest.split_at_mut(layout.weights_of_layer(inputs, neurons));
            let bound = neuron.initial_bound(inputs);
            for w in layer {
                *w = bound * (2.0 * *w - 1.0);
            }
            rest = after;
        }
        Network { layout, weights }
    }

    /// The output for one row of scaled features.
    pub(crate) fn output(&self, inputs: &[f64], tape: &mut Activations) -> f64 {
        Isa::detect().run(Forward { network: self, inputs, tape })
    }

    /// The outputs for rows of scaled features, row-major; one entry a row.
    ///
    /// # Panics
    /// Where `rows` is not a whole number of rows, or `outputs` has another number of them.
    pub fn outputs(&self, rows: &[f64], outputs: &mut [f64]) {
        assert_eq!(rows.len(), outputs.len() * self.layout.inputs, "one output a row");
        Isa::detect().run(NetworkBatch { network: self, rows, outputs });
    }

    /// The output for one row, and its gradient by the weights (eq. 16).
    ///
    /// One logistic neuron has a closed form, y (1 - y) times its input:
    ///
    /// ```
    /// use marsyard::train::network::Activations;
    /// use marsyard::train::{Activation, Layout, Network};
    ///
    /// let layout = Layout { inputs: 2, hidden: Vec::new(), bias: true, members: 1, activation: Activation::Logistic };
    /// let network = Network { layout, weights: vec![0.5, -1.0, 0.25] };
    /// let mut gradient = [0.0; 3];
    /// let output = network.gradient(&[2.0, 1.0], &mut Activations::default(), &mut gradient);
    /// assert!((output - 1.0 / (1.0 + (-0.25_f64).exp())).abs() < 1e-15);
    /// for (slope, input) in gradient.iter().zip([2.0, 1.0, 1.0]) {
    ///     assert!((slope - output * (1.0 - output) * input).abs() < 1e-15);
    /// }
    /// ```
    ///
    /// # Panics
    /// Where `inputs` or `gradient` has another length than the layout says.
    pub fn gradient(&self, inputs: &[f64], tape: &mut Activations, gradient: &mut [f64]) -> f64 {
        assert_eq!(inputs.len(), self.layout.inputs, "one value an input");
        assert_eq!(gradient.len(), self.weights.len(), "one slope a weight");
        Isa::detect().run(Gradient { network: self, inputs, tape, gradient })
    }
}

struct Forward<'a> {
    network: &'a Network,
    inputs: &'a [f64],
    tape: &'a mut Activations,
}

impl Kernel<f64> for Forward<'_> {
    type Out = f64;

    #[inline(always)]
    fn run<V: Simd<f64>>(self) -> f64 {
        let Forward { network: Network { layout, weights }, inputs, tape } = self;
        let size = layout.weights_of_member();
        // A loop, for an iterator's sum is not sure to become part of the kernel.
        let mut sum = 0.0;
        for member in 0..layout.members {
            sum += forward(layout, member, &weights[member * size..][..size], inputs, tape);
        }
        sum / layout.members as f64
    }
}

/// The output of one member; the tape holds its values.
#[inline(always)]
fn forward(layout: &Layout, member: usize, weights: &[f64], inputs: &[f64], tape: &mut Activations) -> f64 {
    let nodes = layout.inputs + layout.hidden.iter().sum::<usize>() + 1;
    tape.values.resize(nodes, 0.0);
    tape.values[..layout.inputs].copy_from_slice(inputs);
    let mut rest = weights;
    let mut first = 0;
    for ((count, neurons), neuron) in layout.layers().zip(layout.neurons(member)) {
        let (before, after) = tape.values[first..].split_at_mut(count);
        let stride = count + usize::from(layout.bias);
        let (own, others) = rest.split_at(stride * neurons);
        let several = CHAINS * (neurons / CHAINS);
        let (together, alone) = after[..neurons].split_at_mut(several);
        for (k, values) in together.as_chunks_mut::<CHAINS>().0.iter_mut().enumerate() {
            *values = neuron.values(&side_by_side(&own[k * CHAINS * stride..], before, layout.bias));
        }
        for (k, value) in alone.iter_mut().enumerate() {
            [*value] = neuron.values(&side_by_side(&own[(several + k) * stride..], before, layout.bias));
        }
        rest = others;
        first += count;
    }
    tape.values[nodes - 1]
}

/// Neurons whose sums run side by side: each is a chain, and waits for itself.
const CHAINS: usize = 8;

/// The sums of `N` neurons, whose weights follow one another in `rows`, of the values of the layer before.
#[inline(always)]
fn side_by_side<const N: usize>(rows: &[f64], before: &[f64], bias: bool) -> [f64; N] {
    let (count, stride) = (before.len(), before.len() + usize::from(bias));
    let rows: [&[f64]; N] = std::array::from_fn(|n| &rows[n * stride..][..stride]);
    let mut sums = [0.0; N];
    if bias {
        for n in 0..N {
            sums[n] = rows[n][count];
        }
    }
    for (i, x) in before.iter().enumerate() {
        for n in 0..N {
            sums[n] = rows[n][i].mul_add(*x, sums[n]); // Eq. (2)
        }
    }
    sums
}

struct Gradient<'a> {
    network: &'a Network,
    inputs: &'a [f64],
    tape: &'a mut Activations,
    gradient: &'a mut [f64],
}

impl Kernel<f64> for Gradient<'_> {
    type Out = f64;

    #[inline(always)]
    fn run<V: Simd<f64>>(self) -> f64 {
        let Gradient { network: Network { layout, weights }, inputs, tape, gradient } = self;
        let size = layout.weights_of_member();
        let mut sum = 0.0;
        for member in 0..layout.members {
            let own = member * size..(member + 1) * size;
            sum += forward(layout, member, &weights[own.clone()], inputs, tape);
            backward(layout, member, &weights[own.clone()], tape, &mut gradient[own]);
        }
        sum / layout.members as f64
    }
}

/// The gradient of the members' mean by the weights of the one whose values are on the tape.
#[inline(always)]
fn backward(layout: &Layout, member: usize, weights: &[f64], tape: &mut Activations, gradient: &mut [f64]) {
    let Activations { values, slopes, slopes_before } = tape;
    slopes.clear();
    slopes.push(1.0 / layout.members as f64);
    let mut last = values.len() - 1;
    let mut end = weights.len();
    let mut neuron = Neuron::Logistic;
    for (count, neurons) in layout.layers().rev() {
        let stride = count + usize::from(layout.bias);
        let start = end - stride * neurons;
        let nodes = &values[last..last + neurons];
        let before = &values[last - count..last];
        slopes_before.clear();
        slopes_before.resize(count, 0.0);
        let rows = weights[start..end].chunks_exact(stride).zip(gradient[start..end].chunks_exact_mut(stride));
        for ((row, out), (value, slope)) in rows.zip(nodes.iter().zip(slopes.iter())) {
            let delta = slope * neuron.slope(*value);
            for (o, x) in out.iter_mut().zip(before) {
                *o = delta * x;
            }
            if layout.bias {
                out[count] = delta;
            }
            for (s, w) in slopes_before.iter_mut().zip(row) {
                *s = delta.mul_add(*w, *s);
            }
        }
        std::mem::swap(slopes, slopes_before);
        neuron = layout.hidden_neuron(member);
        last -= count;
        end = start;
    }
}

#[cfg(test)]
mod tests;
