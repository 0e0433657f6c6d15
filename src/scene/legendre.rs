//! Orthonormal Legendre polynomials on [-1, 1]: values, derivatives, Taylor rows.
//!
//! In: u in [-1, 1] (values stay finite outside it, but grow like u^n). Out: p_0 ... p_n, where p_i = sqrt(2 i + 1) P_i, so that
//! the mean of p_i p_j over the interval is 1 for i = j and 0 else. Then the mean square of a sum is the sum of its squared
//! coefficients, and a least-squares design matrix has columns of equal length.
//! Source: DLMF 18.9 (three-term recurrence).

/// The highest degree a ground may have.
pub(crate) const MAX_DEGREE: usize = 12;

/// One value per degree 0 ..= MAX_DEGREE.
pub(super) type Row = [f64; MAX_DEGREE + 1];

/// sqrt(2 i + 1).
const NORM: Row = [
    1.0,
    1.732_050_807_568_877_2,
    2.236_067_977_499_79,
    2.645_751_311_064_590_7,
    3.0,
    3.316_624_790_355_4,
    3.605_551_275_463_989,
    3.872_983_346_207_417,
    4.123_105_625_617_661,
    4.358_898_943_540_674,
    4.582_575_694_955_84,
    4.795_831_523_312_719,
    5.0,
];

/// (2 i + 1) / (i + 1) and i / (i + 1): P_{i+1} = a_i u P_i - b_i P_{i-1}.
const RECURRENCE: [(f64, f64); MAX_DEGREE] = {
    let mut table = [(0.0, 0.0); MAX_DEGREE];
    let mut i = 0;
    while i < MAX_DEGREE {
        table[i] = ((2 * i + 1) as f64 / (i + 1) as f64, i as f64 / (i + 1) as f64);
        i += 1;
    }
    table
};

/// p_0 ... p_degree at u; zero above.
#[inline]
pub(super) fn values(degree: usize, u: f64) -> Row {
    let mut p = [0.0; MAX_DEGREE + 1];
    p[0] = 1.0;
    for i in 0..degree {
        let (a, b) = RECURRENCE[i];
        p[i + 1] = a * u * p[i] - if i > 0 { b * p[i - 1] } else { 0.0 };
    }
    for (value, norm) in p.iter_mut().zip(NORM) {
        *value *= norm;
    }
    p
}

/// [`values`] at several places, bit for bit, for degrees below `ROWS`: one row a degree.
#[inline(always)]
pub(super) fn values_of<const ROWS: usize, const N: usize>(degree: usize, u: &[f64; N]) -> [[f64; N]; ROWS] {
    let mut p = [[0.0; N]; ROWS];
    p[0] = [1.0; N];
    for i in 0..degree {
        let (a, b) = RECURRENCE[i];
        let (p0, p1) = (p[i], if i > 0 { p[i - 1] } else { [0.0; N] });
        for l in 0..N {
            p[i + 1][l] = a * u[l] * p0[l] - b * p1[l];
        }
    }
    for (row, norm) in p.iter_mut().zip(NORM) {
        for value in row {
            *value *= norm;
        }
    }
    p
}

/// p_i and its first two derivatives at u.
#[inline]
pub(super) fn derivatives(degree: usize, u: f64) -> [Row; 3] {
    let [mut p, mut d, mut dd] = [[0.0; MAX_DEGREE + 1]; 3];
    p[0] = 1.0;
    for i in 0..degree {
        let (a, b) = RECURRENCE[i];
        let (p1, d1, dd1) = if i > 0 { (p[i - 1], d[i - 1], dd[i - 1]) } else { (0.0, 0.0, 0.0) };
        p[i + 1] = a * u * p[i] - b * p1;
        d[i + 1] = a * (p[i] + u * d[i]) - b * d1;
        dd[i + 1] = a * (2.0 * d[i] + u * dd[i]) - b * dd1;
    }
    for i in 0..=degree {
        p[i] *= NORM[i];
        d[i] *= NORM[i];
        dd[i] *= NORM[i];
    }
    [p, d, dd]
}

/// p_i and its first derivative at several places, degree by degree: the bits of [`derivatives`].
pub(super) struct Slopes<const N: usize> {
    degree: usize,
    /// P_i and its derivative, and those of the degree before.
    value: [f64; N],
    value1: [f64; N],
    slope: [f64; N],
    slope1: [f64; N],
}

impl<const N: usize> Slopes<N> {
    /// At degree 0.
    #[inline(always)]
    pub(super) fn new() -> Slopes<N> {
        Slopes { degree: 0, value: [1.0; N], value1: [0.0; N], slope: [0.0; N], slope1: [0.0; N] }
    }

    /// The value and the derivative of this degree.
    #[inline(always)]
    pub(super) fn get(&self) -> [[f64; N]; 2] {
        let norm = NORM[self.degree];
        [self.value.map(|value| value * norm), self.slope.map(|slope| slope * norm)]
    }

    /// On to the next degree, at the places `u`.
    #[inline(always)]
    pub(super) fn step(&mut self, u: &[f64; N]) {
        let (a, b) = RECURRENCE[self.degree];
        let (value1, slope1) = (self.value, self.slope);
        for l in 0..N {
            self.value[l] = a * u[l] * value1[l] - b * self.value1[l];
        }
        for l in 0..N {
            self.slope[l] = a * (value1[l] + u[l] * slope1[l]) - b * self.slope1[l];
        }
        (self.value1, self.slope1) = (value1, slope1);
        self.degree += 1;
    }
}

/// Row i holds the coefficients of p_i(u + h) in powers of h: `rows[i][k]` belongs to h^k.
pub(super) fn taylor_rows(degree: usize, u: f64) -> [Row; MAX_DEGREE + 1] {
    let mut rows = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    rows[0][0] = 1.0;
    for i in 0..degree {
        let (a, b) = RECURRENCE[i];
        for k in 0..=i + 1 {
            let shifted = if k > 0 { rows[i][k - 1] } else { 0.0 };
            let before = if i > 0 { rows[i - 1][k] } else { 0.0 };
            rows[i + 1][k] = a * (u * rows[i][k] + shifted) - b * before;
        }
    }
    for (row, norm) in rows.iter_mut().zip(NORM) {
        for value in row {
            *value *= norm;
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_norms_are_the_square_roots_of_odd_numbers() {
        for (i, norm) in NORM.iter().enumerate() {
            assert_eq!(*norm, ((2 * i + 1) as f64).sqrt());
        }
    }

    #[test]
    fn exact_low_degrees_match_their_closed_forms() {
        for u in [-1.0, -0.3, 0.0, 0.7, 1.0] {
            let [p, d, dd] = derivatives(3, u);
            let p3 = (5.0 * u * u * u - 3.0 * u) / 2.0 * NORM[3];
            assert!((p[3] - p3).abs() < 1e-15 * 8.0 && (values(3, u)[3] - p3).abs() < 1e-15 * 8.0);
            assert!((d[3] - (15.0 * u * u - 3.0) / 2.0 * NORM[3]).abs() < 1e-14);
            assert!((dd[3] - 15.0 * u * NORM[3]).abs() < 1e-14 * 5.0);
        }
    }

    #[test]
    fn equal_taylor_rows_give_the_values_elsewhere() {
        let rows = taylor_rows(MAX_DEGREE, 0.4);
        for h in [-1.4, -0.2, 0.05, 0.6] {
            let direct = values(MAX_DEGREE, 0.4 + h);
            for i in 0..=MAX_DEGREE {
                let shifted = rows[i].iter().rev().fold(0.0, |sum, c| sum * h + c);
                // Rounding of a Horner sum: 2 n units in the last place of the sum of the terms' sizes (1e7 at degree 12).
                let sizes = rows[i].iter().rev().fold(0.0, |sum, c| sum * h.abs() + c.abs());
                let rounding = 26.0 * f64::EPSILON * sizes;
                assert!((shifted - direct[i]).abs() <= rounding, "degree {i}, h {h}: {shifted} {}", direct[i]);
            }
        }
    }
}
