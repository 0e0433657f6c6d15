//! The calls that a program makes first: simulate a scene, build a corpus, open one, train on it.
//!
//! In: a checked plan, or the place of a corpus. Out: arrays, a finished corpus, a model; an error type a call. Each is a few lines over
//! the modules below it, which stay open to whoever wants more: progress, a stop, parts of a corpus on several machines, several
//! corpora, `--init`. Not here: what the verbs say.

use crate::episode::{FailedScene, Prepared, Replay, Scratch, Unobserved, replay_scene};

#[cfg(feature = "corpus")]
pub use corpora::{BuildCorpusError, build_corpus, open_corpus};
#[cfg(feature = "train")]
pub use networks::{TrainNetworkError, train_network};

/// Simulates one scene of a plan: the yard, the drive, the poses and the cells of every kept scan, or why there are none.
///
/// It is a pure function of the plan and the scene's number: the same bits on any thread and after any other scene. Many scenes reuse
/// their working memory by [`replay_scene`](crate::episode::replay_scene).
///
/// ```
/// # #[cfg(feature = "corpus")] {
/// use std::path::Path;
///
/// use marsyard::{config, episode::Prepared, simulate_scene};
///
/// // Any key of a config may be set from outside; cells of 0.2 m here.
/// let plan = config::load(Path::new("configs/quickstart.yaml"), &["cells.size_m=0.2".into()])?;
/// let prepared = Prepared::new(plan)?;
/// let scene = simulate_scene(&prepared, 3)?;
/// let cells = &scene.scans[0].cells;
/// let untraversable = cells.rows.iter().filter(|row| row.untraversable()).count();
/// assert!(untraversable > 0 && untraversable < cells.rows.len());
/// // Row-major: as many columns as the config names features.
/// let columns = cells.features.len() / cells.rows.len();
/// assert_eq!(columns, prepared.plan.corpus_spec().features.len());
/// assert_eq!(cells.points_in, cells.points_binned + cells.dropped_beyond_range + cells.dropped_off_grid);
/// // The same number, the same bits.
/// assert_eq!(simulate_scene(&prepared, 3)?.scans[0].cells.features, cells.features);
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn simulate_scene(prepared: &Prepared, scene_id: u64) -> Result<Replay, Box<FailedScene>> {
    replay_scene(prepared, scene_id, &mut Scratch::default(), &mut Unobserved)
}

#[cfg(feature = "corpus")]
mod corpora {
    use std::path::Path;
    use std::sync::atomic::AtomicBool;

    use crate::build::{CorpusBuildError, Generate, Generated, KEEP_FREE_BYTES, generate};
    use crate::corpus::{CorpusError, Finished, address};
    use crate::plan::Plan;

    /// Why a corpus was not built.
    #[derive(Debug, thiserror::Error)]
    pub enum BuildCorpusError {
        /// The place, or the finished corpus in it.
        #[error(transparent)]
        Corpus(#[from] CorpusError),
        /// Its scenes or shards.
        #[error(transparent)]
        Build(#[from] CorpusBuildError),
        /// The corpus is there, with fewer scenes than its plan allows.
        #[error("{failed} of {scenes} scenes failed, more than max_failed_share = {share}; the first, {first}: {why}")]
        TooManyFailed { failed: u64, scenes: u64, share: f64, first: u64, why: String },
    }

    /// Builds what a folder (or an object store's URL) lacks of a plan's corpus, and finishes it.
    ///
    /// Killed at any moment it leaves whole shards; the same call again goes on from them, to the same bytes. A place that holds
    /// anything else than this plan's corpus is refused, untouched. A stop, progress, parts of a corpus: [`generate`].
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use marsyard::corpus::Split;
    /// use marsyard::{build_corpus, config};
    ///
    /// let folder = tempfile::tempdir()?;
    /// let load = |stops: &str| {
    ///     let sets = ["scenes=7", "scenes_per_shard=1", stops].map(String::from);
    ///     config::load(Path::new("configs/quickstart.yaml"), &sets)
    /// };
    /// let corpus = build_corpus(&load("drive.stops=1")?, folder.path(), 2)?;
    /// let shards = Split::ALL.map(|split| corpus.lines_of(split).count());
    /// assert_eq!(shards, [5, 1, 1]);
    /// // Nothing is left to do, and nothing changes.
    /// let again = build_corpus(&load("drive.stops=1")?, folder.path(), 1)?;
    /// assert_eq!(again.manifest.corpus_id, corpus.manifest.corpus_id);
    /// // Another plan does not write here.
    /// let refused = build_corpus(&load("drive.stops=2")?, folder.path(), 1).err().map(|error| error.to_string());
    /// assert!(refused.is_some_and(|error| error.contains("+ drive.stops: 2")));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn build_corpus(plan: &Plan, place: &Path, threads: usize) -> Result<Finished, BuildCorpusError> {
        let store = address::open(place)?;
        let how = Generate {
            selection: None,
            plan_only: false,
            discard_beyond: false,
            threads,
            keep_free_bytes: KEEP_FREE_BYTES,
            stage_hashes: None,
        };
        let built = generate(plan, store.as_ref(), &how, &AtomicBool::new(false), &mut |_| ())?;
        let Generated::Whole(whole) = built else {
            unreachable!("all shards are selected, and nobody stops the build")
        };
        let manifest = whole.manifest;
        let (failed, scenes, share) = (manifest.failed.len() as u64, manifest.scenes, plan.max_failed_share);
        if let Some(first) = manifest.too_many_failed(share) {
            let (first, why) = (first.scene, first.error.clone());
            return Err(BuildCorpusError::TooManyFailed { failed, scenes, share, first, why });
        }
        Ok(Finished::open(store.as_ref())?)
    }

    /// Opens the finished corpus in a folder or at an object store's URL: whole, or not at all.
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use marsyard::corpus::{Split, Table};
    /// use marsyard::{build_corpus, config, open_corpus};
    ///
    /// let folder = tempfile::tempdir()?;
    /// let sets = ["scenes=2", "scenes_per_shard=1", "drive.stops=1"].map(String::from);
    /// build_corpus(&config::load(Path::new("configs/quickstart.yaml"), &sets)?, folder.path(), 2)?;
    /// let corpus = open_corpus(folder.path())?;
    /// let shard = corpus.lines_of(Split::Train).next().ok_or("a shard")?;
    /// // The table's bytes are held against their hash when it is opened.
    /// let cells = corpus.open_table(shard, Table::Cells).map_err(|why| corpus.refused(shard, Table::Cells, why))?;
    /// let cells = cells.ok_or("the cells are a table of every corpus")?;
    /// let rows: usize = cells.batches().map(|batch| batch.map(|rows| rows.num_rows())).sum::<Result<_, _>>()?;
    /// assert_eq!(rows as u64, shard.tables[&Table::Cells].rows);
    /// // One byte less, and it is no corpus any more.
    /// let file = folder.path().join(Table::Cells.path(shard.shard));
    /// let bytes = std::fs::read(&file)?;
    /// std::fs::write(&file, &bytes[1..])?;
    /// assert!(open_corpus(folder.path()).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open_corpus(place: &Path) -> Result<Finished, CorpusError> {
        Finished::open(address::open(place)?.as_ref())
    }
}

#[cfg(feature = "train")]
mod networks {
    use std::path::Path;
    use std::sync::atomic::AtomicBool;

    use crate::config::{self, ConfigError};
    use crate::corpus::{address, plan_file};
    use crate::train::corpora::{self, CorpusToLearn, Joined};
    use crate::train::{Model, ModelError, Setup, Source, TrainError, TrainParams, folder, train};

    /// Why no network was trained.
    #[derive(Debug, thiserror::Error)]
    pub enum TrainNetworkError {
        /// The corpus, the parameters or the run folder.
        #[error(transparent)]
        Train(#[from] TrainError),
        /// The corpus's own plan.
        #[error("{}", .0.lines())]
        Plan(ConfigError),
        /// The model that was written.
        #[error(transparent)]
        Model(#[from] ModelError),
    }

    /// Trains a network on the finished corpus in a folder or at a URL, and leaves a run folder, which must not be there yet.
    ///
    /// The network is the one after the look at the validation split with the smallest error. Equal corpora and parameters give equal
    /// bits. Several corpora, a start from another network and a resume: [`train::train`](crate::train::train).
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use marsyard::{build_corpus, config, train_network};
    ///
    /// let folder = tempfile::tempdir()?;
    /// let (corpus, run) = (folder.path().join("corpus"), folder.path().join("run"));
    /// let sets = ["scenes=7", "scenes_per_shard=1", "drive.stops=1", "cells.size_m=0.2"].map(String::from);
    /// build_corpus(&config::load(Path::new("configs/quickstart.yaml"), &sets)?, &corpus, 2)?;
    ///
    /// let params = config::load_train(None, &["network.hidden=[4]", "epochs=1"].map(String::from))?;
    /// let model = train_network(&corpus, params, &run)?;
    ///
    /// // Each of two networks side by side: features, their normal scores and a bias to each of 4 neurons, 4 and a bias to the output.
    /// let features = model.about.features.len();
    /// assert_eq!(model.network.weights.len(), 2 * (4 * (2 * features + 1) + 5));
    /// // An output lies in (0, 1): low is traversable, high untraversable.
    /// let output = model.output(&vec![0.0; features]);
    /// assert!(output > 0.0 && output < 1.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn train_network(corpus: &Path, params: TrainParams, out: &Path) -> Result<Model, TrainNetworkError> {
        let store = address::open(corpus).map_err(TrainError::Corpus)?;
        let source = Source::open(store.as_ref(), 1.0)?;
        let plan = config::load(&corpus.join(plan_file::NAME), &[]).map_err(TrainNetworkError::Plan)?;
        let learn = CorpusToLearn { place: corpus.display().to_string(), source, plan };
        let Joined { sources, origin, .. } = corpora::join(vec![learn], &params, None, false)?;
        let setup = Setup {
            config_yaml: config::train_yaml(&params),
            sources,
            params,
            origin,
            out: out.into(),
            resume: false,
            init: None,
            ahead: 1,
        };
        train(&setup, &AtomicBool::new(false), &mut |_| ())?;
        Ok(Model::read(&out.join(folder::MODEL))?)
    }
}
