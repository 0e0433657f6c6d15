//! Contracts that users rely on, checked through the binary.

/// Hours, cores and disk: what to build with them.
mod budget;
/// Clouds that previews write come back as the cells of the corpus.
mod classify;
/// The verbs: exit codes, what is written, what is said.
mod cli;
/// What is told of corpora: compared, inspected by a program, their cards.
mod compare;
/// The one door into a finished corpus: what is not the corpus that its manifest names is refused by every reader.
mod door;
/// Pinned ids of three small corpora.
mod golden;
/// Judging and exporting: reports, exit codes, faults with their cures.
mod judging;
/// Signals, full disks, folders that go away, other programs, too little memory.
mod night;
/// Far and absurd inputs, and what is told of a build.
mod outputs;
/// Folders have owners: no file of another's is replaced, and no input.
mod owners;
/// What a plan says of the machine and of its own corpus.
mod plan;
/// Poses with their whole covariance, and the filter on recordings.
mod poses;
/// Run folders: whatever a kill, a lost file or a flipped bit leaves there.
mod run_safety;
/// The same plan gives the same bytes.
mod sameness;
/// Scans of every pattern, from a corpus to a classified cloud.
mod scans;
/// Searches: the same leaderboard after any kill; faults with their cures.
mod search;
/// What files hold that are not the user's config is in no message.
mod secrets;
/// Recordings of sweeps: points alone are located as whole sweeps are.
mod sweeps;
/// Speed against accuracy: what the verb writes and refuses.
mod tradeoff;
/// Training: the same bits after any kill; faults with their cures.
mod training;
/// Who made a corpus, what it may be judged on, and who vouches for it.
mod trust;
/// A scratch folder, a config in it, and the binary.
mod yard;
