//! A corpus -> what its owner should know before training on it: balance, feature ranges, dead features, odd scenes, and what makes it weak.

mod contents;
mod document;

use std::collections::BTreeMap;
use std::fmt;

use arrow_array::{Array, BooleanArray, Int64Array, RecordBatch, StringArray};

use schemars::JsonSchema;
use serde::Serialize;

use contents::Contents;
pub(crate) use document::{FeatureRange, InspectionDocument};

use super::advice::{Advice, CellGrid, Views, advise};
use super::manifest::{FeatureSummary, Manifest};
use super::stats::LabelCounts;
use super::{CorpusError, Finished, Split, Store, Table};

/// What `marsyard inspect` shows.
#[derive(Clone, Debug)]
pub struct Inspection {
    pub manifest: Manifest,
    pub features: Vec<FeatureReport>,
    /// By family; empty where the `scenes` table is off.
    pub families: BTreeMap<String, FamilyReport>,
    /// What makes the corpus weak for its own sensor and rover, with the key to turn; of shards of it where there are many.
    pub(crate) advice: Vec<Advice>,
    /// By family: what scans of those shards show of obstacles; empty where the `scenes` table is off.
    pub(crate) views: BTreeMap<String, Views>,
    /// Shards whose cells were read for that.
    shards_read: usize,
    /// What could not be checked.
    unchecked: Vec<String>,
}

/// A feature of the train split.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureReport {
    pub summary: FeatureSummary,
    pub fault: Option<FeatureFault>,
}

/// Why a feature teaches nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeatureFault {
    Empty,
    Constant,
    NotFinite,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FamilyReport {
    pub scenes: u64,
    pub failed: u64,
    pub with_both_classes: u64,
    pub labels: LabelCounts,
}

/// Reads the manifest and the (small) `scenes` tables of a finished corpus, and some columns of the cells of some shards.
pub fn inspect(store: &dyn Store) -> Result<Inspection, CorpusError> {
    inspect_with(store, &BTreeMap::new())
}

/// The same where it is known how the cells of families lie, so that bearings can be told.
pub(crate) fn inspect_with(store: &dyn Store, grids: &BTreeMap<String, CellGrid>) -> Result<Inspection, CorpusError> {
    let corpus = Finished::open(store)?;
    let features = corpus.manifest.features.iter().map(FeatureReport::of).collect();
    let mut families = BTreeMap::new();
    let mut contents = Contents::of(&corpus.manifest.families, grids);
    let mut has_scenes = false;
    for line in &corpus.lines {
        let refused = |refused| corpus.refused(line, Table::Scenes, refused);
        let Some(table) = corpus.open_table(line, Table::Scenes).map_err(refused)? else { continue };
        for batch in table.batches() {
            let batch = batch?;
            add_scenes(&batch, &mut families);
            contents.add_scenes(&batch, line.split).map_err(|reason| table.odd(reason))?;
            has_scenes = true;
        }
    }
    let (contents, shards_read) = if has_scenes { contents.with_cells(&corpus)? } else { (Vec::new(), 0) };
    let Finished { manifest, unchecked, .. } = corpus;
    let advice = advise(&contents);
    let views = contents.into_iter().map(|content| (content.family, content.views)).collect();
    Ok(Inspection { manifest, features, families, advice, views, shards_read, unchecked })
}

impl FeatureReport {
    pub(crate) fn of(summary: &FeatureSummary) -> FeatureReport {
        FeatureReport { fault: fault(summary), summary: summary.clone() }
    }
}

fn fault(summary: &FeatureSummary) -> Option<FeatureFault> {
    let moments = &summary.moments;
    if moments.not_finite > 0 {
        Some(FeatureFault::NotFinite)
    } else if moments.count == 0 {
        Some(FeatureFault::Empty)
    } else {
        moments.is_constant().then_some(FeatureFault::Constant)
    }
}

fn add_scenes(batch: &RecordBatch, families: &mut BTreeMap<String, FamilyReport>) {
    fn column<'a, T: 'static>(batch: &'a RecordBatch, name: &str) -> Option<&'a T> {
        batch.column_by_name(name)?.as_any().downcast_ref::<T>()
    }
    let count = |name: &str, row: usize| column::<Int64Array>(batch, name).map_or(0, |column| column.value(row) as u64);
    let text =
        |name: &str, row: usize| column::<StringArray>(batch, name).map_or("", |column| column.value(row)).to_string();
    for row in 0..batch.num_rows() {
        let family = families.entry(text("family", row)).or_default();
        family.scenes += 1;
        family.failed += u64::from(text("status", row) == "failed");
        family.with_both_classes +=
            u64::from(column::<BooleanArray>(batch, "both_classes").is_some_and(|c| c.value(row)));
        family.labels = family.labels
            + LabelCounts {
                traversable: count("cells_traversable", row),
                untraversable: count("cells_untraversable", row),
                unknown: count("cells_unknown", row),
            };
    }
}

impl Inspection {
    /// What should be put right before training; empty where all is well.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let mut warnings = self.unchecked.clone();
        for feature in &self.features {
            let name = &feature.summary.name;
            warnings.extend(feature.fault.map(|fault| match fault {
                FeatureFault::Empty => format!("{name} has no value in the train split"),
                FeatureFault::Constant => {
                    format!("{name} is always {}: it teaches nothing", feature.summary.moments.mean)
                }
                FeatureFault::NotFinite => {
                    format!("{name} is NaN or infinite in {} train cells", feature.summary.moments.not_finite)
                }
            }));
        }
        for (split, totals) in &self.manifest.splits {
            let name = split.name();
            if totals.shards == 0 {
                warnings.push(format!(
                    "the {name} split is empty: there is one shard in each from 7 shards on; raise scenes (`--set scenes=N`, \
                     the shards that are there stay) or lower scenes_per_shard"));
            } else if totals.labels.traversable == 0 || totals.labels.untraversable == 0 {
                warnings.push(format!("the {name} split lacks one of the two classes"));
            }
        }
        if !self.manifest.points.add_up() {
            warnings.push("points in are not points binned plus points dropped and left out".into());
        }
        let failed = self.manifest.failed.len();
        if failed > 0 {
            warnings.push(format!(
                "{failed} of {} scenes failed; replay: {}",
                self.manifest.scenes, self.manifest.failed[0].replay
            ));
        }
        warnings
    }
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let manifest = &self.manifest;
        writeln!(f, "{}  seed {}  corpus_id {}", manifest.name, manifest.seed, &manifest.corpus_id)?;
        writeln!(f, "{} scenes in {} shards, {} failed", manifest.scenes, manifest.shards, manifest.failed.len())?;
        for (table, totals) in &manifest.tables {
            writeln!(f, "  {:<7} {:>12} rows  {:>10.1} MB", table.name(), totals.rows, totals.bytes as f64 / 1e6)?;
        }
        let points = manifest.points;
        writeln!(
            f,
            "points: {} in, {} binned, {} beyond range, {} off the grid{}",
            points.points_in,
            points.binned,
            points.beyond_range,
            points.off_grid,
            points.words_left_out()
        )?;
        writeln!(
            f,
            "\n{:<12} {:>7} {:>8} {:>12} {:>13} {:>9} {:>7}",
            "split", "shards", "scenes", "traversable", "untraversable", "unknown", "share"
        )?;
        for split in Split::ALL {
            let Some(totals) = manifest.splits.get(&split) else { continue };
            write!(f, "{:<12} {:>7} {:>8} ", split.name(), totals.shards, totals.scenes)?;
            balance(f, &totals.labels)?;
        }
        if !self.families.is_empty() {
            writeln!(
                f,
                "\n{:<12} {:>7} {:>8} {:>12} {:>13} {:>9} {:>7}",
                "family", "scenes", "failed", "traversable", "untraversable", "unknown", "share"
            )?;
            for (name, family) in &self.families {
                write!(f, "{:<12} {:>7} {:>8} ", name, family.scenes, family.failed)?;
                balance(f, &family.labels)?;
            }
        }
        let width = self.features.iter().map(|feature| feature.summary.name.len()).max().unwrap_or(0).max(24);
        writeln!(
            f,
            "\n{:<width$} {:<5} {:>12} {:>12} {:>12} {:>12}  train split",
            "feature", "unit", "min", "mean", "sd", "max"
        )?;
        for report in &self.features {
            let (FeatureReport { summary, fault }, range) = (report, FeatureRange::from(report));
            let note = fault.map_or("", |fault| match fault {
                FeatureFault::Empty => "  EMPTY",
                FeatureFault::Constant => "  CONSTANT",
                FeatureFault::NotFinite => "  NOT FINITE",
            });
            let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.5}"));
            let (name, unit) = (&summary.name, &summary.unit);
            let [min, mean, sd, max] = [range.min, range.mean, range.sd, range.max].map(number);
            writeln!(f, "{name:<width$} {unit:<5} {min:>12} {mean:>12} {sd:>12} {max:>12}{note}")?;
        }
        let warnings = self.warnings();
        if !warnings.is_empty() {
            writeln!(f)?;
        }
        warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))?;
        let mut views = Views::default();
        self.views.values().for_each(|of_family| views += of_family);
        if views.scans > 0 {
            write!(f, "\n{views}")?;
        }
        if !self.advice.is_empty() {
            writeln!(f, "\nby the cells of {} of {} shards:", self.shards_read, self.manifest.shards)?;
        }
        self.advice.iter().try_for_each(|advice| writeln!(f, "{advice}"))
    }
}

fn balance(f: &mut fmt::Formatter<'_>, labels: &LabelCounts) -> fmt::Result {
    let share = labels.untraversable_share().map_or("-".into(), |share| format!("{:.2} %", 100.0 * share));
    writeln!(f, "{:>12} {:>13} {:>9} {share:>7}", labels.traversable, labels.untraversable, labels.unknown)
}
