//! Tests of the corpus as a whole, on hand-made scenes.

mod damage;
mod fixture;
mod place;
mod shard;
mod texts;
