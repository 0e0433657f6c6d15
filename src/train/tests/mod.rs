//! Training as a whole, on corpora whose every row is known.

mod extremes;
mod faults;
mod fixture;
mod memory;
mod scenes;
mod stream;
mod validation;
mod whole;
