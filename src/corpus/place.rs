//! A place where a corpus is built: whose it is, and what is put and removed there.

use std::collections::BTreeSet;

use super::finished;
use super::limits::FileKind;
use super::listing::{Listing, Stray};
use super::plan_difference::difference;
pub use super::plan_difference::{Difference, differences};
use super::plan_file::{self, Extent, PlanHead};
use super::receipt::{self, Receipt};
use super::shard::FinishedShard;
pub use super::status::Status;
#[cfg(test)]
use super::status::{ShardState, shard_state};
use super::{CorpusError, CorpusSpec, Store, Table, owner};

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
