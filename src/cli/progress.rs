//! Events of a build -> a bar on a terminal, plain lines elsewhere, JSON lines for machines.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::LogFormat;
use super::output::errln;
use crate::episode::SceneOutput;
use crate::episode::StageTimes;

/// Counts a build and shows it.
pub(super) struct Progress {
    started: Instant,
    last_line: Instant,
    display: Display,
    /// Scenes to build in this run.
    pub(super) scenes: u64,
    pub(super) done: u64,
    pub(super) failed: u64,
    pub(super) rows: u64,
    pub(super) times: StageTimes,
}

enum Display {
    Bar(ProgressBar),
    Lines,
    Json,
}

/// Time between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Progress {
    pub(super) fn new(scenes: u64, log: LogFormat) -> Progress {
        let display = match log {
            LogFormat::Json => Display::Json,
            LogFormat::Text if std::io::stderr().is_terminal() => Display::Bar(bar(scenes)),
            LogFormat::Text => Display::Lines,
        };
        let now = Instant::now();
        let times = StageTimes::new();
        Progress { started: now, last_line: now, display, scenes, done: 0, failed: 0, rows: 0, times }
    }

    /// Counts one scene.
    pub(super) fn scene(&mut self, output: &SceneOutput, times: &StageTimes, replay: impl FnOnce() -> String) {
        self.done += 1;
        self.rows += output.scans.iter().map(|scan| scan.cells.rows.len() as u64).sum::<u64>();
        self.times.add(times);
        if let Some(error) = &output.error {
            self.failed += 1;
            let scene = output.scene_id;
            match &self.display {
                Display::Json => tracing::warn!(event = "scene_failed", scene, error, replay = replay()),
                Display::Bar(bar) => bar.println(format!("scene {scene} failed: {error}\n  replay: {}", replay())),
                Display::Lines => errln!("scene {scene} failed: {error}\n  replay: {}", replay()),
            }
        }
        match &self.display {
            Display::Bar(bar) => {
                bar.set_message(self.rates());
                bar.inc(1);
            }
            Display::Lines | Display::Json if self.last_line.elapsed() < LINE_EVERY && self.done < self.scenes => {}
            Display::Lines => {
                self.last_line = Instant::now();
                errln!("{}/{} scenes  {}  ETA {}", self.done, self.scenes, self.rates(), human(self.remaining()));
            }
            Display::Json => {
                self.last_line = Instant::now();
                tracing::info!(
                    event = "progress",
                    scenes_done = self.done,
                    scenes = self.scenes,
                    failed = self.failed,
                    rows = self.rows,
                    rays = self.times.rays(),
                    elapsed_s = self.started.elapsed().as_secs_f64(),
                    eta_s = self.remaining().as_secs_f64(),
                );
            }
        }
    }

    /// Says that a shard is on disk.
    pub(super) fn shard(&self, shard: u64, bytes: u64) {
        if matches!(self.display, Display::Json) {
            tracing::info!(event = "shard_written", shard, bytes);
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

    fn remaining(&self) -> Duration {
        let left = (self.scenes - self.done) as f64 / self.done.max(1) as f64;
        self.started.elapsed().mul_f64(left)
    }

    /// Rates since the start, as people say them.
    fn rates(&self) -> String {
        let seconds = self.started.elapsed().as_secs_f64().max(1e-9);
        let per_second = |count: u64| count as f64 / seconds;
        format!(
            "{:.1} scenes/s  {} rays/s  {} rows/s",
            per_second(self.done),
            si(per_second(self.times.rays())),
            si(per_second(self.rows))
        )
    }
}

fn bar(scenes: u64) -> ProgressBar {
    let style =
        ProgressStyle::with_template("{bar:32.cyan/blue} {pos}/{len} scenes  {msg}  {elapsed} so far, {eta} left")
            .expect("a constant template")
            .progress_chars("━╸─");
    let bar = ProgressBar::new(scenes).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

/// 1234567 -> "1.23 M".
pub(super) fn si(value: f64) -> String {
    let (scaled, unit) = match value.abs() {
        v if v >= 1e9 => (value / 1e9, " G"),
        v if v >= 1e6 => (value / 1e6, " M"),
        v if v >= 1e3 => (value / 1e3, " k"),
        _ => (value, ""),
    };
    let digits = if scaled.abs() >= 100.0 {
        0
    } else if scaled.abs() >= 10.0 {
        1
    } else {
        2
    };
    format!("{scaled:.digits$}{unit}")
}

/// A duration in at most two units: "3 h 20 min", "1 min 5 s", "12.3 s".
pub(super) fn human(duration: Duration) -> String {
    let seconds = duration.as_secs();
    match seconds {
        0..60 => format!("{:.1} s", duration.as_secs_f64()),
        60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        _ => format!("{} h {} min", seconds / 3600, seconds / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_numbers_and_times_read_well() {
        assert_eq!(si(1_234_567.0), "1.23 M");
        assert_eq!(si(999.0), "999");
        assert_eq!(human(Duration::from_secs(3725)), "1 h 2 min");
        assert_eq!(human(Duration::from_millis(12_340)), "12.3 s");
    }
}
