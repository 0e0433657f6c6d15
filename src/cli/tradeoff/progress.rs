//! Events of a measurement -> a bar on a terminal, plain lines elsewhere, JSON lines for machines.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::LogFormat;
use crate::cli::output::errln;
use crate::cli::progress::human;
use crate::measure::tradeoff::Event;

/// Time between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Shows the two parts of a measurement: scenes, then trainings.
pub(super) struct Progress {
    display: Display,
    /// Of the part in hand.
    begun: Instant,
    last_line: Instant,
}

enum Display {
    Bar(ProgressBar),
    Lines,
    Json,
}

impl Progress {
    pub(super) fn new(log: LogFormat) -> Progress {
        let display = match log {
            LogFormat::Json => Display::Json,
            LogFormat::Text if std::io::stderr().is_terminal() => Display::Bar(bar()),
            LogFormat::Text => Display::Lines,
        };
        Progress { display, begun: Instant::now(), last_line: Instant::now() }
    }

    pub(super) fn take(&mut self, event: Event) {
        match event {
            Event::Start { settings, scenes, trainings } => {
                if let Display::Json = self.display {
                    tracing::info!(event = "start", settings, scenes, trainings);
                } else {
                    errln!("{scenes} scenes at {settings} settings, then up to {trainings} trainings");
                }
            }
            Event::Scene { done, of } => self.step("scenes", done, of),
            Event::Training { done, of } => self.step("trainings", done, of),
        }
    }

    fn step(&mut self, what: &'static str, done: usize, of: usize) {
        let elapsed = self.begun.elapsed();
        let left = elapsed.mul_f64((of - done) as f64 / done.max(1) as f64);
        match &self.display {
            Display::Bar(bar) => {
                bar.set_length(of as u64);
                bar.set_message(what);
                bar.set_position(done as u64);
            }
            _ if self.last_line.elapsed() < LINE_EVERY && done < of => {}
            Display::Lines => {
                self.last_line = Instant::now();
                errln!("{done}/{of} {what}  ETA {}", human(left));
            }
            Display::Json => {
                self.last_line = Instant::now();
                let (elapsed_s, eta_s) = (elapsed.as_secs_f64(), left.as_secs_f64());
                tracing::info!(event = "progress", part = what, done, of, elapsed_s, eta_s);
            }
        }
        if done == of {
            self.begun = Instant::now();
            if let Display::Bar(bar) = &self.display {
                bar.reset();
            }
        }
    }

    /// Takes the bar away.
    pub(super) fn finish(&self) {
        if let Display::Bar(bar) = &self.display {
            bar.finish_and_clear();
        }
    }
}

fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:32.cyan/blue} {pos}/{len} {msg}  {elapsed} so far, {eta} left")
        .expect("a constant template")
        .progress_chars("━╸─");
    let bar = ProgressBar::new(1).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
