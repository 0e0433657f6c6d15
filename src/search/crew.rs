//! One network per thread: threads take the next network that waits, the largest first, and hand in its entry.
//!
//! Which thread trains what, and when, changes no bit of any entry: a training runs on its thread alone.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;

use super::entry::{self, Entry};
use super::networks::Hidden;
use super::rungs::Rung;
use crate::train::memory::Held;
use crate::train::{TrainError, TrainParams};

/// What all networks are trained with.
pub struct Crew<'s> {
    pub params: &'s TrainParams,
    pub held: &'s Held,
    pub threads: usize,
    pub stop: &'s AtomicBool,
}

impl Crew<'_> {
    /// Trains all of them as far as a rung and hands over each as it is finished; false where `stop` was raised before the last.
    pub fn train(
        &self,
        mut waiting: Vec<Hidden>,
        rung: (usize, &Rung),
        take: &mut dyn FnMut(Entry) -> Result<(), TrainError>,
    ) -> Result<bool, TrainError> {
        let weights = |hidden: &Hidden| entry::params_of(self.params, hidden).layout(self.held.train.width).weights();
        waiting.sort_by_key(|hidden| std::cmp::Reverse(weights(hidden)));
        let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
        let (sender, finished) = channel();
        let mut outcome = Ok(());
        let mut left = waiting.len();
        std::thread::scope(|scope| {
            for _ in 0..self.threads.min(waiting.len()) {
                let (sender, next, failed, waiting) = (sender.clone(), &next, &failed, &waiting);
                scope.spawn(move || {
                    while !failed.load(Ordering::Relaxed) && !self.stop.load(Ordering::Relaxed) {
                        let Some(hidden) = waiting.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
                        let done = entry::train(self.params, self.held, hidden, rung, self.stop).transpose();
                        if done.is_none_or(|done| sender.send(done).is_err()) {
                            return;
                        }
                    }
                });
            }
            drop(sender);
            for done in finished {
                let taken = if outcome.is_ok() { done.and_then(&mut *take) } else { Ok(()) };
                left -= 1;
                if let Err(error) = taken {
                    failed.store(true, Ordering::Relaxed);
                    outcome = Err(error);
                }
            }
        });
        outcome.map(|()| left == 0)
    }
}
