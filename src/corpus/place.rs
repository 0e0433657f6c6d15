//! A place where a corpus is built: whose it is, which shards are there, and the merge of what many machines did.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use rayon::prelude::*;

use super::manifest::{self, Merge};
use super::receipt::{self, Receipt};
use super::shard::FinishedShard;
use super::{Build, CorpusError, CorpusSpec, Manifest, Store, Table, card, croissant, ranges};

const PLAN: &str = "plan.yaml";
const PLAN_HEAD: &str = "# scene_plan_hash: ";

/// A place that belongs to the plan.
pub struct Place<'a> {
    store: &'a dyn Store,
    spec: &'a CorpusSpec,
}

impl<'a> Place<'a> {
    /// Takes an empty place for the plan, or goes on in one that is the plan's already.
    ///
    /// `name` and `scenes` may differ from the last time: a corpus may be renamed and may grow. Anything else is another
    /// corpus and is refused with the difference.
    pub fn open(store: &'a dyn Store, spec: &'a CorpusSpec) -> Result<Place<'a>, CorpusError> {
        let text = format!("{PLAN_HEAD}{}\n{}", spec.scene_plan_hash, spec.plan_yaml);
        if store.size(PLAN)?.is_some() {
            let there = String::from_utf8_lossy(&store.read(PLAN)?).into_owned();
            let (hash, plan) = there
                .strip_prefix(PLAN_HEAD)
                .and_then(|rest| rest.split_once('\n'))
                .ok_or_else(|| CorpusError::ForeignPlan { place: store.place() })?;
            if there == text {
                return Ok(Place { store, spec });
            }
            if hash.trim() != spec.scene_plan_hash {
                return Err(CorpusError::OtherPlan {
                    place: store.place(),
                    there: hash.trim().into(),
                    here: spec.scene_plan_hash.clone(),
                    difference: difference(plan, &spec.plan_yaml),
                });
            }
        }
        if let Some(&shard) = receipt::numbers(store)?.iter().find(|&&shard| shard >= spec.shards()) {
            return Err(CorpusError::BeyondPlan { place: store.place(), shard, shards: spec.shards() });
        }
        store.replace(PLAN, text.as_bytes())?;
        let place = Place { store, spec };
        place.sweep()?;
        Ok(place)
    }

    /// Removes what crashed builds left; what a live one is writing stays.
    fn sweep(&self) -> Result<(), CorpusError> {
        let data = Table::ALL.map(|table| format!("data/{}", table.name()));
        let folders = ["", receipt::FOLDER].into_iter().chain(data.iter().map(String::as_str));
        folders.into_iter().try_for_each(|folder| self.store.sweep_temporaries(folder))
    }

    /// Puts a shard, where the place is still the plan's: not removed, unmounted or taken by another since it was opened.
    pub fn commit(&self, shard: &FinishedShard) -> Result<(), CorpusError> {
        self.still_there()?;
        match shard.commit(self.store) {
            Ok(_) => Ok(()),
            Err(error) => self.still_there().and(Err(error)),
        }
    }

    /// Refuses to go on where the place is no longer the plan's.
    pub fn still_there(&self) -> Result<(), CorpusError> {
        match owner(self.store)? {
            Some(hash) if hash == self.spec.scene_plan_hash => Ok(()),
            _ => Err(CorpusError::Vanished { place: self.store.place() }),
        }
    }

    /// The shard is there, whole: its receipt, and every table with the size that the receipt says.
    pub fn is_done(&self, shard: u64) -> Result<bool, CorpusError> {
        Ok(matches!(shard_state(self.store, self.spec, shard)?, ShardState::Done(_)))
    }

    /// Removes a damaged shard, so that it can be built anew: the receipt first, so that no half of it is taken for whole.
    pub fn discard(&self, shard: u64) -> Result<(), CorpusError> {
        self.store.remove(&Receipt::path(shard))?;
        Table::ALL.iter().try_for_each(|table| self.store.remove(&table.path(shard)))
    }
}

/// The scene_plan_hash of the plan that a place belongs to, as the first line of its plan.yaml says; `None` where there is none.
pub fn owner(store: &dyn Store) -> Result<Option<String>, CorpusError> {
    if store.size(PLAN)?.is_none() {
        return Ok(None);
    }
    let head = store.read_range(PLAN, 0, PLAN_HEAD.len() + 64)?;
    let hash = std::str::from_utf8(&head).ok().and_then(|head| head.strip_prefix(PLAN_HEAD));
    Ok(hash.and_then(|hash| hash.lines().next()).map(|hash| hash.trim().to_string()))
}

enum ShardState {
    Done(Box<Receipt>),
    Missing,
    Damaged(String),
    OtherFormat(CorpusError),
}

fn shard_state(store: &dyn Store, spec: &CorpusSpec, shard: u64) -> Result<ShardState, CorpusError> {
    if store.size(&Receipt::path(shard))?.is_none() {
        return Ok(ShardState::Missing);
    }
    let receipt = match Receipt::read(store, shard, &spec.scene_plan_hash) {
        Ok(receipt) => receipt,
        Err(error @ CorpusError::BadReceipt { .. }) => return Ok(ShardState::Damaged(error.to_string())),
        Err(error @ CorpusError::OtherFormat { .. }) => return Ok(ShardState::OtherFormat(error)),
        // Removed since the line above, by a build that makes the shard anew.
        Err(CorpusError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
            return Ok(ShardState::Missing);
        }
        Err(error) => return Err(error),
    };
    for table in &spec.tables {
        let path = table.path(shard);
        let size = store.size(&path)?;
        let reason = match (receipt.tables.get(table), size) {
            (None, _) => format!("its receipt says nothing of {}", table.name()),
            (_, None) => format!("{path} is missing"),
            (Some(facts), Some(size)) if facts.bytes != size => {
                format!("{path} has {size} bytes, its receipt says {}", facts.bytes)
            }
            _ => continue,
        };
        return Ok(ShardState::Damaged(reason));
    }
    Ok(ShardState::Done(Box::new(receipt)))
}

/// Which shards of the plan are there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    pub place: String,
    pub shards: u64,
    pub done: Vec<u64>,
    pub missing: Vec<u64>,
    /// There, but not as the receipt says; and why.
    pub damaged: Vec<(u64, String)>,
    /// There, in a format that this program does not read: not damaged, so nothing to build anew; and why.
    pub other_format: Vec<(u64, String)>,
    /// Done, with scenes that failed.
    pub with_failed_scenes: Vec<u64>,
    pub failed_scenes: u64,
    /// Bytes of the shards that are done.
    pub bytes: u64,
    /// Programs that wrote the shards that are done, with how many.
    pub builds: Vec<(Build, u64)>,
}

impl Status {
    /// Shards to be built, ascending.
    pub fn to_build(&self) -> Vec<u64> {
        let all: BTreeSet<u64> =
            self.missing.iter().copied().chain(self.damaged.iter().map(|(shard, _)| *shard)).collect();
        all.into_iter().collect()
    }

    /// Shards without which there is no whole corpus, ascending.
    fn gaps(&self) -> Vec<u64> {
        let mut gaps = self.to_build();
        gaps.extend(self.other_format.iter().map(|(shard, _)| *shard));
        gaps.sort_unstable();
        gaps
    }

    fn add_done(&mut self, receipt: &Receipt) {
        self.done.push(receipt.shard);
        if !receipt.failed.is_empty() {
            self.with_failed_scenes.push(receipt.shard);
            self.failed_scenes += receipt.failed.len() as u64;
        }
        self.bytes += receipt.tables.values().map(|file| file.bytes).sum::<u64>();
        match self.builds.iter_mut().find(|(build, _)| *build == receipt.build) {
            Some((_, shards)) => *shards += 1,
            None => self.builds.push((receipt.build.clone(), 1)),
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = |shards: &[(u64, String)]| shards.iter().map(|(shard, _)| *shard).collect::<Vec<_>>();
        let (damaged, other) = (numbers(&self.damaged), numbers(&self.other_format));
        writeln!(f, "{}: {} shards", self.place, self.shards)?;
        for (word, shards) in [("done", &self.done), ("missing", &self.missing), ("damaged", &damaged)] {
            writeln!(f, "  {word:<8} {:>7}  {}", shards.len(), ranges::to_text(shards))?;
        }
        if !other.is_empty() {
            writeln!(f, "  other format {:>3}  {}", other.len(), ranges::to_text(&other))?;
        }
        let failed = (self.failed_scenes, ranges::to_text(&self.with_failed_scenes));
        writeln!(f, "  failed scenes {:>2}  in shards {}", failed.0, failed.1)?;
        self.damaged.iter().chain(&self.other_format).try_for_each(|(shard, why)| writeln!(f, "  shard {shard}: {why}"))
    }
}

/// Looks at every shard of the plan: receipts and sizes, no contents (`verify` reads those).
pub fn status(store: &dyn Store, spec: &CorpusSpec) -> Result<Status, CorpusError> {
    status_of(store, spec, &(0..spec.shards()).collect::<Vec<_>>())
}

/// Looks at some shards of the plan: a machine that builds a part need not look at all.
pub fn status_of(store: &dyn Store, spec: &CorpusSpec, shards: &[u64]) -> Result<Status, CorpusError> {
    survey(store, spec, shards, |_| ())
}

/// Receipts that are read at a time, on all threads.
const BLOCK: usize = 1024;

/// Looks at these shards, and shows the receipts of those that are done, in their order; few are in memory at a time.
fn survey(
    store: &dyn Store,
    spec: &CorpusSpec,
    shards: &[u64],
    mut done: impl FnMut(&Receipt),
) -> Result<Status, CorpusError> {
    let mut status = Status { place: store.place(), shards: spec.shards(), ..Status::default() };
    for block in shards.chunks(BLOCK) {
        let states: Vec<_> = block.par_iter().map(|&shard| shard_state(store, spec, shard)).collect();
        for (&shard, state) in block.iter().zip(states) {
            match state? {
                ShardState::Missing => status.missing.push(shard),
                ShardState::Damaged(reason) => status.damaged.push((shard, reason)),
                ShardState::OtherFormat(error) => status.other_format.push((shard, error.to_string())),
                ShardState::Done(receipt) => {
                    status.add_done(&receipt);
                    done(&receipt);
                }
            }
        }
    }
    Ok(status)
}

/// Merges the receipts of whoever built the shards into `shards.jsonl`, `manifest.json`, card and Croissant; refuses gaps.
pub fn finalize(store: &dyn Store, spec: &CorpusSpec) -> Result<Manifest, CorpusError> {
    let mut merge = Merge::new(spec);
    let status = survey(store, spec, &(0..spec.shards()).collect::<Vec<_>>(), |receipt| merge.add(receipt))?;
    let gaps = status.gaps();
    if !gaps.is_empty() {
        return Err(CorpusError::Gaps {
            place: store.place(),
            missing: gaps.len() as u64,
            shards: spec.shards(),
            ranges: ranges::to_text(&gaps),
        });
    }
    let (manifest, lines) = merge.finish();
    store.replace(manifest::SHARDS, lines.as_bytes())?;
    store.replace(card::NAME, card::text(spec, &manifest).as_bytes())?;
    store.replace(croissant::NAME, croissant::text(spec, &manifest).as_bytes())?;
    // Last: whoever waits for the manifest finds the rest.
    manifest.write(store)?;
    Place { store, spec }.sweep()?;
    Ok(manifest)
}

/// A dotted key in which two plans differ, with its value in each as JSON.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    pub key: String,
    pub there: Option<String>,
    pub here: Option<String>,
}

/// The keys in which two plans differ, by key; `name`, `scenes` and the word `fidelity` make no other corpus. `None` where one
/// cannot be read as YAML.
pub fn differences(there: &str, here: &str) -> Option<Vec<Difference>> {
    let (there, here) = (flattened(there)?, flattened(here)?);
    let keys: BTreeSet<&String> = there.keys().chain(here.keys()).collect();
    let differ = |key: &&String| there.get(*key) != here.get(*key);
    let keys = keys.into_iter().filter(|key| !matches!(key.as_str(), "name" | "scenes" | "fidelity")).filter(differ);
    let both = |key: &String| (there.get(key).cloned(), here.get(key).cloned());
    Some(
        keys.map(|key| (key, both(key)))
            .map(|(key, (there, here))| Difference { key: key.clone(), there, here })
            .collect(),
    )
}

/// The same for people: `-` as it is in the place, `+` as it was asked for.
pub fn difference(there: &str, here: &str) -> String {
    let Some(differences) = differences(there, here) else {
        return "  (plan.yaml in the place cannot be read as YAML)".into();
    };
    let lines = differences.iter().flat_map(|Difference { key, there, here }| {
        let old = there.iter().map(move |value| format!("  - {key}: {value}"));
        old.chain(here.iter().map(move |value| format!("  + {key}: {value}")))
    });
    let lines: Vec<String> = lines.collect();
    if lines.is_empty() {
        "  (no key differs: another version of marsyard made the other hash, or the first line of plan.yaml is damaged; if so, \
             delete plan.yaml, and the same command goes on)"
            .into()
    } else {
        lines.join("\n")
    }
}

/// A YAML document as dotted keys with scalar values.
fn flattened(yaml: &str) -> Option<BTreeMap<String, String>> {
    fn walk(key: String, value: &serde_json::Value, out: &mut BTreeMap<String, String>) {
        let below = |part: &str| if key.is_empty() { part.to_string() } else { format!("{key}.{part}") };
        match value {
            serde_json::Value::Object(map) if !map.is_empty() => map.iter().for_each(|(k, v)| walk(below(k), v, out)),
            serde_json::Value::Array(list) if list.iter().any(|v| v.is_object() || v.is_array()) => {
                list.iter().enumerate().for_each(|(i, v)| walk(below(&i.to_string()), v, out));
            }
            scalar => {
                out.insert(key, scalar.to_string());
            }
        }
    }
    let value: serde_json::Value = serde_saphyr::from_str(yaml).ok()?;
    let mut out = BTreeMap::new();
    walk(String::new(), &value, &mut out);
    Some(out)
}
