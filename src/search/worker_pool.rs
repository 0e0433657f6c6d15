//! Networks of a rung -> their entries, one network a thread, the largest first.
//!
//! Which thread trains what, and when, changes no bit of any entry: a training runs on its thread alone.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use super::entry::{self, Entry};
use super::networks::Hidden;
use super::rungs::Rung;
use crate::parallel::{self, Schedule};
use crate::train::memory::Held;
use crate::train::{TrainError, TrainParams};

/// What all networks are trained with.
pub struct WorkerPool<'s> {
    pub params: &'s TrainParams,
    pub held: &'s Held,
    pub threads: usize,
    pub stop: &'s AtomicBool,
}

/// Networks that wait, and who takes their entries.
struct Networks<'a> {
    waiting: std::vec::IntoIter<Hidden>,
    /// Not trained, or not to a rung's end.
    left: usize,
    stop: &'a AtomicBool,
    take: &'a mut dyn FnMut(Entry) -> Result<(), TrainError>,
    failed: Option<TrainError>,
}

impl Schedule for Networks<'_> {
    type Task = Hidden;
    type Output = Result<Option<Entry>, TrainError>;

    fn next(&mut self) -> Option<Hidden> {
        if self.stop.load(Ordering::Relaxed) { None } else { self.waiting.next() }
    }

    fn take(&mut self, trained: Self::Output) -> ControlFlow<()> {
        let Ok(Some(entry)) = trained else {
            self.failed = trained.err();
            // Without an error it was stopped, as the others will be.
            return if self.failed.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        };
        self.left -= 1;
        self.failed = (self.take)(entry).err();
        if self.failed.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

impl WorkerPool<'_> {
    /// Trains all of them as far as a rung and hands over each as it is finished; false where `stop` was raised before the last.
    pub fn train(
        &self,
        mut waiting: Vec<Hidden>,
        rung: (usize, &Rung),
        take: &mut dyn FnMut(Entry) -> Result<(), TrainError>,
    ) -> Result<bool, TrainError> {
        let weights = |hidden: &Hidden| entry::params_of(self.params, hidden).layout(self.held.train.width).weights();
        waiting.sort_by_key(|hidden| std::cmp::Reverse(weights(hidden)));
        let left = waiting.len();
        let mut networks = Networks { waiting: waiting.into_iter(), left, stop: self.stop, take, failed: None };
        parallel::run(self.threads.min(left), &mut networks, |hidden, (): &mut ()| {
            entry::train(self.params, self.held, &hidden, rung, self.stop)
        })?;
        networks.failed.map_or(Ok(networks.left == 0), Err)
    }
}
