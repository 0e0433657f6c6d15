//! Tests of the corpus as a whole, on hand-made scenes.

pub(crate) mod books;
mod damage;
mod door;
pub(super) mod fixture;
mod interrupted;
mod place;
mod shard;
mod texts;
