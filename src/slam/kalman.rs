//! A belief and one measurement of three numbers -> the belief after it.
//!
//! In: mean and covariance, the measurement's slopes, its innovation and the factor of its covariance. Out: the same mean and covariance,
//! later. Joseph form: stays positive semi-definite under rounding. All by rows, so that no product asks for a column.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use super::matrix::{Matrix, Vector, product, product_across, solve, sum, symmetrise};

/// Updates a belief by a measurement of slopes `h` and of noise `noise`. `pull` is H P, and `factor` that of H P H' + the noise.
#[inline(always)]
pub(super) fn update<const N: usize>(
    (mean, covariance): (&mut Vector<N>, &mut Matrix<N, N>),
    h: &Matrix<3, N>,
    pull: &Matrix<3, N>,
    factor: &Matrix<3, 3>,
    innovation: &Vector<3>,
    noise: &Matrix<3, 3>,
) {
    // The transpose of K.
    let gain = solve(factor, pull);
    let mut by = [-0.0; N];
    for k in 0..3 {
        for i in 0..N {
            by[i] += gain[k][i] * innovation[k];
        }
    }
    for i in 0..N {
        mean[i] += by[i];
    }
    *covariance = joseph(covariance, &gain, h, noise);
}

/// (I - K H) P (I - K H)' + K Q K', symmetric to the last bit, of the transpose of K.
#[inline(always)]
fn joseph<const N: usize>(p: &Matrix<N, N>, gain: &Matrix<3, N>, h: &Matrix<3, N>, q: &Matrix<3, 3>) -> Matrix<N, N> {
    let (mut rest, mut across) = (product_across(gain, h), product_across(h, gain));
    for r in 0..N {
        for c in 0..N {
            let unit = f64::from(u8::from(r == c));
            (rest[r][c], across[r][c]) = (unit - rest[r][c], unit - across[r][c]);
        }
    }
    let mut out = sum(&product(&product(&rest, p), &across), &product(&product_across(gain, q), gain));
    symmetrise(&mut out);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slam::matrix::{apply, cholesky, diagonal, transpose};

    #[test]
    fn equal_update_and_the_textbooks_with_a_gain_of_columns() {
        let p: Matrix<4, 4> =
            [[0.9, 0.1, 0.2, 0.0], [0.1, 0.5, -0.1, 0.1], [0.2, -0.1, 0.7, 0.3], [0.0, 0.1, 0.3, 0.6]];
        let h: Matrix<3, 4> = [[1.0, 0.5, 0.0, -0.2], [0.3, -1.0, 0.4, 0.0], [0.0, 0.2, 0.7, 1.1]];
        let (noise, innovation) = (diagonal(&[0.1, 0.2, 0.3]), [0.4, -0.3, 0.2]);
        let pull = product(&h, &p);
        let factor = cholesky(&sum(&product(&pull, &transpose(&h)), &noise)).expect("positive definite");
        let (mut mean, mut covariance) = ([1.0, -2.0, 3.0, 0.5], p);
        update((&mut mean, &mut covariance), &h, &pull, &factor, &innovation, &noise);
        // K = P H' S^-1, x + K v and P - K H P.
        let gain = transpose(&solve(&factor, &transpose(&product(&p, &transpose(&h)))));
        let moved = apply(&gain, &innovation);
        let taken = product(&gain, &pull);
        for r in 0..4 {
            assert!((mean[r] - ([1.0, -2.0, 3.0, 0.5][r] + moved[r])).abs() < 1e-14);
            for c in 0..4 {
                assert!((covariance[r][c] - (p[r][c] - taken[r][c])).abs() < 1e-14, "({r}, {c})");
                assert_eq!(covariance[r][c].to_bits(), covariance[c][r].to_bits());
            }
        }
    }
}
