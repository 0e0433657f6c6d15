//! Builds shards of a sound corpus again, compares every byte, and leaves a record of what was found.

use std::str::FromStr;
use std::time::SystemTime;

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

use super::build::build_outcome;
use super::output::{errln, outln};
use super::place::corpus_failure;
use super::progress::Progress;
use super::signals::stop_on_signals;
use super::{Failure, LogFormat};
use crate::build::{self, Event, Job, Outcome};
use crate::corpus::rebuilt::{self, Rebuilt};
use crate::corpus::verify::Finding;
use crate::corpus::{Build, CorpusError, CorpusSpec, Manifest, Store, ranges, rebuild};
use crate::episode::Prepared;
use crate::plan::Plan;

/// How many shards are built again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Share {
    All,
    Count(u64),
    Percent(f64),
}

impl FromStr for Share {
    type Err = String;

    fn from_str(text: &str) -> Result<Share, String> {
        let fault = || format!("'{text}' is not a number of shards, a share such as 5%, or 'all'");
        match text.strip_suffix('%') {
            None if text == "all" => Ok(Share::All),
            None => text.parse().map(Share::Count).map_err(|_| fault()),
            Some(percent) => match percent.trim().parse::<f64>() {
                Ok(percent) if percent > 0.0 && percent <= 100.0 => Ok(Share::Percent(percent)),
                _ => Err(fault()),
            },
        }
    }
}

impl Share {
    /// So many of these shards; of a share one at least.
    fn of(self, shards: u64) -> u64 {
        match self {
            Share::All => shards,
            Share::Count(count) => count.min(shards),
            Share::Percent(percent) => ((percent / 100.0 * shards as f64).ceil() as u64).clamp(1, shards.max(1)),
        }
    }

    /// Shards taken at random, ascending.
    fn draw(self, shards: u64) -> Vec<u64> {
        let seed = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |now| now.as_nanos() as u64);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let taken = rand::seq::index::sample(&mut random, shards as usize, self.of(shards) as usize);
        let mut taken: Vec<u64> = taken.into_iter().map(|shard| shard as u64).collect();
        taken.sort_unstable();
        taken
    }
}

/// A sound corpus whose shards are built again.
pub(super) struct Rebuild<'a> {
    /// As it was typed.
    pub(super) place: String,
    pub(super) plan: Plan,
    pub(super) spec: &'a CorpusSpec,
    pub(super) store: &'a dyn Store,
    pub(super) threads: usize,
    pub(super) log: LogFormat,
}

impl Rebuild<'_> {
    pub(super) fn run(self, share: Share) -> Result<(), Failure> {
        let shards = share.draw(self.spec.shards());
        if shards.is_empty() {
            return Ok(());
        }
        let (place, store) = (self.place.clone(), self.store);
        let before = Manifest::read(store).map_err(corpus_failure)?;
        let mut findings = self.compare(&shards)?;
        findings.sort_by_key(|finding| (finding.shard, finding.name.clone()));
        let mut differing: Vec<u64> = findings.iter().filter_map(|finding| finding.shard).collect();
        differing.dedup();
        let equal: Vec<u64> = shards.iter().copied().filter(|shard| differing.binary_search(shard).is_err()).collect();
        if let Err(error) = record(store, &before, &equal, &differing) {
            tracing::warn!("{} was not written: {error}", rebuilt::NAME);
        }
        let ranges = ranges::to_text(&shards);
        if findings.is_empty() {
            errln!("{place}: shards {ranges}, built again, have the same bytes");
            return Ok(());
        }
        findings.iter().for_each(|finding| outln!("{finding}"));
        Err(Failure::failed(format!(
            "{} of the files of shards {ranges} differ when built again; the corpus is not what this program makes of its plan.yaml",
            findings.len()
        )))
    }

    fn compare(self, shards: &[u64]) -> Result<Vec<Finding>, Failure> {
        let Rebuild { place, plan, spec, store, threads, log } = self;
        let prepared = Prepared::new(plan).map_err(Failure::failed)?;
        let mut progress = Progress::new(shards.len() as u64 * u64::from(spec.scenes_per_shard), log);
        let mut findings: Vec<Finding> = Vec::new();
        let replay = |scene: u64| format!("marsyard explain {place} --scene {scene}");
        let built = build::build_shards(
            &prepared,
            spec,
            Job { shards, threads, stop: &*stop_on_signals()?, hashes: false },
            |event: Event<Vec<Finding>>| match event {
                Event::Scene { output, record } => progress.scene(output, &record.times, || replay(output.scene_id)),
                Event::Shard { written, .. } => findings.extend_from_slice(written),
            },
            |finished| rebuild::compare(store, spec, finished),
        );
        progress.finish();
        match build_outcome(built, replay)? {
            Outcome::Interrupted => {
                Err(Failure::new(Failure::TRY_AGAIN, miette::miette!("interrupted: nothing was changed")))
            }
            Outcome::Done => Ok(findings),
        }
    }
}

/// Adds what was found to the corpus's record.
fn record(store: &dyn Store, before: &Manifest, equal: &[u64], differing: &[u64]) -> Result<(), CorpusError> {
    if Manifest::read(store)?.corpus_id != before.corpus_id {
        let reason = "the corpus became another one while its shards were built again".into();
        return Err(CorpusError::Refused { place: store.place(), reason, cure: "build them again".into() });
    }
    let mut rebuilt = Rebuilt::read(store, before)?;
    rebuilt.add(&Build::of_this_binary(), equal, differing, before.shards);
    rebuilt.write(store)
}

/// Says what others found when they built it again.
pub(super) fn tell_before(store: &dyn Store) -> Result<(), Failure> {
    let manifest = Manifest::read(store).map_err(corpus_failure)?;
    // A note beside the corpus, not a part of it: what cannot be read of it harms nothing.
    let rebuilt = Rebuilt::read(store, &manifest).inspect_err(|error| tracing::warn!("{error}"));
    for entry in rebuilt.map_or_else(|_| Vec::new(), |rebuilt| rebuilt.rebuilt) {
        let had = if entry.equal { "had the same bytes" } else { "had other bytes" };
        errln!("{}: shards {}, built again by marsyard {}, {had}", rebuilt::NAME, entry.shards, entry.build);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_share_is_all_a_number_or_percent() {
        let of = |text: &str, shards| text.parse::<Share>().map(|share| share.of(shards));
        assert_eq!([of("all", 40), of("3", 40), of("300", 40), of("0", 40)], [40, 3, 40, 0].map(Ok));
        assert_eq!([of("5%", 40), of("5%", 41), of("0.1%", 7), of("100%", 7)], [2, 3, 1, 7].map(Ok));
        for wrong in ["", "%", "-1", "0%", "101%", "NaN%", "some"] {
            assert!(wrong.parse::<Share>().is_err(), "{wrong}");
        }
        assert_eq!(Share::All.draw(5), [0, 1, 2, 3, 4]);
        assert!(Share::Percent(10.0).draw(40).is_sorted());
    }
}
