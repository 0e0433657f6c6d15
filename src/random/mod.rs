//! Addresses -> random draws, and constants or distributions for config values.
//!
//! A draw has an address: (seed, scene, attempt, stage, step, purpose) opens a [`Stream`]; an index (rock, beam, particle)
//! is a position in it. Switching an effect on, adding trees or one more beam moves no other draw. There is no global
//! generator, no default seed and no clock; seed 0 is a seed.
//!
//! Source: ChaCha with 8 rounds (Bernstein 2008) keyed by BLAKE3 of the address; integers only, so the same bits on every
//! CPU. Normal draws: Wichura's AS 241 inverse of the normal law, two words a draw, so that index i costs no more than i + 1.

mod dist;
mod normal;
mod purpose;
mod stream;

pub use dist::{Bounded, Dist, Drawn, Law, within};
pub use purpose::{Purpose, Stage};
pub use stream::{Stream, Streams};
