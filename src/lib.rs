//! marsyard: a mars yard made of software.
//!
//! It builds random yards, drives rovers through them, scans them with LiDAR, estimates the rover's pose with FastSLAM 2.0,
//! and writes per-cell features and labels as Parquet shards:
//!
//! ```text
//! scene -> drive -> sweep -> slam -> cells     the stages: one yard, one rover, one scan
//!    \________ episode ________/               one scene, from its address in a plan to its rows
//! config -> plan -> build -> corpus            scenes on all threads, shards in a place
//! corpus -> train -> evaluate, search          a network, and how good it is
//! cloud  -> judge                              a real scan: its cells by the network, maps
//! ```
//!
//! The modules stand in that order, and `use` points up this list only. The shelf is pure maths and knows nothing; a stage is a function of
//! its parameters, its inputs, a scratch space and its random streams; files are touched by `config`, `corpus` and what lies below;
//! the verbs speak.
//!
//! Without features the library is the stages, a plan and an episode: one scene to arrays, with no file format, no text and no threads.
//! `corpus` adds configs and shards, `train` the networks and real scans, `cli` (the default) the verbs, pictures and studies of cost;
//! `object-stores` corpora in `s3://`, `gs://` and `az://`.
//!
//! # One scene to arrays
//!
//! ```
//! use std::path::Path;
//!
//! use marsyard::config;
//! use marsyard::episode::{Prepared, Scratch, Unobserved, run_scene};
//!
//! // Any key of a config may be set from outside; cells of 0.2 m here.
//! let plan = config::load(Path::new("configs/quickstart.yaml"), &["cells.size_m=0.2".into()])?;
//! let prepared = Prepared::new(plan)?;
//! let scene = run_scene(&prepared, 3, &mut Scratch::default(), &mut Unobserved);
//! assert_eq!(scene.error, None);
//! let scan = &scene.scans[0];
//! let untraversable = scan.cells.rows.iter().filter(|row| row.label == Some(1)).count();
//! assert!(untraversable > 0 && untraversable < scan.cells.rows.len());
//! // Row-major: as many columns as the config names features.
//! let columns = scan.cells.features.len() / scan.cells.rows.len();
//! assert_eq!(columns, prepared.plan.corpus_spec().features.len());
//! // The same address, the same bits: on any thread, after any other scene.
//! let again = run_scene(&prepared, 3, &mut Scratch::default(), &mut Unobserved);
//! assert_eq!(again.scans[0].cells.features, scan.cells.features);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A corpus, built and opened
//!
//! ```
//! use std::path::Path;
//! use std::sync::atomic::AtomicBool;
//!
//! use marsyard::build::{Job, Outcome, build_shards};
//! use marsyard::corpus::{Finished, LocalFolder, Place, Split, finalize};
//! use marsyard::{config, episode::Prepared};
//!
//! let sets = ["scenes=7", "scenes_per_shard=1"].map(String::from);
//! let plan = config::load(Path::new("configs/quickstart.yaml"), &sets)?;
//! let spec = plan.corpus_spec();
//! let folder = tempfile::tempdir()?;
//! let store = LocalFolder::new(folder.path());
//! // An empty folder, or the plan's own: any other is refused.
//! let place = Place::open(&store, &spec)?;
//! let shards: Vec<u64> = (0..plan.shards()).collect();
//! let stop = AtomicBool::new(false);
//! let job = Job { shards: &shards, threads: 2, stop: &stop, hashes: false };
//! let built = build_shards(&Prepared::new(plan)?, &spec, job, |_| (), |shard| place.commit(&shard))?;
//! assert_eq!(built, Outcome::Done);
//! let manifest = finalize(&store, &spec)?;
//! // Readers open a corpus whole, or not at all.
//! let corpus = Finished::open(&store)?;
//! assert_eq!(corpus.lines_of(Split::Train).count(), 5);
//! assert_eq!(corpus.manifest.corpus_id, manifest.corpus_id);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

// The shelf.
pub mod math;

pub mod cpu;

pub mod wide;

pub mod geometry;

pub mod random;

pub mod preset;

// The stages.
pub mod scene;

pub mod drive;

pub mod sweep;

pub mod slam;

pub mod cells;

// One scene.
pub mod plan;

pub mod episode;

// Many scenes.
#[cfg(feature = "corpus")]
pub mod parallel;

#[cfg(feature = "corpus")]
pub mod corpus;

#[cfg(feature = "corpus")]
pub mod config;

#[cfg(feature = "corpus")]
pub mod build;

// Networks.
#[cfg(feature = "train")]
pub mod train;

#[cfg(feature = "train")]
pub mod evaluate;

#[cfg(feature = "train")]
pub mod search;

#[cfg(feature = "train")]
pub mod cloud;

#[cfg(feature = "train")]
pub mod judge;

// The program.
#[cfg(feature = "cli")]
pub mod picture;

#[cfg(feature = "cli")]
pub mod measure;

#[cfg(feature = "cli")]
pub mod cli;

// Unit tests run as the program does: with the pinned functions under the C library's names.
#[cfg(test)]
mod c_symbols;

#[cfg(test)]
mod extremes;
