//! Small dense matrices of f32 and their three products, with the same bits on every CPU.
//!
//! Row-major; each row is padded with zeros to whole chunks. An element of `times` and `transposed_times` is a chain of fused multiply-adds
//! in the order of the inner index; one of `times_transposed` is a sum of chunks in their order, whose lanes are then added as a tree.

use crate::train::filter::lanes::{Isa, Kernel, Real, Simd};

pub(crate) type Chunk = <f32 as Real>::Chunk;
const LANES: usize = <f32 as Real>::LANES;

/// Rows of a result that are formed together, where registers are few and where they are many; both divide the lanes.
const FEW: usize = 4;
const MANY: usize = 8;

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Matrix {
    pub rows: usize,
    pub columns: usize,
    /// Chunks of a row.
    width: usize,
    chunks: Vec<Chunk>,
}

impl Matrix {
    pub(crate) fn zeros(rows: usize, columns: usize) -> Matrix {
        let width = columns.div_ceil(LANES);
        Matrix { rows, columns, width, chunks: vec![Chunk::default(); rows * width] }
    }

    pub(crate) fn identity(size: usize) -> Matrix {
        let mut matrix = Matrix::zeros(size, size);
        (0..size).for_each(|k| matrix.set(k, k, 1.0));
        matrix
    }

    pub(crate) fn row(&self, row: usize) -> &[Chunk] {
        &self.chunks[row * self.width..][..self.width]
    }

    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [Chunk] {
        &mut self.chunks[row * self.width..][..self.width]
    }

    /// The chunks of the rows before a row, and that row.
    pub(crate) fn before_and_row_mut(&mut self, row: usize) -> (&[Chunk], &mut [Chunk]) {
        let (before, rest) = self.chunks.split_at_mut(row * self.width);
        (before, &mut rest[..self.width])
    }

    pub(crate) fn set(&mut self, row: usize, column: usize, value: f32) {
        self.row_mut(row)[column / LANES].as_mut()[column % LANES] = value;
    }

    pub(crate) fn get(&self, row: usize, column: usize) -> f32 {
        self.row(row)[column / LANES].as_ref()[column % LANES]
    }

    /// All elements, row by row, without the padding.
    pub(crate) fn values(&self) -> impl Iterator<Item = f32> {
        (0..self.rows).flat_map(|row| self.row(row).iter().flat_map(|chunk| chunk.as_ref()).take(self.columns).copied())
    }

    /// Takes all elements, row by row.
    pub(crate) fn fill(&mut self, mut values: impl Iterator<Item = f32>) {
        for row in 0..self.rows {
            for column in 0..self.columns {
                self.set(row, column, values.next().expect("an element for each place"));
            }
        }
    }

    /// All elements and the zeros of the padding.
    pub(crate) fn padded(&self) -> impl Iterator<Item = &f32> {
        self.chunks.iter().flat_map(AsRef::as_ref)
    }

    /// Changes each element, and the zeros of the padding, which must stay nought.
    pub(crate) fn change(&mut self, isa: Isa, change: impl Fn(f32) -> f32) {
        isa.run(Change { chunks: &mut self.chunks, change });
    }

    /// The same by the element of another matrix of the size, or of one with more columns.
    pub(crate) fn change_by(&mut self, other: &Matrix, isa: Isa, change: impl Fn(f32, f32) -> f32) {
        assert!(self.rows == other.rows && self.width <= other.width);
        isa.run(ChangeBy { matrix: self, other, change });
    }

    /// Makes what lies behind the last column nought again.
    pub(crate) fn zero_padding(&mut self) {
        let left = self.columns % LANES;
        if left > 0 {
            let last = self.chunks.chunks_exact_mut(self.width).filter_map(<[Chunk]>::last_mut);
            last.for_each(|chunk| chunk.as_mut()[left..].fill(0.0));
        }
    }

    /// `self` becomes a share of itself and the rest of another: (1 - share) self + share other.
    pub(crate) fn update_running_mean(&mut self, other: &Matrix, share: f32, isa: Isa) {
        self.change_by(other, isa, |x, y| x + share * (y - x));
    }

    /// Becomes equal to another of its size, in the memory it has.
    pub(crate) fn copy(&mut self, other: &Matrix) {
        self.chunks.copy_from_slice(&other.chunks);
    }

    /// Becomes the transpose of another, as far as that has columns.
    pub(crate) fn transpose_of(&mut self, other: &Matrix, isa: Isa) {
        assert!(self.columns == other.rows && self.rows <= other.columns);
        isa.run(Transpose { from: other, to: self });
    }
}

struct Change<'a, F> {
    chunks: &'a mut [Chunk],
    change: F,
}

impl<F: Fn(f32) -> f32> Kernel<f32> for Change<'_, F> {
    type Out = ();

    #[inline(always)]
    fn run<V: Simd<f32>>(self) {
        for chunk in self.chunks {
            for lanes in chunk.as_mut().as_chunks_mut::<LANES>().0 {
                *lanes = lanes.map(&self.change);
            }
        }
    }
}

struct ChangeBy<'a, F> {
    matrix: &'a mut Matrix,
    other: &'a Matrix,
    change: F,
}

impl<F: Fn(f32, f32) -> f32> Kernel<f32> for ChangeBy<'_, F> {
    type Out = ();

    #[inline(always)]
    fn run<V: Simd<f32>>(self) {
        let ChangeBy { matrix, other, change } = self;
        let theirs = other.chunks.chunks_exact(other.width.max(1));
        for (mine, theirs) in matrix.chunks.chunks_exact_mut(matrix.width.max(1)).zip(theirs) {
            for (mine, theirs) in mine.iter_mut().zip(theirs) {
                let (mine, theirs) = (mine.as_mut().as_chunks_mut::<LANES>().0, theirs.as_ref().as_chunks::<LANES>().0);
                for (mine, theirs) in mine.iter_mut().zip(theirs) {
                    *mine = std::array::from_fn(|lane| change(mine[lane], theirs[lane]));
                }
            }
        }
    }
}

struct Transpose<'a> {
    from: &'a Matrix,
    to: &'a mut Matrix,
}

impl Kernel<f32> for Transpose<'_> {
    type Out = ();

    /// A chunk of the result at a time.
    #[inline(always)]
    fn run<V: Simd<f32>>(self) {
        let Transpose { from, to } = self;
        for column in 0..to.width {
            let first = column * LANES;
            let count = LANES.min(from.rows - first);
            let rows: [&[Chunk]; LANES] = std::array::from_fn(|lane| from.row(first + lane.min(count - 1)));
            for row in 0..to.rows {
                let (chunk, lane) = (row / LANES, row % LANES);
                let out = to.row_mut(row)[column].as_mut();
                for place in 0..count {
                    out[place] = rows[place][chunk].as_ref()[lane];
                }
            }
        }
    }
}

/// `out` becomes `a b`, worked out in whole chunks of columns, as many as both `b` and `out` have. Where they have different numbers of columns,
/// the columns of the last chunk beyond the smaller number hold zeros or products of what `b` has there, which the caller overwrites; columns beyond
/// that chunk stay as they were.
pub(crate) fn times(a: &Matrix, b: &Matrix, out: &mut Matrix, isa: Isa) {
    assert!(a.columns <= b.rows && a.rows == out.rows);
    isa.run(Times { a, b, out, is_transposed: false });
}

/// `out` becomes the first rows of `a' b`; `a` may have more columns than `out` has rows.
pub(crate) fn transposed_times(a: &Matrix, b: &Matrix, out: &mut Matrix, isa: Isa) {
    assert!(a.rows <= b.rows && a.columns >= out.rows);
    isa.run(Times { a, b, out, is_transposed: true });
}

/// `out` becomes `a b'`.
pub(crate) fn times_transposed(a: &Matrix, b: &Matrix, out: &mut Matrix, isa: Isa) {
    assert!(a.width == b.width && a.rows == out.rows && b.rows == out.columns);
    isa.run(TimesTransposed { a, b, out });
}

struct Times<'a> {
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
        let rows = work.out.rows;
        match (rows, V::MANY) {
            (1, _) => work.strips::<V, 1, FEW>(),
            (_, true) => work.strips::<V, MANY, 2>(),
            (_, false) => work.strips::<V, FEW, 1>(),
        }
    }
}

impl Times<'_> {
    /// The product, tile by tile: of `N` rows and `M` chunks, or those that are left.
    #[inline(always)]
    fn strips<V: Simd<f32>, const N: usize, const M: usize>(&mut self) {
        let width = self.b.width.min(self.out.width);
        for row in (0..self.out.rows).step_by(N) {
            let mut column = 0;
            while column + M <= width {
                self.tile::<V, N, M>(row, column);
                column += M;
            }
            while column < width {
                self.tile::<V, N, 1>(row, column);
                column += 1;
            }
        }
    }

    #[inline(always)]
    fn tile<V: Simd<f32>, const N: usize, const M: usize>(&mut self, row: usize, column: usize) {
        let Times { a, b, .. } = *self;
        let mut sums = [[V::splat(0.0); M]; N];
        if self.is_transposed {
            // N columns of `a` lie in one chunk, because N divides the lanes; those beyond the last are padding.
            let (chunk, lane) = (row / LANES, row % LANES);
            for (left, right) in a.chunks.chunks_exact(a.width).zip(b.chunks.chunks_exact(b.width)) {
                let factors = &left[chunk].as_ref()[lane..lane + N];
                add_products(&mut sums, |n| factors[n], &right[column..column + M]);
            }
        } else {
            // Beyond the last row that row again, which is not kept.
            let last = self.out.rows - 1;
            let rows: [&[Chunk]; N] = std::array::from_fn(|n| a.row((row + n).min(last)));
            for (chunk, right) in b.chunks[..a.columns * b.width].chunks(LANES * b.width).enumerate() {
                let factors: [&[f32]; N] = std::array::from_fn(|n| rows[n][chunk].as_ref());
                for (lane, right) in right.chunks_exact(b.width).enumerate() {
                    add_products(&mut sums, |n| factors[n][lane], &right[column..column + M]);
                }
            }
        }
        for (row, sums) in (row..self.out.rows).zip(sums) {
            let out = &mut self.out.row_mut(row)[column..column + M];
            for (out, sum) in out.iter_mut().zip(sums) {
                sum.store(out);
            }
        }
    }
}

/// Adds `N` numbers times `M` chunks.
#[inline(always)]
fn add_products<V: Simd<f32>, const N: usize, const M: usize>(
    sums: &mut [[V; M]; N],
    factor: impl Fn(usize) -> f32,
    right: &[Chunk],
) {
    let mut chunks = [V::splat(0.0); M];
    for m in 0..M {
        chunks[m] = V::load(&right[m]);
    }
    for (n, sums) in sums.iter_mut().enumerate() {
        let factor = V::splat(factor(n));
        for (sum, chunk) in sums.iter_mut().zip(chunks) {
            *sum = factor.mul_add(chunk, *sum);
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
