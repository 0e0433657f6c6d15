//! Rows in memory -> how small a network may be: many networks trained, the better ones longer.
//!
//! ```text
//! networks (a grid, or all of up to three layers of up to 32) -> rung 1: all learn each row once, one network per thread
//!     -> the best share, and every network that no smaller one beats -> rung 2 ... -> the last rung: all epochs, patience
//!     -> leaderboard; the smallest network within a share of the best error -> train.yaml
//! ```
//!
//! Source: Hewitt et al. 2017, "Results": a sweep over all networks of one to three hidden layers of up to 32 neurons. Deviation:
//! successive halving instead of training all to the end. Each finished network is a line in the journal at once; a search that was
//! killed goes on with those that lack a line, and ends in the same bytes but for times.

pub(crate) mod entry;
pub mod journal;
pub(crate) mod leaderboard;
pub(crate) mod networks;
pub(crate) mod over_scenes;
pub(crate) mod picture;
mod round;
pub(crate) mod rungs;
#[cfg(test)]
mod tests;
pub(crate) mod throughput;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde_json::{Value as Json, json};

pub(crate) use self::entry::Entry;
use self::journal::Journal;
pub(crate) use self::leaderboard::Leaderboard;
use self::networks::Hidden;
use self::over_scenes::ValidationScenes;
use self::round::Round;
use self::rungs::{Rung, rungs, survivors};
use self::throughput::Throughput;
use crate::corpus::limits::FileKind;
use crate::corpus::store::{is_temporary, read_folder};
use crate::corpus::{LocalFolder, Store};
use crate::train::memory::Held;
use crate::train::{TrainError, TrainParams, filter, folder, leave_unnoted};

/// Hidden layers -> a config.
pub(crate) type ConfigOf = dyn Fn(&[usize]) -> String + Sync;

/// What is searched by what.
pub(crate) struct Setup {
    /// `network.hidden` does not apply.
    pub params: TrainParams,
    pub held: Held,
    /// Of the validation rows.
    pub scenes: ValidationScenes,
    pub networks: Vec<Hidden>,
    /// Rungs, and the share of the networks that goes on from each to the next.
    pub rungs: usize,
    pub keep: f64,
    pub margin: f64,
    pub threads: usize,
    /// What the rows are, for the journal: a search goes on with the same only.
    pub data: Json,
    /// The config that trains such a network on all rows, as text.
    pub config_of: Box<ConfigOf>,
    pub out: PathBuf,
    pub resume: bool,
}

/// What happens while searching.
#[derive(Clone, Debug)]
pub(crate) enum Event<'a> {
    /// Before the first network.
    Start(&'a Start),
    /// A rung begins; `seconds`: of one thread, for those that wait, as far as is known.
    Rung { number: usize, rows: u64, networks: usize, done_before: usize, seconds: f64 },
    /// A network is trained as far as its rung; `seconds`: as it was expected to take.
    Done { entry: &'a Entry, best: &'a Entry, seconds: f64 },
}

/// What is known before the first network is trained.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Start {
    pub networks: usize,
    pub rungs: Vec<Rung>,
    pub throughput: Throughput,
    /// Of one thread for each rung, if no patience ends early and those that go on are of mean size.
    pub rung_seconds: Vec<f64>,
    /// Lines in the journal.
    pub resumed: usize,
    /// Bytes of the rows, and of the largest networks with their filters on all threads.
    pub row_bytes: u64,
    pub network_bytes: u64,
}

/// How it ended.
#[derive(Clone, Debug)]
pub(crate) enum Outcome {
    /// The leaderboard, and the entries of the last rung, best first.
    Done(Box<Leaderboard>, Vec<Entry>),
    /// Asked to stop; so many lines are in the journal.
    Interrupted { entries: usize },
}

/// Searches, or goes on searching, until all rungs are done or `stop` is raised.
pub(crate) fn search(setup: &Setup, stop: &AtomicBool, tell: &mut dyn FnMut(Event)) -> Result<Outcome, TrainError> {
    let Setup { params, held, .. } = setup;
    let networks = sorted(setup);
    check(setup, &networks)?;
    let rungs = rungs(networks.len(), held.train.len() as u64, params.epochs, setup.rungs, setup.keep);
    let identity = identity(setup);
    let mut journal = open(setup, &identity)?;
    let most_rows = rungs.last().map_or(0, |rung| rung.rows);
    let throughput = Throughput::measure(params, held, &networks, most_rows, setup.threads)?;
    tell(Event::Start(&start(setup, &networks, &rungs, &throughput, journal.trainings())));
    let mut networks = networks;
    let mut entries: Vec<Vec<Entry>> = Vec::new();
    for (number, rung) in rungs.iter().enumerate() {
        let round = Round { setup, throughput: &throughput, number, rung, networks: &networks };
        if !round.train(&mut journal, stop, tell)? {
            return Ok(Outcome::Interrupted { entries: journal.trainings() });
        }
        let done = round.entries(&journal);
        if let Some(next) = rungs.get(number + 1) {
            networks = survivors(done.clone(), next.networks).into_iter().map(|entry| entry.hidden).collect();
        }
        entries.push(done);
    }
    let board = Leaderboard::of(&rungs, &entries, &setup.scenes, setup.margin, identity.clone());
    journal.sync()?;
    write(setup, &board, &entries, |margin| {
        Leaderboard::of(&rungs, &entries, &setup.scenes, margin, identity.clone())
    })?;
    Ok(Outcome::Done(Box::new(board), entries.pop().unwrap_or_default()))
}

/// By ascending weights.
fn sorted(setup: &Setup) -> Vec<Hidden> {
    let mut networks = setup.networks.clone();
    networks.sort_by_key(|hidden| (weights(setup, hidden), hidden.len(), hidden.clone()));
    networks
}

fn weights(setup: &Setup, hidden: &[usize]) -> usize {
    entry::params_of(&setup.params, hidden).layout(setup.held.train.width).weights()
}

/// The largest network can be trained: so can all.
fn check(setup: &Setup, sorted: &[Hidden]) -> Result<(), TrainError> {
    let largest = sorted.last().map_or(&[][..], Vec::as_slice);
    let layout = entry::params_of(&setup.params, largest).layout(setup.held.train.width);
    let (rows, weights) = (setup.held.train.len(), layout.weights_of_member());
    if rows < weights && !setup.params.allow_few_rows {
        return Err(TrainError::FewRows { rows: rows as u64, weights });
    }
    filter::build(&setup.params.filter, &layout, setup.params.clip)?;
    Ok(())
}

/// What must be the same for a search to go on.
fn identity(setup: &Setup) -> Json {
    let mut hasher = blake3::Hasher::new();
    for hidden in &setup.networks {
        hasher.update(networks::shown(hidden).as_bytes()).update(b"\n");
    }
    let mut config = json!(setup.params);
    leave_unnoted(&mut config);
    // The widths are those of the networks that are searched.
    if let Some(network) = config["network"].as_object_mut() {
        network.shift_remove("hidden");
    }
    json!({
        "data": setup.data,
        "networks": {"count": setup.networks.len(), "blake3": hasher.finalize().to_hex().to_string()},
        "rungs": setup.rungs,
        "keep": setup.keep,
        "config": config,
    })
}

fn open(setup: &Setup, identity: &Json) -> Result<Journal, TrainError> {
    let out = &setup.out;
    if out.exists() {
        if !setup.resume {
            return Err(TrainError::Exists { path: out.display().to_string() });
        }
        if LocalFolder::new(out).size(journal::NAME)?.is_none() && !is_lost(out, identity)? {
            let reason = format!("it holds files, and no {}", journal::NAME);
            return Err(TrainError::NoRun { path: out.display().to_string(), reason });
        }
    }
    let journal = Journal::open(out, identity)?;
    LocalFolder::new(out).sweep_temporaries("")?;
    Ok(journal)
}

/// Whether a folder without a journal is that of such a search: killed in its first moments, or finished and its journal lost.
fn is_lost(out: &Path, identity: &Json) -> Result<bool, TrainError> {
    let store = LocalFolder::new(out);
    if store.size(leaderboard::NAME)?.is_some() {
        return Ok(board_in(&store)?.is_some_and(|board| board.begun_with == *identity));
    }
    let io = |source| TrainError::Io { path: out.display().to_string(), source };
    for entry in read_folder(out).map_err(io)? {
        if !entry.map_err(io)?.file_name().to_str().is_some_and(is_temporary) {
            return Ok(false);
        }
    }
    Ok(true)
}

fn start(setup: &Setup, networks: &[Hidden], rungs: &[Rung], throughput: &Throughput, resumed: usize) -> Start {
    let Setup { params, held, .. } = setup;
    let of_all =
        |rung: &Rung| networks.iter().map(|hidden| throughput.seconds(params, held, hidden, rung)).sum::<f64>();
    let share = |rung: &Rung| rung.networks as f64 / networks.len() as f64;
    let largest = networks.last().map_or(0, |hidden| weights(setup, hidden)) as u64;
    Start {
        networks: networks.len(),
        rungs: rungs.to_vec(),
        throughput: throughput.clone(),
        rung_seconds: rungs.iter().map(|rung| of_all(rung) * share(rung)).collect(),
        resumed,
        row_bytes: (held.train.bytes() + held.validation.bytes()) as u64,
        // The covariance at work, its copy of the best look, and one in the making; 8 bytes an element at most.
        network_bytes: setup.threads as u64 * 3 * 8 * largest * (largest + 1) / 2,
    }
}

/// Writes what a search gives, in the place of what it gave with the margin of the leaderboard that is there.
fn write(
    setup: &Setup,
    board: &Leaderboard,
    entries: &[Vec<Entry>],
    board_of: impl Fn(f64) -> Leaderboard,
) -> Result<(), TrainError> {
    let store = LocalFolder::new(&setup.out);
    let before = board_in(&store)?.map(|there| products(setup, &board_of(there.margin), entries));
    Ok(folder::write_products(&store, &products(setup, board, entries), &before.unwrap_or_default())?)
}

/// The picture, the config and, last of all, the leaderboard.
fn products(setup: &Setup, board: &Leaderboard, entries: &[Vec<Entry>]) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<(&str, String)> = Vec::new();
    files.extend(picture::svg(entries, board.margin).map(|svg| (picture::NAME, svg)));
    files.extend(board.chosen.as_ref().map(|chosen| (folder::CONFIG, (setup.config_of)(&chosen.hidden))));
    let text = serde_json::to_string_pretty(board).expect("a leaderboard is plain data") + "\n";
    files.push((leaderboard::NAME, text));
    files.into_iter().map(|(name, text)| (name.to_owned(), text.into_bytes())).collect()
}

/// The leaderboard in a folder, where there is a whole one.
fn board_in(store: &LocalFolder) -> Result<Option<Leaderboard>, TrainError> {
    if store.size(leaderboard::NAME)?.is_none() {
        return Ok(None);
    }
    let text = store.read_within(leaderboard::NAME, FileKind::Manifest.most_bytes())?;
    Ok(serde_json::from_slice(&text).ok())
}
