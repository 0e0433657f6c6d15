//! A growth, a finalize, a repair and a way back, each cut off after every write: readers find the old corpus whole, the new one
//! whole, or are refused with the command that completes it; and it does.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::fixture::{corpus, scene, spec, write_shard};
use crate::corpus::store::{Files, Put};
use crate::corpus::{
    CorpusError, CorpusSpec, Finished, Known, LocalFolder, Manifest, Place, ShardWriter, Store, Table, finalize,
    finalize_knowing, status, verify,
};

/// A folder whose writer is killed after so many writes.
#[derive(Clone)]
struct Killed {
    folder: LocalFolder,
    left: Arc<AtomicUsize>,
}

impl Killed {
    fn after(folder: &LocalFolder, writes: usize) -> Killed {
        Killed { folder: folder.clone(), left: Arc::new(AtomicUsize::new(writes)) }
    }

    fn write<T>(&self, name: &str, write: impl FnOnce() -> Result<T, CorpusError>) -> Result<T, CorpusError> {
        let one_less = |left: usize| left.checked_sub(1);
        if self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_less).is_ok() {
            return write();
        }
        let source = std::io::Error::other("killed");
        Err(CorpusError::Io { place: self.place(), name: name.into(), source })
    }
}

impl Store for Killed {
    fn put(&self, name: &str, bytes: &[u8]) -> Result<Put, CorpusError> {
        self.write(name, || self.folder.put(name, bytes))
    }
    fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), CorpusError> {
        self.write(name, || self.folder.replace(name, bytes))
    }
    fn remove(&self, name: &str) -> Result<(), CorpusError> {
        self.write(name, || self.folder.remove(name))
    }
    fn read_within(&self, name: &str, most: u64) -> Result<Vec<u8>, CorpusError> {
        self.folder.read_within(name, most)
    }
    fn first_entry(&self) -> Result<Option<String>, CorpusError> {
        self.folder.first_entry()
    }
    fn read_range(&self, name: &str, offset: u64, length: usize) -> Result<Vec<u8>, CorpusError> {
        self.folder.read_range(name, offset, length)
    }
    fn list(&self, folder: &str) -> Result<Vec<(String, u64)>, CorpusError> {
        self.folder.list(folder)
    }
    fn list_all(&self, folder: &str) -> Result<(Files, Vec<String>), CorpusError> {
        self.folder.list_all(folder)
    }
    fn size(&self, name: &str) -> Result<Option<u64>, CorpusError> {
        self.folder.size(name)
    }
    fn sweep_temporaries(&self, folder: &str) -> Result<(), CorpusError> {
        self.folder.sweep_temporaries(folder)
    }
    fn share(&self) -> Arc<dyn Store> {
        Arc::new(self.clone())
    }
    fn place(&self) -> String {
        self.folder.place()
    }
}

const TABLES: [Table; 2] = [Table::Cells, Table::Scenes];

/// What `marsyard generate` does with shards that are made at once.
fn generate(store: &dyn Store, spec: &CorpusSpec) -> Result<Manifest, CorpusError> {
    let place = Place::open(store, spec)?;
    build(store, spec, &place)
}

/// What `marsyard generate --discard-beyond` does.
fn generate_discarding(store: &dyn Store, spec: &CorpusSpec) -> Result<Manifest, CorpusError> {
    let (place, _) = Place::open_discarding(store, spec)?;
    build(store, spec, &place)
}

fn build(store: &dyn Store, spec: &CorpusSpec, place: &Place) -> Result<Manifest, CorpusError> {
    let status = status(store, spec)?;
    status.damaged.iter().try_for_each(|(shard, _)| place.discard(*shard))?;
    status.to_build().into_iter().try_for_each(|shard| place.commit(&write_shard(spec, shard)))?;
    finalize(store, spec)
}

/// What `marsyard verify --repair` does.
fn repair(store: &dyn Store, spec: &CorpusSpec) -> Result<Manifest, CorpusError> {
    let findings = verify::verify(store, spec, None)?;
    let place = Place::open(store, spec)?;
    let mut shards: Vec<u64> = findings.iter().filter_map(|finding| finding.shard).collect();
    shards.dedup();
    shards.iter().try_for_each(|&shard| place.discard(shard))?;
    place.remove_strays()?;
    shards.iter().try_for_each(|&shard| place.commit(&write_shard(spec, shard)))?;
    finalize(store, spec)
}

/// The manifest, where readers take the place for a whole corpus; the rows of every shard are then those of its list.
fn read(store: &LocalFolder) -> Result<Manifest, String> {
    let finished = Finished::open(store).map_err(|error| error.to_string())?;
    for line in &finished.lines {
        for table in TABLES {
            assert!(finished.open_table(line, table).unwrap().is_some(), "{line:?}");
        }
    }
    Ok(finished.manifest)
}

fn names(store: &LocalFolder) -> Vec<String> {
    let folders = ["data/cells", "data/scenes", "receipts"];
    folders.iter().flat_map(|folder| store.list(folder).unwrap()).map(|(name, _)| name).collect()
}

#[test]
fn law_a_growth_killed_after_any_write_is_the_old_corpus_or_the_new_one_or_refused_and_goes_on() {
    let (small, large) = (spec(4, &TABLES), spec(8, &TABLES));
    let (_dir, fresh, whole) = corpus(&large);
    let mut refusals = 0;
    for writes in 0.. {
        let (_dir, store, before) = corpus(&small);
        let done = generate(&Killed::after(&store, writes), &large);
        match read(&store) {
            Ok(manifest) => assert!(manifest == before || manifest == whole, "{writes}"),
            Err(said) => {
                assert!(said.contains(&format!("`marsyard generate {}` completes it", store.place())), "{said}");
                refusals += 1;
                assert_eq!(generate(&store, &large).unwrap(), whole, "{writes}");
            }
        }
        if done.is_ok() {
            break;
        }
        assert_eq!(generate(&store, &large).unwrap(), whole);
        assert_eq!((read(&store).unwrap(), names(&store)), (whole.clone(), names(&fresh)), "{writes}");
        assert_eq!(verify::verify(&store, &large, None).unwrap(), []);
    }
    assert!(refusals >= 8, "{refusals}");
}

#[test]
fn law_the_old_config_after_a_killed_growth_leaves_nothing_behind_that_a_glob_would_read() {
    let (small, large) = (spec(4, &TABLES), spec(8, &TABLES));
    let mut refused = 0;
    for writes in 0.. {
        let (_dir, store, before) = corpus(&small);
        let fresh = names(&store);
        let done = generate(&Killed::after(&store, writes), &large).is_ok();
        match generate(&store, &small) {
            Ok(manifest) => assert_eq!(manifest, before),
            Err(error @ CorpusError::BeyondPlan { .. }) => {
                refused += 1;
                let said = error.to_string();
                assert!(said.contains("raise `scenes`") && said.contains("--discard-beyond"), "{said}");
                assert_eq!(generate_discarding(&store, &small).unwrap(), before);
            }
            Err(error) => panic!("{error}"),
        }
        assert_eq!((read(&store).unwrap(), names(&store)), (before, fresh), "{writes}");
        assert_eq!(verify::verify(&store, &small, None).unwrap(), []);
        if done {
            break;
        }
    }
    assert!(refused > 3, "{refused}");
}

#[test]
fn law_letting_go_of_shards_killed_after_any_write_is_refused_with_what_completes_it() {
    let (small, large) = (spec(4, &TABLES), spec(8, &TABLES));
    let (_dir, fresh, less) = corpus(&small);
    for writes in 0.. {
        let (_dir, store, before) = corpus(&large);
        let done = generate_discarding(&Killed::after(&store, writes), &small).is_ok();
        match read(&store) {
            Ok(manifest) => assert!(manifest == before || manifest == less, "{writes}"),
            Err(said) => assert!(said.contains("--discard-beyond` completes it"), "{said}"),
        }
        assert_eq!(generate_discarding(&store, &small).unwrap(), less);
        assert_eq!((read(&store).unwrap(), names(&store)), (less.clone(), names(&fresh)), "{writes}");
        if done {
            break;
        }
    }
}

#[test]
fn law_a_finalize_killed_after_any_write_is_the_old_corpus_or_the_new_one_or_refused_until_the_next() {
    let spec = spec(4, &TABLES);
    let mut refusals = 0;
    for writes in 0.. {
        let (_dir, store, before) = corpus(&spec);
        // Another program's shard, and so another list.
        let mut other = ShardWriter::with_zstd_level(&spec, 1, 9).unwrap();
        spec.scenes_of(1).for_each(|id| other.push(&scene(id, 40)).unwrap());
        Place::open(&store, &spec).unwrap().discard(1).unwrap();
        other.finish().unwrap().commit(&store).unwrap();
        let known = Known { built: &[1], signed: None };
        let done = finalize_knowing(&Killed::after(&store, writes), &spec, known);
        match Finished::open(&store) {
            Ok(finished) => {
                assert!(finished.manifest == before || Ok(&finished.manifest) == done.as_ref().map_err(|_| ()))
            }
            Err(error) => {
                refusals += 1;
                let said = error.to_string();
                assert!(said.contains("marsyard finalize") || said.contains("--repair"), "{said}");
            }
        }
        let after = finalize_knowing(&store, &spec, known).unwrap();
        assert_eq!(read(&store).unwrap(), after);
        if done.is_ok() {
            break;
        }
    }
    assert!(refusals > 0);
}

#[test]
fn law_a_repair_killed_after_any_write_is_refused_until_the_next() {
    let spec = spec(4, &TABLES);
    for writes in 0.. {
        let (_dir, store, before) = corpus(&spec);
        let fresh = names(&store);
        let path = Table::Cells.path(1);
        let whole = store.read(&path).unwrap();
        store.replace(&path, &whole[..whole.len() / 2]).unwrap();
        store.put("data/cells/train-0000099.parquet", &store.read(&Table::Cells.path(0)).unwrap()).unwrap();
        let done = repair(&Killed::after(&store, writes), &spec).is_ok();
        match read(&store) {
            Ok(manifest) => assert_eq!(manifest, before),
            Err(said) => assert!(said.contains(&format!("marsyard verify {} --repair", store.place())), "{said}"),
        }
        assert_eq!(repair(&store, &spec).unwrap(), before);
        assert_eq!((read(&store).unwrap(), names(&store)), (before, fresh), "{writes}");
        if done {
            break;
        }
    }
}

#[test]
fn law_a_growth_that_is_overtaken_stops_and_leaves_nothing_behind_the_end() {
    let (small, large) = (spec(4, &TABLES), spec(8, &TABLES));
    let (_dir, store, before) = corpus(&small);
    let growth = Place::open(&store, &large).unwrap();
    growth.commit(&write_shard(&large, 2)).unwrap();
    // The old config comes while the growth lives, and lets go of what is there.
    assert_eq!(generate_discarding(&store, &small).unwrap(), before);
    let refused = growth.commit(&write_shard(&large, 3)).unwrap_err();
    assert!(matches!(refused, CorpusError::Overtaken { .. }), "{refused}");
    assert!(matches!(finalize(&store, &large), Err(CorpusError::Overtaken { .. })));
    assert_eq!(read(&store).unwrap(), before);
    assert_eq!(verify::verify(&store, &small, None).unwrap(), []);
}
