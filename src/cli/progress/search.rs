//! A search for a network, in words: rungs, networks and the best so far.

use std::path::Path;
use std::time::{Duration, Instant};

use super::{Teller, counted, human, si};
use crate::cli::LogFormat;
use crate::search::networks::shown;
use crate::search::{Entry, Event, Start};
use crate::train::scenes::Sample;

/// Counts a search and shows it. Networks differ in cost a thousandfold, so what is left is told by expected time, not by number.
pub(in crate::cli) struct SearchProgress {
    teller: Teller,
    out: String,
    rows: String,
    threads: usize,
    started: Instant,
    /// Thread seconds of each rung, as expected.
    rung_seconds: Vec<f64>,
    /// From 1.
    rung: usize,
    networks: usize,
    done: usize,
    done_here: u64,
    /// Thread seconds: expected of what is done here, measured of it, and expected of what is left of the rung.
    expected_s: f64,
    measured_s: f64,
    left_s: f64,
}

impl SearchProgress {
    pub(in crate::cli) fn new(
        out: &Path,
        corpus: &str,
        (train, validation): (&Sample, &Sample),
        threads: usize,
        log: LogFormat,
    ) -> SearchProgress {
        let of = |sample: &Sample| {
            format!("{} rows of {} of {} scenes", sample.rows.len(), sample.scenes, sample.scenes_there)
        };
        SearchProgress {
            teller: Teller::new(log),
            rows: format!("{corpus}: {} to learn, {} to validate by", of(train), of(validation)),
            out: out.display().to_string(),
            threads,
            started: Instant::now(),
            rung_seconds: Vec::new(),
            rung: 0,
            networks: 0,
            done: 0,
            done_here: 0,
            expected_s: 0.0,
            measured_s: 0.0,
            left_s: 0.0,
        }
    }

    pub(in crate::cli) fn take(&mut self, event: &Event) {
        match event {
            Event::Start(start) => self.start(start),
            Event::Rung { number, rows, networks, done_before, seconds } => {
                (self.rung, self.networks, self.done) = (number + 1, *networks, *done_before);
                self.left_s = *seconds;
                if self.teller.is_json() {
                    tracing::info!(event = "rung", rung = self.rung, rows, networks, done_before);
                } else {
                    let before = if *done_before > 0 { format!(", {done_before} of them done") } else { String::new() };
                    self.teller.say(&format!(
                        "rung {}: {} learn {rows} rows{before}",
                        self.rung,
                        counted(*networks as u64, "network")
                    ));
                }
            }
            Event::Done { entry, best, seconds } => self.done(entry, best, *seconds),
        }
    }

    fn start(&mut self, start: &Start) {
        // The clock begins with the first network: reading and measuring say nothing of what is left.
        self.started = Instant::now();
        self.rung_seconds.clone_from(&start.rung_seconds);
        let seconds = start.rung_seconds.iter().sum::<f64>() / self.threads as f64;
        let expected = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        if self.teller.is_json() {
            tracing::info!(
                event = "start",
                run = %self.out,
                rows = %self.rows,
                networks = start.networks,
                resumed = start.resumed,
                threads = self.threads,
                expected_s = expected.as_secs_f64(),
                row_bytes = start.row_bytes,
                network_bytes = start.network_bytes,
            );
            return;
        }
        self.teller.say(&format!(
            "{} -> {} ({}B of rows, at most {}B of networks and covariances)",
            self.rows,
            self.out,
            si(start.row_bytes as f64),
            si(start.network_bytes as f64)
        ));
        let rates = start.throughput.probes.iter().map(|probe| {
            format!("{} ({} weights) {}", shown(&probe.hidden), probe.weights, si(1.0 / probe.row_s.max(1e-12)))
        });
        self.teller.say(&format!("rows/s a thread: {}", rates.collect::<Vec<_>>().join(", ")));
        let rungs = start.rungs.iter().map(|rung| format!("{} x {} rows", rung.networks, rung.rows));
        let resumed =
            if start.resumed > 0 { format!(", {} trainings done before", start.resumed) } else { String::new() };
        self.teller.say(&format!(
            "{} networks ({}): about {} on {}{resumed}",
            start.networks,
            rungs.collect::<Vec<_>>().join(", "),
            human(expected),
            counted(self.threads as u64, "thread")
        ));
    }

    fn done(&mut self, entry: &Entry, best: &Entry, seconds: f64) {
        self.done += 1;
        self.done_here += 1;
        self.expected_s += seconds;
        self.measured_s += entry.seconds;
        self.left_s = (self.left_s - seconds).max(0.0);
        let best_shown = format!("{} {:.5}", shown(&best.hidden), best.validation_error.unwrap_or(f64::NAN));
        let (rate, left) = (self.rate(), self.remaining());
        let (rung, done, networks) = (self.rung, self.done, self.networks);
        let text = || format!("rung {rung}: {done}/{networks}  ETA {}  best {best_shown}  {rate}", human(left));
        let json = || {
            tracing::info!(
                event = "network",
                rung,
                hidden = %shown(&entry.hidden),
                weights = entry.weights,
                validation_error = entry.validation_error,
                best = %shown(&best.hidden),
                best_validation_error = best.validation_error,
                done,
                networks,
                seconds = entry.seconds,
                eta_s = left.as_secs_f64(),
            );
        };
        // Machines are told of every network.
        let is_told = self.teller.is_json();
        self.teller.step((done as u64, networks as u64), is_told, text, json);
    }

    /// Takes the bar away.
    pub(in crate::cli) fn finish(&self) {
        self.teller.finish();
    }

    pub(in crate::cli) fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    /// Networks trained as far as a rung in this process.
    pub(in crate::cli) fn done_here(&self) -> u64 {
        self.done_here
    }

    pub(in crate::cli) fn expected_thread_s(&self) -> f64 {
        self.expected_s
    }

    pub(in crate::cli) fn thread_s(&self) -> f64 {
        self.measured_s
    }

    fn rate(&self) -> String {
        format!("{:.1} networks/s", self.done_here as f64 / self.elapsed().as_secs_f64().max(1e-9))
    }

    /// Of this rung and those to come, at the pace so far.
    fn remaining(&self) -> Duration {
        let pace = self.elapsed().as_secs_f64() / self.expected_s.max(1e-9);
        let left = self.left_s + self.rung_seconds.iter().skip(self.rung).sum::<f64>();
        Duration::try_from_secs_f64(pace * left).unwrap_or(Duration::MAX)
    }
}
