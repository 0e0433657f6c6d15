//! Crashes: every verb that writes is killed, cut off from power, or let down by the system, at each of its system calls in turn.
//!
//! After each crash: whoever reads the corpus gets the old one whole, or the new one whole, or is refused with the command that
//! completes it; the same command again ends with the bytes of an undisturbed run; nothing temporary stays. `cargo test` takes
//! every kill point, and of the power cuts and failing calls some, spread over each run; the long form takes all of them and counts:
//!
//!     cargo test --release --test crash -- --ignored --nocapture --test-threads 2
//!
//! A C program ([`tracer`]) stops the commands. Where it cannot be compiled, or the system lets nobody trace, the tests say that
//! they are skipped and hold nothing.

/// After a crash: what readers may say, and what the same command again must give.
mod aftermath;
/// Power cuts: what was not synced is lost.
mod cuts;
/// System calls that fail.
mod faults;
/// Kills before each change to a file.
mod kills;
/// The verbs under test, and the folders that they start from.
mod tasks;
/// The C program that stops a command at its system calls.
mod tracer;
/// Files of a folder as a map, and copies of folders.
mod tree;
