//! Scenes' rows -> Parquet shards, receipts, manifest; and back. The only user of arrow and parquet.

pub mod split;

pub use split::{Split, Table};
