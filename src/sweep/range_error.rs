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

    /// One slot that light came back from.
    fn report(error: &RangeError, range_m: f64, cos_incidence: f64, normal: f64) -> (f64, Status) {
        let (mut measured_m, mut status) = ([0.0], [Status::Hit]);
        ApplyRangeErrors {
            error,
            range_m: &[range_m],
            cos_incidence: &[cos_incidence],
            normal: &[normal],
            status: &mut status,
            measured_m: &mut measured_m,
        }
        .run();
        (measured_m[0], status[0])
    }

    #[test]
    fn exact_sigma_is_absolute_plus_relative_plus_the_oblique_footprint() {
        let sensors_own = error(&Effects { range_noise: Some(RangeNoise::default()), ..Effects::default() });
        assert!((sensors_own.sigma_m(4.0, 0.5) - (0.010 + 0.005 * 4.0)).abs() < 1e-16);
        let noise = RangeNoise {
            sigma_m: Some(Dist::Constant(0.0)),
            sigma_per_m: Some(0.001.into()),
            incidence: true,
            ..RangeNoise::default()
        };
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
    fn exact_sigma_with_a_floor_is_flat_near_by_and_a_share_of_the_range_beyond() {
        let noise = RangeNoise {
            sigma_m: Some(Dist::Constant(0.0)),
            sigma_per_m: Some(0.01.into()),
            min_sigma_m: Some(0.01.into()),
            incidence: false,
        };
        let datasheet = error(&Effects { range_noise: Some(noise), ..Effects::default() });
        for (range_m, sigma_m) in [(0.06, 0.01), (0.5, 0.01), (1.0, 0.01), (1.5, 0.015), (4.0, 0.04)] {
            assert!((datasheet.sigma_m(range_m, 1.0) - sigma_m).abs() < 1e-16, "{range_m}");
        }
        // A floor below all that the sensor has changes no bit.
        let own = error(&Effects { range_noise: Some(RangeNoise::default()), ..Effects::default() });
        let floored = RangeNoise { min_sigma_m: Some(0.001.into()), ..RangeNoise::default() };
        let floored = error(&Effects { range_noise: Some(floored), ..Effects::default() });
        for range_m in [0.06, 0.3, 2.7, 5.6] {
            assert_eq!(own.sigma_m(range_m, 0.4).to_bits(), floored.sigma_m(range_m, 0.4).to_bits());
        }
    }

    #[test]
    fn exact_steps_are_whole_and_at_most_half_a_step_off() {
        let own = error(&Effects { quantisation: Some(Quantisation::default()), ..Effects::default() });
        let coarse = error(&Effects { quantisation: Some(Quantisation { step_m: Some(0.25) }), ..Effects::default() });
        for k in 1..2000 {
            let range_m = 0.002_718_281_8 * f64::from(k);
            let (fine_m, _) = report(&own, range_m, 1.0, 0.0);
            assert!((fine_m - range_m).abs() <= 0.0005 + 1e-15);
            assert!((fine_m / 0.001 - (fine_m / 0.001).round()).abs() < 1e-9);
            if range_m > 0.125 {
                assert_eq!(report(&coarse, range_m, 1.0, 0.0).0, (range_m * 4.0).round() / 4.0);
            }
        }
    }

    #[test]
    fn exact_gates_shut_out_what_lies_beyond_them_and_without_them_only_the_far_end_counts() {
        let open = error(&Effects::default());
        assert_eq!(report(&open, 0.01, 1.0, 0.0), (0.01, Status::Hit));
        assert_eq!(report(&open, 5.6, 1.0, 0.0), (5.6, Status::Hit));
        assert_eq!(report(&open, 5.600_001, 1.0, 0.0).1, Status::OutOfRange);
        let own = error(&Effects { gates: Some(Gates::default()), ..Effects::default() });
        assert_eq!(report(&own, 0.06, 1.0, 0.0), (0.06, Status::Hit));
        assert_eq!(report(&own, 0.059, 1.0, 0.0).1, Status::OutOfRange);
        let gates = Gates { min_m: Some(1.0), max_m: Some(8.0) };
        let effects = Effects { gates: Some(gates), ..Effects::default() };
        let narrow = error(&effects);
        assert_eq!(report(&narrow, 0.999, 1.0, 0.0).1, Status::OutOfRange);
        assert_eq!(report(&narrow, 7.9, 1.0, 0.0), (7.9, Status::Hit));
        assert_eq!(RangeError::reach_m(&shipped("urg-04lx"), &effects), 8.0);
        assert_eq!(RangeError::reach_m(&shipped("urg-04lx"), &Effects::default()), 5.6);
    }

    #[test]
    fn equal_slots_one_by_one_and_by_lanes_in_every_form() {
        struct Whole<'a>(&'a RangeError, [Vec<f64>; 3], Vec<Status>);
        impl Work for Whole<'_> {
            type Out = (Vec<u64>, Vec<Status>);
            #[inline(always)]
            fn run(self) -> (Vec<u64>, Vec<Status>) {
                let Whole(error, [range_m, cos_incidence, normal], mut status) = self;
                let mut measured_m = vec![1.0; status.len()];
                ApplyRangeErrors {
                    error,
                    range_m: &range_m,
                    cos_incidence: &cos_incidence,
                    normal: &normal,
                    status: &mut status,
                    measured_m: &mut measured_m,
                }
                .run();
                (measured_m.into_iter().map(f64::to_bits).collect(), status)
            }
        }
        let all = [Status::Hit, Status::None, Status::Dropped, Status::Hit, Status::OutOfRange];
        let status: Vec<Status> = all.into_iter().cycle().take(1003).collect();
        let list = |scale: f64, from: f64| -> Vec<f64> {
            (0..1003).map(|k| from + scale * math::sin(f64::from(k) * 0.7).abs()).collect()
        };
        let mut range_m = list(6.0, 0.0);
        range_m[5] = f64::INFINITY;
        range_m[10] = f64::NAN;
        let lists = [range_m, list(1.0, 0.0), list(4.0, -2.0)];
        let noise = |incidence| Some(RangeNoise { incidence, ..RangeNoise::default() });
        for effects in [
            Effects::default(),
            Effects { range_noise: noise(false), gates: Some(Gates::default()), ..Effects::default() },
            Effects { range_noise: noise(true), quantisation: Some(Quantisation::default()), ..Effects::default() },
        ] {
            let error = error(&effects);
            let single: (Vec<u64>, Vec<Status>) = (0..status.len())
                .map(|k| match status[k] {
                    Status::Hit => {
                        let (measured_m, status) = report(&error, lists[0][k], lists[1][k], lists[2][k]);
                        (measured_m.to_bits(), status)
                    }
                    other => (f64::NAN.to_bits(), other),
                })
                .unzip();
            for lanes in crate::wide::every_form(|| Whole(&error, lists.clone(), status.clone())) {
                assert!(lanes == single);
            }
        }
    }

    #[test]
    fn extreme_noise_that_makes_a_range_negative_or_nan_is_out_of_range() {
        let noisy = error(&Effects { range_noise: Some(RangeNoise::default()), ..Effects::default() });
        for (range_m, draw) in [(0.02, -9.0), (f64::NAN, 0.0), (1.0, f64::NEG_INFINITY), (1.0, f64::NAN)] {
            let (measured_m, status) = report(&noisy, range_m, 1.0, draw);
            assert!(measured_m.is_nan() && status == Status::OutOfRange);
        }
    }
}
