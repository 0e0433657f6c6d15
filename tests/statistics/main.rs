//! Slow statistics: laws that need many seeds. Release builds only (`cargo test --release --test statistics`).
#![cfg(not(debug_assertions))]

mod cells;
mod scene;
mod slam;
