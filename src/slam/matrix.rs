//! Fixed-size vectors and matrices -> products, factors, solves.
//!
//! In and out: row-major arrays of f64. Own code instead of a library's: the filter needs five operations on sizes 3 and 6,
//! unrolled by the compiler, with one order of summation everywhere. Plain loops, because closures over rows are not always
//! inlined. Sums of products start at -0, as those of iterators do.

// Algebra reads by its indices.
#![allow(clippy::needless_range_loop)]

use crate::math;

/// A column of `N` numbers.
pub type Vector<const N: usize> = [f64; N];
/// `R` rows of `C` numbers.
pub type Matrix<const R: usize, const C: usize> = [[f64; C]; R];

/// a b.
#[inline(always)]
pub fn product<const R: usize, const K: usize, const C: usize>(a: &Matrix<R, K>, b: &Matrix<K, C>) -> Matrix<R, C> {
    let mut out = [[0.0; C]; R];
    for (out_row, a_row) in out.iter_mut().zip(a) {
        for (&a_rk, b_row) in a_row.iter().zip(b) {
            for (o, &b_kc) in out_row.iter_mut().zip(b_row) {
                *o += a_rk * b_kc;
            }
        }
    }
    out
}

/// a' b.
#[inline(always)]
pub(crate) fn product_across<const K: usize, const R: usize, const C: usize>(
    a: &Matrix<K, R>,
    b: &Matrix<K, C>,
) -> Matrix<R, C> {
    let mut out = [[0.0; C]; R];
    for r in 0..R {
        for k in 0..K {
            for c in 0..C {
                out[r][c] += a[k][r] * b[k][c];
            }
        }
    }
    out
}

/// The transpose.
#[inline(always)]
pub fn transpose<const R: usize, const C: usize>(a: &Matrix<R, C>) -> Matrix<C, R> {
    let mut out = [[0.0; R]; C];
    for c in 0..C {
        for r in 0..R {
            out[c][r] = a[r][c];
        }
    }
    out
}

/// a v.
#[inline(always)]
pub fn apply<const R: usize, const C: usize>(a: &Matrix<R, C>, v: &Vector<C>) -> Vector<R> {
    let mut out = [-0.0; R];
    for r in 0..R {
        for c in 0..C {
            out[r] += a[r][c] * v[c];
        }
    }
    out
}

/// a + b.
#[inline(always)]
pub fn sum<const R: usize, const C: usize>(a: &Matrix<R, C>, b: &Matrix<R, C>) -> Matrix<R, C> {
    let mut out = *a;
    for r in 0..R {
        for c in 0..C {
            out[r][c] += b[r][c];
        }
    }
    out
}

/// The matrix with `d` on its diagonal.
#[inline(always)]
pub fn diagonal<const N: usize>(d: &Vector<N>) -> Matrix<N, N> {
    let mut out = [[0.0; N]; N];
    for i in 0..N {
        out[i][i] = d[i];
    }
    out
}

/// Replaces a by (a + a') / 2.
#[inline(always)]
pub(crate) fn symmetrise<const N: usize>(a: &mut Matrix<N, N>) {
    for r in 0..N {
        for c in 0..r {
            let mean = 0.5 * (a[r][c] + a[c][r]);
            a[r][c] = mean;
            a[c][r] = mean;
        }
    }
}

/// The lower triangular L with L L' = a; `None` unless a is positive definite and finite.
#[inline(always)]
pub fn cholesky<const N: usize>(a: &Matrix<N, N>) -> Option<Matrix<N, N>> {
    let mut l = [[0.0; N]; N];
    for c in 0..N {
        let mut pivot = a[c][c];
        for k in 0..c {
            pivot -= l[c][k] * l[c][k];
        }
        if !(pivot > 0.0 && pivot < f64::INFINITY) {
            return None;
        }
        let root = pivot.sqrt();
        l[c][c] = root;
        for r in c + 1..N {
            let mut rest = a[r][c];
            for k in 0..c {
                rest -= l[r][k] * l[c][k];
            }
            l[r][c] = rest / root;
        }
    }
    Some(l)
}

/// The lower triangular L with L L' = a for a positive semi-definite a: a pivot of at most 1e-18 gives a zero column.
///
/// Covariances are singular right after a step (noise of rank 2 in six dimensions); adding jitter instead would draw noise
/// that nothing caused.
pub(crate) fn cholesky_clamped<const N: usize>(a: &Matrix<N, N>) -> Matrix<N, N> {
    let mut l = [[0.0; N]; N];
    for c in 0..N {
        let mut pivot = a[c][c];
        for k in 0..c {
            pivot -= l[c][k] * l[c][k];
        }
        if !(pivot > 1e-18 && pivot < f64::INFINITY) {
            continue;
        }
        let root = pivot.sqrt();
        l[c][c] = root;
        for r in c + 1..N {
            let mut rest = a[r][c];
            for k in 0..c {
                rest -= l[r][k] * l[c][k];
            }
            l[r][c] = rest / root;
        }
    }
    l
}

/// y with L y = b for a factor of [`cholesky_clamped`]: nought where its column is zero, for there b is nought as well.
pub(crate) fn half_solve_clamped<const N: usize>(l: &Matrix<N, N>, b: &Vector<N>) -> Vector<N> {
    let mut y = *b;
    for r in 0..N {
        for k in 0..r {
            y[r] -= l[r][k] * y[k];
        }
        y[r] = if l[r][r] > 0.0 { y[r] / l[r][r] } else { 0.0 };
    }
    y
}

/// The columns x with L L' x = b, for each column b.
#[inline(always)]
pub(crate) fn solve<const N: usize, const C: usize>(l: &Matrix<N, N>, b: &Matrix<N, C>) -> Matrix<N, C> {
    let mut x = *b;
    for r in 0..N {
        for k in 0..r {
            for c in 0..C {
                x[r][c] -= l[r][k] * x[k][c];
            }
        }
        for c in 0..C {
            x[r][c] /= l[r][r];
        }
    }
    for r in (0..N).rev() {
        for k in r + 1..N {
            for c in 0..C {
                x[r][c] -= l[k][r] * x[k][c];
            }
        }
        for c in 0..C {
            x[r][c] /= l[r][r];
        }
    }
    x
}

/// y with L y = b; its squared length is b' (L L')^-1 b.
#[inline(always)]
pub fn half_solve<const N: usize>(l: &Matrix<N, N>, b: &Vector<N>) -> Vector<N> {
    let mut y = *b;
    for r in 0..N {
        for k in 0..r {
            y[r] -= l[r][k] * y[k];
        }
        y[r] /= l[r][r];
    }
    y
}

/// ln |L L'|, with one logarithm.
#[inline(always)]
pub(crate) fn ln_determinant<const N: usize>(l: &Matrix<N, N>) -> f64 {
    let mut root = 1.0;
    for i in 0..N {
        root *= l[i][i];
    }
    2.0 * math::ln(root)
}

/// v' v.
#[inline(always)]
pub fn square<const N: usize>(v: &Vector<N>) -> f64 {
    v.iter().fold(-0.0, |sum, x| sum + x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Matrix<3, 3> = [[4.0, 2.0, 0.6], [2.0, 5.0, 1.0], [0.6, 1.0, 3.0]];

    #[test]
    fn exact_factor_determinant_and_solution_of_a_small_system() {
        let l = cholesky(&A).expect("positive definite");
        // 4 (15 - 1) - 2 (6 - 0.6) + 0.6 (2 - 3), by hand.
        assert!((math::exp(ln_determinant(&l)) - 44.6).abs() < 1e-12);
        let x = [1.0, -2.0, 0.5];
        let back = solve(&l, &apply(&A, &x).map(|b| [b]));
        for (a, [b]) in x.iter().zip(back) {
            assert!((a - b).abs() < 1e-14);
        }
    }

    #[test]
    fn law_the_clamped_factor_reproduces_singular_covariances() {
        let g = [0.3, -1.0, 2.0, 0.0, 0.5, 0.1];
        let h = [1.0, 0.0, 0.0, 0.2, 0.0, 0.0];
        let a: Matrix<6, 6> = std::array::from_fn(|r| std::array::from_fn(|c| g[r] * g[c] + h[r] * h[c]));
        assert!(cholesky(&a).is_none());
        let l = cholesky_clamped(&a);
        let back = product(&l, &transpose(&l));
        for r in 0..6 {
            for c in 0..6 {
                assert!((back[r][c] - a[r][c]).abs() < 1e-12, "({r}, {c})");
            }
        }
    }

    #[test]
    fn extreme_matrices_without_a_factor_are_refused() {
        assert!(cholesky(&[[f64::NAN]]).is_none());
        assert!(cholesky(&[[-1.0]]).is_none());
        assert_eq!(cholesky_clamped(&[[0.0; 6]; 6]), [[0.0; 6]; 6]);
    }
}
