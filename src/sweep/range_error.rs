//! A true range -> the number the sensor reports.
//!
//! In: range, incidence, draws. Out: range, status. Order: bias and noise, then the step, then the gates. Source: Hewitt et
//! al. 2017 (Gaussian noise after the first hit is chosen); Soudarissanane et al. 2009 for the oblique footprint,
//! range * divergence * tan(incidence) / 4.

use super::Status;
use super::params::{Effects, RangeNoise};
use super::sensor::Sensor;
use crate::random::{Drawn, Purpose, Streams};

/// tan of 82 degrees, where the growth with incidence stops, and its cosine.
const STEEPEST_COS: f64 = 0.139_173_100_960_065_44;
const STEEPEST_TAN: f64 = 7.115_369_722_384_209;

/// The range errors of one sweep; a part that is off is 0, infinite or `None`.
#[derive(Clone, Copy, Debug)]
pub(super) struct RangeError {
    /// Whether Gaussian noise is on at all.
    pub noisy: bool,
    sigma_m: f64,
    sigma_per_m: f64,
    /// divergence / 4 where incidence counts.
    sigma_per_m_tan: f64,
    bias_m: f64,
    step_m: Option<f64>,
    min_m: f64,
    max_m: f64,
}

impl RangeError {
    pub fn new(sensor: &Sensor, effects: &Effects, drawn: &Drawn, streams: &Streams) -> RangeError {
        let bias_sigma_m = effects.range_bias_m.as_ref().map(|_| drawn[Purpose::SweepBiasSigma]);
        let gates = effects.gates.as_ref();
        let mut error = RangeError {
            noisy: effects.range_noise.is_some(),
            sigma_m: 0.0,
            sigma_per_m: 0.0,
            sigma_per_m_tan: 0.0,
            bias_m: bias_sigma_m.map_or(0.0, |sigma_m| sigma_m * streams.open(Purpose::SweepBias).normal(0)),
            step_m: effects.quantisation.as_ref().map(|q| q.step_m.unwrap_or(sensor.range_step_m)),
            min_m: gates.map_or(0.0, |g| g.min_m.unwrap_or(sensor.min_range_m)),
            max_m: gates.and_then(|g| g.max_m).unwrap_or(sensor.max_range_m),
        };
        if let Some(RangeNoise { incidence, .. }) = &effects.range_noise {
            error.sigma_m = drawn.get(Purpose::SweepRangeSigma).unwrap_or(sensor.range_sigma_m);
            error.sigma_per_m = drawn.get(Purpose::SweepRangeSigmaPerM).unwrap_or(sensor.range_sigma_per_m);
            error.sigma_per_m_tan = if *incidence { 0.25e-3 * sensor.divergence_mrad } else { 0.0 };
        }
        error
    }

    /// How far a sensor with these gates looks, metres.
    pub fn reach_m(sensor: &Sensor, effects: &Effects) -> f64 {
        let gate_m = effects.gates.as_ref().and_then(|g| g.max_m).unwrap_or(0.0);
        sensor.max_range_m.max(gate_m)
    }

    /// Standard deviation of the noise at a range and incidence.
    pub fn sigma_m(&self, range_m: f64, cos_incidence: f64) -> f64 {
        let c = cos_incidence;
        let tan = if c > STEEPEST_COS { ((1.0 - c) * (1.0 + c)).max(0.0).sqrt() / c } else { STEEPEST_TAN };
        self.sigma_m + range_m * (self.sigma_per_m + self.sigma_per_m_tan * tan)
    }

    /// The reported range and its status; `normal` is a standard normal draw.
    pub fn report(&self, range_m: f64, cos_incidence: f64, normal: f64) -> (f64, Status) {
        let mut measured_m = range_m + self.bias_m;
        if self.noisy {
            measured_m += self.sigma_m(range_m, cos_incidence) * normal;
        }
        if let Some(step_m) = self.step_m {
            measured_m = (measured_m / step_m).round() * step_m;
        }
        // A range of 0 or less is a measurement of nothing, gates or not.
        if measured_m > 0.0 && measured_m >= self.min_m && measured_m <= self.max_m {
            (measured_m, Status::Hit)
        } else {
            (f64::NAN, Status::OutOfRange)
        }
    }
}
