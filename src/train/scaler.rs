//! Rows of features -> what a network takes of them: standardised and clipped, and behind them their normal scores where it takes those.
//!
//! Compiled for each instruction set ([`lanes`](super::filter::lanes)); bits are the same on all.

use serde::{Deserialize, Serialize};

use super::NormalScores;
use super::filter::lanes::{Isa, Kernel, Simd};
use super::normal_scores::{Knots, limited};

/// How features are scaled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scaler {
    /// Per input the number of another that is subtracted from it first: a neighbour's height above the cell's own.
    pub minus: Vec<Option<usize>>,
    /// Subtracted, then divided by; from the train split. A feature that never varied has scale 1.
    pub mean: Vec<f64>,
    pub scale: Vec<f64>,
    /// Scaled inputs are clipped to [-clip, clip].
    pub clip: f64,
    /// Of each feature, where the network takes normal scores too: those come behind all scaled features. None in models of formats up to 4.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scores: Vec<NormalScores>,
}

impl Scaler {
    /// Numbers that the network takes of a row.
    pub(crate) fn inputs(&self) -> usize {
        self.mean.len() + self.scores.len()
    }

    /// Scales rows of features that lie one after another; `out` has room for [`inputs`](Scaler::inputs) numbers a row, and what is behind the last row is left
    /// alone.
    pub(crate) fn scale(&self, rows: &[f32], out: &mut [f64]) {
        Isa::detect().run(Scale { scaler: self, rows, out });
    }
}

/// A feature of a row less the one that is subtracted from it.
#[inline(always)]
pub(super) fn less(feature: f32, minus: Option<usize>, row: &[f32]) -> f64 {
    f64::from(feature) - minus.map_or(0.0, |other| f64::from(row[other]))
}

struct Scale<'a> {
    scaler: &'a Scaler,
    rows: &'a [f32],
    out: &'a mut [f64],
}

impl Kernel<f64> for Scale<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Simd<f64>>(self) {
        let Scaler { minus, mean, scale, clip, scores } = self.scaler;
        let (features, inputs) = (mean.len(), self.scaler.inputs());
        let knots: Vec<Knots> = scores.iter().map(NormalScores::knots).collect();
        for (row, out) in self.rows.chunks_exact(features).zip(self.out.chunks_exact_mut(inputs)) {
            let (scaled, of_scores) = out.split_at_mut(features);
            for ((x, &feature), minus) in scaled.iter_mut().zip(row).zip(minus) {
                *x = less(feature, *minus, row);
            }
            for ((score, knots), x) in of_scores.iter_mut().zip(&knots).zip(&*scaled) {
                *score = knots.score::<V>(*x);
            }
            // A loop of its own, whose divisions go by lanes.
            for ((x, mean), scale) in scaled.iter_mut().zip(mean).zip(scale) {
                *x = limited((*x - mean) / scale, [-clip, *clip]);
            }
        }
    }
}
