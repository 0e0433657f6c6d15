//! A place where a corpus is built: whose it is, and which shards are there.

use std::collections::BTreeSet;
use std::fmt;

use rayon::prelude::*;

use super::finished;
use super::key_differences::{KeyDifference, key_differences};
use super::limits::FileKind;
use super::listing::{Listing, Stray};
use super::plan_file::{self, Extent, PlanHead};
use super::receipt::{self, Receipt};
use super::shard::FinishedShard;
use super::{Build, CorpusError, CorpusSpec, Store, Table, owner, ranges};

/// A place that belongs to the plan.
pub struct Place<'a> {
    store: &'a dyn Store,
    spec: &'a CorpusSpec,
}

impl<'a> Place<'a> {
    /// A place that is known to be the plan's.
    pub(super) fn of(store: &'a dyn Store, spec: &'a CorpusSpec) -> Place<'a> {
        Place { store, spec }
    }

    /// Takes an empty place for the plan, or goes on in one that is the plan's already; any other is refused, untouched.
    ///
    /// `name` and `scenes` may differ from the last time: a corpus may be renamed and may grow. Anything else is another
    /// corpus and is refused with the difference. Where they differ, the plan is the first file that is written: from then on
    /// it is not the finished corpus's plan, and no reader takes what grows for the corpus that was.
    pub(crate) fn open(store: &'a dyn Store, spec: &'a CorpusSpec) -> Result<Place<'a>, CorpusError> {
        let place = Place { store, spec };
        if place.is_taken()? {
            return Ok(place);
        }
        if let Some(&shard) = place.shards_beyond()?.first() {
            return Err(CorpusError::BeyondPlan { place: store.place(), shard, shards: spec.shards() });
        }
        place.take()?;
        Ok(place)
    }

    /// The same, and removes whole shards behind the plan's end; also how many.
    pub(crate) fn open_discarding(store: &'a dyn Store, spec: &'a CorpusSpec) -> Result<(Place<'a>, u64), CorpusError> {
        let place = Place { store, spec };
        if !place.is_taken()? {
            place.take()?;
        }
        let discarded = place.discard_beyond()?;
        Ok((place, discarded))
    }

    /// Whether the place holds this very plan; one that holds another's is refused.
    fn is_taken(&self) -> Result<bool, CorpusError> {
        let Place { store, spec } = self;
        if store.size(plan_file::NAME)?.is_none() {
            return match owner::check_empty(*store) {
                Ok(()) => Ok(false),
                // Another build may have taken it for the same plan meanwhile.
                Err(_) if store.size(plan_file::NAME)?.is_some() => self.is_taken(),
                Err(foreign) => Err(foreign),
            };
        }
        let there = String::from_utf8_lossy(&FileKind::Config.read(*store, plan_file::NAME)?).into_owned();
        let (hash, plan) = plan_file::split(&there).ok_or_else(|| CorpusError::ForeignPlan { place: store.place() })?;
        if hash != spec.scene_plan_hash {
            return Err(CorpusError::OtherPlan {
                place: store.place(),
                there: hash.into(),
                here: spec.scene_plan_hash.clone(),
                difference: difference(plan, &spec.plan_yaml),
            });
        }
        owner::check_derived(*store)?;
        Ok(there == plan_file::text(spec))
    }

    /// Writes the plan, and clears what crashed builds left.
    fn take(&self) -> Result<(), CorpusError> {
        self.store.replace(plan_file::NAME, plan_file::text(self.spec).as_bytes())?;
        self.sweep()?;
        // After the plan: a growth that goes on all the same finds it changed, and takes back what it puts from now on.
        self.remove_half_shards().map(drop)
    }

    /// Shards behind the plan's end that have a receipt, ascending.
    fn shards_beyond(&self) -> Result<Vec<u64>, CorpusError> {
        let shards = self.spec.shards();
        Ok(receipt::numbers(self.store)?.into_iter().filter(|&shard| shard >= shards).collect())
    }

    /// Removes whole shards behind the plan's end, the receipts first: what is left of one is half a shard.
    fn discard_beyond(&self) -> Result<u64, CorpusError> {
        let listing = Listing::of(self.store)?;
        let mut shards = BTreeSet::new();
        let mut files = Vec::new();
        for name in self.strays(&listing) {
            if let Stray::Beyond { shard } = self.judge(&listing, &name)? {
                shards.insert(shard);
                files.extend(Table::of_path(&name).map(|_| name));
            }
        }
        shards.iter().try_for_each(|&shard| self.store.remove(&Receipt::path(shard)))?;
        files.iter().try_for_each(|name| self.store.remove(name))?;
        Ok(shards.len() as u64)
    }

    /// What lies in the folders and is of no shard of the plan.
    fn strays(&self, listing: &Listing) -> Vec<String> {
        listing.strays(self.spec.shards(), |table| self.spec.tables.contains(&table))
    }

    fn judge(&self, listing: &Listing, name: &str) -> Result<Stray, CorpusError> {
        listing.judge(self.store, name, &self.spec.scene_plan_hash, self.spec.shards())
    }

    /// Removes files behind the plan's end for which no receipt speaks, where they say themselves that they are of this plan; the
    /// names that are left and of no shard, and the listing that they are in.
    fn remove_half_shards(&self) -> Result<(Vec<String>, Listing), CorpusError> {
        let listing = Listing::of(self.store)?;
        let mut left = Vec::new();
        for name in self.strays(&listing) {
            let beyond = Table::of_path(&name).is_some_and(|(_, shard)| shard >= self.spec.shards());
            if beyond && self.judge(&listing, &name)? == Stray::Ours {
                self.store.remove(&name)?;
            } else {
                left.push(name);
            }
        }
        Ok((left, listing))
    }

    /// Removes every file of no shard that says itself that marsyard wrote it for this plan; also their names. Whole shards behind
    /// the plan's end stay, and so does what others put there.
    pub(crate) fn remove_strays(&self) -> Result<Vec<String>, CorpusError> {
        let listing = Listing::of(self.store)?;
        let mut removed = Vec::new();
        for name in self.strays(&listing) {
            if self.judge(&listing, &name)? == Stray::Ours {
                self.store.remove(&name)?;
                removed.push(name);
            }
        }
        Ok(removed)
    }

    /// Refuses a place in which readers would find more than the shards of the plan.
    pub(super) fn refuse_strays(&self) -> Result<(), CorpusError> {
        let (store, spec) = (self.store, self.spec);
        let (left, listing) = self.remove_half_shards()?;
        let Some(name) = left.first() else { return Ok(()) };
        if let Stray::Beyond { shard } = self.judge(&listing, name)? {
            return Err(CorpusError::BeyondPlan { place: store.place(), shard, shards: spec.shards() });
        }
        let finished::Fault { name, what, cure } =
            finished::stray_fault(store, &listing, name, &spec.scene_plan_hash, spec.shards())?;
        Err(CorpusError::NotWhole { place: store.place(), name, reason: what, cure })
    }

    /// Removes what crashed builds left; what a live one is writing stays.
    pub(crate) fn sweep(&self) -> Result<(), CorpusError> {
        let data = Table::ALL.map(Table::folder);
        let folders = ["", receipt::FOLDER].into_iter().chain(data.iter().map(String::as_str));
        folders.into_iter().try_for_each(|folder| self.store.sweep_temporaries(folder))
    }

    /// Puts a shard, where the place is still the plan's: not removed, unmounted or taken by another since it was opened.
    pub(crate) fn commit(&self, shard: &FinishedShard) -> Result<(), CorpusError> {
        self.still_there()?;
        let put = shard.commit(self.store);
        // Asked again: who took the place over meanwhile may have looked for files behind its end before this shard came.
        match self.still_there() {
            Err(error @ CorpusError::Overtaken { .. }) if self.is_beyond(shard)? => {
                shard.withdraw(self.store).and(Err(error))
            }
            Err(error) => Err(error),
            Ok(()) => put.map(|_| ()),
        }
    }

    /// The shard lies behind the end of the plan that is in the place now.
    fn is_beyond(&self, shard: &FinishedShard) -> Result<bool, CorpusError> {
        let extent = plan_file::head(self.store)?.and_then(|head| head.extent);
        Ok(extent.is_some_and(|extent| shard.receipt.scenes[0] >= extent.scenes))
    }

    /// Refuses to go on where the place is no longer the plan's, or where another build has given it another number of scenes.
    pub(crate) fn still_there(&self) -> Result<(), CorpusError> {
        let place = || self.store.place();
        let ours = Extent::from(self.spec);
        let words = |extent: &Extent| format!("{} scenes of '{}'", extent.scenes, extent.name);
        match plan_file::head(self.store)? {
            Some(PlanHead { scene_plan_hash, extent }) if scene_plan_hash == self.spec.scene_plan_hash => {
                match extent {
                    Some(theirs) if theirs != ours => {
                        Err(CorpusError::Overtaken { place: place(), ours: words(&ours), theirs: words(&theirs) })
                    }
                    _ => Ok(()),
                }
            }
            _ => Err(CorpusError::Vanished { place: place() }),
        }
    }

    /// The shard is there, whole: its receipt, and every table with the size that the receipt says.
    #[cfg(test)]
    pub(crate) fn is_done(&self, shard: u64) -> Result<bool, CorpusError> {
        Ok(matches!(shard_state(self.store, self.spec, shard)?, ShardState::Done(..)))
    }

    /// Removes a damaged shard, so that it can be built anew: the receipt last, since it says that what cannot be read is ours. With
    /// a table missing the shard is no longer whole. What marsyard did not write stays, and is refused ([`owner::check_shard`]).
    pub(crate) fn discard(&self, shard: u64) -> Result<(), CorpusError> {
        owner::check_shard(self.store, &self.spec.scene_plan_hash, shard)?;
        Table::ALL.iter().try_for_each(|table| self.store.remove(&table.path(shard)))?;
        self.store.remove(&Receipt::path(shard))
    }
}

/// The scene_plan_hash of the plan that a place belongs to, as the first line of its plan.yaml says; `None` where there is none.
pub(crate) fn owner(store: &dyn Store) -> Result<Option<String>, CorpusError> {
    Ok(plan_file::head(store)?.map(|head| head.scene_plan_hash))
}

enum ShardState {
    /// The receipt, and the bytes that it was read from.
    Done(Box<Receipt>, Vec<u8>),
    Missing,
    Damaged(String),
    OtherFormat(CorpusError),
}

fn shard_state(store: &dyn Store, spec: &CorpusSpec, shard: u64) -> Result<ShardState, CorpusError> {
    let (receipt, bytes) = match Receipt::read_of(store, spec, shard) {
        Ok(read) => read,
        Err(error @ (CorpusError::BadReceipt { .. } | CorpusError::NotAFile { .. } | CorpusError::TooLarge { .. })) => {
            return Ok(ShardState::Damaged(error.to_string()));
        }
        Err(error @ CorpusError::OtherFormat { .. }) => return Ok(ShardState::OtherFormat(error)),
        Err(CorpusError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
            return Ok(ShardState::Missing);
        }
        Err(error) => return Err(error),
    };
    for table in &spec.tables {
        let path = table.path(shard);
        let size = match store.size(&path) {
            Err(error @ CorpusError::NotAFile { .. }) => return Ok(ShardState::Damaged(error.to_string())),
            other => other?,
        };
        let reason = match (receipt.tables.get(table), size) {
            (_, None) => format!("{path} is missing"),
            (Some(facts), Some(size)) if facts.bytes != size => {
                format!("{path} has {size} bytes, its receipt says {}", facts.bytes)
            }
            _ => continue,
        };
        return Ok(ShardState::Damaged(reason));
    }
    Ok(ShardState::Done(Box::new(receipt), bytes))
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
    pub(crate) fn to_build(&self) -> Vec<u64> {
        let all: BTreeSet<u64> =
            self.missing.iter().copied().chain(self.damaged.iter().map(|(shard, _)| *shard)).collect();
        all.into_iter().collect()
    }

    /// Shards without which there is no whole corpus, ascending.
    pub(super) fn gaps(&self) -> Vec<u64> {
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
pub(crate) fn status(store: &dyn Store, spec: &CorpusSpec) -> Result<Status, CorpusError> {
    status_of(store, spec, &(0..spec.shards()).collect::<Vec<_>>())
}

/// Looks at some shards of the plan: a machine that builds a part need not look at all.
pub(crate) fn status_of(store: &dyn Store, spec: &CorpusSpec, shards: &[u64]) -> Result<Status, CorpusError> {
    survey(store, spec, shards, |_, _| ())
}

/// Receipts that are read at a time, on all threads.
const BLOCK: usize = 1024;

/// Looks at these shards, and shows the receipts of those that are done, in their order; few are in memory at a time.
pub(super) fn survey(
    store: &dyn Store,
    spec: &CorpusSpec,
    shards: &[u64],
    mut done: impl FnMut(&Receipt, &[u8]),
) -> Result<Status, CorpusError> {
    let mut status = Status { place: store.place(), shards: spec.shards(), ..Status::default() };
    for block in shards.chunks(BLOCK) {
        let states: Vec<_> = block.par_iter().map(|&shard| shard_state(store, spec, shard)).collect();
        for (&shard, state) in block.iter().zip(states) {
            match state? {
                ShardState::Missing => status.missing.push(shard),
                ShardState::Damaged(reason) => status.damaged.push((shard, reason)),
                ShardState::OtherFormat(error) => status.other_format.push((shard, error.to_string())),
                ShardState::Done(receipt, bytes) => {
                    status.add_done(&receipt);
                    done(&receipt, &bytes);
                }
            }
        }
    }
    Ok(status)
}

/// A dotted key in which two plans differ, with its value in each as JSON.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    pub key: String,
    pub there: Option<String>,
    pub here: Option<String>,
}

/// The keys in which two plans differ, by key; `name`, `scenes`, `card` and the word `fidelity` make no other corpus. `None` where one
/// cannot be read as YAML.
pub fn differences(there: &str, here: &str) -> Option<Vec<Difference>> {
    let document = |yaml: &str| serde_saphyr::from_str::<serde_json::Value>(yaml).ok();
    let found = key_differences(&document(there)?, &document(here)?);
    let is_of_scenes = |key: &str| !matches!(key, "name" | "scenes" | "fidelity") && !key.starts_with("card.");
    let text = |value: Option<serde_json::Value>| value.map(|value| value.to_string());
    let found = found.into_iter().filter(|difference| is_of_scenes(&difference.key));
    Some(found.map(|KeyDifference { key, a, b }| Difference { key, there: text(a), here: text(b) }).collect())
}

/// The same for people: `-` as it is in the place, `+` as it was asked for.
pub(crate) fn difference(there: &str, here: &str) -> String {
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
             write into it the scene_plan_hash of this plan, and the same command goes on)"
            .into()
    } else {
        lines.join("\n")
    }
}
