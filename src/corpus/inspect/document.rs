//! An inspection -> one JSON document for programs: all that `marsyard inspect` tells, under keys that stay.
//!
//! `schemas/inspection.schema.json` is made of these types. Keys may be added; none changes its meaning within a `format`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::{FamilyReport, FeatureFault, FeatureReport, Inspection};
use crate::corpus::advice::{Advice, Views};
use crate::corpus::manifest::{FailedEntry, OtherBuild, SplitTotals, TableTotals};
use crate::corpus::stats::{LabelCounts, PointCounts};
use crate::corpus::{Build, Split, Table};

/// Version of the document.
pub(crate) const FORMAT: u32 = 1;

/// What `marsyard inspect --json` prints.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(crate) struct InspectionDocument {
    /// Version of this document: 1.
    pub format: u32,
    pub name: String,
    pub seed: u64,
    pub corpus_id: String,
    pub scene_plan_hash: String,
    pub scenes: u64,
    pub scenes_per_shard: u32,
    pub shards: u64,
    /// The scenes that gave no rows.
    pub failed: Vec<FailedEntry>,
    pub tables: BTreeMap<Table, TableTotals>,
    /// Where the points of the kept scans went.
    pub points: PointCounts,
    pub splits: BTreeMap<Split, SplitBalance>,
    /// By name; empty where the `scenes` table is off.
    pub families: BTreeMap<String, FamilyBalance>,
    /// Of the train split.
    pub features: Vec<FeatureRange>,
    /// The program that wrote shard 0.
    pub build: Build,
    /// Programs that wrote other shards.
    pub other_builds: Vec<OtherBuild>,
    /// What should be put right before training, in words; empty where all is well.
    pub warnings: Vec<String>,
    /// What makes the corpus weak for its own sensor and rover, with the key to turn; by the cells of `shards_read` shards.
    pub advice: Vec<Advice>,
    pub shards_read: usize,
    /// By family: histograms of what the scans of those shards show of obstacles; bearings are counted where the `poses` table is on.
    pub views: BTreeMap<String, Views>,
}

/// A split: its size and its labels.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(crate) struct SplitBalance {
    #[serde(flatten)]
    pub totals: SplitTotals,
    /// Untraversable cells over cells with a known label; null where there is none.
    pub untraversable_share: Option<f64>,
}

/// A family: its scenes and its labels.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(crate) struct FamilyBalance {
    pub scenes: u64,
    pub failed_scenes: u64,
    /// Scenes of which a kept scan holds traversable and untraversable cells.
    pub with_both_classes: u64,
    pub labels: LabelCounts,
    /// Untraversable cells over cells with a known label; null where there is none.
    pub untraversable_share: Option<f64>,
}

/// A feature of the train split.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(crate) struct FeatureRange {
    pub name: String,
    /// SI, or "1".
    pub unit: String,
    /// Finite values.
    pub count: u64,
    /// Values that are NaN or infinite.
    pub not_finite: u64,
    /// Null where nothing was counted, as are the next three.
    pub mean: Option<f64>,
    /// Standard deviation of the population.
    pub sd: Option<f64>,
    pub min: Option<f64>,
    pub max: Option<f64>,
    /// Why the feature teaches nothing: empty, constant or not_finite; null where it does.
    pub fault: Option<FeatureFault>,
}

impl From<&FeatureReport> for FeatureRange {
    fn from(report: &FeatureReport) -> FeatureRange {
        let (summary, moments) = (&report.summary, &report.summary.moments);
        let known = |value: f64| (moments.count > 0).then_some(value);
        FeatureRange {
            name: summary.name.clone(),
            unit: summary.unit.clone(),
            count: moments.count,
            not_finite: moments.not_finite,
            mean: known(moments.mean),
            sd: known(moments.variance().sqrt()),
            min: moments.min,
            max: moments.max,
            fault: report.fault,
        }
    }
}

impl From<&FamilyReport> for FamilyBalance {
    fn from(family: &FamilyReport) -> FamilyBalance {
        let FamilyReport { scenes, failed, with_both_classes, labels } = *family;
        let untraversable_share = labels.untraversable_share();
        FamilyBalance { scenes, failed_scenes: failed, with_both_classes, labels, untraversable_share }
    }
}

impl Inspection {
    /// The same for programs.
    pub(crate) fn document(&self) -> InspectionDocument {
        let manifest = &self.manifest;
        let balance = |totals: &SplitTotals| SplitBalance {
            totals: totals.clone(),
            untraversable_share: totals.labels.untraversable_share(),
        };
        InspectionDocument {
            format: FORMAT,
            name: manifest.name.clone(),
            seed: manifest.seed,
            corpus_id: manifest.corpus_id.clone(),
            scene_plan_hash: manifest.scene_plan_hash.clone(),
            scenes: manifest.scenes,
            scenes_per_shard: manifest.scenes_per_shard,
            shards: manifest.shards,
            failed: manifest.failed.clone(),
            tables: manifest.tables.clone(),
            points: manifest.points,
            splits: manifest.splits.iter().map(|(&split, totals)| (split, balance(totals))).collect(),
            families: self.families.iter().map(|(name, family)| (name.clone(), family.into())).collect(),
            features: self.features.iter().map(FeatureRange::from).collect(),
            build: manifest.build.clone(),
            other_builds: manifest.other_builds.clone(),
            warnings: self.warnings(),
            advice: self.advice.clone(),
            shards_read: self.shards_read,
            views: self.views.clone(),
        }
    }
}
