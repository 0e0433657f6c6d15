//! A training config, as written and as checked.

mod filter;

pub use filter::{
    BackpropParams, ByErrorParams, DecoupledParams, EkfParams, FilterParams, Groups, KroneckerParams, NoiseParams,
    Precision, RowsLearnt, Schedule, UkfParams,
};

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Activation, Layout};
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
    /// Outputs for traversable and untraversable; default: [0, 1] of the logarithmic loss, by which the output is a probability (where `balance` is `classes`, as if both
    /// classes were as frequent); [0.1, 0.9] of the squared error and of Kalman filters.
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
            targets: FilterParams::default().loss().usual_targets(),
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
    /// Listed, and the height above the ground around the cell where the corpus has it. Where the corpus
    /// has the plane around (`cells.local_height.plane`): with that, and without pitch and roll; where it has the curvature
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
