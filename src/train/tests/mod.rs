//! Training as a whole, on corpora whose every row is known.

mod faults;
mod fixture;
mod memory;
mod stream;
mod whole;
