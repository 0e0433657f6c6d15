//! Back-propagation: one gradient step a row.
//!
//! Source: Hewitt et al. 2017, eq. 17: dw = eta (d - y) B. It is the EKF (eq. 18) where P = p I and 1 / S = a, with eta = a p.
//! A row's R, which carries the weight of its class, divides eta as it would divide a.

use super::FilterError;
use super::linearised::{Learner, Outcome, Rows};
use super::state::{Reader, Writer};

/// A learning rate; no memory.
pub(super) struct Backprop {
    pub rate: f64,
}

impl Learner for Backprop {
    fn kind(&self) -> &str {
        "backprop"
    }

    fn batch(&self) -> usize {
        1
    }

    fn update(&mut self, weights: &mut [f64], rows: &Rows) -> Outcome {
        for (slopes, (innovation, noise)) in
            rows.jacobian.chunks_exact(weights.len()).zip(rows.innovations.iter().zip(rows.noise))
        {
            let scale = self.rate / noise * innovation;
            if !weights.iter().zip(slopes).all(|(w, b)| (w + scale * b).is_finite()) {
                return Outcome { rejected: true, ..Outcome::default() };
            }
            weights.iter_mut().zip(slopes).for_each(|(w, b)| *w += scale * b); // Eq. (17)
        }
        Outcome::default()
    }

    fn save(&self, _to: &mut Writer) {}

    fn load(&mut self, _from: &Reader) -> Result<(), FilterError> {
        Ok(())
    }
}
