//! Draws of every law against its distribution function: closed where there is one, integrated here where there is none.
//!
//! Significance: each bound lets a right law fail with a chance of 1e-6 at most (Kolmogorov's limit law, or five standard errors of a
//! moment). Addresses are fixed, so that a test that passes passes always.

use super::*;
use crate::random::{Dist, Purpose, Stage, Streams};

const SEEDS: u64 = 40;
const DRAWS: u64 = 40_000;

/// Draws of several seeds.
fn draws(law: &Law) -> Vec<f64> {
    assert_eq!(law.fault(), None, "{law:?}");
    let (low, high) = law.bounds();
    let of_seed = |seed| {
        let stream = Streams { seed, scene: 1, attempt: 0, stage: Stage::Scene, step: 0 }.open(Purpose::RockDiameter);
        (0..DRAWS / SEEDS).map(move |index| law.draw(&stream, index))
    };
    let draws: Vec<f64> = (0..SEEDS).flat_map(of_seed).collect();
    assert!(draws.iter().all(|x| (low..=high).contains(x)), "{law:?}");
    draws
}

/// The distribution function of a density given by its logarithm, by the trapezoid rule around its mode; beyond some 60 from the mode
/// the density is exponential, with these rates.
fn integrated(log_density: impl Fn(f64) -> f64, mode: f64, rates: [f64; 2]) -> impl Fn(f64) -> f64 {
    const NODES: usize = 20_000;
    let edge = |sign: f64| {
        let (mut far, mut step) = (0.0, 1e-7);
        while far < 60.0 && log_density(mode) - log_density(mode + sign * far) < 40.0 {
            (far, step) = (far + step, step * 1.1);
        }
        mode + sign * far
    };
    let (left, right) = (edge(-1.0), edge(1.0));
    let width = (right - left) / (NODES - 1) as f64;
    let density = |t: f64| math::exp(log_density(t) - log_density(mode));
    let [below, above] =
        [(left, rates[0]), (right, rates[1])].map(|(t, rate)| if rate > 0.0 { density(t) / rate } else { 0.0 });
    let mut sums = vec![below];
    for k in 1..NODES {
        let [a, b] = [k - 1, k].map(|k| density(left + k as f64 * width));
        sums.push(sums[k - 1] + 0.5 * width * (a + b));
    }
    let total = sums[NODES - 1] + above;
    move |t: f64| match (t - left) / width {
        _ if t < left => below * math::exp(rates[0] * (t - left)) / total,
        _ if t >= right => 1.0 - above * math::exp(-rates[1] * (t - right)) / total,
        place => {
            let k = place as usize;
            (sums[k] + (place - k as f64) * (sums[k + 1] - sums[k])) / total
        }
    }
}

type Distribution = Box<dyn Fn(f64) -> f64>;

fn gamma(shape: f64, scale: f64) -> Distribution {
    // In the logarithm of x, whose density is smooth for every shape.
    let below = integrated(move |t| shape * t - math::exp(t), math::ln(shape), [shape, 0.0]);
    Box::new(move |x| below(math::ln(x / scale)))
}

fn beta(alpha: f64, beta: f64, low: f64, high: f64) -> Distribution {
    // In the logarithm of x / (1 - x).
    let log_density = move |t: f64| alpha * t - (alpha + beta) * (t.max(0.0) + math::ln_1p(math::exp(-t.abs())));
    let below = integrated(log_density, math::ln(alpha / beta), [alpha, beta]);
    Box::new(move |x| match (x - low) / (high - low) {
        share if share <= 0.0 => 0.0,
        share if share >= 1.0 => 1.0,
        share => below(math::ln(share) - math::ln_1p(-share)),
    })
}

/// The distribution function of a law of real values, before it is cut.
fn uncut(law: &Law) -> Distribution {
    match *law {
        Law::Gamma { shape, scale, .. } => gamma(shape, scale),
        Law::Beta { alpha, beta: b, low, high } => beta(alpha, b, low, high),
        Law::Pert { low, mode, high, shape } => {
            let [alpha, b] = [mode - low, high - mode].map(|arm| 1.0 + shape * arm / (high - low));
            beta(alpha, b, low, high)
        }
        Law::Weibull { scale, shape, .. } => Box::new(move |x| -math::exp_m1(-math::pow(x.max(0.0) / scale, shape))),
        Law::Triangular { low, mode, high } => Box::new(move |x| match x.clamp(low, high) {
            x if x < mode => (x - low) * (x - low) / ((high - low) * (mode - low)),
            x if x < high => 1.0 - (high - x) * (high - x) / ((high - low) * (high - mode)),
            _ => 1.0,
        }),
        _ => unreachable!("no law of real values under test here"),
    }
}

/// Kolmogorov's distance between draws and law; a draw stands for all values that round to it.
fn distance(law: &Law) -> f64 {
    let mut draws = draws(law);
    draws.sort_by(f64::total_cmp);
    let (low, high) = law.bounds();
    let below = uncut(law);
    let (cut_low, cut_high) = match law {
        Law::Gamma { .. } | Law::Weibull { .. } => (if low > 0.0 { below(low) } else { 0.0 }, below(high)),
        _ => (0.0, 1.0),
    };
    let below = |x: f64| ((below(x) - cut_low) / (cut_high - cut_low)).clamp(0.0, 1.0);
    let count = draws.len() as f64;
    let far = |(i, &x): (usize, &f64)| {
        let rounding = 1e-300 + 1e-15 * x.abs().max(if low < 0.0 { -low } else { low });
        let down = if x - rounding > 0.0 || low < 0.0 { below(x - rounding) } else { 0.0 };
        ((i + 1) as f64 / count - below(x + rounding)).max(down - i as f64 / count)
    };
    draws.iter().enumerate().map(far).fold(0.0, f64::max)
}

/// Kolmogorov's limit law: 2 exp(-2 z^2) = 1e-6.
fn critical_distance() -> f64 {
    (0.5 * math::ln(2e6)).sqrt() / (DRAWS as f64).sqrt()
}

fn gamma_law(shape: f64, scale: f64) -> Law {
    Law::Gamma { shape, scale, min: 0.0, max: shape * scale * 1e3 + 1e3 * scale }
}

fn weibull_law(scale: f64, shape: f64) -> Law {
    Law::Weibull { scale, shape, min: 0.0, max: 1e300 }
}

fn pert_law(low: f64, mode: f64, high: f64, shape: f64) -> Law {
    Law::Pert { low, mode, high, shape }
}

#[test]
fn dist_draws_follow_the_distribution_function() {
    let beta = |alpha, beta, low, high| Law::Beta { alpha, beta, low, high };
    let triangular = |low, mode, high| Law::Triangular { low, mode, high };
    let laws = [
        gamma_law(2.5, 0.3),
        gamma_law(1.0, 2.0),
        gamma_law(1.0 - 1e-9, 2.0),
        gamma_law(0.5, 1e-12),
        gamma_law(9.0, 1e12),
        gamma_law(1e-3, 1.0),
        gamma_law(1e6, 1e-6),
        Law::Gamma { shape: 2.0, scale: 0.3, min: 0.5, max: 1.0 },
        Law::Gamma { shape: 2.0, scale: 0.3, min: 2.6, max: 5.0 },
        beta(2.0, 5.0, 0.0, 1.0),
        beta(1.0, 1.0, -3.0, 5.0),
        beta(0.5, 0.5, 0.2, 0.8),
        beta(1e-3, 1e-3, 0.0, 1.0),
        beta(1e-3, 2.0, 0.0, 1.0),
        beta(1e6, 1e6, 0.0, 1.0),
        beta(1e6, 2.0, 0.0, 1.0),
        weibull_law(0.4, 1.3),
        weibull_law(1e-12, 0.5),
        weibull_law(1e12, 20.0),
        weibull_law(1.0, 1e-3),
        weibull_law(1.0, 1e6),
        Law::Weibull { scale: 0.3, shape: 1.2, min: 0.1, max: 0.5 },
        Law::Weibull { scale: 0.3, shape: 1.2, min: 1.4, max: 2.0 },
        triangular(0.1, 0.3, 2.0),
        triangular(0.1, 0.1, 2.0),
        triangular(-4.0, 2.0, 2.0),
        triangular(0.0, 1e-9, 1e-8),
        pert_law(0.1, 0.3, 2.0, 4.0),
        pert_law(0.1, 0.1, 2.0, 4.0),
        pert_law(-4.0, 2.0, 2.0, 4.0),
        pert_law(0.0, 0.7, 1.0, 0.0),
        pert_law(0.0, 0.7, 1.0, 1e6),
    ];
    let critical = critical_distance();
    for law in laws {
        let distance = distance(&law);
        assert!(distance < critical, "{law:?}: {distance} against {critical}");
    }
}

#[test]
fn dist_draws_have_the_moments_of_their_law() {
    let pert = |low: f64, mode: f64, high: f64| (low + 4.0 * mode + high) / 6.0;
    // Mean, variance and excess kurtosis in closed form.
    let laws = [
        (gamma_law(2.5, 0.3), 0.75, 0.225, 2.4),
        (gamma_law(1e6, 1e-6), 1.0, 1e-6, 6e-6),
        (gamma_law(0.5, 2.0), 1.0, 2.0, 12.0),
        (Law::Beta { alpha: 2.0, beta: 2.0, low: 0.0, high: 1.0 }, 0.5, 0.05, -6.0 / 7.0),
        (Law::Beta { alpha: 0.5, beta: 0.5, low: 1.0, high: 3.0 }, 2.0, 0.5, -1.5),
        (weibull_law(0.4, 1.0), 0.4, 0.16, 6.0),
        (weibull_law(2.0, 2.0), std::f64::consts::PI.sqrt(), 4.0 - std::f64::consts::PI, 0.245_089_3),
        (Law::Triangular { low: 0.0, mode: 1.0, high: 5.0 }, 2.0, 21.0 / 18.0, -0.6),
        (Law::Triangular { low: 2.0, mode: 2.0, high: 5.0 }, 3.0, 0.5, -0.6),
        (pert_law(0.0, 1.0, 2.0, 4.0), pert(0.0, 1.0, 2.0), 1.0 / 7.0, -2.0 / 3.0),
        (Law::Poisson { mean: 3.0, min: 0.0, max: None }, 3.0, 3.0, 1.0 / 3.0),
        (Law::Poisson { mean: 12.0, min: 0.0, max: None }, 12.0, 12.0, 1.0 / 12.0),
        (Law::Poisson { mean: 1e6, min: 0.0, max: None }, 1e6, 1e6, 1e-6),
    ];
    for (law, mean, variance, excess) in laws {
        let draws = draws(&law);
        let count = draws.len() as f64;
        let got_mean = draws.iter().sum::<f64>() / count;
        let got_variance = draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count;
        let error = 5.0 * (variance / count).sqrt();
        assert!((got_mean - mean).abs() < error, "{law:?}: mean {got_mean} against {mean} +- {error}");
        let error = 5.0 * variance * ((excess + 2.0) / count).sqrt();
        assert!(
            (got_variance - variance).abs() < error,
            "{law:?}: variance {got_variance} against {variance} +- {error}"
        );
    }
}

/// Probabilities of the whole numbers from `least` to `most`, by the ratios of neighbours.
fn poisson_probabilities(mean: f64, least: u64, most: u64) -> Vec<f64> {
    let mut log = vec![0.0];
    for k in least + 1..=most {
        log.push(log[log.len() - 1] + math::ln(mean / k as f64));
    }
    let top = log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = log.iter().map(|l| math::exp(l - top)).collect();
    let total: f64 = weights.iter().sum();
    weights.iter().map(|w| w / total).collect()
}

#[test]
fn dist_poisson_numbers_are_as_frequent_as_the_law_says() {
    let windows = [
        (0.2, 0.0, None),
        (3.0, 0.0, None),
        (11.99, 0.0, None),
        (12.0, 0.0, None),
        (40.0, 0.0, None),
        (1e3, 0.0, None),
    ];
    let cut = [(3.0, 5.0, Some(9.5)), (30.0, 0.0, Some(20.0)), (30.0, 45.2, None)];
    for (mean, min, max) in windows.into_iter().chain(cut) {
        let law = Law::Poisson { mean, min, max };
        let draws = draws(&law);
        let (least, most) = law.bounds();
        let (least, most) = (least as u64, most as u64);
        let mut counts = vec![0u32; (most - least + 1) as usize];
        draws.iter().for_each(|&k| counts[k as usize - least as usize] += 1);
        assert!(draws.iter().all(|k| k.fract() == 0.0), "{law:?}");
        // Neighbours are taken together until twenty draws are expected.
        let (mut statistic, mut groups) = (0.0, 0);
        let (mut seen, mut expected, mut left) = (0.0, 0.0, draws.len() as f64);
        for (&count, p) in counts.iter().zip(poisson_probabilities(mean, least, most)) {
            seen += f64::from(count);
            expected += p * draws.len() as f64;
            if expected >= 20.0 && left - expected >= 20.0 {
                statistic += (seen - expected) * (seen - expected) / expected;
                left -= expected;
                (seen, expected, groups) = (0.0, 0.0, groups + 1);
            }
        }
        statistic += (seen - expected) * (seen - expected) / expected;
        // Wilson & Hilferty's approximation of chi-square's quantile; 4.753 is the normal one of 1 - 1e-6.
        let freedom = f64::from(groups);
        let cube_root = 1.0 - 2.0 / (9.0 * freedom) + 4.753 * (2.0 / (9.0 * freedom)).sqrt();
        let critical = freedom * cube_root * cube_root * cube_root;
        assert!(groups > 0 && statistic < critical, "{law:?}: {statistic} against {critical} of {groups}");
    }
}

#[test]
fn exact_laws_of_one_point_are_that_point() {
    let stream = Streams { seed: 1, scene: 1, attempt: 0, stage: Stage::Scene, step: 0 }.open(Purpose::RockDiameter);
    let laws = [
        Law::Gamma { shape: 2.0, scale: 1.0, min: 0.7, max: 0.7 },
        Law::Weibull { scale: 2.0, shape: 1.0, min: 0.7, max: 0.7 },
        // (0.7 / 0.3)^1000 is beyond f64.
        Law::Weibull { scale: 0.3, shape: 1000.0, min: 0.7, max: 0.7 },
        Law::Beta { alpha: 2.0, beta: 3.0, low: 0.7, high: 0.7 },
        Law::Triangular { low: 0.7, mode: 0.7, high: 0.7 },
        pert_law(0.7, 0.7, 0.7, 4.0),
    ];
    for law in laws {
        assert_eq!(law.fault(), None, "{law:?}");
        assert!((0..100).all(|index| law.draw(&stream, index) == 0.7), "{law:?}");
    }
    let none = Law::Poisson { mean: 0.0, min: 0.0, max: None };
    assert_eq!((none.fault(), none.draw(&stream, 3)), (None, 0.0));
}

#[test]
fn law_a_draw_depends_on_its_own_index_and_law_alone() {
    let stream = Streams { seed: 1, scene: 1, attempt: 0, stage: Stage::Scene, step: 0 }.open(Purpose::RockDiameter);
    // A window of 1 % takes some hundred tries a draw: no draw of another index or another stream moves for it.
    let wide = Law::Gamma { shape: 2.0, scale: 0.3, min: 0.0, max: 9.0 };
    let narrow = Law::Gamma { shape: 2.0, scale: 0.3, min: 0.6, max: 0.615 };
    let backwards: Vec<f64> = (0..50).rev().map(|index| wide.draw(&stream, index)).collect();
    for (index, &expected) in (0..50).zip(backwards.iter().rev()) {
        narrow.draw(&stream, index);
        assert_eq!(wide.draw(&stream, index), expected);
    }
    assert!((1..50).all(|k| backwards[k] != backwards[k - 1]));
}

#[test]
fn law_counts_of_poisson_laws_are_whole_numbers_of_the_window() {
    let dist = Dist::Law(Law::Poisson { mean: 20.0, min: 8.0, max: Some(40.0) });
    let stream = Streams { seed: 1, scene: 1, attempt: 0, stage: Stage::Scene, step: 0 }.open(Purpose::RockFaces);
    let counts: Vec<u64> = (0..2000).map(|index| dist.count_at(&stream, index)).collect();
    assert!(counts.iter().all(|count| (8..=40).contains(count)));
    assert!((0..2000).all(|index| dist.at(&stream, index) == counts[index as usize] as f64));
}

#[test]
fn exact_shares_of_windows_are_those_of_the_integrated_law() {
    for (shape, scale, min, max) in [
        (2.5, 0.3, 0.1, 0.4),
        (1e-3, 1.0, 0.0, 1e-200),
        (1e6, 1e-6, 0.999, 1.001),
        (0.5, 1e-9, 1e-9, 1.0),
        (40.0, 2.0, 120.0, 1e9),
    ] {
        let below = gamma(shape, scale);
        let expected = below(max) - if min > 0.0 { below(min) } else { 0.0 };
        let got = share::of_gamma(shape, scale, min, max);
        assert!((got / expected - 1.0).abs() < 1e-5, "{shape} {scale} [{min}, {max}]: {got} against {expected}");
    }
    for (mean, least, most) in [(0.2, 1, 20), (12.0, 3, 9), (12.0, 25, 60), (1e4, 9_990, 10_010)] {
        let expected: f64 = poisson_probabilities(mean, 0, 20_000)[least as usize..=most as usize].iter().sum();
        let got = share::of_poisson(mean, f64::from(least), f64::from(most));
        assert!((got / expected - 1.0).abs() < 1e-6, "{mean} [{least}, {most}]: {got} against {expected}");
    }
}

#[test]
fn extreme_windows_far_from_the_law_and_faulty_parameters_are_named() {
    let gamma = |shape, scale, min, max| Law::Gamma { shape, scale, min, max };
    let weibull = |scale, shape, min, max| Law::Weibull { scale, shape, min, max };
    let poisson = |mean, min, max| Law::Poisson { mean, min, max: Some(max) };
    for (law, rule) in [
        (gamma(0.0, 1.0, 0.0, 1.0), "gamma needs shape in [0.001, 1000000], got 0"),
        (gamma(f64::NAN, 1.0, 0.0, 1.0), "gamma needs shape in"),
        (gamma(1.0, -1.0, 0.0, 1.0), "gamma needs scale in [0.000000000001, 1000000000000], got -1"),
        (gamma(1.0, 1.0, 2.0, 1.0), "gamma needs 0 <= min <= max, got min 2, max 1"),
        (gamma(1.0, 1.0, -1.0, 1.0), "gamma needs 0 <= min <= max, got min -1, max 1"),
        (gamma(1.0, 1.0, 0.0, f64::INFINITY), "gamma needs 0 <= min <= max"),
        (
            gamma(2.0, 0.3, 9.0, 10.0),
            "gamma needs at least a thousandth of its draws between min and max, got a share of 3e-12",
        ),
        (gamma(1e6, 1.0, 0.0, 1e5), "got a share of 0e0"),
        (weibull(1.0, 1e7, 0.0, 1.0), "weibull needs shape in [0.001, 1000000], got 10000000"),
        (weibull(0.3, 1.2, 9.0, 10.0), "weibull needs at least a thousandth"),
        (weibull(1.0, 1e6, 2.0, 3.0), "weibull needs at least a thousandth"),
        (poisson(-1.0, 0.0, 9.0), "poisson needs mean in [0, 1000000], got -1"),
        (poisson(3.0, 5.2, 5.8), "poisson needs 0 <= min <= max"),
        (poisson(3.0, -2.0, 5.0), "poisson needs 0 <= min <= max"),
        (poisson(3.0, 40.0, 50.0), "poisson needs at least a thousandth"),
        (Law::Beta { alpha: 1.0, beta: 0.0, low: 0.0, high: 1.0 }, "beta needs beta in [0.001, 1000000], got 0"),
        (Law::Beta { alpha: 1.0, beta: 1.0, low: 1.0, high: 0.0 }, "beta needs low <= high, got 1, 0"),
        (Law::Triangular { low: 0.0, mode: 2.0, high: 1.0 }, "triangular needs low <= mode <= high, got 0, 2, 1"),
        (pert_law(0.0, -0.1, 1.0, 4.0), "pert needs low <= mode <= high, got 0, -0.1, 1"),
        (pert_law(0.0, 0.1, 1.0, -4.0), "pert needs shape in [0, 1000000], got -4"),
    ] {
        let fault = law.fault().unwrap_or_default();
        assert!(fault.contains(rule), "{law:?}: {fault}");
    }
}

/// Draws of each law at fixed addresses, as bits.
const BITS: &str = include_str!("../../../tests/fixtures/law-bits.txt");

#[test]
fn golden_draws_of_each_law_in_the_program() {
    // The same lines are held in tests/config/laws.rs, where the C library's names are not bound to the pinned functions.
    let laws: Vec<(&str, &str)> = BITS.lines().filter_map(|line| line.split_once(" = ")).collect();
    assert_eq!(laws.len(), 12);
    for (text, bits) in laws {
        let law: Law = serde_json::from_str(text).unwrap();
        let stream =
            Streams { seed: 7, scene: 3, attempt: 0, stage: Stage::Scene, step: 0 }.open(Purpose::RockDiameter);
        let got: Vec<String> = (0..3).map(|index| format!("{:016x}", law.draw(&stream, index).to_bits())).collect();
        assert_eq!(got.join(" "), bits, "{text}");
    }
}
