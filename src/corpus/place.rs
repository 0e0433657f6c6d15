//! A place where a corpus is built: whose it is, which shards are there, and the merge of what many machines did.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::receipt::{self, Receipt};
use super::{CorpusError, CorpusSpec, Manifest, Store, Table, card, croissant, manifest, ranges};

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
        Ok(Place { store, spec })
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

enum ShardState {
    Done(Box<Receipt>),
    Missing,
    Damaged(String),
}

fn shard_state(store: &dyn Store, spec: &CorpusSpec, shard: u64) -> Result<ShardState, CorpusError> {
    if store.size(&Receipt::path(shard))?.is_none() {
        return Ok(ShardState::Missing);
    }
    let receipt = match Receipt::read(store, shard, &spec.scene_plan_hash) {
        Ok(receipt) => receipt,
        Err(error @ CorpusError::BadReceipt { .. }) => return Ok(ShardState::Damaged(error.to_string())),
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
    /// Done, with scenes that failed.
    pub with_failed_scenes: Vec<u64>,
    pub failed_scenes: u64,
}

impl Status {
    /// Shards to be built, ascending.
    pub fn to_build(&self) -> Vec<u64> {
        let all: BTreeSet<u64> =
            self.missing.iter().copied().chain(self.damaged.iter().map(|(shard, _)| *shard)).collect();
        all.into_iter().collect()
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let damaged: Vec<u64> = self.damaged.iter().map(|(shard, _)| *shard).collect();
        writeln!(f, "{}: {} shards", self.place, self.shards)?;
        for (word, shards) in [("done", &self.done), ("missing", &self.missing), ("damaged", &damaged)] {
            writeln!(f, "  {word:<8} {:>7}  {}", shards.len(), ranges::to_text(shards))?;
        }
        let failed = (self.failed_scenes, ranges::to_text(&self.with_failed_scenes));
        writeln!(f, "  failed scenes {:>2}  in shards {}", failed.0, failed.1)?;
        self.damaged.iter().try_for_each(|(shard, reason)| writeln!(f, "  shard {shard}: {reason}"))
    }
}

/// Looks at every shard of the plan: receipts and sizes, no contents (`verify` reads those).
pub fn status(store: &dyn Store, spec: &CorpusSpec) -> Result<Status, CorpusError> {
    Ok(survey(store, spec, 0..spec.shards())?.0)
}

/// Looks at some shards of the plan: a machine that builds a part need not look at all.
pub fn status_of(store: &dyn Store, spec: &CorpusSpec, shards: &[u64]) -> Result<Status, CorpusError> {
    Ok(survey(store, spec, shards.iter().copied())?.0)
}

fn survey(
    store: &dyn Store,
    spec: &CorpusSpec,
    shards: impl Iterator<Item = u64>,
) -> Result<(Status, Vec<Receipt>), CorpusError> {
    let mut status = Status { place: store.place(), shards: spec.shards(), ..Status::default() };
    let mut receipts = Vec::new();
    for shard in shards {
        match shard_state(store, spec, shard)? {
            ShardState::Missing => status.missing.push(shard),
            ShardState::Damaged(reason) => status.damaged.push((shard, reason)),
            ShardState::Done(receipt) => {
                status.done.push(shard);
                if !receipt.failed.is_empty() {
                    status.with_failed_scenes.push(shard);
                    status.failed_scenes += receipt.failed.len() as u64;
                }
                receipts.push(*receipt);
            }
        }
    }
    Ok((status, receipts))
}

/// Merges the receipts of whoever built the shards into `shards.jsonl`, `manifest.json`, card and Croissant; refuses gaps.
pub fn finalize(store: &dyn Store, spec: &CorpusSpec) -> Result<Manifest, CorpusError> {
    let (status, receipts) = survey(store, spec, 0..spec.shards())?;
    let gaps = status.to_build();
    if !gaps.is_empty() {
        return Err(CorpusError::Gaps {
            place: store.place(),
            missing: gaps.len() as u64,
            shards: spec.shards(),
            ranges: ranges::to_text(&gaps),
        });
    }
    let manifest = Manifest::merge(spec, &receipts);
    store.replace(manifest::SHARDS, manifest::shard_lines(&receipts).as_bytes())?;
    store.replace(card::NAME, card::text(spec, &manifest).as_bytes())?;
    store.replace(croissant::NAME, croissant::text(spec, &manifest).as_bytes())?;
    // Last: whoever waits for the manifest finds the rest.
    manifest.write(store)?;
    store.sweep_temporaries(receipt::FOLDER)?;
    for table in Table::ALL {
        store.sweep_temporaries(&format!("data/{}", table.name()))?;
    }
    Ok(manifest)
}

/// The keys in which two plans differ, `name` and `scenes` aside: `-` as it is in the place, `+` as it was asked for.
pub fn difference(there: &str, here: &str) -> String {
    let (Some(there), Some(here)) = (flattened(there), flattened(here)) else {
        return "  (plan.yaml in the place cannot be read as YAML)".into();
    };
    let keys: BTreeSet<&String> = there.keys().chain(here.keys()).collect();
    let mut lines = Vec::new();
    for key in keys.into_iter().filter(|key| !matches!(key.as_str(), "name" | "scenes")) {
        if there.get(key) != here.get(key) {
            lines.extend(there.get(key).map(|value| format!("  - {key}: {value}")));
            lines.extend(here.get(key).map(|value| format!("  + {key}: {value}")));
        }
    }
    if lines.is_empty() {
        "  (no key differs: another version of marsyard made the other hash)".into()
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
