//! Events of a training -> a bar on a terminal, plain lines elsewhere, JSON lines for machines.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::LogFormat;
use crate::cli::output::errln;
use crate::cli::progress::{human, si};
use crate::train::filter::Counters;
use crate::train::run::Start;
use crate::train::stopping::Look;
use crate::train::{Event, Setup};

/// Counts a training and shows it.
pub(in crate::cli) struct Progress {
    out: String,
    corpora: String,
    epochs: u32,
    started: Instant,
    last_line: Option<Instant>,
    display: Display,
    resumed_at: u64,
    rows: u64,
    /// Rows of all epochs: training may end earlier.
    most_rows: u64,
    /// What was said of the covariance so far.
    guarded: (Option<u64>, Option<u64>),
}

enum Display {
    Bar(ProgressBar),
    Lines,
    Json,
}

/// Time between two plain lines, unless a look is the best so far.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Progress {
    pub(super) fn new(setup: &Setup, log: LogFormat) -> Progress {
        let display = match log {
            LogFormat::Json => Display::Json,
            LogFormat::Text if std::io::stderr().is_terminal() => Display::Bar(bar()),
            LogFormat::Text => Display::Lines,
        };
        let names: Vec<&str> = setup.sources.list.iter().map(|source| source.name.as_str()).collect();
        Progress {
            out: setup.out.display().to_string(),
            corpora: names.join(" + "),
            epochs: setup.params.epochs,
            started: Instant::now(),
            last_line: None,
            display,
            resumed_at: 0,
            rows: 0,
            most_rows: 0,
            guarded: (None, None),
        }
    }

    pub(super) fn take(&mut self, event: &Event) {
        match event {
            Event::Start(start) => self.start(start),
            Event::Rows(rows) => {
                self.rows = *rows;
                if let Display::Bar(bar) = &self.display {
                    bar.set_position(*rows);
                }
            }
            Event::Look { look, best, is_best, counters } => {
                self.look(look, best, *is_best);
                self.guards(counters);
            }
            Event::Note(note) => match self.display {
                Display::Json => tracing::warn!(event = "note", note),
                _ => self.say(&format!("{}: {note}", self.out)),
            },
            Event::Checkpoint { rows } => {
                if matches!(self.display, Display::Json) {
                    tracing::info!(event = "checkpoint", rows);
                }
            }
        }
    }

    fn start(&mut self, start: &Start) {
        self.most_rows = start.train_rows * u64::from(self.epochs);
        (self.resumed_at, self.rows) = (start.resumed_at, start.resumed_at);
        if let Display::Bar(bar) = &self.display {
            bar.set_length(self.most_rows);
            bar.set_position(self.rows);
            bar.reset_eta();
        }
        let warnings = warnings(start);
        if matches!(self.display, Display::Json) {
            tracing::info!(
                event = "start",
                run = %self.out,
                corpora = %self.corpora,
                train_rows = start.train_rows,
                validation_rows = start.validation_rows,
                untraversable_share = start.untraversable_share,
                weights = start.weights,
                features = %start.features.join(" "),
                validate_every = start.validate_every,
                stream_bytes = start.stream_bytes,
                resumed_at = start.resumed_at,
            );
            warnings.iter().for_each(|warning| tracing::warn!(event = "warning", warning));
            return;
        }
        let resumed =
            if start.resumed_at > 0 { format!(", going on after {} rows", start.resumed_at) } else { String::new() };
        self.say(&format!(
            "{} -> {}: {} rows to learn ({:.1} % untraversable), {} to validate by every {}; {} features, {} weights; {}B for the \
             stream{resumed}",
            self.corpora,
            self.out,
            start.train_rows,
            100.0 * start.untraversable_share,
            start.validation_rows,
            start.validate_every,
            start.features.len(),
            start.weights,
            si(start.stream_bytes as f64)
        ));
        warnings.iter().for_each(|warning| self.say(&format!("warning: {warning}")));
    }

    fn look(&mut self, look: &Look, best: &Look, is_best: bool) {
        self.rows = look.rows;
        let error = |error: Option<f64>| error.map_or("-".to_string(), |error| format!("{error:.5}"));
        let due = self.last_line.is_none_or(|last| last.elapsed() >= LINE_EVERY);
        match &self.display {
            Display::Bar(bar) => bar.set_message(format!(
                "{} rows/s  validation {}  best {}",
                si(self.rate()),
                error(look.validation_error),
                error(best.validation_error)
            )),
            Display::Lines if due || is_best => {
                self.last_line = Some(Instant::now());
                errln!(
                    "{:>10} rows  epoch {}  training {}  validation {}  best {}{}{}",
                    look.rows,
                    look.epoch,
                    error(look.train_error),
                    error(look.validation_error),
                    error(best.validation_error),
                    if is_best { " *" } else { "" },
                    self.pace()
                );
            }
            Display::Lines => {}
            Display::Json => tracing::info!(
                event = "look",
                rows = look.rows,
                epoch = look.epoch,
                train_error = look.train_error,
                validation_error = look.validation_error,
                best_validation_error = best.validation_error,
                best_rows = best.rows,
                rows_per_s = self.rate(),
                eta_s = self.remaining().as_secs_f64(),
            ),
        }
    }

    /// Says at once that the covariance was spoilt, and that another form took over: once each.
    fn guards(&mut self, counters: &Counters) {
        let now = (counters.rebuilt_at, counters.factored_at);
        if now == self.guarded {
            return;
        }
        self.guarded = now;
        let what = match now {
            (_, Some(at)) => format!("after {at} rows the covariance was spoilt again: the filter goes on factored"),
            (Some(at), None) => {
                format!("after {at} rows rounding spoilt the covariance: it is rebuilt from its diagonal")
            }
            (None, None) => return,
        };
        match self.display {
            Display::Json => tracing::warn!(event = "guard", note = %what),
            _ => self.say(&format!("warning: {what}")),
        }
    }

    /// Takes the bar away.
    pub(super) fn finish(&self) {
        if let Display::Bar(bar) = &self.display {
            bar.finish_and_clear();
        }
    }

    pub(super) fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    /// Rows learnt in this process.
    pub(super) fn rows_here(&self) -> u64 {
        self.rows - self.resumed_at
    }

    /// Rows a second, looks at the validation split included.
    pub(super) fn rate(&self) -> f64 {
        self.rows_here() as f64 / self.elapsed().as_secs_f64().max(1e-9)
    }

    /// Rate and time left, once there is one.
    fn pace(&self) -> String {
        if self.rows_here() == 0 {
            return String::new();
        }
        format!("  {} rows/s  at most {} left", si(self.rate()), human(self.remaining()))
    }

    fn remaining(&self) -> Duration {
        let left = self.most_rows.saturating_sub(self.rows) as f64 / self.rows_here().max(1) as f64;
        Duration::try_from_secs_f64(self.elapsed().as_secs_f64() * left).unwrap_or(Duration::MAX)
    }

    fn say(&self, line: &str) {
        match &self.display {
            Display::Bar(bar) => bar.println(line),
            _ => errln!("{line}"),
        }
    }
}

fn warnings(start: &Start) -> Vec<String> {
    let mut warnings = Vec::new();
    if !start.constant.is_empty() {
        warnings.push(format!("constant in the train split, so of no use: {}", start.constant.join(", ")));
    }
    if start.one_class {
        warnings.push("all rows to learn have one label: the network can only learn to say it".to_string());
    }
    if start.covariance == Some(false) {
        warnings.push("no filter.safetensors beside the model to start from: its covariance begins anew".to_string());
    }
    warnings
}

fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template(
        "{bar:32.cyan/blue} {pos}/{len} rows  {msg}  {elapsed} so far, at most {eta} left",
    )
    .expect("a constant template")
    .progress_chars("━╸─");
    let bar = ProgressBar::new(0).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
