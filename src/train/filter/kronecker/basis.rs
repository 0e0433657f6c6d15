//! A covariance and an orthonormal basis -> one that is nearer to its eigenvectors.
//!
//! One power step and an orthogonalisation (Gram-Schmidt, twice), the vectors in the order in which they stand: repeated, it sorts them by
//! eigenvalue. Vectors are the rows of a matrix. Where a vector vanishes or lies within those before it, the old one takes its
//! place, or an axis: the result is orthonormal whatever the covariance, one of zeros and one of rank 1 among them.

use crate::train::filter::lanes::{Isa, Kernel, Real, Simd};
use crate::train::network::matrix::{Chunk, Matrix, times};

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
    isa.run(Orthonormal { vectors, place })
}

struct Orthonormal<'a> {
    vectors: &'a mut Matrix,
    place: usize,
}

/// Vectors that are taken out of another together: their parts of it are sums that do not wait for one another.
const TOGETHER: usize = 4;

impl Kernel<f32> for Orthonormal<'_> {
    type Out = bool;

    #[inline(always)]
    fn run<V: Simd<f32>>(self) -> bool {
        // Loops in place of closures: intrinsics within a closure are not inlined into it.
        let (before, own) = self.vectors.before_and_row_mut(self.place);
        if !normalised::<V>(own) {
            return false;
        }
        for _ in 0..2 {
            for others in before.chunks(TOGETHER * own.len()) {
                let several = others.len() / own.len();
                // Beyond the last vector that one again, of which nothing is taken.
                let others: [&[Chunk]; TOGETHER] =
                    std::array::from_fn(|n| &others[n.min(several - 1) * own.len()..][..own.len()]);
                let mut sums = [V::splat(0.0); TOGETHER];
                for (place, x) in own.iter().enumerate() {
                    let x = V::load(x);
                    for n in 0..TOGETHER {
                        sums[n] = V::load(&others[n][place]).mul_add(x, sums[n]);
                    }
                }
                let along = V::sums(sums);
                for (place, x) in own.iter_mut().enumerate() {
                    let mut rest = V::load(x);
                    for n in 0..several {
                        rest = V::splat(along[n]).neg_mul_add(V::load(&others[n][place]), rest);
                    }
                    rest.store(x);
                }
            }
            if square::<V>(own) <= LEFT || !normalised::<V>(own) {
                return false;
            }
        }
        true
    }
}

#[inline(always)]
fn square<V: Simd<f32>>(vector: &[Chunk]) -> f32 {
    let mut sum = V::splat(0.0);
    for x in vector {
        sum = V::load(x).mul_add(V::load(x), sum);
    }
    sum.sum()
}

/// Makes a vector's length 1; false where it has none.
#[inline(always)]
fn normalised<V: Simd<f32>>(vector: &mut [Chunk]) -> bool {
    // The greatest element first: squares of the elements of a covariance may be too small or too large for f32.
    let mut most = [0.0_f32; <f32 as Real>::LANES];
    for chunk in vector.iter() {
        most.iter_mut().zip(chunk.as_ref()).for_each(|(most, x)| *most = most.max(x.abs()));
    }
    let most = most.into_iter().fold(0.0, f32::max);
    if !(most > f32::MIN_POSITIVE && most < f32::INFINITY) {
        return false;
    }
    vector.iter_mut().for_each(|chunk| chunk.as_mut().iter_mut().for_each(|x| *x /= most));
    let length = square::<V>(vector).sqrt();
    vector.iter_mut().for_each(|chunk| chunk.as_mut().iter_mut().for_each(|x| *x /= length));
    true
}
