//! A true range -> the number the sensor reports.
//!
//! In: range, incidence, draws. Out: range, status. Order: bias and noise, then the step, then the gates. Source: Hewitt et
//! al. 2017 (Gaussian noise after the first hit is chosen); Soudarissanane et al. 2009 for the oblique footprint,
//! range * divergence * tan(incidence) / 4.

use super::Status;
use super::params::{Effects, RangeNoise};
use super::sensor::Sensor;
use crate::random::{Drawn, Purpose, Streams};
use crate::wide::Work;

/// tan of 82 degrees, where the growth with incidence stops, and its cosine.
const STEEPEST_COS: f64 = 0.139_173_100_960_065_44;
const STEEPEST_TAN: f64 = 7.115_369_722_384_209;

/// The range errors of one sweep; a part that is off is 0, infinite or `None`.
#[derive(Clone, Copy, Debug)]
pub(super) struct RangeError {
    sigma_m: f64,
    sigma_per_m: f64,
    /// divergence / 4 where incidence counts.
    sigma_per_m_tan: f64,
    min_sigma_m: f64,
    bias_m: f64,
    step_m: Option<f64>,
    min_m: f64,
    max_m: f64,
}

impl RangeError {
    pub(super) fn new(sensor: &Sensor, effects: &Effects, drawn: &Drawn, streams: &Streams) -> RangeError {
        let bias_sigma_m = effects.range_bias_m.as_ref().map(|_| drawn[Purpose::SweepBiasSigma]);
        let gates = effects.gates.as_ref();
        let mut error = RangeError {
            sigma_m: 0.0,
            sigma_per_m: 0.0,
            sigma_per_m_tan: 0.0,
            min_sigma_m: 0.0,
            bias_m: bias_sigma_m.map_or(0.0, |sigma_m| sigma_m * streams.open(Purpose::SweepBias).normal(0)),
            step_m: effects.quantisation.as_ref().map(|q| q.step_m.unwrap_or(sensor.range_step_m)),
            min_m: gates.map_or(0.0, |g| g.min_m.unwrap_or(sensor.min_range_m)),
            max_m: gates.and_then(|g| g.max_m).unwrap_or(sensor.max_range_m),
        };
        if let Some(RangeNoise { incidence, .. }) = &effects.range_noise {
            error.sigma_m = drawn.get(Purpose::SweepRangeSigma).unwrap_or(sensor.range_sigma_m);
            error.sigma_per_m = drawn.get(Purpose::SweepRangeSigmaPerM).unwrap_or(sensor.range_sigma_per_m);
            error.min_sigma_m = drawn.get(Purpose::SweepRangeSigmaLeast).unwrap_or(0.0);
            error.sigma_per_m_tan = if *incidence { 0.25e-3 * sensor.divergence_mrad } else { 0.0 };
        }
        error
    }

    /// How far a sensor with these gates looks, metres.
    pub(super) fn reach_m(sensor: &Sensor, effects: &Effects) -> f64 {
        let gate_m = effects.gates.as_ref().and_then(|g| g.max_m).unwrap_or(0.0);
        sensor.max_range_m.max(gate_m)
    }

    /// Whether the noise grows with the incidence.
    pub(super) fn oblique(&self) -> bool {
        self.sigma_per_m_tan > 0.0
    }

    /// Standard deviation of the noise at a range and incidence.
    #[inline(always)]
    fn sigma_m(&self, range_m: f64, cos_incidence: f64) -> f64 {
        let c = cos_incidence;
        let tan = if c > STEEPEST_COS { ((1.0 - c) * (1.0 + c)).max(0.0).sqrt() / c } else { STEEPEST_TAN };
        (self.sigma_m + range_m * (self.sigma_per_m + self.sigma_per_m_tan * tan)).max(self.min_sigma_m)
    }

    /// The reported range: NaN where the gates shut it out. `noise_m` is a draw of what `sigma_m` tells.
    #[inline(always)]
    fn measured_m(&self, range_m: f64, noise_m: f64) -> f64 {
        let mut measured_m = range_m + self.bias_m + noise_m;
        if let Some(step_m) = self.step_m {
            measured_m = (measured_m / step_m).round() * step_m;
        }
        // A range of 0 or less is a measurement of nothing, gates or not.
        let within = measured_m > 0.0 && measured_m >= self.min_m && measured_m <= self.max_m;
        if within { measured_m } else { f64::NAN }
    }
}

/// What the ranges before errors tell of a run of slots.
pub(super) struct MarkStatus<'a> {
    /// Infinite where nothing was met, NaN where no range could be made of the light.
    pub range_m: &'a [f64],
    /// Overwritten.
    pub status: &'a mut [Status],
}

impl Work for MarkStatus<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        for (status, &range_m) in self.status.iter_mut().zip(self.range_m) {
            let lit = if range_m.is_finite() { Status::Hit } else { Status::None };
            *status = if range_m.is_nan() { Status::Dropped } else { lit };
        }
    }
}

/// The ranges that a run of slots reports, all slots alike whatever became of their beams.
pub(super) struct ApplyRangeErrors<'a> {
    pub error: &'a RangeError,
    /// Ranges before errors.
    pub range_m: &'a [f64],
    /// Empty where no effect asks for it.
    pub cos_incidence: &'a [f64],
    /// Standard normal draws; empty without noise.
    pub normal: &'a [f64],
    /// Slots that the gates shut out change it.
    pub status: &'a mut [Status],
    /// Overwritten; NaN unless the status is `Hit`.
    pub measured_m: &'a mut [f64],
}

impl Work for ApplyRangeErrors<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let ApplyRangeErrors { error, range_m, cos_incidence, normal, status, measured_m } = self;
        let ranges = measured_m.iter_mut().zip(range_m);
        if normal.is_empty() {
            for (measured_m, &range_m) in ranges {
                *measured_m = error.measured_m(range_m, 0.0);
            }
        } else if error.oblique() {
            for (((measured_m, &range_m), &normal), &cos) in ranges.zip(normal).zip(cos_incidence) {
                *measured_m = error.measured_m(range_m, error.sigma_m(range_m, cos) * normal);
            }
        } else {
            // What the incidence adds is nothing.
            for ((measured_m, &range_m), &normal) in ranges.zip(normal) {
                *measured_m = error.measured_m(range_m, error.sigma_m(range_m, 1.0) * normal);
            }
        }
        for (measured_m, status) in measured_m.iter_mut().zip(status) {
            let hit = *status == Status::Hit;
            *status = if hit && measured_m.is_nan() { Status::OutOfRange } else { *status };
            *measured_m = if hit { *measured_m } else { f64::NAN };
        }
    }
}

#[cfg(test)]
mod tests;
