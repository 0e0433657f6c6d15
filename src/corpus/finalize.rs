//! Receipts of a place -> `shards.jsonl`, card, Croissant and manifest: what makes whole shards a corpus.
//!
//! The manifest names the others by their hashes and is written last: a corpus whose finalize was cut off is the old one whole, or is
//! refused by readers until another finalize ends. A receipt is held against the corpus that was finished before: one that changed
//! since is refused, where it was not built just now. Where there is no finished corpus receipts are taken at their word: what was
//! edited in one to fit its shard is merged, and only a shard that is built again tells.

use super::finished::{self, Listed};
use super::limits::FileKind;
use super::manifest::{self, Merge};
use super::place::Place;
use super::status::survey;
use super::{CorpusError, CorpusSpec, Manifest, Receipt, Store, card, croissant, owner, plan_file, ranges, sha256};
use crate::shell;

/// What whoever asks for a merge knows beside the plan.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Known<'a> {
    /// Shards that were built just now, ascending: their receipts may differ from those that the corpus was finished with.
    pub built: &'a [u64],
    /// The SHA-256 of the manifest that was signed: no other is written.
    pub signed: Option<&'a str>,
}

/// Merges the receipts of whoever built the shards into `shards.jsonl`, `manifest.json`, card and Croissant; refuses gaps, files that
/// are of no shard, and receipts that changed since the corpus was finished.
pub(crate) fn finalize(store: &dyn Store, spec: &CorpusSpec) -> Result<Manifest, CorpusError> {
    finalize_knowing(store, spec, Known::default())
}

/// The same, by somebody who knows more.
pub(crate) fn finalize_knowing(store: &dyn Store, spec: &CorpusSpec, known: Known) -> Result<Manifest, CorpusError> {
    let place = Place::of(store, spec);
    place.still_there()?;
    owner::check_derived(store)?;
    let before = Before::read(store, spec)?;
    let mut merge = Merge::new(spec);
    let mut changed = Vec::new();
    let all: Vec<u64> = (0..spec.shards()).collect();
    let status = survey(store, spec, &all, |receipt, bytes| {
        merge.add(receipt, bytes);
        let is_built = known.built.binary_search(&receipt.shard).is_ok();
        if !is_built && before.as_ref().is_some_and(|before| before.listed.has_other(receipt.shard, bytes)) {
            changed.push(receipt.shard);
        }
    })?;
    let gaps = status.gaps();
    if !gaps.is_empty() {
        return Err(CorpusError::Gaps {
            place: store.place(),
            missing: gaps.len() as u64,
            shards: spec.shards(),
            ranges: ranges::to_text(&gaps),
        });
    }
    refuse_changed(store, &changed)?;
    place.refuse_strays()?;
    let (mut manifest, lines) = merge.finish();
    before.as_ref().map_or(Ok(()), |before| before.refuse_unknown(store, &manifest, &lines))?;
    let plan = FileKind::Config.read(store, plan_file::NAME)?;
    let card = card::text(spec, &manifest).into_bytes();
    let croissant = croissant::text(spec, &manifest).into_bytes();
    let files = [(manifest::SHARDS, lines.into_bytes()), (card::NAME, card), (croissant::NAME, croissant)];
    manifest.files = files.iter().map(|(name, bytes)| (name.to_string(), sha256(bytes))).collect();
    manifest.files.insert(plan_file::NAME.into(), sha256(&plan));
    for (name, bytes) in &files[1..] {
        let last = before.as_ref().and_then(|before| before.last_written(name));
        owner::check_text(store, name, bytes, last)?;
    }
    let text = manifest.text();
    refuse_unreadable(store, &manifest)?;
    known.signed.map_or(Ok(()), |signed| refuse_unsigned(store, &text, signed))?;
    place.still_there()?;
    files.iter().try_for_each(|(name, bytes)| store.replace(name, bytes))?;
    place.still_there()?;
    // Last: whoever waits for the manifest finds the rest.
    store.replace(manifest::NAME, text.as_bytes())?;
    place.sweep()?;
    Ok(manifest)
}

/// The corpus that was finished here before, of the same plan or of fewer or more scenes.
struct Before {
    manifest: Manifest,
    listed: Listed,
}

impl Before {
    /// `None` where there is none, or only one of which too little is known: of format 1, or with a damaged manifest.
    fn read(store: &dyn Store, spec: &CorpusSpec) -> Result<Option<Before>, CorpusError> {
        let manifest = match Manifest::read(store) {
            Ok(manifest) if manifest.format > 1 && manifest.scene_plan_hash == spec.scene_plan_hash => manifest,
            Ok(_) | Err(CorpusError::BadManifest { .. } | CorpusError::OtherFormat { .. }) => return Ok(None),
            Err(error) => return Err(error),
        };
        let listed = Listed::read(store, &manifest)?;
        Ok(Some(Before { manifest, listed }))
    }

    /// The SHA-256 of a file beside the manifest, where it is known which of them was written last: not where a finalize was cut off.
    fn last_written(&self, name: &str) -> Option<&str> {
        let is_cut_off = self.listed == Listed::Other;
        self.manifest.files.get(name).map(String::as_str).filter(|_| !is_cut_off)
    }

    /// Refuses receipts that are not those of the same corpus before, where its list, damaged or gone, cannot say which of them
    /// changed. A list that is what is about to be written is that of a finalize that was cut off, and is gone on with.
    fn refuse_unknown(&self, store: &dyn Store, manifest: &Manifest, lines: &str) -> Result<(), CorpusError> {
        let Before { manifest: there, listed } = self;
        let is_same = there.receipts_sha256 == manifest.receipts_sha256;
        let is_known = matches!(listed, Listed::Own(receipts) if receipts.len() as u64 == manifest.shards);
        if is_known || is_same || there.scenes != manifest.scenes {
            return Ok(());
        }
        let kind = FileKind::ShardList { shards: manifest.shards };
        if finished::read_present(store, manifest::SHARDS, kind)?.as_deref() == Some(lines.as_bytes()) {
            return Ok(());
        }
        let (place, at) = (store.place(), shell::word(store.place()));
        let reason = "its receipts_sha256 is not that of the receipts, and the list that would say which of them changed, \
                      shards.jsonl, is not the manifest's either";
        let cure = format!(
            "bring shards.jsonl back, `marsyard verify {at}` then names the receipt; or remove {}, and `marsyard finalize {at}` \
             takes the receipts as they are",
            manifest::NAME
        );
        Err(CorpusError::NotWhole { place, name: manifest::NAME.into(), reason: reason.into(), cure })
    }
}

/// What is said of a receipt that is not the one that the corpus was finished with.
pub(crate) const CHANGED_RECEIPT: &str =
    "its SHA-256 is not that of shards.jsonl: it was edited, damaged or written anew since the corpus was finished";

fn refuse_changed(store: &dyn Store, changed: &[u64]) -> Result<(), CorpusError> {
    let Some(&first) = changed.first() else { return Ok(()) };
    let (place, at) = (store.place(), shell::word(store.place()));
    let more = if changed.len() == 1 { String::new() } else { format!(" (and {} more)", changed.len() - 1) };
    let cure = format!("`marsyard verify {at} --repair` builds its shard anew");
    Err(CorpusError::NotWhole { place, name: Receipt::path(first), reason: CHANGED_RECEIPT.to_string() + &more, cure })
}

/// Refuses to write what readers would refuse.
fn refuse_unreadable(store: &dyn Store, manifest: &Manifest) -> Result<(), CorpusError> {
    let cure = "nothing was written; report it with the plan.yaml";
    let refused = |reason: String| CorpusError::NotWhole {
        place: store.place(),
        name: manifest::NAME.into(),
        reason: format!("it would not be readable: {reason}"),
        cure: cure.into(),
    };
    manifest.check().map_err(refused)
}

fn refuse_unsigned(store: &dyn Store, text: &str, signed: &str) -> Result<(), CorpusError> {
    if sha256(text.as_bytes()) == signed {
        return Ok(());
    }
    let reason = "this program would write another one than was signed";
    let cure =
        "use the marsyard that wrote the corpus; without --key it is written all the same, and is no longer signed";
    Err(CorpusError::NotWhole {
        place: store.place(),
        name: manifest::NAME.into(),
        reason: reason.into(),
        cure: cure.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::LocalFolder;

    #[test]
    fn exact_changed_receipts_are_refused_by_the_first_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let store = LocalFolder::new(folder.path());
        let said = |changed: &[u64]| refuse_changed(&store, changed).err().map(|error| error.to_string());
        assert_eq!(said(&[]), None);
        let (one, three) = (said(&[4]).unwrap(), said(&[4, 7, 9]).unwrap());
        assert!(one.contains(&Receipt::path(4)) && !one.contains(" more)"), "{one}");
        assert!(three.contains(&Receipt::path(4)) && three.contains("(and 2 more)"), "{three}");
    }
}
