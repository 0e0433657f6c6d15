//! A packed lower triangle in the order in which kernels read it.
//!
//! Rows stand in strips of four; a strip is a run of tiles, four rows by one chunk of columns, from column 0 to its diagonal. So
//! a pass is one stream through memory. The place right of the diagonal in the last tile of a strip holds zeros. On disk: row by
//! row, `(0,0) (1,0) (1,1) (2,0) ...`.

use super::lanes::{Real, Simd};

/// Rows of a strip.
pub(super) const ROWS: usize = 4;

/// Four rows by one chunk of columns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct CovarianceBlock<C>(pub [C; ROWS]);

/// Lower triangle of a `size` x `size` matrix.
#[derive(Clone, Debug)]
pub(crate) struct Triangle<T: Real> {
    size: usize,
    pub tiles: Vec<CovarianceBlock<T::Chunk>>,
}

/// For the last tile of a strip: 1 where the column is below, at, or at most the row, else 0.
pub(crate) struct Masks<C> {
    pub strict: [C; ROWS],
    pub diagonal: [C; ROWS],
    pub lower: [C; ROWS],
}

/// Chunks that a vector of `size` elements takes up, padded to whole strips.
pub(super) fn chunks<T: Real>(size: usize) -> usize {
    size.next_multiple_of(ROWS).div_ceil(T::LANES)
}

/// Tiles of a strip.
#[inline(always)]
pub(super) fn width<T: Real>(strip: usize) -> usize {
    (ROWS * strip + ROWS - 1) / T::LANES + 1
}

/// Tiles before a strip.
#[inline(always)]
pub(super) fn start<T: Real>(strip: usize) -> usize {
    let turn = T::LANES / ROWS;
    let (full, rest) = (strip / turn, strip % turn);
    turn * full * (full + 1) / 2 + rest * (full + 1)
}

impl<T: Real> Triangle<T> {
    pub(super) fn diagonal(size: usize, value: f64) -> Triangle<T> {
        let mut triangle = Triangle { size, tiles: Vec::new() };
        triangle.tiles.resize(start::<T>(triangle.strips()), CovarianceBlock::default());
        for i in 0..size {
            triangle.set(i, i, T::of(value));
        }
        triangle
    }

    pub(crate) fn strips(&self) -> usize {
        self.size.div_ceil(ROWS)
    }

    fn place(row: usize, column: usize) -> (usize, usize, usize) {
        (start::<T>(row / ROWS) + column / T::LANES, row % ROWS, column % T::LANES)
    }

    /// The element of a row and a column at most the row.
    pub(super) fn get(&self, row: usize, column: usize) -> T {
        let (tile, r, lane) = Self::place(row, column);
        self.tiles[tile].0[r].as_ref()[lane]
    }

    pub(super) fn set(&mut self, row: usize, column: usize, value: T) {
        let (tile, r, lane) = Self::place(row, column);
        self.tiles[tile].0[r].as_mut()[lane] = value;
    }

    /// Elements row by row.
    pub(crate) fn elements(&self) -> impl Iterator<Item = T> + '_ {
        (0..self.size).flat_map(move |i| (0..=i).map(move |j| self.get(i, j)))
    }

    /// Number of elements.
    pub(super) fn count(&self) -> usize {
        self.size * (self.size + 1) / 2
    }

    pub(crate) fn set_elements(&mut self, mut elements: impl Iterator<Item = T>) {
        for i in 0..self.size {
            for (j, value) in (0..=i).zip(&mut elements) {
                self.set(i, j, value);
            }
        }
    }

    pub(crate) fn masks(strip: usize) -> Masks<T::Chunk> {
        let first = (ROWS * strip) % T::LANES;
        let mask = |keep: fn(usize, usize) -> bool| {
            let mut rows = [T::Chunk::splat(T::of(0.0)); ROWS];
            for (r, row) in rows.iter_mut().enumerate() {
                for (lane, value) in row.as_mut().iter_mut().enumerate() {
                    *value = T::of(f64::from(u8::from(keep(lane, first + r))));
                }
            }
            rows
        };
        Masks { strict: mask(|c, r| c < r), diagonal: mask(|c, r| c == r), lower: mask(|c, r| c <= r) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order<T: Real>() {
        let mut next = 0;
        for strip in 0..40 {
            assert_eq!(start::<T>(strip), next);
            next += width::<T>(strip);
        }
        let mut triangle = Triangle::<T>::diagonal(37, 0.0);
        assert_eq!(triangle.tiles.len(), start::<T>(10));
        triangle.set_elements((0..37 * 38 / 2).map(|k| T::of(f64::from(k))));
        assert_eq!(triangle.get(36, 0), T::of(36.0 * 37.0 / 2.0));
        assert!(triangle.elements().zip(0..).all(|(x, k)| x == T::of(f64::from(k))));
    }

    #[test]
    fn order_strips_follow_one_another_and_elements_come_row_by_row() {
        order::<f32>();
        order::<f64>();
    }
}
