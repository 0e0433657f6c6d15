//! A fitted ground -> its steepest slope anywhere in the yard, certified.
//!
//! In: [`Polynomial`]. Out: rise over run, never below the truth and at most 0.2 % above it. No sampling can promise that a
//! steep spot does not lie between the samples; so the yard is split into squares, each bounded by its Taylor series
//! (branch and bound). With g and H the gradient and Hessian at a square's centre, r its circumradius and t_m the
//! homogeneous part of degree m,
//!
//! |grad z| <= sqrt(|g|^2 + 2 r |H g| + r^2 |H|^2) + sum over m >= 3 of m |t_m| r^(m-1).
//!
//! |t_m| is the Bombieri norm, which bounds t_m and (Banach 1938: in a Euclidean space a symmetric form and its
//! polynomial have the same norm) its derivative on the unit circle too.

use super::legendre::MAX_DEGREE;
use super::polynomial::{FIT_MARGIN, Polynomial, term_count, terms};
use crate::geometry::DVec2;

/// How far above the truth the answer may be, as a share of it.
const TOLERANCE: f64 = 2e-3;
/// Samples along a side that tell steep squares from flat ones early.
const SAMPLES: usize = 16;
/// Squares along a side to begin with, and how often they are halved at most (then the bound itself is the answer).
const SQUARES: usize = 4;
const HALVINGS: u32 = 24;

impl Polynomial {
    /// The steepest slope in the yard as rise over run: a bound from above, at most 0.2 % too high.
    pub(crate) fn max_slope(&self) -> f64 {
        let yard_m = 2.0 * self.half_m / FIT_MARGIN;
        let corner = self.centre_m - DVec2::splat(0.5 * yard_m);
        let mut steepest = 0.0_f64;
        for row in 0..=SAMPLES {
            for col in 0..=SAMPLES {
                let place = corner + DVec2::new(col as f64, row as f64) * (yard_m / SAMPLES as f64);
                steepest = steepest.max(self.gradient(place.x, place.y).length());
            }
        }
        let half_m = 0.5 * yard_m / SQUARES as f64;
        let square =
            |k: usize| corner + DVec2::new((2 * (k % SQUARES) + 1) as f64, (2 * (k / SQUARES) + 1) as f64) * half_m;
        let mut open: Vec<(DVec2, f64, u32)> = (0..SQUARES * SQUARES).map(|k| (square(k), half_m, 0)).collect();
        let mut unresolved = 0.0_f64;
        while let Some((centre, half_m, halvings)) = open.pop() {
            let (here, bound) = self.slope_bound(centre, half_m * std::f64::consts::SQRT_2);
            steepest = steepest.max(here);
            if bound <= steepest * (1.0 + TOLERANCE) {
                continue;
            }
            if halvings == HALVINGS {
                unresolved = unresolved.max(bound);
                continue;
            }
            let quarter = 0.5 * half_m;
            for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
                open.push((centre + DVec2::new(sx, sy) * quarter, quarter, halvings + 1));
            }
        }
        unresolved.max(steepest * (1.0 + TOLERANCE))
    }

    /// The slope at a point, and a bound on it within `radius_m`.
    fn slope_bound(&self, centre: DVec2, radius_m: f64) -> (f64, f64) {
        let mut taylor = [0.0; (MAX_DEGREE + 1) * (MAX_DEGREE + 2) / 2];
        let taylor = &mut taylor[..term_count(self.degree)];
        self.taylor_into(centre.x, centre.y, taylor);
        let (mut g, mut h) = (DVec2::ZERO, [0.0; 3]);
        let mut squares = [0.0; MAX_DEGREE + 1];
        for ((k, l), &t) in terms(self.degree).zip(&*taylor) {
            match (k, l) {
                (1, 0) => g.x = t,
                (0, 1) => g.y = t,
                (2, 0) => h[0] = 2.0 * t,
                (1, 1) => h[1] = t,
                (0, 2) => h[2] = 2.0 * t,
                _ => squares[k + l] += t * t / binomial(k + l, k),
            }
        }
        let turned = DVec2::new(h[0] * g.x + h[1] * g.y, h[1] * g.x + h[2] * g.y);
        let bend = h[0] * h[0] + 2.0 * h[1] * h[1] + h[2] * h[2];
        let mut bound = (g.length_squared() + 2.0 * radius_m * turned.length() + radius_m * radius_m * bend).sqrt();
        let mut power = radius_m;
        for (m, square) in squares.iter().enumerate().skip(3) {
            power *= radius_m;
            bound += m as f64 * square.sqrt() * power;
        }
        (g.length(), bound)
    }
}

fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::super::polynomial::tests::sample;
    use super::*;

    #[test]
    fn exact_slopes_of_planes_and_bowls() {
        let plane = Polynomial::plane(20.0, 0.0, DVec2::new(0.3, 0.4));
        assert!((0.5..0.5 * 1.0021).contains(&plane.max_slope()));
        assert_eq!(Polynomial::flat(20.0).max_slope(), 0.0);
        // z = (x - 10)^2 / 50 + (y - 10)^2 / 50: steepest in the corners, 0.4 sqrt(2).
        let bowl =
            Polynomial::fit_surface(20.0, 2, 64, |x, y| ((x - 10.0) * (x - 10.0) + (y - 10.0) * (y - 10.0)) / 50.0);
        let slope = bowl.max_slope() / (0.4 * 2.0_f64.sqrt());
        assert!((1.0 - 1e-12..1.0021).contains(&slope), "{slope}");
    }

    #[test]
    fn law_no_sample_is_steeper_than_the_bound() {
        for degree in [2, 5, 8, 12] {
            let poly = sample(degree);
            let bound = poly.max_slope();
            let mut steepest = 0.0_f64;
            for row in 0..=500 {
                for col in 0..=500 {
                    steepest = steepest.max(poly.gradient(f64::from(col) * 0.04, f64::from(row) * 0.04).length());
                }
            }
            // Samples 4 cm apart miss the true maximum by a few 1e-5 of it at most.
            assert!(steepest <= bound && bound <= steepest * 1.003, "degree {degree}: {steepest} {bound}");
        }
    }

    #[test]
    fn exact_binomials_are_those_of_pascals_triangle() {
        let row = |n: usize| (0..=n).map(|k| binomial(n, k)).collect::<Vec<f64>>();
        assert_eq!(row(0), [1.0]);
        assert_eq!(row(5), [1.0, 5.0, 10.0, 10.0, 5.0, 1.0]);
        for n in 1..MAX_DEGREE {
            assert!((1..=n).all(|k| binomial(n + 1, k) == binomial(n, k) + binomial(n, k - 1)), "{n}");
        }
    }
}
