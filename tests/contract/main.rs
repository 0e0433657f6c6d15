//! Contracts that users rely on, checked through the binary.

/// Clouds that previews write come back as the cells of the corpus.
mod classify;
/// The verbs: exit codes, what is written, what is said.
mod cli;
/// Pinned ids of three small corpora.
mod golden;
/// Judging and exporting: reports, exit codes, faults with their cures.
mod judging;
/// Signals, full disks, folders that go away, other programs, too little memory.
mod night;
/// The same plan gives the same bytes.
mod sameness;
/// Scans of every pattern, from a corpus to a classified cloud.
mod scans;
/// Searches: the same leaderboard after any kill; faults with their cures.
mod search;
/// Speed against accuracy: what the verb writes and refuses.
mod tradeoff;
/// Training: the same bits after any kill; faults with their cures.
mod training;
/// A scratch folder, a config in it, and the binary.
mod yard;
