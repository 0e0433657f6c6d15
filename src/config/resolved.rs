//! A checked plan -> its text, and what the corpus is told of it.

use std::collections::BTreeSet;

use super::write::yaml;
use crate::cells::{CellParams, feature_columns, loss_columns, truth_columns};
use crate::corpus::CorpusSpec;
use crate::corpus::card::FamilyCard;
use crate::plan::Plan;
use crate::random::Purpose;

impl Plan {
    /// The whole plan as a document: every default written out, presets in place. [`load`](super::load) gives the same plan.
    pub fn to_yaml(&self) -> String {
        format!("# The resolved config: every default written out.\n{}", yaml(&self.to_document()))
    }

    /// What the corpus needs to know of the plan.
    pub fn corpus_spec(&self) -> CorpusSpec {
        let first = &self.families[0];
        let drawn: BTreeSet<Purpose> = self
            .families
            .iter()
            .flat_map(|f| f.scene.dists().into_iter().chain(f.drive.dists()).chain(f.sweep.dists()))
            .map(|(purpose, _)| purpose)
            .collect();
        let cells: Vec<&CellParams> = self.families.iter().map(|family| &family.cells).collect();
        CorpusSpec {
            name: self.name.clone(),
            seed: self.seed,
            scenes: self.scenes,
            scenes_per_shard: self.scenes_per_shard,
            tables: self.tables.clone(),
            // Checked by the rules: the same for all families.
            features: feature_columns(&first.cells, first.sweep.effects.intensity.is_some()),
            pose_covariance: self.pose_covariance,
            by_rover: first.cells.labels.rover.is_some(),
            poses: first.cells.labels.rover.as_ref().is_some_and(|rule| rule.pose),
            truth: truth_columns(&first.cells),
            losses: loss_columns(&cells),
            drawn: drawn.into_iter().collect(),
            families: self.families.iter().map(|f| f.name.clone()).collect(),
            scene_plan_hash: self.scene_plan_hash(),
            yards: self.yards(),
            plan_yaml: self.to_yaml(),
            card: self.card.clone().unwrap_or_default(),
            facts: self.families.iter().map(FamilyCard::of).collect(),
        }
    }
}
