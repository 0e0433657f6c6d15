//! marsyard: a mars yard made of software.
//!
//! It builds random yards, drives rovers through them, scans them with LiDAR, estimates the rover's pose with FastSLAM 2.0,
//! and writes per-cell features and labels as Parquet shards:
//!
//! ```text
//! scene -> drive -> sweep -> slam -> cells -> corpus
//! ```
//!
//! The modules stand in that order. The shelf is pure maths and knows nothing; a stage is a function of its parameters, its
//! inputs, a scratch space and its random streams; files are touched by the boundary alone; the top knows everything and
//! computes nothing. `use` points up this list only.

pub mod math;

pub mod cpu;

pub mod wide;

pub mod geometry;

pub mod random;

pub mod preset;

pub mod scene;

pub mod drive;

pub mod sweep;

pub mod slam;

pub mod cells;

pub mod corpus;

pub mod train;

pub mod evaluate;

pub mod search;

pub mod cloud;

pub mod config;

pub mod picture;

pub mod pipeline;

pub mod estimate;

pub mod tradeoff;

pub mod cli;

// Unit tests run as the program does: with the pinned functions under the C library's names.
#[cfg(test)]
mod c_symbols;

#[cfg(test)]
mod extremes;
