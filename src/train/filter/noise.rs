//! P0, R and Q, and how they change.
//!
//! Only ratios matter, so R = 1 but for the schedule and the weight of a row's class. Schedule of Puskorius & Feldkamp (Haykin
//! 2001, ch. 2): R falls from 100 to 1 and Q from 1e-2 to 1e-6, both as exp(-n / 4000) until they reach their floor, P0 = 100.

use super::FilterError;
use crate::math;
use crate::train::params::{NoiseParams, Precision, Schedule};

/// Rows in which R and Q of the schedule fall by e.
const TIME_CONSTANT: f64 = 4000.0;

/// Largest P0 / R and Q / R of a plain covariance, by its precision: beyond, rounding outgrows R.
///
/// A row shrinks the variance along its own b from v = b'Pb to v R / (v + R), which is less than R. Eq. (14) forms that as the difference of v
/// and v^2 / (v + R), both of size v and both rounded to a share eps of themselves, and so to some eps v. Where v / R comes near 1 / eps the
/// rounding is as large as all that should be left: the next row like it may find b'Pb < 0, and S below R. No rule that starts from the rounded
/// b'Pb cures that (neither symmetry nor Joseph's form does); U D U' takes no such difference, and needs no limit.
///
/// At the start v = P0 |b|^2, and never less than Q |b|^2 afterwards. |b|^2 is about 1: the 17 slopes of a neuron of 16 inputs and a bias are
/// at most 1/4 each, y (1 - y) times an input in (0, 1), and slopes of deeper layers carry more factors of 1/4. So P0 / R and Q / R must
/// stay below 1 / eps: 2^24 = 1.7e7 in f32, 2^53 = 9e15 in f64. The limits are two and four decades lower, for larger |b|, and because the
/// rounding of many rows adds up. `extreme_grid_the_plain_form_keeps_weights_finite_and_says_when_it_rebuilt` holds them: up to them no guard
/// acts on features of one scale; the same grid has settings beyond them where guards do.
const F32_LIMIT: f64 = 1e5;
const F64_LIMIT: f64 = 1e12;

/// Checked noise settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Noise {
    pub p0: f64,
    q: f64,
    schedule: Schedule,
}

impl Noise {
    pub(super) fn of(params: &NoiseParams) -> Noise {
        let p0 = match params.schedule {
            Schedule::Constant => params.p0_over_r,
            Schedule::PuskoriusFeldkamp => 100.0,
        };
        Noise { p0, q: params.q_over_r, schedule: params.schedule }
    }

    /// No noise: for learners that have no covariance.
    pub(super) fn none() -> Noise {
        Noise { p0: 0.0, q: 0.0, schedule: Schedule::Constant }
    }

    /// R and Q after `n` rows.
    pub(super) fn at(&self, n: u64) -> (f64, f64) {
        match self.schedule {
            Schedule::Constant => (1.0, self.q),
            Schedule::PuskoriusFeldkamp => {
                let fall = math::exp(-(n as f64) / TIME_CONSTANT);
                ((100.0 * fall).max(1.0), (1e-2 * fall).max(1e-6))
            }
        }
    }

    /// Refuses what a plain covariance of this precision cannot hold.
    pub(super) fn check(&self, precision: Precision, cure: &str) -> Result<(), FilterError> {
        let (limit, name) = match precision {
            Precision::F32 => (F32_LIMIT, "f32"),
            Precision::F64 => (F64_LIMIT, "f64"),
        };
        for (key, value) in [("p0_over_r", self.p0), ("q_over_r", self.q)] {
            if value.is_nan() || value > limit {
                return Err(FilterError::OutOfRange(format!(
                    "{key} is {value:e}, but a plain {name} covariance loses b'Pb to rounding above {limit:e}; {cure}"
                )));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_schedule_starts_falls_and_ends_at_its_published_values() {
        let params = NoiseParams { schedule: Schedule::PuskoriusFeldkamp, ..NoiseParams::default() };
        let noise = Noise::of(&params);
        assert_eq!((noise.p0, noise.at(0)), (100.0, (100.0, 1e-2)));
        let (r, q) = noise.at(4000);
        assert!((r - 100.0 / std::f64::consts::E).abs() < 1e-12 && (q - 1e-2 / std::f64::consts::E).abs() < 1e-15);
        assert_eq!(noise.at(1_000_000), (1.0, 1e-6));
    }

    #[test]
    fn extreme_ratios_are_refused_with_the_cure() {
        let noise = |p0, q| Noise::of(&NoiseParams { p0_over_r: p0, q_over_r: q, ..NoiseParams::default() });
        let refusal = noise(1e6, 0.0).check(Precision::F32, "set `robust: true`").unwrap_err().to_string();
        assert!(refusal.contains("p0_over_r") && refusal.contains("robust") && refusal.contains("1e5"), "{refusal}");
        assert!(noise(10.0, 1e6).check(Precision::F32, "").is_err());
        assert!(noise(1e12, 0.0).check(Precision::F64, "").is_ok());
        assert!(noise(1e5, 0.0).check(Precision::F32, "").is_ok());
    }
}
