//! Small dense matrices of f32 and their three products, with the same bits on every CPU.
//!
//! Row-major; each row is padded with zeros to whole chunks. An element of `times` and `transposed_times` is a chain of fused multiply-adds
//! in the order of the inner index; one of `times_transposed` is a sum of chunks in their order, whose lanes are then added as a tree.

use crate::train::filter::lanes::{Isa, Kernel, Real, Simd};

type Chunk = <f32 as Real>::Chunk;
const LANES: usize = <f32 as Real>::LANES;

/// Rows of a result that are formed together: as many as registers hold.
const FEW: usize = 4;
const MANY: usize = 8;

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Matrix {
    pub rows: usize,
    pub columns: usize,
    /// Chunks of a row.
    width: usize,
    chunks: Vec<Chunk>,
}

impl Matrix {
    pub(super) fn zeros(rows: usize, columns: usize) -> Matrix {
        let width = columns.div_ceil(LANES);
        Matrix { rows, columns, width, chunks: vec![Chunk::default(); rows * width] }
    }

    pub(super) fn identity(size: usize) -> Matrix {
        let mut matrix = Matrix::zeros(size, size);
        (0..size).for_each(|k| matrix.set(k, k, 1.0));
        matrix
    }

    pub(super) fn row(&self, row: usize) -> &[Chunk] {
        &self.chunks[row * self.width..][..self.width]
    }

    pub(super) fn row_mut(&mut self, row: usize) -> &mut [Chunk] {
        &mut self.chunks[row * self.width..][..self.width]
    }

    /// The rows before a row, and that row.
    pub(super) fn before_and_row_mut(&mut self, row: usize) -> (impl Iterator<Item = &[Chunk]>, &mut [Chunk]) {
        let (before, rest) = self.chunks.split_at_mut(row * self.width);
        (before.chunks_exact(self.width.max(1)), &mut rest[..self.width])
    }

    pub(super) fn set(&mut self, row: usize, column: usize, value: f32) {
        self.row_mut(row)[column / LANES].as_mut()[column % LANES] = value;
    }

    pub(super) fn get(&self, row: usize, column: usize) -> f32 {
        self.row(row)[column / LANES].as_ref()[column % LANES]
    }

    /// All elements, row by row, without the padding.
    pub(super) fn values(&self) -> impl Iterator<Item = f32> {
        (0..self.rows).flat_map(|row| self.row(row).iter().flat_map(|chunk| chunk.as_ref()).take(self.columns).copied())
    }

    /// Takes all elements, row by row.
    pub(super) fn fill(&mut self, mut values: impl Iterator<Item = f32>) {
        for row in 0..self.rows {
            for column in 0..self.columns {
                self.set(row, column, values.next().expect("an element for each place"));
            }
        }
    }

    /// All elements and the zeros of the padding, for what is done to each alike; what is done must leave nought nought.
    pub(super) fn padded(&self) -> impl Iterator<Item = &f32> {
        self.chunks.iter().flat_map(AsRef::as_ref)
    }

    /// As [`Matrix::padded`], to be changed.
    pub(super) fn padded_mut(&mut self) -> impl Iterator<Item = &mut f32> {
        self.chunks.iter_mut().flat_map(AsMut::as_mut)
    }

    /// `self` becomes a share of itself and the rest of another: (1 - share) self + share other.
    pub(super) fn update_running_mean(&mut self, other: &Matrix, share: f32) {
        for (mine, theirs) in self.chunks.iter_mut().zip(&other.chunks) {
            for (x, y) in mine.as_mut().iter_mut().zip(theirs.as_ref()) {
                *x += share * (y - *x);
            }
        }
    }

    /// Adds another.
    pub(super) fn add(&mut self, other: &Matrix) {
        for (mine, theirs) in self.chunks.iter_mut().zip(&other.chunks) {
            mine.as_mut().iter_mut().zip(theirs.as_ref()).for_each(|(x, y)| *x += y);
        }
    }
}

/// The first rows of `out` become `a b`; `a` may have fewer rows than `out`.
pub(super) fn times(a: &Matrix, b: &Matrix, out: &mut Matrix, isa: Isa) {
    assert!(a.columns <= b.rows && a.rows <= out.rows && b.width == out.width);
    isa.run(Times { rows: a.rows, a, b, out, is_transposed: false });
}

/// `out` becomes the first rows of `a' b`; `a` may have more columns than `out` has rows.
pub(super) fn transposed_times(a: &Matrix, b: &Matrix, out: &mut Matrix, isa: Isa) {
    assert!(a.rows <= b.rows && a.columns >= out.rows && b.width == out.width);
    isa.run(Times { rows: out.rows, a, b, out, is_transposed: true });
}

/// `out` becomes `a b'`.
pub(super) fn times_transposed(a: &Matrix, b: &Matrix, out: &mut Matrix, isa: Isa) {
    assert!(a.width == b.width && a.rows == out.rows && b.rows == out.columns);
    isa.run(TimesTransposed { a, b, out });
}

struct Times<'a> {
    rows: usize,
    a: &'a Matrix,
    b: &'a Matrix,
    out: &'a mut Matrix,
    is_transposed: bool,
}

impl Kernel<f32> for Times<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Simd<f32>>(self) {
        let mut work = self;
        if V::MANY {
            (0..work.rows).step_by(MANY).for_each(|row| work.strip::<V, MANY>(row));
        } else {
            (0..work.rows).step_by(FEW).for_each(|row| work.strip::<V, FEW>(row));
        }
    }
}

impl Times<'_> {
    /// `N` rows of the product, or those that there are.
    #[inline(always)]
    fn strip<V: Simd<f32>, const N: usize>(&mut self, row: usize) {
        let Times { a, b, .. } = *self;
        let kept = N.min(self.rows - row);
        for column in 0..b.width {
            let mut sums = [V::splat(0.0); N];
            if self.is_transposed {
                // N columns of `a` lie in one chunk, because N divides the lanes; those beyond the last are padding.
                let (chunk, lane) = (row / LANES, row % LANES);
                for k in 0..a.rows {
                    let factors = &a.row(k)[chunk].as_ref()[lane..lane + N];
                    let right = V::load(&b.row(k)[column]);
                    for n in 0..N {
                        sums[n] = V::splat(factors[n]).mul_add(right, sums[n]);
                    }
                }
            } else {
                // Beyond the last row that row again, which is not kept.
                let rows: [&[Chunk]; N] = std::array::from_fn(|n| a.row(row + n.min(kept - 1)));
                for k in 0..a.columns {
                    let right = V::load(&b.row(k)[column]);
                    for n in 0..N {
                        sums[n] = V::splat(rows[n][k / LANES].as_ref()[k % LANES]).mul_add(right, sums[n]);
                    }
                }
            }
            for (n, sum) in sums.into_iter().enumerate().take(kept) {
                sum.store(&mut self.out.row_mut(row + n)[column]);
            }
        }
    }
}

struct TimesTransposed<'a> {
    a: &'a Matrix,
    b: &'a Matrix,
    out: &'a mut Matrix,
}

impl Kernel<f32> for TimesTransposed<'_> {
    type Out = ();

    /// Two rows by four columns of the result at a time.
    #[inline(always)]
    fn run<V: Simd<f32>>(self) {
        let TimesTransposed { a, b, out } = self;
        for i in (0..a.rows).step_by(2) {
            let rows = [a.row(i), a.row((i + 1).min(a.rows - 1))];
            for j in (0..b.rows).step_by(4) {
                let columns: [&[Chunk]; 4] = std::array::from_fn(|n| b.row((j + n).min(b.rows - 1)));
                let mut sums = [[V::splat(0.0); 4]; 2];
                for chunk in 0..a.width {
                    let left = [V::load(&rows[0][chunk]), V::load(&rows[1][chunk])];
                    for n in 0..4 {
                        let right = V::load(&columns[n][chunk]);
                        for m in 0..2 {
                            sums[m][n] = left[m].mul_add(right, sums[m][n]);
                        }
                    }
                }
                for (m, four) in sums.into_iter().enumerate().take(a.rows - i) {
                    let four = V::sums(four);
                    for (n, sum) in four.into_iter().enumerate().take(b.rows - j) {
                        out.set(i + m, j + n, sum);
                    }
                }
            }
        }
    }
}

/// The sum of the products of two rows.
pub(super) fn dot(a: &[Chunk], b: &[Chunk], isa: Isa) -> f32 {
    isa.run(Dot { a, b })
}

struct Dot<'a> {
    a: &'a [Chunk],
    b: &'a [Chunk],
}

impl Kernel<f32> for Dot<'_> {
    type Out = f32;

    #[inline(always)]
    fn run<V: Simd<f32>>(self) -> f32 {
        let sum = self.a.iter().zip(self.b).fold(V::splat(0.0), |sum, (a, b)| V::load(a).mul_add(V::load(b), sum));
        sum.sum()
    }
}
