//! The train split -> windows of rows in the order of an epoch, read ahead on a thread of its own (`parallel::ReadAhead`).
//!
//! Memory: the window that is learnt, those read ahead (`ahead`) and the one being read. A window holds the rows of
//! [`WINDOW_GROUPS`] row groups, so it does not grow with the corpus. The order is [`Epoch`]'s alone: how far is read ahead
//! changes when a window is there, never which rows it holds.

use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};

use super::TrainError;
use super::order::{Epoch, WINDOW_GROUPS};
use super::rows::Rows;
use super::source::{Group, Sources};
use crate::corpus::Split;
use crate::corpus::cells::rule_truth;
use crate::parallel::ReadAhead;

/// Rows of eight row groups and the order to learn them in.
pub(crate) struct Window {
    pub epoch: u32,
    /// From 0 in each epoch.
    pub window: u32,
    pub rows: Rows,
    pub order: Vec<u32>,
}

/// The order of all epochs from (epoch, window) on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Course {
    pub seed: u64,
    pub epoch: u32,
    pub window: u32,
    pub epochs: u32,
}

/// Windows in the order of the epochs.
pub(super) struct Windows {
    read: ReadAhead<Result<Window, TrainError>>,
    /// Rows that were learnt, for the room they have.
    spent: Sender<Rows>,
}

impl Windows {
    /// Takes a window that nobody needs any more: a later one is read into its memory.
    pub(super) fn reuse(&self, window: Window) {
        // Where nothing is read any more, nobody wants it.
        _ = self.spent.send(window.rows);
    }
}

impl Iterator for Windows {
    type Item = Result<Window, TrainError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read.next()
    }
}

/// Begins to read; up to `ahead` windows wait to be taken. It goes on until the last epoch ends or nobody takes windows any more.
pub(super) fn start(sources: Arc<Sources>, course: Course, ahead: usize) -> Windows {
    let (spent, room) = channel::<Rows>();
    let groups = sources.groups(Split::Train);
    let windows = (course.epoch..course.epochs).flat_map(move |epoch| {
        let order = Epoch::new(course.seed, epoch);
        let shuffled: Vec<Group> = order.groups(groups.len()).into_iter().map(|group| groups[group as usize]).collect();
        let first = if epoch == course.epoch { course.window } else { 0 };
        let windows = shuffled.len().div_ceil(WINDOW_GROUPS) as u32;
        (first..windows).map(move |window| {
            let groups = shuffled.chunks(WINDOW_GROUPS).nth(window as usize).expect("one of the windows");
            (order, epoch, window, groups.to_vec())
        })
    });
    let windows = windows.map(move |(order, epoch, window, groups)| {
        let mut rows = room.try_recv().unwrap_or_default();
        rows.clear(sources.features.len());
        groups.into_iter().try_for_each(|group| sources.read(Split::Train, group, &mut rows))?;
        Ok(Window { epoch, window, order: order.rows(window, rows.len()), rows })
    });
    Windows { read: ReadAhead::start(ahead, windows), spent }
}

/// Bytes of the widest part of the stream, by the mean size of the row groups.
pub(crate) fn memory_bytes(sources: &Sources, ahead: usize) -> u64 {
    let groups = sources.groups(Split::Train).len().max(1) as u64;
    let per_group = sources.rows(Split::Train).div_ceil(groups);
    let truth = 4 * rule_truth(sources.rule.as_ref()).len() as u64;
    let per_row = 4 * sources.features.len() as u64 + 7;
    // The windows, and the row group being decoded.
    per_group * (per_row * WINDOW_GROUPS as u64 * (ahead as u64 + 2) + per_row + truth)
}
