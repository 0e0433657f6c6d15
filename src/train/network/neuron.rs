//! Sums -> values of neurons, and their slopes.
//!
//! Source: Hewitt et al. 2017, eq. 1 (logistic); rectified neurons: Nair & Hinton 2010; the bound of their initial weights: He et al. 2015, the bias counted
//! among the inputs. What learns by batches has the values of f32 in `forward`, and their slopes in `filter/kronecker/gradient`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math;

/// What hidden neurons make of their sums; the output's is always logistic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// 1 / (1 + exp(-x)), the paper's (eq. 1).
    #[default]
    Logistic,
    /// max(0, x).
    Relu,
    /// Members take turns: the first is logistic, the second rectified.
    Both,
}

impl Activation {
    /// As configs name it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Activation::Logistic => "logistic",
            Activation::Relu => "relu",
            Activation::Both => "both",
        }
    }
}

/// What one layer's neurons make of their sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Neuron {
    Logistic,
    Rectified,
}

/// The logistic function (eq. 1) of several numbers; 0 or 1 where exp overflows or vanishes, NaN for NaN.
#[inline(always)]
pub(super) fn logistic<const N: usize>(x: &[f64; N]) -> [f64; N] {
    let mut values = *x;
    for value in &mut values {
        *value = -*value;
    }
    values = math::exp_lanes(&values);
    for value in &mut values {
        *value = 1.0 / (1.0 + *value);
    }
    values
}

impl Neuron {
    /// The values of several neurons from their sums; NaN stays.
    #[inline(always)]
    pub(crate) fn values<const N: usize>(self, sums: &[f64; N]) -> [f64; N] {
        match self {
            Neuron::Logistic => logistic(sums), // Eq. (1)
            Neuron::Rectified => sums.map(|sum| if sum < 0.0 { 0.0 } else { sum }),
        }
    }

    /// d value / d sum, of the value.
    #[inline(always)]
    pub(super) fn slope(self, value: f64) -> f64 {
        match self {
            Neuron::Logistic => value * (1.0 - value),
            Neuron::Rectified => f64::from(u8::from(value > 0.0)),
        }
    }

    /// Initial weights of a layer lie within this: of rectified neurons so that values keep their variance from layer to layer (He et al. 2015).
    pub(super) fn initial_bound(self, inputs: usize) -> f64 {
        match self {
            Neuron::Logistic => 1.5 / ((inputs + 1) as f64).sqrt(),
            Neuron::Rectified => (6.0 / (inputs + 1) as f64).sqrt(),
        }
    }
}
