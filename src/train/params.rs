//! A training config, as written and as checked.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Activation, Layout, Loss};
use crate::cells::LabelRule;
use crate::random::within;

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct TrainParams {
    /// Of initial weights and of the order of rows.
    #[garde(skip)]
    pub seed: u64,
    #[garde(dive)]
    pub network: NetworkParams,
    #[garde(dive)]
    pub filter: FilterParams,
    #[garde(dive)]
    pub features: FeatureSet,
    /// Whether the network sees the heights of neighbours above the cell's own, or above the rover as they are stored.
    #[garde(skip)]
    pub neighbours: Neighbours,
    /// Another rule for the labels, read off the corpus's `truth_` columns; absent = the corpus's own labels.
    #[garde(dive)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelRule>,
    /// Outputs for traversable and untraversable; default: [0.1, 0.9], where the loss is logarithmic [0, 1], by which the output is a probability (where `balance` is `classes`, as if both
    /// classes were as frequent).
    #[garde(inner(custom(within(0.0, 1.0))))]
    pub targets: [f64; 2],
    /// Ascending borders between classes of the output.
    #[garde(length(min = 1, max = 16), inner(custom(within(0.0, 1.0))))]
    pub thresholds: Vec<f64>,
    /// Weigh rows so that both classes count alike, or not at all (the paper).
    #[garde(skip)]
    pub balance: Balance,
    /// How the validation error that decides when training ends weighs the classes.
    #[garde(skip)]
    pub stop_by: StopBy,
    /// Scaled inputs are clipped to this.
    #[garde(custom(within(0.5, 1e6)))]
    pub clip: f64,
    /// Passes over the train split, at most.
    #[garde(range(min = 1, max = 100_000))]
    pub epochs: u32,
    /// Rows between two looks at the validation split; default: a tenth of a pass over the train split, so that what looks cost and what
    /// `patience` allows are shares of the corpus, however large it is; of small corpora 20,000 rows, but a fifth of a pass at most.
    #[garde(range(min = 1))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validate_every: Option<u64>,
    /// Looks before training ends in which the validation error does not fall by 1 %; default: 10, of a Kalman filter 5.
    #[garde(range(min = 1, max = 100_000))]
    pub patience: u32,
    /// Train even where there are fewer rows than weights.
    #[garde(skip)]
    pub allow_few_rows: bool,
    /// Train even where all rows have one label, so that there is nothing to learn but to say it.
    #[garde(skip)]
    pub allow_one_class: bool,
}

impl Default for TrainParams {
    fn default() -> Self {
        TrainParams {
            seed: 1,
            network: NetworkParams::default(),
            filter: FilterParams::default(),
            features: FeatureSet::Full,
            neighbours: Neighbours::AboveCell,
            labels: None,
            targets: [0.1, 0.9],
            thresholds: vec![0.5],
            balance: Balance::Classes,
            stop_by: StopBy::AsLearnt,
            clip: 8.0,
            epochs: 50,
            validate_every: None,
            patience: FilterParams::default().usual_patience(),
            allow_few_rows: false,
            allow_one_class: false,
        }
    }
}

impl TrainParams {
    /// By a filter, with the network, the targets and the patience that are usual for it.
    pub(crate) fn usual_of(filter: FilterParams) -> TrainParams {
        TrainParams {
            network: filter.usual_network(),
            patience: filter.usual_patience(),
            targets: filter.loss().usual_targets(),
            filter,
            ..TrainParams::default()
        }
    }

    /// Layers of a network that takes so many features.
    pub(crate) fn layout(&self, features: usize) -> Layout {
        let NetworkParams { hidden, bias, members, activation, normal_scores } = &self.network;
        let inputs = features * if *normal_scores { 2 } else { 1 };
        Layout { inputs, hidden: hidden.clone(), bias: *bias, members: *members, activation: *activation }
    }

    /// Rows between two looks at the validation split, of so many rows to learn.
    pub(crate) fn rows_between_looks(&self, rows: u64) -> u64 {
        self.validate_every.unwrap_or_else(|| (rows / 10).max((rows / 5).min(20_000))).max(1)
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct NetworkParams {
    /// Neurons of each hidden layer; where a Kalman filter is named and they are not, [16, 16].
    #[garde(length(min = 1, max = 8), inner(range(min = 1, max = 4096)))]
    pub hidden: Vec<usize>,
    /// A bias per neuron (the paper prints none).
    #[garde(skip)]
    pub bias: bool,
    /// Networks of these sizes that learn the same rows from other initial weights, side by side; the output is their mean, which errs
    /// less than each. Each costs a training's time, which threads share. Kalman filters learn one, and where one is named and this is not, it is 1.
    #[garde(range(min = 1, max = 64))]
    pub members: usize,
    /// What hidden neurons make of their sums; the output is logistic. Kalman filters learn logistic neurons.
    #[garde(skip)]
    pub activation: Activation,
    /// Whether the network takes each feature twice, standardised and as its normal score (the quantile of the standard normal distribution at the
    /// share of the train split's cells below it), in which cells that lie close together are told apart. Where a Kalman filter is named and this is not,
    /// it is false: its cost grows with the square of the weights.
    #[garde(skip)]
    pub normal_scores: bool,
}

impl Default for NetworkParams {
    fn default() -> Self {
        FilterParams::default().usual_network()
    }
}

/// Which columns are inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(rename_all = "snake_case")]
pub enum FeatureSet {
    /// The paper's list: 14 with 8 neighbours.
    Listed,
    /// Listed, the height above the ground around the cell where the corpus has it, and the sigmas of z, roll and pitch. Where the corpus
    /// has the plane around (`cells.local_height.plane`): with that, and without anything of the pose; where it has the curvature
    /// (`cells.curvature`) or the squares around (`cells.surroundings`) too: with those, and without heights above the rover and neighbours.
    /// Where it has the squares: without the height above the ground around. Where it has the beams (`cells.beams`): with those.
    Full,
    /// Full, and what beams know of gaps, over the cells without points too (`cells.unseen`); other sets leave those cells out unless
    /// they hold a `gap_` column.
    #[serde(rename = "seen+unseen")]
    SeenUnseen,
    /// Every feature column.
    All,
    /// These columns.
    Columns(#[garde(length(min = 1))] Vec<String>),
}

/// What the heights of neighbours are measured from. The step to a neighbour is what stops a wheel; heights above the rover hide it in
/// the height of the ground. Stored columns are above the rover either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Neighbours {
    AboveCell,
    /// As the paper has them.
    AboveRover,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Balance {
    /// R of a row is divided by its class's weight, so that both classes weigh alike.
    Classes,
    None,
}

/// How a look at the validation split weighs the classes. Where few cells hold an obstacle and rows are not weighed, the unweighted error is
/// lowest long before those cells are told apart: training that stops by it stops too early for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StopBy {
    /// As `balance` weighs the rows to learn.
    AsLearnt,
    /// Both classes alike, however the rows to learn are weighed.
    Classes,
}

impl TrainParams {
    /// How looks weigh the classes.
    pub(crate) fn look_balance(&self) -> Balance {
        match self.stop_by {
            StopBy::AsLearnt => self.balance,
            StopBy::Classes => Balance::Classes,
        }
    }
}

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
    /// What steps lower. Looks, patience and reports go by the squared error whatever the loss; with targets of 0 and 1 it is 1 / 0.64 times that with targets
    /// of 0.1 and 0.9.
    #[garde(skip)]
    pub loss: Loss,
}

impl Default for KroneckerParams {
    fn default() -> Self {
        KroneckerParams { rate: 0.005, loss: Loss::Squared }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_looks_are_a_share_of_the_corpus_and_of_small_ones_enough_rows_to_tell() {
        let every = |rows| TrainParams::default().rows_between_looks(rows);
        let expected = [(0, 1), (5, 1), (1000, 200), (100_000, 20_000), (150_000, 20_000), (200_000, 20_000)];
        assert_eq!(expected.map(|(rows, _)| every(rows)), expected.map(|(_, looks)| looks));
        assert_eq!((every(2_650_095), every(1_000_000_000)), (265_009, 100_000_000));
        let named = TrainParams { validate_every: Some(300), ..TrainParams::default() };
        assert_eq!(named.rows_between_looks(1_000_000_000), 300);
    }
}
