//! A learning curve at a few sizes -> what to expect at any other size, and how far that can be told.
//!
//! The balanced error falls to a floor by a power of the scenes: error(n) = floor + b (n / n_largest)^-c, with floor, b >= 0 (a power law with
//! offset; Viering & Loog 2023, "The shape of learning curves", find it among the best). Every floor and power of a grid that fits
//! as well as the best one by chance (profile likelihood: chi^2 within 3.84) is believed; what is expected is their mean, weighed by likelihood, so
//! that a few noisy sizes promise no wonder, and their spread is what the shape leaves open. To it comes, in quadrature, the interval of the largest measured size, for the draw of test scenes moves all sizes together. No prediction
//! is better than the believed floors: beyond what was measured, promises end there.

use crate::math;
use crate::statistics::Interval;

/// Powers that curves were found to have, and then some.
const POWERS: [f64; 10] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0, 1.25, 1.5, 2.0];
/// Steps of the floor, from 0 to the least error.
const FLOORS: usize = 50;
/// The 95 % quantile of chi^2 with one degree of freedom.
const BELIEVED: f64 = 3.841;

/// A measured size: scenes, balanced error, and the standard error of its trainings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub scenes: f64,
    pub error: f64,
    pub standard_error: f64,
}

/// error = floor + scale * (scenes / largest)^-power.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Law {
    floor: f64,
    scale: f64,
    power: f64,
}

/// The believed laws of a curve.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// With their likelihoods.
    believed: Vec<(Law, f64)>,
    largest_scenes: f64,
    /// Of the largest size, over test scenes and trainings.
    half_width: f64,
}

/// A balanced accuracy to be expected, and the interval of 95 % about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Expected {
    pub mean: f64,
    pub low: f64,
    pub high: f64,
}

impl Fit {
    /// Of at least two sizes, ascending.
    pub(super) fn of(sizes: &[Measured], largest: &Interval) -> Fit {
        let last = sizes[sizes.len() - 1];
        let least = sizes.iter().map(|size| size.error).fold(f64::INFINITY, f64::min);
        let mut laws = Vec::new();
        for power in POWERS {
            for step in 0..=FLOORS {
                let floor = least * step as f64 / FLOORS as f64;
                laws.push(law(sizes, last.scenes, floor, power));
            }
        }
        let best = laws.iter().map(|(_, misfit)| *misfit).fold(f64::INFINITY, f64::min);
        let believed = laws.into_iter().filter(|(_, misfit)| *misfit <= best + BELIEVED);
        let believed = believed.map(|(law, misfit)| (law, math::exp(-0.5 * (misfit - best)))).collect();
        Fit { believed, largest_scenes: last.scenes, half_width: largest.half_width }
    }

    /// Of the largest measured size.
    pub(super) fn largest_scenes(&self) -> f64 {
        self.largest_scenes
    }

    /// Balanced accuracy at a number of scenes.
    pub(super) fn expected(&self, scenes: f64) -> Expected {
        let error = |law: &Law| law.error(scenes / self.largest_scenes);
        let mean = self.mean(error);
        let (low, high) = self.range(error);
        let beside = |shape: f64| math::hypot(shape, self.half_width);
        Expected {
            mean: 1.0 - mean,
            low: (1.0 - mean - beside(high - mean)).max(0.0),
            high: (1.0 - mean + beside(mean - low)).min(1.0),
        }
    }

    /// What more scenes would bring: by the mean of the believed laws, and at most by any.
    pub(super) fn gain(&self, from: f64, to: f64) -> (f64, f64) {
        let gain = |law: &Law| law.error(from / self.largest_scenes) - law.error(to / self.largest_scenes);
        (self.mean(gain), self.range(gain).1)
    }

    fn mean(&self, of: impl Fn(&Law) -> f64) -> f64 {
        let weights: f64 = self.believed.iter().map(|(_, weight)| weight).sum();
        self.believed.iter().map(|(law, weight)| weight * of(law)).sum::<f64>() / weights
    }

    /// Least and most of a figure over the believed laws.
    fn range(&self, of: impl Fn(&Law) -> f64) -> (f64, f64) {
        let all = self.believed.iter().map(|(law, _)| of(law));
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    }
}

impl Law {
    fn error(&self, share: f64) -> f64 {
        (self.floor + self.scale * math::pow(share, -self.power)).min(1.0)
    }
}

/// The scale that fits best at a floor and a power, and what it misses by: chi^2.
fn law(sizes: &[Measured], largest: f64, floor: f64, power: f64) -> (Law, f64) {
    let (mut products, mut squares) = (0.0, 0.0);
    let shape = |size: &Measured| math::pow(size.scenes / largest, -power);
    let weight = |size: &Measured| 1.0 / (size.standard_error * size.standard_error);
    for size in sizes {
        products += weight(size) * shape(size) * (size.error - floor);
        squares += weight(size) * shape(size) * shape(size);
    }
    let scale = (products / squares).max(0.0);
    let misfit = sizes.iter().map(|size| {
        let off = size.error - floor - scale * shape(size);
        weight(size) * off * off
    });
    (Law { floor, scale, power }, misfit.sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sizes(error: impl Fn(f64) -> f64, standard_error: f64) -> Vec<Measured> {
        [16.0, 32.0, 64.0, 128.0].map(|scenes| Measured { scenes, error: error(scenes), standard_error }).into()
    }

    #[test]
    fn exact_a_power_law_with_a_floor_is_found_again() {
        let of = |scenes: f64| 0.03 + 0.6 / scenes;
        let fit = Fit::of(&sizes(of, 1e-5), &Interval { mean: 1.0 - of(128.0), half_width: 0.0 });
        for scenes in [16.0, 100.0, 1000.0, 1e6] {
            let expected = fit.expected(scenes);
            assert!((expected.mean - (1.0 - of(scenes))).abs() < 6e-4, "{scenes}: {expected:?}");
            assert!(expected.low <= expected.mean && expected.mean <= expected.high);
        }
        let (gain, most) = fit.gain(1000.0, 1e6);
        assert!((gain - 0.0006).abs() < 4e-4 && most < 0.002, "{gain} {most}");
    }

    #[test]
    fn law_what_trainings_leave_open_widens_what_is_beyond_the_largest_size() {
        let of = |scenes: f64| 0.03 + 0.6 / scenes;
        let interval = Interval { mean: 1.0 - of(128.0), half_width: 0.004 };
        let width = |standard_error: f64, scenes: f64| {
            let expected = Fit::of(&sizes(of, standard_error), &interval).expected(scenes);
            expected.high - expected.low
        };
        assert!(width(0.003, 1e6) > width(0.0005, 1e6) && width(0.003, 1e6) > width(0.003, 128.0));
        // Where it was measured the interval is hardly wider than that of the measurement.
        assert!((0.008..0.010).contains(&width(0.001, 128.0)), "{}", width(0.001, 128.0));
    }

    #[test]
    fn extreme_a_flat_curve_and_a_rising_error_promise_nothing_more() {
        for of in [(|_| 0.05) as fn(f64) -> f64, |scenes| 0.05 + 1e-5 * scenes] {
            let fit = Fit::of(&sizes(of, 1e-4), &Interval { mean: 0.95, half_width: 0.002 });
            let expected = fit.expected(1e9);
            assert!(expected.mean < 0.9515 && expected.high < 0.955, "{expected:?}");
        }
        // Nothing is better than no error.
        let fit = Fit::of(&sizes(|scenes| 0.1 / scenes, 0.01), &Interval { mean: 0.999, half_width: 0.05 });
        assert_eq!(fit.expected(1e9).high, 1.0);
    }
}
