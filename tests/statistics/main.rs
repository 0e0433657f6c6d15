//! Slow statistics, one module a stage: laws that need many seeds. Release builds only:
//! `cargo test --release --test statistics`.
#![cfg(not(debug_assertions))]

mod cast;
mod cells;
mod drive;
mod extremes;
mod overhang;
mod scene;
mod slam;
mod sweep;
mod train;
