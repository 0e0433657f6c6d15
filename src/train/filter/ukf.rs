//! The square-root unscented filter: no Jacobians, 2 s + 1 forward runs a row. For small networks.
//!
//! Source: van der Merwe & Wan 2001, *The square-root unscented Kalman filter for state and parameter-estimation*, parameter
//! form, kappa = 0; P = S S', S lower triangular. Deviations: the innovation's variance is not taken below R + c'c, where
//! c_j = (y(w + eta S_j) - y(w - eta S_j)) / (2 eta): with alpha < 1 the centre's negative weight could carry it there, and P
//! would turn indefinite; exact wherever that weight is not negative. Q is added to the squared diagonal of S. All f64.

use super::noise::Noise;
use super::state::{Reader, Writer};
use super::{Counters, Filter, FilterError, FilterState};
use crate::train::Network;
use crate::train::network::Activations;
use crate::train::params::UkfParams;

/// Largest number of weights: beyond, a row takes more than some milliseconds.
pub(crate) const MOST_WEIGHTS: usize = 1000;

const KIND: &str = "ukf";

/// The filter.
pub(super) struct Ukf {
    root: SquareRoot,
    noise: Noise,
    clip: f64,
    counters: Counters,
    tape: Activations,
}

/// Weights' square root of covariance, and what an update needs.
pub(crate) struct SquareRoot {
    p0: f64,
    alpha: f64,
    beta: f64,
    /// S, column by column from the diagonal down.
    columns: Vec<Vec<f64>>,
    /// eta c and the shifted weights.
    slopes: Vec<f64>,
    shifted: Vec<f64>,
}

/// What became of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Learnt {
    Yes,
    /// P was rebuilt from its diagonal after the row.
    Rebuilt,
    No,
}

impl SquareRoot {
    pub(super) fn new(size: usize, p0: f64, alpha: f64, beta: f64) -> SquareRoot {
        let columns = (0..size)
            .map(|j| {
                let mut column = vec![0.0; size - j];
                column[0] = p0.sqrt();
                column
            })
            .collect();
        SquareRoot { p0, alpha, beta, columns, slopes: vec![0.0; size], shifted: vec![0.0; size] }
    }

    /// Learns one target of any function of the weights; they stay finite.
    pub(super) fn update(
        &mut self,
        weights: &mut [f64],
        target: f64,
        r: f64,
        q: f64,
        mut output: impl FnMut(&[f64]) -> f64,
    ) -> Learnt {
        let size = weights.len() as f64;
        let square = self.alpha * self.alpha;
        let (eta, share) = ((square * size).sqrt(), 1.0 / (2.0 * square * size));
        let centre_mean = 1.0 - 1.0 / square;
        let centre_square = centre_mean + 1.0 - square + self.beta;
        for column in &mut self.columns {
            column[0] = (column[0] * column[0] + q).sqrt();
        }
        let centre = output(weights);
        // Sums of outputs less that of the centre: no cancellation where alpha is small.
        let (mut mean, mut spread) = (0.0, 0.0);
        let mut gained = 0.0;
        self.shifted.copy_from_slice(weights);
        for (j, column) in self.columns.iter().enumerate() {
            let mut at = |sign: f64| {
                for ((x, w), s) in self.shifted[j..].iter_mut().zip(&weights[j..]).zip(column) {
                    *x = w + sign * eta * s;
                }
                output(&self.shifted) - centre
            };
            let (up, down) = (at(1.0), at(-1.0));
            self.shifted[j..].copy_from_slice(&weights[j..]);
            mean += share * (up + down);
            spread += share * (up * up + down * down);
            self.slopes[j] = (up - down) / (2.0 * eta);
            gained += self.slopes[j] * self.slopes[j];
        }
        // sum W (y - mean)^2, both about the centre's output; the weights of all but the centre sum to 1 / alpha^2.
        let about_mean = spread - 2.0 * mean * mean + mean * mean / square + centre_square * mean * mean;
        let s = (about_mean + r).max(gained + r);
        let innovation = target - (centre + mean);
        let scale = innovation / s;
        // P B' = S c.
        let gain = &mut self.shifted;
        gain.fill(0.0);
        for (j, (column, c)) in self.columns.iter().zip(&self.slopes).enumerate() {
            for (g, x) in gain[j..].iter_mut().zip(column) {
                *g += x * c;
            }
        }
        if !(s > 0.0 && s < f64::INFINITY && weights.iter().zip(&*gain).all(|(w, g)| (w + g * scale).is_finite())) {
            return Learnt::No;
        }
        for (w, g) in weights.iter_mut().zip(&mut *gain) {
            *w += *g * scale;
            *g /= s.sqrt();
        }
        if self.downdate() { Learnt::Yes } else { Learnt::Rebuilt }
    }

    /// S S' -= x x' with x in `shifted`; where rounding forbids it, S becomes diagonal.
    fn downdate(&mut self) -> bool {
        let variances = self.variances();
        for k in 0..self.columns.len() {
            let column = &mut self.columns[k];
            let (l, x) = (column[0], self.shifted[k]);
            let rest = (l - x) * (l + x);
            if rest.is_nan() || rest <= 0.0 {
                for (column, variance) in self.columns.iter_mut().zip(variances) {
                    column.fill(0.0);
                    column[0] = variance.max(1e-12 * self.p0).sqrt();
                }
                return false;
            }
            let root = rest.sqrt();
            let (cos, sin) = (root / l, x / l);
            column[0] = root;
            for (s, x) in column[1..].iter_mut().zip(&mut self.shifted[k + 1..]) {
                *s = (*s - sin * *x) / cos;
                *x = cos * *x - sin * *s;
            }
        }
        true
    }

    /// The diagonal of P.
    fn variances(&self) -> Vec<f64> {
        let mut variances = vec![0.0; self.columns.len()];
        for (j, column) in self.columns.iter().enumerate() {
            for (v, s) in variances[j..].iter_mut().zip(column) {
                *v += s * s;
            }
        }
        variances
    }
}

impl Ukf {
    pub(super) fn new(params: &UkfParams, size: usize, clip: f64) -> Ukf {
        let noise = Noise::of(&params.noise);
        Ukf {
            root: SquareRoot::new(size, noise.p0, params.alpha, params.beta),
            noise,
            clip,
            counters: Counters::default(),
            tape: Activations::default(),
        }
    }
}

impl Filter for Ukf {
    fn learn(&mut self, network: &mut Network, inputs: &[f64], targets: &[f64], noise: &[f64]) {
        let mut model = network.clone();
        for ((row, &target), &noise) in inputs.chunks_exact(network.layout.inputs).zip(targets).zip(noise) {
            let sound = row.iter().all(|x| x.is_finite()) && target.is_finite() && noise > 0.0 && noise < f64::INFINITY;
            if !sound {
                self.counters.rejected += 1;
                continue;
            }
            let (r, q) = self.noise.at(self.counters.updates);
            let learnt = self.root.update(&mut network.weights, target, noise * r, q, |weights| {
                model.weights.copy_from_slice(weights);
                model.output(row, &mut self.tape)
            });
            match learnt {
                Learnt::No => {
                    self.counters.rejected += 1;
                    continue;
                }
                Learnt::Rebuilt => drop(self.counters.take_rebuilt(1)),
                Learnt::Yes => {}
            }
            self.counters.updates += 1;
            self.counters.take_inputs(row, self.clip);
            self.counters.take_weights(&mut network.weights);
        }
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn state(&self) -> FilterState {
        let mut writer = Writer::new(KIND);
        self.counters.save("", &mut writer);
        writer.reals("root", self.root.columns.iter().flatten().copied());
        writer.finish()
    }

    fn restore(&mut self, state: &FilterState) -> Result<(), FilterError> {
        let reader = Reader::new(state, KIND)?;
        let counters = Counters::load("", &reader)?;
        let root = reader.reals::<f64>("root", self.root.columns.iter().map(Vec::len).sum())?;
        let mut values = root.into_iter();
        for column in &mut self.root.columns {
            column.iter_mut().zip(&mut values).for_each(|(s, value)| *s = value);
        }
        self.counters = counters;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_the_mean_that_is_predicted_of_a_sum_of_squares() {
        // E |w|^2 = |mean|^2 + the trace of P: a target of that much teaches nothing.
        let (start, p0) = ([0.5, -1.0, 2.0], 0.3);
        let mut weights = start;
        let target = start.iter().map(|w| w * w).sum::<f64>() + 3.0 * p0;
        let mut filter = SquareRoot::new(3, p0, 0.5, 2.0);
        assert_eq!(filter.update(&mut weights, target, 0.1, 0.0, |w| w.iter().map(|w| w * w).sum()), Learnt::Yes);
        assert!(weights.iter().zip(start).all(|(w, start)| (w - start).abs() < 1e-12), "{weights:?}");
    }

    #[test]
    fn exact_variances_after_a_linear_row_are_kalmans() {
        let (slopes, p0, r) = ([1.0, -2.0, 0.5], 0.7, 0.2);
        let mut filter = SquareRoot::new(3, p0, 0.5, 2.0);
        assert_eq!(filter.variances(), [p0; 3].map(|p| p.sqrt() * p.sqrt()));
        filter.update(&mut [0.0; 3], 1.0, r, 0.0, |w| w.iter().zip(slopes).map(|(w, b)| w * b).sum());
        let s = r + p0 * slopes.iter().map(|b| b * b).sum::<f64>();
        for (variance, b) in filter.variances().into_iter().zip(slopes) {
            let expected = p0 - p0 * b * p0 * b / s;
            assert!((variance - expected).abs() < 1e-12, "{variance} {expected}");
        }
    }
}
