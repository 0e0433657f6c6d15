//! Training as a whole, on corpora whose every row is known.

mod extremes;
mod faults;
mod fixture;
mod stream;
mod whole;
