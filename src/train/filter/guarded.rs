//! The plain EKF, which gives way to the factored form where rounding spoils its covariance again and again.
//!
//! In: Jacobians and innovations. Out: better weights. A plain covariance whose b'Pb comes out negative is rebuilt from its
//! diagonal and goes on. Where that happens a second time, the settings or the features are beyond what the plain form can hold:
//! the factored form takes over the variances, and S >= R from then on by construction.

use super::FilterError;
use super::ekf::Ekf;
use super::lanes::{Isa, Real};
use super::linearised::{Learner, Outcome, Rows};
use super::state::{Reader, Writer};
use super::ud::Ud;

/// The filter with covariances of element type `T`.
pub(crate) struct CheckedFilter<T: Real> {
    form: Form<T>,
    kind: String,
    isa: Isa,
}

enum Form<T: Real> {
    Plain(Ekf<T>),
    Factored(Ud<T>),
}

impl<T: Real> CheckedFilter<T> {
    pub(super) fn new(plain: Ekf<T>, isa: Isa) -> CheckedFilter<T> {
        CheckedFilter { kind: plain.kind().to_string(), form: Form::Plain(plain), isa }
    }
}

impl<T: Real> Learner for CheckedFilter<T> {
    /// Of the plain form, whichever learns: a state of either goes on in a filter of the same settings.
    fn kind(&self) -> &str {
        &self.kind
    }

    fn batch(&self) -> usize {
        match &self.form {
            Form::Plain(plain) => plain.batch(),
            Form::Factored(factored) => factored.batch(),
        }
    }

    fn update(&mut self, weights: &mut [f64], rows: &Rows) -> Outcome {
        match &mut self.form {
            Form::Plain(plain) => plain.update(weights, rows),
            Form::Factored(factored) => factored.update(weights, rows),
        }
    }

    fn give_way(&mut self) -> bool {
        let Form::Plain(plain) = &self.form else { return false };
        self.form = Form::Factored(plain.factored(self.isa));
        true
    }

    fn save(&self, to: &mut Writer) {
        match &self.form {
            Form::Plain(plain) => plain.save(to),
            Form::Factored(factored) => factored.save(to),
        }
    }

    fn load(&mut self, from: &Reader) -> Result<(), FilterError> {
        if from.holds(Ud::<T>::FACTOR) {
            self.give_way();
        }
        match &mut self.form {
            Form::Plain(plain) => plain.load(from),
            Form::Factored(factored) => factored.load(from),
        }
    }
}
