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
    #[inline]
    pub fn sigma_m(&self, range_m: f64, cos_incidence: f64) -> f64 {
        let c = cos_incidence;
        let tan = if c > STEEPEST_COS { ((1.0 - c) * (1.0 + c)).max(0.0).sqrt() / c } else { STEEPEST_TAN };
        self.sigma_m + range_m * (self.sigma_per_m + self.sigma_per_m_tan * tan)
    }

    /// The reported range and its status; `normal` is a standard normal draw.
    #[inline]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;
    use crate::random::Dist;
    use crate::sweep::fixtures::{shipped, streams};
    use crate::sweep::params::{Gates, Quantisation};

    fn error(effects: &Effects) -> RangeError {
        let params = crate::sweep::SweepParams { effects: effects.clone(), ..Default::default() };
        let drawn = Drawn::draw(&streams(1), params.dists());
        RangeError::new(&shipped("urg-04lx"), effects, &drawn, &streams(1))
    }

    #[test]
    fn exact_sigma_is_absolute_plus_relative_plus_the_oblique_footprint() {
        let sensors_own = error(&Effects { range_noise: Some(RangeNoise::default()), ..Effects::default() });
        assert!((sensors_own.sigma_m(4.0, 0.5) - (0.010 + 0.005 * 4.0)).abs() < 1e-16);
        let noise = RangeNoise { sigma_m: Some(Dist::Constant(0.0)), sigma_per_m: Some(0.001.into()), incidence: true };
        let oblique = error(&Effects { range_noise: Some(noise), ..Effects::default() });
        // R beta tan(alpha) / 4 at 60 degrees; capped at 82.
        let at = |alpha_deg: f64| oblique.sigma_m(2.0, math::cos(alpha_deg.to_radians()));
        assert!((at(60.0) - (0.002 + 2.0 * 0.010 * 3.0f64.sqrt() / 4.0)).abs() < 1e-15);
        let capped = 0.002 + 2.0 * 0.010 * math::tan(82.0f64.to_radians()) / 4.0;
        assert!((at(81.999_999) - capped).abs() < 1e-7);
        for alpha_deg in [82.000_001, 89.0, 90.0] {
            assert!((at(alpha_deg) - capped).abs() < 1e-14, "{alpha_deg}");
        }
        assert!(oblique.sigma_m(2.0, 0.0).is_finite());
    }

    #[test]
    fn exact_steps_are_whole_and_at_most_half_a_step_off() {
        let own = error(&Effects { quantisation: Some(Quantisation::default()), ..Effects::default() });
        let coarse = error(&Effects { quantisation: Some(Quantisation { step_m: Some(0.25) }), ..Effects::default() });
        for k in 1..2000 {
            let range_m = 0.002_718_281_8 * f64::from(k);
            let (fine_m, _) = own.report(range_m, 1.0, 0.0);
            assert!((fine_m - range_m).abs() <= 0.0005 + 1e-15);
            assert!((fine_m / 0.001 - (fine_m / 0.001).round()).abs() < 1e-9);
            if range_m > 0.125 {
                assert_eq!(coarse.report(range_m, 1.0, 0.0).0, (range_m * 4.0).round() / 4.0);
            }
        }
    }

    #[test]
    fn exact_gates_shut_out_what_lies_beyond_them_and_without_them_only_the_far_end_counts() {
        let open = error(&Effects::default());
        assert_eq!(open.report(0.01, 1.0, 0.0), (0.01, Status::Hit));
        assert_eq!(open.report(5.6, 1.0, 0.0), (5.6, Status::Hit));
        assert_eq!(open.report(5.600_001, 1.0, 0.0).1, Status::OutOfRange);
        let own = error(&Effects { gates: Some(Gates::default()), ..Effects::default() });
        assert_eq!(own.report(0.06, 1.0, 0.0), (0.06, Status::Hit));
        assert_eq!(own.report(0.059, 1.0, 0.0).1, Status::OutOfRange);
        let gates = Gates { min_m: Some(1.0), max_m: Some(8.0) };
        let effects = Effects { gates: Some(gates), ..Effects::default() };
        let narrow = error(&effects);
        assert_eq!(narrow.report(0.999, 1.0, 0.0).1, Status::OutOfRange);
        assert_eq!(narrow.report(7.9, 1.0, 0.0), (7.9, Status::Hit));
        assert_eq!(RangeError::reach_m(&shipped("urg-04lx"), &effects), 8.0);
        assert_eq!(RangeError::reach_m(&shipped("urg-04lx"), &Effects::default()), 5.6);
    }

    #[test]
    fn extreme_noise_that_makes_a_range_negative_or_nan_is_out_of_range() {
        let noisy = error(&Effects { range_noise: Some(RangeNoise::default()), ..Effects::default() });
        for (range_m, draw) in [(0.02, -9.0), (f64::NAN, 0.0), (1.0, f64::NEG_INFINITY), (1.0, f64::NAN)] {
            let (measured_m, status) = noisy.report(range_m, 1.0, draw);
            assert!(measured_m.is_nan() && status == Status::OutOfRange);
        }
    }
}
