//! What a corpus costs, and what that buys.
//!
//! [`estimate`] measures a plan on some of its own scenes: time, rows, bytes, the price of each part. `tradeoff` measures what each
//! choice of speed against accuracy costs and how far the network's errors move with it. Both time with [`clock`] and compare what is
//! measured in turn with [`interleave`].

pub mod clock;
pub mod estimate;
pub mod interleave;
pub(crate) mod tradeoff;
