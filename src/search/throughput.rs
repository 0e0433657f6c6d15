//! How long it will take: a few networks are timed, the others lie between them.
//!
//! An update costs about the square of the number of weights, and more once the covariance leaves the nearest cache, so times are
//! interpolated between logarithms. All threads measure at once, because they share caches and memory. Times decide nothing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::entry::{course, params_of};
use super::networks::Hidden;
use super::rungs::Rung;
use crate::math;
use crate::parallel;
use crate::train::memory::{Course, Event, Held, train};
use crate::train::{TrainError, TrainParams};

/// Time to measure a network, unless it has learnt all that it will in the search before.
const PROBE_TIME: Duration = Duration::from_millis(120);
/// Networks that are measured.
const PROBES: usize = 6;

/// Seconds of networks of some size.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Probe {
    pub hidden: Hidden,
    pub weights: usize,
    /// To learn a row, and to look at all validation rows once.
    pub row_s: f64,
    pub look_s: f64,
}

/// Measured times, by ascending weights.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Throughput {
    pub probes: Vec<Probe>,
}

impl Throughput {
    /// Measures networks from the smallest to the largest. `sorted`: by ascending weights; `most_rows`: of the last rung.
    pub(crate) fn measure(
        params: &TrainParams,
        held: &Held,
        sorted: &[Hidden],
        most_rows: u64,
        threads: usize,
    ) -> Result<Throughput, TrainError> {
        let mut probes: Vec<Probe> = Vec::new();
        for k in 0..PROBES {
            let hidden = &sorted[k * (sorted.len() - 1) / (PROBES - 1)];
            let params = params_of(params, hidden);
            let weights = params.layout(held.train.width).weights();
            if probes.last().is_some_and(|probe| probe.weights == weights) {
                continue;
            }
            let measured = parallel::on_every_thread(threads, || time(&params, held, most_rows))?;
            let measured = measured.into_iter().collect::<Result<Vec<_>, _>>()?;
            let mean = |of: fn(&(f64, f64)) -> f64| measured.iter().map(of).sum::<f64>() / measured.len() as f64;
            let (row_s, look_s) = (mean(|times| times.0), mean(|times| times.1));
            probes.push(Probe { hidden: hidden.clone(), weights, row_s, look_s });
        }
        Ok(Throughput { probes })
    }

    /// Thread seconds of a network up to a rung, if patience lasts.
    pub(crate) fn seconds(&self, params: &TrainParams, held: &Held, hidden: &[usize], rung: &Rung) -> f64 {
        let params = params_of(params, hidden);
        let Course { rows, validate_every } = course(&params, held, rung);
        let (row_s, look_s) = self.at(params.layout(held.train.width).weights());
        rows as f64 * row_s + (1 + rows.div_ceil(validate_every)) as f64 * look_s
    }

    /// Seconds a row and a look of a network with so many weights.
    fn at(&self, weights: usize) -> (f64, f64) {
        let after = self.probes.partition_point(|probe| probe.weights < weights).min(self.probes.len() - 1);
        let (low, high) = (&self.probes[after.saturating_sub(1)], &self.probes[after]);
        let log = |x: f64| math::ln(x.max(1e-12));
        let span = log(high.weights as f64) - log(low.weights as f64);
        let part = if span > 0.0 { (log(weights as f64) - log(low.weights as f64)) / span } else { 0.0 };
        let between = |low: f64, high: f64| math::exp(log(low) + part * (log(high) - log(low)));
        (between(low.row_s, high.row_s), between(low.look_s, high.look_s))
    }
}

/// Seconds a row and a look.
fn time(params: &TrainParams, held: &Held, most_rows: u64) -> Result<(f64, f64), TrainError> {
    let over = AtomicBool::new(false);
    let (mut begun, mut look_s, mut learnt) = (Instant::now(), 0.0, (1, f64::EPSILON));
    let course = Course { rows: most_rows, validate_every: u64::MAX };
    train(params, held, course, &over, &mut |event| match event {
        Event::Look { .. } => {
            look_s = begun.elapsed().as_secs_f64();
            begun = Instant::now();
        }
        Event::Rows(rows) => {
            learnt = (rows, begun.elapsed().as_secs_f64());
            over.store(begun.elapsed() > PROBE_TIME, Ordering::Relaxed);
        }
    })?;
    Ok((learnt.1 / learnt.0 as f64, look_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_times_between_two_probes_follow_a_power_of_the_weights() {
        let probe = |weights: usize, row_s| Probe { hidden: vec![1], weights, row_s, look_s: 2.0 };
        let throughput = Throughput { probes: vec![probe(10, 1e-6), probe(100, 1e-4), probe(1000, 1e-2)] };
        for weights in [10, 20, 100, 300, 1000] {
            let (row_s, look_s) = throughput.at(weights);
            let square = (weights * weights) as f64 * 1e-8;
            assert!((row_s / square - 1.0).abs() < 1e-12 && (look_s - 2.0).abs() < 1e-12, "{weights}: {row_s}");
        }
        let single = Throughput { probes: vec![probe(10, 1e-6)] };
        assert!((single.at(10).0 - 1e-6).abs() < 1e-18);
    }
}
