//! The pass of mini-batches: several pending vectors, several Jacobians.

use super::{Covariance, rows};
use crate::train::filter::lanes::{Real, Simd};
use crate::train::filter::triangle::{self, Masks, ROWS, Tile};

impl<T: Real> Covariance<T> {
    /// One strip: first all pending vectors, then one Jacobian after the other while the strip is in the nearest cache.
    #[inline(always)]
    pub(super) fn joint<V: Simd<T>>(&mut self, strip: usize, count: usize, q: T, masks: &Masks<T::Chunk>) {
        let (first, tiles) = (triangle::start::<T>(strip), triangle::width::<T>(strip));
        let strip_tiles = &mut self.triangle.tiles[first..first + tiles];
        for j in 0..self.rank {
            let t = &self.pending[j * self.width..][..self.width];
            subtract::<T, V>(strip_tiles, &rows::<T, V>(t, strip), t, masks);
        }
        let last = &mut strip_tiles[tiles - 1];
        for r in 0..ROWS {
            V::splat(q).mul_add(V::load(&masks.diagonal[r]), V::load(&last.0[r])).store(&mut last.0[r]);
        }
        for j in 0..count {
            let b = &self.jacobian[j * self.width..][..self.width];
            let y = &mut self.product[j * self.width..][..self.width];
            let sums = multiply::<T, V>(strip_tiles, &rows::<T, V>(b, strip), b, y, masks);
            let at = ROWS * strip;
            let four = &mut y[at / T::LANES].as_mut()[at % T::LANES..][..ROWS];
            for r in 0..ROWS {
                four[r] = four[r] + sums[r].sum();
            }
        }
    }
}

/// P -= t t' in one strip.
#[inline(always)]
fn subtract<T: Real, V: Simd<T>>(
    tiles: &mut [Tile<T::Chunk>],
    t_rows: &[V; ROWS],
    t: &[T::Chunk],
    masks: &Masks<T::Chunk>,
) {
    let (last, body) = tiles.split_last_mut().expect("a strip has a tile");
    for (tile, t) in body.iter_mut().zip(t) {
        let t = V::load(t);
        for (p, t_row) in tile.0.iter_mut().zip(t_rows) {
            t_row.neg_mul_add(t, V::load(p)).store(p);
        }
    }
    let t = V::load(&t[body.len()]);
    for ((p, t_row), lower) in last.0.iter_mut().zip(t_rows).zip(&masks.lower) {
        t_row.neg_mul_add(t.mul(V::load(lower)), V::load(p)).store(p);
    }
}

/// Adds a strip's part of P b to y, but for the sums along its rows, which it returns.
#[inline(always)]
fn multiply<T: Real, V: Simd<T>>(
    tiles: &[Tile<T::Chunk>],
    b_rows: &[V; ROWS],
    b: &[T::Chunk],
    y: &mut [T::Chunk],
    masks: &Masks<T::Chunk>,
) -> [V; ROWS] {
    let mut sums = [V::splat(T::of(0.0)); ROWS];
    let (last, body) = tiles.split_last().expect("a strip has a tile");
    for (tile, (b, y)) in body.iter().zip(b.iter().zip(y.iter_mut())) {
        let b = V::load(b);
        let mut down = V::load(y);
        for r in 0..ROWS {
            let p = V::load(&tile.0[r]);
            sums[r] = p.mul_add(b, sums[r]);
            down = p.mul_add(b_rows[r], down);
        }
        down.store(y);
    }
    let b = V::load(&b[body.len()]);
    let mut down = V::load(&y[body.len()]);
    for r in 0..ROWS {
        let p = V::load(&last.0[r]);
        sums[r] = p.mul_add(b, sums[r]);
        down = p.mul_add(b_rows[r].mul(V::load(&masks.strict[r])), down);
    }
    down.store(&mut y[body.len()]);
    sums
}
