//! Rows a second of every filter, whole training steps (forward run, gradient, update), and how near the machine's bound the
//! default comes. CPU time of one thread.
//!
//! `cargo bench --bench filter`; numbers as arguments choose other hidden layers (`-- 16x16 32`). The bound of a full covariance
//! of s weights of e bytes: the longer of 3 s^2 operations at the peak of fused multiply-adds, and s^2 e bytes at the bandwidth of
//! a buffer as large as the triangle; both measured here, before and after, the better of the two. Medians of interleaved rounds.

mod bound;
mod trainee;

use trainee::{FILTERS, Rows, Trainee, rows};

const ROUNDS: usize = 7;
/// About so long a round, seconds.
const ROUND_S: f64 = 0.1;

fn main() -> Result<(), String> {
    let networks: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let networks =
        if networks.is_empty() { ["8x8", "16x16", "32x32", "32x32x32"].map(String::from).into() } else { networks };
    let rows = rows();
    networks.iter().try_for_each(|hidden| table(&rows, hidden))
}

fn table(rows: &Rows, hidden: &str) -> Result<(), String> {
    let mut trainees = Vec::new();
    for filter in FILTERS {
        // The unscented filter refuses large networks.
        if let Ok(mut trainee) = Trainee::new(hidden, filter) {
            let count = ((ROUND_S / (trainee.learn(rows, 16) / 16.0)) as usize).clamp(16, 1 << 20) / 8 * 8;
            trainees.push((filter, trainee, count, Vec::new()));
        }
    }
    let weights = trainees.first().ok_or_else(|| format!("{hidden}: no such network"))?.1.network.weights.len();
    let before = Bound::measure(weights);
    for _ in 0..ROUNDS {
        for (_, trainee, count, rates) in &mut trainees {
            rates.push(*count as f64 / trainee.learn(rows, *count));
        }
    }
    let bound = before.better(Bound::measure(weights));
    let rates: Vec<(&str, f64)> = trainees
        .into_iter()
        .map(|(filter, .., mut rates)| {
            rates.sort_unstable_by(f64::total_cmp);
            (filter, rates[rates.len() / 2])
        })
        .collect();
    let rate = |name: &str| rates.iter().find(|(filter, _)| *filter == name).map_or(f64::NAN, |(_, rate)| *rate);
    println!("{hidden}: {weights} weights; peak {:.0} GF/s f32", bound.flops / 1e9);
    for (filter, rate) in &rates {
        println!("  {filter:<11} {rate:>10.0} rows/s");
    }
    for (bits, bytes) in [(32, 4.0), (64, 8.0)] {
        let (form, most) = (format!("f{bits}"), bound.rows_per_s(weights, bytes));
        let (default, robust) = (rate(&format!("ekf-{form}")), rate(&format!("ud-{form}")));
        println!(
            "  {form}: bound {most:.0} rows/s, the default at {:.2} of it; robust takes {:.2} of its time",
            default / most,
            default / robust
        );
    }
    Ok(())
}

/// What this machine does at most, for covariances of one size.
struct Bound {
    flops: f64,
    /// Of f32 and f64 triangles.
    bandwidths: [f64; 2],
}

impl Bound {
    fn measure(weights: usize) -> Bound {
        let triangle = |bytes: usize| bound::bandwidth(bytes * weights * (weights + 1) / 2);
        Bound { flops: bound::peak_flops(), bandwidths: [triangle(4), triangle(8)] }
    }

    fn better(self, other: Bound) -> Bound {
        let [a, b] = self.bandwidths;
        Bound {
            flops: self.flops.max(other.flops),
            bandwidths: [a.max(other.bandwidths[0]), b.max(other.bandwidths[1])],
        }
    }

    fn rows_per_s(&self, weights: usize, bytes: f64) -> f64 {
        let square = (weights * weights) as f64;
        let flops = self.flops * 4.0 / bytes;
        let bandwidth = self.bandwidths[usize::from(bytes > 4.0)];
        1.0 / (3.0 * square / flops).max(square * bytes / bandwidth)
    }
}
