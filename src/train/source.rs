//! Finished corpora -> what a trainer reads of them: which files and row groups, and their rows.
//!
//! The corpus is opened once, by its one door; of each shard a few dozen bytes are kept. A shard's size and sha256 and whose it says
//! it is are checked when it is first opened, so that a truncated, damaged or foreign file is never learnt from.

mod open_file;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::feature_choice::{choose, unit_of};
use super::{FeatureSet, TrainError};
use crate::cells::{LabelRule, is_gap};
use crate::corpus::belongs::ShardIdentity;
use crate::corpus::checked::{Expected, Refused};
use crate::corpus::manifest::{FeatureSummary, ShardLine};
use crate::corpus::reader::TableFile;
use crate::corpus::stats::LabelCounts;
use crate::corpus::{Finished, Split, Store, Table, Yards};

/// One corpus.
pub struct Source {
    store: Arc<dyn Store>,
    pub name: String,
    pub corpus_id: String,
    pub scene_plan_hash: String,
    pub manifest_sha256: String,
    /// Where the manifest does not say which they are (format 1), whoever has the plan may.
    pub yards: Yards,
    /// Of `shards.jsonl`.
    pub shards_sha256: String,
    /// What could not be checked of it, for people.
    pub unchecked: Vec<String>,
    /// How much one of its rows counts, against a row of another corpus.
    pub weight: f64,
    /// Of the train split.
    pub features: Vec<FeatureSummary>,
    labels: [LabelCounts; 3],
    files: [Vec<ShardFile>; 3],
}

/// The `cells` file of one shard.
struct ShardFile {
    shard: u64,
    scenes: std::ops::Range<u64>,
    rows: u64,
    bytes: u64,
    row_groups: u32,
    sha256: String,
    value_hash: String,
    verified: AtomicBool,
}

/// The address of a row group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Group {
    pub source: u16,
    pub file: u32,
    pub group: u32,
}

/// The address of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneAddress {
    pub source: u16,
    pub file: u32,
    pub scene: u64,
}

impl Source {
    pub fn open(store: &dyn Store, weight: f64) -> Result<Source, TrainError> {
        let Finished { manifest, manifest_sha256, shards_sha256, lines, unchecked, .. } = Finished::open(store)?;
        let mut files: [Vec<ShardFile>; 3] = Default::default();
        for line in lines {
            let ShardLine { shard, split, tables, scenes: [first, end], .. } = line;
            if let Some(facts) = tables.get(&Table::Cells) {
                files[at(split)].push(ShardFile {
                    shard,
                    scenes: first..end,
                    rows: facts.rows,
                    bytes: facts.bytes,
                    row_groups: facts.row_groups,
                    sha256: facts.sha256.clone(),
                    value_hash: facts.value_hash.clone(),
                    verified: AtomicBool::new(false),
                });
            }
        }
        if !manifest.tables.contains_key(&Table::Cells) {
            return Err(TrainError::NoCells { place: store.place() });
        }
        Ok(Source {
            yards: manifest.yards(),
            store: store.share(),
            labels: Split::ALL.map(|split| manifest.splits.get(&split).map(|s| s.labels).unwrap_or_default()),
            name: manifest.name,
            corpus_id: manifest.corpus_id,
            scene_plan_hash: manifest.scene_plan_hash,
            manifest_sha256,
            shards_sha256,
            unchecked,
            weight,
            features: manifest.features,
            files,
        })
    }

    pub(crate) fn place(&self) -> String {
        self.store.place()
    }

    pub(crate) fn rows(&self, split: Split) -> u64 {
        self.files[at(split)].iter().map(|file| file.rows).sum()
    }

    /// Shards of a split that hold rows, by the hash of what is in their rows.
    pub(crate) fn shards_by_values(&self, split: Split) -> BTreeMap<String, u64> {
        let with_rows = self.files[at(split)].iter().filter(|file| file.rows > 0);
        with_rows.map(|file| (file.value_hash.clone(), file.shard)).collect()
    }

    pub(crate) fn shards(&self, split: Split) -> u64 {
        self.files[at(split)].len() as u64
    }

    /// Labels as the corpus has them.
    pub(crate) fn labels(&self, split: Split) -> LabelCounts {
        self.labels[at(split)]
    }

    /// The file, its bytes checked if nobody has done so before.
    fn open_file(&self, split: Split, file: &ShardFile) -> Result<TableFile, TrainError> {
        let name = path(split, file.shard);
        let ShardFile { shard, ref scenes, rows, bytes, row_groups, ref sha256, ref verified, .. } = *file;
        let (scene_plan_hash, scenes) = (&*self.scene_plan_hash, [scenes.start, scenes.end]);
        let identity = ShardIdentity { scene_plan_hash, shard, split, scenes };
        let expected = Expected { name: &name, bytes, sha256, rows, row_groups, table: Table::Cells, identity };
        let known = verified.load(Ordering::Acquire);
        let opened =
            if known { expected.open(self.store.as_ref()) } else { expected.open_checked(self.store.as_ref()) };
        let table = opened.map_err(|refused| self.fault(&name, refused))?;
        verified.store(true, Ordering::Release);
        Ok(table)
    }

    fn fault(&self, name: &str, refused: Refused) -> TrainError {
        match refused {
            Refused::Other(reason) => TrainError::Shard { place: self.place(), name: name.into(), reason },
            Refused::Store(error) => TrainError::Corpus(error),
        }
    }
}

fn path(split: Split, shard: u64) -> String {
    let path = Table::Cells.path(shard);
    debug_assert!(path.contains(split.name()));
    path
}

fn at(split: Split) -> usize {
    split as usize
}

/// All corpora of a run, and what is read of each.
pub struct Sources {
    pub list: Vec<Arc<Source>>,
    /// The inputs, in order.
    pub features: Vec<String>,
    pub rule: Option<LabelRule>,
    /// Cells without points, which some corpora hold, are left out: the features do not tell them from others.
    pub seen_alone: bool,
    /// What was told of scenes in two splits, where that was allowed.
    pub shared_scenes: Vec<String>,
}

impl Sources {
    pub fn new(list: Vec<Source>, set: &FeatureSet, rule: Option<LabelRule>) -> Result<Sources, TrainError> {
        rule.as_ref().map_or(Ok(()), LabelRule::check_answerable)?;
        for (i, source) in list.iter().enumerate() {
            if list[..i].iter().any(|other| other.corpus_id == source.corpus_id) {
                return Err(TrainError::Twice { place: source.place() });
            }
        }
        let features = choose(&list[0], set)?;
        if *set == FeatureSet::SeenUnseen && !features.iter().any(|name| is_gap(name)) {
            return Err(TrainError::NoGaps { place: list[0].place() });
        }
        let of_gaps = |source: &Source| source.features.iter().any(|feature| is_gap(&feature.name));
        let seen_alone = !features.iter().any(|name| is_gap(name)) && list.iter().any(of_gaps);
        for source in &list[1..] {
            for name in &features {
                let ours = unit_of(&list[0], name)?;
                let theirs = unit_of(source, name)?;
                if ours != theirs {
                    return Err(TrainError::Unlike {
                        place: source.place(),
                        other: list[0].place(),
                        what: format!("'{name}' is in {theirs} there and in {ours} here"),
                    });
                }
            }
            let names = |source: &Source| choose(source, set);
            if names(source)? != features {
                return Err(TrainError::Unlike {
                    place: source.place(),
                    other: list[0].place(),
                    what: format!(
                        "the features are {} there and {} here",
                        names(source)?.join(" "),
                        features.join(" ")
                    ),
                });
            }
        }
        let list = list.into_iter().map(Arc::new).collect();
        Ok(Sources { list, features, rule, seen_alone, shared_scenes: Vec::new() })
    }

    /// The same corpora, to read labels from and nothing else.
    pub(crate) fn labels_alone(&self) -> Sources {
        Sources {
            list: self.list.clone(),
            features: Vec::new(),
            rule: self.rule.clone(),
            seen_alone: self.seen_alone,
            shared_scenes: Vec::new(),
        }
    }

    /// Every row group of a split: corpus by corpus, shard by shard.
    pub fn groups(&self, split: Split) -> Vec<Group> {
        let mut groups = Vec::new();
        for (source, of) in self.list.iter().enumerate() {
            for (file, facts) in of.files[at(split)].iter().enumerate() {
                let group = |group| Group { source: source as u16, file: file as u32, group };
                groups.extend((0..facts.row_groups).map(group));
            }
        }
        groups
    }

    /// Every scene of a split that was to be built: corpus by corpus, shard by shard. Some may have no row.
    pub fn scenes(&self, split: Split) -> Vec<SceneAddress> {
        let mut scenes = Vec::new();
        for (source, of) in self.list.iter().enumerate() {
            for (file, facts) in of.files[at(split)].iter().enumerate() {
                let address = |scene| SceneAddress { source: source as u16, file: file as u32, scene };
                scenes.extend(facts.scenes.clone().map(address));
            }
        }
        scenes
    }

    pub(crate) fn rows(&self, split: Split) -> u64 {
        self.list.iter().map(|source| source.rows(split)).sum()
    }

    pub(crate) fn shards(&self, split: Split) -> u64 {
        self.list.iter().map(|source| source.shards(split)).sum()
    }
}
