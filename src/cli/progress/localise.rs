//! A recorded drive that is located, in words: steps done, and when the last will be.

use std::time::Instant;

use super::{Teller, human};
use crate::cli::LogFormat;

/// Shows how far a drive is located.
pub(in crate::cli) struct LocaliseProgress {
    teller: Teller,
    started: Instant,
}

impl LocaliseProgress {
    pub(in crate::cli) fn new(log: LogFormat) -> LocaliseProgress {
        LocaliseProgress { teller: Teller::new(log), started: Instant::now() }
    }

    /// Tells that `done` steps, one at least, of `of` are located. What is left is told by the mean of the steps so far; where all are done
    /// nothing is said beyond a terminal, for most drives take less than the time between two lines.
    pub(in crate::cli) fn take(&mut self, done: usize, of: usize) {
        let elapsed = self.started.elapsed();
        let left = elapsed.mul_f64((of - done) as f64 / done as f64);
        let text = || format!("{done}/{of} steps  ETA {}", human(left));
        let json = || {
            tracing::info!(
                event = "progress",
                steps_done = done,
                steps = of,
                elapsed_s = elapsed.as_secs_f64(),
                eta_s = left.as_secs_f64()
            );
        };
        self.teller.show((done as u64, of as u64), text);
        self.teller.line(false, text, json);
    }

    /// Takes the bar away.
    pub(in crate::cli) fn finish(&self) {
        self.teller.finish();
    }
}
