//! What the benches share: yards to cast at, and rates by CPU time.

#![allow(dead_code)] // Each bench takes what it needs.

pub mod paper;
pub mod yards;

use marsyard::measure::clock::thread_cpu_s;

/// Rounds that a rate is the median of.
const ROUNDS: usize = 9;
/// A round repeats its work until it has taken this long, seconds of CPU.
const ROUND_S: f64 = 0.02;

/// Median CPU seconds of one call of `work`, after one that does not count.
pub fn seconds(mut work: impl FnMut()) -> f64 {
    work();
    let mut rounds: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let (begun, mut calls) = (thread_cpu_s(), 0.0);
            loop {
                work();
                calls += 1.0;
                let spent = thread_cpu_s() - begun;
                if spent >= ROUND_S {
                    return spent / calls;
                }
            }
        })
        .collect();
    rounds.sort_by(f64::total_cmp);
    rounds[ROUNDS / 2]
}

/// Prints how many `unit` a second of one thread's CPU `work` does, `count` of them a call.
pub fn rate(what: &str, unit: &str, count: f64, work: impl FnMut()) {
    let seconds = seconds(work);
    println!("{what:44} {:>12.4e} {unit}/s   {:>10.3} ms a call", count / seconds, 1e3 * seconds);
}
