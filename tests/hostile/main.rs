//! Files of other people: whatever a file holds, its reader ends with a value or an error, within a memory that the file's size
//! warrants, and opens nothing outside the place that it was given.
//!
//! Every reader is fed valid files with bytes flipped, cut, moved, repeated and replaced by hostile numbers (`edits`), under an
//! allocator that counts (`heap`). Cases found are kept as tests with the prefix `regress_`. Few cases by default; for a long run:
//! `PROPTEST_CASES=20000 cargo test --release --test hostile`.

/// Clouds, their trajectories and their labels.
mod clouds;
/// Configs, presets, beam patterns and height maps; YAML bombs; paths.
mod configs;
/// Receipts, manifests, shard lists and Parquet tables.
mod corpora;
/// Valid bytes -> hostile bytes.
mod edits;
/// Memory and time of a reader.
mod heap;
/// Models, run folders and search journals.
mod models;

#[global_allocator]
static COUNTING: heap::Counting = heap::Counting;
