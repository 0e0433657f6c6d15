//! Shards of a finished corpus, built again -> where they differ, and a record of what was found.
//!
//! A corpus is what its plan says: whoever builds a shard anew must get its bytes. Nothing of the corpus is changed; the record
//! (`rebuilt.json`) lies beside it.

use std::str::FromStr;
use std::sync::atomic::AtomicBool;
use std::time::SystemTime;

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

use super::Tally;
use super::corpus::{CorpusBuildError, CorpusEvent};
use super::shards::{Event, Job, Outcome, build_shards};
use crate::corpus::rebuilt::Rebuilt;
use crate::corpus::verify::Finding;
use crate::corpus::{Build, CorpusError, CorpusSpec, Manifest, Store, rebuild};
use crate::episode::Prepared;
use crate::plan::Plan;

/// How many shards are built again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Share {
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
            None => text.parse().ok().filter(|count| *count > 0).map(Share::Count).ok_or_else(fault),
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

/// What came of building shards again.
#[derive(Debug)]
pub(crate) struct Compared {
    /// Those that were built again, ascending.
    pub shards: Vec<u64>,
    /// Where they differ, by shard and file.
    pub findings: Vec<Finding>,
    /// Why the record could not be written.
    pub unrecorded: Option<CorpusError>,
}

/// Builds a share of a corpus's shards again, taken at random, and compares every byte; `None` where it was asked to stop.
pub(crate) fn compare_again(
    plan: &Plan,
    store: &dyn Store,
    share: Share,
    threads: usize,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(CorpusEvent),
) -> Result<Option<Compared>, CorpusBuildError> {
    let spec = plan.corpus_spec();
    let shards = share.draw(spec.shards());
    if shards.is_empty() {
        return Ok(Some(Compared { shards, findings: Vec::new(), unrecorded: None }));
    }
    let before = Manifest::read(store)?;
    let job = Job { shards: &shards, threads, stop, hashes: false };
    let Some(mut findings) = findings(plan, &spec, store, job, observe)? else { return Ok(None) };
    findings.sort_by_key(|finding| (finding.shard, finding.name.clone()));
    let mut differing: Vec<u64> = findings.iter().filter_map(|finding| finding.shard).collect();
    differing.dedup();
    let equal: Vec<u64> = shards.iter().copied().filter(|shard| differing.binary_search(shard).is_err()).collect();
    let unrecorded = record(store, &before, &equal, &differing).err();
    Ok(Some(Compared { shards, findings, unrecorded }))
}

fn findings(
    plan: &Plan,
    spec: &CorpusSpec,
    store: &dyn Store,
    job: Job,
    observe: &mut dyn FnMut(CorpusEvent),
) -> Result<Option<Vec<Finding>>, CorpusBuildError> {
    let mut tally = Tally::new(job.shards.len() as u64 * u64::from(spec.scenes_per_shard));
    let mut findings: Vec<Finding> = Vec::new();
    let outcome = build_shards(
        &Prepared::new(plan.clone())?,
        spec,
        job,
        |event: Event<Vec<Finding>>| match event {
            Event::Scene { output, record } => {
                tally.scene(output, &record.times);
                observe(CorpusEvent::Scene { output, tally: &tally });
            }
            Event::Shard { written, .. } => findings.extend_from_slice(written),
        },
        |finished| rebuild::compare(store, spec, finished),
    )?;
    Ok((outcome == Outcome::Done).then_some(findings))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_share_is_all_a_number_or_percent() {
        let of = |text: &str, shards| text.parse::<Share>().map(|share| share.of(shards));
        assert_eq!([of("all", 40), of("3", 40), of("300", 40)], [40, 3, 40].map(Ok));
        assert_eq!([of("5%", 40), of("5%", 41), of("0.1%", 7), of("100%", 7)], [2, 3, 1, 7].map(Ok));
        for wrong in ["", "%", "-1", "0", "0%", "101%", "NaN%", "some"] {
            assert!(wrong.parse::<Share>().is_err(), "{wrong}");
        }
        assert_eq!(Share::All.draw(5), [0, 1, 2, 3, 4]);
        assert!(Share::Percent(10.0).draw(40).is_sorted());
    }
}
