//! A plan -> its shards in a place: built, gone on with, or built again and compared.
//!
//! ```text
//! shards         scenes on all threads -> whole shards, each handed over
//! corpus         shard numbers -> those shards in their place: free space, damaged shards, hashes, report.json
//! generate       a plan and a place -> the place taken, its missing shards built, the manifest written
//! rebuild        shards of a finished corpus, built again and compared byte by byte
//! ```
//!
//! A build says what happens to an observer (`CorpusEvent`) and returns typed errors; it prints nothing and listens to no signal: a
//! flag asks it to stop. Not here: what a config means (`config`), how a shard is laid out (`corpus`), what a build would take (`measure`).

mod corpus;
mod expected;
mod generate;
mod rebuild;
mod shards;
mod stage_hashes;
mod tally;

pub(crate) use corpus::CorpusBuild;
pub use corpus::{CorpusBuildError, CorpusEvent};
pub use generate::{Generate, Generated, Whole, generate};
pub(crate) use generate::{KEEP_FREE_BYTES, selected_shards};
pub(crate) use rebuild::{Compared, Share, compare_again};
pub use shards::BuildError;
pub(crate) use shards::Outcome;
pub(crate) use stage_hashes::is_stage_hashes;
pub use tally::Tally;
