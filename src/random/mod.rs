//! Addresses -> random draws, and constants or distributions for config values.
//!
//! A draw has an address: (seed, scene, attempt, stage, step, purpose) opens a [`Stream`]; an index (rock, beam, particle)
//! is a position in it. Switching an effect on, adding trees or one more beam moves no other draw. There is no global
//! generator, no default seed and no clock; seed 0 is a seed.
//!
//! Source: ChaCha with 8 rounds (Bernstein 2008) keyed by BLAKE3 of the address; integers only, so the same bits on every
//! CPU. Normal draws: Wichura's AS 241 inverse of the normal law, two words a draw, so that index i costs no more than i + 1. Laws whose
//! samplers reject (gamma, beta, PERT, Poisson) take a varying number of words, from a ChaCha stream that each index has for itself: a law's
//! parameters change the draws of that law and no other.
//!
//! ```
//! use marsyard::random::{Purpose, Stage, Streams};
//!
//! let streams = Streams { seed: 7, scene: 3, attempt: 0, stage: Stage::Scene, step: 0 };
//! let diameters = streams.open(Purpose::RockDiameter);
//! // Rock 12 has its draw, whichever rocks were drawn before it, and alone or in a block.
//! let mut block = [0.0; 4];
//! diameters.fill_normal(10, &mut block);
//! assert_eq!(block[2], diameters.normal(12));
//! // Another purpose, step or scene has a stream of its own.
//! assert_ne!(streams.at_step(1).open(Purpose::RockDiameter).normal(12), block[2]);
//! // The mean of 10,000 uniform draws is 1/2, within four standard errors of 1 / sqrt(12 * 10,000).
//! let mut uniform = [0.0; 10_000];
//! diameters.fill_uniform(0, &mut uniform);
//! let mean = uniform.iter().sum::<f64>() / 10_000.0;
//! assert!((mean - 0.5).abs() < 4.0 / 120_000_f64.sqrt());
//! ```

mod dist;
mod law;
mod normal;
mod pinned;
mod purpose;
mod sampler;
mod share;
mod stream;

pub use dist::{Bounded, Dist, Drawn, within};
pub use law::Law;
pub use purpose::{Purpose, Stage};
pub use sampler::poisson;
pub use stream::{Stream, Streams};
