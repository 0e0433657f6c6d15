//! Heights on a grid -> the least-squares polynomial of total degree n.
//!
//! In: heights at the middles of m x m equal cells of the fitted square. Out: [`Polynomial`] in orthonormal Legendre form.
//! Method: the Legendre columns of *one* axis are made orthonormal over the nodes (QR by modified Gram-Schmidt, twice), and
//! the products q_i(u) q_j(v), i + j <= n, are then orthonormal over the grid and span the same space. So each
//! coefficient is one sum, as exact as a QR of the whole m^2 x 91 matrix and a thousand times cheaper; the triangular
//! factors carry the result back to the Legendre basis. No normal equations: the columns' condition is below 1.5.
//! Source: separable least squares on a lattice (Gram polynomials; Björck, *Numerical Methods for Least Squares Problems*).

use super::legendre::{self, MAX_DEGREE, Row};
use super::polynomial::{FIT_MARGIN, Polynomial, terms};

/// Nodes per side that hold the condition of every degree: more where the field is rough.
pub(super) const MIN_NODES: usize = 64;

/// Columns q_0 ... q_n over the nodes, and the upper triangle R^-1 with q_i = sum over a <= i of p_a R^-1[a][i].
struct Orthonormal {
    columns: Vec<Vec<f64>>,
    from_legendre: [Row; MAX_DEGREE + 1],
}

/// The middle of cell k of `nodes` equal cells of [-1, 1].
fn middle(k: usize, nodes: usize) -> f64 {
    (2 * k + 1) as f64 / nodes as f64 - 1.0
}

fn mean_product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len() as f64
}

impl Orthonormal {
    fn new(degree: usize, nodes: usize) -> Orthonormal {
        let values: Vec<Row> = (0..nodes).map(|k| legendre::values(degree, middle(k, nodes))).collect();
        let mut columns: Vec<Vec<f64>> = Vec::with_capacity(degree + 1);
        let mut from_legendre = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
        for i in 0..=degree {
            let mut column: Vec<f64> = values.iter().map(|p| p[i]).collect();
            let mut weights = [0.0; MAX_DEGREE + 1];
            weights[i] = 1.0;
            // Twice is enough (Kahan, Parlett).
            for _ in 0..2 {
                for (j, before) in columns.iter().enumerate() {
                    let share = mean_product(&column, before);
                    column.iter_mut().zip(before).for_each(|(c, b)| *c -= share * b);
                    (0..=j).for_each(|a| weights[a] -= share * from_legendre[a][j]);
                }
            }
            let length = mean_product(&column, &column).sqrt();
            column.iter_mut().for_each(|c| *c /= length);
            (0..=i).for_each(|a| from_legendre[a][i] = weights[a] / length);
            columns.push(column);
        }
        Orthonormal { columns, from_legendre }
    }
}

impl Polynomial {
    /// The least-squares polynomial of heights at the middles of `nodes` x `nodes` cells of the fitted square (1.2 times the
    /// yard [0, extent]^2), row by row from the south.
    ///
    /// # Panics
    /// Where the degree is above 12, a side has no more nodes than the degree, or the number of heights does not fit.
    pub fn fit(extent_m: f64, degree: usize, nodes: usize, heights_m: &[f64]) -> Polynomial {
        assert!(
            degree <= MAX_DEGREE && nodes > degree && heights_m.len() == nodes * nodes,
            "{nodes} nodes, degree {degree}"
        );
        let Orthonormal { columns, from_legendre } = Orthonormal::new(degree, nodes);
        // Along x, row by row: along_x[i][row]; then along y: inner[i][j].
        let mut along_x = vec![vec![0.0; nodes]; degree + 1];
        for (row, heights_m) in heights_m.chunks_exact(nodes).enumerate() {
            for (i, column) in columns.iter().enumerate() {
                along_x[i][row] = mean_product(heights_m, column);
            }
        }
        let mut inner = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
        for (i, j) in terms(degree) {
            inner[i][j] = mean_product(&along_x[i], &columns[j]);
        }
        let coefficient = |(a, b): (usize, usize)| -> f64 {
            (a..=degree - b)
                .map(|i| {
                    let along_y: f64 = (b..=degree - i).map(|j| inner[i][j] * from_legendre[b][j]).sum();
                    from_legendre[a][i] * along_y
                })
                .sum()
        };
        Polynomial::new(extent_m, degree, terms(degree).map(coefficient).collect())
    }

    /// The least-squares polynomial of a surface given as a function of world x and y on the fitted square.
    pub(crate) fn fit_surface(
        extent_m: f64,
        degree: usize,
        nodes: usize,
        height_m: impl Fn(f64, f64) -> f64,
    ) -> Polynomial {
        let place = |k: usize| 0.5 * extent_m * (1.0 + FIT_MARGIN * middle(k, nodes));
        let heights_m: Vec<f64> = (0..nodes * nodes).map(|k| height_m(place(k % nodes), place(k / nodes))).collect();
        Polynomial::fit(extent_m, degree, nodes, &heights_m)
    }
}

#[cfg(test)]
mod tests {
    use super::super::polynomial::{term_count, tests::sample};
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// The design matrix of the orthonormal Legendre basis on the grid, each entry over the root of the number of nodes.
    fn design(degree: usize, nodes: usize) -> DMatrix<f64> {
        let values: Vec<Row> = (0..nodes).map(|k| legendre::values(degree, middle(k, nodes))).collect();
        let terms: Vec<(usize, usize)> = terms(degree).collect();
        DMatrix::from_fn(nodes * nodes, terms.len(), |node, term| {
            values[node % nodes][terms[term].0] * values[node / nodes][terms[term].1] / nodes as f64
        })
    }

    #[test]
    fn law_the_legendre_basis_is_well_conditioned_on_every_grid() {
        for (degree, nodes) in [(2, 64), (5, 64), (12, 64), (12, 100)] {
            let matrix = design(degree, nodes);
            let eigenvalues = (matrix.transpose() * &matrix).symmetric_eigenvalues();
            let condition = (eigenvalues.max() / eigenvalues.min()).sqrt();
            assert!(condition < 4.0, "degree {degree}, {nodes} nodes: {condition}");
        }
    }

    #[test]
    fn exact_a_polynomial_is_its_own_fit() {
        for degree in [2, 5, 12] {
            let surface = sample(degree);
            let fit = Polynomial::fit_surface(20.0, degree, MIN_NODES, |x, y| surface.height_m(x, y));
            for (a, b) in fit.coefficients.iter().zip(&surface.coefficients) {
                assert!((a - b).abs() < 1e-13, "degree {degree}: {a} {b}");
            }
        }
    }

    #[test]
    fn equal_fit_and_a_qr_of_the_whole_matrix() {
        let (degree, nodes) = (7, 24);
        let rough = |k: usize| crate::math::sin(k as f64 * k as f64);
        let heights_m: Vec<f64> = (0..nodes * nodes).map(rough).collect();
        let fit = Polynomial::fit(20.0, degree, nodes, &heights_m);
        let qr = design(degree, nodes).qr();
        let right = qr.q().transpose() * DVector::from_fn(nodes * nodes, |k, _| heights_m[k] / nodes as f64);
        let expected = qr.r().solve_upper_triangular(&right).unwrap();
        assert_eq!(expected.len(), term_count(degree));
        for (a, b) in fit.coefficients.iter().zip(expected.iter()) {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
    }
}
