//! Contracts that users rely on, checked through the binary.

/// The verbs: exit codes, what is written, what is said.
mod cli;
/// The same plan gives the same bytes.
mod sameness;
/// Training: the same bits after any kill; faults with their cures.
mod training;
/// A scratch folder, a config in it, and the binary.
mod yard;
