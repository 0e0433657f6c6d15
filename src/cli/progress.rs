//! Steps of a long verb -> one line on a terminal, plain lines elsewhere, JSON lines for machines.
//!
//! Each verb that takes long keeps its own counts and words (the modules below); how they are shown, and how often, is said here once.
//! On a terminal a short bar and the text share one line, cut at the terminal's width as it is when the line is drawn: what matters
//! most stands first.

mod build;
mod localise;
mod search;
mod tradeoff;
mod train;

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

pub(super) use self::build::BuildProgress;
pub(super) use self::localise::LocaliseProgress;
pub(super) use self::search::SearchProgress;
pub(super) use self::tradeoff::TradeoffProgress;
pub(super) use self::train::TrainProgress;
use super::LogFormat;
use super::output::errln;

/// Time between two plain lines, or two JSON lines of a build.
const LINE_EVERY: Duration = Duration::from_secs(10);
/// Time between two drawings where nothing happens: a line follows its terminal's width.
const DRAW_EVERY: Duration = Duration::from_millis(250);

/// Shows how far a verb is.
pub(super) struct Teller {
    display: Display,
    last_line: Instant,
}

enum Display {
    Bar(ProgressBar),
    Lines,
    Json,
}

impl Teller {
    pub(super) fn new(log: LogFormat) -> Teller {
        let display = match log {
            LogFormat::Json => Display::Json,
            LogFormat::Text if std::io::stderr().is_terminal() => Display::Bar(bar()),
            LogFormat::Text => Display::Lines,
        };
        Teller { display, last_line: Instant::now() }
    }

    /// Whether machines listen.
    pub(super) fn is_json(&self) -> bool {
        matches!(self.display, Display::Json)
    }

    /// Says a line that stays.
    pub(super) fn say(&self, line: &str) {
        match &self.display {
            Display::Bar(bar) if bar.length().is_some() => bar.println(line),
            _ => errln!("{line}"),
        }
    }

    /// Shows that so much is done: a terminal always, others where a line is due.
    pub(super) fn step(
        &mut self,
        (done, of): (u64, u64),
        worth_a_line: bool,
        text: impl Fn() -> String,
        json: impl FnOnce(),
    ) {
        self.show((done, of), &text);
        self.line(worth_a_line || done == of, text, json);
    }

    /// Shows on a terminal that so much is done.
    pub(super) fn show(&self, (done, of): (u64, u64), text: impl FnOnce() -> String) {
        if let Display::Bar(bar) = &self.display {
            // Nothing is drawn before the first step: what is said until then stands above.
            if bar.length().is_none() {
                bar.enable_steady_tick(DRAW_EVERY);
            }
            bar.set_length(of);
            bar.set_position(done);
            bar.set_message(text());
        }
    }

    /// Writes a line where there is no terminal, if it is worth one or the last one is long ago.
    pub(super) fn line(&mut self, worth_a_line: bool, text: impl FnOnce() -> String, json: impl FnOnce()) {
        if !worth_a_line && self.last_line.elapsed() < LINE_EVERY {
            return;
        }
        match self.display {
            Display::Bar(_) => return,
            Display::Lines => errln!("{}", text()),
            Display::Json => json(),
        }
        self.last_line = Instant::now();
    }

    /// Takes the bar away.
    pub(super) fn finish(&self) {
        if let Display::Bar(bar) = &self.display {
            bar.finish_and_clear();
        }
    }
}

/// The message takes what the bar and the time leave of the line, and is cut there.
const LINE: &str = "{bar:16.cyan/blue} {elapsed:>3} {wide_msg}";

fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template(LINE).expect("a constant template").progress_chars("━╸─");
    ProgressBar::no_length().with_style(style)
}

/// "1 thread", "4 threads".
pub(super) fn counted<N: std::fmt::Display + PartialEq + From<u8>>(count: N, thing: &str) -> String {
    format!("{count} {thing}{}", if count == N::from(1) { "" } else { "s" })
}

/// 1234567 -> "1.23 M".
pub(super) fn si(value: f64) -> String {
    let (scaled, unit) = match value.abs() {
        v if v >= 1e9 => (value / 1e9, " G"),
        v if v >= 1e6 => (value / 1e6, " M"),
        v if v >= 1e3 => (value / 1e3, " k"),
        _ => (value, ""),
    };
    let digits = if scaled.abs() >= 100.0 || unit.is_empty() && scaled.fract() == 0.0 {
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
        assert_eq!([counted(1_u64, "thread"), counted(2_u64, "thread")], ["1 thread", "2 threads"]);
    }

    #[test]
    fn law_lines_come_when_they_are_worth_it_late_or_the_last() {
        let mut teller = Teller { display: Display::Json, last_line: Instant::now() };
        let mut lines = Vec::new();
        for (step, worth_a_line) in [((1, 9), false), ((2, 9), true), ((3, 9), false), ((9, 9), false)] {
            teller.step(step, worth_a_line, String::new, || lines.push(step.0));
        }
        assert_eq!(lines, [2, 9]);
        let late = Instant::now().checked_sub(LINE_EVERY).expect("a clock that runs for ten seconds");
        Teller { display: Display::Json, last_line: late }.step((4, 9), false, String::new, || lines.push(4));
        assert_eq!(lines, [2, 9, 4]);
    }
}
