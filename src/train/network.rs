//! Scaled features -> one output in (0, 1), and its gradient by the weights.
//!
//! Source: Hewitt et al. 2017, eqs 1 and 2: logistic neurons, linear input layer. Deviations: a bias per neuron, unless switched
//! off (the paper's eq. 2 prints none); rectified hidden neurons, where asked for; several members of one shape, whose mean is the output (Hansen & Salamon 1990). Of f64; `forward` is the same of f32. The gradient is exact, by reverse mode. A row's output has the same bits alone
//! and among others, on every CPU: sums run in the order of the inputs, bias first, with fused multiply-adds.

pub(crate) mod forward;
pub(crate) mod matrix;
mod neuron;

pub use self::neuron::Activation;
pub(crate) use self::neuron::Neuron;
use super::filter::lanes::{Isa, Kernel, Real, Simd};
use crate::random::{Purpose, Streams};

/// Sizes of the layers; the output layer is one neuron.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    pub inputs: usize,
    /// Neurons of each hidden layer, from the input on.
    pub hidden: Vec<usize>,
    pub bias: bool,
    /// Networks of these sizes; the output is their mean.
    pub members: usize,
    pub activation: Activation,
}

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

impl Layout {
    /// Layer sizes of a member with input and output: [inputs, hidden..., 1].
    pub(crate) fn sizes(&self) -> Vec<usize> {
        std::iter::once(self.inputs).chain(self.hidden.iter().copied()).chain([1]).collect()
    }

    /// Number of weights, s, of all members.
    pub fn weights(&self) -> usize {
        self.members * self.weights_of_member()
    }

    /// What the hidden neurons of a member are.
    pub(crate) fn hidden_neuron(&self, member: usize) -> Neuron {
        match self.activation {
            Activation::Logistic => Neuron::Logistic,
            Activation::Relu => Neuron::Rectified,
            Activation::Both if member.is_multiple_of(2) => Neuron::Logistic,
            Activation::Both => Neuron::Rectified,
        }
    }

    /// What the neurons of each layer of a member are, from the first hidden one on.
    pub(crate) fn neurons(&self, member: usize) -> impl Iterator<Item = Neuron> + use<> {
        std::iter::repeat_n(self.hidden_neuron(member), self.hidden.len()).chain([Neuron::Logistic])
    }

    /// With what names of a member's arrays begin: nothing where there is one.
    pub(crate) fn member_name(&self, member: usize) -> String {
        if self.members > 1 { format!("members.{member}.") } else { String::new() }
    }

    /// Of one member.
    pub(crate) fn weights_of_member(&self) -> usize {
        self.layers().map(|(inputs, neurons)| self.weights_of_layer(inputs, neurons)).sum()
    }

    fn weights_of_layer(&self, inputs: usize, neurons: usize) -> usize {
        (inputs + usize::from(self.bias)) * neurons
    }

    /// The weights of each layer: member by member, from the input on; with its inputs and neurons.
    pub(crate) fn split<'w>(&self, weights: &'w [f64]) -> Vec<Vec<LayerOf<'w>>> {
        let mut rest = weights;
        let mut layer = |(inputs, neurons)| {
            let (own, after) = rest.split_at(self.weights_of_layer(inputs, neurons));
            rest = after;
            LayerOf { inputs, neurons, weights: own }
        };
        (0..self.members).map(|_| self.layers().map(&mut layer).collect()).collect()
    }

    /// Inputs and neurons of each layer of a member.
    pub(crate) fn layers(&self) -> impl DoubleEndedIterator<Item = (usize, usize)> + '_ {
        let size = |layer: usize| if layer == 0 { self.inputs } else { self.hidden[layer - 1] };
        let neurons = |layer: usize| self.hidden.get(layer).copied().unwrap_or(1);
        (0..=self.hidden.len()).map(move |layer| (size(layer), neurons(layer)))
    }
}

/// A layer of a member: one row a neuron, its inputs in order, then its bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LayerOf<'w> {
    pub inputs: usize,
    pub neurons: usize,
    pub weights: &'w [f64],
}

impl<'w> LayerOf<'w> {
    /// Weights and bias of each neuron; a bias of 0 where it has none.
    pub(crate) fn rows(self) -> impl Iterator<Item = (&'w [f64], f64)> {
        let row = self.weights.len() / self.neurons;
        self.weights.chunks_exact(row).map(move |w| (&w[..self.inputs], w.get(self.inputs).copied().unwrap_or(0.0)))
    }
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
        let outputs =
            (0..layout.members).map(|member| forward(layout, member, &weights[member * size..][..size], inputs, tape));
        outputs.sum::<f64>() / layout.members as f64
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

struct NetworkBatch<'a> {
    network: &'a Network,
    rows: &'a [f64],
    outputs: &'a mut [f64],
}

impl Kernel<f64> for NetworkBatch<'_> {
    type Out = ();

    /// Rows stand in the lanes.
    #[inline(always)]
    fn run<V: Simd<f64>>(self) {
        type Lane = <f64 as Real>::Chunk;
        let NetworkBatch { network: Network { layout, weights }, rows, outputs } = self;
        let widest = layout.hidden.iter().copied().max().unwrap_or(0).max(layout.inputs).max(1);
        let [mut inputs, mut values, mut next] = [(); 3].map(|()| vec![Lane::default(); widest]);
        for (rows, outputs) in rows.chunks(f64::LANES * layout.inputs.max(1)).zip(outputs.chunks_mut(f64::LANES)) {
            for (lane, row) in rows.chunks_exact(layout.inputs.max(1)).enumerate() {
                for (value, x) in inputs.iter_mut().zip(row) {
                    value.as_mut()[lane] = *x;
                }
            }
            let mut sums = Lane::default();
            let mut rest = &weights[..];
            for member in 0..layout.members {
                for (layer, ((count, neurons), neuron)) in layout.layers().zip(layout.neurons(member)).enumerate() {
                    let before = if layer == 0 { &inputs[..count] } else { &values[..count] };
                    let stride = count + usize::from(layout.bias);
                    let (own, others) = rest.split_at(stride * neurons);
                    let several = ABREAST * (neurons / ABREAST);
                    let (together, alone) = next[..neurons].split_at_mut(several);
                    for (k, out) in together.as_chunks_mut::<ABREAST>().0.iter_mut().enumerate() {
                        abreast::<V, ABREAST>(&own[k * ABREAST * stride..], before, (layout.bias, neuron), out);
                    }
                    for (k, out) in alone.as_chunks_mut::<1>().0.iter_mut().enumerate() {
                        abreast::<V, 1>(&own[(several + k) * stride..], before, (layout.bias, neuron), out);
                    }
                    rest = others;
                    std::mem::swap(&mut values, &mut next);
                }
                sums.as_mut().iter_mut().zip(values[0].as_ref()).for_each(|(sum, output)| *sum += output);
            }
            outputs.iter_mut().zip(sums.as_ref()).for_each(|(mean, sum)| *mean = sum / layout.members as f64);
        }
    }
}

/// Neurons whose sums run side by side where rows stand in the lanes: each is a chain, and waits for itself.
const ABREAST: usize = 8;

/// `N` neurons, whose weights follow one another in `weights`, on the values of the layer before, a row in each lane.
#[inline(always)]
fn abreast<V: Simd<f64>, const N: usize>(
    weights: &[f64],
    before: &[<f64 as Real>::Chunk],
    (bias, neuron): (bool, Neuron),
    out: &mut [<f64 as Real>::Chunk; N],
) {
    let (count, stride) = (before.len(), before.len() + usize::from(bias));
    let own: [&[f64]; N] = std::array::from_fn(|n| &weights[n * stride..][..stride]);
    let mut sums: [V; N] = std::array::from_fn(|n| V::splat(if bias { own[n][count] } else { 0.0 }));
    for (i, x) in before.iter().enumerate() {
        let x = V::load(x);
        for n in 0..N {
            sums[n] = V::splat(own[n][i]).mul_add(x, sums[n]); // Eq. (2)
        }
    }
    for n in 0..N {
        sums[n].store(&mut out[n]);
        let lanes: &mut [f64; f64::LANES] = out[n].as_mut().try_into().expect("a chunk has its lanes");
        *lanes = neuron.values(lanes);
    }
}

#[cfg(test)]
mod tests;
