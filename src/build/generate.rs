//! A plan and a place -> the corpus there, whole: the place taken, what is missing built, the manifest written last.
//!
//! There is nothing to repair after a crash: the same again goes on. Many machines build one corpus by selections of shards: each
//! looks at its own shards alone and writes nothing but them, so that a thousand such builds do not read each other's receipts;
//! `corpus::finalize` is the one that looks at all.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::corpus::{Built, CorpusBuild, CorpusBuildError, CorpusEvent};
use super::{Outcome, Tally};
use crate::corpus::limits::FileKind;
use crate::corpus::{self, Known, Manifest, Place, Selection, Store, address, ranges};
use crate::episode::Prepared;
use crate::plan::Plan;

/// Left free on the disk where nobody says otherwise.
pub(crate) const KEEP_FREE_BYTES: u64 = 100_000_000;

/// How a corpus is built.
#[derive(Clone, Copy, Debug)]
pub struct Generate<'a> {
    /// These shards alone; `None`: all of them, and the manifest.
    pub selection: Option<&'a Selection>,
    /// Lay down plan.yaml and the files that it needs, and build nothing.
    pub plan_only: bool,
    /// Remove whole shards behind the plan's end, which otherwise are refused.
    pub discard_beyond: bool,
    pub threads: usize,
    /// To be left free on the disk.
    pub keep_free_bytes: u64,
    /// Hashes of the stages' results are added to this file.
    pub stage_hashes: Option<&'a Path>,
}

/// How far a corpus was built.
#[derive(Debug)]
pub enum Generated {
    /// The plan is laid down.
    Plan,
    /// Asked to stop: the shards in their place are whole, the rest was discarded.
    Interrupted,
    /// The selected shards are there, ascending.
    Part {
        shards: Vec<u64>,
        tally: Tally,
    },
    Whole(Box<Whole>),
}

/// A corpus that is whole.
#[derive(Debug)]
pub struct Whole {
    pub manifest: Manifest,
    /// Of this build alone: shards that were there are not counted.
    pub tally: Tally,
}

/// Builds what is missing of a plan in a place.
pub fn generate(
    plan: &Plan,
    store: &dyn Store,
    how: &Generate,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(CorpusEvent),
) -> Result<Generated, CorpusBuildError> {
    let (selected, spec) = (selected_shards(plan, how.selection)?, plan.corpus_spec());
    let place = if how.discard_beyond {
        let (place, shards) = Place::open_discarding(store, &spec)?;
        observe(CorpusEvent::Discarded { shards });
        place
    } else {
        Place::open(store, &spec)?
    };
    for file in &plan.files {
        store.put(&file.path, &address::read(&file.from, FileKind::Config)?)?;
    }
    if how.plan_only {
        return Ok(Generated::Plan);
    }
    let status = corpus::status_of(store, &spec, &selected)?;
    let shards = status.to_build();
    observe(CorpusEvent::Start { selected: selected.len(), shards: &shards });
    let build = CorpusBuild {
        prepared: &Prepared::new(plan.clone())?,
        spec: &spec,
        store,
        place: &place,
        threads: how.threads,
        keep_free_bytes: how.keep_free_bytes,
        stage_hashes: how.stage_hashes,
        report: how.selection.is_none(),
    };
    let Built { outcome, tally } = build.build(&status, &shards, stop, observe)?;
    if outcome == Outcome::Interrupted {
        return Ok(Generated::Interrupted);
    }
    let gone = corpus::status_of(store, &spec, &selected)?.to_build();
    if !gone.is_empty() {
        return Err(CorpusBuildError::Gone { place: store.place(), shards: ranges::to_text(&gone) });
    }
    if how.selection.is_some() {
        return Ok(Generated::Part { shards: selected, tally });
    }
    let manifest = corpus::finalize_knowing(store, &spec, Known { built: &shards, signed: None })?;
    Ok(Generated::Whole(Box::new(Whole { manifest, tally })))
}

/// The shards that are selected, ascending.
pub(crate) fn selected_shards(plan: &Plan, selection: Option<&Selection>) -> Result<Vec<u64>, CorpusBuildError> {
    let Some(selection) = selection else { return Ok((0..plan.shards()).collect()) };
    selection.of(plan.shards()).map_err(|why| CorpusBuildError::Selection(why.to_string()))
}
