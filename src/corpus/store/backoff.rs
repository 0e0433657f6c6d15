//! Trouble with a store -> how long to wait before the next try, or no more.
//!
//! Waits double from 0.1 s to 10 s, each between half and all of that, so that many machines do not come back at once; which
//! share is a hash of name and try, for no generator of random numbers is at work here. The limit is time without progress: by default
//! 120 s, `MARSYARD_RETRY_S` sets another. At least one more try is made. The whole is limited too: every byte earns the time that
//! it takes at the slowest rate that is waited for, so that a server that drips ends as one that says nothing.
//!
//! Beside the retries of `object_store` 0.14, which are limited by their count and by the time since the first request, and repeat that
//! request as it was signed: here a transfer that moves goes on, one that stands still or drips ends, and each try is
//! signed anew. Tested against servers that cut, drip and fall silent (`wire`).

use std::cell::Cell;
use std::time::{Duration, Instant};

const FIRST: Duration = Duration::from_millis(100);
const LONGEST: Duration = Duration::from_secs(10);
const LIMIT_S: f64 = 120.0;
/// A request without an answer for so long is given up; tried again, if there is time.
const SILENCE_S: f64 = 30.0;
/// The slowest transfer that is waited for, bytes a second.
pub(crate) const SLOWEST: f64 = 32_768.0;
/// What a name in a listing earns, as bytes: listings come by some thousand names a second.
pub(crate) const NAME_BYTES: usize = 32;

/// How long faults are borne with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    pub patience: Duration,
    pub silence: Duration,
}

impl Limits {
    /// As the environment says.
    pub(crate) fn of_environment() -> Limits {
        let asked = std::env::var("MARSYARD_RETRY_S").ok().and_then(|text| text.trim().parse::<f64>().ok());
        Limits::of(asked.filter(|seconds| (0.0..=86_400.0).contains(seconds)).unwrap_or(LIMIT_S))
    }

    /// So many seconds.
    pub(crate) fn of(patience_s: f64) -> Limits {
        let silence = Duration::from_secs_f64(patience_s.clamp(1.0, SILENCE_S));
        Limits { patience: Duration::from_secs_f64(patience_s), silence }
    }
}

/// The patience with one operation.
#[derive(Debug)]
pub(crate) struct Backoff {
    limits: Limits,
    salt: u64,
    started: Instant,
    last_progress: Cell<Instant>,
    /// Time for the whole, earned by what came.
    earned: Cell<Duration>,
    tries: Cell<u32>,
}

impl Backoff {
    pub(crate) fn new(limits: Limits, name: &str) -> Backoff {
        let salt = blake3::hash(format!("{name} {}", std::process::id()).as_bytes());
        let salt = u64::from_le_bytes(salt.as_bytes()[..8].try_into().expect("a hash has 32 bytes"));
        let now = Instant::now();
        Backoff {
            limits,
            salt,
            started: now,
            last_progress: Cell::new(now),
            earned: Cell::default(),
            tries: Cell::new(0),
        }
    }

    /// So many bytes came, or are to be sent: begin anew, with more time for the whole.
    pub(crate) fn made_progress(&self, bytes: usize) {
        self.last_progress.set(Instant::now());
        self.earned.set(self.earned.get() + Duration::from_secs_f64(bytes as f64 / SLOWEST));
        self.tries.set(0);
    }

    /// Whether all of this took longer than what came is worth.
    pub(crate) fn is_over(&self) -> bool {
        self.started.elapsed() > self.limits.patience.max(self.limits.silence) + self.earned.get()
    }

    /// How long to wait before the next try; `None`: give up.
    pub(crate) fn pause(&self) -> Option<Duration> {
        let tries = self.tries.get();
        let gone = self.last_progress.get().elapsed();
        if tries > 0 && gone >= self.limits.patience || self.is_over() {
            return None;
        }
        self.tries.set(tries + 1);
        let whole = FIRST.saturating_mul(1 << tries.min(10)).min(LONGEST);
        let hash = blake3::hash(&[self.salt.to_le_bytes(), u64::from(tries).to_le_bytes()].concat());
        let pause = whole.mul_f64(0.5 + f64::from(hash.as_bytes()[0]) / 512.0);
        // The last try falls on the end of the patience, not behind it.
        Some(pause.min(self.limits.patience.saturating_sub(gone).max(FIRST)))
    }

    /// Tries so far without progress.
    pub(crate) fn tries(&self) -> u32 {
        self.tries.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_waits_grow_to_ten_seconds_and_are_spread() {
        let patience = Backoff::new(Limits::of(1e4), "a");
        let pauses: Vec<f64> = (0..20).map(|_| patience.pause().unwrap().as_secs_f64()).collect();
        for (k, pause) in pauses.iter().enumerate() {
            let whole = (0.1 * f64::from(1 << k.min(10))).min(10.0);
            assert!((0.5 * whole..=whole).contains(pause), "try {k}: {pause} s of {whole}");
        }
        let other = Backoff::new(Limits::of(1e4), "b");
        assert!((0..20).any(|k| other.pause().unwrap().as_secs_f64() != pauses[k]), "two names wait alike");
        patience.made_progress(1);
        assert!(patience.pause().unwrap().as_secs_f64() <= 0.1);
    }

    #[test]
    fn law_progress_too_small_for_its_time_ends_and_enough_of_it_does_not() {
        let patience = Backoff::new(Limits::of(0.05), "a");
        let begun = Instant::now();
        while !patience.is_over() {
            patience.made_progress(1);
            std::thread::sleep(Duration::from_millis(20));
        }
        // A second is the least that any answer is waited for.
        assert!(begun.elapsed() >= Duration::from_secs(1) && patience.pause().is_none());
        patience.made_progress(10 * SLOWEST as usize);
        assert!(!patience.is_over() && patience.pause().is_some());
    }

    #[test]
    fn law_patience_ends_after_at_least_one_more_try() {
        let none = Backoff::new(Limits::of(0.0), "a");
        assert!(none.pause().is_some() && none.pause().is_none());
        let short = Backoff::new(Limits::of(0.3), "a");
        let (started, mut tries) = (Instant::now(), 0);
        while let Some(pause) = short.pause() {
            std::thread::sleep(pause);
            tries += 1;
            assert!(tries < 20, "the loop is bounded");
        }
        let gone = started.elapsed().as_secs_f64();
        assert!((0.3..5.0).contains(&gone) && tries >= 2, "{gone} s, {tries} tries");
    }
}
