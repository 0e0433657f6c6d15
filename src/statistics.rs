//! Numbers -> their middle and spread, how sure a mean is, and how well two rankings agree.
//!
//! Quantiles interpolate linearly between order statistics (Hyndman & Fan's type 7, NumPy's default). Student's
//! distribution for whole degrees of freedom is the finite sum of Abramowitz & Stegun 26.7.3 and 26.7.4. Rank correlation
//! is Spearman's (1904), ties at their mean rank (Kendall 1948). Values are taken to be independent: what drifts in time is not modelled.

pub(crate) mod scores;

use serde::{Deserialize, Serialize};

use crate::math;

/// A quantile; `None` of nothing. `share` in [0, 1].
pub(crate) fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let place = share * last as f64;
    let below = (place.floor() as usize).min(last);
    let above = (below + 1).min(last);
    Some(sorted[below] + (place - below as f64) * (sorted[above] - sorted[below]))
}

/// `None` of nothing.
pub(crate) fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// Mean and sample variance (over n - 1) of independent values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Moments {
    pub count: usize,
    pub mean: f64,
    /// `None` of a single value, which says nothing of its spread.
    pub variance: Option<f64>,
}

impl Moments {
    /// `None` of nothing.
    pub(crate) fn of(values: impl Iterator<Item = f64> + Clone) -> Option<Moments> {
        let count = values.clone().count();
        if count == 0 {
            return None;
        }
        let mean = values.clone().sum::<f64>() / count as f64;
        let squares: f64 = values.map(|value| (value - mean) * (value - mean)).sum();
        Some(Moments { count, mean, variance: (count > 1).then(|| squares / (count - 1) as f64) })
    }

    /// Of the mean; infinite for a single value.
    pub(crate) fn standard_error(&self) -> f64 {
        self.variance.map_or(f64::INFINITY, |variance| (variance / self.count as f64).sqrt())
    }
}

/// Median and quartiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    pub median: f64,
    pub lower_quartile: f64,
    pub upper_quartile: f64,
}

impl Spread {
    /// `None` of nothing.
    pub(crate) fn of(values: &[f64]) -> Option<Spread> {
        Some(Spread {
            median: median(values)?,
            lower_quartile: quantile(values, 0.25)?,
            upper_quartile: quantile(values, 0.75)?,
        })
    }
}

/// A mean and the half width of its interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Interval {
    pub mean: f64,
    /// Infinite (null in JSON) where nothing is known of it.
    #[serde(with = "finite_or_null")]
    pub half_width: f64,
}

mod finite_or_null {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::INFINITY))
    }
}

impl Interval {
    pub(crate) fn lower(&self) -> f64 {
        self.mean - self.half_width
    }

    pub(crate) fn upper(&self) -> f64 {
        self.mean + self.half_width
    }
}

/// The t that a Student variable stays within, both sides taken together, with this probability.
pub(crate) fn student(freedom: usize, probability: f64) -> f64 {
    assert!(
        freedom > 0 && probability < 1.0,
        "no bound holds a Student variable of {freedom} degrees at {probability}"
    );
    let (mut low, mut high) = (0.0, 1.0);
    while within(high, freedom) < probability {
        high *= 2.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if within(middle, freedom) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Probability of |T| <= t.
fn within(t: f64, freedom: usize) -> f64 {
    let angle = math::atan(t / (freedom as f64).sqrt());
    let (sin, cos) = math::sin_cos(angle);
    let odd = freedom % 2 == 1;
    // Terms cos^k with k of the parity's own, each a ratio of whole numbers times the one before.
    let (mut term, mut sum) = (if odd { cos } else { 1.0 }, 0.0);
    let first = if odd { 1 } else { 0 };
    for k in (first..freedom.saturating_sub(1)).step_by(2) {
        sum += term;
        term *= cos * cos * (k + 1) as f64 / (k + 2) as f64;
    }
    if odd { std::f64::consts::FRAC_2_PI * (angle + sin * sum) } else { sin * sum }
}

/// Spearman's rho of paired numbers; `None` for fewer than two pairs, or where one side is all ties.
pub(crate) fn spearman(pairs: &[(f64, f64)]) -> Option<f64> {
    let ranks = |of: fn(&(f64, f64)) -> f64| mean_ranks(&pairs.iter().map(of).collect::<Vec<_>>());
    let (a, b) = (ranks(|pair| pair.0), ranks(|pair| pair.1));
    let middle = 0.5 * (pairs.len() as f64 + 1.0);
    let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| (x - middle) * (y - middle)).sum::<f64>();
    let scale = (sum(&a, &a) * sum(&b, &b)).sqrt();
    (scale > 0.0).then(|| (sum(&a, &b) / scale).clamp(-1.0, 1.0))
}

/// The rank of each number from 1 on; equal ones share the mean of theirs.
fn mean_ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    for ties in order.chunk_by(|&i, &j| values[i] == values[j]) {
        let mean = from as f64 + 0.5 * (ties.len() as f64 + 1.0);
        ties.iter().for_each(|&i| ranks[i] = mean);
        from += ties.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_quantiles_interpolate_between_order_statistics() {
        // numpy.quantile([7, 1, 3, 10], [0, 0.25, 0.5, 0.9, 1])
        let values = [7.0, 1.0, 3.0, 10.0];
        for (share, expected) in [(0.0, 1.0), (0.25, 2.5), (0.5, 5.0), (0.9, 9.1), (1.0, 10.0)] {
            assert!((quantile(&values, share).unwrap() - expected).abs() < 1e-14, "{share}");
        }
        assert_eq!(Spread::of(&values), Some(Spread { median: 5.0, lower_quartile: 2.5, upper_quartile: 7.75 }));
        assert_eq!((quantile(&[], 0.5), quantile(&[f64::NAN, 4.0], 0.3)), (None, Some(4.0)));
    }

    #[test]
    fn exact_student_quantiles_are_those_of_the_tables() {
        // scipy.stats.t.ppf(0.975, df)
        for (freedom, expected) in [
            (1, 12.706_204_736_174_694),
            (2, 4.302_652_729_749_462),
            (3, 3.182_446_305_283_708),
            (4, 2.776_445_105_197_793),
            (5, 2.570_581_835_636_315),
            (9, 2.262_157_162_798_205),
            (30, 2.042_272_456_301_238),
            (101, 1.983_731_002_955_606),
        ] {
            assert!(
                (student(freedom, 0.95) - expected).abs() < 1e-12 * expected,
                "{freedom}: {}",
                student(freedom, 0.95)
            );
        }
    }

    #[test]
    fn extreme_an_unknown_half_width_is_null() {
        let one = Interval { mean: 0.2, half_width: f64::INFINITY };
        assert_eq!(one.upper(), f64::INFINITY);
        let json = serde_json::to_string(&one).unwrap();
        assert_eq!(json, r#"{"mean":0.2,"half_width":null}"#);
        assert_eq!(serde_json::from_str::<Interval>(&json).unwrap(), one);
    }

    #[test]
    fn exact_moments_of_known_values() {
        let moments = Moments::of([1.0, 2.0, 6.0].into_iter()).unwrap();
        assert_eq!((moments.count, moments.mean, moments.variance), (3, 3.0, Some(7.0)));
        assert!((moments.standard_error() - (7.0f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(Moments::of([].into_iter()), None);
        assert_eq!(Moments::of([4.0].into_iter()).unwrap().standard_error(), f64::INFINITY);
    }

    #[test]
    fn exact_rho_of_known_pairs() {
        let pairs = |b: [f64; 5]| (0..5).map(|k| (f64::from(k), b[k as usize])).collect::<Vec<_>>();
        assert_eq!(spearman(&pairs([1.0, 10.0, 100.0, 1e3, 1e4])), Some(1.0));
        assert_eq!(spearman(&pairs([5.0, 4.0, 3.0, 2.0, 1.0])), Some(-1.0));
        // 1 - 6 sum d^2 / (n (n^2 - 1)) with d^2 = 1, 1, 0, 1, 1.
        assert!((spearman(&pairs([2.0, 1.0, 3.0, 5.0, 4.0])).unwrap() - 0.8).abs() < 1e-15);
        assert_eq!(mean_ranks(&[3.0, 1.0, 3.0, 0.0]), [3.5, 2.0, 3.5, 1.0]);
        assert_eq!(spearman(&pairs([1.0; 5])), None);
        assert_eq!(spearman(&[(1.0, 2.0)]), None);
    }
}
