//! Rock abundance -> how many rocks, and how large.
//!
//! In: k, the share of the ground that rocks cover. Out: the number of rocks per square metre above a diameter, and its
//! inverse. Source: Golombek & Rapp 1997, with the exponential fit of 2003: rocks of diameter D and more cover
//! F_k(D) = k exp(-q D), q = 1.79 + 0.152 / k, D in metres. A rock covers pi D^2 / 4, so
//! n(D) = -(4 / (pi D^2)) dF/dD = 4 k q / (pi D^2) exp(-q D), and
//! N(>D) = (4 k q / pi) (exp(-q D) / D - q E1(q D)).

use std::f64::consts::PI;

use crate::math;

/// Euler's constant.
const EULER_GAMMA: f64 = 0.577_215_664_901_532_9;

/// The size-frequency law of one abundance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Golombek {
    abundance: f64,
    /// q, per metre.
    decay_per_m: f64,
}

impl Golombek {
    /// The law of a share k > 0 of covered ground.
    pub(crate) fn of(abundance: f64) -> Golombek {
        Golombek { abundance, decay_per_m: 1.79 + 0.152 / abundance }
    }

    /// Rocks per square metre with a diameter above the given one.
    pub(crate) fn rocks_per_m2_above(&self, diameter_m: f64) -> f64 {
        let x = self.decay_per_m * diameter_m;
        let scale = 4.0 * self.abundance * self.decay_per_m / PI;
        scale * (math::exp(-x) / diameter_m - self.decay_per_m * exponential_integral(x)).max(0.0)
    }

    /// The diameter that a share `u` in (0, 1) of the rocks between two diameters exceeds.
    pub(crate) fn diameter_m(&self, u: f64, min_m: f64, max_m: f64) -> f64 {
        let (most, least) = (self.rocks_per_m2_above(min_m), self.rocks_per_m2_above(max_m));
        let wanted = least + u * (most - least);
        // Newton in ln D, held inside a bracket that halves where a step leaves it.
        let (mut low, mut high) = (math::ln(min_m), math::ln(max_m));
        let mut at = low;
        for _ in 0..100 {
            let diameter_m = math::exp(at);
            let excess = self.rocks_per_m2_above(diameter_m) - wanted;
            if excess > 0.0 {
                low = at
            } else {
                high = at
            }
            let slope = -4.0 * self.abundance * self.decay_per_m / (PI * diameter_m)
                * math::exp(-self.decay_per_m * diameter_m);
            let newton = at - excess / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - at).abs() < 1e-13 {
                break;
            }
            at = next;
        }
        math::exp(at).clamp(min_m, max_m)
    }
}

/// E1(x) for x > 0: the series up to 1, the continued fraction above (DLMF 6.6.2, 6.9.1; modified Lentz).
fn exponential_integral(x: f64) -> f64 {
    if x <= 1.0 {
        let (mut sum, mut power) = (-EULER_GAMMA - math::ln(x), -1.0);
        for k in 1..40 {
            let k = f64::from(k);
            power *= -x / k;
            sum += power / k;
            if power.abs() < 1e-18 {
                break;
            }
        }
        return sum;
    }
    let mut b = x + 1.0;
    let mut c = f64::INFINITY;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for k in 1..200 {
        let a = -f64::from(k * k);
        b += 2.0;
        d = 1.0 / (a * d + b);
        c = b + a / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-16 {
            break;
        }
    }
    fraction * math::exp(-x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_tabled_exponential_integrals() {
        // Abramowitz & Stegun, tables 5.1 and 5.2.
        for (x, e1) in [
            (0.1, 1.822_923_958),
            (0.5, 0.559_773_595),
            (1.0, 0.219_383_934),
            (2.0, 0.048_900_511),
            (10.0, 4.156_968_930e-6),
        ] {
            assert!((exponential_integral(x) / e1 - 1.0).abs() < 2e-8, "{x}: {}", exponential_integral(x));
        }
        let (below, above) = (exponential_integral(1.0), exponential_integral(1.0 + 1e-15));
        assert!((below / above - 1.0).abs() < 1e-14);
    }

    #[test]
    fn exact_counts_of_the_independent_table() {
        // Rocks per 100 m^2 with D >= 0.2, 0.3, 0.5, 1.0 m, computed apart from this code.
        let table = [
            (0.03, ["11.4", "3.0", "0.33", "0.00"]),
            (0.05, ["24", "8", "1.4", "0.04"]),
            (0.069, ["35", "13", "2.7", "0.11"]),
            (0.10, ["53", "21", "5", "0.31"]),
            (0.176, ["92", "40", "11", "0.97"]),
            (0.19, ["99", "43", "12", "1.1"]),
            (0.30, ["154", "70", "21", "2.2"]),
        ];
        for (k, counts) in table {
            for (diameter_m, printed) in [0.2, 0.3, 0.5, 1.0].into_iter().zip(counts) {
                let got = 100.0 * Golombek::of(k).rocks_per_m2_above(diameter_m);
                let decimals = printed.split('.').nth(1).map_or(0, str::len);
                let last_digit = [1.0, 0.1, 0.01][decimals];
                let count: f64 = printed.parse().unwrap();
                // Within one unit of the last printed digit.
                assert!((got - count).abs() < last_digit, "k {k}, D {diameter_m}: {got} against {printed}");
            }
        }
    }

    #[test]
    fn equal_counts_and_numeric_integration() {
        // Simpson's rule in ln D over n(D) D, out to where exp(-q D) is nothing.
        let law = Golombek::of(0.1);
        let (a, b, parts) = (math::ln(0.1), math::ln(20.0), 20_000);
        let step = (b - a) / f64::from(parts);
        let density = |t: f64| {
            let d = math::exp(t);
            4.0 * 0.1 * law.decay_per_m / (PI * d) * math::exp(-law.decay_per_m * d)
        };
        let weight = |k: i32| if k == 0 || k == parts { 1.0 } else { 2.0 + 2.0 * f64::from(k % 2) };
        let sum: f64 = (0..=parts).map(|k| weight(k) * density(a + f64::from(k) * step)).sum::<f64>() * step / 3.0;
        assert!((law.rocks_per_m2_above(0.1) / sum - 1.0).abs() < 1e-10);
    }

    #[test]
    fn equal_inverse_undoes_the_count() {
        for k in [1e-4, 0.02, 0.19, 0.6] {
            let law = Golombek::of(k);
            let (most, least) = (law.rocks_per_m2_above(0.05), law.rocks_per_m2_above(3.0));
            for u in [1e-12, 0.01, 0.3, 0.99, 1.0 - 1e-12] {
                let diameter_m = law.diameter_m(u, 0.05, 3.0);
                assert!((0.05..=3.0).contains(&diameter_m));
                let share = (law.rocks_per_m2_above(diameter_m) - least) / (most - least);
                assert!((share - u).abs() < 1e-10, "k {k}, u {u}: {share}");
            }
        }
    }
}
