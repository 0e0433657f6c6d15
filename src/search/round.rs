//! The networks of one rung -> their entries in the journal, one network a thread, the largest first.
//!
//! Which thread trains what, and when, changes no bit of any entry: a training runs on its thread alone. An entry is in the journal before
//! anybody is told of it.

use std::cmp::Reverse;
use std::sync::atomic::AtomicBool;

use super::entry::{self, Entry};
use super::journal::Journal;
use super::networks::Hidden;
use super::rungs::Rung;
use super::throughput::Throughput;
use super::{Event, Setup, weights};
use crate::parallel;
use crate::train::TrainError;
use crate::train::stopping::Stop;

/// One rung of a search.
pub(super) struct Round<'a> {
    pub setup: &'a Setup,
    pub throughput: &'a Throughput,
    /// From 0.
    pub number: usize,
    pub rung: &'a Rung,
    pub networks: &'a [Hidden],
}

impl Round<'_> {
    /// Trains the networks that the journal lacks; false where `stop` was raised before the last was finished.
    pub(super) fn train(
        &self,
        journal: &mut Journal,
        stop: &AtomicBool,
        tell: &mut dyn FnMut(Event),
    ) -> Result<bool, TrainError> {
        let Setup { params, held, .. } = self.setup;
        self.carry_over(journal)?;
        let (done, mut waiting): (Vec<&Hidden>, Vec<&Hidden>) =
            self.networks.iter().partition(|hidden| journal.get(self.number, hidden).is_some());
        let seconds = |hidden: &Hidden| self.throughput.seconds(params, held, hidden, self.rung);
        tell(Event::Rung {
            number: self.number,
            rows: self.rung.rows,
            networks: self.networks.len(),
            done_before: done.len(),
            seconds: waiting.iter().map(|hidden| seconds(hidden)).sum(),
        });
        let mut best = self.finished(journal).min_by(|a, b| a.rank(b)).cloned();
        let mut left = waiting.len();
        waiting.sort_by_key(|hidden| Reverse(weights(self.setup, hidden)));
        let rung = (self.number, self.rung);
        let train = |hidden: &Hidden, (): &mut ()| entry::train(self.setup, hidden, rung, stop);
        parallel::for_each(self.setup.threads, waiting, stop, train, |trained| {
            // It was stopped on its way.
            let Some(entry) = trained else { return Ok(()) };
            left -= 1;
            journal.push(entry.clone())?;
            let best = match &mut best {
                Some(best) if best.rank(&entry).is_le() => best,
                best => best.insert(entry.clone()),
            };
            tell(Event::Done { entry: &entry, best, seconds: seconds(&entry.hidden) });
            Ok(())
        })?;
        Ok(left == 0)
    }

    /// The entries of all its networks that the journal has, best first.
    pub(super) fn entries(&self, journal: &Journal) -> Vec<Entry> {
        let mut entries: Vec<Entry> = self.finished(journal).cloned().collect();
        entries.sort_by(Entry::rank);
        entries
    }

    fn finished<'j>(&'j self, journal: &'j Journal) -> impl Iterator<Item = &'j Entry> {
        self.networks.iter().filter_map(|hidden| journal.get(self.number, hidden))
    }

    /// A network that patience stopped in the rung before would end where it ended there.
    fn carry_over(&self, journal: &mut Journal) -> Result<(), TrainError> {
        let Some(before) = self.number.checked_sub(1) else { return Ok(()) };
        for hidden in self.networks {
            if journal.get(self.number, hidden).is_none()
                && let Some(entry) = journal.get(before, hidden).filter(|entry| entry.stopped == Stop::Patience)
            {
                journal.push(Entry { rung: self.number, ..entry.clone() })?;
            }
        }
        Ok(())
    }
}
