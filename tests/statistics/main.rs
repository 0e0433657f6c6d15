//! Slow statistics, one module a stage: `cargo test --release --test statistics`.

mod scene;
