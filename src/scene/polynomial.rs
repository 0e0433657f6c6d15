//! The fitted ground: z = sum of c_ij p_i(u) p_j(v), i + j <= degree.
//!
//! In: world x, y in metres. Out: height, gradient, Hessian, and the Taylor coefficients about a point, which casting
//! works in. Basis: orthonormal Legendre (`legendre.rs`) on the fitted square, u = (x - centre) / half; a monomial basis in
//! metres would lose 17 digits at degree 12. Meant for the yard only, the inner 1/1.2 of the fitted square: a polynomial
//! explodes outside.

use super::legendre::{self, MAX_DEGREE, Slopes};
use crate::geometry::DVec2;
use crate::wide::LANES;

/// The fitted square over the yard: edges of a least-squares polynomial run wild, so the yard keeps off them.
pub const FIT_MARGIN: f64 = 1.2;

/// z = sum of c_ij p_i(u) p_j(v), i + j <= degree, with p_i = sqrt(2 i + 1) P_i: Legendre polynomials whose mean square over
/// [-1, 1] is one.
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    pub degree: usize,
    /// Centre of the fitted square, world.
    pub centre_m: DVec2,
    /// Half the side of the fitted square (1.2 times the yard): u = (x - centre) / half.
    pub half_m: f64,
    /// Coefficients ordered by i (degree in x), then j: (0,0), (0,1), ... (0,n), (1,0), ...
    pub coefficients: Vec<f64>,
}

/// How many coefficients a total degree has.
pub fn term_count(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// The pairs (i, j), i + j <= degree, in the order of the coefficients.
pub fn terms(degree: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..=degree).flat_map(move |i| (0..=degree - i).map(move |j| (i, j)))
}

impl Polynomial {
    /// A polynomial on the yard [0, extent]^2.
    ///
    /// # Panics
    /// Where the degree is above 12 or the number of coefficients does not fit it.
    pub fn new(extent_m: f64, degree: usize, coefficients: Vec<f64>) -> Polynomial {
        assert!(degree <= MAX_DEGREE && coefficients.len() == term_count(degree), "degree and coefficients differ");
        let centre_m = DVec2::splat(0.5 * extent_m);
        Polynomial { degree, centre_m, half_m: 0.5 * FIT_MARGIN * extent_m, coefficients }
    }

    /// Height 0 everywhere.
    pub fn flat(extent_m: f64) -> Polynomial {
        Polynomial::new(extent_m, 0, vec![0.0])
    }

    /// The plane z = height at the yard's corner + slope . (x, y).
    pub fn plane(extent_m: f64, corner_height_m: f64, slope: DVec2) -> Polynomial {
        let unit = 0.5 * FIT_MARGIN * extent_m / 3.0_f64.sqrt();
        let middle = corner_height_m + 0.5 * extent_m * (slope.x + slope.y);
        Polynomial::new(extent_m, 1, vec![middle, slope.y * unit, slope.x * unit])
    }

    /// (u, v) of a world point.
    #[inline]
    fn local(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        ((x_m - self.centre_m.x) / self.half_m, (y_m - self.centre_m.y) / self.half_m)
    }

    /// Height at a world point.
    #[inline]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let (u, v) = self.local(x_m, y_m);
        let (p, q) = (legendre::values(self.degree, u), legendre::values(self.degree, v));
        let mut rest = self.coefficients.as_slice();
        let mut height = 0.0;
        for (i, &pi) in p.iter().enumerate().take(self.degree + 1) {
            let (row, next) = rest.split_at(self.degree + 1 - i);
            height += pi * dot(row, &q);
            rest = next;
        }
        height
    }

    /// [`Self::height_m`] at the nodes of a square grid, row by row from the south, bit for bit: what hangs on a row or on a column alone is
    /// worked out once.
    pub(super) fn heights_on_grid(&self, nodes_m: &[f64]) -> Vec<f64> {
        let nodes = nodes_m.len();
        // By degree, then by column.
        let mut along_x = vec![0.0; (self.degree + 1) * nodes];
        for (col, &x_m) in nodes_m.iter().enumerate() {
            let p = legendre::values(self.degree, self.local(x_m, 0.0).0);
            along_x.iter_mut().skip(col).step_by(nodes).zip(p).for_each(|(value, p)| *value = p);
        }
        let mut heights_m = vec![0.0; nodes * nodes];
        for (heights_m, &y_m) in heights_m.chunks_exact_mut(nodes).zip(nodes_m) {
            let q = legendre::values(self.degree, self.local(0.0, y_m).1);
            let mut rest = self.coefficients.as_slice();
            for (i, p) in along_x.chunks_exact(nodes).enumerate() {
                let (row, next) = rest.split_at(self.degree + 1 - i);
                let along_y = dot(row, &q);
                heights_m.iter_mut().zip(p).for_each(|(height, p)| *height += p * along_y);
                rest = next;
            }
        }
        heights_m
    }

    /// [`Self::height_m`] at several world points, bit for bit.
    ///
    /// Inlined, so that it takes on the instruction set of its caller (see [`crate::wide`]).
    #[inline(always)]
    pub(crate) fn heights_m<const N: usize>(&self, x_m: &[f64; N], y_m: &[f64; N]) -> [f64; N] {
        // Memory for what the degree needs, as for heights and gradients below.
        if self.degree <= 6 {
            self.heights_below::<7, N>(x_m, y_m)
        } else {
            self.heights_below::<{ MAX_DEGREE + 1 }, N>(x_m, y_m)
        }
    }

    /// For degrees below `ROWS`.
    #[inline(always)]
    fn heights_below<const ROWS: usize, const N: usize>(&self, x_m: &[f64; N], y_m: &[f64; N]) -> [f64; N] {
        let Polynomial { degree, centre_m, half_m, ref coefficients } = *self;
        let p = legendre::values_of::<ROWS, N>(degree, &x_m.map(|x| (x - centre_m.x) / half_m));
        let q = legendre::values_of::<ROWS, N>(degree, &y_m.map(|y| (y - centre_m.y) / half_m));
        let mut rest = coefficients.as_slice();
        let mut height = [0.0; N];
        for (i, p) in p.iter().enumerate().take(degree + 1) {
            let (row, next) = rest.split_at(degree + 1 - i);
            let value = weighted(row, &q);
            for l in 0..N {
                height[l] += p[l] * value[l];
            }
            rest = next;
        }
        height
    }

    /// Slope along x and y at a world point.
    #[inline]
    pub fn gradient(&self, x_m: f64, y_m: f64) -> DVec2 {
        self.height_and_gradient(x_m, y_m).1
    }

    /// Height and gradient together, for little more than the price of one.
    #[inline]
    pub fn height_and_gradient(&self, x_m: f64, y_m: f64) -> (f64, DVec2) {
        let (u, v) = self.local(x_m, y_m);
        let [p, dp, _] = legendre::derivatives(self.degree, u);
        let [q, dq, _] = legendre::derivatives(self.degree, v);
        let mut rest = self.coefficients.as_slice();
        let (mut height, mut gradient) = (0.0, DVec2::ZERO);
        for i in 0..=self.degree {
            let (row, next) = rest.split_at(self.degree + 1 - i);
            let along_y = dot(row, &q);
            height += p[i] * along_y;
            gradient += DVec2::new(dp[i] * along_y, p[i] * dot(row, &dq));
            rest = next;
        }
        (height, gradient / self.half_m)
    }

    /// [`Self::height_and_gradient`] at several world points, bit for bit: heights, slopes along x, slopes along y.
    ///
    /// Inlined, so that it takes on the instruction set of its caller (see [`crate::wide`]).
    #[inline(always)]
    pub(crate) fn heights_and_gradients(&self, x_m: &[f64; LANES], y_m: &[f64; LANES]) -> [[f64; LANES]; 3] {
        // Memory for what the degree needs: to clear that for degree 12 would take as long as the sums of degree 5.
        if self.degree <= 6 { self.by_lanes::<7>(x_m, y_m) } else { self.by_lanes::<{ MAX_DEGREE + 1 }>(x_m, y_m) }
    }

    /// For degrees below `ROWS`. Each sum stands in a loop of its own, so that its lanes stay together.
    #[inline(always)]
    fn by_lanes<const ROWS: usize>(&self, x_m: &[f64; LANES], y_m: &[f64; LANES]) -> [[f64; LANES]; 3] {
        let Polynomial { degree, centre_m, half_m, ref coefficients } = *self;
        let u = x_m.map(|x| (x - centre_m.x) / half_m);
        let v = y_m.map(|y| (y - centre_m.y) / half_m);
        let [mut q, mut dq] = [[[0.0; LANES]; ROWS]; 2];
        let mut along_v = Slopes::new();
        [q[0], dq[0]] = along_v.get();
        for j in 1..=degree {
            along_v.step(&v);
            [q[j], dq[j]] = along_v.get();
        }
        let mut along_u = Slopes::new();
        let mut rest = coefficients.as_slice();
        let [mut height, mut along_x, mut along_y] = [[0.0; LANES]; 3];
        for i in 0..=degree {
            if i > 0 {
                along_u.step(&u);
            }
            let (row, next) = rest.split_at(degree + 1 - i);
            let ([p, dp], value, slope) = (along_u.get(), weighted(row, &q), weighted(row, &dq));
            for l in 0..LANES {
                height[l] += p[l] * value[l];
            }
            for l in 0..LANES {
                along_x[l] += dp[l] * value[l];
            }
            for l in 0..LANES {
                along_y[l] += p[l] * slope[l];
            }
            rest = next;
        }
        [height, along_x.map(|slope| slope / half_m), along_y.map(|slope| slope / half_m)]
    }

    /// Second derivatives (xx, xy, yy) at a world point, per metre.
    pub(crate) fn hessian(&self, x_m: f64, y_m: f64) -> [f64; 3] {
        let (u, v) = self.local(x_m, y_m);
        let [p, dp, ddp] = legendre::derivatives(self.degree, u);
        let [q, dq, ddq] = legendre::derivatives(self.degree, v);
        let mut rest = self.coefficients.as_slice();
        let mut hessian = [0.0; 3];
        for i in 0..=self.degree {
            let (row, next) = rest.split_at(self.degree + 1 - i);
            hessian[0] += ddp[i] * dot(row, &q);
            hessian[1] += dp[i] * dot(row, &dq);
            hessian[2] += p[i] * dot(row, &ddq);
            rest = next;
        }
        hessian.map(|h| h / (self.half_m * self.half_m))
    }

    /// Coefficients t_kl of z(x + dx, y + dy) = sum of t_kl dx^k dy^l, metres, in the order of `terms(degree)`.
    pub(crate) fn taylor_at(&self, x_m: f64, y_m: f64) -> Vec<f64> {
        let mut out = vec![0.0; self.coefficients.len()];
        self.taylor_into(x_m, y_m, &mut out);
        out
    }

    /// `taylor_at` into a slice of `term_count(degree)` places.
    pub(crate) fn taylor_into(&self, x_m: f64, y_m: f64, out: &mut [f64]) {
        let n = self.degree;
        let (u, v) = self.local(x_m, y_m);
        let (a, b) = (legendre::taylor_rows(n, u), legendre::taylor_rows(n, v));
        // Along y first: rows[i][l] = sum over j of c_ij b_j[l].
        let mut rows = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
        for ((i, j), c) in terms(n).zip(&self.coefficients) {
            for l in 0..=j {
                rows[i][l] += c * b[j][l];
            }
        }
        let mut scale = [1.0; MAX_DEGREE + 1];
        for k in 1..=n {
            scale[k] = scale[k - 1] / self.half_m;
        }
        for ((k, l), value) in terms(n).zip(out) {
            let sum: f64 = (k..=n - l).map(|i| a[i][k] * rows[i][l]).sum();
            *value = sum * scale[k + l];
        }
    }

    /// The yard: whether the point has ground (the border has).
    pub fn contains(&self, x_m: f64, y_m: f64) -> bool {
        let reach = self.half_m / FIT_MARGIN * (1.0 + 4.0 * f64::EPSILON);
        (x_m - self.centre_m.x).abs() <= reach && (y_m - self.centre_m.y).abs() <= reach
    }
}

/// The sum of rows by their coefficients; as a sum of floats does, it begins at -0.
#[inline(always)]
fn weighted<const N: usize>(coefficients: &[f64], rows: &[[f64; N]]) -> [f64; N] {
    let mut sum = [-0.0; N];
    for (c, row) in coefficients.iter().zip(rows) {
        for l in 0..N {
            sum[l] += c * row[l];
        }
    }
    sum
}

#[inline]
fn dot(row: &[f64], basis: &legendre::Row) -> f64 {
    row.iter().zip(basis).map(|(c, q)| c * q).sum()
}

#[cfg(test)]
pub(super) mod tests;
