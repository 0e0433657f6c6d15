//! Log weights -> weights, effective sample size, parents; and how many ancestors are left.
//!
//! In: one logarithm a particle. Out: normalised weights, the parents of a systematic resampling (Kitagawa 1996; Carpenter
//! et al. 1999). Logarithms throughout: products of densities underflow within a few sweeps.

use crate::math;
use crate::wide::{LANES, Work, widest};

/// Normalises in place to weights that sum to 1. All equal, and `false`, where no weight is left (all zero or not a number).
pub(super) fn normalise(log_weights: &mut [f64]) -> bool {
    let most = log_weights.iter().copied().filter(|w| !w.is_nan()).fold(f64::NEG_INFINITY, f64::max);
    if most.is_infinite() {
        log_weights.fill(-math::ln(log_weights.len() as f64));
        return false;
    }
    let shares = exponentials(log_weights.iter().map(|w| w - most).collect());
    let total: f64 = shares.iter().filter(|share| !share.is_nan()).sum();
    let scale = most + math::ln(total);
    for w in log_weights {
        *w = if w.is_nan() { f64::NEG_INFINITY } else { *w - scale };
    }
    true
}

/// e to the power of each.
pub(super) fn exponentials(mut logs: Vec<f64>) -> Vec<f64> {
    widest(Exponentials(&mut logs));
    logs
}

/// Replaces numbers by e to their power.
struct Exponentials<'a>(&'a mut [f64]);

impl Work for Exponentials<'_> {
    type Out = ();
    #[inline(always)]
    fn run(self) {
        let (blocks, rest) = self.0.as_chunks_mut::<LANES>();
        for block in blocks {
            *block = math::exp_lanes(block);
        }
        for x in rest {
            *x = math::exp(*x);
        }
    }
}

/// 1 / sum of squares: how many equally weighted particles would do as well.
pub(super) fn effective_samples(weights: &[f64]) -> f64 {
    1.0 / weights.iter().map(|w| w * w).sum::<f64>()
}

/// The parent of each of `weights.len()` offspring: particle k gets floor or ceil of N w_k of them. `start` lies in [0, 1).
pub(super) fn systematic(weights: &[f64], start: f64) -> Vec<u32> {
    let count = weights.len();
    let mut parents = Vec::with_capacity(count);
    let mut k = 0;
    let mut sum = weights[0];
    for i in 0..count {
        let mark = (i as f64 + start) / count as f64;
        // Rounding may leave the whole sum below the last mark: stay with the last particle of positive weight.
        while mark >= sum && k + 1 < count {
            k += 1;
            sum += weights[k];
        }
        parents.push(k as u32);
    }
    if let Some(last) = weights.iter().rposition(|&w| w > 0.0) {
        for parent in parents.iter_mut().rev().take_while(|p| **p as usize > last) {
            *parent = last as u32;
        }
    }
    parents
}

/// The family tree of the particles: which of the first each descends from.
#[derive(Clone, Debug)]
pub(super) struct Genealogy(Vec<u32>);

impl Genealogy {
    pub(super) fn new(particles: usize) -> Genealogy {
        Genealogy((0..particles as u32).collect())
    }

    /// A resampling: the parent of each particle.
    pub(super) fn record(&mut self, parents: &[u32]) {
        self.0 = parents.iter().map(|&p| self.0[p as usize]).collect();
    }

    /// Distinct ancestors at the start. What the filter got wrong before the last common ancestor lived, no spread shows.
    pub(super) fn distinct(&self) -> usize {
        // Systematic resampling keeps the order: equal ancestors are neighbours.
        1 + self.0.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(parents: &[u32], n: usize) -> Vec<usize> {
        (0..n).map(|k| parents.iter().filter(|&&p| p as usize == k).count()).collect()
    }

    #[test]
    fn law_systematic_offspring_are_floor_or_ceil_of_n_times_weight() {
        for seed in 0..200u32 {
            let raw: Vec<f64> = (0..37).map(|i| 1.0 + math::sin(f64::from(seed * 37 + i) * 1.7)).collect();
            let total: f64 = raw.iter().sum();
            let weights: Vec<f64> = raw.iter().map(|w| w / total).collect();
            for start in [0.0, 0.31, 0.77, 1.0 - f64::EPSILON] {
                for (k, &count) in counts(&systematic(&weights, start), 37).iter().enumerate() {
                    let expected = 37.0 * weights[k];
                    assert!((count as f64 - expected).abs() < 1.0 + 1e-9, "seed {seed}: {count} of {expected}");
                }
            }
        }
    }

    #[test]
    fn extreme_one_weight_of_one_gets_all_offspring() {
        for start in [0.0, 0.5, 1.0 - f64::EPSILON] {
            for k in 0..5 {
                let mut weights = [0.0; 5];
                weights[k] = 1.0;
                assert_eq!(systematic(&weights, start), vec![k as u32; 5]);
            }
        }
        // A sum that rounding left below one must not hand offspring to a particle of weight zero.
        assert_eq!(systematic(&[0.3, 0.699_999, 0.0], 1.0 - f64::EPSILON), vec![1, 1, 1]);
    }

    #[test]
    fn exact_weights_of_huge_and_vanishing_logarithms() {
        let mut w = vec![-1e6, -1e6 - math::ln(3.0), f64::NEG_INFINITY, f64::NAN];
        assert!(normalise(&mut w));
        let w: Vec<f64> = w.into_iter().map(math::exp).collect();
        // exp(-1e6) itself is zero in f64; the tolerance is the rounding of 1e6.
        assert!((w[0] - 0.75).abs() < 1e-9 && (w[1] - 0.25).abs() < 1e-9 && w[2] == 0.0 && w[3] == 0.0);
    }

    #[test]
    fn extreme_no_weight_left_resets_to_equal() {
        for bad in [f64::NEG_INFINITY, f64::NAN, f64::INFINITY] {
            let mut w = vec![bad; 4];
            assert!(!normalise(&mut w));
            assert!(w.iter().all(|&x| (math::exp(x) - 0.25).abs() < 1e-15));
        }
    }

    #[test]
    fn exact_ancestors_are_counted_through_generations() {
        let mut tree = Genealogy::new(4);
        assert_eq!(tree.distinct(), 4);
        tree.record(&[0, 0, 2, 3]);
        assert_eq!(tree.distinct(), 3);
        tree.record(&[0, 1, 1, 1]);
        assert_eq!(tree.distinct(), 1);
    }

    #[test]
    fn exact_effective_samples_of_weights_known_on_paper() {
        assert_eq!(effective_samples(&[0.25; 4]), 4.0);
        assert_eq!(effective_samples(&[0.0, 1.0, 0.0]), 1.0);
        assert!((effective_samples(&[0.5, 0.25, 0.25]) - 8.0 / 3.0).abs() < 1e-15);
    }
}
