//! A sample of an input's values -> what turns any value into its normal score.
//!
//! Most cells lie close together in a standardised input, because a few lie far out, and a small network sees little of what tells them apart.
//! The score of a value is the quantile of the standard normal distribution at the share of the train split's cells below it: it spreads the cells
//! evenly, whatever the input's distribution. It goes to the network beside the standardised value, which keeps what is far out apart.
//!
//! In: values of one input. Out: at most [`PARTS`] + 1 knots at the quantiles of equal shares, linear between them and constant beyond them, of
//! mean 0 and variance 1 over the sample, before scores end at the clip. Source: van der Waerden 1952. Deviations: from quantiles, so that a model holds few numbers; equal values share the
//! middle of their shares; the outermost shares are half a part within 0 and 1, so that their scores are finite.
//!
//! A neighbour without points stands at the cell's own height in its column, so its height above the cell is 0: amid the heights of level ground,
//! where a network hardly tells it from them. Its score lies apart, below those of usual heights; a neighbour with points at the very same height,
//! to the last bit, has it too. Quantiles, mean and variance are of the other neighbours.

use serde::{Deserialize, Serialize};

use super::filter::lanes::{Chunk64, Real, Simd};
use crate::corpus::stats::Moments;
use crate::math;

/// Parts of equal shares that the quantiles bound.
const PARTS: usize = 64;
/// Values of an input that are sorted, at most: were cells independent, half as many would tell its median to a quarter of a part.
pub(crate) const MOST_VALUES: usize = 32_768;
/// The score of a neighbour without points; that of the lowest heights is some -2.5 where few of them are equal.
const UNSEEN: f64 = -3.5;
/// More knots than any input has.
const MOST_KNOTS: usize = 1024;

/// Value -> score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormalScores {
    /// Values that rise, one at least.
    pub at: Vec<f64>,
    /// The score of each; values between two have it in proportion, those beyond the outermost have theirs.
    pub score: Vec<f64>,
    /// Of a neighbour's height above the cell: the score of 0, which is that of a neighbour without points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unseen: Option<f64>,
}

/// Knots as scores are found by them: where a value lies between them, and what is worked out of the knots on either side. In chunks all knots but the
/// last, behind them infinity: the last of each chunk tells which chunk, that chunk where in it.
pub(super) struct Knots {
    ends: [f64; 2],
    lasts: Vec<Chunk64>,
    chunks: Vec<Chunk64>,
    segments: Vec<Segment>,
    unseen: Option<f64>,
}

/// From one knot to the next.
struct Segment {
    from: f64,
    width: f64,
    low: f64,
    rise: f64,
    high: f64,
}

impl Knots {
    /// The score of a value; NaN for NaN.
    #[inline(always)]
    pub(super) fn score<V: Simd<f64>>(&self, x: f64) -> f64 {
        if let Some(score) = self.unseen
            && x == 0.0
        {
            return score;
        }
        let x = limited(x, self.ends);
        // A NaN is above none.
        let segment = &self.segments[self.count_up_to::<V>(x).saturating_sub(1)];
        let Segment { from, width, low, rise, high } = *segment;
        // Rounding may go beyond the knots by a digit.
        limited(low + rise * ((x - from) / width), [low, high])
    }

    /// How many knots, the last left out, are at most a value.
    #[inline(always)]
    fn count_up_to<V: Simd<f64>>(&self, x: f64) -> usize {
        let mut whole = 0;
        for lasts in &self.lasts {
            whole += V::load(lasts).count_up_to(x);
        }
        let chunk = whole.min(self.chunks.len() - 1);
        f64::LANES * chunk + V::load(&self.chunks[chunk]).count_up_to(x)
    }
}

/// A number within bounds; NaN stays. Unlike `clamp` it asks nothing of the bounds, for which a loop would not go by lanes.
#[inline(always)]
pub(super) fn limited(x: f64, [least, most]: [f64; 2]) -> f64 {
    let x = if x < least { least } else { x };
    if x > most { most } else { x }
}

/// Numbers in chunks, behind them infinity; one chunk at least.
fn chunks_of(numbers: &[f64]) -> Vec<Chunk64> {
    let mut chunks = vec![Chunk64::splat(f64::INFINITY); numbers.len().div_ceil(f64::LANES).max(1)];
    for (chunk, few) in chunks.iter_mut().zip(numbers.chunks(f64::LANES)) {
        chunk.as_mut()[..few.len()].copy_from_slice(few);
    }
    chunks
}

impl NormalScores {
    /// Of a sample of a neighbour's heights above the cell: of those with points.
    pub(crate) fn of_heights_above(mut values: Vec<f64>, clip: f64) -> NormalScores {
        values.retain(|&x| x != 0.0);
        NormalScores { unseen: Some(UNSEEN.max(-clip)), ..NormalScores::of_sample(values, clip) }
    }

    /// Of a sample, in any order; scores end at `clip`.
    pub(crate) fn of_sample(mut values: Vec<f64>, clip: f64) -> NormalScores {
        values.retain(|x| x.is_finite());
        values.sort_unstable_by(f64::total_cmp);
        let quantiles = quantiles(&values);
        let (mut at, mut score) = (Vec::new(), Vec::new());
        let mut first = 0;
        for equal in quantiles.chunk_by(|a, b| a == b) {
            // The middle of the shares that the value has, in parts.
            let parts = 0.5 * (first + first + equal.len() - 1) as f64;
            at.push(equal[0]);
            score.push(normal_quantile(parts.clamp(0.5, PARTS as f64 - 0.5) / PARTS as f64));
            first += equal.len();
        }
        let mut scores = NormalScores { at, score, unseen: None };
        scores.standardise(&values, clip);
        scores
    }

    /// Shifts and stretches the scores to mean 0 and variance 1 over these values; those that never vary have 0.
    fn standardise(&mut self, values: &[f64], clip: f64) {
        let (knots, mut moments) = (self.knots(), Moments::default());
        values.iter().for_each(|&x| moments.add(knots.score::<Chunk64>(x)));
        let scale = if moments.variance().is_normal() { moments.variance().sqrt() } else { 1.0 };
        for score in &mut self.score {
            *score = ((*score - moments.mean) / scale).clamp(-clip, clip);
        }
    }

    /// The score of a value; NaN for NaN.
    #[cfg(test)]
    pub(crate) fn score(&self, x: f64) -> f64 {
        self.knots().score::<Chunk64>(x)
    }

    /// What scores are found by.
    pub(super) fn knots(&self) -> Knots {
        let NormalScores { at, score, unseen } = self;
        let segment = |k: usize, next: usize| Segment {
            from: at[k],
            width: if next > k { at[next] - at[k] } else { 1.0 },
            low: score[k],
            rise: score[next] - score[k],
            high: score[next],
        };
        let last = at.len() - 1;
        let segments = (0..last.max(1)).map(|k| segment(k, (k + 1).min(last))).collect();
        let chunks = chunks_of(&at[..last]);
        let lasts: Vec<f64> = chunks.iter().map(|chunk| chunk.as_ref()[f64::LANES - 1]).collect();
        Knots { ends: [at[0], at[last]], lasts: chunks_of(&lasts), chunks, segments, unseen: *unseen }
    }

    /// What contradicts itself in a file.
    pub(super) fn fault(&self, clip: f64, sane: f64) -> Option<&'static str> {
        let NormalScores { at, score, unseen } = self;
        if at.len() != score.len() || !(1..=MOST_KNOTS).contains(&at.len()) {
            return Some("normal scores without a score for each value");
        }
        let is_sound =
            at.iter().all(|x| x.abs() <= sane) && score.iter().chain(unseen).all(|score| score.abs() <= clip);
        let rises = at.is_sorted_by(|a, b| a < b) && score.is_sorted();
        // Knots of numbers that columns can hold are never so near one another.
        let slope = |k: usize| (score[k + 1] - score[k]) / (at[k + 1] - at[k]);
        let is_finite = (0..at.len() - 1).all(|k| slope(k).is_finite());
        (!(is_sound && rises && is_finite)).then_some("normal scores that do not rise within the clip")
    }
}

/// The values at the borders of [`PARTS`] parts of a sorted sample.
fn quantiles(sorted: &[f64]) -> Vec<f64> {
    let Some(last) = sorted.len().checked_sub(1) else { return vec![0.0; PARTS + 1] };
    (0..=PARTS).map(|part| sorted[(part * last + PARTS / 2) / PARTS]).collect()
}

/// The quantile of the standard normal distribution at a share within 0 and 1, both left out: Newton's iteration from the median, which comes
/// nearer from one side.
fn normal_quantile(share: f64) -> f64 {
    if share > 0.5 {
        return -normal_quantile(1.0 - share);
    }
    let mut z = 0.0;
    for _ in 0..100 {
        let below = 0.5 * math::erfc(-z / std::f64::consts::SQRT_2);
        let density = math::exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt();
        let next = z - (below - share) / density;
        if next >= z {
            break;
        }
        z = next;
    }
    z
}

#[cfg(test)]
mod tests;
