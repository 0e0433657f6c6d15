//! This module says how large a network is, and where its weights lie.
//!
//! The sizes of the layers and the kind of the neurons go in. The number of the weights comes out, and the weights taken apart into members, layers
//! and neurons.

use super::neuron::{Activation, Neuron};

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

    pub(super) fn weights_of_layer(&self, inputs: usize, neurons: usize) -> usize {
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
