//! The decoupled filter with each weight a group of its own: P is diagonal. O(s) an update.
//!
//! Source: Hewitt et al. 2017, "s groups"; Puskorius & Feldkamp 1991. Not back-propagation yet: each weight keeps its variance,
//! and S is shared. All f64. Rows of a batch are learnt one by one against weights that stand still.

use super::FilterError;
use super::linearised::{Learner, Outcome, Rows};
use super::state::{Reader, Writer};

/// One variance a weight.
pub(crate) struct Diagonal {
    batch: usize,
    variances: Vec<f64>,
    step: Vec<f64>,
}

impl Diagonal {
    pub(super) fn new(size: usize, p0: f64, batch: usize) -> Diagonal {
        Diagonal { batch, variances: vec![p0; size], step: vec![0.0; size] }
    }
}

impl Learner for Diagonal {
    fn kind(&self) -> &str {
        "decoupled-weight-f64"
    }

    fn batch(&self) -> usize {
        self.batch
    }

    fn update(&mut self, weights: &mut [f64], rows: &Rows) -> Outcome {
        let rejected = Outcome { rejected: true, ..Outcome::default() };
        self.variances.iter_mut().for_each(|p| *p += rows.q); // Eq. (11)
        self.step.fill(0.0);
        for ((slopes, innovation), noise) in
            rows.jacobian.chunks_exact(weights.len()).zip(rows.innovations).zip(rows.noise)
        {
            let (mut s, mut left) = (*noise, *innovation);
            for ((b, p), step) in slopes.iter().zip(&self.variances).zip(&self.step) {
                s += b * b * p;
                left -= b * step;
            }
            if !(s < f64::INFINITY && (left / s).is_finite()) {
                return rejected;
            }
            for ((b, p), step) in slopes.iter().zip(&mut self.variances).zip(&mut self.step) {
                let gain = *p * b / s; // Eq. (13)
                *step += gain * left; // Eq. (15)
                *p = (*p - gain * (b * *p)).max(0.0); // Eq. (14)
            }
        }
        if !weights.iter().zip(&self.step).all(|(w, step)| (w + step).is_finite()) {
            return rejected;
        }
        weights.iter_mut().zip(&self.step).for_each(|(w, step)| *w += step);
        Outcome::default()
    }

    fn save(&self, to: &mut Writer) {
        to.reals("variances", self.variances.iter().copied());
    }

    fn load(&mut self, from: &Reader) -> Result<(), FilterError> {
        self.variances = from.reals("variances", self.variances.len())?;
        Ok(())
    }
}
