//! What learns, as `filter` of a training config names it, and what follows from it for the network, the looks and the portions of rows.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::NetworkParams;
use crate::random::within;
use crate::train::{Activation, Loss};

/// What learns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FilterParams {
    /// Mini-batches, and steps in the eigenvectors of a Kronecker-factored covariance of their gradients: for networks of any size.
    Kronecker(#[garde(dive)] KroneckerParams),
    /// The extended Kalman filter with one group of weights (the paper's).
    Ekf(#[garde(dive)] EkfParams),
    /// Groups of weights with a covariance each.
    Decoupled(#[garde(dive)] DecoupledParams),
    /// Gradient steps: the EKF under the paper's two assumptions (eqs 17 and 18).
    Backprop(#[garde(dive)] BackpropParams),
    /// The square-root unscented filter, for small networks.
    Ukf(#[garde(dive)] UkfParams),
}

impl Default for FilterParams {
    fn default() -> Self {
        FilterParams::Kronecker(KroneckerParams::default())
    }
}

impl FilterParams {
    /// Whether rows are learnt by batches, at a cost that grows with the weights and not with their square, and the network is an average.
    pub(crate) fn learns_by_batches(&self) -> bool {
        match self {
            FilterParams::Kronecker(_) => true,
            FilterParams::Ekf(_) | FilterParams::Decoupled(_) | FilterParams::Backprop(_) | FilterParams::Ukf(_) => {
                false
            }
        }
    }

    /// What it lowers.
    pub(crate) fn loss(&self) -> Loss {
        match self {
            FilterParams::Kronecker(params) => params.loss,
            FilterParams::Ekf(_) | FilterParams::Decoupled(_) | FilterParams::Backprop(_) | FilterParams::Ukf(_) => {
                Loss::Squared
            }
        }
    }

    /// The network where a config names none: a Kalman filter's cost grows with the square of the weights, and its network is the paper's.
    pub(crate) fn usual_network(&self) -> NetworkParams {
        let by_batches = self.learns_by_batches();
        let (hidden, members) = if by_batches { (vec![64, 64], 2) } else { (vec![16, 16], 1) };
        NetworkParams { hidden, bias: true, members, activation: Activation::Logistic, normal_scores: by_batches }
    }

    /// Looks without an improvement that end training where a config names no number.
    pub(crate) fn usual_patience(&self) -> u32 {
        if self.learns_by_batches() { 10 } else { 5 }
    }

    /// The share of the validation error that is taken for noise when the best look is chosen. An average of weights moves little from
    /// look to look, and what it gains on other yards goes on when the validation yards tell nothing any more; the Kalman filters go back to the
    /// minimum, as the paper has it.
    pub(crate) fn look_noise(&self) -> f64 {
        if self.learns_by_batches() { 0.05 } else { 0.0 }
    }

    /// Rows of a look, and nearly twice as many at most, where so many are learnt between two: of those that the manifests count. A row that
    /// is looked at costs a third of one that is learnt by batches, and a thirtieth of one that a Kalman filter learns; fewer than
    /// 10,000 tell too little, more than 50,000 no more, for it is the scenes that differ.
    pub(crate) fn look_rows(&self, validate_every: u64) -> u64 {
        if self.learns_by_batches() { (validate_every / 8).clamp(10_000, 50_000) } else { 50_000 }
    }

    /// Rows of a portion: two of the largest batches; or few, so that the errors by which rows are selected are of the network as it
    /// nearly is.
    pub(crate) fn portion_rows(&self) -> usize {
        if self.learns_by_batches() { 1024 } else { 256 }
    }

    /// Portions that it is handed at once where threads share the work: what learns on one thread is handed them one by one.
    pub(crate) fn portions_at_once(&self) -> usize {
        if self.learns_by_batches() { 4 } else { 1 }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct KroneckerParams {
    /// Size of a step, each direction in units of its gradients' root mean square.
    #[garde(custom(within(1e-6, 1.0)))]
    pub rate: f64,
    /// What steps lower; default: `logarithmic`, which ranks cells of ground that was never seen far better than the squared error of the paper and errs as little at 0.5. Looks, patience
    /// and reports go by the squared error whatever the loss; with targets of 0 and 1 it is 1 / 0.64 times that with targets of 0.1 and 0.9.
    #[garde(skip)]
    pub loss: Loss,
}

impl Default for KroneckerParams {
    fn default() -> Self {
        KroneckerParams { rate: 0.005, loss: Loss::Logarithmic }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct EkfParams {
    #[garde(dive)]
    pub noise: NoiseParams,
    /// Type of the covariance.
    #[garde(skip)]
    pub precision: Precision,
    /// Bierman's factored form: slower, and sound at any setting.
    #[garde(skip)]
    pub robust: bool,
    /// Rows learnt together.
    #[garde(range(min = 1, max = 64))]
    pub batch: usize,
    /// Which rows are learnt: an update costs the same whatever the row teaches.
    #[garde(dive)]
    pub rows: RowsLearnt,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RowsLearnt {
    /// Those that the network errs on, and of the others a share, drawn; a row that had the probability p counts 1 / p fold, so that the
    /// expectation stays what it is with every row.
    ByError(#[garde(dive)] ByErrorParams),
    /// All: the exact filter (the paper's).
    Every,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct ByErrorParams {
    /// A row whose output is off by this or more is always learnt; the probability of others falls with their error.
    #[garde(custom(within(1e-6, 1.0)))]
    pub full_error: f64,
    /// Least probability; its inverse is the most that a row counts.
    #[garde(custom(within(1e-3, 1.0)))]
    pub floor: f64,
}

impl Default for ByErrorParams {
    fn default() -> Self {
        ByErrorParams { full_error: 0.2, floor: 0.05 }
    }
}

impl Default for EkfParams {
    fn default() -> Self {
        EkfParams {
            noise: NoiseParams::default(),
            precision: Precision::F32,
            robust: false,
            batch: 1,
            rows: RowsLearnt::ByError(ByErrorParams::default()),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    F32,
    F64,
}

/// Only ratios matter: P0 / R, and Q / R.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseParams {
    /// Initial variance of a weight over R.
    #[garde(custom(within(1e-9, 1e12)))]
    pub p0_over_r: f64,
    /// Process noise of a weight over R, added each update.
    #[garde(custom(within(0.0, 1e6)))]
    pub q_over_r: f64,
    #[garde(skip)]
    pub schedule: Schedule,
}

impl Default for NoiseParams {
    fn default() -> Self {
        NoiseParams { p0_over_r: 10.0, q_over_r: 0.0, schedule: Schedule::Constant }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Schedule {
    Constant,
    /// P0 = 100, R from 100 to 1 (time constant 4,000 rows), Q from 1e-2 to 1e-6.
    PuskoriusFeldkamp,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct DecoupledParams {
    #[garde(dive)]
    pub noise: NoiseParams,
    #[garde(skip)]
    pub precision: Precision,
    #[garde(skip)]
    pub groups: Groups,
}

impl Default for DecoupledParams {
    fn default() -> Self {
        DecoupledParams { noise: NoiseParams::default(), precision: Precision::F64, groups: Groups::Node }
    }
}

/// Weights that share a covariance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Groups {
    /// All: the EKF.
    One,
    Layer,
    /// Weights into one neuron.
    Node,
    /// Weights out of one node (the paper's suggestion).
    InputNode,
    /// Each weight alone.
    Weight,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct BackpropParams {
    /// Learning rate, eta.
    #[garde(custom(within(1e-9, 1e3)))]
    pub rate: f64,
}

impl Default for BackpropParams {
    fn default() -> Self {
        BackpropParams { rate: 0.5 }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct UkfParams {
    #[garde(dive)]
    pub noise: NoiseParams,
    #[garde(custom(within(1e-4, 1.0)))]
    pub alpha: f64,
    #[garde(custom(within(0.0, 10.0)))]
    pub beta: f64,
}

impl Default for UkfParams {
    fn default() -> Self {
        UkfParams { noise: NoiseParams::default(), alpha: 1.0, beta: 2.0 }
    }
}
