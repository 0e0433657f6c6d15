//! The train split -> windows of rows in the order of an epoch, read ahead on a thread of its own.
//!
//! Memory: the window in hand, those read ahead (`ahead`) and the one being read. A window holds the rows of
//! [`WINDOW_GROUPS`] row groups, so it does not grow with the corpus. The order is [`Epoch`]'s alone: how far is read ahead
//! changes when a window is there, never which rows it holds.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

use super::order::{Epoch, WINDOW_GROUPS};
use super::rows::Rows;
use super::source::{Group, Sources};
use super::{TrainError, labels};
use crate::corpus::Split;

/// Rows of eight row groups and the order to learn them in.
pub struct Window {
    pub epoch: u32,
    /// From 0 in each epoch.
    pub window: u32,
    pub rows: Rows,
    pub order: Vec<u32>,
}

/// Windows from a place on, until the last epoch ends or nobody takes them any more.
pub struct Stream {
    windows: Option<Receiver<Result<Window, TrainError>>>,
    reader: Option<JoinHandle<()>>,
}

/// The order of all epochs from (epoch, window) on.
#[derive(Clone, Copy, Debug)]
pub struct Course {
    pub seed: u64,
    pub epoch: u32,
    pub window: u32,
    pub epochs: u32,
}

impl Stream {
    /// Begins to read; up to `ahead` windows wait to be taken.
    pub fn start(sources: Arc<Sources>, course: Course, ahead: usize) -> Stream {
        let (sender, windows) = sync_channel(ahead);
        let reader = std::thread::spawn(move || {
            let groups = sources.groups(Split::Train);
            let mut first = course.window;
            for epoch in course.epoch..course.epochs {
                let order = Epoch::new(course.seed, epoch);
                let shuffled: Vec<Group> =
                    order.groups(groups.len()).into_iter().map(|group| groups[group as usize]).collect();
                for (window, groups) in shuffled.chunks(WINDOW_GROUPS).enumerate().skip(first as usize) {
                    let read = read_window(&sources, groups).map(|rows| {
                        let window = window as u32;
                        Window { epoch, window, order: order.rows(window, rows.len()), rows }
                    });
                    let failed = read.is_err();
                    if sender.send(read).is_err() || failed {
                        return;
                    }
                }
                first = 0;
            }
        });
        Stream { windows: Some(windows), reader: Some(reader) }
    }
}

impl Iterator for Stream {
    type Item = Result<Window, TrainError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.windows.as_ref()?.recv().ok()
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // The reader stops at its next window: nobody is there to take it.
        self.windows = None;
        if let Some(reader) = self.reader.take()
            && let Err(panic) = reader.join()
            && !std::thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}

fn read_window(sources: &Sources, groups: &[Group]) -> Result<Rows, TrainError> {
    let mut rows = Rows::new(sources.features.len());
    groups.iter().try_for_each(|&group| sources.read(Split::Train, group, &mut rows))?;
    Ok(rows)
}

/// Bytes of the widest part of the stream, by the mean size of the row groups.
pub fn memory_bytes(sources: &Sources, ahead: usize) -> u64 {
    let groups = sources.groups(Split::Train).len().max(1) as u64;
    let per_group = sources.rows(Split::Train).div_ceil(groups);
    let truth = if sources.rule.is_some() { labels::COLUMNS.len() as u64 * 4 } else { 0 };
    let per_row = 4 * sources.features.len() as u64 + 7;
    // The windows, and the row group being decoded.
    per_group * (per_row * WINDOW_GROUPS as u64 * (ahead as u64 + 2) + per_row + truth)
}
