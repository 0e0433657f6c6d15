//! Contracts that users rely on, checked through the binary.

/// Clouds that previews write come back as the cells of the corpus.
mod classify;
/// The verbs: exit codes, what is written, what is said.
mod cli;
/// Pinned ids of three small corpora.
mod golden;
/// The same plan gives the same bytes.
mod sameness;
/// Speed against accuracy: what the verb writes and refuses.
mod tradeoff;
/// Training: the same bits after any kill; faults with their cures.
mod training;
/// A scratch folder, a config in it, and the binary.
mod yard;
