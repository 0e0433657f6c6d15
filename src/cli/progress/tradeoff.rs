//! The parts of a measurement of speed against accuracy, in words: scenes, scenes to judge by, then trainings.

use std::time::Instant;

use super::{Teller, human};
use crate::cli::LogFormat;
use crate::measure::tradeoff::Event;

/// Shows a measurement.
pub(in crate::cli) struct TradeoffProgress {
    teller: Teller,
    /// Of the part in hand.
    begun: Instant,
}

impl TradeoffProgress {
    pub(in crate::cli) fn new(log: LogFormat) -> TradeoffProgress {
        TradeoffProgress { teller: Teller::new(log), begun: Instant::now() }
    }

    pub(in crate::cli) fn take(&mut self, event: Event) {
        match event {
            Event::Start { settings, scenes, trainings } => {
                self.begun = Instant::now();
                if self.teller.is_json() {
                    tracing::info!(event = "start", settings, scenes, trainings);
                } else {
                    let words = format!("{scenes} scenes at {settings} settings, then up to {trainings} trainings");
                    self.teller.say(&words);
                }
            }
            Event::Scene { done, of } => self.step("scenes", done, of),
            Event::TestScene { done, of } => self.step("test scenes", done, of),
            Event::Training { done, of } => self.step("trainings", done, of),
            Event::Round { done, half_width } => {
                // Judging lies behind the last training and is no part of what follows.
                self.begun = Instant::now();
                if self.teller.is_json() {
                    tracing::info!(event = "round", done, half_width);
                } else {
                    let width = half_width
                        .map_or("not known yet".into(), |width| format!("\u{b1} {:.2} points", 100.0 * width));
                    let words = format!("round {done}: the gain that is known least: {width}; another round follows");
                    self.teller.say(&words);
                }
            }
        }
    }

    fn step(&mut self, what: &'static str, done: usize, of: usize) {
        let elapsed = self.begun.elapsed();
        let left = elapsed.mul_f64((of - done) as f64 / done.max(1) as f64);
        let text = || format!("{done}/{of} {what}  ETA {}", human(left));
        let json = || {
            let (elapsed_s, eta_s) = (elapsed.as_secs_f64(), left.as_secs_f64());
            tracing::info!(event = "progress", part = what, done, of, elapsed_s, eta_s);
        };
        self.teller.step((done as u64, of as u64), false, text, json);
        if done == of {
            self.begun = Instant::now();
        }
    }

    /// Takes the bar away.
    pub(in crate::cli) fn finish(&self) {
        self.teller.finish();
    }
}
