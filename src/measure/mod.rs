//! What a corpus costs, and what that buys.
//!
//! [`estimate`] measures a plan on some of its own scenes: time, rows, bytes, the price of each part. `tradeoff` measures what each
//! choice of speed against accuracy costs, errs and is worth; `study` is the file that keeps its learning curves, and `budget` makes of them what
//! to build in some hours. All time with [`clock`] and compare what is measured in turn with [`interleave`].

pub(crate) mod budget;
pub mod clock;
pub mod estimate;
pub mod interleave;
pub(crate) mod study;
pub(crate) mod tradeoff;
