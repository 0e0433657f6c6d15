//! A polynomial ground along a ray: power series in the distance, and the first crossing of a series.
//!
//! In: Legendre coefficients of the ground ([`Polynomial`]), a point and a direction. Out: the height along the ray as a
//! power series about the point, in metres. The basis is expanded by its own three-term recurrence on truncated series,
//! so that no monomial far from its centre is ever formed (the Legendre basis is well conditioned, monomials are not).
//!
//! The first crossing is found by curvature-bounded Newton steps: where g'' >= -M on an interval, g lies above the
//! parabola g + g' s - M s^2 / 2, so a step to the parabola's first root cannot pass a root of g. M is the largest
//! Bernstein coefficient of -g'' on the interval, an upper bound of -g'' by the convex-hull property: a certificate, not
//! a sample.

use crate::scene::Polynomial;
use crate::scene::polynomial::{term_count, terms};

pub(super) use crate::scene::MAX_DEGREE;
/// Coefficients of a power series, lowest first.
pub(super) type Series = [f64; MAX_DEGREE + 1];

/// Height above the ground at which a falling ray counts as having arrived: far below the promised 1e-9 m, well above the
/// rounding of g. The last step goes on from here to the root itself.
pub(super) const ARRIVAL_M: f64 = 4e-13;

/// Steps after which a ray counts as arrived.
const MOST_STEPS: u32 = 100_000;

/// Factor of the ground's Legendre polynomial of degree i on [-1, 1]: the mean of its square is 1.
pub(super) fn orthonormal(i: usize) -> f64 {
    ((2 * i + 1) as f64).sqrt()
}

/// The series of P_0 .. P_degree (classical Legendre) at `centre + slope * s`, by the recurrence
/// (i + 1) P_{i+1} = (2 i + 1) u P_i - i P_{i-1}.
fn legendre_series(degree: usize, centre: f64, slope: f64) -> [Series; MAX_DEGREE + 1] {
    let mut p = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    p[0][0] = 1.0;
    for i in 0..degree {
        let a = (2 * i + 1) as f64 / (i + 1) as f64;
        let b = i as f64 / (i + 1) as f64;
        for k in 0..=i + 1 {
            let here = if k <= i { centre * p[i][k] } else { 0.0 };
            let lower = if k > 0 { slope * p[i][k - 1] } else { 0.0 };
            let before = if i > 0 { b * p[i - 1][k] } else { 0.0 };
            p[i + 1][k] = a * (here + lower) - before;
        }
    }
    p
}

/// The ground's height along the line (x, y) + s * (dx, dy), as a series in s.
pub(super) fn along(ground: &Polynomial, x_m: f64, y_m: f64, dx: f64, dy: f64) -> Series {
    let n = ground.degree;
    let pu = legendre_series(n, (x_m - ground.centre_m.x) / ground.half_m, dx / ground.half_m);
    let pv = legendre_series(n, (y_m - ground.centre_m.y) / ground.half_m, dy / ground.half_m);
    let mut height = [0.0; MAX_DEGREE + 1];
    let mut index = 0;
    for (i, pu) in pu.iter().enumerate().take(n + 1) {
        // Q_i(s) = sum over j of c_ij P_j(v(s)); the height is the sum of P_i(u(s)) Q_i(s).
        let mut q = [0.0; MAX_DEGREE + 1];
        for (j, pv) in pv.iter().enumerate().take(n - i + 1) {
            let c = ground.coefficients[index] * orthonormal(i) * orthonormal(j);
            index += 1;
            for k in 0..=j {
                q[k] += c * pv[k];
            }
        }
        for a in 0..=i {
            for b in 0..=n - i {
                height[a + b] += pu[a] * q[b];
            }
        }
    }
    height
}

/// The Taylor coefficients of the ground about (x, y), in metres: `table[k][j]` goes with X^(k-j) Y^j.
pub(super) fn taylor(ground: &Polynomial, x_m: f64, y_m: f64) -> [Series; MAX_DEGREE + 1] {
    let mut flat = [0.0; (MAX_DEGREE + 1) * (MAX_DEGREE + 2) / 2];
    ground.taylor_into(x_m, y_m, &mut flat[..term_count(ground.degree)]);
    let mut table = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    for ((i, j), value) in terms(ground.degree).zip(flat) {
        table[i + j][j] = value;
    }
    table
}

/// The series about `s` instead of 0.
fn shift(series: &Series, degree: usize, s: f64) -> Series {
    let mut out = *series;
    for low in 0..degree {
        for k in (low..degree).rev() {
            out[k] += s * out[k + 1];
        }
    }
    out
}

/// An upper bound of -g'' on [0, width] (at least 0), from Bernstein coefficients.
fn curvature_bound(g: &Series, degree: usize, width: f64) -> f64 {
    if degree < 2 {
        return 0.0;
    }
    let m = degree - 2;
    let mut b = [0.0; MAX_DEGREE + 1];
    let (mut power, mut binomial, mut size) = (1.0, 1.0, 0.0);
    for k in 0..=m {
        let term = -((k + 1) as f64) * (k + 2) as f64 * g[k + 2] * power;
        size += term.abs();
        b[k] = term / binomial;
        power *= width;
        binomial *= (m - k) as f64 / (k + 1) as f64;
    }
    for row in 1..=m {
        for k in (row..=m).rev() {
            b[k] += b[k - 1];
        }
    }
    let bound = b[..=m].iter().fold(0.0f64, |a, &v| a.max(v));
    // The sums above round; 1e-14 of the terms' size covers it for every degree up to 12.
    bound + 1e-14 * size
}

/// First s in [from, to] at which the falling g reaches 0, for a g that is not negative at `from`.
///
/// Trust-region form: the curvature is bounded on a window ahead, and the window follows the steps. Near a tangency it
/// shrinks with them, so that a ray which skims the ground is resolved too.
pub(super) fn first_crossing(g: &Series, degree: usize, from: f64, to: f64) -> Option<f64> {
    let mut s = from;
    let mut window = to - from;
    for _ in 0..MOST_STEPS {
        if s > to {
            return None;
        }
        let here = shift(g, degree, s);
        let arrived = ARRIVAL_M + 4.0 * f64::EPSILON * g[0].abs();
        let width = window.min(to - s);
        let bound = curvature_bound(&here, degree, width);
        let step = parabola_step(here[0].max(0.0), here[1], bound);
        if here[0] <= arrived && here[1] <= 0.0 {
            let last = s + if step.is_finite() && step < 1e-3 { step } else { 0.0 };
            return Some(last.min(to));
        }
        if step >= width {
            if width >= to - s {
                return None;
            }
            s += width;
            window *= 2.0;
        } else {
            // A step below the resolution of s would stand still for ever.
            s += step.max(f64::EPSILON * (1.0 + s.abs()));
            window = window.min(8.0 * step.max(1e-12));
        }
    }
    // So many steps are only taken within rounding of the ground.
    Some(s)
}

/// Distance to the first root of g + g' s - M s^2 / 2 (infinite where it has none).
#[inline(always)]
pub(super) fn parabola_step(g: f64, slope: f64, bound: f64) -> f64 {
    let root = (slope * slope + 2.0 * bound * g).sqrt();
    // Two forms of the same root; each adds where the other cancels.
    if slope > 0.0 { (slope + root) / bound } else { 2.0 * g / (root - slope) }
}
