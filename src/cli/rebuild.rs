//! Shards of a sound corpus built again, in words: which have the same bytes, which differ and where.

use super::build::build_failure;
use super::output::{errln, outln};
use super::place::corpus_failure;
use super::progress::BuildProgress;
use super::signals::stop_on_signals;
use super::{Failure, LogFormat};
use crate::build::{self, Compared, Share};
use crate::corpus::rebuilt::{self, Rebuilt};
use crate::corpus::{Manifest, Store, ranges};
use crate::plan::Plan;
use crate::shell;

/// Builds a share of the shards again and says what came of it; `place` is the corpus as it was typed.
pub(super) fn run(
    place: &str,
    plan: &Plan,
    store: &dyn Store,
    share: Share,
    threads: usize,
    log: LogFormat,
) -> Result<(), Failure> {
    let replay = |scene: u64| format!("marsyard explain {} --scene {scene}", shell::word(place));
    let stop = stop_on_signals()?;
    let mut progress = BuildProgress::new(log, place.into(), &replay);
    let compared = build::compare_again(plan, store, share, threads, &stop, &mut |event| progress.take(&event));
    progress.finish();
    let Some(compared) = compared.map_err(|error| build_failure(error, &replay))? else {
        return Err(Failure::new(Failure::TRY_AGAIN, miette::miette!("interrupted: nothing was changed")));
    };
    let Compared { shards, findings, unrecorded } = compared;
    if let Some(error) = unrecorded {
        tracing::warn!("{} was not written: {error}", rebuilt::NAME);
    }
    if shards.is_empty() {
        return Ok(());
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
