//! What is built: a corpus as its config resolved it, checked, with no file and no text.
//!
//! In: values that [`config`](crate::config) read, or that a program put together. Out: which family a scene belongs to, where its random
//! streams begin, which split a shard is, and the hashes by which two plans are told apart. Tables and splits have their names here; what
//! is in the tables' columns is the corpus's.

mod card;
mod fidelity;
mod labels;
mod split;

use std::collections::BTreeSet;

use serde::Serialize;
use serde_json::Value as Json;

use crate::cells::CellParams;
use crate::drive::DriveParams;
use crate::random::{Purpose, Stage, Streams};
use crate::scene::SceneParams;
use crate::slam::SlamParams;
use crate::sweep::SweepParams;

pub use card::CardParams;
pub use fidelity::Fidelity;
pub(crate) use labels::unlike_labels;
pub use split::{Split, Table};

/// The sections of a family, in the order of the flow.
pub const SECTIONS: [&str; 5] = ["scene", "drive", "sweep", "slam", "cells"];

/// A corpus, ready to build: presets written out, families resolved, rules checked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Version of the config format.
    pub marsyard: u32,
    pub name: String,
    pub seed: u64,
    pub scenes: u64,
    pub scenes_per_shard: u32,
    pub tables: Vec<Table>,
    /// `poses` holds the whole covariance of each estimate.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub pose_covariance: bool,
    /// The run fails when more than this share of its scenes fails.
    pub max_failed_share: f64,
    /// What was laid under the config's own keys; all of it is written out in the families.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fidelity: Option<Fidelity>,
    /// What the corpus's card says beside the plan; in no hash.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub card: Option<CardParams>,
    /// At least one; a config without families has one named `default`.
    pub families: Vec<Family>,
    /// Files that the plan names and `plan.yaml` needs beside it: their path there, and where they lie now.
    #[serde(skip)]
    pub files: Vec<PlanFile>,
}

/// A file (a height map) to be copied beside `plan.yaml`.
#[derive(Clone, Debug, Eq)]
pub struct PlanFile {
    /// Path relative to `plan.yaml`.
    pub path: String,
    /// Where it was read from.
    pub from: std::path::PathBuf,
}

/// Where a file lay before does not make a plan another one.
impl PartialEq for PlanFile {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path
    }
}

/// One kind of yard, rover and sensor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Family {
    pub name: String,
    pub weight: f64,
    /// Only test shards hold scenes of this family.
    pub hold_out: bool,
    pub scene: SceneParams,
    pub drive: DriveParams,
    pub sweep: SweepParams,
    pub slam: SlamParams,
    pub cells: CellParams,
}

impl Family {
    /// Whether train shards hold scenes of it.
    pub(crate) fn is_learnt(&self) -> bool {
        !self.hold_out && self.weight > 0.0
    }
}

impl Plan {
    pub fn shards(&self) -> u64 {
        self.scenes / u64::from(self.scenes_per_shard)
    }

    pub fn shard_of(&self, scene: u64) -> u64 {
        scene / u64::from(self.scenes_per_shard)
    }

    /// The address of a scene's draws in one stage.
    pub fn streams(&self, scene: u64, attempt: u32, stage: Stage) -> Streams {
        Streams { seed: self.seed, scene, attempt, stage, step: 0 }
    }

    /// The family a scene belongs to: drawn by weight; families that are held out are drawn in test shards alone.
    pub fn family_of(&self, scene: u64) -> &Family {
        &self.families[self.family_index_of(scene)]
    }

    /// As [`family_of`](Plan::family_of): its place among the families.
    pub fn family_index_of(&self, scene: u64) -> usize {
        let test = Split::of_shard(self.shard_of(scene)) == Split::Test;
        let open = || self.families.iter().enumerate().filter(|(_, f)| test || !f.hold_out);
        let total: f64 = open().map(|(_, f)| f.weight).sum();
        let mut left = self.streams(scene, 0, Stage::Plan).open(Purpose::Family).uniform(0) * total;
        for (index, family) in open() {
            left -= family.weight;
            if left < 0.0 {
                return index;
            }
        }
        open().next_back().expect("checked: at least one family is not held out").0
    }

    /// The share of the scenes that is expected of a family, by its place: of the test shards by weight, of the others by the weights of those that are
    /// not held out.
    pub(crate) fn expected_share(&self, family: usize) -> f64 {
        let test = (0..self.shards()).filter(|&shard| Split::of_shard(shard) == Split::Test).count() as f64;
        let test = test / self.shards() as f64;
        let share = |test: bool| {
            let open = |family: &&Family| test || !family.hold_out;
            let total: f64 = self.families.iter().filter(open).map(|family| family.weight).sum();
            Some(&self.families[family]).filter(open).map_or(0.0, |family| family.weight / total)
        };
        test * share(true) + (1.0 - test) * share(false)
    }

    /// Hash of the plan without `name` and `scenes`: the same for a corpus and the same corpus with more scenes. Nor does
    /// `fidelity` enter, a word for values that are all written out, nor `card`, which is about the corpus and not of its rows.
    ///
    /// ```
    /// # #[cfg(feature = "corpus")] {
    /// use std::path::Path;
    ///
    /// use marsyard::config;
    ///
    /// let load = |set: &str| config::load(Path::new("configs/quickstart.yaml"), &[set.to_string()]);
    /// let plan = load("scenes=1000")?;
    /// assert_eq!(load("scenes=2000")?.scene_plan_hash(), plan.scene_plan_hash());
    /// assert_ne!(load("seed=43")?.scene_plan_hash(), plan.scene_plan_hash());
    /// // Another sensor in the same yards: other rows, equal grounds.
    /// let spinning = load("sweep.sensor=os1-64")?;
    /// assert_ne!(spinning.scene_plan_hash(), plan.scene_plan_hash());
    /// assert_eq!(spinning.yards(), plan.yards());
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn scene_plan_hash(&self) -> String {
        let mut document = self.to_document();
        if let Some(entries) = document.as_object_mut() {
            entries.shift_remove("name");
            entries.shift_remove("scenes");
            entries.shift_remove("fidelity");
            entries.shift_remove("card");
        }
        // Keys in the order of the types, numbers in their shortest form: the same plan, the same bytes.
        blake3::hash(document.to_string().as_bytes()).to_hex().to_string()
    }

    /// Hashes of the kinds of yard that its families have, ascending.
    pub fn yards(&self) -> Vec<String> {
        let section =
            |family: &Family| serde_json::to_value(&family.scene).expect("a scene is finite numbers and text keys");
        let kinds: BTreeSet<String> = self.families.iter().map(|f| yard_kind(self.seed, &section(f))).collect();
        kinds.into_iter().collect()
    }

    /// Hash of all that makes the rows of a scene: equal where two corpora hold the same rows, be they cut into other shards. Where a
    /// family is held out the cut makes rows too: it says which scenes are in test shards, the only ones that the family may have.
    pub fn rows_hash(&self) -> String {
        let held_out = self.families.iter().any(|family| family.hold_out);
        let scenes_per_shard = if held_out { self.scenes_per_shard } else { 1 };
        let tables = Vec::new();
        let plan = Plan { scenes_per_shard, tables, pose_covariance: false, max_failed_share: 0.0, ..self.clone() };
        plan.scene_plan_hash()
    }

    /// The plan in the form of a document, every default written out. One family named `default` is the document's own sections.
    pub fn to_document(&self) -> Json {
        let plan = serde_json::to_value(self).expect("a plan holds finite numbers and text keys");
        let Json::Object(mut document) = plan else { unreachable!("a struct is an object") };
        let is_default = |family: &Family| family.name == "default" && family.weight == 1.0 && !family.hold_out;
        if let [family] = self.families.as_slice()
            && is_default(family)
        {
            let families = document.shift_remove("families");
            if let Some(Json::Object(sections)) = families.and_then(|mut list| list.get_mut(0).map(Json::take)) {
                document.extend(sections.into_iter().filter(|(key, _)| SECTIONS.contains(&key.as_str())));
            }
        }
        document.into()
    }
}

/// The hash of a kind of yard: scenes of equal number and kind stand on the same ground, whatever drives and scans them.
pub(crate) fn yard_kind(seed: u64, scene_section: &Json) -> String {
    blake3::hash(serde_json::json!({"seed": seed, "scene": scene_section}).to_string().as_bytes()).to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::config;

    #[test]
    fn statistics_families_have_the_share_of_scenes_that_is_expected_of_them() {
        let scenes = 40_000;
        let plan =
            config::load(Path::new("configs/mixed.yaml"), &[format!("scenes={scenes}")]).expect("a shipped config");
        let mut counts = vec![0u32; plan.families.len()];
        (0..scenes).for_each(|scene| counts[plan.family_index_of(scene)] += 1);
        let expected: Vec<f64> = (0..counts.len()).map(|family| plan.expected_share(family)).collect();
        assert!((expected.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for (count, share) in counts.into_iter().zip(expected) {
            // Five standard deviations of a binomial, of fifteen families.
            let bound = 5.0 * (share * (1.0 - share) / scenes as f64).sqrt();
            assert!((f64::from(count) / scenes as f64 - share).abs() < bound, "{count} for {share}");
        }
    }
}
