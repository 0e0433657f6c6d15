//! What the corpus is told of the plan.

use super::Table;
use super::card::FamilyCard;
use super::schema::{self, Column};
use crate::cells::{FeatureColumn, LossColumn, TruthColumn};
use crate::plan::CardParams;
use crate::random::Purpose;

/// What the plan says of the corpus as a whole.
#[derive(Clone, Debug)]
pub struct CorpusSpec {
    pub name: String,
    pub seed: u64,
    pub scenes: u64,
    pub scenes_per_shard: u32,
    pub tables: Vec<Table>,
    /// The feature columns of `cells`, in order; the same for all families.
    pub features: Vec<FeatureColumn>,
    /// `poses` holds the whole covariance of each estimate.
    pub pose_covariance: bool,
    /// Cells are labelled by a rover, and have its columns.
    pub by_rover: bool,
    /// The rover is set down in each of them too.
    pub poses: bool,
    /// The truth columns of `cells` that only some configs have, behind the features; the same for all families.
    pub truth: Vec<TruthColumn>,
    /// The counts of points left out that only some configs have, behind the fixed columns of `scenes`.
    pub losses: Vec<LossColumn>,
    /// What is drawn once per scene, of all families: the last columns of `scenes`, in the order of the register.
    pub drawn: Vec<Purpose>,
    pub families: Vec<String>,
    /// Hash of the resolved plan without `name` and `scenes`, hexadecimal.
    pub scene_plan_hash: String,
    /// Hashes of the kinds of yard, ascending: see [`Yards`](super::Yards).
    pub yards: Vec<String>,
    /// The resolved plan as text.
    pub plan_yaml: String,
    /// Licence, authors and citation.
    pub card: CardParams,
    /// What its card says of each family.
    pub facts: Vec<FamilyCard>,
}

impl CorpusSpec {
    /// The columns of a table, in order.
    pub(crate) fn columns(&self, table: Table) -> Vec<Column> {
        let asked = [self.by_rover, self.poses, self.pose_covariance];
        schema::columns(table, &self.features, &self.truth, &self.losses, &self.drawn, asked)
    }

    /// Whole shards of the plan; `scenes` is a multiple of `scenes_per_shard`.
    pub(crate) fn shards(&self) -> u64 {
        self.scenes.div_ceil(u64::from(self.scenes_per_shard.max(1)))
    }

    /// The scenes of a shard, half open.
    pub(crate) fn scenes_of(&self, shard: u64) -> std::ops::Range<u64> {
        let size = u64::from(self.scenes_per_shard);
        shard * size..((shard + 1) * size).min(self.scenes)
    }
}
