//! A covariance and an orthonormal basis -> one that is nearer to its eigenvectors.
//!
//! One power step and an orthogonalisation (Gram-Schmidt, twice), the vectors in the order in which they stand: repeated, it sorts them by
//! eigenvalue. Vectors are the rows of a matrix. Where a vector vanishes or lies within those before it, the old one takes its
//! place, or an axis: the result is orthonormal whatever the covariance, one of zeros and one of rank 1 among them.

use super::matrix::{Matrix, dot, times};
use crate::train::filter::lanes::Isa;

/// Of a vector's square, what has to be left after the others are taken out of it.
const LEFT: f32 = 1e-8;

/// `basis` after the step; `scratch` has its size.
pub(super) fn turn_to_eigenvectors(covariance: &Matrix, basis: &mut Matrix, scratch: &mut Matrix, isa: Isa) {
    times(basis, covariance, scratch, isa);
    for place in 0..basis.rows {
        let is_kept = orthonormal(scratch, place, isa) || {
            scratch.row_mut(place).copy_from_slice(basis.row(place));
            orthonormal(scratch, place, isa)
        };
        if !is_kept {
            // Of the axes at least one stands out of what fewer vectors than axes span, by 1 / sqrt(axes) or more.
            let is_found = (0..basis.rows).any(|axis| {
                scratch.row_mut(place).fill(Default::default());
                scratch.set(place, axis, 1.0);
                orthonormal(scratch, place, isa)
            });
            debug_assert!(is_found, "an axis stands out");
        }
    }
    std::mem::swap(basis, scratch);
}

/// Makes the vector at `place` orthonormal to those before it; false where nothing of it is left.
fn orthonormal(vectors: &mut Matrix, place: usize, isa: Isa) -> bool {
    if !normalised(vectors, place, isa) {
        return false;
    }
    for _ in 0..2 {
        let (before, own) = vectors.before_and_row_mut(place);
        for other in before {
            let along = dot(other, own, isa);
            for (x, y) in own.iter_mut().zip(other) {
                x.as_mut().iter_mut().zip(y.as_ref()).for_each(|(x, y)| *x -= along * y);
            }
        }
        let left = dot(vectors.row(place), vectors.row(place), isa);
        if left <= LEFT || !normalised(vectors, place, isa) {
            return false;
        }
    }
    true
}

fn normalised(vectors: &mut Matrix, place: usize, isa: Isa) -> bool {
    // The greatest element first: squares of the elements of a covariance may be too small or too large for f32.
    let most = vectors.row(place).iter().flat_map(|x| x.as_ref()).fold(0.0_f32, |most, x| most.max(x.abs()));
    if !(most > f32::MIN_POSITIVE && most < f32::INFINITY) {
        return false;
    }
    for x in vectors.row_mut(place).iter_mut().flat_map(AsMut::as_mut) {
        *x /= most;
    }
    let length = dot(vectors.row(place), vectors.row(place), isa).sqrt();
    vectors.row_mut(place).iter_mut().flat_map(AsMut::as_mut).for_each(|x| *x /= length);
    true
}
