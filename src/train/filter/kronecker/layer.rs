//! One layer of weights: its gradient -> its step.
//!
//! G (neurons x inputs) is the mean gradient of a batch. Its covariance over batches is taken as a Kronecker product of E[G G'] (between
//! neurons) and E[G' G] (between inputs), whose eigenvectors are A and B. In the basis A, B the elements of a gradient are nearly uncorrelated, so
//! each is divided by its own root mean square there: with M the running mean of G, the step is -rate A ((A' M B) / sqrt(E[(A' G B)^2])) B'.
//! Deviation: the quotient is bounded. While the bases stand it is 1 at most (Cauchy-Schwarz, for both means forget alike); where they turn, a direction may be
//! left with the squares of another one, of which no gradient ever had a part.

use super::basis::turn_to_eigenvectors;
use crate::train::filter::lanes::Isa;
use crate::train::network::matrix::{Matrix, times, times_transposed, transposed_times};

/// What of a running mean stays from batch to batch.
pub(super) const KEPT: f64 = 0.95;
/// Batches from one turn of the bases to the next.
const TURN_EVERY: u64 = 10;
/// What is added to a root mean square: gradients far below it are noise of rounding.
const LEAST_ROOT: f32 = 1e-10;

/// The most that a mean is in units of its root mean square: far above what turns of the bases leave where gradients have parts everywhere.
const MOST_QUOTIENT: f32 = 100.0;

pub(super) struct Layer {
    pub weights: Matrix,
    /// The sum of the gradients of a batch so far.
    pub gradient: Matrix,
    /// Running means, from nought: of G, G G', G' G, and (A' G B)^2.
    mean: Matrix,
    by_neurons: Matrix,
    by_inputs: Matrix,
    squares: Matrix,
    /// A and B; vectors are rows.
    neuron_basis: Matrix,
    input_basis: Matrix,
    scratch: Scratch,
}

struct Scratch {
    by_neurons: Matrix,
    by_inputs: Matrix,
    half: Matrix,
    turned: Matrix,
}

/// The arrays that are kept, by name.
macro_rules! arrays {
    ($($name:ident),*) => {
        /// All that the next step depends on.
        pub(super) fn arrays(&self) -> Vec<(&'static str, &Matrix)> {
            vec![$((stringify!($name), &self.$name)),*]
        }

        /// The same, to be restored.
        pub(super) fn arrays_mut(&mut self) -> Vec<(&'static str, &mut Matrix)> {
            vec![$((stringify!($name), &mut self.$name)),*]
        }
    };
}

impl Layer {
    pub(super) fn new(neurons: usize, inputs: usize) -> Layer {
        let [own, neuron, input] =
            [(neurons, inputs), (neurons, neurons), (inputs, inputs)].map(|(r, c)| Matrix::zeros(r, c));
        Layer {
            weights: own.clone(),
            gradient: own.clone(),
            mean: own.clone(),
            by_neurons: neuron.clone(),
            by_inputs: input.clone(),
            squares: own.clone(),
            neuron_basis: Matrix::identity(neurons),
            input_basis: Matrix::identity(inputs),
            scratch: Scratch { by_neurons: neuron, by_inputs: input, half: own.clone(), turned: own },
        }
    }

    arrays!(weights, gradient, mean, by_neurons, by_inputs, squares, neuron_basis, input_basis);

    /// Whether a step can be made of the gradient: no element of its covariances, nor of its square in any basis, is greater than the sum of
    /// its squares, so that all are finite where that is.
    pub(super) fn is_sound(&self) -> bool {
        let squares: f64 = self.gradient.padded().map(|x| f64::from(*x) * f64::from(*x)).sum();
        squares < f64::from(f32::MAX) / 4.0
    }

    /// Makes the gradient of a batch nought.
    pub(super) fn zero_gradient(&mut self, isa: Isa) {
        self.gradient.change(isa, |_| 0.0);
    }

    /// The step for the gradient of `rows` rows, which is then nought again; `steps`: those before it.
    pub(super) fn step(&mut self, rows: u64, steps: u64, rate: f32, seen: f32, isa: Isa) {
        let Layer { gradient, mean, by_neurons, by_inputs, squares, scratch, .. } = self;
        let (share, scale) = ((1.0 - KEPT) as f32, 1.0 / rows as f32);
        gradient.change(isa, |x| x * scale);
        times_transposed(gradient, gradient, &mut scratch.by_neurons, isa);
        mean.update_running_mean(gradient, share, isa);
        by_neurons.update_running_mean(&scratch.by_neurons, share, isa);
        transposed_times(gradient, gradient, &mut scratch.by_inputs, isa);
        by_inputs.update_running_mean(&scratch.by_inputs, share, isa);
        if steps.is_multiple_of(TURN_EVERY) {
            turn_to_eigenvectors(by_neurons, &mut self.neuron_basis, &mut scratch.by_neurons, isa);
            turn_to_eigenvectors(by_inputs, &mut self.input_basis, &mut scratch.by_inputs, isa);
        }
        let Scratch { half, turned, .. } = scratch;
        times(&self.neuron_basis, gradient, half, isa);
        times_transposed(half, &self.input_basis, turned, isa);
        squares.change_by(turned, isa, |square, x| square + share * (x * x - square));
        times(&self.neuron_basis, mean, half, isa);
        times_transposed(half, &self.input_basis, turned, isa);
        // Running means from nought are `seen` too small.
        let size = rate / seen;
        let most = rate * MOST_QUOTIENT;
        turned.change_by(squares, isa, |x, square| {
            (x * (size / ((square / seen).sqrt() + LEAST_ROOT))).clamp(-most, most)
        });
        times(turned, &self.input_basis, half, isa);
        transposed_times(&self.neuron_basis, half, turned, isa);
        self.weights.change_by(turned, isa, |w, step| w - step);
        self.zero_gradient(isa);
    }
}
