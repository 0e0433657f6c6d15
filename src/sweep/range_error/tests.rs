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
