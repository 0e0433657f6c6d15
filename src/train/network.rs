//! Scaled features -> one output in (0, 1), and its gradient by the weights.
//!
//! Source: Hewitt et al. 2017, eqs 1 and 2: logistic neurons, linear input layer. Deviation: a bias per neuron, unless switched
//! off (the paper's eq. 2 prints none). All f64.

/// Sizes of the layers; the output layer is one neuron.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    pub inputs: usize,
    /// Neurons of each hidden layer, from the input on.
    pub hidden: Vec<usize>,
    pub bias: bool,
}

/// Layer sizes and weights. Order of the weights: layer by layer from the input on; within a layer neuron by neuron; within a
/// neuron its inputs in order, then its bias.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    pub layout: Layout,
    pub weights: Vec<f64>,
}

impl Layout {
    /// Layer sizes with input and output: [inputs, hidden..., 1].
    pub fn sizes(&self) -> Vec<usize> {
        std::iter::once(self.inputs).chain(self.hidden.iter().copied()).chain([1]).collect()
    }

    /// Number of weights, s.
    pub fn weights(&self) -> usize {
        self.sizes().windows(2).map(|w| (w[0] + usize::from(self.bias)) * w[1]).sum()
    }
}
