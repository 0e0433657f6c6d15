//! What the guards of a filter saw and did.

use serde::{Deserialize, Serialize};

use super::FilterError;
use super::state::{Reader, Writer};

/// Weights are cut back to this size: a neuron with inputs of size 1 is saturated long before, and no sum of products overflows.
pub(crate) const MOST_WEIGHT: f64 = 1e6;

/// Rebuilds after which a filter that can goes on in a sounder form.
const MOST_REBUILDS: u64 = 2;

/// Guards that were needed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Counters {
    /// Rows that were learnt.
    pub updates: u64,
    /// Rows that were not finite, or whose step was not, and were not learnt.
    pub rejected: u64,
    /// Times b'Pb came out negative or not finite, and P was rebuilt from its diagonal.
    pub rebuilt: u64,
    /// Rows learnt before the first of them.
    pub rebuilt_at: Option<u64>,
    /// Rows learnt before the filter went on factored, because P had to be rebuilt repeatedly.
    pub factored_at: Option<u64>,
    /// Of the rows that were learnt, those with an input that was clipped.
    pub clipped: u64,
    /// Updates after which a weight was cut back to `MOST_WEIGHT`.
    pub cut_back: u64,
}

impl Counters {
    /// Counts rebuilds; whether there were too many of them by now.
    pub(super) fn take_rebuilt(&mut self, count: u64) -> bool {
        self.rebuilt_at.get_or_insert(self.updates);
        self.rebuilt += count;
        self.rebuilt >= MOST_REBUILDS
    }

    pub(super) fn take_inputs(&mut self, row: &[f64], clip: f64) {
        self.clipped += u64::from(row.iter().any(|x| x.abs() >= clip));
    }

    /// Cuts weights back.
    pub(super) fn take_weights(&mut self, weights: &mut [f64]) {
        // All of them are looked at: a loop that may stop early is not turned into vectors.
        if weights.iter().fold(false, |far, w| far | (w.abs() > MOST_WEIGHT)) {
            weights.iter_mut().for_each(|w| *w = w.clamp(-MOST_WEIGHT, MOST_WEIGHT));
            self.cut_back += 1;
        }
    }

    /// `name`: with what the array's begins.
    pub(super) fn save(&self, name: &str, to: &mut Writer) {
        let Counters { updates, rejected, rebuilt, rebuilt_at, factored_at, clipped, cut_back } = *self;
        let at = |at: Option<u64>| at.unwrap_or(u64::MAX);
        let all = [updates, rejected, rebuilt, at(rebuilt_at), at(factored_at), clipped, cut_back];
        to.counts(&format!("{name}counters"), all.into_iter());
    }

    pub(super) fn load(name: &str, from: &Reader) -> Result<Counters, FilterError> {
        let all = from.counts(&format!("{name}counters"), 7)?;
        let at = |at: u64| (at != u64::MAX).then_some(at);
        Ok(Counters {
            updates: all[0],
            rejected: all[1],
            rebuilt: all[2],
            rebuilt_at: at(all[3]),
            factored_at: at(all[4]),
            clipped: all[5],
            cut_back: all[6],
        })
    }
}
