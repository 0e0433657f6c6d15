//! Arrow values -> Parquet shards, receipts, manifest; and back. The only user of arrow and parquet.
