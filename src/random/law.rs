//! A law that a value of a config is drawn from: its draws, its bounds, what is wrong with it.
//!
//! In: parameters, a stream and an index. Out: the draw at that address. Laws with a closed inverse take the uniform draw at the index;
//! gamma, beta, PERT, triangular and Poisson draws come from rand_distr and a generator that belongs to the index alone. Laws with an
//! unbounded tail (normal, gamma, Weibull, Poisson) are cut to a window that the config names, so that every law has bounds and a key can
//! hold its range against them. Cut means drawn given that the value lies in the window: no share of the draws heaps up at its ends.
//! Not modelled: laws of several values together, and laws whose parameters are drawn.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::normal::normal_from_open_unit;
use super::{Stream, sampler, share};
use crate::math;

/// Shapes of gamma, beta, Weibull and PERT laws.
const LEAST_SHAPE: f64 = 1e-3;
const GREATEST_SHAPE: f64 = 1e6;
/// Scales of gamma and Weibull laws.
const LEAST_SCALE: f64 = 1e-12;
const GREATEST_SCALE: f64 = 1e12;
/// Means of Poisson laws.
const GREATEST_MEAN: f64 = 1e6;
/// What a window must hold of a law that is cut to it.
const LEAST_SHARE: f64 = 1e-3;

/// A law that a value is drawn from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Law {
    /// Uniform between two bounds.
    Uniform([f64; 2]),
    /// Uniform in the logarithm between two positive bounds.
    LogUniform([f64; 2]),
    /// Normal, cut to [min, max] (by its inverse law, so that no draw is rejected).
    Normal { mean: f64, sd: f64, min: f64, max: f64 },
    /// Gamma of mean shape x scale, cut to [min, max], which must hold a thousandth of it.
    Gamma {
        #[schemars(range(min = LEAST_SHAPE, max = GREATEST_SHAPE))]
        shape: f64,
        /// In the unit of the value.
        #[schemars(range(min = LEAST_SCALE, max = GREATEST_SCALE))]
        scale: f64,
        /// The least value that is drawn.
        min: f64,
        /// The greatest value that is drawn.
        max: f64,
    },
    /// Beta of mean alpha / (alpha + beta), stretched over [low, high].
    Beta {
        #[schemars(range(min = LEAST_SHAPE, max = GREATEST_SHAPE))]
        alpha: f64,
        #[schemars(range(min = LEAST_SHAPE, max = GREATEST_SHAPE))]
        beta: f64,
        low: f64,
        high: f64,
    },
    /// Weibull: a share exp(-(x / scale)^shape) lies above x; cut to [min, max], which must hold a thousandth of it.
    Weibull {
        /// Below it lie 63 % of the uncut law; in the unit of the value.
        #[schemars(range(min = LEAST_SCALE, max = GREATEST_SCALE))]
        scale: f64,
        #[schemars(range(min = LEAST_SHAPE, max = GREATEST_SHAPE))]
        shape: f64,
        /// The least value that is drawn.
        min: f64,
        /// The greatest value that is drawn.
        max: f64,
    },
    /// Triangular: likeliest at the mode, falling in straight lines to nothing at low and high.
    Triangular { low: f64, mode: f64, high: f64 },
    /// PERT: likeliest at the mode, falling smoothly to nothing at low and high, of mean (low + shape mode + high) / (shape + 2).
    Pert {
        low: f64,
        mode: f64,
        high: f64,
        /// How much the mode counts for the mean: 0 makes the law uniform.
        #[serde(default = "default_pert_shape")]
        #[schemars(range(min = 0.0, max = GREATEST_SHAPE))]
        shape: f64,
    },
    /// Poisson: a whole number with this mean, cut to [min, max], which must hold a thousandth of it.
    Poisson {
        #[schemars(range(min = 0.0, max = GREATEST_MEAN))]
        mean: f64,
        /// The least number that is drawn.
        #[serde(default)]
        min: f64,
        /// The greatest number that is drawn. Absent: 20 and eight standard deviations above the mean, beyond which less than one draw in 10^15 lies.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        max: Option<f64>,
    },
    /// One of the values, all equally likely.
    Choice(Vec<f64>),
    /// One of the values, by weight: [[weight, value], ...].
    Weighted(Vec<[f64; 2]>),
}

fn default_pert_shape() -> f64 {
    4.0
}

impl Law {
    /// The draw at one index of a stream.
    pub(super) fn draw(&self, stream: &Stream, index: u64) -> f64 {
        match *self {
            Law::Gamma { shape, scale, min, max } => {
                let rng = &mut stream.generator_at(index);
                sampler::cut(min, max, || sampler::gamma(shape, scale, rng))
            }
            Law::Beta { alpha, beta, low, high } => {
                let share = sampler::beta(alpha, beta, &mut stream.generator_at(index));
                (low + (high - low) * share).clamp(low, high)
            }
            Law::Triangular { low, mode, high } => {
                sampler::triangular(low, mode, high, &mut stream.generator_at(index)).clamp(low, high)
            }
            Law::Pert { low, mode, high, shape } => {
                sampler::pert(low, mode, high, shape, &mut stream.generator_at(index)).clamp(low, high)
            }
            Law::Poisson { mean, .. } => {
                let (min, max) = self.bounds();
                let rng = &mut stream.generator_at(index);
                sampler::cut(min, max, || sampler::poisson(mean, rng))
            }
            _ => self.quantile(stream.uniform(index)),
        }
    }

    /// The value below which a share `u` in (0, 1) of the draws falls, for the laws with a closed inverse.
    fn quantile(&self, u: f64) -> f64 {
        match self {
            Law::Uniform([a, b]) => (a + u * (b - a)).clamp(*a, *b),
            Law::LogUniform([a, b]) => (a * math::exp(u * math::ln(b / a))).clamp(*a, *b),
            Law::Normal { mean, sd, min, max } => {
                let below = |x: f64| 0.5 * libm::erfc(-(x - mean) / (sd * std::f64::consts::SQRT_2));
                let (low, high) = (below(*min), below(*max));
                let p = (low + u * (high - low)).clamp(1e-300, 1.0 - f64::EPSILON / 2.0);
                (mean + sd * normal_from_open_unit(p)).clamp(*min, *max)
            }
            Law::Weibull { min, max, .. } if min == max => *min,
            Law::Weibull { scale, shape, min, max } => {
                // (x / scale)^shape is exponential, and what an exponential draw has beyond a threshold is exponential again.
                let [near, far] = [min, max].map(|x| math::pow(x / scale, *shape));
                let exponential = near - math::ln_1p(u * math::exp_m1(near - far));
                (scale * math::pow(exponential, 1.0 / shape)).clamp(*min, *max)
            }
            Law::Choice(values) => values[((u * values.len() as f64) as usize).min(values.len() - 1)],
            Law::Weighted(pairs) => {
                let total: f64 = pairs.iter().map(|p| p[0]).sum();
                let mut left = u * total;
                for [weight, value] in pairs {
                    left -= weight;
                    if left < 0.0 {
                        return *value;
                    }
                }
                pairs.iter().rev().find(|p| p[0] > 0.0).expect("checked: a positive weight").to_owned()[1]
            }
            _ => unreachable!("{self:?} is drawn by rand_distr"),
        }
    }

    /// The smallest and largest value that can be drawn.
    pub fn bounds(&self) -> (f64, f64) {
        let of = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
        };
        match self {
            Law::Uniform([low, high])
            | Law::LogUniform([low, high])
            | Law::Normal { min: low, max: high, .. }
            | Law::Gamma { min: low, max: high, .. }
            | Law::Beta { low, high, .. }
            | Law::Weibull { min: low, max: high, .. }
            | Law::Triangular { low, high, .. }
            | Law::Pert { low, high, .. } => (*low, *high),
            Law::Poisson { mean, min, max } => {
                let max = max.unwrap_or(mean + 8.0 * mean.sqrt() + 20.0);
                (min.ceil(), max.floor())
            }
            Law::Choice(values) => of(&mut values.iter().copied()),
            Law::Weighted(pairs) => of(&mut pairs.iter().map(|p| p[1])),
        }
    }

    /// The law in a few words, without its parameters.
    pub fn name(&self) -> &'static str {
        match self {
            Law::Uniform(_) => "uniform",
            Law::LogUniform(_) => "log_uniform",
            Law::Normal { .. } => "normal",
            Law::Gamma { .. } => "gamma",
            Law::Beta { .. } => "beta",
            Law::Weibull { .. } => "weibull",
            Law::Triangular { .. } => "triangular",
            Law::Pert { .. } => "pert",
            Law::Poisson { .. } => "poisson",
            Law::Choice(_) => "choice",
            Law::Weighted(_) => "weighted",
        }
    }

    /// What is wrong with the law itself, if anything.
    pub fn fault(&self) -> Option<String> {
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        let shape = |what, value| self.outside(what, value, LEAST_SHAPE, GREATEST_SHAPE);
        let scale = |value| self.outside("scale", value, LEAST_SCALE, GREATEST_SCALE);
        match *self {
            Law::Uniform([a, b]) => {
                (!finite(&[a, b]) || a > b).then(|| format!("uniform needs [low, high] with low <= high, got [{a}, {b}]"))
            }
            Law::LogUniform([a, b]) => (!finite(&[a, b]) || a > b || a <= 0.0)
                .then(|| format!("log_uniform needs [low, high] with 0 < low <= high, got [{a}, {b}]")),
            Law::Normal { mean, sd, min, max } => {
                (!finite(&[mean, sd, min, max]) || sd <= 0.0 || min > max || (mean - min) / sd < -8.0 || (max - mean) / sd < -8.0)
                    .then(|| format!("normal needs sd > 0 and min <= max within 8 sd of the mean, got mean {mean}, sd {sd}, min {min}, max {max}"))
            }
            Law::Gamma { shape: k, scale: theta, min, max } => shape("shape", k).or_else(|| scale(theta)).or_else(|| {
                self.window_fault(min, max, || share::of_gamma(k, theta, min, max))
            }),
            Law::Weibull { scale: lambda, shape: k, min, max } => shape("shape", k).or_else(|| scale(lambda)).or_else(|| {
                self.window_fault(min, max, || share::of_weibull(lambda, k, min, max))
            }),
            Law::Poisson { mean, min, .. } => self.outside("mean", mean, 0.0, GREATEST_MEAN).or_else(|| {
                let (least, most) = self.bounds();
                self.window_fault(min.min(least), most, || share::of_poisson(mean, least, most))
            }),
            Law::Beta { alpha, beta, low, high } => {
                shape("alpha", alpha).or_else(|| shape("beta", beta)).or_else(|| self.disorder("low <= high", &[low, high]))
            }
            Law::Triangular { low, mode, high } => self.disorder("low <= mode <= high", &[low, mode, high]),
            Law::Pert { low, mode, high, shape } => self
                .outside("shape", shape, 0.0, GREATEST_SHAPE)
                .or_else(|| self.disorder("low <= mode <= high", &[low, mode, high])),
            Law::Choice(ref values) => {
                (values.is_empty() || !finite(values)).then(|| "choice needs at least one finite value".to_string())
            }
            Law::Weighted(ref pairs) => {
                let total: f64 = pairs.iter().map(|p| p[0]).sum();
                (pairs.is_empty() || pairs.iter().any(|p| !finite(p) || p[0] < 0.0) || !total.is_finite() || total <= 0.0)
                    .then(|| "weighted needs [[weight, value], ...] with finite weights >= 0, not all 0".to_string())
            }
        }
    }

    /// A parameter outside its range.
    fn outside(&self, parameter: &str, value: f64, low: f64, high: f64) -> Option<String> {
        let range = format!("[{low}, {high}]");
        (!(low..=high).contains(&value)).then(|| format!("{} needs {parameter} in {range}, got {value}", self.name()))
    }

    /// Values that should rise and do not.
    fn disorder(&self, rule: &str, values: &[f64]) -> Option<String> {
        let rise = values.iter().all(|v| v.is_finite()) && values.is_sorted();
        let got: Vec<String> = values.iter().map(f64::to_string).collect();
        (!rise).then(|| format!("{} needs {rule}, got {}", self.name(), got.join(", ")))
    }

    /// A window that is none, or holds too little of the law to be drawn from.
    fn window_fault(&self, min: f64, max: f64, share: impl FnOnce() -> f64) -> Option<String> {
        if !(0.0 <= min && min <= max && max.is_finite()) {
            return Some(format!("{} needs 0 <= min <= max, got min {min}, max {max}", self.name()));
        }
        let share = if min == max { 1.0 } else { share() };
        let rule = "needs at least a thousandth of its draws between min and max";
        (share < LEAST_SHARE).then(|| format!("{} {rule}, got a share of {share:.0e}", self.name()))
    }
}

#[cfg(test)]
mod tests;
