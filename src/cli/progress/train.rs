//! A training, in words: how far this pass over the rows is, how good the network is, and when the training can be over.
//!
//! A training ends when the validation error no longer falls, which nobody knows beforehand; what is known is the pass in hand, and the
//! soonest end: the row at which patience is over if no look is an improvement.

use std::time::{Duration, Instant};

use super::{Teller, human, si};
use crate::cli::LogFormat;
use crate::train::filter::Counters;
use crate::train::run::Start;
use crate::train::stopping::Look;
use crate::train::{Event, Setup};

/// Counts a training and shows it.
pub(in crate::cli) struct TrainProgress {
    teller: Teller,
    out: String,
    corpora: String,
    epochs: u32,
    patience: u32,
    started: Instant,
    resumed_at: u64,
    rows: u64,
    /// Of one pass.
    pass_rows: u64,
    validate_every: u64,
    /// Of the last look and of the best one.
    validation_error: Option<f64>,
    best: Option<Look>,
    /// The row at which patience is over if no later look is an improvement; `None` before the first look of this process.
    patience_ends: Option<u64>,
    /// What was said of the covariance so far.
    guarded: (Option<u64>, Option<u64>),
}

impl TrainProgress {
    pub(in crate::cli) fn new(setup: &Setup, log: LogFormat) -> TrainProgress {
        let names: Vec<&str> = setup.sources.list.iter().map(|source| source.name.as_str()).collect();
        TrainProgress {
            teller: Teller::new(log),
            out: setup.out.display().to_string(),
            corpora: names.join(" + "),
            epochs: setup.params.epochs,
            patience: setup.params.patience,
            started: Instant::now(),
            resumed_at: 0,
            rows: 0,
            pass_rows: 0,
            validate_every: 0,
            validation_error: None,
            best: None,
            patience_ends: None,
            guarded: (None, None),
        }
    }

    pub(in crate::cli) fn take(&mut self, event: &Event) {
        match event {
            Event::Start(start) => self.start(start),
            Event::Rows(rows) => {
                self.rows = *rows;
                self.teller.show(self.of_pass(), || self.text());
            }
            Event::Look { look, best, is_best, waited, counters } => {
                let looks_left = u64::from(self.patience.saturating_sub(*waited));
                self.patience_ends = Some(look.rows.saturating_add(looks_left.saturating_mul(self.validate_every)));
                self.look(look, best, *is_best);
                self.guards(counters);
            }
            Event::Note(note) if self.teller.is_json() => tracing::warn!(event = "note", note),
            Event::Note(note) => self.teller.say(&format!("{}: {note}", self.out)),
            Event::Checkpoint { rows } => {
                if self.teller.is_json() {
                    tracing::info!(event = "checkpoint", rows);
                }
            }
        }
    }

    fn start(&mut self, start: &Start) {
        (self.pass_rows, self.validate_every) = (start.train_rows, start.validate_every);
        (self.resumed_at, self.rows) = (start.resumed_at, start.resumed_at);
        let warnings = warnings(start);
        if self.teller.is_json() {
            tracing::info!(
                event = "start",
                run = %self.out,
                corpora = %self.corpora,
                train_rows = start.train_rows,
                validation_rows = start.validation_rows,
                look_rows = start.look_rows,
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
        let is_thinned = start.look_rows < start.validation_rows;
        let of_them = if is_thinned { format!("{} of ", start.look_rows) } else { String::new() };
        self.teller.say(&format!(
            "{} -> {}: {} rows to learn ({:.1} % untraversable), judged by {of_them}{} to validate after every {}; {} features, {} weights; \
             {}B for the stream{resumed}",
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
        warnings.iter().for_each(|warning| self.teller.say(&format!("warning: {warning}")));
    }

    fn look(&mut self, look: &Look, best: &Look, is_best: bool) {
        self.rows = look.rows;
        (self.validation_error, self.best) = (look.validation_error, Some(*best));
        let text = format!(
            "{:>10} rows  epoch {}  training {}  validation {}  kept {}{}{}",
            look.rows,
            look.epoch,
            error(look.train_error),
            error(look.validation_error),
            error(best.validation_error),
            if is_best { " *" } else { "" },
            self.pace()
        );
        let (rows_per_s, eta_s) = (self.rate(), self.seconds(self.most_left()));
        let soonest_end_s = self.seconds(self.least_left());
        let json = || {
            tracing::info!(
                event = "look",
                rows = look.rows,
                epoch = look.epoch,
                train_error = look.train_error,
                validation_error = look.validation_error,
                best_validation_error = best.validation_error,
                best_rows = best.rows,
                rows_per_s,
                eta_s,
                soonest_end_s,
            );
        };
        // Machines are told of every look.
        let is_told = is_best || self.teller.is_json();
        self.teller.line(is_told, || text, json);
        self.teller.show(self.of_pass(), || self.text());
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
        if self.teller.is_json() {
            tracing::warn!(event = "guard", note = %what);
        } else {
            self.teller.say(&format!("warning: {what}"));
        }
    }

    /// Takes the bar away.
    pub(in crate::cli) fn finish(&self) {
        self.teller.finish();
    }

    pub(in crate::cli) fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    /// Rows learnt in this process.
    pub(in crate::cli) fn rows_here(&self) -> u64 {
        self.rows - self.resumed_at
    }

    /// Rows a second, looks at the validation split included.
    pub(in crate::cli) fn rate(&self) -> f64 {
        self.rows_here() as f64 / self.elapsed().as_secs_f64().max(1e-9)
    }

    /// Rate and the soonest end, once there is one.
    fn pace(&self) -> String {
        if self.rows_here() == 0 {
            return String::new();
        }
        format!("  {} rows/s  {}", si(self.rate()), self.soonest())
    }

    fn soonest(&self) -> String {
        let least = self.least_left();
        match Duration::try_from_secs_f64(self.seconds(least)) {
            Ok(left) if least < self.most_left() => format!("{} left at the soonest", human(left)),
            Ok(left) => format!("{} left at most", human(left)),
            Err(_) => String::new(),
        }
    }

    /// What a terminal shows.
    fn text(&self) -> String {
        let (done, of) = self.of_pass();
        format!(
            "pass {}: {}/{} rows{}  validation {} kept {}",
            1 + (self.rows.saturating_sub(1)) / self.pass_rows.max(1),
            si(done as f64),
            si(of as f64),
            if self.rows_here() > 0 { format!("  {}", self.soonest()) } else { String::new() },
            error(self.validation_error),
            error(self.best.and_then(|best| best.validation_error)),
        )
    }

    /// Rows of the pass in hand that are learnt, and all of them.
    fn of_pass(&self) -> (u64, u64) {
        match (self.rows, self.pass_rows) {
            (0, of) => (0, of),
            (rows, of) => (1 + (rows - 1) % of.max(1), of),
        }
    }

    /// Rows until all passes are over.
    fn most_left(&self) -> u64 {
        (self.pass_rows * u64::from(self.epochs)).saturating_sub(self.rows)
    }

    /// Rows until the training ends if no look is an improvement.
    fn least_left(&self) -> u64 {
        self.patience_ends.map_or(u64::MAX, |end| end.saturating_sub(self.rows)).min(self.most_left())
    }

    /// Seconds for so many rows, at the pace so far.
    fn seconds(&self, rows: u64) -> f64 {
        rows as f64 * self.elapsed().as_secs_f64() / self.rows_here().max(1) as f64
    }
}

fn error(error: Option<f64>) -> String {
    error.map_or("-".to_string(), |error| format!("{error:.5}"))
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
        warnings.push("no filter.safetensors beside the model to start from: the filter begins anew".to_string());
    }
    warnings
}
