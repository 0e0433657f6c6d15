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
//! # Where to begin
//!
//! | to | call | without which feature it is not there |
//! |---|---|---|
//! | simulate one scene, as arrays | [`simulate_scene`] | |
//! | build a corpus, or go on building it | [`build_corpus`] | `corpus` |
//! | open one | [`open_corpus`] | `corpus` |
//! | train a network on it | [`train_network`] | `train` |
//! | judge a real scan | [`judge::ScanJudge`] | `train` |
//!
//! Each has an example that runs, and so have the doors of the stages below them, for who brings scenes, sensors, readings or features of
//! their own. `examples/` holds whole programs.

#![warn(unreachable_pub)]
// With fewer features, what only the layers above call stands unused.
#![cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]

// The shelf.
pub mod math;

pub mod cpu;

pub(crate) mod wide;

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
pub mod recording;

#[cfg(feature = "corpus")]
pub mod build;

// Networks.
#[cfg(feature = "train")]
pub mod statistics;

#[cfg(feature = "train")]
mod chart;

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

#[cfg(feature = "corpus")]
pub(crate) mod shell;

// The calls to begin with.
mod front;

pub use front::simulate_scene;
#[cfg(feature = "corpus")]
pub use front::{BuildCorpusError, build_corpus, open_corpus};
#[cfg(feature = "train")]
pub use front::{TrainNetworkError, train_network};

// The program.
#[cfg(feature = "cli")]
mod picture;

#[cfg(feature = "cli")]
pub mod measure;

#[cfg(feature = "cli")]
pub mod cli;

// Unit tests run as the program does: with the pinned functions under the C library's names.
#[cfg(test)]
mod c_symbols;

#[cfg(test)]
mod extremes;
